"""Searches for a design: what they find, and what they leave behind."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista
from helpers_design import CANTILEVER, cantilever, cantilever_file, design_rows
from helpers_process import tmc
from numpy.typing import NDArray

from tmc_vem import RunResult, optimise
from tmc_vem.cli.main import _run
from tmc_vem.design.record import read_records
from tmc_vem.results.design_run import DesignRun
from tmc_vem.simulation.problem_file import read_problem

Float = NDArray[np.float64]
COMMAND = ["-c", "from tmc_vem.cli.main import main; main()"]
QUICK: dict[str, Any] = {"animation": False, "final": False}


def numbers(directory: Path, name: str) -> Float:
    return np.array([float(row[name]) for row in design_rows(directory)])


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> DesignRun:
    """A search with everything that it writes."""
    there = tmp_path_factory.mktemp("search")
    problem, options = cantilever(there, {"design.iterations": 12, "design.symmetry": {"y": 0.5}})
    return optimise(problem, there / "found", options, every=4)


def test_a_search_lowers_the_objective_within_its_volume(found: DesignRun) -> None:
    assert found.directory is not None
    objective, better = (numbers(found.directory, name) for name in ("objective", "better"))
    assert objective[better > 0][-1] == objective.min() < 0.65 * objective[0]
    assert found.objective == pytest.approx(objective.min(), rel=1e-6)  # loaded from the beginning once more
    assert (np.diff(objective) < 0.0).mean() > 0.7
    assert found.feasible
    assert found.volume == pytest.approx(0.5, abs=0.02)
    assert found.limits["volume"].margin == pytest.approx(0.5 - found.volume)
    assert found.sentence == f"The design satisfies its limit: compliance = {found.objective:.6g}."


def test_what_it_leaves_behind(found: DesignRun) -> None:
    there = found.directory
    assert there is not None
    names = {path.name for path in there.iterdir()}
    assert names == {
        "design.toml", "history.csv", "evaluations", "designs", "design.pvd", "design.vtu", "stiffness.npz",
        "final.toml", "final", "design.png", "deformed.png", "history.png", "design.gif", "result.json", "report.html",
        "report.md", "figures", "checkpoint.npz", "checkpoint-before.npz",
    }  # fmt: skip
    assert sorted(path.name for path in (there / "designs").iterdir()) == [f"design_{n:05d}.vtu" for n in (1, 4, 8, 12)]
    assert [line.split('timestep="')[1].split('"')[0] for line in (there / "design.pvd").read_text().splitlines()
            if "timestep" in line] == ["1", "4", "8", "12"]  # fmt: skip
    records = read_records(there / "evaluations", 16, 100)
    assert [record.evaluation.objective for record in records] == numbers(there, "objective").tolist()
    assert DesignRun.read(there) == found
    plain = json.loads((there / "result.json").read_text())
    assert (plain["schema"], plain["feasible"], plain["limits"]["volume"]["at_most"]) == (1, True, 0.5)
    report = (there / "report.md").read_text()
    assert report.index(found.sentence) < report.index("##")


def test_fields_are_those_of_the_best_design(found: DesignRun) -> None:
    assert found.directory is not None
    grid = pyvista.read(found.directory / "design.vtu")
    with np.load(found.directory / "stiffness.npz") as file:
        known = {tuple(np.round(x, 9)): (s, d) for x, s, d in zip(*(file[k] for k in file), strict=True)}
    centers = np.round(grid.cell_centers().points[:, :2].astype(float), 9)
    assert [known[tuple(x)] for x in centers] == list(
        zip(grid.cell_data["stiffness"].tolist(), grid.cell_data["density"].tolist(), strict=True)
    )
    assert (grid.cell_data["stiffness"] <= grid.cell_data["density"] + 1e-12).all()  # RAMP
    tip = np.argmin(np.abs(grid.points[:, :2] - (2.0, 0.5)).sum(axis=1))
    assert grid.point_data["displacement"][tip, 1] == pytest.approx(found.objective / -0.001, rel=1e-6)


def test_the_best_design_is_a_run_and_a_problem_file(found: DesignRun, tmp_path: Path) -> None:
    assert found.directory is not None
    run = RunResult.read(found.directory / found.runs[""])
    assert run.complete
    assert run.probes["tip"] * -0.001 == pytest.approx(found.objective, rel=1e-6)
    done = tmc("run", str(found.directory / "final.toml"), "--json")
    assert json.loads(done.stdout)["probes"]["tip"] == pytest.approx(run.probes["tip"], rel=1e-12)


def test_limits_and_load_cases(tmp_path: Path) -> None:
    """The tip may sink by so much with little material: the limit is met, and the volume is what it takes."""
    problem, options = cantilever(
        tmp_path,
        {
            "design.minimise": "compliance", "design.iterations": 12,
            "design.limits": {"sinks": {"of": "tip", "at_least": -0.03}},
            "design.cases": [{"name": "small", "set": {"load.force": [0, -0.0005]}}, {"name": "large"}],
        },
    )  # fmt: skip
    run = optimise(problem, tmp_path / "found", options, every=0)
    assert set(run.limits) == {"volume", "small.sinks", "large.sinks"}
    assert run.objective == pytest.approx(run.values["small.compliance"] + run.values["large.compliance"])
    assert run.limits["large.sinks"].margin == pytest.approx(run.values["large.tip"] + 0.03)
    assert run.runs == {"small": "final/small", "large": "final/large"}
    assert {path.name for path in (tmp_path / "found").glob("final*.toml")} == {"final-small.toml", "final-large.toml"}
    assert {path.name for path in (tmp_path / "found").glob("deformed*.png")} == {
        "deformed-small.png",
        "deformed-large.png",
    }
    grid = pyvista.read(tmp_path / "found" / "design.vtu")
    ratio = np.abs(grid.point_data["displacement_large"]).max() / np.abs(grid.point_data["displacement_small"]).max()
    assert ratio == pytest.approx(2.0, rel=0.1)
    assert not list((tmp_path / "found" / "designs").iterdir())


def test_what_cannot_be_satisfied_is_said_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = cantilever_file(tmp_path)
    limit = "design.limits={ tip = { at_least = -1e-6 } }"
    monkeypatch.chdir(tmp_path)
    assert _run(["optimise", str(path), "--set", limit, "--iterations", "2", "--no-final", "--out", "found"]) == 3
    said = capsys.readouterr()
    assert "tmc-vem: NOT FEASIBLE: no design satisfied all limits; the best one violates " in said.err
    assert "tip by 0.0" in said.err
    last = [line.split("  ")[0] for line in said.out.splitlines() if line[0] != " "][-1]
    assert last == "NOT FEASIBLE"
    report = (tmp_path / "found" / "report.md").read_text()
    assert report.index("NOT FEASIBLE") < report.index("##")
    assert _run(["list", "."]) == 0
    assert " NO " in capsys.readouterr().out


def test_a_search_without_a_directory_writes_nothing(tmp_path: Path) -> None:
    problem, options = cantilever(tmp_path, {"design.iterations": 2})
    before = set(tmp_path.iterdir())
    run = optimise(problem, None, options)
    assert (run.evaluations, run.directory, set(tmp_path.iterdir())) == (2, None, before)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("optimise", "plain.toml"), r"plain.toml has no table [design]: add one"),
        (("optimise", "missing.toml"), r"missing.toml cannot be read"),
        (("optimise", "cantilever.toml", "--method", "simplex"), r"'simplex' is not one of 'mma', 'ccsaq', 'oc'"),
        (("optimise", "cantilever.toml", "--iterations", "0"), r"iterations = 0: give 1 or more"),
        (("optimise", "cantilever.toml", "--every", "-1"), r"every = -1: write every n-th design, or 0"),
        (("optimise", "cantilever.toml", "--set", "design.volum=0.4"), r"did you mean 'volume'?"),
        (("optimise", "cantilever.toml", "--out", "other"), r"output directory other has other things in it"),
        (("optimise", "cantilever.toml", "--out", "run"), r"output directory run has other things in it"),
        (("resume", "other"), r"other cannot be resumed"),
        (("resume", "run", "--iterations", "5"), r"--iterations is for searches of 'tmc-vem optimise'; run is a run"),
        (("run", "cantilever.toml", "--out", "search", "--overwrite"), r"directory search has other things in it"),
        (("resume", "search", "--max-iterations", "5"), r"--max-iterations is for runs; a search for a design has"),
    ],
)  # fmt: skip
def test_bad_input_is_said_in_a_line(arguments: tuple[str, ...], message: str, tmp_path: Path, capsys: Any,
                                     monkeypatch: pytest.MonkeyPatch) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    cantilever_file(tmp_path)
    (tmp_path / "plain.toml").write_text(CANTILEVER.split("[design]")[0])
    for name, files in {
        "other": ("a",),
        "run": ("command.json", "checkpoint.npz"),
        "search": ("design.toml", "run.json"),
    }.items():
        (tmp_path / name).mkdir()
        for file in files:
            (tmp_path / name / file).write_text("{}")
    assert _run(list(arguments)) == 2
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1


def test_the_least_volume_within_a_limit(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The limit is active in the end; without one, or made large, the volume is no objective."""
    file = cantilever_file(tmp_path, CANTILEVER.replace("volume = 0.5", "start = 0.9"))
    stiff = optimise(*read_problem(file, {"design.iterations": 1})[:1], None, **QUICK)
    bound = 2.0 * stiff.values["compliance"]
    limits = {"compliance": {"at_most": bound}}
    changes = {"design.minimise": "volume", "design.iterations": 30, "design.limits": limits}
    problem, options = read_problem(file, changes)
    least = optimise(problem, tmp_path / "least", options, **QUICK)
    assert least.feasible
    assert least.objective == least.volume < 0.6
    assert least.values["compliance"] == pytest.approx(bound, rel=0.01)
    assert list(numbers(tmp_path / "least", "objective")) == list(numbers(tmp_path / "least", "volume"))
    for changed in (["design.minimise=volume"], ["design.minimise=''", "design.maximise=volume"]):
        words = [word for change in changed for word in ("--set", change)]
        assert _run(["optimise", str(file), *words, "--out", str(tmp_path / "no")]) == 2
        assert "it can be made small within limits" in capsys.readouterr().err
