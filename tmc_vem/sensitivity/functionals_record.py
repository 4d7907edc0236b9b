"""Scalar results as functions of a state and of parameters: what their derivatives consist of.

At an equilibrium R(u, p) = 0 (free degrees of freedom) a result is v(u, p) = j(u, p) + w . R(u, p), with w at
constrained degrees of freedom only: reactions. The adjoint field L then gives

    dv/dp = dj/dp + L . dR/dp,    K_ff L_f = -(dj/du_f + K_fc w),    L_c = w.

What j has of parameters directly is said cell by cell (:class:`CellParts`), by what a discretisation can differentiate:

    dv/dp_c = energy_weight_c dpsi_c/dp + (L + field on the chosen cells) . dR_c/dp + direct_ck.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tmc_vem.simulation.reading import Behind
from tmc_vem.support.distributed import Vec
from tmc_vem.system.control import Control

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]


@dataclass(frozen=True)
class FunctionalState:
    """A converged state.

    Attributes:
        u: displacements.
        residual: full gradient of the potential there, reactions included.
        position: where on the path it is.
        behind: tells whether the second of two points is behind the surface of the first, where surfaces cross.
    """

    u: Vec
    residual: Vec
    position: Control
    behind: Behind | None = None


@dataclass(frozen=True)
class Direct:
    """Derivatives by what some cells of one region have of parameters: of j with u held, or of a result in all.

    Attributes:
        region: its name.
        cells: (n_cells,) which of this rank's cells.
        names: parameters of the region's energy, in the kernel's order.
        values_ck: (n_cells, n_names) derivatives by the values of the parameters in each cell.
    """

    region: str
    cells: Int
    names: tuple[str, ...]
    values_ck: Float


@dataclass(frozen=True)
class CellParts:
    """What j has of parameters, u held, by the cells of this rank.

    Attributes:
        energy_weight_c: (n_cells,) what the energy of each cell is multiplied with in j; None is 0.
        chosen_c: (n_cells,) cells whose residual alone, times the field, is in j; None are none.
        field: the field, a vector of the system.
        direct: all else.
    """

    energy_weight_c: Float | None = None
    chosen_c: Bool | None = None
    field: Vec | None = None
    direct: Sequence[Direct] = ()


@dataclass(frozen=True)
class Derivative:
    """A result at a state, and its derivatives there; equal on all ranks but for the parts of each.

    Attributes:
        value: v.
        by_u: dj/du, a vector of the system, along the axes of its degrees of freedom.
        on_residual: w, a vector of the system; None is 0.
        by_cells: what j has of parameters directly; None is nothing.
        by_forces: dj/df by the forces that act at the nodes, u held, a vector of the system; None is 0.
        per_load: of j by the load factor, u and these forces held.
        reads_loads: whether j depends on the numbers of loads besides, u and these forces held.
    """

    value: float
    by_u: Vec
    on_residual: Vec | None = None
    by_cells: CellParts | None = None
    by_forces: Vec | None = None
    per_load: float = 0.0
    reads_loads: bool = False


class Functional(Protocol):
    """A scalar result."""

    @property
    def words(self) -> str:
        """What it is called in a message."""

    def derivative(self, state: FunctionalState) -> Derivative:
        """Value and derivatives at a state; called by all ranks together.

        Raises:
            InputError: it has no derivative there; the message says why and what has one.
        """
