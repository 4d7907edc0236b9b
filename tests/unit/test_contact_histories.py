"""Contact step by step: pairs that come and go, stages, graded media, and runs that go on."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import pytest
from helpers_traction import LAYERS, LOADED, changed, solve, solved

from tmc_vem import RunOptions, RunResult, run
from tmc_vem.problems import Bodies, Problem, Punch
from tmc_vem.problems.contact_quantities import joint_of
from tmc_vem.results.directory import RunDirectory
from tmc_vem.simulation.contact_gauge import ContactGauge
from tmc_vem.simulation.problem_file import read_problem

NEWTON = 1e-9  # of the largest force
SMALL = changed(LAYERS, ("size = 0.2", "size = 0.4"), ("uy = -0.5", "uy = -0.2"), ("steps = 5", "steps = 4"))
UNITS = changed(SMALL, ("gap =", 'units = { length = "mm", force = "N" }\ngap ='))


def test_pairs_that_come_and_go(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A pair that faces in the second and third of four steps only is read back with its name, value and unit, from a
    run that goes on as well."""
    read, calls, running = ContactGauge.read, [], []

    def some(self: ContactGauge, u: Any, residual: Any, *, along_path: bool = True) -> Any:
        calls.append(read(self, u, residual, along_path=along_path))
        if len(calls) == 4:
            running.append(RunResult.read(tmp_path / "run"))
        return {name: values for name, values in calls[-1].items() if name != "low-up" or len(calls) in (2, 3)}

    rewrite, rewritten = RunDirectory.rewrite_history, []

    def counted(self: RunDirectory, records: Any, units: Any) -> None:
        rewritten.append(len(records))
        rewrite(self, records, units)

    monkeypatch.setattr(ContactGauge, "read", some)
    monkeypatch.setattr(RunDirectory, "rewrite_history", counted)
    result = solved(tmp_path, UNITS, tmp_path / "run").result
    again = RunResult.read(tmp_path / "run")
    assert [len(step.contact) for step in result.history] == [2, 3, 3, 2]
    assert [step.contact for step in again.history] == [step.contact for step in result.history]
    assert rewritten == [2], "with new columns only"
    assert running[0].unfinished == "running"
    assert [step.contact for step in running[0].history] == [step.contact for step in result.history[:3]]
    for each in (result, again):
        assert each.unit("contact.low-up.force") == each.unit("contact.up.force") == "N/mm"
        assert each.unit("contact.low-up.pressure_max") == "N/mm^2"


# A support holds nodes of the outline, and leaves its force there when it ends; gamma is not the same everywhere.
STAGED = (
    changed(
        LOADED,
        ("size = 0.25", "size = 0.4"),
        ('regulariser = "huhu_lulu" } }', 'regulariser = "huhu_lulu" }, graded = { gamma = "gamma * (1 + 4 * x)" } }'),
        ("uy = -0.12", "uy = -0.12\nhistory = [[0, 0], [1, 1], [2, 1]]"),
        ("steps = 2", "steps = 4"),
    )
    + """
[[stage]]
name = "held"
begins = 0
[[stage]]
name = "free"
begins = 1
[[support]]
at = "tread"
ux = 0
stage = "held"
"""
)


def test_forces_that_supports_leave_are_no_contact(tmp_path: Path) -> None:
    """At every step, while such a force goes as well, what the medium does to one body it does to the other."""
    found = solved(tmp_path, STAGED)
    assert found.result.complete
    loads = [step.load for step in found.result.history]
    assert any(1.0 < load < 2.0 for load in loads), "on the way"
    for step in found.result.history:
        base, plug = (step.contact[name] for name in ("base", "plug"))
        for quantity in ("force_x", "force_y", "moment"):
            assert base[quantity] == pytest.approx(-plug[quantity], abs=1e-11), step.load
        assert abs(base["force_x"]) > 1e-5
    assert max(found.imbalance().values()) < NEWTON


@pytest.mark.parametrize(
    "problem", [Punch(size=0.25), Bodies(size=0.1, discs=2, length=2.0)], ids=lambda problem: type(problem).__name__
)
def test_bodies_of_built_in_problems_are_in_balance(problem: Problem) -> None:
    found = solve(problem, RunOptions(max_iterations=6, snapshots=0))
    imbalance = found.imbalance()
    assert len(imbalance) > 1
    assert max(imbalance.values()) < NEWTON
    assert max(values["force"] for values in found.result.contact.values()) > 0.0


@pytest.mark.parametrize(
    ("bodies", "joint"),
    [
        (["a", "b"], "-"),
        (["a", "a-2"], "-"),
        (["a", "b", "a-b"], "--"),
        (["2", "a", "a-2"], "-"),  # the pair is 2-a
        (["a", "2", "a-2"], "--"),
        (["a-b", "c", "a", "b-c"], "--"),
        (["a", "b", "a-b", "a--b"], "\u2013"),
        (["a-", "b", "a", "-b"], "\u2013"),
        ([], "-"),
    ],
)
def test_names_of_bodies_and_pairs_differ(bodies: list[str], joint: str) -> None:
    assert joint_of(bodies) == joint


def test_no_value_of_a_pair_takes_the_place_of_a_body(tmp_path: Path) -> None:
    """Bodies a, b and a-b, of which a and b face each other; the third one is not in medium."""
    text = changed(
        SMALL, ("low", "a"), ("up =", "b ="), ('"up"', '"b"'),
        ("mid = {", "far = { rectangle = [3, 0, 4, 1] }\nmid = {"),
        ("medium = { shape", 'a-b = { shape = "far", solid = { E = 1, nu = 0 } }\nmedium = { shape'),
        ('[[support]]\nat = "left"', '[[support]]\nat = "apart"\nux = 0\nuy = 0\n[[support]]\nat = "left"'),
        ("bottom = {", "apart = { line = [[3, 0], [4, 0]] }\nbottom = {"),
        ("[mesh]", '[probes]\np = { contact = "force_y", of = "a--b" }\n'
                   'q = { contact = "force_y", of = "a-b" }\n[mesh]'),
    )  # fmt: skip
    found = solved(tmp_path, changed(text, ("steps = 4", "steps = 1"))).result
    assert set(found.contact) == {"a", "b", "a--b"}
    assert found.checks["regulariser_share"].keys() == {"a--b"}
    assert found.probes["p"] == found.contact["a--b"]["force_y"] < -0.01
    assert found.probes["q"] == 0.0


def test_a_run_that_goes_on_has_the_contact_of_one_in_a_piece(tmp_path: Path) -> None:
    path = tmp_path / "small.toml"
    path.write_text(changed(SMALL, ("snapshots = 0", "snapshots = 2")))
    problem, options = read_problem(path)
    whole = run(problem, tmp_path / "whole", options)
    part = run(problem, tmp_path / "part", dataclasses.replace(options, max_iterations=4))
    assert 0 < part.steps < whole.steps
    again = run(problem, tmp_path / "part", options, resume=True)
    assert again.complete
    assert [step.contact for step in again.history] == [step.contact for step in whole.history]
    names = ["contact.csv", "contact.pvd", *(f"contact/step_{n:05d}.{kind}" for n in (2, 4) for kind in ("csv", "vtu"))]
    for name in names:
        assert (tmp_path / "part" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name
