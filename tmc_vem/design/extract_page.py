"""The report of the outlines of a design: picture, volumes, and both runs side by side."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.design.extract_compare import comparison_table
from tmc_vem.design.extract_directory import CURVES, PICTURE
from tmc_vem.design.extract_figure import density_figure
from tmc_vem.design.outlined import Outlined
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.report.page import Block, Page, Section, Table, Text, Warnings, picture
from tmc_vem.report.plots import gap_and_reaction
from tmc_vem.report.tables import percent, relative, stopped
from tmc_vem.report.write import write_page
from tmc_vem.support.files import whole_file

Float = NDArray[np.float64]

DPI = 150
DENSITIES, FITTED = "densities", "body-fitted"


def write_outlines(found: Outlined, mesh: PolygonMesh, density_c: Float) -> None:
    """Write pictures and report.

    Args:
        found: what became of the design.
        mesh: of the densities.
        density_c: (n_cells,) densities; not a number where nothing is designed.
    """
    drawn = {PICTURE: density_figure(mesh, density_c, found.extracted.outlines.solid, title=_title(found))}
    for case in found.compared:
        name = f"{CURVES}-{case}.png" if case else f"{CURVES}.png"
        drawn[name] = gap_and_reaction({DENSITIES: found.designs[case], FITTED: found.runs[case]})
    for name, figure in drawn.items():
        with whole_file(found.directory / name, durable=False) as temporary:
            figure.savefig(temporary, dpi=DPI)
    write_page(outlines_page(found, drawn), found.directory)


def outlines_page(found: Outlined, drawn: dict[str, Any]) -> Page:
    """The report; ``drawn`` has figures by the names of their files."""
    first = picture(
        drawn[PICTURE], PICTURE.removesuffix(".png"), "Densities, and the outlines of the solid.", inline="png"
    )
    sections = [Section("Outlines", [first, _volumes(found), Warnings(found.notes)])]
    for case in found.runs:
        blocks: list[Block] = []
        if case in found.compared:
            name = f"{CURVES}-{case}" if case else CURVES
            blocks.append(comparison_table(found.designs[case], found.runs[case], found.extracted))
            blocks.append(picture(drawn[f"{name}.png"], name, "Both during loading."))
        runs = {DENSITIES: found.designs[case], FITTED: found.runs[case]}
        bad = [f"{name}: {stopped(run)}" for name, run in runs.items() if not run.complete]
        sections.append(Section(f"Comparison, {case}" if case else "Comparison", [*blocks, Warnings([], bad)]))
    names = ", ".join(path.name for path in found.problems.values())
    again = Text(f"'tmc-vem run' on {names} beside this page gives what the outlines do.")
    return Page(
        f"Outlines of {found.design.problem}",
        f"The design as solid parts in third medium, of a mesh whose edges are its outlines. {summary(found)}",
        [*sections, Section("How to repeat this", [again])],
    )


def summary(found: Outlined) -> str:
    """What was found, in a sentence or two."""
    of = found.extracted.outlines
    volume = percent(relative(found.extracted.volume_mesh, of.volume_densities))
    return f"{_count(of.parts, 'part')}, {_count(of.holes, 'hole')}; the volume differs by {volume}."


def _volumes(found: Outlined) -> Table:
    of = found.extracted.outlines
    rows = [("densities", of.volume_densities), (f"within the level {of.level:.4g}", of.volume_level),
            ("without specks and narrow gaps", of.volume_cleaned), ("outlines", of.volume),
            ("mesh", found.extracted.volume_mesh)]  # fmt: skip
    return Table(
        "Volume of the solid.",
        ("of", "volume", "difference"),
        [(name, f"{value:.6g}", percent(relative(value, of.volume_densities))) for name, value in rows],
    )


def _title(found: Outlined) -> str:
    of = found.extracted.outlines
    volume = percent(relative(of.volume, of.volume_densities))
    return f"{found.design.problem}: outlines at density {of.level:.3g}, volume {volume}"


def _count(n: int, what: str) -> str:
    return f"{n} {what}" if n == 1 else f"{n} {what}s"
