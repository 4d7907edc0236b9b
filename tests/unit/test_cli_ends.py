"""How commands end: what a run that stopped says, what resume refuses, tables of runs, figures that cannot be made."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import click
import pytest
from click.testing import CliRunner

from tmc_vem.cli import execute, resume
from tmc_vem.cli.list import list_runs
from tmc_vem.cli.plot import animate, plot
from tmc_vem.report.field_figure import Shown
from tmc_vem.results.directory import RunDirectory
from tmc_vem.results.lock import DirectoryLock
from tmc_vem.results.records import StepRecord
from tmc_vem.results.run_result import RunResult
from tmc_vem.simulation.monitor import Monitor
from tmc_vem.support.errors import ConvergenceError

RECORD = StepRecord(1, 0.5, -0.5, {"gap": 0.125}, -4.0, 3, 0, 0, {"s": 0.5}, {"s": 1.0}, 0, False, 1.5, 0.5)
RESULT = RunResult(
    inputs={"problem": "box", "gamma": 1e-3}, versions={}, complete=True, reason="full load", load=0.5, n_cells=10,
    n_dofs=20, newton_iterations=3, cut_backs=0, projection_degrees={}, seconds={"total": 1.5}, history=[RECORD],
    checks={"regulariser_energy": 0.5, "summary": "no contact", "imbalance": 0.0},
)  # fmt: skip


def written(path: Path, result: RunResult = RESULT) -> Path:
    directory = RunDirectory(path)
    directory.start({"problem": "box", "options": {"uy": -0.5}})
    for record in result.history:
        directory.add_step(record)
    directory.write_result(result)
    return path


# -- the end of a run ------------------------------------------------------------------------------------------------


def ended(monkeypatch: pytest.MonkeyPatch, result: RunResult, **options: Any) -> tuple[Any, list[Any]]:
    """What a command says whose run has this result, and how the run was asked for."""
    asked: list[Any] = []
    monkeypatch.setattr(execute, "start", lambda words: None)
    monkeypatch.setattr("tmc_vem.adapt.run.run", lambda *given, **named: asked.append((given, named)) or result)

    @click.command("box")
    @click.pass_context
    def command(context: click.Context) -> None:
        if options.pop("resumed", False):
            context.meta[execute.RESUME] = True
        execute.execute("problem", "settings", {"petsc": "", "as_json": False, "quiet": False, "out": "o", **options})

    return CliRunner().invoke(command, []), asked


def test_a_run_that_reached_its_load(monkeypatch: pytest.MonkeyPatch) -> None:
    done, asked = ended(monkeypatch, RESULT)
    assert done.exit_code == 0
    assert "load reached" in done.output
    ((given, named),) = asked
    assert given == ("problem", "o", "settings")
    assert (named["resume"], named["command"]) == (False, {"problem": "box", "options": {}})
    assert type(named["monitor"]).__name__ == "ConsoleMonitor"
    done, asked = ended(monkeypatch, RESULT, as_json=True, resumed=True)
    assert json.loads(done.output)["gap"] == 0.125
    assert (asked[0][1]["resume"], type(asked[0][1]["monitor"])) == (True, Monitor)
    done, asked = ended(monkeypatch, RESULT, quiet=True)
    assert (done.output, type(asked[0][1]["monitor"])) == ("", Monitor)


def test_a_run_that_stopped_says_where_and_what_is_kept(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    stopped = replace(RESULT, complete=False, reason="why")
    done, _ = ended(monkeypatch, stopped, quiet=True)
    assert isinstance(done.exception, ConvergenceError)
    plain = str(done.exception)
    assert "why" in plain
    assert "; " not in plain
    path = written(tmp_path / "run", stopped)
    done, _ = ended(monkeypatch, replace(stopped, directory=path), quiet=True)
    assert str(done.exception) == f"{plain}; steps up to there are in {path}"
    (path / "checkpoint.npz").write_text("")
    done, _ = ended(monkeypatch, replace(stopped, directory=path, cut_short=True), quiet=True)
    assert str(done.exception) == f"{plain}; steps up to there are in {path}; 'tmc-vem resume {path}' goes on"
    done, _ = ended(monkeypatch, replace(stopped, directory=path, history=[]), quiet=True)
    assert "steps up to there" not in str(done.exception)


# -- resume ----------------------------------------------------------------------------------------------------------


def test_what_cannot_be_resumed(tmp_path: Path) -> None:
    path = written(tmp_path / "run")

    def said(*more: str) -> str:
        return str(CliRunner().invoke(resume.resume, [str(path), *more]).exception)

    lock = DirectoryLock(path)
    assert said() == f"the run in {path} goes on: there is nothing to resume"
    lock.release()
    assert said() == (
        f"{path} has no checkpoint to go on from: run it again with --overwrite, and for the next time with "
        "checkpoints (--checkpoint-every 1 writes one after every load step)"
    )
    (path / "checkpoint.npz").write_text("")
    (path / "command.json").write_text('{"problem": "sphere", "options": {}}')
    assert said() == f"{path / 'command.json'} asks for the problem 'sphere', which does not exist"
    (path / "command.json").write_text('{"problem": "box", "options": {"zeta": 1, "uz": 1}}')
    assert said() == f"{path / 'command.json'} has the unknown option 'uz'"


def test_a_run_is_resumed_with_what_it_was_asked_for(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    path, asked = written(tmp_path / "run"), list[Any]()
    (path / "checkpoint.npz").write_text("")
    command = click.Command(
        "box", callback=lambda **given: asked.append((given, click.get_current_context().meta[execute.RESUME])),
        params=[click.Option([f"--{name}"]) for name in
                ("uy", "out", "as_json", "quiet", "max_iterations", "max_seconds")],
    )  # fmt: skip
    monkeypatch.setattr(resume, "run_group", SimpleNamespace(get_command=lambda context, name: command))
    CliRunner().invoke(resume.resume, [str(path), "--max-iterations", "7", "--quiet"], catch_exceptions=False)
    assert asked == [
        ({"uy": -0.5, "out": path, "as_json": False, "quiet": True, "max_iterations": 7, "max_seconds": None}, True)
    ]


# -- tables and figures ----------------------------------------------------------------------------------------------


def test_tables_of_runs(tmp_path: Path) -> None:
    assert CliRunner().invoke(list_runs, [str(tmp_path)]).output == f"no runs below {tmp_path}\n"
    written(tmp_path / "a")
    written(tmp_path / "b", replace(RESULT, inputs={"problem": "box", "gamma": 1e-4}, errors=["bad"], n_dofs=0))
    lines = CliRunner().invoke(list_runs, [str(tmp_path)]).output.splitlines()
    rows = [line.split() for line in lines if line.strip() and "─" not in line]
    assert rows == [
        ["run", "gamma", "load", "gap", "reaction", "doubts", "dofs", "iterations", "time", "(s)"],
        ["a", "0.001", "end", "of", "path,", "load", "0.5", "1.2500e-01", "-4.0000e+00", "20", "3", "1.5"],
        [
            "b",
            "0.0001",
            "end",
            "of",
            "path,",
            "load",
            "0.5",
            "1.2500e-01",
            "-4.0000e+00",
            "1",
            "error",
            "–",
            "3",
            "1.5",
        ],
    ]
    found = json.loads(CliRunner().invoke(list_runs, [str(tmp_path), "--json"]).output)
    assert {name: entry["inputs"]["gamma"] for name, entry in found.items()} == {"a": 1e-3, "b": 1e-4}
    csv = CliRunner().invoke(list_runs, [str(tmp_path), "--csv"]).output
    assert len(csv.splitlines()) == 3
    both = CliRunner().invoke(list_runs, [str(tmp_path), "--csv", "--json"])
    assert str(both.exception) == "--json and --csv: choose one"


def test_figures_that_cannot_be_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = written(tmp_path / "run")
    asked: list[Any] = []
    monkeypatch.setattr(
        "tmc_vem.report.run_page.run_page",
        lambda result, **given: asked.append(given) or SimpleNamespace(pictures=[SimpleNamespace(name="x")]),
    )
    monkeypatch.setattr(
        "tmc_vem.report.write.write_page", lambda page, out, name: asked.append((out, name)) or out / "r"
    )
    done = CliRunner().invoke(plot, [str(path)], catch_exceptions=False)
    assert done.output == f"{path / 'plots' / 'figures' / 'x.png'}\n{path / 'plots' / 'r'}\n"
    shown = Shown(None, math.inf, medium=False, span=None)
    CliRunner().invoke(plot, [str(path), "--out", "o", "--quantity", "J", "--states", "2"], catch_exceptions=False)
    assert asked == [
        {"quantity": "uy", "n_states": 4, "shown": shown}, (path / "plots", "run"),
        {"quantity": "J", "n_states": 2, "shown": shown}, (Path("o"), "run"),
    ]  # fmt: skip

    def full(*_: Any, **__: Any) -> Any:
        raise OSError(28, "No space left", "somewhere")

    monkeypatch.setattr("tmc_vem.report.write.write_page", full)
    done = CliRunner().invoke(plot, [str(path)])
    assert str(done.exception) == "somewhere cannot be written: No space left; --out names another place"
    done = CliRunner().invoke(animate, [str(path), "--out", "a.png"])
    assert str(done.exception) == "a.png: animations are written as .gif"
    monkeypatch.setattr("tmc_vem.report.animation.states_of", lambda result: [])
    assert str(CliRunner().invoke(animate, [str(path)]).exception) == f"{path} has no fields yet"
    monkeypatch.setattr("tmc_vem.report.animation.states_of", lambda result: ["s"])
    monkeypatch.setattr("tmc_vem.report.animation.animate", lambda *given, **named: asked.append((given, named)))
    done = CliRunner().invoke(animate, [str(path), "--seconds", "0.5", "--quantity", "J"], catch_exceptions=False)
    assert asked[-1] == ((["s"], path / "deformed.gif"), {"quantity": "J", "seconds_each": 0.5})
    assert done.output == f"{path / 'deformed.gif'}\n"
    CliRunner().invoke(animate, [str(path)], catch_exceptions=False)
    assert asked[-1][1] == {"quantity": "uy", "seconds_each": 0.25}
    monkeypatch.setattr("tmc_vem.report.animation.animate", full)
    done = CliRunner().invoke(animate, [str(path)])
    assert str(done.exception) == f"{path / 'deformed.gif'} cannot be written: No space left"
