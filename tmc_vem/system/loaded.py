"""A discretisation with forces: its potential less their work, wherever on the path of loads it stands.

What is not about forces is that of the discretisation itself, which knows nothing of them. A problem without forces has
its discretisation alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.distributed import Mat, Vec
from tmc_vem.support.errors import InputError
from tmc_vem.system.acting import Act, Acting
from tmc_vem.system.control import Control
from tmc_vem.system.discretisation import Discretisation, Evaluation
from tmc_vem.system.forces import CavityPressure, FollowerPressure, Force
from tmc_vem.system.layout import DISPLACEMENT

Float = NDArray[np.float64]


def with_forces(system: Discretisation, forces: Sequence[Force], media: Sequence[str] = ()) -> Discretisation:
    """A discretisation with forces; itself if there are none. All ranks call this together.

    Args:
        system: the discretisation.
        forces: forces and springs.
        media: names of regions that are third medium.

    Raises:
        InputError: two forces have one name, or one acts on what is not there or has no potential.
    """
    # whatever LoadedSystem does not have itself it asks the other one for, which mypy cannot see
    return cast("Discretisation", LoadedSystem(system, forces, media)) if forces else system


class LoadedSystem:
    """Implements ``Discretisation``; arguments are those of :func:`with_forces`."""

    def __init__(self, system: Discretisation, forces: Sequence[Force], media: Sequence[str]) -> None:
        self._system = system
        names = [force.name for force in forces]
        twice = [name for name in names if names.count(name) > 1]
        if twice:
            raise InputError(f"two forces are called '{twice[0]}': give each a name of its own")
        act = Act(system, media)
        self._acting: list[Acting] = [act.on(force) for force in forces]
        self._constrained = act.constrained()
        self._axes_nij = act.axes()
        self._position = Control(0.0)
        self._of_tangent = self._factors()
        self._gradient, self._loads, self._springs = (system.create_vector() for _ in range(3))

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """What is not about forces."""
            if name == "_system":  # while there is none, as in a copy that is being made
                raise AttributeError(name)
            return getattr(self._system, name)

    # -- Discretisation ------------------------------------------------------------------------------------------

    def set_position(self, position: Control) -> None:
        """Forces and springs are those at a position on the path from now on."""
        self._system.set_position(position)
        self._position = position

    def energy(self, u: Vec) -> Evaluation:
        """Potential at ``u``."""
        return self._with_forces(u, self._system.energy(u))

    def residual(self, u: Vec, out: Vec) -> Evaluation:
        """Gradient of the potential at ``u`` into ``out``; its constrained entries are the reactions."""
        evaluation = self._with_forces(u, self._system.residual(u, out))
        out.axpy(-1.0, self._loads)
        out.axpy(-1.0, self._springs)
        return evaluation

    def jacobian(self, u: Vec, out: Mat) -> None:
        """Tangent at ``u`` with rows and columns of the identity at constrained degrees of freedom."""
        self._system.jacobian(u, out)
        self._of_tangent = self._factors()
        if all(acting.work.is_linear for acting in self._acting):
            return
        for acting, factor in zip(self._acting, self._of_tangent, strict=True):
            acting.work.add_hessian(-factor, self._constrained, out)
        out.assemble()

    def tangent_action(self, du: Vec, out: Vec) -> None:
        """Product of the last tangent, without boundary conditions, and ``du``."""
        self._system.tangent_action(du, out)
        for acting, factor in zip(self._acting, self._of_tangent, strict=True):
            acting.work.add_product(du, -factor, out)

    def add_residual_per_load(self, u: Vec, position: Control, out: Vec) -> None:
        """Add the derivative of the residual with respect to the load factor at ``u``."""
        self._system.add_residual_per_load(u, position, out)
        for acting in self._acting:
            rate = acting.force.amplitude.per_load(position) * acting.factor
            if rate:
                acting.work.gradient(u, self._gradient)
                out.axpy(-rate, self._gradient)

    def external_forces(self, u: Vec) -> Float:
        """(n_owned_nodes, 2) forces along x and y on the nodes, springs included."""
        total_ni = self._system.external_forces(u)
        for acting, factor in zip(self._acting, self._factors(), strict=True):
            acting.work.gradient(u, self._gradient)
            total_ni += factor * self._along_x_and_y(self._gradient)
        return total_ni

    def measures(self, u: Vec, position: Control) -> dict[str, dict[str, float]]:
        """What forces and springs do at a state and a position on the path, by name.

        ``force_x``, ``force_y`` and ``moment`` are the resultant on the body and its moment about the origin, at the
        places to which the body has moved. ``amplitude`` is what ``potential`` is multiplied with: the work that the
        force would do at amplitude 1 from the reference state to this one; of springs it is minus the energy at
        amplitude 1. A pressure has its ``pressure``, a cavity ``area`` and ``area_at_start``, a spring ``energy``.
        """
        return {acting.force.name: self._measure(acting, u, position) for acting in self._acting}

    # -- internals -----------------------------------------------------------------------------------------------

    def _factors(self) -> list[float]:
        """What the work of each force is multiplied with at the present position."""
        return [acting.force.amplitude.at(self._position) * acting.factor for acting in self._acting]

    def _with_forces(self, u: Vec, evaluation: Evaluation) -> Evaluation:
        """An evaluation of the body alone with what forces and springs add; gradients of their work are kept."""
        self._loads.set(0.0)
        self._springs.set(0.0)
        work, springs = 0.0, {}
        for acting, factor in zip(self._acting, self._factors(), strict=True):
            done = factor * acting.work.gradient(u, self._gradient)
            work += done
            if acting.is_spring:
                springs[acting.force.name] = -done
            (self._springs if acting.is_spring else self._loads).axpy(factor, self._gradient)
        norm = max(self._loads.norm(), self._springs.norm())
        return replace(evaluation, energy=evaluation.energy - work, springs=springs, forces=norm)

    @cached_property
    def _points_nx(self) -> Float:
        return self._system.node_labels()[:, :2]

    def _along_x_and_y(self, vector: Vec) -> Float:
        """Components (n_owned_nodes, 2) of this rank's part of a vector."""
        own_ni = DISPLACEMENT.nodal(vector.getArray(readonly=True))
        along_ni: Float = np.einsum("nij,nj->ni", self._axes_nij, own_ni)
        return along_ni

    def _measure(self, acting: Acting, u: Vec, position: Control) -> dict[str, float]:
        amplitude = acting.force.amplitude.at(position)
        factor = amplitude * acting.factor
        done = acting.work.gradient(u, self._gradient)
        force_ni, u_ni = (factor * self._along_x_and_y(self._gradient), self._along_x_and_y(u))
        x, y = (self._points_nx + u_ni).T
        mine = [*force_ni.sum(axis=0), x @ force_ni[:, 1] - y @ force_ni[:, 0]]
        force_x, force_y, moment = np.sum(self._system.comm.allgather(np.array(mine)), axis=0).tolist()
        found = {"force_x": force_x, "force_y": force_y, "moment": moment, "amplitude": amplitude}
        found["potential"] = acting.factor * done
        if acting.is_spring:
            found["energy"] = -factor * done
        if isinstance(acting.force, CavityPressure | FollowerPressure):
            found["pressure"] = factor
        if isinstance(acting.force, CavityPressure):
            found |= {"area": acting.area + done, "area_at_start": acting.area}
        return found
