"""J between quadrature points."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_mesh import hanging, voronoi
from helpers_system import interpolate, make_system, region

from tmc_vem.mesh import PolygonMesh
from tmc_vem.mesh.geometry import triangle_lattice


def test_lattice() -> None:
    points = triangle_lattice(4)
    assert len(points) == 10
    assert points.sum(axis=1) == pytest.approx(np.ones(10))
    assert points.min() == 0.0
    assert sorted(map(tuple, np.eye(3).tolist())) == sorted(p for p in map(tuple, points.tolist()) if max(p) == 1.0)


@pytest.mark.parametrize("mesh", [voronoi(20), hanging(2)], ids=["voronoi", "hanging nodes"])
def test_homogeneous_states(mesh: PolygonMesh) -> None:
    system = make_system(mesh, region("solid", K=20.0, mu=10.0))
    u = interpolate(system, lambda x: x @ np.array([[0.1, 0.2], [-0.3, 0.05]]))
    assert system.dense_jacobians(u) == pytest.approx(np.full(mesh.n_cells, 1.1 * 1.05 + 0.2 * 0.3), abs=1e-9)


@pytest.mark.parametrize("mesh", [voronoi(20), hanging(2)], ids=["voronoi", "hanging nodes"])
def test_the_smallest_is_at_a_vertex(mesh: PolygonMesh) -> None:
    """u = (0.3 x^2, 0): J = 1 + 0.6 x, smallest at the left-most vertex, beyond all quadrature points."""
    system = make_system(mesh, region("solid", K=20.0, mu=10.0))
    u = interpolate(system, lambda x: np.column_stack([0.3 * x[:, 0] ** 2, 0.0 * x[:, 0]]))
    exact = [1.0 + 0.6 * mesh.points_vx[mesh.cell(c), 0].min() for c in range(mesh.n_cells)]
    dense, (_, at_points) = system.dense_jacobians(u), system.cell_jacobians(u)
    assert dense == pytest.approx(np.array(exact), abs=1e-8)
    assert (dense < at_points).all()
