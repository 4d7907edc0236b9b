"""The report that compares two methods on a sequence of meshes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field

from tmc_vem.report import cautions, plots, tables
from tmc_vem.report.adapted_tables import estimated_errors
from tmc_vem.report.limits import WITHHELD, limit_names
from tmc_vem.report.page import Block, Entry, Page, Picture, Section, Table, Text, picture
from tmc_vem.report.panels import draw_panels
from tmc_vem.report.richardson import Extrapolation
from tmc_vem.report.tables import full_energy, full_gap, number, percent, relative
from tmc_vem.results.plausibility import WARNING, Finding
from tmc_vem.results.run_result import RunResult
from tmc_vem.results.snapshots import nearest, read_fields, snapshots
from tmc_vem.support.errors import InputError
from tmc_vem.system.fields import Fields

DIFFERENT_MEDIA = 0.1  # relative difference of the medium's energies above which a report warns
NOT_CONVERGED = 0.02  # relative uncertainty of a mesh-converged value above which a report warns


QUANTITIES: Mapping[str, Callable[[RunResult | None], float | None]] = {"gap": full_gap, "energy": full_energy}
QUANTITY_NOTES = {
    "gap": "Gap at full load.",
    "energy": "Energy of all regions at full load: a mean over the whole domain, smoother than the gap at one place.",
}


@dataclass(frozen=True)
class Method:
    """Runs of one method.

    Attributes:
        name: 'VEM' or 'FEM'.
        runs: by name of the mesh, from coarse to fine.
        limits: mesh-converged values by name of the quantity, where the three finest meshes reach full load.
    """

    name: str
    runs: Mapping[str, RunResult]
    limits: Mapping[str, Extrapolation]

    @property
    def converged(self) -> Extrapolation | None:
        """Mesh-converged gap."""
        return self.limits.get("gap")

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
    def quantities(self) -> dict[str, Callable[[RunResult | None], float | None]]:
        """What is compared: the gap, if the problem has one, and the energy."""
        has_gap = any(run.gap is not None for run in self.runs.values())
        return {name: value for name, value in QUANTITIES.items() if has_gap or name != "gap"}

    def reference(self, quantity: str = "gap") -> Extrapolation | None:
        """The mesh-converged value with the smaller uncertainty."""
        known = [method.limits[quantity] for method in self.methods if quantity in method.limits]
        return min(known, key=lambda limit: limit.uncertainty) if known else None

    def agreed(self, quantity: str = "gap") -> bool:
        """Whether the mesh-converged values of all methods agree within their uncertainties."""
        known = [method.limits[quantity] for method in self.methods if quantity in method.limits]
        spread = max((x.value for x in known), default=0.0) - min((x.value for x in known), default=0.0)
        return spread <= sum(limit.uncertainty for limit in known)

    def measure(self, method: Method, quantity: str) -> Extrapolation | None:
        """What errors of a method are measured against: the common reference, or its own limit if they disagree."""
        return self.reference(quantity) if self.agreed(quantity) else method.limits.get(quantity)

    @property
    def finest(self) -> dict[str, RunResult]:
        """Run on the finest mesh by method."""
        return {method.name: method.finest for method in self.methods if method.finest}


def comparison_page(comparison: Comparison) -> Page:
    """The report."""
    c = comparison
    contact, overlaps = cautions.of_contact(c.finest)
    doubts = [Finding(WARNING, text) for text in _doubts(c)]
    findings = [*cautions.of_failures(c.failures), *overlaps, *cautions.of_runs(c.runs), *doubts]
    sections = [
        Section("Result", [*_summary(c), cautions.listed(findings)]),
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
                *estimated_errors(c.runs),
                *tables.energy_in_jumps(c.runs),
                tables.effort(c.runs),
                Table("Contact in the last state, finest mesh.", ("run", "deformed solids"), contact),
            ],
        ),
        Section("How to repeat this", tables.provenance(c.runs, c.command)),
    ]
    return Page(c.title, _lead(c), sections)


def _lead(c: Comparison) -> str:
    meshes = " and ".join(f"{method.name} on {len(method.runs)} meshes" for method in c.methods)
    return f"{meshes}. Everything on this page comes from the run directories beside it."


def _summary(c: Comparison) -> list[Block]:
    """VEM | FEM | difference | paper."""
    finest = c.finest
    names = list(finest)
    rows: list[list[str | Entry]] = []

    def row(label: str, values: Sequence[float | None], paper: str | Entry = "–") -> None:
        shown = [number(value) for value in values]
        difference = relative(values[0], values[1]) if len(values) == 2 else None
        rows.append([label, *shown, percent(difference), paper])

    reference = next((value for name, value in c.paper.items() if name.startswith("FEM")), None)
    row("gap", [full_gap(run) for run in finest.values()], _paper_cell(reference))
    row("gap, mesh-converged", [m.converged.value if m.converged else None for m in c.methods], _paper_cell(reference))
    row("reaction", [run.reaction if run.complete else None for run in finest.values()])
    for probe in tables.probes_of(finest):
        row(
            tables.with_unit(probe, finest, probe),
            [run.reported.get(probe) if run.complete else None for run in finest.values()],
        )
    for quantity in limit_names(finest):
        values, shown = zip(*(_limit_cell(run, quantity) for run in finest.values()), strict=True)
        difference = relative(values[0], values[1]) if len(values) == 2 else None
        label = tables.with_unit(f"{quantity}, limit of gamma", finest, quantity)
        rows.append([label, *shown, percent(difference), "–"])
    regions = tables.region_names_of(finest)
    row("smallest gap in contact", [run.checks.get("smallest_gap") for run in finest.values()])
    for region in regions:
        row(f"smallest J, {region}", [run.min_j.get(region) for run in finest.values()])
    for region in regions:
        row(f"energy, {region}", [run.last.energy.get(region) if run.last else None for run in finest.values()])
    row(tables.REGULARISER, [run.checks.get("regulariser_energy") for run in finest.values()])
    caption = "Full load, finest mesh. The energy of the medium includes that of the regulariser."
    table = Table(caption, ("", *names, "difference", "paper"), rows)
    blocks: list[Block] = [table]
    converged = c.reference()
    if converged:
        lines = [f"{m.name} {m.converged}" for m in c.methods if m.converged]
        blocks.append(Text(f"Mesh-converged gap (Richardson extrapolation from three meshes): {'; '.join(lines)}."))
    if c.paper:
        entries = [
            [name, _paper_cell(value), percent(relative(converged.value if converged else None, value[0]))]
            for name, value in c.paper.items()
        ]
        blocks.append(Table("The paper's values.", ("paper", "gap", "ours, mesh-converged, relative to it"), entries))
    return blocks


def _limit_cell(run: RunResult, quantity: str) -> tuple[float | None, str | Entry]:
    """Limit for gamma to 0 of a run that has one, and what is shown of it."""
    entry = run.limit.values.get(quantity) if run.limit else None
    if entry is None:
        return None, "–"
    shown: str | Entry = str(entry) if entry.value is not None else Entry(WITHHELD, entry.reason or "", "suspect")
    return entry.value, shown


def _paper_cell(value: tuple[float | None, str] | None) -> str | Entry:
    if value is None:
        return "–"
    gap, suspect = value
    text = "does not converge" if gap is None else number(gap)
    return Entry(text, f"suspect: {suspect}", "suspect") if suspect else text


def _convergence(c: Comparison) -> list[Block]:
    meshes = list(dict.fromkeys(mesh for method in c.methods for mesh in method.runs))
    blocks: list[Block] = []
    for quantity, value_of in c.quantities.items():
        head = ["mesh"]
        for method in c.methods:
            head += [f"{method.name} dofs", f"{method.name} {quantity}", "to converged"]
        rows = []
        for mesh in meshes:
            row = [mesh]
            for method in c.methods:
                run, limit = method.runs.get(mesh), c.measure(method, quantity)
                value = value_of(run)
                row += [str(run.n_dofs) if run else "–", number(value)]
                row.append(percent(relative(value, limit.value if limit else None)))
            rows.append(row)
        blocks.append(Table(QUANTITY_NOTES[quantity], head, rows))
        if c.reference(quantity):
            blocks.append(_errors(c, quantity))
    return blocks + _limits(c, meshes)


def _limits(c: Comparison, meshes: Sequence[str]) -> list[Block]:
    """A table of the limits for gamma to 0 on every mesh, if they were asked for."""
    columns = [(method, quantity) for method in c.methods for quantity in limit_names(method.runs)]
    if not columns:
        return []
    rows: list[list[str | Entry]] = [
        [mesh, *(_limit_cell(m.runs[mesh], quantity)[1] if mesh in m.runs else "–" for m, quantity in columns)]
        for mesh in meshes
    ]
    head = ["mesh", *(f"{method.name} {quantity}" for method, quantity in columns)]
    return [Table("Limits for gamma to 0 at full load, without the error of the mesh.", head, rows)]


def _errors(c: Comparison, quantity: str) -> Picture:
    series, floors = {}, {}
    for method in c.methods:
        limit = c.measure(method, quantity)
        if limit is None:
            continue
        floors[method.name] = limit.relative
        series[method.name] = [
            (float(run.n_dofs), run.seconds["total"], abs(value / limit.value - 1.0))
            for run in method.runs.values()
            if (value := QUANTITIES[quantity](run)) is not None
        ]
    if c.agreed(quantity):
        against = f"the converged value {c.reference(quantity)}"
    else:
        limits = (f"{m.name} {m.limits[quantity]}" for m in c.methods if quantity in m.limits)
        against = (
            f"each method's own converged value, which differ by more than their uncertainties: {'; '.join(limits)}"
        )
    caption = (
        f"Error of the {quantity} relative to {against}; over degrees of freedom and over time. Rates are "
        "least-squares fits over the errors above the uncertainty of the converged value; those below say nothing."
    )
    return picture(plots.convergence(series, quantity, floors), f"convergence-{quantity}", caption)


def _loading(c: Comparison) -> list[Block]:
    return [
        picture(plots.gap_and_reaction(c.finest), "loading", "Gap and reaction during loading, finest mesh."),
        *plots.probe_pictures(c.finest),
        picture(plots.smallest_j(c.finest), "smallest-j", "Smallest J during loading, finest mesh."),
        picture(plots.energy_split(c.finest), "energy", "Energy of solids and medium during loading, finest mesh."),
    ]


def _states(c: Comparison) -> list[Block]:
    panels: list[tuple[str, Fields]] = []
    for load in (0.5, 1.0):
        for name, run in c.finest.items():
            with suppress(InputError):  # no fields, which the warnings say
                chosen = nearest(snapshots(run), load)
                moved = chosen.load * _full_displacement(run)
                panels.append((f"{name} at {moved:.3g}", read_fields(run, chosen)))
    if not panels:
        return [Text("No fields were written.")]
    caption = "Deformed states of the finest meshes at two prescribed displacements; the colour is the vertical one."
    return [picture(draw_panels(panels), "states", caption, inline="png")]


def _full_displacement(run: RunResult) -> float:
    last = run.last
    return last.displacement / last.load if last and last.load else 0.0


def _doubts(c: Comparison) -> list[str]:
    messages = []
    for method in c.methods:
        first = next(iter(c.quantities))
        limit = method.limits.get(first)
        if limit is None:
            messages.append(f"{method.name}: no mesh-converged value, it takes three meshes that reach full load")
        elif limit.relative > NOT_CONVERGED:
            uncertain = f"the uncertainty of the {first} is {limit.relative:.1%}"
            messages.append(f"{method.name} is not mesh-converged: {uncertain}")
    for quantity in c.quantities:
        if not c.agreed(quantity):
            limits = "; ".join(f"{m.name} {m.limits[quantity]}" for m in c.methods if quantity in m.limits)
            messages.append(f"the converged values of the {quantity} differ by more than their uncertainties: {limits}")
    messages += _medium_doubts(c)
    messages += [f"suspect cell of the paper, {name}: {why}" for name, (_, why) in c.paper.items() if why]
    return messages


def _medium_doubts(c: Comparison) -> list[str]:
    """A difference between the media of the two methods that no finer mesh removes."""
    media = [
        sum(energy for name, energy in run.last.energy.items() if name in run.media)
        for run in c.finest.values()
        if run.last
    ]
    penalty = [run.inputs.get("interior_penalty", "none") for run in c.finest.values()]
    if len(media) != 2 or max(media) <= (1.0 + DIFFERENT_MEDIA) * min(media) or set(penalty) == {"none"}:
        return []
    return [
        f"the energies of the medium differ by a factor {max(media) / min(media):.1f}: finite elements with interior "
        "penalty count the jumps of the gradient between elements as curvature, virtual elements count none"
    ]
