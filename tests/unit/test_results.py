"""Run directories survive a round trip, and what is not one is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from mpi4py import MPI

from tmc_vem import Box, Medium, RunOptions, prepare, run
from tmc_vem.cli.progress import summary_rows
from tmc_vem.results.directory import RunDirectory
from tmc_vem.results.run_result import RunResult
from tmc_vem.results.snapshots import read_fields, snapshots
from tmc_vem.simulation.end_checks import imbalance, second_gradient_energy
from tmc_vem.simulation.recorder import Recorder
from tmc_vem.support.distributed import Vec
from tmc_vem.support.errors import InputError
from tmc_vem.support.petsc import PETSc
from tmc_vem.support.timing import Timer
from tmc_vem.system.discretisation import Discretisation, Evaluation, RegionValues
from tmc_vem.system.fields import Fields, Polygons
from tmc_vem.vem.spaces.element_settings import ElementSettings


@pytest.fixture(scope="module")
def short_run(tmp_path_factory: pytest.TempPathFactory) -> RunResult:
    out = tmp_path_factory.mktemp("runs") / "box"
    return run(Box(cells=(20, 5), uy=-0.02, medium=Medium(gamma=1e-4)), out, RunOptions(snapshots=0))


def test_round_trip(short_run: RunResult) -> None:
    assert short_run.directory is not None
    again = RunResult.read(short_run.directory)
    assert again.history == short_run.history
    assert again.as_dict() == json.loads(short_run.to_json())


def test_fields_are_read_back_with_their_regions(tmp_path: Path) -> None:
    run(Box(cells=(20, 5), uy=-0.02, medium=Medium(gamma=1e-4)), tmp_path / "box", RunOptions(snapshots=1))
    result = RunResult.read(tmp_path / "box")
    polygons = read_fields(result, snapshots(result)[-1]).polygons
    medium = polygons.region_c == polygons.region_names.index("medium")
    middles = np.array([polygons.points_nx[polygons.cell(c)].mean(axis=0) for c in range(polygons.n_cells)])
    cavity = (np.abs(middles[:, 0] - 1.0) < 0.9) & (np.abs(middles[:, 1] - 0.25) < 0.15)
    assert (medium == cavity).all()


def test_python_and_history_agree(short_run: RunResult) -> None:
    assert short_run.gap == short_run.history[-1].gap
    assert short_run.newton_iterations == sum(r.iterations + r.wasted_iterations for r in short_run.history)
    assert short_run.history[-1].displacement == -0.02


def test_reading_refuses_what_is_not_a_run(tmp_path: Path, short_run: RunResult) -> None:
    with pytest.raises(InputError, match="not a run directory"):
        RunResult.read(tmp_path)
    (tmp_path / "result.json").write_text("{")
    with pytest.raises(InputError, match="readable"):
        RunResult.read(tmp_path)


def test_reading_refuses_a_newer_schema(tmp_path: Path, short_run: RunResult) -> None:
    data = short_run.as_dict() | {"schema": 99}
    (tmp_path / "result.json").write_text(json.dumps(data))
    (tmp_path / "history.csv").write_text("step\n")
    with pytest.raises(InputError, match="newer version"):
        RunResult.read(tmp_path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"schema": 0}, "old version"),
        ({"schema": None}, "before run directories had a schema number"),
        ({"n_dofs": "gone"}, "'n_dofs' is missing"),
    ],
)
def test_reading_refuses_an_old_schema_and_says_what_is_missing(
    tmp_path: Path, short_run: RunResult, change: dict[str, object], message: str
) -> None:
    assert short_run.directory is not None
    data = short_run.as_dict() | change
    if change.get("n_dofs") == "gone":
        del data["n_dofs"]
    (tmp_path / "result.json").write_text(json.dumps(data))
    (tmp_path / "history.csv").write_text((short_run.directory / "history.csv").read_text())
    with pytest.raises(InputError, match=message):
        RunResult.read(tmp_path)


def test_a_directory_from_before_the_checks_is_read(tmp_path: Path, short_run: RunResult) -> None:
    assert short_run.directory is not None
    data = short_run.as_dict()
    del data["checks"]
    (tmp_path / "result.json").write_text(json.dumps(data))
    (tmp_path / "history.csv").write_text((short_run.directory / "history.csv").read_text())
    again = RunResult.read(tmp_path)
    assert again.checks == {}
    assert again.history == short_run.history


def test_a_number_that_is_none_becomes_null(short_run: RunResult) -> None:
    from dataclasses import replace

    text = replace(short_run, load=float("nan")).to_json()
    assert json.loads(text)["load"] is None


def test_directory_below_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be made"):
        RunDirectory(tmp_path / "file" / "run")


def test_options_are_checked() -> None:
    with pytest.raises(InputError, match="unknown method"):
        RunOptions(method="bem")
    with pytest.raises(InputError, match="largest step"):
        RunOptions(largest_step=0.0)


def test_merging_fields_keeps_cells_apart() -> None:
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])

    def part(x: float) -> Fields:
        polygons = Polygons(square + np.array([x, 0.0]), np.array([0, 4]), np.arange(4), np.array([0]), ("solid",))
        return Fields(polygons, np.full((4, 2), x), np.array([x]), np.array([x]), np.array([x]))

    merged = Fields.merge([part(0.0), part(1.0)])
    assert merged.polygons.n_cells == 2
    for c, x in enumerate((0.0, 1.0)):
        assert merged.polygons.points_nx[merged.polygons.cell(c), 0].min() == x
        assert (merged.displacement_ni[merged.polygons.cell(c)] == x).all()


def test_timer_counts_nested_phases_once() -> None:
    timer = Timer()
    with timer("outer"), timer("inner"):
        sum(range(10000))
    report = timer.report()
    assert sum(report[phase] for phase in ("outer", "inner", "other")) == pytest.approx(report["total"])
    assert report["inner"] > report["outer"]


def test_last_state_is_checked(short_run: RunResult) -> None:
    checks = short_run.checks
    assert not checks["interpenetrates"]
    assert checks["imbalance"] < 1e-9
    assert 0.0 < checks["regulariser_energy"] < short_run.history[-1].energy["medium"]


def test_energy_between_cells_is_told_apart() -> None:
    """The regulariser's 0.5 of the cells' 3, and what the regions have beyond the cells."""

    def cell_energies(u: object, without: str = "") -> object:
        return np.array([1.0, 1.5]) if without == "alpha_r" else np.array([1.0, 2.0])

    points = SimpleNamespace(region="medium", w_cq=np.array([[2.0]]))
    rubbed = SimpleNamespace(points=points, response=SimpleNamespace(energy=np.array([[0.5]])))
    system = SimpleNamespace(cell_energies=cell_energies, comm=MPI.COMM_SELF, friction_states=lambda u: iter([rubbed]))
    regions = {"solid": RegionValues(1.0, 1.0), "medium": RegionValues(3.25, 1.0)}
    for inputs, expected in (
        ({"interior_penalty": "full"}, {"regulariser_energy": 0.5, "penalty_energy": 0.25}),
        ({"interior_penalty": "none"}, {"regulariser_energy": 0.5}),
        ({}, {"regulariser_energy": 0.5}),
    ):
        u = cast(PETSc.Vec, None)
        made = cast(Discretisation, system)
        assert second_gradient_energy(made, u, Evaluation(4.25, regions), inputs) == expected


def test_the_summary_says_how_much_is_between_cells(short_run: RunResult) -> None:
    assert "penalty_energy" not in short_run.checks
    box = Box(cells=(20, 5), uy=-0.02, medium=Medium(gamma=1e-4))
    penalised = run(box, options=RunOptions(element=ElementSettings(interior_penalty="full"), steps=1))
    cells, sides = (penalised.checks[name] for name in ("regulariser_energy", "penalty_energy"))
    assert 0.0 < abs(sides) < cells < penalised.history[-1].energy["medium"]
    lines = [dict(summary_rows(result))["energy, regulariser"] for result in (short_run, penalised)]
    assert lines[0] == f"{short_run.checks['regulariser_energy']:.6e}, a part of the medium's"
    assert lines[1] == f"{cells:.6e} in cells, {sides:.6e} between them, a part of the medium's"


def test_the_smallest_j_between_quadrature_points_is_reported(short_run: RunResult) -> None:
    dense, rows = short_run.checks["dense_min_j"], dict(summary_rows(short_run))
    assert short_run.checks["inverted_cells"] == {}
    assert list(dense) == ["solid", "medium"]
    for region, smallest in dense.items():
        assert 0.0 < smallest < short_run.min_j[region]  # at vertices, in a box that bends
        points, between = rows[f"smallest J, {region}"].split(", ")
        assert points == f"{short_run.min_j[region]:.4e}"
        assert between == f"{smallest:.2e} between quadrature points"
    old = replace(short_run, checks={name: v for name, v in short_run.checks.items() if name != "dense_min_j"})
    assert dict(summary_rows(old))["smallest J, medium"] == f"{old.min_j['medium']:.4e}"


def test_cells_of_all_ranks_count_between_quadrature_points() -> None:
    """Two cells of one region and two of another here, others on another rank; 0 and no number are not positive."""
    system = SimpleNamespace(
        output_polygons=lambda: SimpleNamespace(region_c=np.array([0, 1, 1, 0]), region_names=("a", "b", "c")),
        dense_jacobians=lambda u: np.array([0.5, -0.25, 0.0, 0.75]),
        comm=SimpleNamespace(allgather=lambda mine: [mine, [(0, 0.125), (1, -0.5), (1, np.nan)]]),
    )
    found = Recorder._between_the_points(cast(Recorder, SimpleNamespace(system=system)), cast(Vec, None))
    assert found["inverted_cells"] == {"b": 3, "c": 1}
    assert {name: value for name, value in found["dense_min_j"].items() if name != "c"} == {"a": 0.125, "b": -0.5}
    assert np.isnan(found["dense_min_j"]["c"])


@pytest.mark.parametrize("component", [0, 1])
def test_reactions_that_do_not_balance_are_seen_in_either_direction(component: int) -> None:
    """Two held nodes with forces that add up to 3 in one direction; the largest is 4."""
    forces = np.zeros((4, 2))
    forces[1], forces[2] = (-4.0, -4.0), (4.0, 4.0)
    forces[1, component] += 3.0
    residual = PETSc.Vec().createWithArray(forces.ravel().copy())
    held = lambda vector: vector.getArray().reshape(-1, 2)[1:3]  # noqa: E731
    system = SimpleNamespace(held_forces=held, comm=MPI.COMM_SELF, size=2.0)

    def of(residual: Any, loads: Any, before: float = 0.0) -> float:
        first = SimpleNamespace(energy={"a": before, "b": before}, forces={})
        steps = [first, SimpleNamespace(energy={"a": 0.0}, forces=loads)]
        return imbalance(cast(Discretisation, system), residual, cast(Any, steps))

    assert of(residual, {}) == pytest.approx(3.0 / 4.0)
    assert imbalance(cast(Discretisation, system), residual, ()) == pytest.approx(3.0 / 4.0)
    axes = ("force_x", "force_y")
    push, pull = ({name: sign * float(axes.index(name) == component) for name in axes} for sign in (5.0, -8.0))
    measures = {"push": push, "pull": pull}  # -3 together
    assert of(residual, measures) == 0.0
    assert of(residual, {"push": push}) == pytest.approx(8.0 / 5.0), "relative to the force"
    forces[1, component] = -4.0
    balanced = PETSc.Vec().createWithArray(forces.ravel().copy())
    assert of(balanced, {}) == 0.0
    # an energy of 4e7 on the way asks for forces of 4e7 / 2.0 * 1e-6 or more
    assert of(residual, {}, before=2e7) == pytest.approx(3.0 / 20.0)


def test_both_methods_give_the_regulariser_the_same_energy(short_run: RunResult) -> None:
    pytest.importorskip("dolfinx")
    box = Box(cells=(20, 5), uy=-0.02, medium=Medium(gamma=1e-4))
    fem = run(box, options=RunOptions(method="fem"))
    assert fem.checks["regulariser_energy"] == pytest.approx(short_run.checks["regulariser_energy"], rel=0.05)


def test_media_of_a_directory_from_before_they_were_written_down(tmp_path: Path) -> None:
    """Names told then; only where nothing else does."""
    fine = Medium(gamma=1e-4)
    run(Box(cells=(20, 5), uy=-0.02, medium=fine), tmp_path / "box", RunOptions(steps=1, snapshots=0))
    path = tmp_path / "box" / "result.json"
    data = json.loads(path.read_text())
    assert data["media"] == ["medium"]
    for media, expected in ((["solid"], ["solid"]), ([], []), (None, ["medium"])):
        path.write_text(json.dumps(data | {"media": media}))
        assert list(RunResult.read(tmp_path / "box").media) == expected
    del data["media"]
    path.write_text(json.dumps(data))
    assert list(RunResult.read(tmp_path / "box").media) == ["medium"]


def test_a_run_without_a_result_knows_its_media(tmp_path: Path) -> None:
    box = Box(cells=(20, 5), uy=-0.02, medium=Medium(gamma=1e-4))
    simulation = prepare(box, tmp_path / "box", RunOptions(steps=2, snapshots=0))

    def fail(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    simulation.recorder.finish = fail  # type: ignore[method-assign, assignment]
    with pytest.raises(KeyboardInterrupt):
        simulation.go()
    assert not (tmp_path / "box" / "result.json").exists()
    assert list(RunResult.read(tmp_path / "box").media) == ["medium"]
    assert json.loads((tmp_path / "box" / "run.json").read_text())["media"] == ["medium"]


@pytest.mark.parametrize(("name", "said"), [("run/x", ""), ("run/fields/x", " (run/fields/x)"), (None, "")])
def test_what_cannot_be_written_is_named_unless_it_is_in_the_directory_itself(
    name: str | None, said: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def fails(**_: object) -> None:
        raise OSError(28, "No space left on device", name)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("tempfile.TemporaryFile", fails)
    with pytest.raises(InputError) as raised:
        RunDirectory("run")
    assert str(raised.value) == f"output directory run cannot be written: No space left on device{said}; choose another"
    assert not Path("run").exists()
