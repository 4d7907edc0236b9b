"""Figures 7, 8, 10, 11, 13, 14: deformed states of C-box, punch and several bodies."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from tmc_vem.problems import Bodies, CBox, Punch
from tmc_vem.problems.base import Problem, forces_of, media_of
from tmc_vem.problems.cbox import angle_medium
from tmc_vem.report import cautions, plots
from tmc_vem.report.page import Block, Section, Table, Text, picture
from tmc_vem.report.panels import draw_panels
from tmc_vem.report.problem_figure import draw_meshes, draw_problem
from tmc_vem.report.tables import effort, final_state
from tmc_vem.results.snapshots import nearest, read_fields, snapshots
from tmc_vem.simulation.options import RunOptions
from tmc_vem.study.batch import Job
from tmc_vem.study.paper.target import Results, Target
from tmc_vem.support.errors import InputError


@dataclass(frozen=True)
class StateFigure:
    """Figure of deformed states.

    Attributes:
        number: of the figure in the paper.
        title, caption, note: of the page; the note says what the paper leaves open.
        problems: by label, for the quick or the full version.
        shares: of the full load that are shown.
        options: of the runs.
    """

    number: int
    title: str
    caption: str
    note: str
    problems: Callable[[bool], Mapping[str, Problem]]
    shares: Sequence[float] = (1.0,)
    options: RunOptions = RunOptions(snapshots=20)  # noqa: RUF009 (frozen)

    def jobs(self, quick: bool) -> dict[str, Job]:
        """Runs by label."""
        return {
            label: Job(f"fig{self.number}-{problem.name}", problem, self.options, cost=10.0)
            for label, problem in self.problems(quick).items()
        }

    def sections(self, results: Results, quick: bool) -> list[Section]:
        """States, curves and what must be said about them."""
        problems = self.problems(quick)
        runs = {label: results[job.name] for label, job in self.jobs(quick).items() if job.name in results}
        contact, overlaps = cautions.of_contact(runs)
        panels = []
        for label, run in runs.items():
            try:
                available = snapshots(run)
            except InputError:
                continue  # of_contact has said so
            for share in self.shares if available else ():
                chosen = nearest(available, share)
                moved = chosen.load * (run.last.displacement / run.last.load if run.last else 0.0)
                title = f"{label}, $u_y$ = {moved:.3g}" if len(problems) > 1 else f"$u_y$ = {moved:.3g}"
                panels.append((title, read_fields(run, chosen)))
        blocks: list[Block] = [Text(self.note), *([cautions.listed(overlaps)] if overlaps else [])]
        if panels:
            figure = draw_panels(panels)
            blocks.insert(0, picture(figure, f"fig{self.number}", self.caption, inline="png"))
        curves = plots.gap_and_reaction(runs)
        return [
            Section("Deformed states", blocks),
            Section("Problem", self._problem(problems)),
            Section(
                "Solution",
                [
                    picture(curves, f"fig{self.number}-loading", "Gap and reaction during loading."),
                    final_state(runs),
                    effort(runs),
                    Table("Contact in the last state.", ("run", "deformed solids"), contact),
                ],
            ),
        ]

    def _problem(self, problems: Mapping[str, Problem]) -> list[Block]:
        meshes = {label: problem.make_mesh() for label, problem in problems.items()}
        label, problem = next(iter(problems.items()))
        media = media_of(problem)
        figure = draw_problem(
            meshes[label], media, problem.prescribed(), problem.load(), problem.probes(), forces_of(problem)
        )
        named = [(f"{label}: {mesh.n_cells} cells", mesh) for label, mesh in meshes.items()]
        return [
            picture(figure, f"fig{self.number}-problem", "The problem with its supports, load and gap."),
            picture(draw_meshes(named, media), f"fig{self.number}-mesh", "Undeformed mesh.", inline="png"),
        ]

    def target(self) -> Target:
        """As a target."""
        lead = "Virtual elements, regulariser (15) without damping. The colour is the vertical displacement."
        return Target(f"Figure {self.number}: {self.title}", lead, self.jobs, self.sections)


def _cbox_cells(quick: bool) -> tuple[int, int]:
    return (10, 5) if quick else (20, 10)


def _cbox_half(quick: bool) -> dict[str, Problem]:
    cells = _cbox_cells(quick)
    return {f"medium divided by {n}": CBox(cells=cells, medium_refinement=n, uy=-0.5) for n in (1, 2)}


def _cbox_full(quick: bool) -> dict[str, Problem]:
    return {"C-box": CBox(cells=_cbox_cells(quick), medium=angle_medium(1e-5, 20.0), uy=-1.0)}


def _punch(stiffness: float) -> Callable[[bool], dict[str, Problem]]:
    return lambda quick: {"punch": Punch(size=0.2 if quick else 0.1, stiffness=stiffness)}


def _bodies(case: int) -> Callable[[bool], dict[str, Problem]]:
    return lambda quick: {f"case {case}": Bodies(case=case, size=0.15 if quick else 0.1)}


OPEN_GAP = "The paper gives the initial gap in a figure only; ours is the default of the problem."
FIGURES = (
    StateFigure(7, "C-box at u_y = -0.5", "Deformed C-box with two densities of the medium (figure 7 of the paper).",
                "gamma = 1e-5, alpha_r = 1.", _cbox_half),
    StateFigure(8, "C-box up to u_y = -1", "Deformed C-box at increasing displacement (figure 8 of the paper).",
                "gamma = 1e-5, alpha_r = 20.", _cbox_full, (0.25, 0.5, 0.75, 1.0)),
    StateFigure(10, "punch as soft as the block", "Punch at increasing displacement (figure 10 of the paper).",
                f"gamma = 1e-4, alpha_r = 1. {OPEN_GAP}", _punch(1.0), (0.25, 0.5, 0.75, 1.0)),
    StateFigure(11, "punch a hundred times stiffer", "Punch at increasing displacement (figure 11 of the paper).",
                f"gamma = 1e-4, alpha_r = 1. {OPEN_GAP}", _punch(100.0), (0.25, 0.5, 0.75, 1.0)),
    StateFigure(13, "several bodies, half discs guided", "Case 1 at increasing displacement (figure 13 of the paper).",
                f"gamma = 1e-4, alpha_r = 10. {OPEN_GAP}", _bodies(1), (0.5, 1.0)),
    StateFigure(14, "several bodies, half discs free", "Case 2 at increasing displacement (figure 14 of the paper).",
                f"gamma = 1e-4, alpha_r = 10. {OPEN_GAP}", _bodies(2), (0.5, 1.0)),
)  # fmt: skip
TARGETS = {f"fig{figure.number}": figure.target() for figure in FIGURES}
