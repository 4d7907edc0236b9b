"""Tables of runs: results, effort, provenance; and runs as CSV."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from typing import Any

from tmc_vem.problems.probes import GAP
from tmc_vem.report.page import Entry, Table
from tmc_vem.results.energy_balance import energy_balance
from tmc_vem.results.plausibility import differing_parameters
from tmc_vem.results.run_result import RunResult
from tmc_vem.results.unfinished import UNKNOWN

Runs = Mapping[str, RunResult]
REGULARISER = "energy, regulariser"


def number(value: float | None, digits: int = 5) -> str:
    """Value for a table; a dash if there is none, or it is not a number."""
    return "–" if value is None or math.isnan(value) else f"{value:.{digits - 1}e}"


def count(value: int) -> str:
    """A number of things; a dash if it is not known."""
    return str(value) if value else "–"


def seconds(value: float | None) -> str:
    """A time for a table; a dash if it is not known."""
    return "–" if value is None else f"{value:.1f}"


def percent(value: float | None, digits: int = 2) -> str:
    """Signed percentage of a fraction."""
    return "–" if value is None else f"{100.0 * value:+.{digits}f} %"


def relative(value: float | None, reference: float | None) -> float | None:
    """Relative difference of a value from a reference, if there are both."""
    return None if value is None or not reference else value / reference - 1.0


def reached(result: RunResult) -> str:
    """How far the load was applied, and with which parameters if they are not those of the problem, in few words."""
    if result.complete:
        return "full load" if result.load == 1.0 else f"end of path, load {result.load:.4g}"
    if result.last is None:
        return f"{_verb(result)} before its first step"
    other = "".join(f", {name} {value:.3g}" for name, value, _ in differing_parameters(result.last, result.inputs))
    return f"{_verb(result)} at {result.load:.4g}{other}"


def stopped(result: RunResult) -> str:
    """Where a run stopped or stands, what is missing there, and why: a sentence without its stop."""
    if result.last is None:
        return f"{_verb(result)} before its first step: {result.reason}"
    other = [
        f"{name} = {value:.4g}, not yet brought back to {wanted:.4g}"
        for name, value, wanted in differing_parameters(result.last, result.inputs)
    ]
    missing = f" with {' and '.join(other)}" if other else ""
    return f"{_verb(result)} at {result.load:.4g} of the load{missing}: {result.reason}"


def _verb(result: RunResult) -> str:
    return "unfinished" if result.state == UNKNOWN else result.state


def full_gap(result: RunResult | None) -> float | None:
    """Gap at full load; None if a run did not get there."""
    return result.gap if result is not None and result.complete else None


def full_energy(result: RunResult | None) -> float | None:
    """Energy of all regions at full load; None if a run did not get there."""
    if result is None or not result.complete or result.last is None:
        return None
    return sum(result.last.energy.values())


def effort(runs: Runs) -> Table:
    """Size, steps, iterations and times of runs."""
    rows: list[list[str | Entry]] = [
        [
            name,
            count(run.n_cells),
            count(run.n_dofs),
            Entry(reached(run), style="" if run.complete else "bad"),
            str(run.steps),
            str(run.newton_iterations),
            str(run.cut_backs),
            f"{run.seconds['total']:.1f}",
            seconds(run.seconds.get("assembly")),
            seconds(run.seconds.get("linear solve")),
        ]
        for name, run in runs.items()
    ]
    head = ("run", "cells", "dofs", "load", "steps", "Newton iterations", "cut-backs", "time (s)", "assembly (s)",
            "linear solves (s)")  # fmt: skip
    return Table(
        "Effort. Times are wall times and include compilation where a kernel was not in the cache.", head, rows
    )


def final_state(runs: Runs) -> Table:
    """Gap, reaction, smallest J and energies at the last converged step."""
    regions = region_names_of(runs)
    head = [
        "run",
        *(with_unit(name, runs, name) for name in ("gap", "reaction")),
        *(f"smallest J, {r}" for r in regions),
        *(with_unit(f"energy, {r}", runs, f"energy_{r}") for r in regions),
        REGULARISER,
    ]
    rows = []
    for name, run in runs.items():
        energies = run.last.energy if run.last else {}
        rows.append(
            [
                name if run.complete else f"{name}, {reached(run)}",
                number(run.gap),
                number(run.reaction),
                *(number(run.min_j.get(region), 3) for region in regions),
                *(number(energies.get(region), 4) for region in regions),
                number(run.checks.get("regulariser_energy"), 4),
            ]
        )
    return Table("State at the last converged step. The medium's energy includes the regulariser's.", head, rows)


def measured(runs: Runs) -> list[Table]:
    """A table with the probes at the last converged step, if there are others than the gap."""
    names = probes_of(runs)
    rows: list[list[str | Entry]] = [
        [with_unit(name, runs, name), *(number(run.reported.get(name)) for run in runs.values())] for name in names
    ]
    more = [what for what, there in (("loads", [run.loads for run in runs.values()]),
                                     ("contact", [run.contact for run in runs.values()])) if any(there)]  # fmt: skip
    what = ", ".join(["Probes", *more[:-1]]) + (f" and {more[-1]}" if more else "")
    head = ("quantity" if more else "probe", *runs)
    return [Table(f"{what} at the last converged step.", head, rows)] if rows else []


def energy_in_jumps(runs: Runs) -> list[Table]:
    """A table with what each jump to another branch lost, if there were any."""
    balances = {name: energy_balance(run.history) for name, run in runs.items()}
    rows: list[list[str | Entry]] = [
        [name, str(jump.step), number(jump.load), number(jump.lost, 3), number(jump.uncertainty, 2)]
        for name, balance in balances.items()
        if balance
        for jump in balance.jumps
    ]
    head = ("run", "step", "load", "energy lost", "known to")
    title = "Energy lost in jumps: stored before, plus the work of the step, minus stored after."
    return [Table(title, head, rows)] if rows else []


def energy_in_friction(runs: Runs) -> list[Table]:
    """A table that says where the work of runs with friction went, if there are any."""
    balances = {name: energy_balance(run.history) for name, run in runs.items() if run.friction}
    names = ("work", "stored", "slip", "dissipated", "released", "lost", "parameters", "integration_error")
    column = next((column for run in runs.values() for column in run.units if column.startswith("energy_")), "")
    head = ["run", *(with_unit(name.replace("_", " "), runs, column) for name in names)]
    rows: list[list[str | Entry]] = [
        [name, *(number(getattr(balance, each), 4) for each in names)] for name, balance in balances.items() if balance
    ]
    title = (
        "Where the work went: stored, of which elastic slip has a part; dissipated by friction; released by elastic "
        "slip as the pressure changed; lost in jumps. Stored = work + parameters + integration error - dissipated - "
        "released - lost."
    )
    return [Table(title, head, rows)] if rows else []


def region_names_of(runs: Runs) -> list[str]:
    """Names of all regions of some runs."""
    return list(dict.fromkeys(name for run in runs.values() for name in run.min_j))


def probes_of(runs: Runs) -> list[str]:
    """Names of all probes of some runs but for the gap, and of what is shown of their loads."""
    return list(dict.fromkeys(name for run in runs.values() for name in run.reported if name != GAP))


def with_unit(label: str, runs: Runs, column: str) -> str:
    """A label with the unit of a column of the history, if all runs that declare one declare the same."""
    units = {unit for run in runs.values() if (unit := run.unit(column))}
    return f"{label} ({units.pop()})" if len(units) == 1 else label


def provenance(runs: Runs, command: str) -> list[Table]:
    """What was run: parameters that all runs share, those in which they differ, versions, machine and times; all that
    is needed to repeat it."""
    names, values = differing(runs)
    shared = common([run.inputs for run in runs.values()])
    rows: list[list[str | Entry]] = [
        [
            label,
            Entry(", ".join(f"{n} {v}" for n, v in zip(names, values[label], strict=True) if v != "–"), style="long"),
            f"{run.seconds['total']:.1f}",
            run.directory.name if run.directory else "–",
        ]
        for label, run in runs.items()
    ]
    versions: dict[str, list[str]] = {}
    for run in runs.values():
        for name, value in run.versions.items():
            if name != "command":
                known = versions.setdefault(name, [])
                if str(value) not in known:
                    known.append(str(value))
    total = sum(run.seconds["total"] for run in runs.values())
    tables = [Table("Runs, and what they differ in.", ("run", "inputs", "time (s)", "run directory"), rows)]
    if shared:
        title = "Parameters of all runs." if len(runs) > 1 else "Parameters."
        tables.append(Table(title, ("parameter", "value"), [[name, text] for name, text in flat(shared)]))
    return [
        *tables,
        Table(
            "Versions and machine.",
            ("what", "value"),
            [
                ["command", command],
                *([name, ", ".join(values)] for name, values in versions.items()),
                ["time of all runs", f"{total:.0f} s"],
            ],
        ),
    ]


def flat(values: Mapping[str, Any], prefix: str = "") -> list[tuple[str, str]]:
    """Nested parameters as lines: ``medium.gamma``."""
    lines: list[tuple[str, str]] = []
    for name, value in values.items():
        if isinstance(value, Mapping):
            lines += flat(value, f"{prefix}{name}.")
        else:
            lines.append((prefix + name, f"{value:g}" if isinstance(value, float) else str(value)))
    return lines


def differing(runs: Runs) -> tuple[list[str], dict[str, list[str]]]:
    """Names of the inputs in which runs differ, and their values by run; '–' where a run does not have one."""
    inputs = {name: dict(flat(run.inputs)) for name, run in runs.items()}
    names = list(dict.fromkeys(key for values in inputs.values() for key in values))
    chosen = [key for key in names if len({values.get(key) for values in inputs.values()}) > 1]
    return chosen, {name: [values.get(key, "–") for key in chosen] for name, values in inputs.items()}


def common(inputs: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Parameters that all runs share, in the order of the first."""
    if not inputs:
        return {}
    return {
        name: value
        for name, value in inputs[0].items()
        if all(name in other and other[name] == value for other in inputs)
    }


def runs_csv(runs: Runs) -> str:
    """A row a run: label, inputs, results and times."""
    rows = []
    for label, run in runs.items():
        data = run.as_dict()
        row: dict[str, Any] = {"run": label}
        row |= {name: data[name] for name in ("complete", "state", "load", "gap", "reaction", "n_cells", "n_dofs",
                "steps", "newton_iterations", "cut_backs", "negative_pivots")}  # fmt: skip
        for group in ("probes", "min_j", "energy", "seconds", "inputs", "versions"):
            row |= {f"{group}.{name}": value for name, value in _leaves(data[group])}
        if run.adaptivity is not None:
            row |= {f"estimated_error.{name}": value for name, value in run.adaptivity.errors.items()}
        row["directory"] = run.directory.name if run.directory else ""
        rows.append(row)
    columns = list(dict.fromkeys(name for row in rows for name in row))
    text = io.StringIO()
    writer = csv.DictWriter(text, fieldnames=columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _leaves(values: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    leaves: list[tuple[str, Any]] = []
    for name, value in values.items():
        leaves += _leaves(value, f"{prefix}{name}.") if isinstance(value, Mapping) else [(prefix + name, value)]
    return leaves
