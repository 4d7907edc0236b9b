"""Commands without their work: defaults of every option, what is made of them, lines on the terminal, refusals."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import click
import numpy as np
import pytest
from click.testing import CliRunner

from tmc_vem.cli import batch_command, execute, progress
from tmc_vem.cli import compare as comparing
from tmc_vem.cli import main as entry
from tmc_vem.cli import run as running
from tmc_vem.cli.columns import plain
from tmc_vem.cli.list import Column, _doubts, fitting
from tmc_vem.cli.mesh import describe, mesh_group
from tmc_vem.cli.resume import read_command
from tmc_vem.cli.shared_options import chosen_medium, chosen_options, parse_parameters, parse_path
from tmc_vem.mesh.files.io import read_mesh
from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
from tmc_vem.mesh.parts import with_names
from tmc_vem.problems import Bodies, Box, CBox, Medium, Punch
from tmc_vem.problems.cbox import angle_medium
from tmc_vem.results.records import StepRecord
from tmc_vem.results.run_result import RunResult
from tmc_vem.simulation import RunOptions
from tmc_vem.simulation.triangulated import Triangulated
from tmc_vem.support.errors import InputError
from tmc_vem.system.fem_settings import FemSettings
from tmc_vem.vem.spaces.element_settings import ElementSettings

# -- tmc-vem run -----------------------------------------------------------------------------------------------------


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, RunOptions, dict[str, Any]]]:
    """Problem, options and the rest that commands would run."""
    seen: list[Any] = []
    monkeypatch.setattr(running, "execute", lambda *what: seen.append(what))
    return seen


RUNS: list[tuple[str, Any]] = [
    ("box", Box(medium=Medium())),
    ("cbox", CBox(medium=angle_medium(1e-5, 1.0))),
    ("cbox --method fem", CBox(solid_cells="quadrilaterals", medium=angle_medium(1e-5, 1.0))),
    ("punch", Punch(medium=angle_medium(1e-4, 1.0))),
    ("bodies", Bodies(medium=angle_medium(1e-4, 10.0))),
    ("punch --method fem --size 0.2", Triangulated(Punch(size=0.2, medium=angle_medium(1e-4, 1.0)), 0.2)),
    ("bodies --method fem", Triangulated(Bodies(medium=angle_medium(1e-4, 10.0)), 0.1)),
    ("box --cells 20 5 --mesh voronoi --uy -0.5 --gamma 1e-3 --alpha-r 2 --beta 1 --regulariser angle",
     Box(cells=(20, 5), cell_kind="voronoi", uy=-0.5,
         medium=Medium(gamma=1e-3, alpha_r=2.0, beta=1.0, regulariser="angle"))),
    ("box --refine-medium 3 --alpha 2.5 --medium-energy balanced",
     Box(medium_refinement=3, medium=Medium(alpha=2.5, energy="balanced"))),
    ("cbox --cells 10 5 --mesh quadrilaterals --refine-medium 2 --uy -1 --alpha-r 20",
     CBox(cells=(10, 5), solid_cells="quadrilaterals", medium_refinement=2, uy=-1.0, medium=angle_medium(1e-5, 20.0))),
    ("punch --size 0.2 --stiffness 2 --gap0 0.5 --uy -1",
     Punch(size=0.2, stiffness=2.0, gap0=0.5, uy=-1.0, medium=angle_medium(1e-4, 1.0))),
    ("bodies --case 2 --size 0.15 --discs 3 --gap0 0.2 --uy 0.3",
     Bodies(case=2, size=0.15, discs=3, gap0=0.2, uy=0.3, medium=angle_medium(1e-4, 10.0))),
]  # fmt: skip


@pytest.mark.parametrize(("line", "problem"), RUNS, ids=[line for line, _ in RUNS])
def test_the_problem_of_a_command(line: str, problem: Any, asked: list[Any]) -> None:
    done = CliRunner().invoke(running.run_group, line.split(), catch_exceptions=False)
    assert done.exit_code == 0, done.output
    ((found, options, rest),) = asked
    assert found == problem
    assert options == RunOptions(method="fem" if "--method fem" in line else "vem")
    assert (rest["out"], rest["as_json"], rest["quiet"], rest["petsc"]) == (None, False, False, "")


OPTIONS: list[tuple[str, RunOptions | None]] = [
    ("--path 0,1,0.5 --follow", None),
    ("--steps 7 --path '0 1' --at 0.5 --at 0.25", RunOptions(steps=7, output_loads=(0.5, 0.25))),
    ("--path 0,1,0.5 --continuation gamma=1e-3", RunOptions(path=(0.0, 1.0, 0.5), continuation={"gamma": 1e-3})),
    ("--follow --allow-overlap --max-iterations 5 --max-seconds 2.5",
     RunOptions(follow=True, allow_overlap=True, max_iterations=5, max_seconds=2.5)),
    ("--extrapolate-gamma --steps 7", RunOptions(extrapolate_gamma=True, steps=7)),
    ("--extrapolate-gamma path --gamma-decades 4", RunOptions(extrapolate_gamma="path", gamma_decades=4)),
    ("--overwrite --checkpoint-every 3 --snapshots 4 --triangulated --solver reproducible",
     RunOptions(overwrite=True, checkpoint_every=3, snapshots=4, triangulated=True, solver="reproducible")),
    ("--order 3 --l 2 --quadrature 7 --rule triangles --interior-penalty full --eta 4",
     RunOptions(element=ElementSettings(order=3, degree=2, quadrature=7, rule="triangles", interior_penalty="full",
                                        eta=4.0))),
    ("--projection composite", RunOptions(element=ElementSettings(projection="composite"))),
    ("--method fem --order 3 --quadrature 6 --interior-penalty penalty --eta 4 --triangles",
     RunOptions(method="fem", fem=FemSettings(order=3, quadrature=6, interior_penalty="penalty", eta=4.0,
                                              triangles=True))),
]  # fmt: skip


@pytest.mark.parametrize(("line", "options"), OPTIONS, ids=[line for line, _ in OPTIONS])
def test_the_options_of_a_command(line: str, options: RunOptions | None, asked: list[Any]) -> None:
    import shlex

    done = CliRunner().invoke(running.run_group, ["box", *shlex.split(line)])
    if options is None:
        assert str(done.exception) == "follow does not go with path: the load is not prescribed along the branch"
    else:
        assert done.exit_code == 0, done.exception
        assert asked[0][1] == options


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("--method fem --l 1", "--l belongs to --method vem: finite elements project nothing"),
        ("--method fem --projection full", None),
        ("--method fem --projection composite",
         "--projection belongs to --method vem: finite elements project nothing"),
        ("--method fem --rule triangles", "--rule belongs to --method vem: finite elements have the rules of dolfinx"),
        ("--triangles", "--triangles belongs to --method fem"),
        ("--path 0,x", "--path '0,x' is not a list of load factors, for example '0 1 0'"),
        ("--param kappa", "--param 'kappa' is not NAME=VALUE, for example kappa=0.1"),
        ("--param =1", "--param '=1' is not NAME=VALUE, for example kappa=0.1"),
        ("--continuation gamma=x", "--continuation 'gamma=x' is not NAME=VALUE, for example gamma=1e-4"),
    ],
)  # fmt: skip
def test_options_that_do_not_go_together(line: str, message: str | None, asked: list[Any]) -> None:
    done = CliRunner().invoke(running.run_group, ["box", *line.split()])
    assert done.exit_code != 0
    if message is not None:
        assert str(done.exception) == message
    assert not asked


def test_lists_and_values_of_options() -> None:
    assert parse_path("0 1,0.5") == (0.0, 1.0, 0.5)
    assert parse_parameters((" a = 1", "b=2e-3")) == {"a": 1.0, "b": 2e-3}
    assert chosen_medium is running.chosen_medium
    assert chosen_options is running.chosen_options


# -- tmc-vem compare -------------------------------------------------------------------------------------------------


@pytest.fixture
def compared(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    seen: list[Any] = []
    monkeypatch.setattr(comparing, "compare_study", lambda *what: seen.append(what))
    return seen


FEM = {"penalty": FemSettings(interior_penalty="penalty"), "none": FemSettings()}
COMPARED: list[tuple[str, list[Any], str, str]] = [
    ("box", [Box(cells=(20 * n, 5 * n)) for n in (1, 2, 4)], "none", "runs/compare-box"),
    ("box --quick --uy -0.5 --gamma 1e-4", [Box(cells=(20 * n, 5 * n), uy=-0.5, medium=Medium(gamma=1e-4))
                                            for n in (1, 2, 3)], "none", "runs/compare-box"),
    ("box --factor 8 --factor 2 --factor 4 --out a", [Box(cells=(20 * n, 5 * n)) for n in (2, 4, 8)], "none", "a"),
    ("cbox", [CBox(cells=(10 * n, 5 * n), polygons_across=2 * n + 1, column_cells=n) for n in (1, 2, 4)], "none",
     "runs/compare-cbox"),
    ("punch", [Punch(size=size) for size in (0.2, 0.14, 0.1)], "penalty", "runs/compare-punch"),
    ("punch --quick --stiffness 2 --uy -1", [Punch(size=size, stiffness=2.0, uy=-1.0) for size in (0.25, 0.2, 0.15)],
     "penalty", "runs/compare-punch"),
    ("bodies", [Bodies(size=size) for size in (0.12, 0.085, 0.06)], "penalty", "runs/compare-bodies"),
    ("bodies --quick --case 2 --uy 0.2", [Bodies(size=size, case=2, uy=0.2) for size in (0.15, 0.125, 0.1)], "penalty",
     "runs/compare-bodies"),
    ("bodies --size 0.1 --size 0.05 --size 0.07", [Bodies(size=size) for size in (0.1, 0.07, 0.05)], "penalty",
     "runs/compare-bodies"),
]  # fmt: skip


@pytest.mark.parametrize(("line", "problems", "penalty", "out"), COMPARED, ids=[entry[0] for entry in COMPARED])
def test_what_is_compared(line: str, problems: list[Any], penalty: str, out: str, compared: list[Any]) -> None:
    done = CliRunner().invoke(comparing.compare_group, line.split(), catch_exceptions=False)
    assert done.exit_code == 0, done.output
    ((study, where, jobs),) = compared
    assert [level.problems["vem"] for level in study.levels] == problems
    assert study.options == {"vem": RunOptions("vem"), "fem": RunOptions("fem", fem=FEM[penalty])}
    assert where == Path(out)
    assert 1 <= jobs <= 2


def test_settings_of_a_comparison(compared: list[Any]) -> None:
    line = "cbox --order 3 --steps 5 --interior-penalty full --jobs 7"
    CliRunner().invoke(comparing.compare_group, line.split(), catch_exceptions=False)
    study, _, jobs = compared[0]
    fem = FemSettings(order=3, interior_penalty="full")
    assert study.options == {
        "vem": RunOptions("vem", element=ElementSettings(3), steps=5), "fem": RunOptions("fem", fem=fem, steps=5),
    }  # fmt: skip
    assert jobs == 7
    for given in ((1,), (1, 1, 2)):
        options = [f"--factor={n}" for n in given]
        done = CliRunner().invoke(comparing.compare_group, ["box", *options])
        assert str(done.exception) == (
            f"{len(set(given))} meshes: convergence shows on three or more, so give --factor three times"
        )


def test_commands_that_start_processes_are_refused_under_mpirun(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE"):
        monkeypatch.delenv(name, raising=False)
    batch_command.require_one_process()
    monkeypatch.setenv("PMI_SIZE", "1")
    batch_command.require_one_process()
    for name in ("PMI_SIZE", "OMPI_COMM_WORLD_SIZE"):
        monkeypatch.setenv(name, "2")
        with pytest.raises(InputError, match="call it without mpirun, with --jobs"):
            batch_command.require_one_process()
    monkeypatch.setattr("sys.argv", ["/somewhere/tmc-vem", "compare", "a b"])
    assert batch_command.command_line() == "tmc-vem compare 'a b'"


# -- execution and errors --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("as_json", "words"), [(False, ["tmc-vem", "-a", "1"]), (True, ["tmc-vem", "-a", "1", "-options_left", "0"])]
)
def test_petsc_is_started_with_the_options_that_were_given(
    as_json: bool, words: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[Any] = []

    class Enough(Exception):
        pass

    def start(given: list[str]) -> None:
        started.append(given)
        raise Enough

    monkeypatch.setattr(execute, "start", start)
    with pytest.raises(Enough):
        execute.execute(None, None, {"petsc": "-a 1", "as_json": as_json, "quiet": True, "out": None})
    assert started == [words]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("-a 'b", "--petsc '-a 'b': no closing quotation"),
        ("a", "--petsc 'a': 'a' is not an option, such as '-tmc_ksp_rtol 1e-10'"),
        ("-a 1 2", "--petsc '-a 1 2': '2' is not an option, such as '-tmc_ksp_rtol 1e-10'"),
        ("-1", "--petsc '-1': '-1' is not an option, such as '-tmc_ksp_rtol 1e-10'"),
    ],
)
def test_petsc_options_that_are_none(text: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        execute._petsc_words(text)
    assert str(caught.value) == message
    assert execute._petsc_words("-a -1 -b 'c d' -e") == ["-a", "-1", "-b", "c d", "-e"]


def test_what_a_command_was_asked_is_kept_as_plain_values() -> None:
    context: Any = SimpleNamespace(command=SimpleNamespace(name="box"), params={"out": Path("a"), "uy": -1.0})
    assert execute.asked(context) == {"problem": "box", "options": {"out": "a", "uy": -1.0}}


def test_what_was_asked_is_read_back(tmp_path: Path) -> None:
    (tmp_path / "command.json").write_text(json.dumps({"problem": "box", "options": {"cells": [20, 5], "uy": 1.0}}))
    assert read_command(tmp_path) == ("box", {"cells": (20, 5), "uy": 1.0})
    for text in ("{", "{}", "[]", '{"problem": "a", "options": 3}'):
        (tmp_path / "command.json").write_text(text)
        with pytest.raises(InputError, match=r"command\.json is damaged \(.*\): start the run anew"):
            read_command(tmp_path)
    with pytest.raises(InputError, match=r"cannot be resumed: .*; a run from Python goes on with run\(\.\.\., resume"):
        read_command(tmp_path / "nowhere")


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (InputError("a\nb"), 2, "tmc-vem: a\\nb\n"),
        (KeyboardInterrupt(), 130, "tmc-vem: interrupted\n"),
        (click.Abort(), 130, "tmc-vem: interrupted\n"),
        (BrokenPipeError(), 1, ""),
        (OSError(28, "No space left", "file"), 1, "tmc-vem: file: No space left\n"),
        (OSError("odd"), 1, "tmc-vem: odd\n"),
        (click.UsageError("bad"), 2, "tmc-vem: bad\n"),
        (click.exceptions.Exit(5), 5, ""),
    ],
)
def test_errors_become_a_line_and_a_code(
    error: BaseException, code: int, said: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: Any, **__: Any) -> None:
        raise error

    monkeypatch.setattr(entry.cli, "main", fail)
    assert entry._run([]) == code
    assert capsys.readouterr().err == said
    monkeypatch.setattr(entry.cli, "main", lambda *_, **__: 1)
    assert entry._run([]) == 1
    monkeypatch.setattr(entry.cli, "main", lambda *_, **__: "text")
    assert entry._run([]) == 0


def test_a_note_is_shown_once(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    from tmc_vem.support.notes import say

    monkeypatch.setattr(entry.cli, "main", lambda *_, **__: [say(text) for text in ("one", "two", "one")])
    assert entry._run([]) == 0
    assert capsys.readouterr().err == "tmc-vem: note: one\ntmc-vem: note: two\n"


def test_ranks_are_known_without_mpi(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(entry, "_mpi_runs", lambda: False)
    for name in ("OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE", "PMI_RANK", "PMI_SIZE"):
        monkeypatch.delenv(name, raising=False)
    assert entry._world() == (0, 1)
    monkeypatch.setenv("PMI_RANK", "3")
    assert entry._world() == (3, 1)
    monkeypatch.setenv("PMI_SIZE", "8")
    assert (entry._rank(), entry._ranks()) == (3, 8)
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", "1")
    monkeypatch.setenv("OMPI_COMM_WORLD_SIZE", "2")
    assert entry._world() == (1, 2)


# -- lines on the terminal -------------------------------------------------------------------------------------------

RECORD = StepRecord(
    step=2, load=0.5, displacement=-0.25, probes={"gap": 0.125, "side": 2.0}, reaction=-4.0, iterations=5, cut_backs=2,
    wasted_iterations=7, min_j={"solid": 0.75, "medium": 0.0625}, energy={"solid": 8.0, "medium": 0.375},
    negative_pivots=1, jumped=True, seconds=1.5, time=0.5,
)  # fmt: skip
RESULT = RunResult(
    inputs={"problem": "box", "units": {}, "medium": {"alpha": 2.5, "alpha_r": 2.25, "h": 0.3}}, versions={},
    complete=False, reason="why", load=0.5, n_cells=10, n_dofs=20, newton_iterations=30, cut_backs=4,
    projection_degrees={"2": 9, "composite": 1}, seconds={"total": 2.5, "set-up": 1.0, "other": 1.5}, history=[RECORD],
    checks={"regulariser_energy": 0.5, "summary": "no contact", "imbalance": 1e-12,
            "energy_balance": {"lost": 0.25, "jumps": [{"uncertainty": 0.5}, {"uncertainty": 0.25}]}},
    errors=["bad"], warnings=["doubtful"], directory=Path("runs/a"),
    units={"displacement": "mm", "gap": "mm", "reaction": "N/mm", "energy_solid": "N", "energy_medium": "N"},
)  # fmt: skip


def test_the_summary_of_a_run() -> None:
    rows = progress.summary_rows(RESULT)
    assert rows[1:] == [
        ("displacement", "-0.25 mm"), ("gap", "1.250000e-01 mm"), ("reaction", "-4.000000e+00 N/mm"),
        ("side", "2.000000e+00"), ("smallest J, solid", "7.5000e-01"), ("smallest J, medium", "6.2500e-02"),
        ("energy, solid", "8.000000e+00 N"), ("energy, medium", "3.750000e-01 N"), ("unstable", "1 negative pivots"),
        ("regulariser", "alpha_r = 2.25 (alpha = 2.5, h = 0.3)"),
        ("energy, regulariser", "5.000000e-01 N, a part of the medium's"), ("contact", "no contact"),
        ("energy lost", "2.500e-01 N in 2 jumps, known to 7.5e-01 N"),
        ("imbalance", "1.0e-12 of the largest reaction"),
        ("load steps", "1 with 30 Newton iterations, 4 cut-backs"),
        ("cells", "10 (l = 2: 9, composite: 1), 20 degrees of freedom"), ("time", "2.50 s (set-up 1.00, other 1.50)"),
        ("written to", "runs/a"), ("ERROR", "bad"), ("warning", "doubtful"),
    ]  # fmt: skip
    bare = replace(RESULT, history=[], checks={}, projection_degrees={}, cut_backs=0, directory=None, errors=[],
                   warnings=[], inputs={})  # fmt: skip
    assert progress.summary_rows(bare)[1:] == [
        ("load steps", "0 with 30 Newton iterations"), ("cells", "10, 20 degrees of freedom"),
        ("time", "2.50 s (set-up 1.00, other 1.50)"),
    ]  # fmt: skip


def test_a_line_for_every_tenth_of_the_load(capsys: pytest.CaptureFixture[str]) -> None:
    monitor = progress.ConsoleMonitor()
    monitor.started(Box(cells=(20, 5)), 10, 20)
    monitor.warned(["odd"])
    for time in (0.05, 0.1, 0.15, 0.199, 0.2):
        monitor.stepped(replace(RECORD, load=time, time=time, probes={} if time > 0.15 else RECORD.probes))
    monitor.finished(RESULT)
    assert capsys.readouterr().err.splitlines() == [
        "box: 10 cells, 20 degrees of freedom", "warning: odd",
        "load 0.100, step 2, gap 0.125, min J 0.062, 5 iterations", "load 0.200, step 2, min J 0.062, 5 iterations",
    ]  # fmt: skip


def test_columns_that_fit() -> None:
    columns = [Column(name, ["12345"]) for name in ("other", "medium.gamma", "load", "gap", "dofs")]
    assert [column.width for column in columns] == [8, 15, 8, 8, 8]
    assert [column.rank for column in columns] == [15, 8, 0, 1, 14]
    for width, names in (
        (47, ["other", "medium.gamma", "load", "gap", "dofs"]), (46, ["medium.gamma", "load", "gap", "dofs"]),
        (39, ["medium.gamma", "load", "gap", "dofs"]), (31, ["medium.gamma", "load", "gap"]),
        (30, ["load", "gap", "dofs"]), (0, ["load", "gap"]),
    ):  # fmt: skip
        assert [column.heading for column in fitting(columns, width)] == names, width
    counts: Any = SimpleNamespace(errors=["a"], warnings=["b", "c"])
    assert _doubts(counts) == "1 error, 2 warnings"
    assert _doubts(SimpleNamespace(errors=["a", "b"], warnings=["c"])) == "2 errors, 1 warning"  # type: ignore[arg-type]
    assert _doubts(SimpleNamespace(errors=[], warnings=[])) == ""  # type: ignore[arg-type]
    assert plain("[red]a\n").plain == "[red]a\\n"


# -- tmc-vem mesh ----------------------------------------------------------------------------------------------------


def test_what_is_said_of_a_mesh() -> None:
    x, y = np.linspace(0.0, 2.0, 3), np.linspace(0.0, 1.0, 2)
    mesh = with_names(
        structured_quadrilaterals(x, y, [Rectangle("a", 0, 2, 0, 1), Rectangle("b", 1, 2, 0, 1)]),
        {"p": (2.0, 1.0)}, {"bottom": ((0, 0), (2, 0)), "right": ((2, 0), (2, 1))},
    )  # fmt: skip
    rows = describe(mesh, 2)
    assert rows[:9] == [
        ("cells", "2, 6 vertices, 7 edges"), ("degrees of freedom", "30 for k = 2"), ("polygons", "2 with 4 sides"),
        ("region a", "1 cells, area 1"), ("region b", "1 cells, area 1"), ("named points", "p (2, 1)"),
        ("named edges", "bottom (2), right (1)"), ("cell diameter", "1.414 to 1.414"),
        ("shortest edge", "1; 0.707 of cell 0's diameter"),
    ]  # fmt: skip
    assert dict(rows)["not convex"] == "0 cells; not star-shaped about the centroid: 0"
    assert dict(describe(mesh, 3))["degrees of freedom"] == f"{2 * (6 + 7 * 2 + 2 * 3)} for k = 3"


GENERATED = [
    ("box", Box()), ("box --cells 20 5 --refine-medium 2", Box(cells=(20, 5), medium_refinement=2)),
    ("cbox --mesh quadrilaterals", CBox(solid_cells="quadrilaterals")),
    ("cbox --cells 10 5 --refine-medium 2", CBox(cells=(10, 5), medium_refinement=2)),
    ("punch --size 0.25 --gap0 0.4", Punch(size=0.25, gap0=0.4)),
    ("bodies --size 0.1 --discs 1 --gap0 0.2", Bodies(size=0.1, discs=1, gap0=0.2)),
    ("punch", Punch()), ("bodies", Bodies()), ("cbox", CBox()),
]  # fmt: skip


@pytest.mark.parametrize(("line", "problem"), GENERATED, ids=[line for line, _ in GENERATED])
def test_meshes_of_the_benchmarks(line: str, problem: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Any] = []
    monkeypatch.setattr(type(problem), "make_mesh", lambda self: made.append(self) or "mesh")
    monkeypatch.setattr("tmc_vem.cli.mesh._write", lambda mesh, out: made.append((mesh, out)))
    CliRunner().invoke(mesh_group, ["generate", *line.split(), "--out", "a.vtu"], catch_exceptions=False)
    assert made == [problem, ("mesh", Path("a.vtu"))]


@pytest.mark.parametrize(
    ("line", "cells"), [("", 200), ("--height 0.5 --size 0.25", 16), ("--width 0.5 --height 0.2 --size 0.3", 2)]
)
def test_a_rectangle_of_quadrilaterals(line: str, cells: int, tmp_path: Path) -> None:
    out = tmp_path / "a.vtu"
    command = ["generate", "rectangle", "--width", "2", "--kind", "quadrilaterals", *line.split(), "--out", str(out)]
    done = CliRunner().invoke(mesh_group, command, catch_exceptions=False)
    mesh = read_mesh(out)
    assert done.output == f"{mesh.n_cells} cells, {mesh.n_vertices} vertices written to {out}\n"
    assert mesh.n_cells == cells
    assert list(mesh.named_edges) == ["bottom", "right", "top", "left"]
    sides = {name: mesh.points_vx[edges].mean(axis=(0, 1)) for name, edges in mesh.named_edges.items()}
    width, height = mesh.points_vx.max(axis=0)
    assert [sides[name].tolist() for name in ("bottom", "right", "top", "left")] == [
        pytest.approx(place)
        for place in ((width / 2, 0.0), (width, height / 2), (width / 2, height), (0.0, height / 2))
    ]


def test_what_a_rectangle_of_voronoi_cells_is_made_with(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Any] = []

    def voronoi(regions: Any, size: float, **given: Any) -> Any:
        made.append((size, given))
        raise InputError("enough")

    monkeypatch.setattr("tmc_vem.mesh.make.voronoi.voronoi_mesh", voronoi)
    for line in ("", "--size 0.3 --relaxation 2 --shortest 0.2 --seed 5"):
        CliRunner().invoke(mesh_group, ["generate", "rectangle", *line.split(), "--out", "a.vtu"])
    assert made == [(0.1, {"relaxation": 10, "shortest": 0.15, "seed": 0}),
                    (0.3, {"relaxation": 2, "shortest": 0.2, "seed": 5})]  # fmt: skip
    done = CliRunner().invoke(mesh_group, ["generate", "rectangle", "--size", "0", "--out", "a.vtu"])
    assert str(done.exception) == "--size = 0 must be a positive number: a length"


def test_refusals_of_mesh_commands(tmp_path: Path) -> None:
    done = CliRunner().invoke(mesh_group, ["plot", "a.vtu", "--out", "a.txt"])
    assert str(done.exception) == "--out a.txt: use .png, .pdf or .svg"
    done = CliRunner().invoke(mesh_group, ["check", "a.vtu", "--tolerance", "0.1"])
    assert str(done.exception) == "--tolerance 0.1 is for --fix: give a file to write"
    done = CliRunner().invoke(mesh_group, ["check", "a.vtu", "--tolerance", "0.6", "--fix", "b.vtu"])
    assert str(done.exception) == "--tolerance = 0.6: use 0 to 0.5, a fraction of the sides; try 0.001"
