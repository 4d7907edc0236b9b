"""A converged state with the equations linearised there: what adjoint fields are made of.

The tangent is put together and factorised once; an adjoint field is one back-substitution with these factors, whatever
it is for, as the tangent is symmetric.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

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
        by_u: dj/du + K w, the derivative of v by u, the residual in it included.
    """

    field: Vec
    by_u: Vec


@dataclass(frozen=True)
class Moved:
    """Displacements of constrained degrees of freedom alone.

    Attributes:
        u: a vector of the system with them, and zeros.
        force: the tangent times it.
    """

    u: Vec
    force: Vec


class Equilibrium:
    """A converged state; all ranks make and use it together.

    Args:
        solver: of its system; its matrix and factors become those of the tangent at the state.
        system: the discretisation.
        u: displacements.
        position: where on the path it is.
        behind: tells whether the second of two points is behind the surface of the first, where surfaces cross.

    Raises:
        SingularTangent: the tangent there cannot be factorised.

    Attributes:
        system: the discretisation.
        state: what functionals are of.
        negative_pivots: of the tangent; above zero the state is unstable. None if the solver cannot tell.
    """

    def __init__(
        self, solver: NewtonSolver, system: Discretisation, u: Vec, position: Control, behind: Behind | None = None
    ) -> None:
        self.system, self._solver = system, solver
        system.set_position(position)
        residual = system.create_vector()
        system.residual(u, residual)
        self.state = FunctionalState(u, residual, position, behind)
        solved, self.negative_pivots = solver.linearise(u, position)
        if not solved:
            raise SingularTangent(
                f"the tangent at load factor {position.load:g} has no inverse{solver.linear_complaint}: there is no "
                "derivative at a limit point or a bifurcation"
            )

    @property
    def is_unstable(self) -> bool:
        """Whether the state is known to be no minimum of the potential."""
        return bool(self.negative_pivots)

    @cached_property
    def residual_per_load(self) -> Vec:
        """Rate of the residual per load factor, u held: of forces that change along the path."""
        rate = self.system.create_vector()
        self.system.add_residual_per_load(self.state.u, self.state.position, rate)
        return rate

    @cached_property
    def per_load(self) -> Vec:
        """Rate of u per load factor along the path.

        Raises:
            SingularTangent: the linear solver failed.
        """
        held = self.moved(self.system.prescribed_per_load(self.state.position))
        held.force.axpy(1.0, self.residual_per_load)
        rate = self._solved(held.force, "rate along the path")
        rate.axpy(1.0, held.u)
        return rate

    def adjoint(self, of: Derivative) -> Adjoint:
        """The adjoint field of a functional: K_ff L_f = -(dj/du + K w)_f and L_c = w.

        Raises:
            SingularTangent: the linear solver failed.
        """
        by_u, held = self.system.create_vector(), self.system.constrained()
        if of.on_residual is not None:  # not 0 at few nodes, and only the cells there are computed
            self.system.tangent_action(of.on_residual, by_u)
        by_u.axpy(1.0, of.by_u)
        field = self._solved(by_u, "adjoint field")
        if of.on_residual is not None:
            field.getArray()[held] = of.on_residual.getArray(readonly=True)[held]
        return Adjoint(field, by_u)

    def moved(self, prescribed: Float) -> Moved:
        """What displacements (n,) of this rank's constrained degrees of freedom do while all others are held."""
        u, force = self.system.create_vector(), self.system.create_vector()
        u.getArray()[self.system.constrained()] = prescribed
        self.system.tangent_action(u, force)
        return Moved(u, force)

    def _solved(self, force: Vec, what: str) -> Vec:
        """The displacements of free degrees of freedom that undo a force."""
        found = self._corrected(force, what)
        if not self._solver.ordering:  # an iteration, whose tolerance is that of a Newton step: once more for the rest
            rest = self.system.create_vector()
            self.system.tangent_action(found, rest)
            rest.axpy(1.0, force)
            found.axpy(1.0, self._corrected(rest, what))
        return found

    def _corrected(self, force: Vec, what: str) -> Vec:
        found = self.system.create_vector()
        if not self._solver.correction(force, found):
            raise SingularTangent(f"no {what} was found{self._solver.linear_complaint}")
        return found
