"""Cells that are inside out are untangled: derivatives, what moves and what does not, and when it cannot be done."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_mesh import grid
from helpers_system import local_interpolant, make_system, region
from mpi4py import MPI
from numpy.typing import NDArray

from tmc_vem.mesh import PolygonMesh, Rectangle, structured_quadrilaterals
from tmc_vem.vem.system import VemSystem
from tmc_vem.vem.untangle import Untangled, _derivatives, untangled

Float = NDArray[np.float64]
Bool = NDArray[np.bool_]

SOLID = region("solid", K=1.0, mu=0.5)


def system_on(mesh: PolygonMesh) -> VemSystem:
    return make_system(mesh, SOLID, comm=MPI.COMM_SELF)


def smallest(system: VemSystem, u_ni: Float) -> float:
    return float(system.cell_jacobians(system.nodal_vector(u_ni))[1].min())


def at(system: VemSystem, x: float, y: float) -> int:
    """The node at a place."""
    points_vx = system.distributed.mesh.points_vx
    return int(system.dofmap.vertex_nodes[np.hypot(*(points_vx - (x, y)).T).argmin()])


def on_outline(system: VemSystem) -> Bool:
    """(n_nodes, 2) nodes on the boundary of the unit square."""
    x_nx, is_moment = local_interpolant(system, lambda x: x)
    outer = ((np.abs(x_nx) < 1e-9) | (np.abs(x_nx - 1.0) < 1e-9)).any(axis=1) & ~is_moment
    return np.repeat(outer[:, None], 2, axis=1)


def inverted(system: VemSystem) -> Float:
    """A node in the middle is pushed through the cell beside it."""
    u_ni = np.zeros((system.dofmap.n_nodes, 2))
    u_ni[at(system, 0.5, 0.5)] = (0.4, 0.1)
    return u_ni


@pytest.mark.parametrize("delta", [1e-3, 0.3])
def test_derivatives(delta: float) -> None:
    """What is left of the energy beyond its first Taylor polynomial goes down with the square of the distance, at
    points with J of either sign."""
    rng = np.random.default_rng(3)
    F_qs = np.array([(1.0, 0.1, -0.2, 1.1), (-0.4, 0.3, 0.6, 0.9), (0.5, 0.5, 0.4, 0.4), (1.0, 0.0, 0.0, -0.01)])
    dF_qs = rng.normal(size=F_qs.shape)
    energy, gradient, _ = _derivatives(F_qs, delta)
    assert (energy > 0.0).all()
    slope = (gradient * dF_qs).sum(axis=1)
    steps = delta * np.array([4e-2, 2e-2, 1e-2])
    values = np.array([_derivatives(F_qs + t * dF_qs, delta)[0] for t in steps])
    first = np.abs(values - energy - steps[:, None] * slope)
    assert np.log2(first[:-1] / first[1:]) == pytest.approx(2.0, abs=0.25)


@pytest.mark.parametrize("F_s", [(-0.4, 0.3, 0.6, 0.9), (1.2, 0.1, -0.1, 0.9)])
def test_the_hessian_is_without_its_negative_part(F_s: tuple[float, ...]) -> None:
    """Differences of the gradient, with eigenvalues below 0 at 0."""
    delta, t = 0.1, 1e-5
    columns = [
        (_derivatives(F_s + t * e, delta)[1] - _derivatives(F_s - t * e, delta)[1]) / (2.0 * t) for e in np.eye(4)
    ]
    values, vectors = np.linalg.eigh(np.stack(columns, axis=1))
    assert (values[0] < -1.0) == (F_s[0] < 0.0)  # else nothing is tested
    expected = (vectors * np.maximum(values, 0.0)) @ vectors.T
    H = _derivatives(np.array(F_s), delta)[2]
    assert np.abs(H - expected).max() < 1e-6 * np.abs(expected).max()


@pytest.mark.parametrize("least", [0.0, 0.05, 0.3])
def test_an_inverted_node_is_untangled(least: float) -> None:
    system = system_on(grid(4, 4))
    u_ni, fixed_ni = inverted(system), on_outline(system)
    assert smallest(system, u_ni) < -0.1
    found = untangled(system, u_ni, fixed_ni, {"domain": 1.0}, least)
    assert found is not None
    assert smallest(system, found.u_ni) > least
    assert found.n_cells == int((system.cell_jacobians(system.nodal_vector(u_ni))[1] <= least).sum()) > 0
    assert found.moved == np.abs(found.u_ni - u_ni).max() > 0.1
    assert np.array_equal(found.u_ni[fixed_ni], u_ni[fixed_ni])
    # what is prescribed there stays prescribed
    u_ni[fixed_ni] += 1e-3
    found = untangled(system, u_ni, fixed_ni, {"domain": 1.0}, least)
    assert found is not None
    assert np.array_equal(found.u_ni[fixed_ni], u_ni[fixed_ni])


def test_single_components_stay() -> None:
    """A roller's node moves along it, and not across."""
    system = system_on(grid(4, 4))
    u_ni, fixed_ni = inverted(system), on_outline(system)
    fixed_ni[at(system, 0.5, 0.5), 1] = True
    found = untangled(system, u_ni, fixed_ni, {"domain": 1.0})
    assert found is not None
    node = at(system, 0.5, 0.5)
    assert found.u_ni[node, 1] == u_ni[node, 1]
    assert found.u_ni[node, 0] < u_ni[node, 0]


def test_only_nodes_around_the_cells_move() -> None:
    system = system_on(grid(10, 10))
    u_ni = np.zeros((system.dofmap.n_nodes, 2))
    u_ni[at(system, 0.5, 0.5)] = (0.15, 0.04)
    found = untangled(system, u_ni, on_outline(system), {"domain": 1.0})
    assert found is not None
    x_nx, is_moment = local_interpolant(system, lambda x: x)
    moved = (found.u_ni != u_ni).any(axis=1) & ~is_moment
    assert np.abs(x_nx[moved] - 0.5).max() < 0.21
    assert moved.sum() > 5


def test_an_outline_that_is_inside_out_stays() -> None:
    """Nothing that may move can help: the side of the square is pushed through the other one."""
    system = system_on(grid(2, 2))
    x_nx, is_moment = local_interpolant(system, lambda x: x)
    u_ni = np.zeros_like(x_nx)
    u_ni[(x_nx[:, 0] > 0.9) & ~is_moment] = (-1.5, 0.0)
    assert untangled(system, u_ni, on_outline(system), {"domain": 1.0}) is None
    assert untangled(system, inverted(system), np.ones_like(u_ni, dtype=bool), {"domain": 1.0}) is None


def test_nothing_to_do() -> None:
    system = system_on(grid(4, 4))
    u_ni = np.random.default_rng(0).normal(scale=1e-3, size=(system.dofmap.n_nodes, 2))
    found = untangled(system, u_ni, on_outline(system), {"domain": 1.0})
    assert found == Untangled(u_ni, 0, 0.0)
    assert found.u_ni is u_ni


def test_heavy_regions_hardly_move() -> None:
    """The node between a heavy region and a light one: the cells of the light one give way."""
    lines = np.linspace(0.0, 1.0, 5)
    regions = [Rectangle("left", 0, 1, 0, 1), Rectangle("right", 0.5, 1, 0, 1)]
    system = system_on(structured_quadrilaterals(lines, lines, regions, {}))
    u_ni = np.zeros((system.dofmap.n_nodes, 2))
    u_ni[at(system, 0.25, 0.5)] = (0.3, 0.0)  # beyond the line between them
    x_nx, is_moment = local_interpolant(system, lambda x: x)
    right = (x_nx[:, 0] >= 0.5) & ~is_moment
    changed = {}
    for weight in (1.0, 1000.0):
        found = untangled(system, u_ni, on_outline(system), {"left": 1.0, "right": weight})
        assert found is not None
        changed[weight] = float(np.abs((found.u_ni - u_ni)[right]).max())
    assert changed[1.0] > 1e-3
    assert changed[1000.0] < 0.05 * changed[1.0]


def test_cells_of_heavy_regions_are_untangled_too() -> None:
    system = system_on(grid(4, 4))
    found = untangled(system, inverted(system), on_outline(system), {"domain": 1000.0})
    assert found is not None
    assert smallest(system, found.u_ni) > 0.0
