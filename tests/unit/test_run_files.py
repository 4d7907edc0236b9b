"""What stands in the files of a run, value by value, and what is said of those that are damaged or incomplete."""

from __future__ import annotations

import fcntl
import json
import os
import socket
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tmc_vem.results.directory import RunDirectory
from tmc_vem.results.energy_balance import energy_balance
from tmc_vem.results.lock import ATTEMPTS, LOCK, DirectoryLock, is_held
from tmc_vem.results.records import COLUMNS, StepRecord, finite, heading
from tmc_vem.results.run_result import RunResult
from tmc_vem.results.unfinished import how_to_go_on, process_facts, unfinished
from tmc_vem.support.errors import InputError

RECORD = StepRecord(
    step=3, load=0.5, displacement=-0.25, probes={"gap": 0.125, "side": 2.0}, reaction=-4.0, iterations=5, cut_backs=2,
    wasted_iterations=7, min_j={"solid": 0.75, "medium": 0.0625}, energy={"solid": 8.0, "medium": 0.375},
    negative_pivots=1, jumped=True, seconds=1.5, time=0.625, parameters={"gamma": 1e-3}, load_force=16.0,
)  # fmt: skip
ROW = {
    "step": 3, "load": 0.5, "displacement": -0.25, "gap": 0.125, "side": 2.0, "reaction": -4.0, "iterations": 5,
    "cut_backs": 2, "wasted_iterations": 7, "negative_pivots": 1, "jumped": True, "seconds": 1.5, "time": 0.625,
    "load_force": 16.0, "min_j_solid": 0.75, "min_j_medium": 0.0625, "energy_solid": 8.0, "energy_medium": 0.375,
    "parameter_gamma": 1e-3,
}  # fmt: skip
RESULT = RunResult(
    inputs={"problem": "box", "units": {"length": "mm", "force": "N"}}, versions={"tmc-vem": "1"}, complete=False,
    reason="why", load=0.5, n_cells=10, n_dofs=20, newton_iterations=30, cut_backs=4, projection_degrees={"2": 10},
    seconds={"total": 2.5}, history=[RECORD], checks={"imbalance": 0.0}, parallel={"ranks": 1}, errors=["bad"],
    warnings=["doubtful"], units={"reaction": "N/mm", "min_j_solid": "1"}, cut_short=True, media=["medium"],
)  # fmt: skip


# -- records ---------------------------------------------------------------------------------------------------------


def test_a_record_is_a_row_and_back() -> None:
    assert RECORD.as_row() == ROW
    assert list(RECORD.as_row()) == list(ROW)
    assert StepRecord.from_row({name: str(value) for name, value in ROW.items()}) == RECORD
    assert (RECORD.coordinate, RECORD.gap) == (0.625, 0.125)


def test_a_record_of_old_runs() -> None:
    old = replace(RECORD, time=None, load_force=None, negative_pivots=None, parameters={}, probes={}, jumped=False)
    row = {name: str(value) for name, value in old.as_row().items()}
    assert row["negative_pivots"] == row["time"] == row["load_force"] == ""
    assert StepRecord.from_row(row) == old
    del row["time"], row["load_force"]
    assert StepRecord.from_row(row) == old
    assert (old.coordinate, old.gap) == (0.5, None)


def test_a_record_of_a_checkpoint_and_of_the_first_checkpoints() -> None:
    plain = dict(vars(RECORD))
    assert StepRecord.from_plain(plain) == RECORD
    del plain["probes"]
    assert StepRecord.from_plain({**plain, "gap": 0.25}).probes == {"gap": 0.25}
    assert StepRecord.from_plain({**plain, "gap": None}).probes == {}


def test_columns_and_headings() -> None:
    assert COLUMNS == ("step", "load", "displacement", "reaction", "iterations", "cut_backs", "wasted_iterations",
                       "negative_pivots", "jumped", "seconds", "time", "load_force")  # fmt: skip
    assert [heading("reaction", unit) for unit in ("N/mm", "1", "")] == ["reaction [N/mm]", "reaction", "reaction"]
    odd = {"a": [1.0, float("inf"), (float("nan"),)], "b": {"c": -float("inf"), "d": "text"}}
    assert finite(odd) == {"a": [1.0, None, [None]], "b": {"c": None, "d": "text"}}


# -- results ---------------------------------------------------------------------------------------------------------


def test_the_content_of_result_json() -> None:
    assert json.loads(RESULT.to_json()) == {
        "schema": 2, "limit": None, "complete": False, "state": "stopped", "reason": "why", "cut_short": True,
        "load": 0.5,
        "displacement": -0.25, "gap": 0.125, "reaction": -4.0, "probes": {"gap": 0.125, "side": 2.0},
        "min_j": {"solid": 0.75, "medium": 0.0625}, "energy": {"solid": 8.0, "medium": 0.375},
        "units": {"reaction": "N/mm", "min_j_solid": "1"}, "media": ["medium"], "n_cells": 10, "n_dofs": 20, "steps": 1,
        "newton_iterations": 30, "cut_backs": 4, "negative_pivots": 1, "projection_degrees": {"2": 10},
        "checks": {"imbalance": 0.0}, "parallel": {"ranks": 1}, "errors": ["bad"], "warnings": ["doubtful"],
        "seconds": {"total": 2.5}, "inputs": {"problem": "box", "units": {"length": "mm", "force": "N"}},
        "versions": {"tmc-vem": "1"},
    }  # fmt: skip
    nothing = replace(RESULT, history=[], complete=True).as_dict()
    assert [nothing[name] for name in ("displacement", "gap", "reaction", "probes", "min_j", "energy", "steps")] == [
        0.0, None, None, {}, {}, {}, 0,
    ]  # fmt: skip
    assert (nothing["negative_pivots"], nothing["state"]) == (None, "complete")
    assert [RESULT.unit(column) for column in ("reaction", "min_j_solid", "load")] == ["N/mm", "", ""]
    assert replace(RESULT, inputs={}).unit("reaction") == ""
    assert replace(RESULT, unfinished="running").state == "running"


def written(path: Path, **changes: Any) -> Path:
    """A run directory whose result.json has other values; None leaves one out."""
    directory = RunDirectory(path)
    directory.start({"problem": "box", "options": {}})
    directory.add_step(RECORD, RESULT.units)
    directory.write_result(RESULT)
    data = {**json.loads((path / "result.json").read_text()), **changes}
    kept = {name: value for name, value in data.items() if value is not None}
    (path / "result.json").write_text(json.dumps(kept))
    return path


def test_a_result_is_read_back(tmp_path: Path) -> None:
    assert (written(tmp_path / "run") / "history.csv").read_text().splitlines()[0] == (
        "step,load,displacement,gap,side,reaction [N/mm],iterations,cut_backs,wasted_iterations,negative_pivots,jumped,"
        "seconds,time,load_force,min_j_solid,min_j_medium,energy_solid,energy_medium,parameter_gamma"
    )
    assert RunResult.read(tmp_path / "run") == replace(RESULT, directory=tmp_path / "run")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        *(({name: 5}, f"{name} = 5 has the wrong type") for name in
          ("inputs", "versions", "projection_degrees", "seconds", "checks", "parallel", "complete", "reason",
           "cut_short", "errors", "warnings", "media")),
        *(({name: "5"}, f"{name} = '5' has the wrong type") for name in
          ("n_cells", "n_dofs", "newton_iterations", "cut_backs", "load", "unfinished")[:5]),
        ({"errors": [1]}, "errors = [1] are no sentences"),
        ({"warnings": [1]}, "warnings = [1] are no sentences"),
        ({"media": [1]}, "media = [1] are no names"),
        ({"seconds": {"set-up": 1.0}}, "seconds = {'set-up': 1.0} are no times, with a total"),
        ({"seconds": {"total": "1"}}, "seconds = {'total': '1'} are no times, with a total"),
        ({"steps": 2}, "history.csv has 1 of 2 steps"),
        ({"n_cells": None}, "'n_cells' is missing; run it again"),
    ],
)  # fmt: skip
def test_a_damaged_result_is_said_in_one_line(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as caught:
        RunResult.read(written(tmp_path / "run", **changes))
    assert str(caught.value) == f"{tmp_path / 'run'} is not a readable run directory: {message}"


@pytest.mark.parametrize(
    ("schema", "message"),
    [
        (None, " was written before run directories had a schema number: run it again"),
        (3, " was written by a newer version (schema 3, known up to 2): update tmc-vem"),
        (0, " was written by an old version (schema 0, read from 1 on): run it again"),
    ],
)
def test_results_of_other_versions(tmp_path: Path, schema: int | None, message: str) -> None:
    with pytest.raises(InputError) as caught:
        RunResult.read(written(tmp_path / "run", schema=schema))
    assert str(caught.value) == f"{tmp_path / 'run'}{message}"


def test_what_the_first_runs_did_not_say_has_defaults(tmp_path: Path) -> None:
    old = dict.fromkeys(("checks", "parallel", "errors", "warnings", "cut_short", "media"))
    found = RunResult.read(written(tmp_path / "run", **old))
    assert (found.checks, found.parallel, found.errors, found.warnings, found.cut_short) == ({}, {}, (), (), False)
    assert list(found.media) == ["medium"], "by its name"


def test_the_totals_of_a_run_without_a_result(tmp_path: Path) -> None:
    directory = RunDirectory(tmp_path / "run")
    directory.start()
    directory.begin({"inputs": {"problem": "box"}, "n_cells": 5}, locked=False)
    empty = RunResult.read(tmp_path / "run")
    assert (empty.load, empty.newton_iterations, empty.cut_backs, empty.seconds) == (0.0, 0, 0, {"total": 0.0})
    for record in (RECORD, replace(RECORD, step=4, load=0.75, seconds=9.0), replace(RECORD, step=5)):
        directory.add_step(record)
    with (tmp_path / "run" / "history.csv").open("a") as file:
        file.write("6,0.8")  # was being written
    found = RunResult.read(tmp_path / "run")
    assert (found.load, found.newton_iterations, found.cut_backs, found.seconds) == (0.5, 36, 6, {"total": 1.5})
    assert (found.steps, found.n_cells, found.n_dofs, found.state) == (3, 5, 0, "running")


# -- run directories -------------------------------------------------------------------------------------------------


def test_steps_with_more_columns_make_the_history_anew(tmp_path: Path) -> None:
    directory = RunDirectory(tmp_path / "run")
    directory.start()
    first = replace(RECORD, parameters={}, step=1)
    directory.rewrite_history([first, RECORD], {"reaction": "N/mm"})
    lines = (tmp_path / "run" / "history.csv").read_text().splitlines()
    assert (lines[0].split(",")[5], lines[0].split(",")[-1]) == ("reaction [N/mm]", "parameter_gamma")
    assert (lines[1].split(",")[0], lines[1].split(",")[-1]) == ("1", "")
    assert lines[2].split(",")[-1] == "0.001"
    directory.rewrite_history([])
    assert (tmp_path / "run" / "history.csv").read_text().strip() == "step"


def test_a_start_takes_away_what_a_run_has_left_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "run"
    own = ("result.json", "history.csv", "fields.pvd", "triangulated.pvd", "deformed.png", "command.json", "run.json",
           "checkpoint.npz", "checkpoint-before.npz", "checkpoint-part-000001-1.npz", ".unfinished-history-x.csv",
           "fields/step_00001.vtu", "adapted.png", "adapt.pvd", "mesh.vtu", "adapt/round-00.vtu")  # fmt: skip
    for folder in ("fields", "adapt"):
        (path / folder).mkdir(parents=True)
    for name in (*own, "notes.txt"):
        (path / name).write_text("")
    with pytest.raises(InputError, match="has a run in it: choose another, or say --overwrite"):
        RunDirectory(path)
    RunDirectory(path, overwrite=True).start({"problem": "box"})
    assert sorted(entry.relative_to(path).as_posix() for entry in path.rglob("*")) == [
        "command.json", "fields", "notes.txt",
    ]  # fmt: skip
    assert json.loads((path / "command.json").read_text()) == {"problem": "box"}


def test_a_directory_with_other_things_is_refused_and_a_try_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("")
    with pytest.raises(InputError, match="has other things in it: choose an empty or new one"):
        RunDirectory(tmp_path, overwrite=True)
    with pytest.raises(InputError, match=r"notes\.txt is a file: choose another name"):
        RunDirectory(tmp_path / "notes.txt")
    with pytest.raises(InputError, match=r"notes\.txt/a/b cannot be (made|written): "):
        RunDirectory(tmp_path / "notes.txt" / "a" / "b")
    RunDirectory(tmp_path / "a" / "b" / "c")
    assert not (tmp_path / "a").exists()
    (tmp_path / "locked").mkdir()
    (tmp_path / "locked" / LOCK).write_text("")  # of a run that begins
    RunDirectory(tmp_path / "locked")


def test_why_a_run_ended_without_a_result_is_kept(tmp_path: Path) -> None:
    directory = RunDirectory(tmp_path / "run")
    directory.start()
    directory.interrupted("too early")  # nothing has begun
    assert not (tmp_path / "run" / "run.json").exists()
    (tmp_path / "run" / "result.json").write_text("{}")
    directory.begin({"inputs": {"gamma": float("inf")}}, locked=True)
    assert not (tmp_path / "run" / "result.json").exists()
    directory.interrupted("the disk is full")
    facts = json.loads((tmp_path / "run" / "run.json").read_text())
    assert facts["process"] == process_facts(locked=True)
    assert (facts["inputs"], facts["reason"]) == ({"gamma": None}, "the disk is full")
    directory.write_result(RESULT)
    assert not (tmp_path / "run" / "run.json").exists()


# -- runs without a result -------------------------------------------------------------------------------------------


def begun(path: Path, process: dict[str, Any] | None = None, **facts: Any) -> Path:
    path.mkdir()
    who = {"id": 2**22 + 1, "host": socket.gethostname(), "began": 1, "locked": True}
    (path / "run.json").write_text(json.dumps({"process": who if process is None else process, **facts}))
    return path


SILENT = "its process ended without a word: killed, or lost with its machine"


def test_what_is_known_of_a_run_without_a_result(tmp_path: Path) -> None:
    path = begun(tmp_path / "a b", inputs={"problem": "box"}, n_dofs=7)
    assert unfinished(path) == {
        "versions": {}, "n_cells": 0, "n_dofs": 7, "projection_degrees": {}, "units": {}, "inputs": {"problem": "box"},
        "complete": False, "unfinished": "interrupted", "reason": SILENT,
        "process": json.loads((path / "run.json").read_text())["process"],
    }  # fmt: skip
    (path / "checkpoint-before.npz").write_text("")
    assert unfinished(path)["reason"] == f"{SILENT}; run(..., resume=True) goes on"
    (path / "command.json").write_text("{}")
    assert how_to_go_on(path) == f"'tmc-vem resume '{path}'' goes on"
    assert unfinished(path)["reason"] == f"{SILENT}; {how_to_go_on(path)}"
    (path / "checkpoint-before.npz").unlink()
    assert how_to_go_on(path) == ""
    (path / "checkpoint.npz").write_text("")
    assert how_to_go_on(path) != ""


def test_a_reason_that_tells_how_to_go_on_is_not_told_twice(tmp_path: Path) -> None:
    path = begun(tmp_path / "run", reason="stopped; run(..., resume=True) goes on")
    (path / "checkpoint.npz").write_text("")
    assert unfinished(path)["reason"] == "stopped; run(..., resume=True) goes on"


def test_who_runs_is_said(tmp_path: Path) -> None:
    path = begun(tmp_path / "run", {"id": 5, "host": "elsewhere", "locked": False})
    assert unfinished(path)["reason"] == "process 5 on elsewhere may be at work: its file system has no locks"
    assert unfinished(path)["unfinished"] == "unknown"
    lock = DirectoryLock(begun(tmp_path / "other", {"id": 5, "host": "elsewhere"}))
    found = unfinished(tmp_path / "other")
    assert (found["unfinished"], found["reason"]) == ("running", "process 5 on elsewhere")
    (tmp_path / "other" / "run.json").write_text('{"process": {"id": 5}}')
    assert unfinished(tmp_path / "other")["reason"] == "another process"
    lock.release()


@pytest.mark.parametrize("text", ["[]", '{"process": 3}'])
def test_a_damaged_beginning_is_said(tmp_path: Path, text: str) -> None:
    begun(tmp_path / "run")
    (tmp_path / "run" / "run.json").write_text(text)
    with pytest.raises(ValueError, match=r"^run\.json is damaged$"):
        unfinished(tmp_path / "run")


def test_inputs_of_a_run_from_before_run_json(tmp_path: Path) -> None:
    (tmp_path / "command.json").write_text('{"problem": "punch"}')
    assert unfinished(tmp_path)["inputs"] == {"problem": "punch"}
    (tmp_path / "command.json").write_text("{}")
    assert unfinished(tmp_path)["inputs"] == {"problem": "run"}
    (tmp_path / "checkpoint.npz").write_text("torn")
    np.savez(tmp_path / "checkpoint-before.npz", facts=json.dumps({"inputs": {"problem": "cbox"}}))
    assert unfinished(tmp_path)["inputs"] == {"problem": "cbox"}
    np.savez(tmp_path / "checkpoint.npz", facts=json.dumps({"inputs": {"problem": "box"}}))
    assert unfinished(tmp_path)["inputs"] == {"problem": "box"}
    for name in ("checkpoint.npz", "checkpoint-before.npz"):
        (tmp_path / name).unlink()
    (tmp_path / "command.json").write_text("[]")
    with pytest.raises(ValueError, match=r"^command\.json is damaged$"):
        unfinished(tmp_path)


# -- locks -----------------------------------------------------------------------------------------------------------


def test_without_locks_on_the_file_system_a_lock_is_not_held_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(handle: Any, _: int) -> None:
        raise OSError(37, "No locks available")

    def refuse_and_remove(handle: Any, _: int) -> None:
        (tmp_path / LOCK).unlink()  # as another run that finds none either
        refuse(handle, _)

    for flock in (refuse, refuse_and_remove):
        monkeypatch.setattr(fcntl, "flock", flock)
        lock = DirectoryLock(tmp_path)
        assert (lock.held, (tmp_path / LOCK).exists()) == (False, False)
        lock.release()


def test_a_lock_says_who_holds_it_and_is_gone_after(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tmc_vem.results.lock.INSTANT", 0.0)
    (tmp_path / LOCK).write_text("somebody who was killed, with a name longer than that of the next one\n" * 3)
    lock = DirectoryLock(tmp_path)
    me = f"process {os.getpid()} on {socket.gethostname()}"
    assert (lock.held, (tmp_path / LOCK).read_text()) == (True, f"{me}\n")
    with pytest.raises(InputError) as caught:
        DirectoryLock(tmp_path)
    assert str(caught.value) == f"output directory {tmp_path} is in use by {me}: wait for it, or choose another"
    with (tmp_path / LOCK).open("r+") as file:
        file.truncate(0)
    with pytest.raises(InputError, match="is in use by another process: wait"):
        DirectoryLock(tmp_path)
    (tmp_path / LOCK).unlink()  # somebody has removed it
    lock.release()
    assert (lock.held, is_held(tmp_path)) == (False, False)
    lock.release()


def test_a_lock_is_tried_several_times(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    waits: list[float] = []
    monkeypatch.setattr("tmc_vem.results.lock.time.sleep", waits.append)
    lock = DirectoryLock(tmp_path)
    with pytest.raises(InputError):
        DirectoryLock(tmp_path)
    assert waits == [0.02] * (ATTEMPTS - 1)
    lock.release()


def test_a_lock_that_its_holder_has_removed_meanwhile_is_taken_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real, calls = fcntl.flock, list[int]()

    def flock(handle: Any, operation: int) -> None:
        real(handle, operation)
        calls.append(operation)
        if len(calls) == 1:
            (tmp_path / LOCK).unlink()
        elif len(calls) == 2:
            (tmp_path / LOCK).unlink()
            (tmp_path / LOCK).write_text("another file")

    monkeypatch.setattr(fcntl, "flock", flock)
    lock = DirectoryLock(tmp_path)
    assert (lock.held, len(calls)) == (True, 3)
    assert set(calls) == {fcntl.LOCK_EX | fcntl.LOCK_NB}
    lock.release()


# -- energy balance --------------------------------------------------------------------------------------------------


def test_one_step_without_a_force_leaves_no_balance() -> None:
    old = replace(RECORD, load_force=None)
    assert energy_balance([RECORD, old]) is None
    assert energy_balance([old, RECORD]) is None
    assert energy_balance([RECORD]) is not None
