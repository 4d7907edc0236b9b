"""Friction of finite elements: the slip systems of a load step as a function at quadrature points, which forms read."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.fem import compat
from tmc_vem.fem.mesh import FemMesh
from tmc_vem.system.friction import N_ENTRIES, FrictionLaw, FrictionStates, SlipSystem
from tmc_vem.system.point_states import PointStates

Float = NDArray[np.float64]
Int = NDArray[np.int64]

# Where the values of a point stand, after the four of A by columns: the entries of a slip system, and the part of the
# stiffness that tangents have where it slips, which is the same everywhere.
AH, BOUND, STIFFNESS, TAU, DAMPING, N_VALUES = 4, 5, 6, 7, 8, 9


class PointFriction:
    """Slip systems at the quadrature points of this rank's cells; there are none yet in the undeformed state.

    Its degree has to be that of the cells' integrals: a function at quadrature points has no values elsewhere.

    Args:
        mesh: of this rank.
        degree: of the quadrature.
        laws: friction by region, of the regions that have some.
    """

    def __init__(self, mesh: FemMesh, degree: int, laws: Mapping[str, FrictionLaw]) -> None:
        self.laws = laws
        self._mesh, self._degree = mesh, degree

    def shear_work(self, u: Any, v: Any) -> Any:
        """``tau A : grad v``, the virtual work of friction."""
        import ufl

        k, trial = self._function, self._trial(u)
        below = ufl.conditional(ufl.lt(trial, k[BOUND]), trial, k[BOUND])
        tau = ufl.conditional(ufl.gt(below, -k[BOUND]), below, -k[BOUND])
        return tau * self._along(v)

    def shear_stiffness(self, u: Any, du: Any, v: Any) -> Any:
        """Its derivative in a direction, of rank one at a point, and where it slips what :meth:`damp_slip` says."""
        import ufl

        k, trial = self._function, self._trial(u)
        sticks = ufl.And(ufl.lt(trial, k[BOUND]), ufl.gt(trial, -k[BOUND]))
        return k[STIFFNESS] * ufl.conditional(sticks, 1.0, k[DAMPING]) * self._along(du) * self._along(v)

    def _trial(self, u: Any) -> Any:
        k = self._function
        return k[TAU] + k[STIFFNESS] * (self._along(u) - k[AH])

    def _along(self, v: Any) -> Any:
        """``A : grad v``."""
        import ufl

        k = self._function
        return ufl.inner(ufl.as_matrix([[k[0], k[2]], [k[1], k[3]]]), ufl.grad(v))

    def damp_slip(self, fraction: float) -> bool:
        """Tangents have this fraction of the stiffness of sticking points where points slip."""
        if self.laws:
            self._values[:, DAMPING] = fraction
        return bool(self.laws)

    def states(self, points: Iterable[PointStates]) -> Iterator[FrictionStates]:
        """The slip systems of cells, and their answer to a state."""
        for some in points:
            k_cqk = self._values[self._rows_cq[some.cells], :N_ENTRIES]
            slip = SlipSystem.of_entries(k_cqk, self._normal_cqi[some.cells])
            yield FrictionStates(some, slip, slip.response(some.F_cqij), self.laws[some.region])

    def stress_rates(self, points: PointStates, dF_cqij: Float) -> Float:
        """What the stress of friction (n_cells, n_points, 2, 2) of some cells changes by along a change of F."""
        rates = np.zeros_like(dF_cqij)
        for states in self.states([points] if points.region in self.laws else []):
            slip = states.slip
            stiffness = np.where(states.response.sticks, slip.stiffness, 0.0)
            change = stiffness * np.einsum("cqij,cqij->cq", slip.A_ij, dF_cqij)
            rates += change[..., None, None] * slip.A_ij
        return rates

    def begin_step(self, points: Iterable[PointStates], shear_at: Callable[[Float], Float] | None = None) -> None:
        """Freeze the slip systems of cells for the step that begins at a state.

        Args:
            points: the state.
            shear_at: gives the shear (n,) reached there at points (n, 2) of the reference configuration; what the step
                before has led to by default.
        """
        for states in self.states(points):
            cells, slip = states.points.cells, states.next_slip(shear_at)
            self._values[self._rows_cq[cells], :N_ENTRIES] = slip.entries()
            self._normal_cqi[cells] = slip.n_i

    @cached_property
    def _function(self) -> Any:
        return compat.point_function(self._mesh.mesh, self._mesh.cell, self._degree, N_VALUES)

    @cached_property
    def _rows_cq(self) -> Int:
        """(n_cells, n_points) rows of the values of this rank's cells."""
        rows_cq = compat.point_rows(self._function, len(self._mesh.region_c))
        return rows_cq[: self._mesh.n_owned].astype(np.int64)

    @cached_property
    def _normal_cqi(self) -> Float:
        """(n_cells, n_points, 2) normals of contact at the beginning of the step."""
        return np.zeros((*self._rows_cq.shape, 2))

    @property
    def _values(self) -> Float:
        """(n_points, 9) values of the function, which change with them."""
        values: Float = self._function.x.array.reshape(-1, N_VALUES)
        return values
