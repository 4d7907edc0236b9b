"""A page about one run."""

from __future__ import annotations

import numpy as np

from tmc_vem.report import cautions, plots, tables
from tmc_vem.report.adapted import adapted_sections
from tmc_vem.report.contact_figure import contact_of
from tmc_vem.report.contact_tables import contact_tables
from tmc_vem.report.field_figure import Shown, field_figure
from tmc_vem.report.limits import limit_blocks
from tmc_vem.report.page import Block, Page, Section, Table, Text, picture
from tmc_vem.report.panels import draw_panels
from tmc_vem.results.run_result import RunResult
from tmc_vem.results.snapshots import nearest, read_fields, record_of, snapshots
from tmc_vem.support.errors import InputError

NOTHING = Text("No pressure acts on any solid.")


def run_page(result: RunResult, *, quantity: str = "uy", n_states: int = 4, shown: Shown | None = None) -> Page:
    """Curves, deformed states, tables and provenance of a run, as far as it has come.

    Args:
        result: the run.
        quantity: what colours the deformed states.
        n_states: how many there are.
        shown: a field that gets a large picture; the von Mises stress, if there is one, by default.

    Raises:
        InputError: the run does not have the field that is asked for.
    """
    name = f"{result.inputs.get('problem', 'run')} {str(result.inputs.get('method', '')).upper()}".rstrip()
    runs = {name: result}
    contact, findings = cautions.of_contact(runs) if result.history else ([], [])
    warnings = cautions.listed([*findings, *cautions.of_runs(runs)])
    cells, dofs = tables.count(result.n_cells), tables.count(result.n_dofs)
    made_with = str(result.versions.get("command", "–"))
    return Page(
        f"Run of {name}",
        f"{tables.reached(result)}, {cells} cells, {dofs} degrees of freedom.",
        [
            Section(
                "Result",
                [
                    tables.final_state(runs),
                    *tables.measured(runs),
                    *tables.energy_in_jumps(runs),
                    *tables.energy_in_friction(runs),
                    warnings,
                ],
            ),
            *([Section("Limit for gamma to 0", limit_blocks(name, result))] if result.limit else []),
            *adapted_sections(name, result),
            *([Section("Deformed states", [_states(result, quantity, n_states)])] if result.history else []),
            *(_contact(result) if result.history else []),
            *([Section("Field", [_field(result, shown)])] if result.history else []),
            *([Section("Curves", _curves(runs))] if result.history else []),
            Section("Solution", [tables.effort(runs), Table("Contact.", ("run", "deformed solids"), contact)]),
            Section("How to repeat this", tables.provenance(runs, made_with)),
        ],
    )


def _states(result: RunResult, quantity: str, n_states: int) -> Block:
    """Deformed states, evenly spread over the path so far, or why there are none."""
    try:
        available = snapshots(result)
        wanted = result.history[-1].coordinate * np.arange(1, n_states + 1) / n_states
        chosen = {found.load: found for load in wanted for found in (nearest(available, float(load)),)}
        panels = [
            (f"displacement {record_of(result, found).displacement:.3g}", read_fields(result, found))
            for found in chosen.values()
        ]
    except InputError as error:
        return Text(str(error))
    return picture(draw_panels(panels, quantity=quantity), "states", "Deformed states.", inline="png")


def contact_page(result: RunResult, load: float | None = None) -> Page:
    """Contact of a run alone.

    Args:
        result: the run.
        load: factor, or coordinate on the load path, of the snapshot; None for the last state.

    Raises:
        InputError: the run has no tractions.
    """
    name = f"{result.inputs.get('problem', 'run')} {str(result.inputs.get('method', '')).upper()}".rstrip()
    pictures = contact_of(result, load)
    blocks: list[Block] = list(pictures) if pictures else [NOTHING]
    if load is None:
        blocks += contact_tables(result)
    return Page(f"Contact of {name}", f"{tables.reached(result)}.", [Section("Contact", blocks)])


def _contact(result: RunResult) -> list[Section]:
    """Tractions at the end, where the run has them."""
    try:
        pictures = contact_of(result)
    except InputError:
        return []
    return [Section("Contact", [*pictures, *contact_tables(result)])]


def _field(result: RunResult, shown: Shown | None) -> Block:
    """A large picture of one field, or why there is none where none is asked for."""
    asked = shown is not None and shown != Shown()
    try:
        figure, name = field_figure(result, shown or Shown("von_mises"))
    except InputError as error:
        if asked:
            raise
        if shown is None:
            return _field(result, Shown())
        return Text(str(error))
    return picture(figure, f"field-{name}", f"The field {name}.", inline="png")


def _curves(runs: tables.Runs) -> list[Block]:
    return [
        picture(plots.gap_and_reaction(runs), "loading", "Gap and reaction during loading."),
        *plots.loops(runs),
        *plots.probe_pictures(runs),
        picture(plots.smallest_j(runs), "smallest-j", "Smallest J during loading."),
        picture(plots.energy_split(runs), "energy", "Energy of solids and medium during loading."),
        picture(plots.newton_iterations(runs), "newton", "Newton iterations of every load step."),
    ]
