"""What both discretisations say of how energies and residuals of their cells change with parameters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.system.point_states import PointStates

Float = NDArray[np.float64]
Int = NDArray[np.int64]

# Forces at the points of some cells: on gradients P_cqij, and on second gradients T_cqijk or None; None where there are
# none at all.
PointForces = Callable[[PointStates], tuple[Float, Float | None] | None]


@dataclass(frozen=True)
class CellDerivatives:
    """Some cells of one region: derivatives with respect to the value that each parameter has in each cell.

    Attributes:
        region: its name.
        cells: (n_cells,) which of this rank's cells.
        names: (n_names,) parameters of the region's energy, in the kernel's order.
        energy_ck: (n_cells, n_names) of the cell's energy.
        residual_ck: (n_cells, n_names) of the product of an adjoint field and the cell's residual; 0 without a field.
    """

    region: str
    cells: Int
    names: tuple[str, ...]
    energy_ck: Float
    residual_ck: Float
