"""Order and weight of everything nodal that is written, drawn, measured or read back, for every order of the elements.

With order 2 a side has one inner node, in its middle: neither its direction nor the place of its nodes can be wrong.
From order 3 on both can, and a cell has more than one moment.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers_mesh import grid, hanging, voronoi, with_boundary
from helpers_system import interpolate, make_system, problem_system, region
from mpi4py import MPI
from numpy.typing import NDArray

from tmc_vem import Box, Medium, RunOptions, RunResult, run
from tmc_vem.mesh.geometry import areas
from tmc_vem.problems import Material, Problem
from tmc_vem.problems.base import solid_region
from tmc_vem.problems.probes import MeanJ
from tmc_vem.problems.wrapped import Probed
from tmc_vem.results.contact.solids import Solids
from tmc_vem.results.output import gather_fields
from tmc_vem.results.snapshots import read_fields, snapshots
from tmc_vem.simulation.checkpoint import Checkpoint
from tmc_vem.simulation.gauge import Gauge
from tmc_vem.simulation.overlap import OverlapWatch
from tmc_vem.system.fem_settings import FemSettings
from tmc_vem.system.fields import Polygons
from tmc_vem.vem.spaces.element_settings import ElementSettings
from tmc_vem.vem.spaces.quadrature import gauss_lobatto

Float = NDArray[np.float64]
SOLID = region("solid", K=20.0, mu=10.0)
VEM_ORDERS, FEM_ORDERS = (2, 3, 4), (2, 3)
MESHES = {"voronoi": voronoi(24), "hanging": hanging(2, 0.05)}
BOX = Box(cells=(20, 5), uy=-0.06, medium=Medium(gamma=1e-4))


def field(order: int) -> Any:
    """A polynomial displacement that no lower order has, and that looks different from either end of a side."""

    def displacement(x: Float) -> Float:
        a, b = x[:, 0], x[:, 1]
        return 0.1 * np.column_stack([a**order - 0.4 * a * b ** (order - 1), b**order + 0.7 * a ** (order - 1) * b - a])

    return displacement


def fem_system(mesh: Any, problem: Problem | None = None, **settings: Any) -> Any:
    pytest.importorskip("dolfinx")
    from tmc_vem.fem.system import FemSystem

    regions = problem.regions() if problem else {name: solid_region(Material(20.0, 10.0)) for name in mesh.region_names}
    return FemSystem(
        MPI.COMM_WORLD, problem.make_mesh if problem else lambda: mesh, regions, (), FemSettings(**settings)
    )


def systems() -> list[Any]:
    both = [pytest.param("vem", name, k, id=f"vem-{name}-{k}") for name in MESHES for k in VEM_ORDERS]
    return both + [
        pytest.param("fem", kind, k, id=f"fem-{kind}-{k}") for kind in ("squares", "cut") for k in FEM_ORDERS
    ]


def build(method: str, name: str, order: int) -> Any:
    if method == "vem":
        system = make_system(MESHES[name], SOLID, (), ElementSettings(order=order))
        return system, interpolate(system, field(order)), field(order), order
    mesh = grid(3, 3)
    inner = np.abs(mesh.points_vx - 0.5).max(axis=1) < 0.4
    skewed = mesh.points_vx + 0.04 * inner[:, None] * np.random.default_rng(4).uniform(-1.0, 1.0, mesh.points_vx.shape)
    system = fem_system(with_boundary(skewed, list(mesh.cells())), order=order, triangles=name == "cut")
    return system, system.interpolate(field(order)), field(order), order


def lengths(polygons: Polygons, points: Float) -> Float:
    """Perimeter of each polygon."""
    loops = [points[polygons.cell(c)] for c in range(polygons.n_cells)]
    return np.array([np.hypot(*(loop - np.roll(loop, 1, axis=0)).T).sum() for loop in loops])


@pytest.mark.parametrize(("method", "name", "order"), systems())
class TestSystem:
    """What a discretisation hands out."""

    def test_points_run_round_their_cell_and_move_as_the_field_does(self, method: str, name: str, order: int) -> None:
        system, u, displacement, _ = build(method, name, order)
        polygons = system.output_polygons()
        corners = [polygons.points_nx[polygons.cell(c)[::order]] for c in range(polygons.n_cells)]
        around = [np.hypot(*(loop - np.roll(loop, 1, axis=0)).T).sum() for loop in corners]
        assert lengths(polygons, polygons.points_nx) == pytest.approx(around, rel=1e-12)  # no way back on a side
        assert min(areas(loop[None])[0] for loop in corners) > 0.0
        assert system.output_displacements(u) == pytest.approx(displacement(polygons.points_nx), abs=1e-12)

    def test_inner_points_of_sides_are_those_of_gauss_and_lobatto(self, method: str, name: str, order: int) -> None:
        system, _, _, _ = build(method, name, order)
        polygons = system.output_polygons()
        expected = gauss_lobatto(order + 1)[0][1:-1]
        for c in range(polygons.n_cells):
            loop = polygons.points_nx[polygons.cell(c)]
            start, end = loop[::order], np.roll(loop, -order, axis=0)[::order]
            for n, t in enumerate(expected, start=1):
                assert loop[n::order] == pytest.approx(start + t * (end - start), abs=1e-12)

    def test_outlines_are_the_curves_that_the_sides_become(self, method: str, name: str, order: int) -> None:
        system, u, displacement, _ = build(method, name, order)
        fields = gather_fields(system, u, ("medium",))
        assert fields is not None
        solids = Solids(fields, np.ones(fields.polygons.n_cells, dtype=bool), order, 7)
        sides = solids.chains(np.arange(len(solids.side_nodes)))
        flat = sides.before.reshape(-1, 2)
        assert sides.now.reshape(-1, 2) - flat == pytest.approx(displacement(flat), abs=1e-12)
        # pieces are equally long: the points of a straight side are equidistant in the reference state
        pieces = np.hypot(*np.moveaxis(np.diff(sides.before, axis=1), -1, 0))
        assert pieces == pytest.approx(np.repeat(pieces[:, :1], 7, axis=1), rel=1e-9)

    def test_the_outline_that_is_watched_is_the_same_curve(self, method: str, name: str, order: int) -> None:
        system, u, displacement, _ = build(method, name, order)
        outline = OverlapWatch(system, ["medium"], order)._watched()
        flat = outline._before.reshape(-1, 2)
        assert outline._sides(u).reshape(-1, 2) - flat == pytest.approx(displacement(flat), abs=1e-12)

    def test_no_two_nodes_have_one_label(self, method: str, name: str, order: int) -> None:
        system, _, _, _ = build(method, name, order)
        labels = system.node_labels()
        assert len(labels) == system.n_dofs // 2
        assert len(np.unique(np.round(labels, 9), axis=0)) == len(labels)
        states = np.random.default_rng(2).normal(size=(2, len(labels), 2))
        order_of_another_run = np.random.default_rng(3).permutation(len(labels))
        checkpoint = Checkpoint({}, labels[order_of_another_run], states[:, order_of_another_run])
        np.testing.assert_array_equal(checkpoint.values_at(labels), states)

    def test_j_is_a_mean_over_the_area(self, method: str, name: str, order: int) -> None:
        """u = (a x^2, b x^2 y): J = (1 + 2 a x) (1 + b x^2) is no linear function, so that the rule's weights count."""
        if (method, name, order) == ("fem", "cut", 2) or (method == "vem" and order == 2):
            pytest.skip("x^2 y is no quadratic polynomial")
        a, b = 0.3, 0.9

        def bent(x: Float) -> Float:
            return np.column_stack([a * x[:, 0] ** 2, b * x[:, 0] ** 2 * x[:, 1]])

        system, _, _, _ = build(method, name, order)
        u = interpolate(system, bent) if method == "vem" else system.interpolate(bent)
        mean, _ = system.cell_jacobians(u)
        area = system.cell_areas()
        assert area.sum() == pytest.approx(1.0)
        # the mean over the unit square of (1 + 2 a x) (1 + b x^2); squares that are skewed do not have x^2 y exactly
        exact = 1.0 + a + b / 3.0 + a * b / 2.0
        skewed = method == "fem" and order == 2
        assert area @ mean == pytest.approx(exact, rel=2e-3 if skewed else 1e-9)


@pytest.mark.parametrize(("method", "order"), [("vem", 2), ("vem", 3), ("fem", 2), ("fem", 3)])
def test_mean_j_of_a_region_is_a_mean_over_its_area(method: str, order: int) -> None:
    """On rectangles, u = (a x^2, b x^2 y) and u = (a x^2, b x y) are exact; the middle of the cavity is x = 1."""
    problem = Probed(Box(cells=(20, 5)), {"of_medium": MeanJ("medium")})
    a, b = 0.2, 0.3

    def bent(x: Float) -> Float:
        return np.column_stack([a * x[:, 0] ** 2, b * x[:, 0] * x[:, 1]])

    if method == "fem":
        system = fem_system(None, problem, order=order)
        u = system.interpolate(bent)
    else:
        system = problem_system(problem, ElementSettings(order=order))
        u = interpolate(system, bent)
    value = Gauge(problem, system).read(u, system.create_vector())["of_medium"]
    # (1 + 2 a x) (1 + b x) from 0.1 to 1.9: mean of x is 1, of x^2 is 1 + 0.9^2 / 3
    assert value == pytest.approx(1.0 + 2 * a + b + 2 * a * b * (1.0 + 0.81 / 3.0), rel=1e-9)


# -- runs ------------------------------------------------------------------------------------------------------------


def options(method: str, order: int, **more: Any) -> RunOptions:
    return RunOptions(method, ElementSettings(order=order), FemSettings(order=order), steps=3, snapshots=3, **more)


@pytest.fixture(scope="module", params=[("vem", 2), ("vem", 3), ("fem", 3)], ids=lambda p: f"{p[0]}-{p[1]}")
def finished(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[RunResult, str, int]:
    method, order = request.param
    if method == "fem":
        pytest.importorskip("dolfinx")
    out = tmp_path_factory.mktemp("order") / "box"
    return run(BOX, out, options(method, order)), method, order


def test_fields_are_written_and_read_back_in_their_order(finished: tuple[RunResult, str, int]) -> None:
    result, _, order = finished
    fields = read_fields(result, snapshots(result)[-1])
    polygons = fields.polygons
    assert np.diff(polygons.offsets).tolist() == [4 * order] * 100
    assert lengths(polygons, polygons.points_nx) == pytest.approx([0.4] * 100)
    corners = polygons.points_nx[polygons.connectivity.reshape(100, -1)]
    region_c = (np.abs(corners.mean(axis=1) - (1.0, 0.25)) < (0.9, 0.15)).all(axis=1)
    assert [polygons.region_names[n] == "medium" for n in polygons.region_c] == region_c.tolist()
    loaded = np.hypot(*(polygons.points_nx - (1.0, 0.5)).T) < 1e-12
    assert fields.displacement_ni[loaded, 1] == pytest.approx(-0.06, abs=1e-14)
    # sides are smooth: the inner points of a side are near the chord of its moved ends, in their order
    moved = polygons.points_nx + fields.displacement_ni
    assert lengths(polygons, moved) == pytest.approx(lengths(polygons, polygons.points_nx), rel=0.2)
    # cell values belong to the cells beside them: their energies are those of the regions
    energy = np.bincount(polygons.region_c, fields.energy_density_c * 0.01)
    last = result.history[-1]
    assert dict(zip(polygons.region_names, energy, strict=True)) == pytest.approx(dict(last.energy), rel=1e-9)
    smallest = [fields.min_jacobian_c[polygons.region_c == n].min() for n in range(2)]
    assert dict(zip(polygons.region_names, smallest, strict=True)) == pytest.approx(dict(last.min_j), rel=1e-9)
    assert (fields.min_jacobian_c <= fields.jacobian_c).all()


def test_a_run_goes_on_from_its_checkpoint_as_if_it_had_not_stopped(
    finished: tuple[RunResult, str, int], tmp_path: Path
) -> None:
    whole, method, order = finished
    short = run(BOX, tmp_path / "box", options(method, order, max_iterations=whole.history[0].iterations + 1))
    assert not short.complete
    assert len(short.history) == 1
    resumed = run(BOX, tmp_path / "box", options(method, order), resume=True)
    assert resumed.complete
    for mine, theirs in zip(resumed.history, whole.history, strict=True):
        assert dict(mine.energy) == dict(theirs.energy)
        assert dict(mine.probes) == dict(theirs.probes)
        assert mine.reaction == theirs.reaction
