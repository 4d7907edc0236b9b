"""What is put together for a run, with everything around it made up: stepper, messages, result, jumps, commands."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import click
import numpy as np
import pytest
from click.testing import CliRunner
from mpi4py import MPI

from tmc_vem.cli import run_file
from tmc_vem.cli.compare import compare_group
from tmc_vem.cli.field_options import setting
from tmc_vem.problems import Box
from tmc_vem.results.contact.rings import Rings
from tmc_vem.results.plausibility import ERROR, WARNING, Finding
from tmc_vem.results.records import StepRecord
from tmc_vem.simulation import RunOptions, prepare, recorder
from tmc_vem.simulation.lowered import Lowered
from tmc_vem.simulation.overlap import OverlapWatch, _Outline
from tmc_vem.simulation.simulation import Simulation
from tmc_vem.solve.arclength import ArcLengthStepper, ArcOptions
from tmc_vem.solve.stepping import LoadStepper, SteppingOptions, SteppingResult
from tmc_vem.support.errors import InputError
from tmc_vem.support.settings import about
from tmc_vem.support.validation import build, check_fields
from tmc_vem.system.discretisation import Evaluation, RegionValues

BOX = Box(cells=(20, 5))


# -- a run -----------------------------------------------------------------------------------------------------------


def test_there_is_nothing_to_resume_without_a_directory() -> None:
    with pytest.raises(InputError, match=r"^there is nothing to resume without a run directory$"):
        prepare(BOX, resume=True)


def made(said: list[Any], **more: Any) -> Any:
    parts: dict[str, Any] = {
        "problem": BOX, "options": RunOptions(), "path": "path", "stepping": SteppingOptions(),
        "solver": SimpleNamespace(system=SimpleNamespace(
            create_vector=lambda: None, prescribed=lambda _: np.ones(1), size=1.0, comm=MPI.COMM_SELF)),
        "recorder": SimpleNamespace(record="record", step_failed="failed", findings=[]),
        "monitor": SimpleNamespace(iterated=lambda *given: said.append(given)), "hints": ("odd", "doubtful"),
        "directory": SimpleNamespace(path=Path("a"), start=lambda *given: said.append(("start", *given))),
        "comm": MPI.COMM_SELF, "command": {"a": 1}, "resume": False, "lowering": None, "system": None,
    }  # fmt: skip
    return SimpleNamespace(**{**parts, **more})


def test_what_goes_along_the_path() -> None:
    said: list[Any] = []
    stop, budget = (
        SimpleNamespace(check=lambda: said.append("stop")),
        SimpleNamespace(spend=lambda: said.append("spent")),
    )
    run = made(said)
    stepper: Any
    stepper, descents = Simulation._stepper(run, stop, budget)  # type: ignore[arg-type]
    assert descents is None
    assert type(stepper) is LoadStepper
    assert (stepper.solver, stepper.options, stepper.on_step, stepper.path, stepper.on_failure) == (
        run.solver, run.stepping, "record", "path", "failed",
    )  # fmt: skip
    assert stepper.soften == {"gamma": 1e-5}
    stepper.on_iteration(SimpleNamespace(residual=0.5), 7)
    assert said == [(7, 0.5), "stop", "spent"]
    for largest, first in ((0.5, 0.01), (0.005, 0.005)):
        run = made(said, options=RunOptions(follow=True, largest_step=largest))
        stepper, _ = Simulation._stepper(run, stop, budget)  # type: ignore[arg-type]
        assert type(stepper) is ArcLengthStepper
        assert (stepper.options, stepper.on_step) == (ArcOptions(largest=largest, first=first), "record")


@pytest.mark.parametrize(("resume", "started"), [(False, [("start", {"a": 1}, None)]), (True, [])])
@pytest.mark.parametrize("held", [True, False])
def test_what_is_said_before_the_first_step(resume: bool, started: list[Any], held: bool) -> None:
    said: list[Any] = []
    run = made(said, resume=resume)
    Simulation._begin_directory(run, SimpleNamespace(held=held))  # type: ignore[arg-type]
    assert said == started
    first = [] if held else ["the file system of a has no locks: only one run may write there"]
    assert run.recorder.findings == [Finding(WARNING, text) for text in (*first, "odd", "doubtful")]
    nowhere = made(said, directory=None)
    Simulation._begin_directory(nowhere, None)
    assert len(nowhere.recorder.findings) == 2


class Phase:
    def __call__(self, _: str) -> Phase:
        return self

    def __enter__(self) -> None:
        pass

    def __exit__(self, *_: object) -> None:
        pass

    def report(self) -> dict[str, float]:
        return {"total": 2.5}


def test_the_result_of_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    step = StepRecord(1, 0.5, 0.0, {}, 0.0, 3, 2, 5, {}, {}, 0, False, 0.0, 0.25)
    said: list[Any] = []
    evidence: list[Any] = []
    monkeypatch.setattr(recorder, "gather_fields", lambda *_: None)
    monkeypatch.setattr(recorder, "imbalance", lambda system, r, history: 0.125 if r == "r" else 0.0)
    monkeypatch.setattr(recorder, "energy_balance", lambda _: SimpleNamespace(as_dict=lambda: {"lost": 1.0}))
    monkeypatch.setattr(recorder, "balance", lambda comm, work: {"ranks": 1, "work": work})
    monkeypatch.setattr(
        recorder, "findings_of", lambda given: evidence.append(given) or [Finding(WARNING, "a"), Finding(ERROR, "b")]
    )
    system = SimpleNamespace(
        comm=MPI.COMM_SELF, size=2.0, create_vector=lambda: "r", residual=lambda u, r: said.append(("residual", u, r)),
        cell_energies=lambda u, without="": np.array([1.0, 2.0]) if without == "alpha_r" else np.array([4.0, 8.0]),
        work=lambda: {"cells": 3.0},
    )  # fmt: skip
    rec: Any = recorder.Recorder.__new__(recorder.Recorder)
    vars(rec).update(
        problem=BOX, system=system, directory=None, history=[step, dataclasses.replace(step, step=2, time=0.75)],
        inputs={"i": 1}, timer=Phase(), findings=[Finding(WARNING, "c")], _order=2, _inverted={"inverted_from": 0.25},
        _facts={"inputs": {"i": 1}, "versions": {}, "n_cells": 5, "n_dofs": 6, "projection_degrees": {}, "media": ()},
        _snapshots=SimpleNamespace(directory=Path("a"), write=lambda *given: said.append(given)),
        _between_the_points=lambda u: {"inverted_cells": {"m": 2}, "dense_min_j": {"m": -1.0}},
        _units=lambda record: {"of": record.step}, lowered=Lowered(failed_iterations=100), descending=None,
        adaptivity=None,
        contact=SimpleNamespace(curves=lambda *given: said.append(("curves", *given))),
    )  # fmt: skip
    outcome = SteppingResult(0.5, False, "why", 7, 11, None, 13, "PORD")
    found = rec.finish(outcome, "u", "direct", cut_short=True)
    assert said == [("residual", "u", "r"), ("curves", "u", "r"), (2, 0.75, "u")]
    assert found.curves is None
    assert found.checks == {
        "imbalance": 0.125, "regulariser_energy": 9.0, "inverted_cells": {"m": 2}, "dense_min_j": {"m": -1.0},
        "inverted_from": 0.25, "energy_balance": {"lost": 1.0},
    }  # fmt: skip
    assert (found.newton_iterations, found.cut_backs) == (2 * 8 + 7 + 100, 2 * 2 + 11)
    assert (found.errors, found.warnings, found.units) == (["b"], ["a", "c"], {"of": 2})
    assert found.parallel == {
        "ranks": 1, "work": {"cells": 3.0}, "solver": "direct", "ordering": "PORD", "linear_iterations": 13,
    }  # fmt: skip
    assert (found.complete, found.reason, found.load, found.cut_short, found.directory) == (
        False,
        "why",
        0.5,
        True,
        None,
    )
    (given,) = evidence
    assert (given.inputs, given.media, given.size, given.complete) == ({"i": 1}, ["medium"], 2.0, False)
    whole = dataclasses.replace(outcome, complete=True)
    assert rec.finish(whole, "u", "direct", cut_short=True).cut_short is False


# -- jumps -----------------------------------------------------------------------------------------------------------


def sides(lower: float) -> Any:
    """Two squares of side 1, the second one's bottom at a height, each side with its middle."""
    found = []
    for y in (0.0, lower):
        loop = np.array([(0.0, y), (1.0, y), (1.0, y + 1.0), (0.0, y + 1.0)])
        following = np.roll(loop, -1, axis=0)
        found.append(np.stack([loop, 0.5 * (loop + following), following], axis=1))
    return np.concatenate(found)


@pytest.mark.parametrize(
    ("after", "share"),
    [
        (-1.5, 5 / 24),  # by 3 in 4 steps per thickness of 1/2; overlaps by more than a sixteenth from 1/2 + 1/16 on
        (0.94, None),  # 0.06 at the end
        (-99.0, 1 / 64),  # in no more than 64 steps
        (1.6, None),
    ],
)
def test_bodies_that_would_pass_each_other_on_the_way(after: float, share: float | None) -> None:
    ends = np.array([[n, (n + 1) % 4] for n in range(4)])
    outline: Any = _Outline.__new__(_Outline)
    outline._rings = Rings(sides(1.5), np.concatenate([ends, ends + 4]))
    assert outline._passing(sides(1.5), sides(after)) == (pytest.approx(share) if share else None)
    outline._rings = None
    assert outline._passing(sides(1.5), sides(after)) is None


def test_one_of_several_media_that_is_squeezed_is_enough() -> None:
    looked: list[Any] = []
    watch: Any = OverlapWatch(SimpleNamespace(size=1.0), ["a", "b", "gone"], 2)  # type: ignore[arg-type]
    watch._outline = SimpleNamespace(look=looked.append)
    for n, (a, b) in enumerate(((0.1, 0.5), (0.5, 0.1), (0.5, 0.09), (0.5, 0.5))):
        assert watch.refusal(n, Evaluation(0.0, {"a": RegionValues(0.0, a), "b": RegionValues(0.0, b)})) is None
    assert looked == [2, 3], "from the first such state on"


# -- commands and tables ---------------------------------------------------------------------------------------------


def test_options_of_a_file_count_where_they_are_given(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[Any] = []
    monkeypatch.setattr(run_file, "execute", lambda *given: seen.append(given))
    monkeypatch.setattr("tmc_vem.simulation.problem_file.read_problem", lambda *given: (given, RunOptions(steps=3)))
    command = run_file.problem_command("a.toml")
    for line, options in (
        ("", RunOptions(steps=3)), ("--overwrite", RunOptions(steps=3, overwrite=True)),
        ("--steps 5 --snapshots 0 --triangulated --checkpoint-every 0 --allow-overlap",
         RunOptions(steps=5, snapshots=0, triangulated=True, checkpoint_every=0, allow_overlap=True)),
        ("--method fem --max-iterations 7 --max-seconds 2.5",
         RunOptions(steps=3, method="fem", max_iterations=7, max_seconds=2.5)),
    ):  # fmt: skip
        done = CliRunner().invoke(command, line.split(), catch_exceptions=False)
        assert done.exit_code == 0, done.output
        assert seen[-1][:2] == (("a.toml", {}), options)
    assert run_file.RunGroup("run").get_command(click.Context(command), "b.toml").name == "b.toml"  # type: ignore[union-attr]


def test_what_help_says_of_settings() -> None:
    @dataclass
    class Settings:
        n: int | None = field(default=None, metadata=about("A number.", none="as many as it takes"))
        word: str = field(default="a", metadata=about("A word.", choices=("a", "b")))
        on: bool = field(default=False, metadata=about("Whether."))

    n = setting(Settings, "n", before="vem:", after="More.")
    assert (n.opts, n.help, n.type) == (["--n"], "vem: a number. More. Default: as many as it takes.", click.INT)
    word = setting(Settings, "word")
    assert isinstance(word.type, click.Choice)
    assert (list(word.type.choices), word.default, word.show_default, word.help) == (["a", "b"], "a", True, "A word.")
    on = setting(Settings, "on", "--really", "really")
    assert (on.is_flag, on.opts, on.name, on.show_default) == (True, ["--really"], "really", False)
    several = setting(Settings, "n", multiple=True, optional=True)
    assert (several.help, several.default) == ("A number. May be given several times.", None)
    help_text = CliRunner().invoke(compare_group, ["box", "--help"]).output
    assert "fem: jumps of the gradient" in " ".join(help_text.split())


def test_fields_that_are_no_arguments_are_no_entries_of_tables() -> None:
    @dataclass
    class Table:
        a: int
        made: int = field(init=False, default=5)
        word: str = field(default="x", metadata=about("A word.", choices=("x", "y")))
        other: str = field(default="z", metadata=about("Any word."))
        list_of: list[int] = field(default_factory=list)

        def __post_init__(self) -> None:
            check_fields(self)

    assert build(Table, {"a": 1}, "t").made == 5
    with pytest.raises(InputError, match=r"^t has no 'made'"):
        build(Table, {"a": 1, "made": 3}, "t")
    with pytest.raises(InputError, match=r"^t lacks 'a'$"):
        build(Table, {}, "t")
    with pytest.raises(InputError, match=r"^t: unknown word 'q': choose one of x, y$"):
        build(Table, {"a": 1, "word": "q"}, "t")
