"""Tables and figures of the paper from made-up runs: every cell is the value that belongs there."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import drawn
import pytest

from tmc_vem.report.page import Entry, Text
from tmc_vem.report.richardson import Extrapolation
from tmc_vem.report.tables import provenance
from tmc_vem.study.paper import body_figures, box_figures, point_loads
from tmc_vem.study.paper import table2 as second
from tmc_vem.study.paper import table3 as third
from tmc_vem.study.paper.cells import judged, printed, ratio
from tmc_vem.study.paper.jobs import box_job
from tmc_vem.study.paper.values import table2, table3


def run(gap: float, complete: bool = True, **more: Any) -> Any:
    return SimpleNamespace(gap=gap, complete=complete, steps=5, **more)


def number(value: float) -> str:
    return f"{value:.4e}"


def test_table_2(monkeypatch: pytest.MonkeyPatch) -> None:
    """Gaps a little off the converged one: 1 % of finite elements, 2, 4 and 6 % of the three densities."""
    monkeypatch.setattr(second, "creep", lambda coarse, fine: 0.0)
    monkeypatch.setattr(second, "sinking", lambda runs: None)
    monkeypatch.setattr(second, "effort", lambda runs: Text(f"{len(runs)} runs"))
    asked: list[Any] = []

    def converged(sizes: list[float], runs: list[Any]) -> Extrapolation:
        asked.append((sizes, [made.gap for made in runs]))
        return Extrapolation(0.5 * runs[-1].gap, 2.0, 0.0)

    monkeypatch.setattr(second, "converged", converged)
    results: dict[str, Any] = {}
    values = {pair: 0.01 * (n + 1) for n, pair in enumerate(second.MEDIA)}
    for pair, medium in second.MEDIA.items():
        value = values[pair]
        for n, cells in enumerate(second.UNIFORM[True]):
            results[box_job("vem", cells, medium).name] = run(2.0 * value if n == 2 else (5.0 + n) * value)
        results[box_job("fem", second.FINE[True], medium).name] = run(1.01 * value)
        for n in (1, 2, 3):
            results[box_job("vem", second.SOLID[True], medium, n).name] = run((1.0 + 0.02 * n) * value)
    del results[box_job("fem", second.FINE[True], second.MEDIA[10.0, 1e-4]).name]
    fem, vem, mesh, effort = second.sections(results, True)
    assert asked[0] == ([1 / 20, 1 / 40, 1 / 60], pytest.approx([1.02 * 0.01, 6.0 * 0.01, 2.0 * 0.01]))
    text, table = fem.blocks
    assert isinstance(text, Text)
    assert text.text.startswith("8 of 9 pairs reach full load with both methods on all meshes.")
    assert text.text.endswith("Our fine FEM is within 1.0 % of it. Our three VEM meshes are within 6.0 % of it.")
    for row, (pair, cells) in zip(table.rows, table2().items(), strict=True):  # type: ignore[union-attr]
        value, paper, ours = values[pair], cells["fem_fine"], 1.01 * values[pair]
        is_there = pair != (10.0, 1e-4)
        assert row == [
            f"{pair[0]:g}", f"{pair[1]:.0e}", printed(paper),
            number(ours) if is_there else Entry("failed", style="bad"),
            ratio(ours, paper) if is_there else "–", str(Extrapolation(value, 2.0, 0.0)),
            judged(paper.value / value - 1.0 if paper.usable and paper.value else None, 0.02),
            judged(0.01 if is_there else None, 0.02),
        ]  # fmt: skip
    for n, table in enumerate(vem.blocks[1:]):
        start = f"Gap at u_y = -1: the paper's mesh {n + 1}, and ours with"
        assert table.caption.startswith(start)  # type: ignore[union-attr]
        for row, (pair, cells) in zip(table.rows, table2().items(), strict=True):  # type: ignore[union-attr]
            column, ours = cells[f"vem_mesh{n + 1}"], (1.02 + 0.02 * n) * values[pair]
            assert row == [
                f"{pair[0]:g}", f"{pair[1]:.0e}", printed(column), number(ours), ratio(ours, column),
                judged(0.02 * (n + 1), 0.05),
            ]  # fmt: skip
    (squares,) = mesh.blocks
    assert squares.head == ("alpha_r", "gamma", "20 x 5", "40 x 10", "60 x 15", "converged")  # type: ignore[union-attr]
    value = values[1.0, 1e-4]
    gaps = [number(factor * value) for factor in (1.02, 6.0, 2.0)]
    wanted = ["1", "1e-04", *gaps, str(Extrapolation(value, 2.0, 0.0))]
    assert wanted in list(squares.rows)  # type: ignore[union-attr]
    assert effort.blocks == [Text(f"{len(results)} runs")]
    monkeypatch.setattr(second, "creep", lambda coarse, fine: -0.25)
    found = second.limit(results, second.MEDIA[1.0, 1e-4], True)
    assert found is not None
    assert found.uncertainty == pytest.approx(0.25 * value)


def test_table_3() -> None:
    jobs = third.jobs(True)
    results = {job.name: run(0.001 * (n + 1), complete=n != 5, history=[], load=0.5, state="stopped", last=None)
               for n, job in enumerate(jobs.values())}  # fmt: skip
    (section,) = third.sections({name: made for name, made in results.items() if made.complete}, True)
    spread, note, plain, damped = section.blocks
    assert isinstance(note, Text)
    assert note.text == third.NOTE
    assert isinstance(spread, Text)
    assert "agree within" in spread.text
    for beta, table in ((0.0, plain), (5.0, damped)):
        assert list(table.head) == [  # type: ignore[union-attr]
            "regulariser", "paper, mesh 1", "ours, 20 x 5", "ours / paper", "paper, mesh 2", "ours, 40 x 10",
            "ours / paper",
        ]  # fmt: skip
        assert table.caption.endswith("damped by exp(-5 J)." if beta else "without damping.")  # type: ignore[union-attr]
        for row, (name, cells) in zip(table.rows, table3().items(), strict=True):  # type: ignore[union-attr]
            assert row[0] == third.REGULARISERS[name]
            for n, mesh in enumerate(third.MESHES[True]):
                made = results[box_job("vem", mesh, third._medium(name, beta)).name]
                column = cells[f"vem_mesh{n + 1}"]
                wanted = [printed(column), number(made.gap), ratio(made.gap, column)]
                if not made.complete:
                    wanted = [printed(column), Entry("failed", style="bad"), "–"]
                assert list(row[1 + 3 * n : 4 + 3 * n]) == wanted


def test_figure_4(monkeypatch: pytest.MonkeyPatch) -> None:
    """Loads nearest to quarters, gap and reaction of each run side by side."""
    for name in ("picture", "effort"):
        monkeypatch.setattr(box_figures, name, lambda *given: Text(str(given[1:])))
    monkeypatch.setattr(box_figures.plots, "gap_and_reaction", lambda runs: None)
    jobs = box_figures.figure4_jobs(True)
    history = [
        SimpleNamespace(load=load, gap=0.5 - load / 4, reaction=-10 * load) for load in (0.2, 0.3, 0.55, 0.8, 1.0)
    ]
    results: Any = {job.name: SimpleNamespace(history=history) for job in list(jobs.values())[:2]}
    (section,) = box_figures.figure4_sections(results, True)
    table = section.blocks[2]
    assert table.head == ["u_y", "gap, gamma = 1e-04", "reaction, gamma = 1e-04", "gap, gamma = 1e-05",  # type: ignore[union-attr]
                          "reaction, gamma = 1e-05"]  # fmt: skip
    assert table.rows == [  # type: ignore[union-attr]
        [u, *([f"{0.5 - load / 4:.3e}", f"{10 * load:.3e}"] * 2)]
        for u, load in (("-0.25", 0.2), ("-0.5", 0.55), ("-0.75", 0.8), ("-1", 1.0))
    ]


def test_figure_5_and_the_deformed_states(monkeypatch: pytest.MonkeyPatch) -> None:
    panels: list[Any] = []
    for module in (box_figures, body_figures):
        for name in ("picture", "effort"):
            monkeypatch.setattr(module, name, lambda *given, **named: Text(str(given[1:])))
        monkeypatch.setattr(module, "draw_panels", lambda given, **named: panels.append((given, named)))
        monkeypatch.setattr(module, "snapshots", lambda run: run.states)
        monkeypatch.setattr(module, "read_fields", lambda run, chosen: (run.label, chosen.load))
    states = [SimpleNamespace(load=load) for load in (0.25, 0.5, 0.75, 1.0)]
    jobs = box_figures.figure5_jobs(True)
    results: Any = {job.name: SimpleNamespace(label=name, states=states) for name, job in jobs.items()}
    box_figures.figure5_sections(results, True)
    ((given, named),) = panels
    assert named == {"columns": 2}
    assert given == [
        (f"mesh {n}, $u_y$ = {-load:.3g}", (f"mesh {n}", load)) for load in (0.25, 0.5, 1.0) for n in (1, 3)
    ]
    panels.clear()
    monkeypatch.setattr(body_figures, "final_state", lambda runs: Text("state"))
    monkeypatch.setattr(body_figures.plots, "gap_and_reaction", lambda runs: None)
    monkeypatch.setattr(body_figures.cautions, "of_contact", lambda runs: ([["a", "b"]], []))
    monkeypatch.setattr(body_figures.StateFigure, "_problem", lambda self, problems: [])
    for number_of, titles in (
        (8, [f"$u_y$ = {-load:.3g}" for load in (0.25, 0.5, 0.75, 1.0)]),
        (7, ["medium divided by 1, $u_y$ = -1", "medium divided by 2, $u_y$ = -1"]),
    ):
        figure = next(figure for figure in body_figures.FIGURES if figure.number == number_of)
        last = SimpleNamespace(displacement=-0.5, load=0.5)
        made: Any = {job.name: SimpleNamespace(label=label, states=states, last=last)
                     for label, job in figure.jobs(True).items()}  # fmt: skip
        shown, problem, solution = figure.sections(made, True)
        assert [title for title, _ in panels[-1][0]] == titles
        assert [section.title for section in (shown, problem, solution)] == ["Deformed states", "Problem", "Solution"]
        assert shown.blocks[1] == Text(figure.note)
        assert solution.blocks[3].rows == [["a", "b"]]  # type: ignore[union-attr]


def test_how_far_nodes_sink_in(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(point_loads, "snapshots", lambda run: run.states)
    monkeypatch.setattr(point_loads, "read_fields", lambda run, state: state)
    monkeypatch.setattr(
        point_loads, "_shortened", lambda state, a, b: state[0] if (a, b) == point_loads.LOADED else state[1]
    )
    monkeypatch.setattr(point_loads, "_slope", lambda run: run.slope)
    first, second_run = (run(gap, states=[(9.0, 9.0), state], slope=slope)
                         for gap, state, slope in ((0.5, (0.01, 0.02), -1.0), (0.6, (0.03, 0.04), -2.0)))  # fmt: skip
    table = point_loads.sinking({"a": first, "b": second_run})
    assert table is not None
    assert table.rows == [
        ["a", "1.00e-02", "2.00e-02", "5.0000e-01", "–", "–"],
        ["b", "3.00e-02", "4.00e-02", "6.0000e-01", "+20.00 %", "+16.00 %"],
    ]
    assert point_loads.creep(first, second_run) == pytest.approx(2.0 * 0.04 / 0.6)
    assert point_loads.creep(None, second_run) == point_loads.creep(first, None) == 0.0
    assert point_loads.creep(first, run(0.6, states=[], slope=1.0)) == 0.0
    for bad in (None, run(0.5, complete=False), run(0.5, states=[])):
        assert point_loads.sinking({"a": first, "b": bad}) is None
    second_run.steps = 1
    assert point_loads.sinking({"a": first, "b": second_run}) is None
    assert point_loads.creep(first, second_run) == 0.0


def test_parameters_are_called_those_of_all_runs_if_there_are_several() -> None:
    runs = {name: replace(run, seconds={"total": 1.0}) for name, run in drawn.runs().items()}
    for some, title in ((runs, "Parameters of all runs."), ({"one": runs["FEM"]}, "Parameters.")):
        assert provenance(some, "tmc-vem run box")[1].caption == title
