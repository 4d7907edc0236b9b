"""Names that rich, matplotlib, HTML or Markdown would read as something else are shown as they are."""

from __future__ import annotations

import html
import re
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from helpers_process import tmc
from rich.console import Console

from tmc_vem.cli.columns import names_and_values
from tmc_vem.cli.progress import summary_rows
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.report import plots
from tmc_vem.report.labels import label
from tmc_vem.report.mesh_figure import draw_mesh
from tmc_vem.report.page import Page, Section, Table, Text
from tmc_vem.report.write import to_html, to_markdown
from tmc_vem.results.records import StepRecord
from tmc_vem.results.run_result import RunResult

NAMES = (
    "$x_1^2$",
    r"$\frac$",
    "a$b",
    "[red]steel",
    "medium[/]",
    "[bold]",
    "_p",
    "100 % {a}",
    r"C:\x",
    "a<b>&amp;",
    ":x:",
)
TOML = """name = "[/] $\\\\frac$ <b>"
[mesh]
file = "mesh.obj"
[regions."[red]$\\\\x$"]
solid = { K = 20, mu = 10 }
[regions."medium[/]_"]
medium = { gamma = 1e-2, alpha_r = 0.1 }
[edges]
left = { box = [-1e-6, -1, 1e-6, 2] }
[points]
tip = [2, 1]
[probes]
_p = { displacement = "ux", at = "tip" }
[[support]]
at = "left"
ux = 0
uy = 0
[load]
at = "tip"
uy = -0.1
"""
OBJ = """v 0 0 0
v 1 0 0
v 2 0 0
v 0 1 0
v 1 1 0
v 2 1 0
g [red]$\\x$
f 1 2 5 4
g medium[/]_
f 2 3 6 5
"""  # fmt: skip


def result(name: str) -> RunResult:
    steps = [
        StepRecord(n, n / 2, -n / 2, {name: 0.1, "gap": 0.1}, -1.0, 3, n, n, {name: 0.9}, {name: 1.0}, 0, False, 1.0)
        for n in (1, 2)
    ]
    return RunResult(
        {"problem": name}, {}, True, "", 1.0, 1, 8, 9, 1, {}, {"total": 1.0}, steps, warnings=[f"{name} is doubtful"]
    )


@pytest.mark.parametrize("name", NAMES)
def test_on_a_terminal(name: str) -> None:
    text = StringIO()
    console = Console(file=text, width=200, force_terminal=True, color_system=None)
    console.print(names_and_values(summary_rows(result(name)), {"warning": "yellow"}), highlight=False)
    assert text.getvalue().count(name) == 4  # probe, smallest J, energy, warning


def test_controls_do_not_reach_the_terminal() -> None:
    text = StringIO()
    Console(file=text, width=200).print(names_and_values([("a\x1b[31mb", "c\nd")]))
    assert text.getvalue().split() == [r"a\x1b[31mb", r"c\nd"]


@pytest.mark.parametrize("name", NAMES)
def test_in_figures(name: str, tmp_path: Path) -> None:
    runs = {name: result(name), "other": result(name)}
    figures = [plots.gap_and_reaction(runs), plots.newton_iterations(runs)]
    for figure in figures:
        figure.savefig(tmp_path / "figure.png")
    shown = figures[0].axes[0].get_legend().get_texts()[0]
    assert shown.get_text().replace(r"\$", "$").strip() == name
    assert not shown._preprocess_math(shown.get_text())[1]
    assert len(figures[0].axes[0].get_legend().get_texts()) == 2
    assert plots.probe_pictures(runs)[0].png.startswith(b"\x89PNG")
    points = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    mesh = PolygonMesh.from_cells(points, [[0, 1, 2, 3]], np.zeros(1, np.int64), (name,))
    draw_mesh(mesh, tmp_path / "mesh.png")


def test_beside_a_formula() -> None:
    from matplotlib.figure import Figure

    figure = Figure()
    figure.text(0.5, 0.5, f"{label('a$b$c')}, $u_y$ = 1")
    figure.savefig(StringIO(), format="svg")


@pytest.mark.parametrize("name", NAMES)
def test_in_reports(name: str) -> None:
    page = Page(name, name, [Section(name, [Text(name), Table(name, (name,), [[name]])])])
    assert html.unescape(to_html(page)).count(name) >= 7
    for mark in "[]$<*`":
        assert to_markdown(page).count(mark) == to_markdown(page).count(f"\\{mark}")
    assert re.sub(r"\\([!-/:-@\[-`{-~])", r"\1", to_markdown(page)).count(name) == 7


def test_from_the_mesh_to_the_report(tmp_path: Path) -> None:
    (tmp_path / "problem.toml").write_text(TOML)
    (tmp_path / "mesh.obj").write_text(OBJ)
    for command in (
        ("run", "problem.toml", "--steps", "2", "--out", "run[/]$"), ("list", "."), ("plot", "run[/]$"),
        ("animate", "run[/]$"),
    ):  # fmt: skip
        done = tmc(*command, cwd=tmp_path)
        assert (done.returncode, done.stderr.count("Traceback")) == (0, 0), done.stderr
        if command[0] == "run":
            assert r"[red]$\x$" in done.stdout
            assert r"[/] $\frac$ <b>: 2 cells" in done.stderr
        elif command[0] == "list":
            assert "run[/]$" in done.stdout
