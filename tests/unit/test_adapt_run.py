"""Runs on adapted meshes: their results are those of the mesh that came out, what is refused, and how they end."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers_process import clean_environment

from tmc_vem import Box, Medium, RunOptions, run
from tmc_vem.adapt.rounds import Rounds, Standing, Watcher
from tmc_vem.adapt.store import MESH
from tmc_vem.cli import main
from tmc_vem.cli.progress import summary_rows
from tmc_vem.mesh import PolygonMesh
from tmc_vem.mesh.stored import mesh_of
from tmc_vem.problems.on_mesh import OnMesh
from tmc_vem.results.adaptivity import SOLVED, Adaptivity, Round, error_in_words
from tmc_vem.results.records import ADAPT, ADAPTED, ADAPTED_MESH, StepRecord
from tmc_vem.results.run_result import RunResult
from tmc_vem.simulation.adapt_settings import AdaptSettings
from tmc_vem.simulation.monitor import Monitor
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.simulation.simulation import prepare
from tmc_vem.support.errors import InputError
from tmc_vem.support.petsc import PETSc

BOX = Box(cells=(20, 5), uy=-0.2)
TO_GAP = AdaptSettings(of="gap", tolerance=0.005)
OPTIONS = RunOptions(adapt=TO_GAP)


def asdict_plain(settings: AdaptSettings) -> Any:
    return json.loads(json.dumps(asdict(settings)))


def last_mesh(out: Path) -> PolygonMesh:
    with np.load(out / ADAPT / MESH) as file:
        return mesh_of(file)


class Heard(Monitor):
    """Keeps what it is told."""

    def __init__(self) -> None:
        self.rounds: list[Round] = []
        self.of: list[tuple[str, ...]] = []
        self.started_with: list[int] = []
        self.loads: list[float] = []
        self.results: list[RunResult] = []

    def started(self, problem: Any, n_cells: int, n_dofs: int) -> None:
        self.started_with.append(n_cells)

    def stepped(self, record: StepRecord) -> None:
        self.loads.append(record.load)

    def adapted(self, round_: Round, of: Any) -> None:
        self.rounds.append(round_)
        self.of.append(tuple(of))

    def finished(self, result: RunResult) -> None:
        self.results.append(result)


@pytest.fixture(scope="module")
def adapted(tmp_path_factory: pytest.TempPathFactory) -> tuple[RunResult, Path, Heard]:
    out, heard = tmp_path_factory.mktemp("runs") / "adapted", Heard()
    return run(BOX, out, OPTIONS, monitor=heard), out, heard


def test_the_result_is_that_of_the_mesh(adapted: tuple[RunResult, Path, Heard]) -> None:
    """The same run on the mesh that came out, by hand."""
    result, out, _ = adapted
    mesh = last_mesh(out)
    by_hand = run(OnMesh(BOX, mesh), options=RunOptions())
    assert mesh.n_cells == result.n_cells == by_hand.n_cells > 100
    names = ("load", "iterations", "gap", "reaction", "energy", "min_j")
    for one, other in zip(result.history, by_hand.history, strict=True):
        assert [getattr(one, name) for name in names] == [getattr(other, name) for name in names]
    assert result.complete
    assert not result.warnings


def test_the_last_round_is_the_result(adapted: tuple[RunResult, Path, Heard]) -> None:
    """The state that was carried from mesh to mesh is that of loading the last mesh from the beginning."""
    result, _, _ = adapted
    assert result.adaptivity is not None
    last = result.adaptivity.last
    assert result.adaptivity.reached
    assert last.load == result.load == 1.0
    assert last.values["gap"] == pytest.approx(result.gap, rel=1e-6)
    assert last.values["reaction"] == pytest.approx(result.reaction, rel=1e-6)
    assert last.n_cells == result.n_cells
    assert last.n_dofs == result.n_dofs
    assert last.relative("gap") <= 0.005
    assert result.adaptivity.errors == last.errors
    first, *more = result.adaptivity.rounds
    assert first.relative("gap") > 0.005
    assert (first.n_cells, first.found, first.before) == (100, "loaded from the beginning", {})
    for before, after in zip(result.adaptivity.rounds, more, strict=False):
        assert after.number == before.number + 1
        assert after.n_cells > before.n_cells
        assert before.refined > 0
        assert after.before == {name: before.values[name] for name in ("energy", "reaction")}
        assert after.found.startswith("carried over")
    assert all(each.estimate == SOLVED for each in result.adaptivity.rounds)


def test_a_fine_mesh_agrees_with_the_estimate(adapted: tuple[RunResult, Path, Heard]) -> None:
    result, _, _ = adapted
    fine = run(Box(cells=(80, 20), uy=-0.2), options=RunOptions(steps=2))
    assert result.gap == pytest.approx(fine.gap, rel=0.01)  # that mesh has an error, too
    coarse = run(BOX)
    assert abs(result.gap - fine.gap) < 0.5 * abs(coarse.gap - fine.gap)


def test_what_is_written_is_read(adapted: tuple[RunResult, Path, Heard]) -> None:
    result, out, _ = adapted
    again = RunResult.read(out)
    assert again.adaptivity == result.adaptivity
    assert again.as_dict() == json.loads(json.dumps(result.as_dict()))
    assert json.loads((out / "result.json").read_text())["inputs"]["adapt"] == asdict_plain(TO_GAP)
    n = len(result.adaptivity.rounds)
    assert sorted(path.name for path in (out / ADAPT).iterdir()) == sorted(
        [*(f"round-{k:02d}.vtu" for k in range(n)), MESH, "rounds.json"]
    )
    assert (out / ADAPTED).read_text().count(".vtu") == n
    assert (out / ADAPTED_MESH).is_file()
    rows = dict(summary_rows(again))
    assert rows["estimated error, gap"].endswith("%)")
    assert f"100 to {result.n_cells} cells" in rows["mesh"]
    plain = run(BOX)
    assert plain.adaptivity is None
    assert "adaptivity" not in plain.as_dict()


@pytest.mark.parametrize(
    "damage",
    [
        lambda data: data.pop("rounds"),
        lambda data: data.update(rounds=[]),
        lambda data: data.update(rounds=[{"a": 1}]),
        lambda data: data.update(more=1),
    ],
)
def test_damaged_rounds_are_refused(adapted: tuple[RunResult, Path, Heard], damage: Any) -> None:
    data = adapted[0].adaptivity.as_dict()
    damage(data)
    with pytest.raises(TypeError, match="adaptivity has"):
        Adaptivity.from_dict(data)


def test_the_monitor_hears_of_rounds(adapted: tuple[RunResult, Path, Heard]) -> None:
    """Of the loads of the first and of the last mesh, and of one result."""
    result, _, heard = adapted
    assert tuple(heard.rounds) == result.adaptivity.rounds
    assert set(heard.of) == {("gap",)}
    assert heard.started_with == [100, result.n_cells]
    assert heard.loads.count(1.0) == 2
    assert len(heard.results) == 1


def test_errors_in_words() -> None:
    """The sign says whether the exact value is larger in size."""
    round_ = Round(0, 1.0, 1, 1, {"a": -2.0, "b": 2.0, "c": 0.0, "d": 1.0}, {"a": -0.01, "b": -0.01, "c": 1.0})
    assert error_in_words(round_, "a") == "(+0.5 %)"
    assert error_in_words(round_, "b") == "(-0.5 %)"
    assert error_in_words(round_, "d") == "without an estimate"
    assert round_.relative("c") == np.inf


# -- loads, limits, ends ---------------------------------------------------------------------------------------------


def test_loads_one_after_another() -> None:
    """The mesh is adapted at half the load, and then at the whole one; output loads on the way do not matter."""
    options = RunOptions(adapt=replace(TO_GAP, at=(0.5, 1.0)), output_loads=(0.3, 0.8))
    result = run(BOX, options=options)
    assert result.adaptivity is not None
    loads = [each.load for each in result.adaptivity.rounds]
    assert loads == sorted(loads)
    assert set(loads) == {0.5, 1.0}
    first = next(each for each in result.adaptivity.rounds if each.load == 1.0)
    assert first.found == "loaded from 0.5"
    assert first.before == {}
    assert result.adaptivity.reached
    half = [each for each in result.adaptivity.rounds if each.load == 0.5][-1]
    assert half.relative("gap") <= 0.005
    same = run(BOX, options=RunOptions(adapt=replace(TO_GAP, at=(0.5,)), output_loads=(0.3, 0.8)))
    assert same.adaptivity.rounds[-1].values == result.adaptivity.rounds[-1].values
    only = run(BOX, options=RunOptions(adapt=replace(TO_GAP, at=(1.0,))))
    assert {each.load for each in only.adaptivity.rounds} == {1.0}


def test_a_first_mesh_that_cannot_be_solved() -> None:
    """The run is that of the mesh as it is, and says why."""
    result = run(BOX, options=replace(OPTIONS, max_iterations=3))
    assert not result.complete
    assert result.cut_short
    assert result.adaptivity is None
    assert any("the mesh was not adapted: the load stopped at" in text for text in result.warnings)
    assert result.n_cells == 100


def test_a_load_that_is_not_reached_later_ends_the_rounds(monkeypatch: pytest.MonkeyPatch) -> None:
    """The mesh that was adapted at the loads before is used."""
    from tmc_vem.adapt import rounds
    from tmc_vem.adapt.solved import NotReached

    def fails(*_: Any) -> None:
        raise NotReached("the load stopped at 0.7")

    monkeypatch.setattr(rounds, "loaded_further", fails)
    result = run(BOX, options=RunOptions(adapt=replace(TO_GAP, at=(0.5, 1.0), tolerance=0.002)))
    assert result.complete
    assert result.n_cells > 100
    assert not result.adaptivity.reached
    assert result.adaptivity.reason == "the load stopped at 0.7"
    assert any("not all within 0.002: the load stopped at 0.7" in text for text in result.warnings)


@pytest.mark.parametrize(
    ("settings", "reason"),
    [({"cells": 110}, "and 110 are allowed"), ({"rounds": 1}, "1 round was made, which is all that is allowed")],
)
def test_limits(settings: dict[str, Any], reason: str) -> None:
    result = run(BOX, options=RunOptions(adapt=replace(TO_GAP, tolerance="0.01%", **settings)))
    assert result.complete
    assert not result.adaptivity.reached
    assert reason in result.adaptivity.reason
    assert any(
        text.startswith("the estimated errors are not all within 0.01%: at load 1, ") for text in result.warnings
    )
    assert len(result.adaptivity.rounds) == (1 if "cells" in settings else 2)


def test_several_results_at_once() -> None:
    result = run(BOX, options=RunOptions(adapt=AdaptSettings(of="energy, reaction", tolerance="3%")))
    last = result.adaptivity.last
    assert result.adaptivity.of == ("energy", "reaction")
    assert max(last.relative("energy"), last.relative("reaction")) <= 0.03
    assert max(result.adaptivity.rounds[0].relative(name) for name in ("energy", "reaction")) > 0.03


# -- refusals --------------------------------------------------------------------------------------------------------

REFUSED: dict[str, tuple[Any, RunOptions, str]] = {
    "name": (BOX, RunOptions(adapt=AdaptSettings(of="gap,gip")), "of = 'gip' is no result of problem 'box': gap"),
    "fem": (BOX, replace(OPTIONS, method="fem"), "virtual elements only"),
    "friction": (
        replace(BOX, medium=Medium(friction=0.3)), OPTIONS, "does not go with friction \\(in region 'medium'\\)",
    ),
    "follow": (BOX, replace(OPTIONS, follow=True), "does not go with follow"),
    "overlap": (BOX, replace(OPTIONS, allow_overlap=True), "does not go with allow_overlap"),
    "beyond": (BOX, RunOptions(adapt=replace(TO_GAP, at=(0.5, 1.5))), "at = 1.5 is beyond the last load factor, 1"),
    "back": (
        BOX, RunOptions(adapt=replace(TO_GAP, at=(0.5,)), path=(0.0, 1.0, 0.0)), "is for a load that goes from 0",
    ),
    "displacement": (BOX, RunOptions(adapt=AdaptSettings(of="displacement")), "of = 'displacement' is no result"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_does_not_go_with_it(case: str, tmp_path: Path) -> None:
    problem, options, message = REFUSED[case]
    with pytest.raises(InputError, match=message):
        run(problem, tmp_path / "out", options)
    assert not (tmp_path / "out").exists()


def test_stages_do_not(tmp_path: Path) -> None:
    (tmp_path / "staged.toml").write_text(STAGED)
    assert refused(["run", str(tmp_path / "staged.toml"), "--adapt", "energy"]).startswith(
        "tmc-vem: adapt does not go with [[stage]]"
    )


BLOCK = """
name = "block"
[shapes]
block = { rectangle = [0, 0, 1, 1] }
[regions.block]
shape = "block"
solid = { E = 1, nu = 0.3 }
[mesh]
cells = "quadrilaterals"
size = 0.25
[edges]
bottom = { line = [[0, 0], [1, 0]] }
top = { line = [[0, 1], [1, 1]] }
[[support]]
at = "bottom"
ux = 0
uy = 0
"""
STAGED = (
    BLOCK
    + """
[[stage]]
name = "first"
begins = 0
[[stage]]
name = "later"
begins = 1
[[load]]
at = "top"
uy = -0.1
history = [[0, 0], [2, 1]]
"""
)
PRESSED = (
    BLOCK
    + """
[[load]]
name = "weight"
at = "top"
traction = [0, -0.05]
"""
)
HISTORY = (
    BLOCK
    + """
[[load]]
at = "top"
uy = -0.1
history = [[0, 0], [1, 0.2], [2, 1]]
"""
)


def test_forces(tmp_path: Path) -> None:
    """The displacement is a result there, and what is reported of a force is known exactly."""
    (tmp_path / "pressed.toml").write_text(PRESSED)
    problem, options = read_problem(tmp_path / "pressed.toml")
    for of in ("displacement", "reaction, energy"):
        result = run(problem, options=replace(options, adapt=AdaptSettings(of=of, tolerance="1%")))
        assert result.complete
        assert result.adaptivity.reached
    assert result.adaptivity.rounds[0].relative("reaction") < 1e-12
    assert result.adaptivity.last.relative("energy") <= 0.01


def test_the_end_of_a_history_and_a_load_before(tmp_path: Path) -> None:
    """At 1, where a path without histories ends, too."""
    (tmp_path / "history.toml").write_text(HISTORY)
    problem, options = read_problem(tmp_path / "history.toml")
    settings = AdaptSettings(of="reaction", tolerance="10%", at=(1.0,))
    result = run(problem, tmp_path / "out", replace(options, adapt=settings))
    assert [each.load for each in result.adaptivity.rounds] == sorted(each.load for each in result.adaptivity.rounds)
    assert {each.load for each in result.adaptivity.rounds} == {1.0, 2.0}
    first = result.adaptivity.rounds[0]
    assert first.values["displacement"] == pytest.approx(-0.02)
    assert result.adaptivity.last.values["reaction"] == pytest.approx(result.reaction, rel=1e-6)
    # the problem as it was solved is there, with what it was adapted to
    again, read = read_problem(tmp_path / "out" / "problem.toml")
    assert read.adapt == settings
    assert again.name == "block"


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"tolerance": "much"}, "tolerance = 'much' is no number: write 0.5% or 0.005"),
        ({"tolerance": 0.7}, "tolerance = 0.7: use 1e-09 to 0.5"),
        ({"tolerance": "0%"}, "tolerance = 0%"),
        ({"tolerance": "nan"}, "tolerance = nan"),
        ({"rounds": 0}, "rounds = 0: use 1 to 50"),
        ({"rounds": 51}, "rounds = 51"),
        ({"cells": 0}, "cells = 0: use 1 to 10000000"),
        ({"at": (0.5, 0.5)}, "each larger than the one before"),
        ({"at": (0.0,)}, "give load factors above 0"),
        ({"of": " , "}, "names no result"),
        ({"estimator": "guess"}, "estimator"),
    ],
)
def test_settings_out_of_range(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        AdaptSettings(**{"of": "gap", **settings})


def test_a_prepared_run_has_no_adapted_mesh() -> None:
    with pytest.raises(InputError, match="not known before the run"):
        prepare(BOX, None, OPTIONS)


def test_a_resumed_run_needs_a_directory(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nothing to resume without a run directory"):
        run(BOX, None, OPTIONS, resume=True)
    with pytest.raises(InputError, match="no checkpoint to go on from"):
        run(BOX, tmp_path / "none", OPTIONS, resume=True)
    assert not (tmp_path / "none").exists()


def refused(arguments: list[str], code: int = 2) -> str:
    """What the command line says in one line, with an exit code."""
    done = subprocess.run(
        [sys.executable, "-c", "from tmc_vem.cli.main import main; main()", *arguments],
        capture_output=True, text=True, env=clean_environment(), check=False,
    )  # fmt: skip
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr
    assert done.stderr.count("\n") == 1, done.stderr
    return done.stderr


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--adapt-tolerance", "1%"], "--adapt-tolerance goes with --adapt NAMES"),
        (["--adapt", "gip"], "of = 'gip' is no result of problem 'box': gap"),
        (["--adapt", "gap", "--adapt-tolerance", "much"], "tolerance = 'much' is no number"),
        (["--adapt", "gap", "--adapt-rounds", "0"], "rounds = 0: use 1 to 50"),
        (["--adapt", "gap", "--adapt-at", "2"], "at = 2 is beyond the last load factor, 1"),
        (["--adapt", "gap", "--adapt-cells", "0"], "cells = 0: use 1 to"),
        (["--adapt", "gap", "--method", "fem"], "virtual elements only"),
        (["--adapt", "gap", "--friction", "0.3"], "does not go with friction"),
        (["--adapt", "gap", "--follow"], "does not go with follow"),
        (["--adapt", "gap", "--adapt-estimator", "guess"], "estimator"),
    ],
)
def test_the_command_line_refuses_in_a_line(
    options: list[str], message: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert main._run(["run", "box", "--cells", "20", "5", *options]) == 2
    error = capfd.readouterr().err
    assert message in error
    assert error.count("\n") == 1


# -- directories -----------------------------------------------------------------------------------------------------


def test_a_problem_that_is_refused_leaves_the_directory(adapted: tuple[RunResult, Path, Heard], tmp_path: Path) -> None:
    """What a run with --overwrite would replace is still there if its problem turns out to be wrong."""
    out = tmp_path / "out"
    kept = run(Box(cells=(20, 5), uy=-0.01), out)
    with pytest.raises(InputError, match="output load"):
        run(BOX, out, replace(OPTIONS, overwrite=True, path=(0.0, 0.5), output_loads=(0.7,)))
    assert RunResult.read(out).gap == kept.gap


def test_old_rounds_are_removed(tmp_path: Path) -> None:
    """By a run with other rounds, and by one without any."""
    out, small = tmp_path / "out", Box(cells=(20, 5), uy=-0.05)
    run(small, out, OPTIONS)
    (out / ADAPT / "round-17.vtu").write_text("of a run before")
    with pytest.raises(InputError, match="say --overwrite"):
        run(small, out, OPTIONS)
    again = run(small, out, replace(OPTIONS, overwrite=True))
    assert not (out / ADAPT / "round-17.vtu").exists()
    assert (out / ADAPT / MESH).is_file()
    assert RunResult.read(out).adaptivity == again.adaptivity
    run(small, out, RunOptions(overwrite=True))
    assert not any((out / name).exists() for name in (ADAPT, ADAPTED, ADAPTED_MESH))
    assert RunResult.read(out).adaptivity is None


def test_a_full_disk_is_said_in_a_line(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """What is there stays, and goes on later."""
    from tmc_vem.adapt import store
    from tmc_vem.support.errors import TmcError

    whole, count = store.whole_file, [0]

    def full(path: Path, **more: Any) -> Any:
        count[0] += 1
        if count[0] == 2:
            raise OSError(28, "No space left on device", str(path))
        return whole(path, **more)

    monkeypatch.setattr(store, "whole_file", full)
    with pytest.raises(TmcError, match=r"could not be written \(No space left on device\); what is there is intact"):
        run(BOX, tmp_path / "out", OPTIONS)
    assert "No space left" in RunResult.read(tmp_path / "out").reason
    monkeypatch.undo()
    result = run(BOX, tmp_path / "out", OPTIONS, resume=True)
    assert result.adaptivity.reached


def test_a_damaged_directory_is_refused(tmp_path: Path) -> None:
    run(BOX, tmp_path / "out", OPTIONS)
    path = tmp_path / "out" / ADAPT / MESH
    path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(InputError, match=r"is damaged .*run it again with --overwrite"):
        run(BOX, tmp_path / "out", OPTIONS, resume=True)


def test_what_petsc_has_of_meshes_before_is_freed(capfd: pytest.CaptureFixture[str]) -> None:
    """petsc4py puts objects aside when Python has done with them: hundreds of vectors and a factorisation a round."""

    def aside() -> int:
        capfd.readouterr()
        PETSc.garbage_view(PETSc.COMM_SELF)
        found = re.search(r"Total entries: (\d+)", capfd.readouterr().out)
        assert found is not None
        return int(found[1])

    counts = []

    class Counter(Watcher):
        def stands(self, standing: Standing) -> None:
            counts.append(aside())

    PETSc.garbage_cleanup(PETSc.COMM_SELF)
    rounds = Rounds(BOX, RunOptions(adapt=replace(TO_GAP, tolerance="0.3%", rounds=2)), (None,), Counter())
    assert aside() == 0
    rounds.go(rounds.begin())
    assert len(counts) == 3
    assert counts[1:] == [0, 0]
    assert aside() > 0  # the last round's: that they can be seen


def test_nothing_is_drawn_or_imported_for_rounds(tmp_path: Path) -> None:
    """Neither matplotlib nor vtk are needed for rounds, nor is the adaptive part for runs without."""
    code = """
import sys
from tmc_vem import Box, RunOptions
from tmc_vem.simulation.adapt_settings import AdaptSettings
from tmc_vem.adapt.rounds import Rounds, Watcher
options = RunOptions(adapt=AdaptSettings(of="gap", tolerance="5%"))
rounds = Rounds(Box(cells=(20, 5), uy=-0.05), options, (None,), Watcher())
assert rounds.go(rounds.begin()).rounds
found = {"matplotlib", "vtk", "vtkmodules", "pyvista", "meshio", "sympy", "h5py"} & set(sys.modules)
assert not found, found
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False,
                          env=clean_environment())  # fmt: skip
    assert done.returncode == 0, done.stderr


def test_meshes_that_are_made_anew_come_to_the_same() -> None:
    file = Path(__file__).parents[2] / "demos" / "problems" / "cbox_pad.toml"
    problem, options = read_problem(file, {"load.uy": -0.05, "mesh.size": 0.1})
    results = []
    for meshes in ("cut", "anew"):
        settings = AdaptSettings(of="reaction", tolerance=0.03, meshes=meshes)
        results.append(run(problem, None, replace(options, adapt=settings)))
        adaptivity = results[-1].adaptivity
        assert adaptivity is not None
        assert adaptivity.reached
        assert len(adaptivity.rounds) > 1
    assert results[1].reaction == pytest.approx(results[0].reaction, rel=0.06)
    assert results[1].n_cells != results[0].n_cells
    with pytest.raises(InputError, match="'anew' is for a problem file with shapes"):
        run(BOX, None, RunOptions(adapt=AdaptSettings("gap", meshes="anew")))
