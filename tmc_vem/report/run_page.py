"""A page about one run."""

from __future__ import annotations

import numpy as np

from tmc_vem.report import cautions, plots, tables
from tmc_vem.report.limits import limit_blocks
from tmc_vem.report.page import Block, Page, Section, Table, Text, picture
from tmc_vem.report.panels import draw_panels
from tmc_vem.results.run_result import RunResult
from tmc_vem.results.snapshots import nearest, read_fields, record_of, snapshots
from tmc_vem.support.errors import InputError


def run_page(result: RunResult, *, quantity: str = "uy", n_states: int = 4) -> Page:
    """Curves, deformed states, tables and provenance of a run, as far as it has come."""
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
                [tables.final_state(runs), *tables.measured(runs), *tables.energy_in_jumps(runs), warnings],
            ),
            *([Section("Limit for gamma to 0", limit_blocks(name, result))] if result.limit else []),
            *([Section("Deformed states", [_states(result, quantity, n_states)])] if result.history else []),
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


def _curves(runs: tables.Runs) -> list[Block]:
    return [
        picture(plots.gap_and_reaction(runs), "loading", "Gap and reaction during loading."),
        *plots.probe_pictures(runs),
        picture(plots.smallest_j(runs), "smallest-j", "Smallest J during loading."),
        picture(plots.energy_split(runs), "energy", "Energy of solids and medium during loading."),
        picture(plots.newton_iterations(runs), "newton", "Newton iterations of every load step."),
    ]
