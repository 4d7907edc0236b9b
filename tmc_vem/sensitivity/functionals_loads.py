"""Reactions, displacements of loads and the work of forces."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tmc_vem.problems.base import Problem, forces_of, media_of
from tmc_vem.problems.columns import pair_of
from tmc_vem.problems.load_tables import Load
from tmc_vem.problems.probes import Reaction
from tmc_vem.sensitivity.functionals_nodes import Nodes
from tmc_vem.sensitivity.functionals_record import Derivative, FunctionalState
from tmc_vem.support.distributed import Vec
from tmc_vem.support.errors import InputError
from tmc_vem.system.acting import Act, Acting
from tmc_vem.system.constraints import COMPONENTS, Condition, Prescribed, PrescribedAcross, PrescribedRotation
from tmc_vem.system.control import Control
from tmc_vem.system.forces import CavityPressure, FollowerPressure, Force

Float = NDArray[np.float64]


class Forces:
    """Forces and springs of a problem, each as the work that it does; all ranks make and use it together.

    Args:
        problem: whose forces.
        nodes: of its discretisation.
    """

    def __init__(self, problem: Problem, nodes: Nodes) -> None:
        self._nodes = nodes
        forces = forces_of(problem)
        act = Act(nodes.system, media_of(problem)) if forces else None
        self.acting: Sequence[Acting] = [act.on(force) for force in forces] if act else []

    def of(self, force: Force) -> Acting:
        """What a force of the problem does."""
        return next(acting for acting in self.acting if acting.force.name == force.name)

    def gradient(self, acting: Acting, u: Vec) -> tuple[float, Vec]:
        """Work of a force at amplitude 1, a pressure at pressure 1, and its derivative by u."""
        gradient = self._nodes.vector()
        return acting.work.gradient(u, gradient), gradient

    def factor(self, acting: Acting, position: Control) -> float:
        """What the work is multiplied with at a position on the path."""
        return acting.force.amplitude.at(position) * acting.factor

    def add_stiffness(self, du: Vec, position: Control, factor: float, out: Vec) -> None:
        """Add ``factor d(external forces)/du du``, springs included."""
        for acting in self.acting:
            acting.work.add_product(du, factor * self.factor(acting, position), out)


class ReactionFunctional:
    """Force that holds a named point or edges, along a direction, or its moment about a point.

    Both are ``w . R``. At degrees of freedom that nothing holds R is 0 at every equilibrium, so that w is left out.
    The arms of a moment reach to where the nodes are now, so that w depends on u: ``dv/du`` has ``R_y, -R_x`` besides.

    Args:
        words: what it is called.
        where: name of the point or edges.
        nodes: of the discretisation.
        direction: unit vector of a force.
        about: point of a moment, which is taken where there is no direction.
    """

    def __init__(
        self, words: str, where: str, nodes: Nodes, direction: Sequence[float] | None = None,
        about: Sequence[float] = (0.0, 0.0),
    ) -> None:  # fmt: skip
        self.words, self._nodes, self._where = words, nodes, where
        self._direction = None if direction is None else np.asarray(direction, dtype=np.float64)
        self._about = np.asarray(about, dtype=np.float64)
        self._here = nodes.system.owned_nodes(where)

    def derivative(self, state: FunctionalState) -> Derivative:
        """Value and derivatives at a state."""
        nodes, here = self._nodes, self._here
        weight_ni, by_u_ni = np.zeros((2, nodes.n_owned, 2))
        x, y = self._about.tolist()
        resultant = nodes.system.resultant(state.u, state.residual, self._where, (x, y))
        if self._direction is not None:
            weight_ni[here] = self._direction
            value = float(resultant[:2] @ self._direction)
        else:
            arm_ni = (nodes.points_nx + nodes.along(state.u) - self._about)[here]
            force_ni = nodes.along(state.residual)[here]
            weight_ni[here] = np.column_stack([-arm_ni[:, 1], arm_ni[:, 0]])
            by_u_ni[here] = np.column_stack([force_ni[:, 1], -force_ni[:, 0]])
            value = float(resultant[2])
        held = nodes.only_constrained(nodes.vector(weight_ni))
        return Derivative(value, nodes.vector(by_u_ni), held, reads_loads=self._direction is None)


class PrescribedFunctional:
    """How far a prescribed displacement or rotation has gone, as it is prescribed: whatever u is.

    Args:
        words: what it is called.
        condition: what is prescribed.
        nodes: of the discretisation.
    """

    def __init__(self, words: str, condition: Condition, nodes: Nodes) -> None:
        self.words, self._nodes, self._condition = words, nodes, condition

    def derivative(self, state: FunctionalState) -> Derivative:
        """Value and derivatives at a state."""
        condition = self._condition
        per_load = condition.amplitude.per_load(state.position) * condition.value
        value = condition.at(state.position)
        return Derivative(value, self._nodes.vector(), per_load=per_load, reads_loads=True)


class WorkFunctional:
    """Work that a force would do at amplitude 1, divided by a magnitude: the displacement of a dead force along itself,
    the area of a cavity, or the area that a pressure has swept.

    Args:
        words: what it is called.
        force: which.
        forces: those of the problem.
        nodes: of the discretisation.
    """

    def __init__(self, words: str, force: Force, forces: Forces, nodes: Nodes) -> None:
        self.words, self._forces, self._acting = words, forces, forces.of(force)
        if isinstance(force, CavityPressure | FollowerPressure):
            self._magnitude, self._area = 1.0, self._acting.area
        else:
            mine = nodes.along(forces.gradient(self._acting, nodes.vector())[1]).sum(axis=0)
            self._magnitude, self._area = math.hypot(*np.sum(nodes.system.comm.allgather(mine), axis=0)), 0.0

    def derivative(self, state: FunctionalState) -> Derivative:
        """Value and derivatives at a state."""
        done, gradient = self._forces.gradient(self._acting, state.u)
        gradient.scale(1.0 / self._magnitude)
        return Derivative(self._area + done / self._magnitude, gradient, reads_loads=True)


class ComplianceFunctional:
    """Potential of all forces and pressures at the present position: ``f . u`` of dead ones. Springs do not count.

    Args:
        problem: whose forces.
        forces: the same.
        nodes: of the discretisation.

    Raises:
        InputError: there are none.
    """

    words = "compliance"

    def __init__(self, problem: Problem, forces: Forces, nodes: Nodes) -> None:
        self._forces, self._nodes = forces, nodes
        self._acting = [acting for acting in forces.acting if not acting.is_spring]
        if not self._acting:
            raise InputError(
                f"compliance is the work of forces, and problem '{problem.name}' has none: take 'reaction', the force "
                "to the displacement that is prescribed"
            )

    def derivative(self, state: FunctionalState) -> Derivative:
        """Value and derivatives at a state."""
        total, per_load, by_u = 0.0, 0.0, self._nodes.vector()
        for acting in self._acting:
            done, gradient = self._forces.gradient(acting, state.u)
            factor = self._forces.factor(acting, state.position)
            total += factor * done
            per_load += acting.force.amplitude.per_load(state.position) * acting.factor * done
            by_u.axpy(factor, gradient)
        return Derivative(total, by_u, per_load=per_load, reads_loads=True)


def reaction_probe(probe: Reaction, nodes: Nodes) -> ReactionFunctional:
    """A probe of a reaction."""
    return ReactionFunctional(str(probe), probe.at, nodes, np.eye(2)[COMPONENTS[probe.component]].tolist())


def of_load(
    load: Load, quantity: str, forces: Forces, nodes: Nodes
) -> ReactionFunctional | PrescribedFunctional | WorkFunctional:
    """One of the two quantities that a load is reported by.

    Args:
        load: which.
        quantity: of :func:`tmc_vem.problems.columns.pair_of`.
        forces: those of the problem.
        nodes: of the discretisation.

    Raises:
        InputError: it is the force of a load that is a force.
    """
    moved, force = pair_of(load)
    words = f"{quantity} of {load.name or 'the load'}"
    if not isinstance(load, Condition):
        if quantity == force:
            raise InputError(f"{words} is given, no result: take its {moved}, or 'compliance', the work of all forces")
        return WorkFunctional(words, load, forces, nodes)
    if quantity == moved:
        return PrescribedFunctional(words, load, nodes)
    condition = _on_mesh(load, nodes)
    if isinstance(condition, PrescribedRotation):
        return ReactionFunctional(words, condition.where, nodes, None, condition.about)
    return ReactionFunctional(words, condition.where, nodes, condition.axes[0])


def _on_mesh(condition: Condition, nodes: Nodes) -> Condition:
    """A condition with its axes."""
    if isinstance(condition, Prescribed | PrescribedRotation):
        return condition
    return next(
        each for each in nodes.system.conditions
        if isinstance(each, PrescribedAcross) and (each.where, each.direction) == (condition.where, condition.direction)
    )  # fmt: skip
