"""``tmc-vem sweep`` and ``tmc-vem compare FILE.toml``: which runs there are, their tables and curves, and bad input."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import math
import re
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from helpers_plug import plug

from tmc_vem import Medium, RunOptions, RunResult
from tmc_vem.cli import compare_file
from tmc_vem.cli.check import check_file
from tmc_vem.cli.compare import compare_group
from tmc_vem.cli.main import _run
from tmc_vem.cli.sweep import sweep as sweep_command
from tmc_vem.report import plots
from tmc_vem.report.comparison import Comparison, Method, comparison_page
from tmc_vem.report.page import Picture
from tmc_vem.report.sweep import Row, Sweep, final_lines, said, sweep_page
from tmc_vem.results.records import StepRecord
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.study import sweep as module
from tmc_vem.study.batch import Outcome
from tmc_vem.study.compare import file_study
from tmc_vem.study.sweep import combinations, maker, sweep
from tmc_vem.support.errors import InputError
from tmc_vem.system.fem_settings import FemSettings
from tmc_vem.vem.spaces.element_settings import ElementSettings

# -- combinations ----------------------------------------------------------------------------------------------------


def test_all_combinations_the_last_entry_fastest() -> None:
    assert combinations({"a": [1, 2], "b": ["x"], "c": [3, 4]}) == [
        {"a": 1, "b": "x", "c": 3}, {"a": 1, "b": "x", "c": 4}, {"a": 2, "b": "x", "c": 3}, {"a": 2, "b": "x", "c": 4},
    ]  # fmt: skip


def test_values_side_by_side() -> None:
    assert combinations({"a": [1, 2], "b": ["x"], "c": [3, 4]}, zipped=True) == [
        {"a": 1, "b": "x", "c": 3}, {"a": 2, "b": "x", "c": 4},
    ]  # fmt: skip
    assert combinations({"a": [1]}, zipped=True) == [{"a": 1}]


def test_combinations_that_are_refused() -> None:
    with pytest.raises(InputError, match=r"^--set a has the value 1 twice: give it once$"):
        combinations({"a": [1, 2, 1]})
    with pytest.raises(InputError, match=r"--zip takes equally many values of each entry, or one: a has 2, c has 3$"):
        combinations({"a": [1, 2], "b": [1], "c": [1, 2, 3]}, zipped=True)
    with pytest.raises(
        InputError, match=r"^1001 combinations are more than 1000: give fewer values, or take them side"
    ):
        combinations({"a": list(range(1001))})
    assert len(combinations({"a": list(range(1000))})) == 1000


def test_benchmarks_and_what_may_be_set_of_them() -> None:
    problem, options = maker("cbox")(
        {"gamma": 1e-3, "medium.alpha_r": 2.0, "uy": -0.1, "cells": [10, 5], "solve.steps": 3}
    )
    assert options == RunOptions(steps=3)
    assert (problem.load().value, problem.cells) == (-0.1, (10, 5))  # type: ignore[attr-defined]
    medium: Medium = problem.medium  # type: ignore[attr-defined]
    assert (medium.gamma, medium.alpha_r, medium.regulariser, medium.beta) == (1e-3, 2.0, "angle", 0.0)
    assert maker("box")({})[0].inputs() == module.Box().inputs()
    for changes, message in (({"sells": [1, 2]}, "box has no 'sells' (did you mean 'cells'?)"),
                             ({"medium.gama": 1}, "medium has no 'gama' (did you mean 'gamma'?)"),
                             ({"solve.stps": 1}, "box: solve has no 'stps'")):  # fmt: skip
        with pytest.raises(InputError, match=re.escape(message)):
            maker("box")(changes)
    with pytest.raises(InputError, match=r"unknown problem 'boxx' \(did you mean 'box'\?\).*or give a problem file"):
        maker("boxx")


# -- tables and curves -----------------------------------------------------------------------------------------------


def result(gap: float, *, complete: bool = True, load: float = 1.0) -> RunResult:
    records = [
        StepRecord(n, load * n / 2, -0.1 * load * n / 2, {"gap": gap / n, "side": 3.0 * n}, -5.0 * n * gap, 3, 0, 0,
                   {"solid": 0.5, "medium": 0.1 / n}, {"solid": 2.0, "medium": 1.0}, 0, False, 1.0)
        for n in (1, 2)
    ]  # fmt: skip
    return RunResult(
        {"problem": "plug"}, {}, complete, "" if complete else "no way on", load, 4, 9, 7, 0, {}, {"total": 1.5},
        records, media=["medium"],
    )  # fmt: skip


MU, UY, WORD = "regions.plug.solid.mu", "load.uy", "mesh.cells"
ROWS = (
    Row({MU: 10, UY: -0.25, WORD: "a"}, result(4.0), "", "plug-1"),
    Row({MU: 10, UY: -0.5, WORD: "a"}, result(6.0), "", "plug-2"),
    Row({MU: 5.0, UY: -0.25, WORD: "b"}, result(8.0, complete=False, load=0.6), "", "plug-3"),
    Row({MU: 5.0, UY: -0.5, WORD: "b"}, None, "mu is bad"),
)  # fmt: skip
SWEEP = Sweep("Sweep of 'plug'", "tmc-vem sweep plug.toml", (MU, UY, WORD), ROWS)


def test_rows_say_what_was_reached_and_why_not() -> None:
    first, _, stopped, failed = ROWS
    assert (first.complete, first.why, first.final("gap"), first.final("side"), first.final("reaction")) == (
        True, "", 2.0, 6.0, -40.0,
    )  # fmt: skip
    assert (stopped.complete, stopped.final("gap")) == (False, None)
    assert stopped.why == "stopped at 0.6 of the load: no way on"
    assert (failed.complete, failed.why, failed.final("gap")) == (False, "mu is bad", None)
    assert first.final("other") is None


def test_axes_and_combinations_have_short_names() -> None:
    assert SWEEP.short == {MU: "mu", UY: "uy", WORD: "cells"}
    assert dataclasses.replace(SWEEP, axes=("a.mu", "b.mu", "c.'x y'")).short == {
        "a.mu": "a.mu",
        "b.mu": "b.mu",
        "c.'x y'": "x y",
    }
    assert SWEEP.label(ROWS[2]) == "mu = 5, uy = -0.25, cells = b"
    assert SWEEP.label(ROWS[2], UY) == "mu = 5, cells = b"
    assert list(SWEEP.runs) == [SWEEP.label(row) for row in ROWS[:3]]
    assert SWEEP.failures == ["mu = 5, uy = -0.5, cells = b gave no result: mu is bad"]
    assert SWEEP.quantities == ["gap", "side", "reaction"]


def test_values_in_words() -> None:
    assert [said(value) for value in (True, "a b", 1e-4, 0.1234567, 20, [1, 2.5], {"K": 2})] == [
        "true", "a b", "0.0001", "0.123457", "20", "[1, 2.5]", '{"K": 2}',
    ]  # fmt: skip


def test_the_table() -> None:
    table = SWEEP.table()
    assert list(table.head) == ["mu", "uy", "cells", "load", "gap", "side", "reaction", "smallest J",
                                "Newton iterations", "time (s)", "why not"]  # fmt: skip
    assert [[cell.text for cell in row] for row in table.cells] == [
        ["10", "-0.25", "a", "full load", "2.0000e+00", "6.0000e+00", "-4.0000e+01", "5.0000e-02", "7", "1.5", ""],
        ["10", "-0.5", "a", "full load", "3.0000e+00", "6.0000e+00", "-6.0000e+01", "5.0000e-02", "7", "1.5", ""],
        ["5", "-0.25", "b", "stopped at 0.6", "–", "–", "–", "5.0000e-02", "7", "1.5",
         "stopped at 0.6 of the load: no way on"],
        ["5", "-0.5", "b", "no result", "–", "–", "–", "–", "–", "–", "mu is bad"],
    ]  # fmt: skip
    assert [row[3].style for row in table.cells] == ["", "", "bad", "bad"]
    assert table.cells[0][-1].style == "long"


def test_rows_as_json_and_csv() -> None:
    rows = json.loads(SWEEP.to_json())
    assert rows[0] == {
        "set": {MU: 10, UY: -0.25, WORD: "a"}, "complete": True, "load": 1.0, "gap": 2.0, "side": 6.0,
        "reaction": -40.0, "min_j": {"solid": 0.5, "medium": 0.05}, "newton_iterations": 7, "seconds": 1.5,
        "directory": "runs/plug-1", "why": "",
    }  # fmt: skip
    assert (rows[2]["load"], rows[2]["gap"], rows[2]["complete"]) == (0.6, None, False)
    assert (rows[3]["directory"], rows[3]["min_j"], rows[3]["why"], rows[3]["seconds"]) == (None, {}, "mu is bad", None)
    table = list(csv.DictReader(io.StringIO(SWEEP.to_csv())))
    assert table[0][f"set {MU}"] == "10"
    assert (table[0]["gap"], table[0]["min_j_medium"], table[0]["complete"]) == ("2.0", "0.05", "True")
    assert (table[3]["gap"], table[3]["min_j_medium"], table[3]["why"]) == ("", "", "mu is bad")


def test_final_values_against_each_entry_with_numbers() -> None:
    assert final_lines(SWEEP, MU)["gap"] == {
        "uy = -0.25, cells = a": [(10.0, 2.0)],
        "uy = -0.5, cells = a": [(10.0, 3.0)],
    }
    assert final_lines(SWEEP, UY)["reaction"] == {"mu = 10, cells = a": [(-0.25, -40.0), (-0.5, -60.0)]}
    assert list(final_lines(SWEEP, UY)) == ["gap", "side", "reaction"]


def test_pictures_of_final_values(monkeypatch: pytest.MonkeyPatch) -> None:
    figures: list[Any] = []

    def keep(figure: Any, name: str, caption: str) -> Picture:
        figures.append((figure, name, caption))
        return Picture(name, caption, b"", b"")

    monkeypatch.setattr(plots, "picture", keep)
    line = {"x = 1": [(2.0, 5.0), (1.0, 4.0)], "x = 2": [(1.0, 6.0)]}
    found = plots.final_values(dict.fromkeys("abcd", line), "mu", "final-1")
    assert [picture.name for picture in found] == ["final-1-1", "final-1-2"]
    assert found[0].caption == "a, b, c at full load against mu."
    first, second = figures[0][0], figures[1][0]
    assert [axes.get_ylabel() for axes in (*first.axes, *second.axes)] == list("abcd")
    assert [curve.get_xydata().tolist() for curve in first.axes[0].lines] == [[[1, 4], [2, 5]], [[1, 6]]]
    assert [text.get_text() for text in first.axes[0].get_legend().get_texts()] == list(line)
    assert first.axes[1].get_legend() is None
    assert first._supxlabel.get_text() == "mu"  # a public name from matplotlib 3.8 on
    assert (first.get_size_inches()[0], second.get_size_inches()[0]) == (10.0, 5.5)
    plots.final_values({"a": {"": [(1.0, 2.0)]}}, "mu", "final-2")
    assert figures[-1][0].axes[0].get_legend() is None


def test_the_page(undrawn: None) -> None:
    page = sweep_page(SWEEP)
    assert page.title == "Sweep of 'plug'"
    assert page.lead.startswith("4 combinations of regions.plug.solid.mu, load.uy, mesh.cells. Everything on this page")
    assert [section.title for section in page.sections] == [
        "Result", "Against the values", "Loading", "Solution", "How to repeat this",
    ]  # fmt: skip
    assert page.sections[0].blocks[1].errors or page.sections[0].blocks[1].messages  # type: ignore[union-attr]
    names = [picture.name for picture in page.pictures]
    assert names == ["final-1-1", "final-2-1", "loading", "probes-1", "smallest-j"]
    words = sweep_page(dataclasses.replace(SWEEP, axes=(WORD,))).sections[1].blocks[0].text  # type: ignore[union-attr]
    assert words == "No entry with numbers has runs that reach full load."


# -- from values to rows ---------------------------------------------------------------------------------------------


def no_batch(monkeypatch: pytest.MonkeyPatch, gap: float | None = 4.0) -> list[Any]:
    """What would be run, without running it."""
    asked: list[Any] = []

    def done(jobs: Any, directory: Path, *, processes: int, observer: Any) -> list[Outcome]:
        asked.append((jobs, directory, processes))
        directory.parent.mkdir(parents=True, exist_ok=True)
        return [Outcome(job, None if gap is None else result(gap), "broken" if gap is None else "") for job in jobs]

    monkeypatch.setattr(module, "run_batch", done)
    monkeypatch.setattr(module, "sweep_page", lambda found: None)
    monkeypatch.setattr(module, "write_page", lambda page, out: None)
    return asked


def test_a_combination_that_is_no_problem_is_a_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = no_batch(monkeypatch)
    found = sweep(
        str(plug(tmp_path)), {"load.uy": [-0.1, 0], "mesh.size": [0.3]}, tmp_path / "out", processes=3, command="c"
    )
    ((jobs, directory, processes),) = asked
    assert (directory, processes, len(jobs)) == (tmp_path / "out" / "runs", 3, 1)
    assert jobs[0].label == "plug-uy=-0.1"
    assert (jobs[0].problem.load().value, jobs[0].problem.table.mesh.size) == (-0.1, 0.3)
    assert [(row.values["load.uy"], row.complete) for row in found.rows] == [(-0.1, True), (0, False)]
    assert found.rows[0].name == jobs[0].name
    assert "nothing moves" in found.rows[1].error
    assert (found.title, found.command, found.axes) == ("Sweep of 'plug'", "c", ["load.uy"])
    assert json.loads((tmp_path / "out" / "sweep.json").read_text()) == json.loads(found.to_json())
    assert (tmp_path / "out" / "sweep.csv").read_text() == found.to_csv().replace("\r\n", "\n")


def test_names_of_run_directories_are_plain(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = no_batch(monkeypatch)
    shapes = ["frame - base - plug", "frame - (base + plug)"]
    sweep(str(plug(tmp_path)), {"regions.medium.shape": shapes}, tmp_path / "out")
    assert [job.label for job in asked[0][0]] == ["plug-shape=frame-base-plug", "plug-shape=frame-_base+plug_"]
    assert len(module._label("x" * 100, "y")) == 60


def test_sweeps_without_any_result_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = str(plug(tmp_path))
    with pytest.raises(InputError, match=r"^a sweep needs an entry with several values, for example --set regions"):
        sweep(path, {"load.uy": [-0.1]}, tmp_path / "out")
    with pytest.raises(InputError, match=r"did you mean 'size'.*\(--set mesh.siez=1\)$"):
        sweep(path, {"mesh.siez": [1, 2]}, tmp_path / "out")
    no_batch(monkeypatch, None)
    with pytest.raises(InputError, match=r"^uy = -0\.1 gave no result: broken$"):
        sweep(path, {"load.uy": [-0.1, -0.2]}, tmp_path / "out")
    assert not (tmp_path / "out" / "sweep.csv").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "several values"), (["--set", "load.uy"], "NAME=VALUE"), (["--set", "load.uy=1,1"], "twice"),
        (["--set", "load.uy=1,"], "a value is missing"), (["--set", "mesh.siez=1,2"], "did you mean 'size'"),
        (["--set", "a=1,2", "--set", "b=1,2,3", "--zip"], "a has 2, b has 3"), (["--jobs", "0"], "--jobs"),
        (["--set", "a=1", "--set", "a=1,2"], "set twice"),
    ],
)  # fmt: skip
def test_bad_input_of_a_sweep(
    words: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert _run(["sweep", str(plug(tmp_path)), *words]) == 2
    printed = capsys.readouterr().err
    assert message in printed
    assert printed.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["plug.toml"]


def test_the_command_shows_rows_and_counts_failures(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    plug(tmp_path)
    no_batch(monkeypatch)
    words = ["sweep", "plug.toml", "--set", "load.uy=-0.1,-0.2"]
    assert _run(words) == 0
    out = capsys.readouterr().out
    assert out.splitlines()[0].split() == ["uy", "load", "gap", "side", "reaction", "smallest", "J", "Newton",
                                           "iterations", "time", "(s)", "why", "not"]  # fmt: skip
    assert out.splitlines()[-1] == "report: runs/sweep-plug/report.html"
    assert _run([*words, "--json", "--out", "here"]) == 0
    assert [row["set"]["load.uy"] for row in json.loads(capsys.readouterr().out)] == [-0.1, -0.2]
    assert (tmp_path / "here" / "sweep.csv").is_file()
    assert _run(["sweep", "plug.toml", "--set", "load.uy=-0.1,0"]) == 1
    assert capsys.readouterr().err == "tmc-vem: 1 of 2 runs gave no result; the table says why\n"


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("swept")
    words = ["--set", "load.uy=-0.01,0", "--set", "mesh.size=0.3", "--json", "--out", str(directory / "out")]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("matplotlib.figure.Figure.savefig", lambda *_, **__: None)
        assert _run(["sweep", str(plug(directory)), *words]) == 1
    return directory


def test_runs_of_a_sweep_are_found_again(swept: Path, capsys: pytest.CaptureFixture[str], undrawn: None) -> None:
    """One of the two combinations is no problem, as nothing moves."""
    rows = json.loads((swept / "out" / "sweep.json").read_text())
    assert [row["complete"] for row in rows] == [True, False]
    assert rows[0]["gap"] == pytest.approx(0.19, abs=1e-3)
    assert "nothing moves" in rows[1]["why"]
    path = swept / "out" / rows[0]["directory"]
    run = RunResult.read(path)
    assert (run.gap, run.inputs["set"]) == (rows[0]["gap"], {"load.uy": -0.01, "mesh.size": 0.3})
    again, options = read_problem(path / "problem.toml")
    assert (again.load().value, options.steps) == (-0.01, 1)
    assert "Against the values" in (swept / "out" / "report.html").read_text()
    words = ["--set", "load.uy=-0.01,0", "--set", "mesh.size=0.3", "--json", "--out", str(swept / "out")]
    capsys.readouterr()
    assert _run(["sweep", str(swept / "plug.toml"), *words]) == 1
    printed = capsys.readouterr()
    assert "1 runs, 1 of them done before" in printed.err
    assert json.loads(printed.out) == rows


def test_help_says_how_values_are_written() -> None:
    for command, form, more in ((sweep_command, "NAME=VALUE,VALUE,...", "separated by commas."),
                                (check_file, "NAME=VALUE", "several times.")):  # fmt: skip
        option = next(param for param in command.params if param.name == "changes")
        assert (option.opts, option.metavar, option.multiple) == (["--set"], form, True)  # type: ignore[attr-defined]
        assert option.help.endswith(more)  # type: ignore[attr-defined]


# -- comparisons of problem files ------------------------------------------------------------------------------------


def test_meshes_and_methods_of_a_problem_file(tmp_path: Path) -> None:
    problem, settings = read_problem(plug(tmp_path), {"mesh.size": 0.2, "mesh.cells": "voronoi", "load.uy": -0.1})
    study = file_study(problem, (0.1, 0.4, 0.2), settings)
    assert study.title == "plug: VEM and FEM"
    assert [(level.name, level.size) for level in study.levels] == [
        ("size 0.4", 0.4),
        ("size 0.2", 0.2),
        ("size 0.1", 0.1),
    ]
    for level in study.levels:
        tables = {method: made.table.mesh for method, made in level.problems.items()}  # type: ignore[attr-defined]
        assert {mesh.size for mesh in tables.values()} == {level.size}
        assert [mesh.refine[0].size for mesh in tables.values()] == pytest.approx([level.size] * 2)
        assert (tables["vem"].cells, tables["fem"].cells) == ("voronoi", "triangles")
        assert level.problems["vem"].inputs()["set"] == {"mesh.cells": "voronoi", "load.uy": -0.1}
    assert study.options == {
        "vem": RunOptions(steps=1, snapshots=0),
        "fem": RunOptions("fem", steps=1, snapshots=0, fem=FemSettings(interior_penalty="penalty")),
    }
    of_triangles = file_study(read_problem(plug(tmp_path))[0], (0.1, 0.2, 0.4), settings).levels[0].problems
    assert {made.table.mesh.cells for made in of_triangles.values()} == {"triangles"}  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("of_file", "given", "penalty"),
    [("none", None, "penalty"), ("full", None, "full"), ("none", "none", "none"), ("full", "none", "none")],
)
def test_settings_of_a_comparison(tmp_path: Path, of_file: str, given: str | None, penalty: str) -> None:
    problem, _ = read_problem(plug(tmp_path))
    settings = RunOptions(
        steps=4, method="fem", fem=FemSettings(interior_penalty=of_file), element=ElementSettings(eta=3.0)
    )
    study = file_study(problem, (1, 2, 3), settings, order=3, steps=2, interior_penalty=given)
    assert study.options["fem"] == RunOptions("fem", steps=2, fem=FemSettings(order=3, interior_penalty=penalty),
                                              element=settings.element)  # fmt: skip
    assert study.options["vem"].element == ElementSettings(order=3, eta=3.0)
    assert (study.options["vem"].method, study.options["vem"].steps) == ("vem", 2)
    assert file_study(problem, (1, 2, 3), settings).options["vem"].steps == 4


@pytest.mark.parametrize(
    ("words", "sizes"),
    [
        ([], [0.5, 0.375, 0.25]), (["--quick"], [0.75, 0.5625, 0.375]),
        (["--mesh-size", "0.1,0.2", "--mesh-size", "0.3 0.2"], [0.3, 0.2, 0.1]),
    ],
)  # fmt: skip
def test_sizes_of_a_comparison(
    words: list[str], sizes: list[float], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Any] = []
    monkeypatch.setattr(compare_file, "compare_study", lambda *given: seen.append(given))
    path = str(plug(tmp_path))
    more = ["--set", "load.uy=-0.3", "--steps", "7", "--order", "3", "--interior-penalty", "full", "--jobs", "4"]
    done = CliRunner().invoke(compare_group, [path, *words, *more], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    ((study, out, jobs),) = seen
    assert [level.size for level in study.levels] == pytest.approx(sizes)
    assert (out, jobs) == (Path("runs/compare-plug"), 4)
    assert study.options["fem"].fem == FemSettings(order=3, interior_penalty="full")
    assert study.options["vem"].steps == 7
    assert study.levels[0].problems["fem"].load().value == -0.3


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--mesh-size", "0.1,0.2"], "2 meshes: convergence shows on three or more, so give --mesh-size three times"),
        (["--mesh-size", "a"], "--mesh-size a is no list of sizes, for example 0.1,0.07,0.05"),
        (["--mesh-size", "0,1,2"], "size = 0"), (["--set", "mesh.size=1,2"], "'tmc-vem sweep'"),
        (["--set", "mesh.siez=1"], "did you mean 'size'"), (["--order", "9"], "order"),
    ],
)  # fmt: skip
def test_bad_input_of_a_comparison(
    words: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert _run(["compare", str(plug(tmp_path)), *words]) == 2
    printed = capsys.readouterr().err
    assert message in printed
    assert printed.count("\n") == 1


def test_a_mesh_file_has_one_size(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text(
        'name = "a"\nregions = { body = { solid = { K = 2, mu = 1 } } }\nmesh = { file = "a.msh" }\nsupport = []\n'
        'load = { at = "top", ux = 1 }\n'
    )
    problem, settings = read_problem(path)
    with pytest.raises(
        InputError, match=r"^mesh: file = 'a.msh' has one size of cells: give several files to 'tmc-vem sw"
    ):
        file_study(problem, (0.0, 0.0, 0.0), settings)


def test_a_problem_without_a_gap_is_compared_by_its_energy(undrawn: None) -> None:
    def of(gap: bool) -> Comparison:
        made = result(4.0)
        history = [dataclasses.replace(record, probes=record.probes if gap else {}) for record in made.history]
        return Comparison("t", "c", [Method("VEM", {"a": dataclasses.replace(made, history=history)}, {})])

    assert list(of(gap=True).quantities) == ["gap", "energy"]
    assert list(of(gap=False).quantities) == ["energy"]
    captions = [getattr(block, "caption", "") for block in comparison_page(of(gap=False)).sections[2].blocks]
    assert captions == [
        "Energy of all regions at full load: a mean over the whole domain, smoother than the gap at one place."
    ]
    assert math.isclose(of(gap=False).quantities["energy"](of(gap=False).methods[0].runs["a"]) or 0.0, 3.0)
