"""Probes: their values against what is known without them, names, units, and run directories of before."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers_mesh import hanging, voronoi
from helpers_system import interpolate, make_system, problem_system, region

from tmc_vem import Box, Medium, RunOptions, RunResult, run
from tmc_vem.problems.probes import RESERVED, Displacement, Gap, MeanJ, Position, Probe, Reaction, check_probes
from tmc_vem.problems.wrapped import Probed
from tmc_vem.results.records import StepRecord
from tmc_vem.simulation.gauge import Gauge
from tmc_vem.support.errors import InputError
from tmc_vem.support.units import Units
from tmc_vem.system.places import Places
from tmc_vem.vem.spaces.element_settings import ElementSettings

SOLID = region("solid", K=20.0, mu=10.0)
BOX = Box(cells=(20, 5), uy=-0.05, medium=Medium(gamma=1e-4))
PROBES: dict[str, Probe] = {
    "node": Displacement("uy", "load"),
    "same_node": Displacement("uy", (1.0, 0.5)),
    "height": Position("y", (1.0, 0.5)),
    "same_gap": Gap((1.0, 0.4), "flange_bottom"),
    "left": Reaction("uy", "support_left"),
    "right": Reaction("uy", "support_right"),
    "cavity": MeanJ("medium"),
}


def polynomial(order: int) -> Any:
    def field(x: Any) -> Any:
        return np.column_stack([1 + x[:, 0] - 2 * x[:, 0] * x[:, 1], x[:, 1] ** order - 3 * x[:, 0]])

    return field


@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("mesh", [voronoi(30), hanging(3)], ids=["voronoi", "hanging"])
def test_polynomials_are_exact_inside_on_sides_and_at_vertices(order: int, mesh: Any) -> None:
    system = make_system(mesh, SOLID, (), ElementSettings(order=order))
    ends = mesh.points_vx[mesh.edges.vertices_ev]
    on_sides = ends[:, 0] + 0.3 * (ends[:, 1] - ends[:, 0])
    low, high = mesh.points_vx.min(axis=0), mesh.points_vx.max(axis=0)
    points = np.concatenate([np.random.default_rng(0).uniform(low, high, (100, 2)), on_sides, mesh.points_vx])
    field = polynomial(order)
    found = Places(system, points).displacements(interpolate(system, field))
    assert found == pytest.approx(field(points), abs=1e-9)


def test_on_sides_the_function_itself_is_taken_and_not_its_projection() -> None:
    """Between random nodal values, a side's trace is the parabola through its three nodes, from both cells."""
    mesh = voronoi(30)
    system = make_system(mesh, SOLID)
    u = system.create_vector()
    u.getArray()[:] = np.random.default_rng(1).uniform(-1.0, 1.0, u.getLocalSize())
    nodes, dofmap, edges = system.nodal_values(u), system.dofmap, system.distributed.edges
    start, end = (nodes[dofmap.vertex_nodes[edges.vertices_ev[:, n]]] for n in (0, 1))
    middle = nodes[dofmap.edge_nodes[:, 0]]
    t = 0.2
    expected = (1 - t) * (1 - 2 * t) * start + 4 * t * (1 - t) * middle + t * (2 * t - 1) * end
    ends = system.distributed.mesh.points_vx[edges.vertices_ev]
    points = (1 - t) * ends[:, 0] + t * ends[:, 1]
    assert Places(system, points).displacements(u) == pytest.approx(expected, abs=1e-9)
    assert Places(system, mesh.points_vx).displacements(u) == pytest.approx(nodes[dofmap.vertex_nodes], abs=1e-9)


@pytest.mark.parametrize("away", [-1e-7, -1e-11, 0.0, 1e-11, 1e-9, 1e-7, 1e-6, 1e-5])
def test_points_near_sides_do_not_snap_to_them(away: float) -> None:
    """Linear fields are exact at any distance from a side, on both sides of it and a little outside of the mesh."""
    mesh = voronoi(30)
    system = make_system(mesh, SOLID)
    ends = mesh.points_vx[mesh.edges.vertices_ev]
    along = ends[:, 1] - ends[:, 0]
    normal = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
    points = ends[:, 0] + 0.3 * along + away * normal
    points = points[((points >= -5e-7) & (points <= 1.0 + 5e-7)).all(axis=1)]

    def field(x: Any) -> Any:
        return x @ np.array([[0.3, -2.0], [1.0, 0.7]]) + [0.1, -0.2]

    assert Places(system, points).displacements(interpolate(system, field)) == pytest.approx(field(points), abs=1e-12)


def test_of_two_cells_near_a_point_the_one_that_has_it_counts() -> None:
    """Not the one of the smaller number, as far as the tolerance reaches: that would be the numbering's choice."""
    mesh = voronoi(30)
    system = make_system(mesh, SOLID)
    u = system.create_vector()
    u.getArray()[:] = np.random.default_rng(1).uniform(-1.0, 1.0, u.getLocalSize())
    inner = mesh.edges.n_cells_e == 2
    ends = mesh.points_vx[mesh.edges.vertices_ev[inner]]
    along = ends[:, 1] - ends[:, 0]
    normal = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
    middle = ends.mean(axis=1)
    steps = [Places(system, middle + away * normal).displacements(u) for away in (-2e-7, -1e-7, 0.0, 1e-7, 2e-7)]
    low, high = steps[1] - steps[0], steps[4] - steps[3]
    assert steps[2] - steps[1] == pytest.approx(low, abs=1e-10)  # straight up to the side, from either cell
    assert steps[3] - steps[2] == pytest.approx(high, abs=1e-10)
    assert np.abs(low - high).max() > 1e-8


@pytest.mark.parametrize("method", ["vem", "fem"])
def test_probes_of_a_run(method: str, tmp_path: Path) -> None:
    if method == "fem":
        pytest.importorskip("dolfinx")
    result = run(Probed(BOX, PROBES), tmp_path / "box", RunOptions(method, steps=2, snapshots=1))
    values = result.probes
    assert list(values) == ["gap", *PROBES]
    assert values["node"] == pytest.approx(-0.05, abs=1e-14)
    assert values["same_node"] == pytest.approx(-0.05, abs=1e-12)
    assert values["height"] == pytest.approx(0.45, abs=1e-12)
    assert values["same_gap"] == pytest.approx(result.gap, rel=1e-10)
    assert values["left"] + values["right"] == pytest.approx(-result.reaction, rel=1e-8)
    assert values["left"] == pytest.approx(values["right"], rel=1e-6)
    # the medium's mean of J is the cavity's area over what it was, with the inside of the walls as polygons
    mesh = result.to_pyvista()
    cells = mesh.cell_data["region"] == list(mesh.field_data["region_names"]).index("medium")
    moved = mesh.warp_by_vector("displacement").compute_cell_sizes(length=False, volume=False).cell_data["Area"]
    area = mesh.compute_cell_sizes(length=False, volume=False).cell_data["Area"]
    assert values["cavity"] == pytest.approx(moved[cells].sum() / area[cells].sum(), rel=2e-3)
    assert values["cavity"] < 0.95

    again = RunResult.read(tmp_path / "box")
    assert again.history == result.history
    assert again.units == result.units
    assert result.units["left"] == "force/length"
    assert json.loads((tmp_path / "box" / "result.json").read_text())["probes"] == dict(values)
    frame = again.to_pandas()
    assert frame["cavity"].iloc[-1] == values["cavity"]
    with pytest.raises(InputError, match="probes"):
        run(BOX, tmp_path / "box", RunOptions(method, steps=2, snapshots=1), resume=True)


def test_mean_j_of_known_states_on_cells_of_many_sizes() -> None:
    problem = Probed(
        Box(cells=(20, 5), cell_kind="voronoi"), {"of_solid": MeanJ("solid"), "of_medium": MeanJ("medium")}
    )
    system = problem_system(problem)
    gauge, residual = Gauge(problem, system), system.create_vector()
    affine = gauge.read(interpolate(system, lambda x: x @ np.array([[0.1, 0.2], [-0.3, 0.05]])), residual)
    assert affine["of_solid"] == pytest.approx(1.1 * 1.05 + 0.2 * 0.3, abs=1e-10)
    assert affine["of_medium"] == pytest.approx(affine["of_solid"], abs=1e-10)
    # u_x = 0.1 x^2, J = 1 + 0.2 x; the middle of the cavity is x = 1
    bent = gauge.read(interpolate(system, lambda x: np.column_stack([0.1 * x[:, 0] ** 2, 0.0 * x[:, 0]])), residual)
    assert bent["of_medium"] == pytest.approx(1.0 + 0.2 * 1.0, abs=1e-10)


@pytest.mark.parametrize(
    ("name", "probe", "words"),
    [
        ("reaction", Displacement("ux", "load"), "reaction: history.csv has a column of that name already"),
        ("energy_x", Displacement("ux", "load"), "energy_x: history.csv has a column"),
        ("a b", Displacement("ux", "load"), "'a b': use letters, digits"),
        ("p", Displacement("ux", "nowhere"), "probes: p: the mesh has no named point 'nowhere'"),
        ("p", Displacement("ux", (2.5, 0.1)), r"probes: p: point \(2.5, 0.1\) lies 0.5 outside of the mesh, whose "
         r"nearest point is \(2, 0.1\)"),
        ("p", Reaction("ux", "load"), "p: ux is not prescribed at 'load'.*uy at load"),
        ("p", MeanJ("air"), r"p: there is no region 'air' \(there are: solid, medium\)"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("method", ["vem", "fem"])
def test_wrong_probes_are_refused_before_anything_is_written(
    name: str, probe: Probe, words: str, method: str, tmp_path: Path
) -> None:
    if method == "fem":
        pytest.importorskip("dolfinx")
    with pytest.raises(InputError, match=words):
        run(Probed(BOX, {name: probe}), tmp_path / "out", RunOptions(method))
    assert not (tmp_path / "out").exists()


def test_a_name_twice_and_a_gap_that_is_none_are_refused() -> None:
    with pytest.raises(InputError, match="probes: gap: problem 'box' has one already"):
        Probed(BOX, {"gap": Gap((0.5, 0.0), (0.5, 0.5))})
    with pytest.raises(InputError, match="gap: reports take it for a distance"):
        check_probes({"gap": Displacement("ux", "load")}, BOX.prescribed(), ("solid", "medium"))


def test_wrong_components_and_units_are_refused() -> None:
    with pytest.raises(InputError, match="unknown displacement 'uz'"):
        Displacement("uz", "tip")
    with pytest.raises(InputError, match="finite"):
        Position("x", (0.0, float("nan")))
    with pytest.raises(InputError, match="both length and force"):
        Units("mm")
    with pytest.raises(InputError, match="unit of length"):
        Units("m m", "N")


def test_reserved_names_are_the_columns_that_are_no_probes() -> None:
    groups = {"probes", "forces", "contact", "friction", "min_j", "energy", "parameters"}
    assert set(RESERVED) == {field.name for field in dataclasses.fields(StepRecord)} - groups


OLD_HISTORY = """\
step,load,displacement,gap,reaction,iterations,cut_backs,wasted_iterations,negative_pivots,jumped,seconds,min_j_solid,energy_solid
1,0.5,-0.5,0.25,-1.5,3,0,0,0,False,0.1,0.9,1.0
2,1.0,-1.0,{gap},-2.5,4,1,2,,True,0.2,0.8,2.0
"""


@pytest.mark.parametrize(("text", "gap"), [("0.125", 0.125), ("", None)])
def test_run_directories_of_before_probes_are_read(text: str, gap: float | None, tmp_path: Path) -> None:
    (tmp_path / "history.csv").write_text(OLD_HISTORY.format(gap=text))
    entries = {
        "schema": 1, "inputs": {}, "versions": {}, "complete": True, "reason": "", "load": 1.0, "n_cells": 1,
        "n_dofs": 9, "newton_iterations": 7, "cut_backs": 1, "projection_degrees": {}, "seconds": {"total": 0.2},
    }  # fmt: skip
    (tmp_path / "result.json").write_text(json.dumps(entries))
    result = RunResult.read(tmp_path)
    assert (result.gap, result.reaction, result.units) == (gap, -2.5, {})
    assert result.history[0].probes == {"gap": 0.25}
    assert result.history[1].jumped


def test_records_of_old_checkpoints_are_read() -> None:
    record = StepRecord(1, 1.0, -1.0, {"gap": 0.5}, -2.0, 3, 0, 0, {"solid": 0.9}, {"solid": 1.0}, 0, False, 0.1)
    plain = dataclasses.asdict(record)
    assert StepRecord.from_plain(plain) == record
    del plain["probes"]
    assert StepRecord.from_plain(plain | {"gap": 0.5}) == record
    assert StepRecord.from_plain(plain | {"gap": None}).gap is None
