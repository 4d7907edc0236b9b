"""Runs that lower gamma for its limit: beside the path, cut short and resumed, with several media, along the path."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest
from helpers_blocks import blocks
from helpers_process import tmc
from mpi4py import MPI

from tmc_vem import Box, Medium, RunOptions, RunResult, run
from tmc_vem.problems.base import RegionEnergy
from tmc_vem.problems.wrapped import Wrapped
from tmc_vem.results.limit import (
    GammaLimit,
    LimitValue,
    limit_at_end,
)
from tmc_vem.results.records import StepRecord
from tmc_vem.simulation.descent import lowering_of
from tmc_vem.simulation.discretised import discretise
from tmc_vem.simulation.monitor import Monitor
from tmc_vem.support.errors import InputError

BOX = Box(cells=(20, 5), uy=-0.5, medium=Medium(gamma=1e-4))
OPTIONS = RunOptions(extrapolate_gamma=True, snapshots=0)


@pytest.fixture(scope="module")
def plain() -> RunResult:
    return run(BOX, None, RunOptions(snapshots=0))


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> RunResult:
    return run(BOX, tmp_path_factory.mktemp("whole") / "box", OPTIONS)


def limit_of(result: RunResult) -> GammaLimit:
    assert result.limit is not None
    return result.limit


# -- whole runs --------------------------------------------------------------------------------------------------------


def test_the_run_itself_is_as_without(plain: RunResult, whole: RunResult) -> None:
    assert [replace(step, seconds=0.0) for step in whole.history] == [replace(s, seconds=0.0) for s in plain.history]
    limit = limit_of(whole)
    assert whole.newton_iterations == plain.newton_iterations + limit.newton_iterations
    assert limit.newton_iterations == sum(step.iterations + step.wasted_iterations for step in whole.lowered)
    assert limit.newton_iterations <= 1.5 * plain.newton_iterations
    assert (plain.limit, plain.lowered) == (None, ())
    peak = "no limit for gamma to 0 of contact.solid-solid.pressure_max: it follows no power of gamma"
    assert whole.warnings == [*plain.warnings, peak]  # that of two nodes of a coarse mesh
    assert whole.checks["dense_min_j"] == plain.checks["dense_min_j"]


def test_values_at_every_gamma_are_those_of_runs_with_it(whole: RunResult) -> None:
    limit = limit_of(whole)
    assert list(limit.gammas) == [1e-4, 1e-5, 1e-6]
    assert limit.expected_ratio == 10.0**0.6
    contact = [f"contact.solid-solid.{quantity}" for quantity in ("force", "pressure_max")]
    assert list(limit.values) == ["reaction", "gap", *contact]
    there = run(replace(BOX, medium=Medium(gamma=1e-5)), None, RunOptions(snapshots=0))
    reaction, gap = limit.values["reaction"], limit.values["gap"]
    assert reaction.at[1] == pytest.approx(there.reaction, rel=1e-8)
    assert gap.at[1] == pytest.approx(there.gap, rel=1e-7)
    assert (reaction.at[0], gap.at[0]) == (whole.reaction, whole.gap)
    assert reaction.ratio == pytest.approx((reaction.at[0] - reaction.at[1]) / (reaction.at[1] - reaction.at[2]))
    assert reaction.value is not None
    assert reaction.uncertainty is not None
    assert abs(reaction.value) < abs(reaction.at[2])
    assert 0.0 < reaction.uncertainty < 0.01 * abs(reaction.value)


def test_what_is_written_is_read(whole: RunResult) -> None:
    assert whole.directory is not None
    data = json.loads((whole.directory / "result.json").read_text())
    assert data["schema"] == 2
    assert data["limit"]["values"]["reaction"]["value"] == limit_of(whole).values["reaction"].value
    assert set(data["limit"]["values"]["gap"]) == {"value", "uncertainty", "ratio", "reason", "at"}
    assert {"gammas", "expected_ratio", "values"} <= set(data["limit"])
    again = RunResult.read(whole.directory)
    assert again.limit == replace(limit_of(whole), gammas=tuple(limit_of(whole).gammas))
    assert again.lowered == whole.lowered
    assert again.history == list(whole.history)
    rows = (whole.directory / "history.csv").read_text().splitlines()
    assert rows[0].endswith("limit_of,parameter_gamma")
    assert len(rows) == 1 + len(whole.history) + len(whole.lowered)
    assert [row.split(",")[-2] for row in rows[1:]] == [""] * whole.steps + [str(whole.steps)] * len(whole.lowered)
    last = whole.lowered[-1]
    assert last.parameters == {"gamma": pytest.approx(1e-6, rel=1e-12)}
    assert (last.load, last.time, last.limit_of) == (1.0, 1.0, whole.steps)


def test_old_runs_are_read(whole: RunResult, tmp_path: Path) -> None:
    assert whole.directory is not None
    data = json.loads((whole.directory / "result.json").read_text())
    del data["limit"]
    data["schema"] = 1
    (tmp_path / "result.json").write_text(json.dumps(data))
    (tmp_path / "history.csv").write_text((whole.directory / "history.csv").read_text())
    old = RunResult.read(tmp_path)
    assert (old.limit, old.history) == (None, list(whole.history))
    data["limit"] = {"gammas": "?"}
    (tmp_path / "result.json").write_text(json.dumps(data))
    with pytest.raises(InputError, match=r"limit = .* has the wrong form"):
        RunResult.read(tmp_path)


class Counting(Monitor):
    """Counts states with lower gamma, and ends the run at one of them."""

    def __init__(self, last: int) -> None:
        self.left, self.gammas = last, list[float]()

    def lowered(self, record: StepRecord) -> None:
        self.gammas.append(record.parameters["gamma"])
        self.left -= 1
        if not self.left:
            raise RuntimeError("killed")


def test_a_run_killed_while_gamma_is_lowered_goes_on(whole: RunResult, tmp_path: Path) -> None:
    first = Counting(3)
    with pytest.raises(RuntimeError, match="killed"):
        run(BOX, tmp_path / "box", OPTIONS, monitor=first)
    assert RunResult.read(tmp_path / "box").state == "interrupted"
    second = Counting(99)
    result = run(BOX, tmp_path / "box", OPTIONS, monitor=second, resume=True)
    # the checkpoint of a state is written before it is told
    assert first.gammas + second.gammas == [step.parameters["gamma"] for step in whole.lowered]
    assert result.limit == whole.limit
    assert result.newton_iterations == whole.newton_iterations
    again = run(BOX, tmp_path / "box", OPTIONS, monitor=Counting(1), resume=True)  # all is done
    assert again.limit == whole.limit


def test_a_limit_on_the_work(whole: RunResult, plain: RunResult, tmp_path: Path) -> None:
    most = plain.newton_iterations + 5
    cut = run(BOX, tmp_path / "box", replace(OPTIONS, max_iterations=most))
    assert not cut.complete
    assert cut.cut_short
    assert cut.load == 1.0
    assert cut.reason == f"the limit of {most} Newton iterations is used up while gamma was lowered"
    assert cut.limit is not None
    assert "gamma was not lowered at this load" in (cut.limit.values["gap"].reason or "")
    assert any(text.startswith("no limit for gamma to 0 of reaction, gap, contact.") for text in cut.warnings)
    result = run(BOX, tmp_path / "box", OPTIONS, resume=True)
    assert result.complete
    assert result.limit is not None
    assert result.limit.values == limit_of(whole).values


def test_along_the_path(tmp_path: Path) -> None:
    box = replace(BOX, uy=-0.2)
    options = replace(OPTIONS, extrapolate_gamma="path", output_loads=(0.5,), largest_step=0.4)
    with pytest.raises(RuntimeError, match="killed"):
        run(box, tmp_path / "box", options, monitor=Counting(7))
    result = run(box, tmp_path / "box", options, resume=True)
    limit = limit_of(result)
    loads = [point.load for point in limit.path]
    wanted, before = [], 0.0
    for step in result.history:  # the first step at or beyond each tenth
        if math.floor(step.load * 10.0 + 1e-9) > math.floor(before * 10.0 + 1e-9):
            wanted.append(step.load)
        before = step.load
    assert loads == wanted
    assert 0.5 in loads
    assert limit.path[-1].values == limit.values
    end = limit_of(run(box, None, OPTIONS))
    assert limit.values["reaction"].value == pytest.approx(end.values["reaction"].value, rel=1e-6)
    assert {step.limit_of for step in result.lowered} == {point.step for point in limit.path}
    same = run(box, None, RunOptions(snapshots=0, output_loads=(0.5,), largest_step=0.4))
    assert [step.reaction for step in result.history] == [step.reaction for step in same.history]
    from tmc_vem.report.limits import limit_blocks
    from tmc_vem.report.page import Picture, Table

    table, curves, *more = limit_blocks("box", result)
    assert isinstance(table, Table)
    assert isinstance(curves, Picture)
    assert table.head == ("quantity", "gamma 0.0001", "gamma 1e-05", "gamma 1e-06", "limit", "ratio")
    gap = limit.values["gap"]
    assert [cell.text for cell in table.cells[1]] == [
        "gap", *(f"{value:.4e}" for value in gap.at), str(gap), f"{gap.ratio:.3f}",
    ]  # fmt: skip
    assert ([each.name for each in (curves, *more)], limit_blocks("box", same)) == (["limit-1", "limit-2"], [])


def test_paths_that_come_back_branches_and_other_gammas() -> None:
    back = run(BOX, None, replace(OPTIONS, path=(0.0, 0.4, 0.2)))
    assert [step.load for step in back.lowered] == [pytest.approx(0.2)] * len(back.lowered)
    straight = run(replace(BOX, uy=-0.1), None, OPTIONS)
    assert limit_of(back).values["gap"].value == pytest.approx(limit_of(straight).values["gap"].value, rel=1e-6)
    from_above = run(BOX, None, replace(OPTIONS, continuation={"gamma": 1e-3}, path=(0.0, 0.2)))
    assert limit_of(from_above).values["gap"].value == pytest.approx(limit_of(straight).values["gap"].value, rel=1e-6)
    along = run(BOX, None, replace(OPTIONS, continuation={"gamma": 1e-3}, path=(0.0, 0.2), extrapolate_gamma="path"))
    reasons = {point.values["gap"].reason for point in limit_of(along).path}
    assert "gamma could not be lowered to the end: gamma or alpha_r was not that of the problem at this load" in reasons
    assert limit_of(along).values["gap"].value == limit_of(from_above).values["gap"].value
    followed = run(replace(BOX, uy=-0.1), None, replace(OPTIONS, follow=True))
    assert limit_of(followed).values["gap"].value == pytest.approx(limit_of(straight).values["gap"].value, rel=1e-6)


# -- several media -----------------------------------------------------------------------------------------------------


class TwoMedia(Wrapped):
    """The box, whose walls are a second medium by name, as stiff as they were."""

    def regions(self) -> dict[str, RegionEnergy]:
        found = dict(self.problem.regions())
        found["solid"] = replace(found["medium"], values={**found["medium"].values, "gamma": 0.5})
        return found


def test_all_media_are_lowered_together() -> None:
    assert lowering_of(BOX, RunOptions()) is None
    one = lowering_of(BOX, OPTIONS)
    assert one is not None
    assert one.gammas == {"gamma": 1e-4}
    assert one.factors == pytest.approx([1.0, 10**-0.5, 0.1, 10**-1.5, 0.01], rel=1e-12)
    two = lowering_of(TwoMedia(BOX), replace(OPTIONS, gamma_decades=3))
    assert two is not None
    assert two.gammas == {"solid.gamma": 0.5, "medium.gamma": 1e-4}
    assert two.at(0.1) == {"solid.gamma": pytest.approx(0.05), "medium.gamma": pytest.approx(1e-5)}
    assert (len(two.factors), two.factors[-1]) == (7, pytest.approx(1e-3))
    step = StepRecord(1, 0.1, -0.2, {"gap": 0.5}, -3.0, 1, 0, 0, {}, {}, 0, jumped=False, seconds=0.0)
    made = limit_at_end(two, [step], [], {}, along_path=False)
    assert list(made.gammas) == [0.5, 0.05, 0.005, 0.0005]
    assert made.by_medium == {"solid": [0.5, 0.05, 0.005, 0.0005], "medium": [1e-4, 1e-5, 1e-6, 1e-7]}


@pytest.mark.parametrize("method", ["vem", "fem"])
def test_a_parameter_of_one_region(method: str) -> None:
    if method == "fem":
        pytest.importorskip("dolfinx")
    system = discretise(BOX, RunOptions(method), MPI.COMM_SELF)
    u = system.create_vector()
    labels = system.node_labels()
    u.getArray()[:] = (
        0.01 * (labels[:, :1] * labels[:, 1:2] ** 2 * [[1.0, -2.0]]).ravel() * (labels[:, 2] <= 1.0).repeat(2)
    )

    def energies() -> dict[str, float]:
        return {name: values.energy for name, values in system.energy(u).regions.items()}

    before = energies()
    system.set_parameters({"medium.gamma": 2e-4, "solid.gamma": 7.0})
    assert energies() == {"solid": before["solid"], "medium": pytest.approx(2.0 * before["medium"], rel=1e-12)}
    system.set_parameters({"solid.mu": 1e3, "medium.gamma": 1e-4})
    assert energies()["medium"] == pytest.approx(before["medium"], rel=1e-12)
    assert energies()["solid"] > 2.0 * before["solid"]


# -- what is refused and withheld --------------------------------------------------------------------------------------


class NoMedium(Wrapped):
    """The box without medium."""

    def regions(self) -> dict[str, RegionEnergy]:
        return {"solid": self.problem.regions()["solid"], "medium": self.problem.regions()["solid"]}


def test_what_cannot_be_asked() -> None:
    with pytest.raises(InputError, match=r"^extrapolate_gamma = 'paths': use true, false or 'path'$"):
        RunOptions(extrapolate_gamma="paths")
    for decades in (1, 7):
        with pytest.raises(InputError, match=rf"^gamma_decades = {decades}: use 2 to 6$"):
            RunOptions(gamma_decades=decades)
    assert (RunOptions(gamma_decades=6).gamma_decades, RunOptions(gamma_decades=2).gamma_decades) == (6, 2)
    with pytest.raises(InputError, match="no third medium with a parameter gamma"):
        run(NoMedium(BOX), None, OPTIONS)


def test_a_table_of_a_problem_file_asks_for_it(tmp_path: Path) -> None:
    from tmc_vem.simulation.problem_file import problem_text, read_problem

    for text, value in (("true", True), ('"path"', "path"), ("false", False)):
        problem, options = read_problem(blocks(tmp_path, f"extrapolate_gamma = {text}"))
        assert options.extrapolate_gamma == value
        assert (f"extrapolate_gamma = {text}" in problem_text(problem, options)) == bool(value)


# -- where it is shown -------------------------------------------------------------------------------------------------


def test_the_summary_has_limits(whole: RunResult, plain: RunResult) -> None:
    from tmc_vem.cli.progress import limit_rows, summary_rows

    limit = limit_of(whole)
    rows = limit_rows(whole)
    assert [name for name, _ in rows] == ["limit of gamma", *(f"limit, {name}" for name in limit.values)]
    assert rows[0][1] == f"from 0.0001, 1e-05, 1e-06, with {limit.newton_iterations} Newton iterations"
    gap = limit.values["gap"]
    assert rows[2][1] == f"{gap} (ratio {gap.ratio:.3f}, 3.981 in contact)"
    assert [row for row in summary_rows(whole) if row[0].startswith("limit")] == rows
    assert limit_rows(plain) == []
    none = replace(limit, values={"gap": LimitValue(None, None, None, "why")})
    units = {"units": {"length": "mm", "force": "N"}}
    in_mm = {"inputs": units, "units": {"gap": "mm"}}
    assert limit_rows(replace(whole, limit=none, **in_mm))[1] == ("limit, gap", "withheld")
    assert limit_rows(replace(whole, **in_mm))[2][1].startswith(f"{gap} mm (ratio")


def test_comparisons_have_a_table_of_limits(whole: RunResult, plain: RunResult) -> None:
    from tmc_vem.report.comparison import Comparison, Method, _limits, _summary
    from tmc_vem.report.page import Table

    limit = limit_of(whole)
    c = Comparison("title", "command", [Method("VEM", {"20 x 5": whole}, {}), Method("FEM", {"20 x 5": plain}, {})])
    (table,) = _limits(c, ["20 x 5", "40 x 10"])
    assert isinstance(table, Table)
    assert table.head == ["mesh", *(f"VEM {name}" for name in limit.values)]
    texts = [[cell.text for cell in row] for row in table.cells]
    assert texts == [["20 x 5", *map(str, limit.values.values())], ["40 x 10", *("–" for _ in limit.values)]]
    (summary, *_) = _summary(c)
    assert isinstance(summary, Table)
    found = {row[0].text: [cell.text for cell in row[1:]] for row in summary.cells}
    assert found["gap, limit of gamma"] == [str(limit.values["gap"]), "–", "–", "–"]
    withheld = replace(whole, limit=replace(limit, values={"gap": LimitValue(None, None, None, "why")}))
    (table,) = _limits(replace(c, methods=[Method("VEM", {"20 x 5": withheld}, {})]), ["20 x 5"])
    assert isinstance(table, Table)
    assert (table.cells[0][1].text, table.notes) == ("withheld", ["why"])
    assert _limits(replace(c, methods=c.methods[1:]), ["20 x 5"]) == []


def test_comparisons_ask_for_limits(tmp_path: Path) -> None:
    from tmc_vem.cli.compare import _methods
    from tmc_vem.simulation.problem_file import read_problem
    from tmc_vem.study.compare import file_study

    given = {"order": 2, "steps": None, "interior_penalty": "none", "extrapolate_gamma": "path", "gamma_decades": 3}
    for options in _methods(given).values():
        assert (options.extrapolate_gamma, options.gamma_decades) == ("path", 3)
    for options in _methods({**given, "extrapolate_gamma": None, "gamma_decades": None}).values():
        assert (options.extrapolate_gamma, options.gamma_decades) == (False, 2)
    problem, settings = read_problem(blocks(tmp_path, "extrapolate_gamma = true\ngamma_decades = 4"))
    for options in file_study(problem, [0.1, 0.2, 0.3], settings).options.values():
        assert (options.extrapolate_gamma, options.gamma_decades) == (True, 4)
    study = file_study(problem, [0.1, 0.2, 0.3], settings, extrapolate_gamma="path", gamma_decades=5)
    assert {(o.extrapolate_gamma, o.gamma_decades) for o in study.options.values()} == {("path", 5)}


@pytest.mark.slow
def test_ranks(whole: RunResult, tmp_path: Path) -> None:
    out = str(tmp_path / "box")
    words = "run box --cells 20 5 --uy -0.5 --gamma 1e-4 --extrapolate-gamma --snapshots 0 --quiet --max-iterations"
    assert tmc(*words.split(), str(whole.newton_iterations - 9), "--out", out, ranks=2).returncode == 3
    assert tmc("resume", out, "--quiet", ranks=3).returncode == 0
    found = limit_of(RunResult.read(out)).values
    for name, entry in limit_of(whole).values.items():
        assert found[name].at == pytest.approx(entry.at, rel=1e-9)
        assert found[name].reason == entry.reason
        assert entry.value is None or found[name].value == pytest.approx(entry.value, rel=1e-6)
