"""A converged state with the equations linearised there: what adjoint fields are made of.

The tangent is put together and factorised once; an adjoint field is one back-substitution with these factors, whatever
it is for, as the tangent is symmetric.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.sensitivity.functionals_record import Derivative, FunctionalState
from tmc_vem.simulation.reading import Behind
from tmc_vem.solve.newton import NewtonSolver
from tmc_vem.support.distributed import Vec
from tmc_vem.support.errors import TmcError
from tmc_vem.system.control import Control
from tmc_vem.system.discretisation import Discretisation

Float = NDArray[np.float64]


class SingularTangent(TmcError):
    """The tangent at a state has no factors: there is no derivative."""


@dataclass(frozen=True)
class Adjoint:
    """An adjoint field of a functional v = j + w . R.

    Attributes:
        field: L, a vector of the system, constrained entries included.
        by_prescribed: (n,) total derivatives of v by what is prescribed at this rank's constrained degrees of freedom;
            not numbers where only those by parameters of cells are wanted.
    """

    field: Vec
    by_prescribed: Float


class Equilibrium:
    """A converged state; all ranks make and use it together.

    Args:
        solver: of its system; its matrix and factors become those of the tangent at the state.
        system: the discretisation.
        u: displacements.
        position: where on the path it is.
        behind: tells whether the second of two points is behind the surface of the first, where surfaces cross.
        cells_only: only derivatives by parameters of cells are wanted, which saves two products and a solution: those
            along the path and by what is prescribed are not numbers.

    Raises:
        SingularTangent: the tangent there cannot be factorised.

    Attributes:
        system: the discretisation.
        state: what functionals are of.
        per_load: rate of u per load factor along the path; not numbers with ``cells_only``.
        negative_pivots: of the tangent; above zero the state is unstable. None if the solver cannot tell.
    """

    def __init__(
        self, solver: NewtonSolver, system: Discretisation, u: Vec, position: Control, behind: Behind | None = None, *,
        cells_only: bool = False,
    ) -> None:  # fmt: skip
        self.system, self._solver, self._cells_only = system, solver, cells_only
        system.set_position(position)
        residual = system.create_vector()
        system.residual(u, residual)
        self.state = FunctionalState(u, residual, position, behind)
        self.per_load = system.create_vector()
        if cells_only:
            self.per_load.set(np.nan)
            solved, self.negative_pivots = solver.linearise(u, position)
        else:
            solved, self.negative_pivots = solver.per_load(u, position, self.per_load)
        if not solved:
            raise SingularTangent(
                f"the tangent at load factor {position.load:g} has no inverse{solver.linear_complaint}: there is no "
                "derivative at a limit point or a bifurcation"
            )

    @property
    def is_unstable(self) -> bool:
        """Whether the state is known to be no minimum of the potential."""
        return bool(self.negative_pivots)

    def adjoint(self, of: Derivative) -> Adjoint:
        """The adjoint field of a functional: K_ff L_f = -(dj/du + K w)_f and L_c = w.

        Raises:
            SingularTangent: the linear solver failed.
        """
        system, held = self.system, self.system.constrained()
        rhs, field = system.create_vector(), system.create_vector()
        if of.on_residual is not None:
            system.tangent_action(of.on_residual, rhs)
        rhs.axpy(1.0, of.by_u)
        if not self._solver.correction(rhs, field):
            raise SingularTangent(f"no adjoint field was found{self._solver.linear_complaint}")
        if of.on_residual is not None:
            field.getArray()[held] = of.on_residual.getArray(readonly=True)[held]
        if self._cells_only:
            return Adjoint(field, np.full(len(held), np.nan))
        # along what is prescribed: dj/du_c + K_cf L_f + K_cc w
        system.tangent_action(field, rhs)
        rhs.axpy(1.0, of.by_u)
        return Adjoint(field, rhs.getArray(readonly=True)[held].copy())
