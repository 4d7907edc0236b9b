"""Forces on discretisations some of whose nodes have axes of their own."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from helpers_forces import (
    KINDS,
    METHODS,
    cavity_plate,
    discretised,
    interpolated,
    smooth,
)

from tmc_vem.system.control import Control
from tmc_vem.system.forces import FollowerPressure
from tmc_vem.system.loaded import with_forces
from tmc_vem.system.pressure import end_terms
from tmc_vem.system.turned import Turned


@pytest.fixture(scope="module")
def bare() -> dict[str, Any]:
    return {method: discretised(method, cavity_plate()) for method in METHODS}


class Slanted:
    """A discretisation whose nodes at the tip and at the first corner have axes turned by an angle."""

    def __init__(self, system: Any, angle: float) -> None:
        self._inner = system
        nodes = np.concatenate([system.owned_nodes("tip"), system.owned_nodes("base")])
        axes = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        self._turned = Turned(nodes, np.array([axes, axes.T]))

    def turned(self) -> Turned:
        return self._turned

    def own(self, u: Any) -> Any:
        """The vector in the degrees of freedom of the nodes."""
        vector = u.copy()
        nodal = vector.getArray().reshape(-1, 2)
        for node, axes in zip(self._turned.nodes, self._turned.axes_nij, strict=True):
            nodal[node] = axes.T @ nodal[node]
        return vector

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inner, name)


@pytest.mark.parametrize("kind", KINDS)
def test_nodes_may_have_axes_of_their_own(bare: dict[str, Any], kind: str) -> None:
    """The same forces, moments and work; gradients are turned like displacements."""
    force = KINDS[kind] if kind != "follower" else FollowerPressure("f", "hole", 0.6)
    force = replace(force, where="tip") if kind == "point spring" else force
    plain = with_forces(bare["vem"], [force])
    slanted: Any = Slanted(bare["vem"], 0.7)
    system = with_forces(slanted, [force])
    u = interpolated(bare["vem"], smooth)
    expected = plain.measures(u, Control(0.8))
    assert system.measures(slanted.own(u), Control(0.8))["f"] == pytest.approx(expected["f"], rel=1e-12, abs=1e-13)
    gradients = [each.create_vector() for each in (plain, system)]
    plain.add_residual_per_load(u, Control(0.8), gradients[0])
    system.add_residual_per_load(slanted.own(u), Control(0.8), gradients[1])
    assert (slanted.own(gradients[0]) - gradients[1]).norm() < 1e-13


def test_a_chain_may_end_on_an_incline() -> None:
    """Turned with the axes of the slope, it is a chain that ends on level ground."""
    corner, origin = np.array([2.0, 1.0]), np.array([0.5, 0.25])
    axes = np.array([[np.sqrt(0.5), -np.sqrt(0.5)], [np.sqrt(0.5), np.sqrt(0.5)]])
    ends, nodes = np.array([[0, 1]]), np.array([[7, 8]])
    for held in (16, 17):  # x or y of the node 8; the other end has both
        fixed = np.array([14, 15, held])
        place = np.array([[[0.0, 0.0], corner]])
        turned = Turned(np.array([8]), axes[None])
        found = list(end_terms("f", "w", ends, nodes, place, fixed, turned, origin))[1].along(turned)
        level = origin + (place - origin) @ axes
        plain = list(end_terms("f", "w", ends, nodes, level, fixed, Turned(), origin))[1]
        assert found.linear_sm == pytest.approx(plain.linear_sm)
        assert found.hessian_smm == pytest.approx(plain.hessian_smm)
        sign = 1.0 if held == 16 else -1.0
        assert plain.hessian_smm == pytest.approx(-sign * np.array([[[0.0, 0.5], [0.5, 0.0]]]))
