"""Tractions of runs: exact ones of a layer, balance of every body whatever acts on it, and what is written of them."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
import pyvista
from helpers_traction import LAYERS, LOADED, Solved, changed, solve, solved

from tmc_vem import RunOptions, RunResult
from tmc_vem.problems import Box
from tmc_vem.results.contact.curves import ContactCurves
from tmc_vem.results.contact_files import curves_at
from tmc_vem.results.records import StepRecord
from tmc_vem.simulation.contact_gauge import ContactGauge
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.support.errors import InputError
from tmc_vem.system.fem_settings import FemSettings
from tmc_vem.vem.spaces.element_settings import ElementSettings

# All but one whose solids are in a design region, which has no outlines.
DEMOS = sorted(
    file for file in (Path(__file__).parents[2] / "demos" / "problems").glob("*.toml") if file.stem != "design_c"
)
# With the slow tests: the meshes of the first three alone take seconds, and first steps of the others many iterations.
DEAR = ("gripper", "seal", "pneumatic", "shear_lag", "sliding_block", "snap_fit")
NEWTON = 1e-9  # of the largest force

KINDS = {
    "vem": ("voronoi", {}),
    "vem, k = 3": ("triangles", {"element": ElementSettings(order=3)}),
    "fem": ("triangles", {"method": "fem"}),
    "fem, k = 3": ("triangles", {"method": "fem", "fem": FemSettings(order=3, quadrature=6)}),
}


def law(stretch: float) -> float:
    """Pressure of a homogeneous layer: (2 gamma mu / 3) (l^(-5/3) - l^(1/3))."""
    return 2.0 * 1e-2 * 10.0 / 3.0 * (stretch ** (-5.0 / 3.0) - stretch ** (1.0 / 3.0))


@pytest.mark.parametrize("kind", KINDS)
def test_the_pressure_of_a_layer_is_exact(kind: str, tmp_path: Path) -> None:
    if "fem" in kind:
        pytest.importorskip("dolfinx")
    cells, options = KINDS[kind]
    found = solved(tmp_path, changed(LAYERS, ("triangles", cells)), **options)
    gap = found.result.gap
    assert gap is not None
    assert 0.02 < gap < 0.039
    pressure, curves = law(gap / 0.4), found.result.traction()
    assert curves.pressure_n == pytest.approx(pressure, rel=1e-10)
    assert curves.medium_pressure_n == pytest.approx(pressure, rel=1e-10)
    assert curves.gap_n == pytest.approx(gap, rel=1e-10)
    free = np.abs(curves.reference_nx[:, 0] - 0.5) < 0.49  # the walls hold the medium too
    assert curves.shear_n[free] == pytest.approx(0.0, abs=1e-10)
    assert found.result.checks["regulariser_share"] == pytest.approx({"low-up": 0.0}, abs=1e-10)
    pair = found.result.contact["low-up"]
    assert (pair["force_x"], pair["force_y"], pair["pressure_max"]) == pytest.approx((0.0, -pressure, pressure))
    assert (pair["gap"], pair["contact_length"], pair["centre_x"]) == pytest.approx((gap, 1.0, 0.5))
    assert "half_width" not in pair, "a level pressure has none"
    assert max(found.imbalance().values()) < NEWTON


@pytest.fixture(scope="module", params=["vem", "fem"])
def loaded(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Solved:
    """Forces, springs and an inclined support act on the surface."""
    if request.param == "fem":
        pytest.importorskip("dolfinx")
    folder = tmp_path_factory.mktemp(request.param)
    return solved(folder, LOADED, folder / "run", method=request.param, snapshots=2)


def test_loads_supports_and_contact_are_in_balance(loaded: Solved) -> None:
    assert loaded.result.complete
    assert loaded.simulation.system.turned().nodes.size, "axes of their own"
    imbalance = loaded.imbalance()
    assert imbalance.keys() == {"base", "plug"}
    assert max(imbalance.values()) < NEWTON
    # and by what a run reports, which knows nothing of nodes
    acting = [loaded.load(name) for name in ("wind", "weight", "pull")]
    total = loaded.contact("plug") + loaded.resultant("top") + sum(acting)
    assert total == pytest.approx(np.zeros(3), abs=1e-12)
    assert np.abs(loaded.contact("plug")[:2]).max() > 1e-3


def test_action_is_reaction_across_the_medium(loaded: Solved) -> None:
    """The medium touches nothing but the bodies: what it does to one it does to the other, the other way."""
    assert loaded.contact("base") == pytest.approx(-loaded.contact("plug"), abs=1e-12)


def test_integrals_of_the_curves_are_the_forces(loaded: Solved) -> None:
    curves = loaded.result.traction()
    for name in curves.bodies:
        mine = curves.between(name)
        normal, shear = curves.normal_nx[mine], curves.shear_n[mine, None]
        tangent = np.column_stack([-normal[:, 1], normal[:, 0]])
        true = -curves.pressure_n[mine, None] * normal + shear * tangent
        total = (true * curves.deformed_weight_n[mine, None]).sum(axis=0)
        assert total == pytest.approx(loaded.contact(name)[:2], abs=1e-12)
        nominal = (curves.traction_ni[mine] * curves.weight_n[mine, None]).sum(axis=0)
        assert nominal == pytest.approx(total, abs=1e-12)
    assert curves.between("base", "plug").sum() < curves.between("base").sum()
    with pytest.raises(InputError, match=r"no body 'bsae' is in medium .there is: base, plug."):
        curves.between("bsae")


def test_columns_of_the_history(loaded: Solved) -> None:
    result = loaded.result
    assert result.directory is not None
    again = RunResult.read(result.directory)
    assert again.history[-1].contact == result.history[-1].contact == result.contact == again.contact
    with (result.directory / "history.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert float(rows[-1]["contact.plug.force_y"]) == result.contact["plug"]["force_y"]
    assert rows[-1]["contact.base-plug.half_width"] == "0.0", "the gap is open"
    assert rows[-1]["contact.base-plug.centre_x"] == ""
    names = [name for name in result.reported if name.startswith("contact")]
    assert names == [f"contact.{name}" for name in ("base.force", "plug.force", "base-plug.force",
                                                    "base-plug.pressure_max", "base-plug.half_width")]  # fmt: skip
    alone = {"s": {"force": 1e-17}, "s-s": {"force": 2.0, "pressure_max": 3.0}}
    record = StepRecord(1, 1.0, 0.0, {}, 0.0, 1, 0, 0, {}, {}, 0, False, 0.0, contact=alone)
    assert record.reported == {"contact.s-s.force": 2.0, "contact.s-s.pressure_max": 3.0}
    named = {f"contact.{key}": value for key, value in {"force": 5.0, "s.force": 1.0}.items()}
    row = {name: str(value) for name, value in (record.as_row() | named).items()}
    read = StepRecord.from_row(row)
    assert (read.forces, read.contact["s"]) == ({"contact": {"force": 5.0}}, {"force": 1.0})


def same(one: ContactCurves, other: ContactCurves) -> None:
    for name, value in vars(one).items():
        expected = getattr(other, name)
        assert (
            value == expected
            if name in ("bodies", "joint", "friction")
            else np.array_equal(value, expected, equal_nan=True)
        ), name


def test_tables_and_lines_of_a_run(loaded: Solved) -> None:
    """What is read is what was written; lines have the same arrays, and a collection."""
    directory, curves = loaded.result.directory, loaded.result.traction()
    assert directory is not None
    result = RunResult.read(directory)
    same(result.traction(), curves)
    same(result.traction(1.0), curves)
    assert np.abs(result.traction(0.5).pressure_n).max() < 0.6 * curves.pressure_n.max()
    collection = (directory / "contact.pvd").read_text()
    assert collection.count("<DataSet") == 2
    assert 'file="contact/step_00002.vtu"' in collection
    lines = pyvista.read(directory / "contact" / "step_00002.vtu")
    assert lines.n_cells == len(curves) - len(curves.closed_l) + curves.closed_l.sum()
    assert lines.point_data["pressure"] == pytest.approx(curves.pressure_n)
    assert lines.point_data["traction"][:, :2] == pytest.approx(curves.traction_ni)
    assert lines.warp_by_vector("displacement").points[:, :2] == pytest.approx(curves.point_nx)
    assert lines.length > 0.0
    (directory / "contact" / "step_00001.csv").write_text("body,faces\nplug,\n")
    with pytest.raises(InputError, match=r"step_00001.csv is not a readable table of contact"):
        curves_at(result, 0.5)
    (directory / "contact" / "step_00001.csv").unlink()
    with pytest.raises(InputError, match=r"step_00001.csv cannot be read: No such file"):
        curves_at(result, 0.5)


def test_runs_without_a_surface_have_no_contact(tmp_path: Path) -> None:
    text = """name = "bar"
shapes = { a = { rectangle = [0, 0, 1, 1] } }
regions = { a = { shape = "a", solid = { E = 1, nu = 0.3 } } }
mesh = { size = 0.5 }
edges = { left = { line = [[0, 0], [0, 1]] }, right = { line = [[1, 0], [1, 1]] } }
support = [{ at = "left", ux = 0, uy = 0 }]
load = { at = "right", ux = 0.1 }
solve = { snapshots = 1 }
"""
    found = solved(tmp_path, text, tmp_path / "run")
    assert found.result.complete
    assert found.result.contact == {}
    assert found.result.curves is None
    assert not (tmp_path / "run" / "contact.csv").exists()
    assert not (tmp_path / "run" / "contact.pvd").exists()
    assert "contact" not in found.result.as_dict()
    with pytest.raises(InputError, match=r"has no contact\.csv: no solid is in medium"):
        found.result.traction()


def test_tractions_of_runs_in_memory(tmp_path: Path) -> None:
    """The last step's alone; a body that faces itself."""
    found = solve(Box((20, 5), uy=-0.2), RunOptions(steps=2))
    assert max(found.imbalance().values()) < NEWTON
    curves = found.result.traction()
    assert curves.bodies == ("solid",)
    assert curves.closed_l.tolist() == [True]
    with pytest.raises(InputError, match="kept in memory only"):
        found.result.traction(0.5)
    pair = found.result.contact["solid-solid"]
    assert pair["force_y"] > 1e-4, "the first outline is the lower one of the cavity's, on the left as seen from it"


def test_sides_of_an_interior_penalty_belong_to_the_medium(tmp_path: Path) -> None:
    element = ElementSettings(interior_penalty="full")
    found = solved(tmp_path, changed(LOADED, ("steps = 2", "steps = 1")), element=element)
    assert max(found.imbalance().values()) < NEWTON
    assert found.contact("base") == pytest.approx(-found.contact("plug"), abs=1e-12)


@pytest.mark.parametrize("file", [file for file in DEMOS if file.stem not in DEAR], ids=lambda file: file.stem)
def test_every_body_of_every_demo_is_in_balance(file: Path) -> None:
    """As far as a few iterations take it, on triangles; the whole path is a slow test."""
    problem, given = read_problem(file, {"mesh.cells": "triangles"})
    values = {name: getattr(given, name) for name in given.__dataclass_fields__}
    found = solve(problem, RunOptions(**values | {"max_iterations": 4}))
    imbalance = found.imbalance()
    assert imbalance
    assert max(imbalance.values()) < NEWTON


@pytest.mark.slow
@pytest.mark.parametrize("file", DEMOS, ids=lambda file: file.stem)
def test_every_body_of_every_demo_is_in_balance_at_the_end(file: Path) -> None:
    problem, options = read_problem(file)
    assert max(solve(problem, options).imbalance().values()) < NEWTON


def test_a_gauge_is_made_of_the_cells_at_the_surface_only(loaded: Solved) -> None:
    gauge = loaded.simulation.recorder.contact
    assert isinstance(gauge, ContactGauge)
    asked = gauge.chosen_c
    assert 0 < asked.sum() < len(asked)
