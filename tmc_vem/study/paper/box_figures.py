"""Figures 4 and 5: gap and reaction of the box during loading, and its deformed states."""

from __future__ import annotations

from collections.abc import Mapping

from tmc_vem.problems import Medium
from tmc_vem.report import plots
from tmc_vem.report.page import Block, Section, Table, Text, picture
from tmc_vem.report.panels import draw_panels
from tmc_vem.report.tables import effort, number
from tmc_vem.results.snapshots import nearest, read_fields, snapshots
from tmc_vem.study.batch import Job
from tmc_vem.study.paper.jobs import box_job
from tmc_vem.study.paper.table2 import DENSITIES, SOLID, mesh_note
from tmc_vem.study.paper.target import Results, Target

GAMMAS = (1e-4, 1e-5, 1e-6)
STEPS = 20  # equal steps, so that the loads of the figures are hit exactly
SHOWN = (0.3, 0.6, 1.0)


def figure4_jobs(quick: bool) -> dict[str, Job]:
    """alpha_r = 0.1 for three gammas on mesh 3 of Table 2."""
    return {
        f"gamma = {gamma:.0e}": box_job("vem", SOLID[quick], Medium(gamma, alpha_r=0.1), DENSITIES[-1], steps=STEPS)
        for gamma in GAMMAS
    }


def figure4_sections(results: Results, quick: bool) -> list[Section]:
    """Curves and a table of them."""
    jobs = figure4_jobs(quick)
    runs = {name: results[job.name] for name, job in jobs.items() if job.name in results}
    rows = []
    for share in (0.25, 0.5, 0.75, 1.0):
        row = [f"{-share:g}"]
        for run in runs.values():
            record = min(run.history, key=lambda record: abs(record.load - share))
            row += [number(record.gap, 4), number(abs(record.reaction), 4)]
        rows.append(row)
    head = ["u_y"]
    for name in runs:
        head += [f"gap, {name}", f"reaction, {name}"]
    caption = "Gap and reaction during loading for three gammas, alpha_r = 0.1 (figure 4 of the paper)."
    blocks: list[Block] = [
        Text("The gap at full load falls with gamma, and the reaction before contact with it: the paper's conclusion."),
        picture(plots.gap_and_reaction(runs), "fig4", caption),
        Table("Values at some displacements.", head, rows),
        effort(runs),
    ]
    return [Section("Gap and reaction", blocks)]


def figure5_jobs(quick: bool) -> dict[str, Job]:
    """alpha_r = 0.1, gamma = 1e-6 on meshes 1 and 3 of Table 2."""
    medium = Medium(gamma=1e-6, alpha_r=0.1)
    return {
        f"mesh {n}": box_job("vem", SOLID[quick], medium, DENSITIES[n - 1], steps=STEPS) for n in (1, len(DENSITIES))
    }


def figure5_sections(results: Results, quick: bool) -> list[Section]:
    """Deformed states of both meshes side by side."""
    runs = {name: results[job.name] for name, job in figure5_jobs(quick).items() if job.name in results}
    panels = []
    for share in SHOWN:
        for name, run in runs.items():
            chosen = nearest(snapshots(run), share)
            panels.append((f"{name}, $u_y$ = {-chosen.load:.3g}", read_fields(run, chosen)))
    caption = "Deformed box at increasing displacement on two meshes (figure 5 of the paper)."
    blocks: list[Block] = [
        picture(draw_panels(panels, columns=len(runs)), "fig5", caption, inline="png"),
        Text(mesh_note(quick)),
        effort(runs),
    ]
    return [Section("Deformed states", blocks)]


TARGETS: Mapping[str, Target] = {
    "fig4": Target(
        "Figure 4: gap and reaction of the box during loading",
        "alpha_r = 0.1, regulariser (9) damped by exp(-5 J), virtual elements on mesh 3.",
        figure4_jobs,
        figure4_sections,
    ),
    "fig5": Target(
        "Figure 5: deformed box",
        "alpha_r = 0.1, gamma = 1e-6, virtual elements on meshes 1 and 3.",
        figure5_jobs,
        figure5_sections,
    ),
}
