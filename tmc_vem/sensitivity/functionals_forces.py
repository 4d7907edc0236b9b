"""Forces that some cells resist with: through cuts, and of the medium on bodies.

Such a force is ``w . R_chosen(u, p)``, the residual of chosen cells alone: its derivative by u is their tangent times
w, ``K_chosen w``, and what it has of parameters is ``w . dR_chosen/dp``. In a moment w has arms that reach to where the
nodes are now, whose derivatives by u come on top.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tmc_vem.problems.base import Problem
from tmc_vem.problems.contact_quantities import OF_BODY, OF_FRICTION, OF_PAIR
from tmc_vem.problems.field_probes import CutForce
from tmc_vem.sensitivity.functionals_loads import Forces
from tmc_vem.sensitivity.functionals_nodes import Nodes, Point
from tmc_vem.sensitivity.functionals_record import CellParts, Derivative, FunctionalState
from tmc_vem.simulation.contact_gauge import ContactGauge
from tmc_vem.simulation.cut_gauge import Cut, direction_of
from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import require_choice

Float = NDArray[np.float64]
Bool = NDArray[np.bool_]


class CutFunctional:
    """Force through a cut, or its moment about the middle of the line.

    Args:
        probe: which.
        problem: whose probe.
        nodes: of its discretisation.

    Raises:
        InputError: the line cuts nothing.
    """

    def __init__(self, probe: CutForce, problem: Problem, nodes: Nodes) -> None:
        self.words, self._nodes = str(probe), nodes
        self._cut = Cut(probe, problem, nodes.system)
        is_moment = probe.component == "moment"
        self._direction = None if is_moment else direction_of(probe)
        self._middle = Point(nodes, probe.middle) if is_moment else None

    def derivative(self, state: FunctionalState) -> Derivative:
        """Value and derivatives at a state."""
        nodes, system, cut = self._nodes, self._nodes.system, self._cut
        force_ni = system.internal_forces(state.u, cut.left_c)[cut.nodes]
        by_u = nodes.vector()
        if self._direction is not None:
            weight_ni = np.broadcast_to(self._direction, force_ni.shape)
        else:
            assert self._middle is not None
            about = cut.middle + self._middle.displacement(state.u)
            arm_ni = cut.points_nx + nodes.along(state.u)[cut.nodes] - about
            weight_ni = np.column_stack([-arm_ni[:, 1], arm_ni[:, 0]])
            by_arm_ni = np.column_stack([force_ni[:, 1], -force_ni[:, 0]])
            by_u = nodes.vector(_placed(by_arm_ni, cut.nodes, nodes))
            by_u.axpy(-1.0, self._middle.vector(np.sum(system.comm.allgather(by_arm_ni.sum(axis=0)), axis=0)))
        value = sum(system.comm.allgather(float((weight_ni * force_ni).sum())))
        field = nodes.vector(_placed(weight_ni, cut.nodes, nodes))
        system.cell_tangent_action(state.u, field, cut.left_c, by_u)
        return Derivative(value, by_u, by_cells=CellParts(chosen_c=cut.left_c, field=field))


class ContactFunctional:
    """Force of the medium on a body, or on the first one of a pair that face each other, or its moment.

    At the nodes of a body's surface its cells resist with what acts there: the medium, forces and springs, and what
    holds it. So ``v = w . (R_cells - f_external - R)``, of which R counts at held degrees of freedom only. Which nodes
    of a pair face each other is taken as it is in the state: the derivative is that of the force on these nodes.

    Args:
        of: name of the body or pair.
        quantity: one of ``OF_BODY`` of :mod:`tmc_vem.problems.contact_quantities`.
        gauge: makes what contact is read with, once.
        forces: of the problem.
        nodes: of its discretisation.

    Raises:
        InputError: the quantity has no derivative; the message says why.
    """

    def __init__(
        self, of: str, quantity: str, gauge: Callable[[], ContactGauge], forces: Forces, nodes: Nodes
    ) -> None:  # fmt: skip
        self.words = f"contact.{of}.{quantity}"
        require_choice("quantity of contact", quantity, {**OF_PAIR, **OF_FRICTION})
        if quantity not in OF_BODY:
            raise InputError(f"{self.words} has no derivative: {_why_not(quantity)}")
        self._of, self._quantity, self._forces, self._nodes = of, quantity, forces, nodes
        self._gauge = gauge()

    def derivative(self, state: FunctionalState) -> Derivative:
        """Value and derivatives at a state.

        Raises:
            InputError: there is no such body, or no such pair in the state; or the force has no direction.
        """
        share_n = self._gauge.shares(self._of, state.u, state.residual)
        if share_n is None:
            bodies = ", ".join(self._gauge.names()) or "none"
            raise InputError(
                f"{self.words}: there is no body of that name (there are: {bodies}), and no pair whose outlines face "
                "each other in this state"
            )
        force_ni = self._force(state)
        x, y = (share_n @ force_ni[:, n] for n in (0, 1))
        fx, fy = np.sum(self._nodes.system.comm.allgather((x, y)), axis=0).tolist()
        weight_ni = np.zeros_like(force_ni)
        by_arm_ni = np.zeros_like(force_ni)
        if self._quantity == "moment":
            here = self._gauge.nodes
            place_ni = (self._nodes.points_nx + self._nodes.along(state.u))[here]
            weight_ni = share_n[:, None] * np.column_stack([-place_ni[:, 1], place_ni[:, 0]])
            by_arm_ni = share_n[:, None] * np.column_stack([force_ni[:, 1], -force_ni[:, 0]])
            value = sum(self._nodes.system.comm.allgather(float((weight_ni * force_ni).sum())))
            return self._result(state, value, weight_ni, by_arm_ni)
        value = {"force": math.hypot(fx, fy), "force_x": fx, "force_y": fy}[self._quantity]
        directions = {"force_x": (1.0, 0.0), "force_y": (0.0, 1.0)}
        if self._quantity == "force":
            if value == 0.0:
                raise InputError(f"{self.words} is 0, where it has no direction and no derivative: take force_x")
            directions["force"] = (fx / value, fy / value)
        weight_ni = np.outer(share_n, directions[self._quantity])
        return self._result(state, value, weight_ni, by_arm_ni)

    def _force(self, state: FunctionalState) -> Float:
        """(n, 2) force of the medium on this rank's nodes of the surface."""
        nodes, system, here = self._nodes, self._nodes.system, self._gauge.nodes
        resisted_ni = system.internal_forces(state.u, self._gauge.chosen_c) - system.external_forces(state.u)
        held = nodes.vector()
        held.getArray()[:] = system.holding_forces(state.residual)
        force_ni: Float = (resisted_ni - nodes.along(held))[here]
        return force_ni

    def _result(self, state: FunctionalState, value: float, weight_ni: Float, by_arm_ni: Float) -> Derivative:
        nodes, gauge = self._nodes, self._gauge
        by_u = nodes.vector(_placed(by_arm_ni, gauge.nodes, nodes))
        field = nodes.vector(_placed(weight_ni, gauge.nodes, nodes))
        nodes.system.cell_tangent_action(state.u, field, gauge.chosen_c, by_u)
        self._forces.add_stiffness(field, state.position, -1.0, by_u)
        held = nodes.only_constrained(nodes.vector(_placed(-weight_ni, gauge.nodes, nodes)))
        less = field.copy()
        less.scale(-1.0)
        return Derivative(value, by_u, held, CellParts(chosen_c=gauge.chosen_c, field=field), by_forces=less)


def _placed(values_ni: Float, here: NDArray[np.int64], nodes: Nodes) -> Float:
    """(n_owned, 2) values at some nodes, 0 at the others."""
    placed = np.zeros((nodes.n_owned, 2))
    placed[here] = values_ni
    return placed


def _why_not(quantity: str) -> str:
    """Why a quantity of contact has none, and what has one."""
    if quantity == "gap":
        return "it is the smallest distance of all nodes; take a probe of the gap of two points"
    if quantity in ("pressure_max", "pressure_fit"):
        return "it goes by the node with the largest pressure; take the force, or a p-norm of a stress"
    if quantity in ("half_width", "contact_length", "centre_x", "centre_y"):
        return "it goes by which nodes are above a part of the largest pressure; take the force, or its moment"
    return "friction depends on the path, not on the state alone; take it out of the medium"
