"""What pages, pictures, tables and commands show of adapted meshes."""

from __future__ import annotations

import json
import math
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from matplotlib.collections import PolyCollection
from matplotlib.colors import LogNorm

from tmc_vem import RunResult
from tmc_vem.adapt.adaption import _drawn
from tmc_vem.adapt.run import run
from tmc_vem.cli.main import cli
from tmc_vem.problems import Box
from tmc_vem.report.adapted import adapted_sections
from tmc_vem.report.adapted_curves import curves_figure, loads_of
from tmc_vem.report.adapted_meshes import DECADES, meshes_figure, shown_rounds, title_of
from tmc_vem.report.adapted_tables import (
    CRUDE,
    ELSEWHERE,
    change,
    errors_in_few_words,
    estimated_errors,
    in_words,
    rounds_table,
    signed_error,
    solution_table,
)
from tmc_vem.report.animation import meshes_of
from tmc_vem.report.comparison import Comparison, Method, comparison_page
from tmc_vem.report.page import Picture, Table, Text
from tmc_vem.report.problem_figure import MEDIUM_COLOUR, SOLIDS
from tmc_vem.report.run_page import run_page
from tmc_vem.report.tables import runs_csv
from tmc_vem.results.adapted_rounds import ERROR_OF, GO_ON, adaptivity_of, read_round
from tmc_vem.results.adaptivity import LINEARISED, SOLVED, Adaptivity, Round
from tmc_vem.simulation.adapt_settings import AdaptSettings
from tmc_vem.simulation.options import RunOptions
from tmc_vem.support.errors import InputError

OF = ("gap", "reaction")


@pytest.fixture(scope="module")
def adapted(tmp_path_factory: pytest.TempPathFactory) -> RunResult:
    """A run with rounds at two loads."""
    out = tmp_path_factory.mktemp("adapted") / "run"
    settings = AdaptSettings(",".join(OF), tolerance="1%", rounds=2, at=(0.5, 1.0))
    run(Box(cells=(20, 5), uy=-0.3), out, RunOptions(adapt=settings))
    return RunResult.read(out)


@pytest.fixture
def copied(adapted: RunResult, tmp_path: Path) -> Path:
    """Its directory, to be changed."""
    assert adapted.directory is not None
    return shutil.copytree(adapted.directory, tmp_path / "run")


def rounds_of(result: RunResult) -> Adaptivity:
    assert result.adaptivity is not None
    return result.adaptivity


def round_of(number: int = 0, load: float = 1.0, cells: int = 100, **values: Any) -> Round:
    usual: dict[str, Any] = {
        "values": {"gap": 2.0, "reaction": -4.0, "energy": 8.0}, "estimate": SOLVED,
        "errors": {"gap": 0.1, "reaction": 0.02, "energy": -0.04},
    }  # fmt: skip
    return Round(number=number, load=load, n_cells=cells, n_dofs=10 * cells, **{**usual, **values})


def made(*rounds: Round, of: tuple[str, ...] = OF, tolerance: float = 0.01) -> Adaptivity:
    return Adaptivity(of, tolerance, rounds, False, "enough")


def area(points: Any) -> float:
    x, y = np.transpose(points)
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def test_files_of_rounds_have_the_meshes(adapted: RunResult) -> None:
    assert adapted.directory is not None
    rounds = rounds_of(adapted).rounds
    assert len({each.load for each in rounds}) == 2
    assert rounds[-1].n_cells > rounds[0].n_cells
    for each in rounds:
        fields = read_round(adapted.directory, each.number)
        polygons = fields.polygons
        assert polygons.n_cells == each.n_cells
        areas = np.array([area(polygons.points_nx[polygons.cell(c)]) for c in range(polygons.n_cells)])
        assert areas.sum() == pytest.approx(2.0 * 0.5)
        assert areas[~polygons.is_solid_c].sum() == pytest.approx(1.8 * 0.3)
        assert fields.displacement_ni[:, 1].min() == pytest.approx(-0.3 * each.load, abs=0.02)
        assert {ERROR_OF + name for name in OF} <= {*fields.cell_fields}
        text = (adapted.directory / "adapt" / f"round-{each.number:02d}.vtu").read_text()
        for name in OF:  # a bound has no unit that is known
            start = text.index(f'Name="{ERROR_OF}{name}"')
            assert "UNITS_LABEL" not in text[start : text.index("</DataArray>", start)]
    with pytest.raises(InputError, match="round-99"):
        read_round(adapted.directory, 99)


def test_a_page_has_a_section(adapted: RunResult) -> None:
    a = rounds_of(adapted)
    page = run_page(adapted)
    (section,) = [each for each in page.sections if each.title == "Adapted mesh"]
    kinds = [type(block) for block in section.blocks]
    assert kinds == [Text, Table, Picture, Picture, Table]
    text, rounds, curves, meshes, solution = section.blocks
    assert isinstance(text, Text)
    assert isinstance(rounds, Table)
    assert isinstance(solution, Table)
    assert a.reason in text.text
    assert [[cell.text for cell in row][:4] for row in rounds.cells] == [
        [str(each.number), f"{each.load:g}", str(each.n_cells), str(each.n_dofs)] for each in a.rounds
    ]
    assert [row[2].text for row in solution.cells] == [str(each.iterations) for each in a.rounds]
    assert [block.name for block in (curves, meshes) if isinstance(block, Picture)] == ["adapted-1", "adapted-meshes"]
    plain = run_page(replace(adapted, adaptivity=None))
    assert "Adapted mesh" not in [each.title for each in plain.sections]


def test_without_files_there_is_all_but_meshes(adapted: RunResult, copied: Path) -> None:
    (section,) = adapted_sections("a", replace(adapted, directory=None))
    assert section.blocks[3] == Text("The run was kept in memory only: there are no pictures of the meshes.")
    (copied / "adapt" / "round-00.vtu").unlink()
    (section,) = adapted_sections("a", RunResult.read(copied))
    assert isinstance(section.blocks[3], Text)
    assert "round-00.vtu is not readable" in section.blocks[3].text


def test_signs_of_errors() -> None:
    """The exact value is the value times one plus the error, whatever sign it has."""
    for value, error in ((2.0, 0.1), (2.0, -0.1), (-4.0, 0.02), (-4.0, -0.02)):
        found = signed_error(round_of(values={"gap": value}, errors={"gap": error}), "gap")
        assert found is not None
        assert value * (1.0 + found) == pytest.approx(value + error)
    assert signed_error(round_of(errors={}), "gap") is None


def test_rounds_and_their_colours() -> None:
    close = {"gap": 0.001, "reaction": 0.001}
    table = rounds_table("a", RESULT, made(
        round_of(0, refined=7), round_of(1, errors=close),
        round_of(2, load=2.0, estimate="", errors={}, doubt="there is no estimate: bad luck"),
        round_of(3, load=2.0, estimate=LINEARISED, errors=close), round_of(4, load=2.0),
        round_of(5, load=2.0, errors={"gap": 1.0, "reaction": 1.0}, values={"gap": 0.0, "reaction": math.nan}),
    ))  # fmt: skip
    cells = [[(cell.text, cell.style, cell.note) for cell in row] for row in table.cells]
    assert [row[5][:2] for row in cells] == [
        ("+5 %", ""), ("+0.05 %", "good"), ("–", "suspect"), ("+0.05 %", "suspect"), ("+5 %", ""),
        ("1.0e+00", "suspect"),
    ]  # fmt: skip
    assert cells[2][5][2] == "There is no estimate: bad luck."
    assert cells[3][5][2] == CRUDE[LINEARISED]
    assert [row[7][0] for row in cells[:2]] == ["-0.5 %", "-0.025 %"]
    assert [row[8][0] for row in cells[:2]] == ["7", "–"]
    assert cells[5][6][0] == "–"
    last_at_load = rounds_table("a", RESULT, made(round_of(0), round_of(1, load=2.0, errors={"gap": 0.001})))
    assert [row[5].style for row in last_at_load.cells] == ["bad", "good"]
    assert last_at_load.cells[1][7].note == "There is no estimate of it."
    one = rounds_table("a", RESULT, made(round_of(), of=("gap",)))
    assert list(one.head) == ["round", "load", "cells", "dofs", "gap", "estimated error", "cells cut"]


def test_changes_that_estimates_do_not_explain() -> None:
    """The energy was off by 0.5 %, so that 1.4 % is no surprise and 1.6 % is."""
    for now, far in ((8.0 * 1.014, False), (8.0 * 1.016, True), (8.0 * 0.984, True)):
        second = round_of(1, values={"energy": now}, before={"energy": 8.0}, found="carried over")
        row = solution_table(made(round_of(), second)).cells[1]
        assert row[1].text == "Carried over"
        assert row[3].text == f"{100.0 * (now / 8.0 - 1.0):+.2g} %"
        assert row[3].note == (ELSEWHERE if far else "")
        assert row[4].text == "–"
    assert change(round_of(), "energy") is None


def test_why_there_are_no_more_rounds() -> None:
    text = in_words(made(round_of(seconds=1.5), round_of(1, cells=300, seconds=2.0))).text
    assert "Adapted to gap, reaction with a tolerance of 1 %: 2 rounds, 100 to 300 cells, 3.5 s." in text
    assert "Why there are no more: enough. The result is that of the whole path" in text


@pytest.mark.parametrize(("cells", "shown"), [
    ((100,), (0,)), ((100, 400), (0, 1)), ((100, 110, 190, 400), (0, 2, 3)), ((100, 200, 390, 400), (0, 1, 3)),
    ((400, 200, 390, 100), (0, 1, 3)), ((100, 200, 240, 400), (0, 1, 3)),
])  # fmt: skip
def test_which_meshes_are_shown(cells: tuple[int, ...], shown: tuple[int, ...]) -> None:
    """The one between is the nearest to the geometric mean."""
    assert [each.number for each in shown_rounds([round_of(n, cells=c) for n, c in enumerate(cells)])] == [*shown]


def test_titles() -> None:
    assert title_of(round_of(2, load=0.5)) == "round 2, load 0.5: 100 cells"
    assert title_of(round_of(), ("reaction",), load=False) == "round 0: 100 cells, reaction -4 (-0.5 %)"


def test_rounds_of_each_load() -> None:
    loads = loads_of(made(round_of(0, 0.5), round_of(1, 0.5), round_of(2, 1.0)))
    assert [(load, [each.number for each in rounds]) for load, rounds in loads] == [(0.5, [0, 1]), (1.0, [2])]


def test_values_are_drawn_with_their_errors() -> None:
    """The bars end where the errors do, the crosses are at the exact values, the band around the last of them."""
    rounds = (round_of(0), round_of(1, cells=200, values={"gap": 2.1}, errors={"gap": -0.05}),
              round_of(2, cells=400, values={"gap": 2.07}, errors={}, estimate="", doubt="none"))  # fmt: skip
    left, right = curves_figure(made(*rounds, of=("gap",)), ("gap",), ("gap (mm)",)).axes
    (bars,) = left.containers
    assert bars[0].get_xydata().tolist() == [[1000.0, 2.0], [2000.0, 2.1], [4000.0, 2.07]]
    ends = [segment[:, 1].tolist() for segment in bars[2][0].get_segments()]
    assert np.ravel(ends) == pytest.approx([1.9, 2.1, 2.05, 2.15, 2.07, 2.07])
    (crosses,) = [line for line in left.lines if line.get_label() == "exact, by the estimate"]
    assert crosses.get_xydata() == pytest.approx(np.array([[1000.0, 2.1], [2000.0, 2.05]]))
    (band,) = left.patches
    assert band.get_extents().transformed(left.transData.inverted()).intervaly == pytest.approx(
        [2.07 * 0.99, 2.07 * 1.01]
    )
    assert (left.get_ylabel(), right.get_ylabel()) == ("gap (mm)", "estimated error of gap, %")
    assert (left.get_xscale(), right.get_xscale(), right.get_yscale()) == ("log", "log", "log")
    marks = {line.get_marker(): float(line.get_ydata()[0]) for line in right.lines if line.get_marker() in "^v"}
    assert marks == {"^": pytest.approx(5.0), "v": pytest.approx(100.0 * 0.05 / 2.1)}
    assert [line.get_ydata()[0] for line in right.lines if line.get_label() == "tolerance 1 %"] == [1.0]


def test_several_loads_are_drawn_relative_to_their_last_estimates() -> None:
    rounds = (round_of(0, 0.5), round_of(1, 0.5, 200, values={"gap": 2.1, "reaction": -4.0}),
              round_of(2, 1.0, 200, values={"gap": 1.0, "reaction": -8.0}, doubt="crude"))  # fmt: skip
    figure = curves_figure(made(*rounds), OF, OF)
    upper, _, lower, _ = figure.axes
    first, second = (bars[0].get_ydata() for bars in upper.containers)
    assert first == pytest.approx([100.0 * (2.0 / 2.2 - 1.0), 100.0 * (2.1 / 2.2 - 1.0)])
    assert second == pytest.approx([100.0 * (1.0 / 1.1 - 1.0)])
    assert [bars.get_label() for bars in upper.containers] == ["load 0.5", "load 1"]
    filled = [line.get_markerfacecolor() for line in lower.lines if line.get_marker() == "^"]
    assert [colour == "white" for colour in filled] == [False, False, True]


def test_values_that_are_not_known_are_left_out() -> None:
    rounds = made(round_of(0, values={"gap": None}, errors={}), round_of(1, cells=200), of=("gap",))
    left, _ = curves_figure(rounds, ("gap",), ("gap",)).axes
    assert left.containers[0][0].get_xdata().tolist() == [2000.0]
    none = made(round_of(0, values={"gap": math.nan}, errors={}), of=("gap",))
    assert not curves_figure(none, ("gap",), ("gap",)).axes[0].containers


def test_meshes_and_where_errors_come_from(adapted: RunResult) -> None:
    assert adapted.directory is not None
    a = rounds_of(adapted)
    figure = meshes_figure(adapted.directory, a)
    chosen = shown_rounds(a.rounds)
    collections = [[c for c in axes.collections if isinstance(c, PolyCollection)] for axes in figure.axes]
    by_region, by_share = collections[: 2 * len(chosen)], collections[2 * len(chosen) : -1]
    counts = [sum(len(c.get_paths()) for c in drawn) for drawn in by_region]
    assert counts == 2 * [each.n_cells for each in chosen]
    colours = {tuple(np.round(255 * c.get_facecolor()[0, :3]).astype(int)) for drawn in by_region for c in drawn}
    wanted = {tuple(int(colour[n : n + 2], 16) for n in (1, 3, 5)) for colour in (SOLIDS[0], MEDIUM_COLOUR)}
    assert colours == wanted
    assert len(by_share) == 2 * len(OF)
    for (drawn,) in by_share:
        assert isinstance(drawn.norm, LogNorm)
        assert drawn.norm.vmax / drawn.norm.vmin <= 10.0**DECADES * (1.0 + 1e-9)
        assert drawn.get_array().sum() == pytest.approx(1.0)
    last = read_round(adapted.directory, a.last.number).cell_fields[ERROR_OF + "gap"]
    assert np.asarray(by_share[0][0].get_array()) == pytest.approx(last / last.sum())
    titles = [axes.get_title() for axes in figure.axes[: len(chosen)]]
    assert titles == [title_of(each) for each in chosen]
    assert [text.get_text().partition(": ")[0] for text in figure.texts] == [f"round {a.last.number}"] * len(OF)


def test_meshes_without_an_estimate_have_no_colours(adapted: RunResult) -> None:
    assert adapted.directory is not None
    blind = replace(rounds_of(adapted), rounds=[replace(rounds_of(adapted).rounds[0], estimate="")])
    figure = meshes_figure(adapted.directory, blind)
    assert len(figure.axes) == 2


def test_a_run_draws_its_meshes(adapted: RunResult, copied: Path) -> None:
    picture = copied / "adapted.png"
    assert picture.read_bytes().startswith(b"\x89PNG")
    picture.unlink()
    assert _drawn(copied, rounds_of(adapted)) == ""
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_picture_that_cannot_be_made_is_a_warning(adapted: RunResult, copied: Path) -> None:
    (copied / "adapted.png").unlink()
    (copied / "adapted.png").mkdir()
    (copied / "adapted.png" / "notes.txt").write_text("")
    assert _drawn(copied, rounds_of(adapted)).startswith("adapted.png could not be written: ")
    (copied / "adapt" / "round-00.vtu").write_text("")
    assert _drawn(copied, rounds_of(adapted)).startswith("adapted.png was not drawn: ")


def test_a_run_does_not_end_for_want_of_a_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("tmc_vem.report.adapted_meshes.draw_meshes_file", full)
    options = RunOptions(adapt=AdaptSettings("reaction", tolerance="50%"))
    result = run(Box(cells=(20, 5), uy=-0.02), tmp_path / "run", options)
    assert result.complete
    assert "adapted.png could not be written: No space left on device" in result.warnings


def test_rounds_of_a_run_without_a_result(adapted: RunResult, copied: Path) -> None:
    a = rounds_of(adapted)
    (copied / "result.json").unlink()
    over = adaptivity_of(RunResult.read(copied))
    assert over is not None
    assert (over.of, over.tolerance, over.reached, over.reason) == (a.of, a.tolerance, a.reached, a.reason)
    assert [each.values for each in over.rounds] == [each.values for each in a.rounds]
    path = copied / "adapt" / "rounds.json"
    facts = json.loads(path.read_text())
    path.write_text(json.dumps({**facts, "finished": None, "rounds": facts["rounds"][:1]}))
    result = RunResult.read(copied)
    standing = adaptivity_of(result)
    assert standing is not None
    assert (len(standing.rounds), standing.reached, standing.reason) == (1, False, GO_ON)
    assert "Adapted mesh" in [each.title for each in run_page(result).sections]
    path.write_text(json.dumps({**facts, "rounds": []}))
    assert adapted_sections("a", result) == []
    path.write_text("{")
    (section,) = adapted_sections("a", result)
    assert isinstance(section.blocks[0], Text)
    assert "rounds.json is not readable" in section.blocks[0].text
    path.unlink()
    assert adapted_sections("a", result) == []


def test_an_animation_has_a_frame_a_round(adapted: RunResult, copied: Path, tmp_path: Path) -> None:
    from PIL import Image

    a = rounds_of(adapted)
    assert [title for title, _ in meshes_of(adapted)] == [title_of(each, OF) for each in a.rounds]
    done = CliRunner().invoke(cli, ["animate", str(copied), "--meshes"])
    assert done.exit_code == 0, done.output
    with Image.open(copied / "adapted.gif") as frames:
        assert frames.n_frames == len(a.rounds)
        assert frames.info["duration"] == 1000
    refused = CliRunner().invoke(cli, ["animate", str(copied), "--meshes", "--quantity", "J"])
    assert isinstance(refused.exception, InputError)
    assert "no use is made of --quantity" in str(refused.exception)
    with pytest.raises(InputError, match="has no adapted mesh to show: run it with --adapt gap"):
        meshes_of(replace(adapted, adaptivity=None))


def test_errors_beside_other_results(adapted: RunResult, copied: Path) -> None:
    a = rounds_of(adapted)
    errors = [signed_error(a.last, name) for name in OF]
    texts = [f"{100.0 * (error or 0.0):+.2g} %" for error in errors]
    assert errors_in_few_words(adapted) == f"gap {texts[0]}, reaction {texts[1]}"
    assert errors_in_few_words(replace(adapted, adaptivity=None)) == ""
    plain = replace(adapted, adaptivity=None)
    (table,) = estimated_errors({"one": adapted, "plain": plain})
    assert [[row[n].text for n in (0, 1, 3, 4)] for row in table.cells] == [
        ["one", name, text, "1 %"] for name, text in zip(OF, texts, strict=True)
    ]
    assert estimated_errors({"plain": plain}) == []
    head, first, second = runs_csv({"one": adapted, "plain": plain}).splitlines()
    column = head.split(",").index("estimated_error.gap")
    assert float(first.split(",")[column - len(head.split(","))]) == a.errors["gap"]
    assert second.split(",")[column - len(head.split(","))] == ""
    page = comparison_page(Comparison("t", "c", [Method("VEM", {"a": adapted}, {}), Method("FEM", {"a": plain}, {})]))
    captions = [block.caption for each in page.sections for block in each.blocks if isinstance(block, Table)]
    assert table.caption in captions
    listed = CliRunner().invoke(cli, ["list", str(copied.parent)])
    assert "estimated error" in listed.output
    assert errors_in_few_words(adapted) in listed.output


RESULT = RunResult({}, {}, True, "", 1.0, 4, 9, 3, 0, {}, {"total": 1.0}, [])
