"""A page about a design, feasibility first, and its pictures as files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.report.design_figure import animate_designs, deformed_figure, densities_figure, history_figure
from tmc_vem.report.page import Block, Entry, Page, Section, Table, Text, Warnings, picture
from tmc_vem.report.tables import flat
from tmc_vem.report.write import write_page
from tmc_vem.results.design_run import ANIMATION, CURVES, DEFORMED, OUTLINES, PICTURE, DesignRun
from tmc_vem.support.files import whole_file
from tmc_vem.system.fields import Fields, Polygons

Float = NDArray[np.float64]

LIMIT = "limit "
DPI = 150


def write_design(
    directory: Path, run: DesignRun, rows: Sequence[Mapping[str, str]], polygons: Polygons, density_c: Float,
    fields: Mapping[str, Fields], frames: Sequence[tuple[str, Float]],
) -> None:  # fmt: skip
    """Write the pictures of a design, the animation if there are frames for one, and the report.

    Args:
        directory: of the design.
        run: the result.
        rows: of history.csv.
        polygons: cells of the mesh.
        density_c: (n_cells,) the best design; not a number for cells that are not designed.
        fields: of the best design by load case, with ``density`` among the values of cells.
        frames: titles and densities of the designs on the way.
    """
    drawn = figures(run, rows, polygons, density_c, fields)
    for name, figure in drawn.items():
        with whole_file(directory / name, durable=False) as temporary:
            figure.savefig(temporary, dpi=DPI)
    if len(frames) > 1:
        animate_designs(polygons, frames, directory / ANIMATION)
    write_page(design_page(run, rows, drawn), directory)


def figures(
    run: DesignRun, rows: Sequence[Mapping[str, str]], polygons: Polygons, density_c: Float,
    fields: Mapping[str, Fields],
) -> dict[str, Any]:  # fmt: skip
    """Figures by the names of their files; the arguments are those of :func:`write_design`."""
    columns = list(rows[0]) if rows else []
    limits = [name for name in columns if name.startswith(LIMIT) and name != f"{LIMIT}volume"]
    title = f"{run.problem}: {run.of} {run.objective:.5g}, volume {run.volume:.4g}"
    found: dict[str, Any] = {PICTURE: densities_figure(polygons, density_c, title)}
    for case, of in fields.items():
        name = f"{DEFORMED}-{case}.png" if case else f"{DEFORMED}.png"
        found[name] = deformed_figure(of, f"{run.problem}{', ' if case else ''}{case}, at full load")
    found[CURVES] = history_figure(rows, run.of, limits)
    return found


def design_page(run: DesignRun, rows: Sequence[Mapping[str, str]], drawn: Mapping[str, Any]) -> Page:
    """The report.

    Args:
        run: the result.
        rows: of history.csv.
        drawn: figures by the names of their files.
    """
    bad = [] if run.feasible else [run.sentence]
    noted = [f"evaluation {row['evaluation']}: {row['note']}" for row in rows if row.get("note")]
    captions = {PICTURE: "Densities of the best design.", CURVES: "Evaluations of the search; dots are better than all "
                "before, dotted lines are where the projection became steeper."}  # fmt: skip
    pictures = {
        name: picture(
            figure,
            name.removesuffix(".png"),
            captions.get(name, "The best design at full load, deformed."),
            inline="png",
        )
        for name, figure in drawn.items()
    }
    deformed = [of for name, of in pictures.items() if name not in captions]
    return Page(
        f"Design of {run.problem}",
        f"{run.sentence} {run.ending}",
        [
            Section(
                "Result",
                [*_limits(run), _values(run), Warnings(run.notes, bad)],
            ),
            Section("Design", [pictures[PICTURE], *deformed]),
            Section("Search", [pictures[CURVES], _search(run), *([_notes(noted)] if noted else [])]),
            Section("How to repeat this", [*_runs(run), _inputs(run)]),
        ],
    )


def _limits(run: DesignRun) -> list[Block]:
    if not run.limits:
        return [Text("There were no limits.")]
    rows: list[Sequence[str | Entry]] = []
    for name, limit in run.limits.items():
        bound = f"at most {limit.at_most:g}" if limit.at_most is not None else f"at least {limit.at_least:g}"
        style = "" if limit.satisfied else "bad"
        rows.append([name, bound, f"{limit.value:.6g}", Entry(f"{limit.margin:.3g}", style=style),
                     Entry("yes" if limit.satisfied else "NO", style=style)])  # fmt: skip
    return [Table("Limits.", ("result", "limit", "value", "margin", "satisfied"), rows)]


def _values(run: DesignRun) -> Block:
    rows = [["objective", f"{run.objective:.6g}"], ["volume", f"{run.volume:.6g}"]]
    rows += [[name, f"{value:.6g}"] for name, value in run.values.items()]
    return Table("The best design, loaded from the beginning.", ("result", "value"), rows)


def _search(run: DesignRun) -> Block:
    entries = {
        "method": run.method,
        "evaluations": str(run.evaluations),
        "better than all before": str(run.iterations),
        "starts of the method": str(run.starts),
        "converged": "yes" if run.converged else "no",
        "why it ended": run.reason,
        "gradient left, as a part of it": f"{run.stationarity:.3g}",
        "beta of the projection": "no projection" if run.beta is None else f"{run.beta:g}",
        "variables": str(run.n_variables),
        "cells": str(run.n_cells),
        "degrees of freedom": str(run.n_dofs),
        "Newton iterations": str(run.newton_iterations),
        "time of the evaluations (s)": f"{run.seconds['evaluations']:.1f}",
    }
    return Table(
        "The search.", ("what", "value"), [[name, Entry(text, style="long")] for name, text in entries.items()]
    )


def _notes(noted: Sequence[str]) -> Block:
    return Table("What was said of evaluations.", ("note",), [[Entry(text, style="long")] for text in noted])


def _runs(run: DesignRun) -> list[Block]:
    outlines = Text(
        "'tmc-vem extract' on this directory, with --run, makes a problem of solid parts whose mesh has the outlines "
        f"of the design as edges, solves it, and compares both: {OUTLINES}/report.html."
    )
    if not run.runs:
        return [outlines]
    listed = ", ".join(f"{where} ({case})" if case else where for case, where in run.runs.items())
    return [
        Text(
            f"The best design as a run, with its curves over the load: {listed}. The problem file beside this page, "
            "final.toml or one for each load case, does it again with 'tmc-vem run'."
        ),
        outlines,
    ]


def _inputs(run: DesignRun) -> Block:
    rows = [*flat(run.inputs), *flat(run.versions)]
    return Table("Inputs and versions.", ("name", "value"), [[name, Entry(text, style="long")] for name, text in rows])
