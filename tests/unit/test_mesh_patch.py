"""The patch test and rates of convergence on every kind of mesh that the generators make."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_system import CLAMPED, free_part, interpolate, make_system, region
from test_vem_convergence import observed

from tmc_vem.mesh import PolygonMesh, Rectangle, structured_quadrilaterals
from tmc_vem.mesh.make.outline import Arc, Region
from tmc_vem.mesh.make.refine import refine
from tmc_vem.mesh.make.triangles import triangle_mesh
from tmc_vem.mesh.make.voronoi import voronoi_mesh
from tmc_vem.mesh.make.weld import weld
from tmc_vem.problems import Box, CBox, Punch
from tmc_vem.solve.newton import NewtonSolver
from tmc_vem.support.errors import InputError

SQUARE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
HALVES = [
    Region("left", [(0.0, 0.0), (0.5, 0.0), (0.5, 1.0), (0.0, 1.0)]),
    Region("right", [(0.5, 0.0), (1.0, 0.0), (1.0, 1.0), (0.5, 1.0)]),
]
CIRCLE = [Arc((0.5, 0.5), 0.25, 0, 180), Arc((0.5, 0.5), 0.25, 180, 360)]
SOLID = region("solid", K=5.0 / 3.0, mu=5.0 / 14.0)
H = np.array([[0.3, 0.45], [-0.25, 0.2]])


def bounded(mesh):
    """The mesh with its boundary named."""
    outer = mesh.edges.vertices_ev[mesh.edges.n_cells_e == 1]
    return PolygonMesh(
        mesh.points_vx, mesh.cell_offsets, mesh.cell_vertices, mesh.region_c, mesh.region_names,
        named_edges={"boundary": outer},
    )  # fmt: skip


def squares(n):
    lines = np.linspace(0.0, 1.0, n + 1)
    return structured_quadrilaterals(lines, lines, [Rectangle("a", 0, 1, 0, 1)])


def welded(n, ratio):
    """Voronoi cells on the left, squares on the right."""
    left = voronoi_mesh(HALVES[:1], 0.5 / n)
    x, y = np.linspace(0.5, 1.0, n * ratio // 2 + 1), np.linspace(0.0, 1.0, n * ratio + 1)
    return weld([left, structured_quadrilaterals(x, y, [Rectangle("right", 0.5, 1, 0, 1)])])


def quadtree(n):
    """Squares, refined twice towards a corner."""
    mesh = squares(n)
    for radius in (0.6, 0.3):
        middle = np.array([mesh.points_vx[loop].mean(axis=0) for loop in mesh.cells()])
        mesh = refine(mesh, np.hypot(*middle.T) < radius)
    return mesh


def ear_clipped(n):
    """Pairs of cells that interlock: one is a C, which does not see its centroid."""
    c = [(0, 0), (3, 0), (3, 1), (1, 1), (1, 2), (3, 2), (3, 3), (0, 3)]
    tongue = [(3, 1), (4, 1), (4, 2), (3, 2), (1, 2), (1, 1)]
    rest = [[(3, 0), (4, 0), (4, 1), (3, 1)], [(3, 2), (4, 2), (4, 3), (3, 3)]]
    number: dict[tuple[int, int], int] = {}
    cells = [
        [number.setdefault((x + 4 * i, y + 3 * j), len(number)) for x, y in loop]
        for i in range(n) for j in range(n) for loop in (c, tongue, *rest)
    ]  # fmt: skip
    return PolygonMesh.from_cells(np.array(list(number)) / [4.0 * n, 3.0 * n], cells)


MESHES = {
    "Voronoi": lambda: voronoi_mesh([Region("a", SQUARE)], 0.2),
    "Voronoi, two regions": lambda: voronoi_mesh(HALVES, 0.15),
    "Voronoi, circle": lambda: voronoi_mesh([Region("a", SQUARE, [CIRCLE]), Region("b", CIRCLE)], 0.15),
    "Voronoi, graded": lambda: voronoi_mesh([Region("a", SQUARE)], lambda x: 0.08 + 0.15 * x[:, 0]),
    "triangles": lambda: triangle_mesh(HALVES, 0.25),
    "recombined": lambda: triangle_mesh(HALVES, 0.25, quadrilaterals=True),
    "quadtree": lambda: quadtree(4),
    "refined polygons": lambda: refine(voronoi_mesh([Region("a", SQUARE)], 0.25), [0, 5, 9]),
    "welded 2": lambda: welded(4, 2),
    "welded 4": lambda: welded(4, 4),
    "ear-clipped": lambda: ear_clipped(2),
    "box, ratio 2": lambda: Box(cells=(20, 5), medium_refinement=2).make_mesh(),
    "box, ratio 4": lambda: Box(cells=(20, 5), medium_refinement=4).make_mesh(),
    "C-box": lambda: CBox(cells=(10, 5), medium_refinement=2).make_mesh(),
    "punch": lambda: Punch(size=0.2).make_mesh(),
}


@pytest.mark.parametrize("name", MESHES)
def test_patch(name):
    """A linear displacement under finite strain is a solution, with a residual of rounding and found by Newton."""
    system = make_system(bounded(MESHES[name]()), SOLID, CLAMPED)
    exact = interpolate(system, lambda x: x @ H.T + [0.1, -0.2])
    residual = system.create_vector()
    system.residual(exact, residual)
    assert np.abs(free_part(system, residual)).max() < 1e-11
    u = exact.copy()
    noise = np.random.default_rng(3).normal(size=u.getLocalSize()) * 1e-4
    noise[system.constrained()] = 0.0
    u.getArray()[:] += noise
    result = NewtonSolver(system).solve(u)
    assert result.converged, result.reason
    assert np.abs((u - exact).getArray()).max() < 1e-10


def test_ratio_8_is_solved_or_refused_by_name():
    """Seven hanging nodes on a side need a high degree; if none has full rank the cell is named."""
    mesh = Box(cells=(20, 5), medium_refinement=8).make_mesh()
    assert mesh.n_sides_c.max() == 11
    try:
        system = make_system(bounded(mesh), SOLID, CLAMPED)
    except InputError as error:
        assert "has 11 vertices" in str(error)  # noqa: PT017
        return
    exact = interpolate(system, lambda x: x @ H.T)
    residual = system.create_vector()
    system.residual(exact, residual)
    assert np.abs(free_part(system, residual)).max() < 1e-10


@pytest.mark.parametrize(
    ("kind", "sizes"),
    [
        (lambda n: voronoi_mesh([Region("a", SQUARE)], 1.0 / n), (4, 8, 16)),
        (lambda n: welded(n, 2), (4, 8, 16)),
        (quadtree, (4, 8, 16)),
        (ear_clipped, (2, 4, 8)),
    ],
    ids=["Voronoi", "welded", "quadtree", "ear-clipped"],
)
def test_rates(kind, sizes):
    """Order 3 of the displacement and 2 of its gradient, for k = 2."""
    _, displacement, gradient = observed([bounded(kind(n)) for n in sizes], 2)
    assert displacement[-1] > 2.7
    assert gradient[-1] > 1.8
