"""Blocks of README.md and docs/reproduction.md: the paper's tables and figures."""

from __future__ import annotations

from collections.abc import Callable

from pages.block import PaperBlock
from pages.runs import Batch
from tmc_vem.report.page import Entry, Section, Table, Text
from tmc_vem.report.refresh import section_markdown
from tmc_vem.report.tables import full_gap, number, percent, reached, relative
from tmc_vem.study.paper.cells import printed
from tmc_vem.study.paper.jobs import box_job
from tmc_vem.study.paper.reproduce import TARGETS
from tmc_vem.study.paper.table2 import MEDIA, UNIFORM, limit
from tmc_vem.study.paper.target import Results
from tmc_vem.study.paper.values import table2

README_PAIRS = ((1.0, 1e-4), (1.0, 1e-5), (0.1, 1e-6))
README_CELLS = (40, 10)
FIGURES = ("fig7", "fig8", "fig10", "fig11", "fig13", "fig14")
TIMES = "(s)"  # in the headings of columns that say how long something took, which no page of results has


def readme(batch: Batch) -> str:
    """Three pairs of Table 2 on the mesh of the demo."""
    media = [MEDIA[pair] for pair in README_PAIRS]
    results = batch(box_job("vem", cells, medium) for medium in media for cells in UNIFORM[False])
    rows = []
    for pair, medium in zip(README_PAIRS, media, strict=True):
        gap = full_gap(results.get(box_job("vem", README_CELLS, medium).name))
        reference = limit(results, medium, quick=False)
        rows.append(
            [f"{pair[0]:g}", f"{pair[1]:.0e}", number(gap, 4), number(reference.value, 4) if reference else "–",
             percent(relative(gap, reference.value if reference else None), 1), printed(table2()[pair]["fem_fine"])]
        )  # fmt: skip
    finest = UNIFORM[False][-1]
    head = ("alpha_r", "gamma", "VEM, 40 x 10", f"converged (up to {finest[0]} x {finest[1]})", "difference",
            "paper, fine FEM")  # fmt: skip
    return section_markdown(Section("README", [Table("Gap at u_y = -1.", head, rows)]))


def figures(batch: Batch) -> str:
    """Runs of the figures of C-box, punch and several bodies."""
    jobs = {f"{name.removeprefix('fig')}, {label}": job for name in FIGURES
            for label, job in TARGETS[name].jobs(False).items()}  # fmt: skip
    results = batch(jobs.values())
    rows: list[list[str | Entry]] = []
    for label, job in jobs.items():
        run = results[job.name]
        rows.append(
            [label, str(run.n_cells), reached(run), str(run.steps), str(run.newton_iterations),
             number(run.checks["smallest_gap"], 2), "yes" if run.checks["interpenetrates"] else "no"]
        )  # fmt: skip
    head = ("figure", "cells", "load", "steps", "Newton iterations", "smallest gap in contact", "interpenetration")
    tips = [results[job.name].gap for job in TARGETS["fig7"].jobs(False).values()]
    change = percent(relative(tips[1], tips[0]))
    text = Text(f"Figure 7: from the coarse to the fine medium the distance of the tips changes by {change}.")
    return section_markdown(Section("Figures", [Table("States of the figures.", head, rows), text]))


def section(target: str, n: int) -> Callable[[Batch], str]:
    """A section of the page of a table or figure, without what was timed."""

    def write(batch: Batch) -> str:
        results: Results = batch(TARGETS[target].jobs(False).values())
        chosen = TARGETS[target].sections(results, False)[n]
        kept = [_untimed(block) if isinstance(block, Table) else block for block in chosen.blocks]
        return section_markdown(Section(chosen.title, kept))

    return write


def _untimed(table: Table) -> Table:
    columns = [n for n, heading in enumerate(table.head) if TIMES not in heading]
    caption = table.caption.split(" Times are wall times")[0]
    return Table(caption, [table.head[n] for n in columns], [[row[n] for n in columns] for row in table.rows])


BLOCKS = (
    PaperBlock("readme", "hours", readme),
    PaperBlock("table2-fem", "hours", section("table2", 0)),
    PaperBlock("table2-vem", "hours", section("table2", 1)),
    PaperBlock("table2-meshes", "hours", section("table2", 2)),
    PaperBlock("table3", "minutes", section("table3", 0)),
    PaperBlock("fig4", "minutes", section("fig4", 0)),
    PaperBlock("figures", "minutes", figures),
)
