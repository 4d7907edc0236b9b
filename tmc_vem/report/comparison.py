"""The report that compares two methods on a sequence of meshes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from tmc_vem.fields import Fields
from tmc_vem.report import cautions, plots, tables
from tmc_vem.report.page import Block, Cell, Page, Picture, Section, Table, Text, Warnings, picture
from tmc_vem.report.panels import draw_panels
from tmc_vem.report.snapshots import nearest, read_fields, snapshots
from tmc_vem.report.tables import full_gap, number, percent, relative
from tmc_vem.results import RunResult

NOT_CONVERGED = 0.02  # relative uncertainty of a mesh-converged value above which a report warns


@dataclass(frozen=True)
class Converged:
    """Mesh-converged gap with its uncertainty, and the observed order of convergence if there is one."""

    value: float
    uncertainty: float
    order: float | None

    def __str__(self) -> str:
        order = "no clear order" if self.order is None else f"order {self.order:.1f}"
        return f"{self.value:.4e} ± {self.uncertainty:.0e} ({self.uncertainty / self.value:.1%}, {order})"


@dataclass(frozen=True)
class Method:
    """Runs of one method.

    Attributes:
        name: 'VEM' or 'FEM'.
        runs: by name of the mesh, from coarse to fine.
        converged: from these runs, or None if three of them do not reach full load.
    """

    name: str
    runs: Mapping[str, RunResult]
    converged: Converged | None

    @property
    def finest(self) -> RunResult | None:
        """Run on the finest mesh."""
        return list(self.runs.values())[-1] if self.runs else None


@dataclass(frozen=True)
class Comparison:
    """All that the report shows.

    Attributes:
        title: of the page.
        command: with which it was made.
        methods: VEM and FEM.
        paper: the paper's values that belong to these parameters: method, text, gap or None, why it is suspect.
        pictures: of the problem and its meshes.
        failures: jobs without a result, and why.
    """

    title: str
    command: str
    methods: Sequence[Method]
    paper: Mapping[str, tuple[float | None, str]] = field(default_factory=dict)
    pictures: Sequence[Picture] = ()
    failures: Sequence[str] = ()

    @property
    def runs(self) -> dict[str, RunResult]:
        """All runs by method and mesh."""
        return {f"{m.name} {mesh}": run for m in self.methods for mesh, run in m.runs.items()}

    @property
    def reference(self) -> Converged | None:
        """The mesh-converged value with the smaller uncertainty."""
        known = [method.converged for method in self.methods if method.converged]
        return min(known, key=lambda converged: converged.uncertainty) if known else None

    @property
    def finest(self) -> dict[str, RunResult]:
        """Run on the finest mesh by method."""
        return {method.name: method.finest for method in self.methods if method.finest}


def comparison_page(comparison: Comparison) -> Page:
    """The report."""
    c = comparison
    contact, overlaps = cautions.of_contact(c.finest)
    messages = [*c.failures, *cautions.of_runs(c.runs), *overlaps, *_doubts(c)]
    sections = [
        Section("Result", [*_summary(c), Warnings(messages)]),
        Section("Problem", list(c.pictures)),
        Section("Mesh convergence", _convergence(c)),
        Section("Loading", _loading(c)),
        Section("Deformed states", _states(c)),
        Section(
            "Solution",
            [
                picture(
                    plots.newton_iterations(c.finest), "newton", "Newton iterations of every load step, finest mesh."
                ),
                tables.final_state(c.runs),
                tables.effort(c.runs),
                Table("Contact in the last state, finest mesh.", ("run", "deformed solids"), contact),
            ],
        ),
        Section("How to repeat this", tables.provenance(c.runs.values(), c.command, _shared(c))),
    ]
    return Page(c.title, _lead(c), sections)


def _lead(c: Comparison) -> str:
    meshes = " and ".join(f"{method.name} on {len(method.runs)} meshes" for method in c.methods)
    return f"{meshes}. Everything on this page comes from the run directories beside it."


def _shared(c: Comparison) -> dict[str, object]:
    return tables.common([run.inputs for run in c.runs.values()])


def _summary(c: Comparison) -> list[Block]:
    """VEM | FEM | difference | paper."""
    finest = c.finest
    names = list(finest)
    rows: list[list[str | Cell]] = []

    def row(label: str, values: Sequence[float | None], paper: str | Cell = "–") -> None:
        shown = [number(value) for value in values]
        difference = relative(values[0], values[1]) if len(values) == 2 else None
        rows.append([label, *shown, percent(difference), paper])

    reference = next((value for name, value in c.paper.items() if name.startswith("FEM")), None)
    row("gap, finest mesh", [full_gap(run) for run in finest.values()], _paper_cell(reference))
    row("gap, converged", [m.converged.value if m.converged else None for m in c.methods], _paper_cell(reference))
    row("reaction, finest mesh", [run.reaction if run.complete else None for run in finest.values()])
    regions = list(dict.fromkeys(region for run in finest.values() for region in run.min_j))
    for region in regions:
        row(f"smallest J, {region}", [run.min_j.get(region) for run in finest.values()])
    for region in regions:
        row(f"energy, {region}", [run.last.energy.get(region) if run.last else None for run in finest.values()])
    table = Table("Full load.", ("", *names, "difference", "paper"), rows)
    blocks: list[Block] = [table]
    if c.reference:
        lines = [f"{m.name} {m.converged}" for m in c.methods if m.converged]
        blocks.append(Text(f"Mesh-converged gap (Richardson extrapolation from three meshes): {'; '.join(lines)}."))
    if c.paper:
        entries = [
            [name, _paper_cell(value), percent(relative(c.reference.value if c.reference else None, value[0]))]
            for name, value in c.paper.items()
        ]
        blocks.append(Table("The paper's values.", ("paper", "gap", "ours, converged, relative to it"), entries))
    return blocks


def _paper_cell(value: tuple[float | None, str] | None) -> str | Cell:
    if value is None:
        return "–"
    gap, suspect = value
    text = "does not converge" if gap is None else number(gap)
    return Cell(text, f"suspect: {suspect}", "suspect") if suspect else text


def _convergence(c: Comparison) -> list[Block]:
    meshes = list(dict.fromkeys(mesh for method in c.methods for mesh in method.runs))
    reference = c.reference
    head = ["mesh"]
    for method in c.methods:
        head += [f"{method.name} gap", "to converged"]
    rows = []
    for mesh in meshes:
        row = [mesh]
        for method in c.methods:
            gap = full_gap(method.runs.get(mesh))
            row += [number(gap), percent(relative(gap, reference.value if reference else None))]
        rows.append(row)
    blocks: list[Block] = [Table("Gap at full load.", head, rows)]
    if reference:
        series = {
            method.name: [
                (float(run.n_dofs), run.seconds["total"], abs(gap / reference.value - 1.0))
                for run in method.runs.values()
                if (gap := full_gap(run)) is not None
            ]
            for method in c.methods
        }
        caption = (
            f"Error of the gap relative to the converged value {reference}, against degrees of freedom and against "
            "time. The rate is a least-squares fit over all meshes; errors below the uncertainty say nothing."
        )
        figure = plots.convergence(series, floor=reference.uncertainty / reference.value)
        blocks.append(picture(figure, "convergence", caption))
    return blocks


def _loading(c: Comparison) -> list[Block]:
    return [
        picture(plots.gap_and_reaction(c.finest), "loading", "Gap and reaction during loading, finest mesh."),
        picture(plots.smallest_j(c.finest), "smallest-j", "Smallest J during loading, finest mesh."),
        picture(plots.energy_split(c.finest), "energy", "Energy of solids and medium during loading, finest mesh."),
    ]


def _states(c: Comparison) -> list[Block]:
    panels: list[tuple[str, Fields]] = []
    for load in (0.5, 1.0):
        for name, run in c.finest.items():
            available = snapshots(run)
            if available:
                chosen = nearest(available, load)
                moved = chosen.load * _full_displacement(run)
                panels.append((f"{name}, displacement {moved:.3g}", read_fields(run, chosen)))
    if not panels:
        return [Text("No fields were written.")]
    caption = "Deformed states of the finest meshes side by side, coloured by the vertical displacement."
    return [picture(draw_panels(panels, columns=len(c.finest)), "states", caption, inline="png")]


def _full_displacement(run: RunResult) -> float:
    last = run.last
    return last.displacement / last.load if last and last.load else 0.0


def _doubts(c: Comparison) -> list[str]:
    messages = []
    for method in c.methods:
        converged = method.converged
        if converged is None:
            messages.append(f"{method.name}: no mesh-converged value, it takes three meshes that reach full load")
        elif converged.uncertainty > NOT_CONVERGED * abs(converged.value):
            messages.append(
                f"{method.name} is not mesh-converged: the uncertainty is {converged.uncertainty / converged.value:.1%}"
            )
    known = [method.converged for method in c.methods if method.converged]
    if len(known) == 2 and abs(known[0].value - known[1].value) > known[0].uncertainty + known[1].uncertainty:
        messages.append(
            f"the converged values of the two methods differ by {abs(known[0].value / known[1].value - 1):.2%}, more "
            "than their uncertainties"
        )
    messages += [f"suspect cell of the paper, {name}: {why}" for name, (_, why) in c.paper.items() if why]
    return messages
