"""States at quadrature points, as both discretisations give them: what stresses and all other fields are made of.

Axes in names: c cells, q quadrature points, x coordinates, i components of the displacement, j and k derivatives.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]
Int = NDArray[np.int64]


@dataclass(frozen=True)
class PointStates:
    """Some cells of one region at a state, each with equally many quadrature points.

    Attributes:
        region: its name.
        cells: (n_cells,) which of this rank's cells.
        w_cq: (n_cells, n_points) quadrature weights, reference area.
        X_cqx: (n_cells, n_points, 2) points of the reference configuration.
        F_cqij: (n_cells, n_points, 2, 2) deformation gradient ``dx_i / dX_j``; of virtual elements, the projected one.
        G_cqijk: (n_cells, n_points, 2, 2, 2) second gradient of the displacement, if the energy has it.
        parameters: of the energy by name: numbers, or (n_cells, 1) of those that vary from cell to cell.
    """

    region: str
    cells: Int
    w_cq: Float
    X_cqx: Float
    F_cqij: Float
    G_cqijk: Float | None
    parameters: Mapping[str, float | Float]
