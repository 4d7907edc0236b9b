"""Tables of adapted meshes: rounds with estimated errors, how equilibrium was found, and results of several runs."""

from __future__ import annotations

import math

from tmc_vem.report.page import Entry, Table, Text
from tmc_vem.report.tables import Runs, number, with_unit
from tmc_vem.results.adaptivity import LINEARISED, RECOVERED, Adaptivity, Round
from tmc_vem.results.run_result import RunResult

CRUDE = {LINEARISED: "From one Newton step on the refined mesh.", RECOVERED: "From recovered gradients."}
FAR = 3.0  # times the error that was estimated before: a larger change of energy or reaction is marked
ELSEWHERE = (
    f"More than {FAR:g} times the error that was estimated before: the state may have come to another branch, or the "
    "estimate was of no use."
)
CHANGES = ("energy", "reaction")


def signed_error(round_: Round, name: str) -> float | None:
    """Estimated error relative to the value: above 0 if the exact value is larger in size; None without an estimate."""
    relative = round_.relative(name)
    if relative is None:
        return None
    return relative if round_.errors[name] * round_.values[name] > 0.0 else -relative


def change(round_: Round, name: str) -> float | None:
    """Relative change of energy or reaction when the state came to a mesh; None on a first one."""
    before, now = round_.before.get(name), round_.values.get(name)
    return None if not before or now is None else now / before - 1.0


def in_words(adaptivity: Adaptivity) -> Text:
    """What was asked for, and why no more rounds were made."""
    a, first, last = adaptivity, adaptivity.rounds[0], adaptivity.last
    seconds = sum(each.seconds for each in a.rounds)
    return Text(
        f"Adapted to {', '.join(a.of)} with a tolerance of {100.0 * a.tolerance:.3g} %: {_rounds(len(a.rounds))}, "
        f"{first.n_cells} to {last.n_cells} cells, {seconds:.1f} s. Why there are no more: {a.reason}. "
        "The result is that of the whole path with the last mesh."
    )


def _rounds(n: int) -> str:
    return f"{n} round{'' if n == 1 else 's'}"


def rounds_table(name: str, result: RunResult, adaptivity: Adaptivity) -> Table:
    """A row a round: size, results with estimated errors, and what was done to the mesh."""
    runs = {name: result}
    head = ["round", "load", "cells", "dofs"]
    for of in adaptivity.of:
        head += [with_unit(of, runs, of), "estimated error" if len(adaptivity.of) == 1 else f"estimated error, {of}"]
    rows: list[list[str | Entry]] = []
    for n, each in enumerate(adaptivity.rounds):
        row: list[str | Entry] = [str(each.number), f"{each.load:.4g}", str(each.n_cells), str(each.n_dofs)]
        last = n + 1 == len(adaptivity.rounds) or adaptivity.rounds[n + 1].load != each.load
        for of in adaptivity.of:
            row += [number(each.values.get(of)), _error(each, of, adaptivity.tolerance, last=last)]
        rows.append([*row, _or_dash(each.refined)])
    caption = (
        "Rounds. An estimated error is that of the mesh alone, relative to the value, and above 0 where the exact "
        "value is larger in size; green ones are within the tolerance."
    )
    return Table(caption, (*head, "cells cut"), rows)


def _error(round_: Round, name: str, tolerance: float, *, last: bool) -> Entry:
    error = signed_error(round_, name)
    if error is None:
        return Entry("–", _sentence(round_.doubt) if round_.doubt else "There is no estimate of it.", "suspect")
    if not math.isfinite(error):
        return Entry(number(round_.errors[name], 2), "The value is 0: this is its error.", "suspect")
    note = _sentence(round_.doubt) if round_.doubt else CRUDE.get(round_.estimate, "")
    within = abs(error) <= tolerance
    return Entry(_short(error), note, "suspect" if note else "good" if within else "bad" if last else "")


def solution_table(adaptivity: Adaptivity) -> Table:
    """A row a round: how equilibrium was found, what changed with the mesh, and what the estimate took."""
    rows: list[list[str | Entry]] = []
    before: Round | None = None
    for each in adaptivity.rounds:
        found = each.found[:1].upper() + each.found[1:]
        row: list[str | Entry] = [str(each.number), Entry(found or "–", style="long"), str(each.iterations)]
        row += [_change(each, of, before) for of in CHANGES]
        rows.append([*row, _or_dash(each.refined_dofs), _or_dash(each.refined_iterations), f"{each.seconds:.1f}"])
        before = each
    caption = (
        "Equilibrium in each round. Energy and reaction are compared at the same load, before and after the state came "
        "to the mesh; estimates are from the mesh with all cells cut, with so many degrees of freedom and iterations."
    )
    head = ("round", "how it was found", "iterations", "change of energy", "change of reaction",
            "dofs, all cells cut", "iterations there", "time (s)")  # fmt: skip
    return Table(caption, head, rows)


def _change(round_: Round, name: str, before: Round | None) -> Entry:
    found = change(round_, name)
    if found is None:
        return Entry("–")
    expected = None if before is None else before.relative(name)
    far = expected is not None and abs(found) > FAR * expected and abs(found) > 1e-6
    return Entry(_short(found), ELSEWHERE if far else "", "suspect" if far else "")


def estimated_errors(runs: Runs) -> list[Table]:
    """A table of the estimated errors of runs with adapted meshes, if there are any."""
    rows: list[list[str | Entry]] = []
    for label, run in runs.items():
        a = run.adaptivity
        for name in a.of if a else ():
            assert a is not None
            sizes = f"{a.rounds[0].n_cells} to {a.last.n_cells} in {_rounds(len(a.rounds))}"
            error = _error(a.last, name, a.tolerance, last=True)
            rows.append([label, name, number(a.last.values.get(name)), error, f"{100.0 * a.tolerance:.3g} %", sizes])
    head = ("run", "result", "value", "estimated error", "tolerance", "cells")
    return [Table("Results that meshes were adapted to, at the last load.", head, rows)] if rows else []


def errors_in_few_words(result: RunResult) -> str:
    """``gap -0.04 %``; nothing for a run whose mesh was not adapted."""
    a = result.adaptivity
    if a is None:
        return ""
    errors = {name: signed_error(a.last, name) for name in a.of}
    return ", ".join(f"{name} {'–' if error is None else _short(error)}" for name, error in errors.items())


def _short(error: float) -> str:
    """A percentage with two digits that count: errors of rounds go over decades."""
    return f"{100.0 * error:+.2g} %"


def _or_dash(value: int) -> str:
    return str(value) if value else "–"


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}{'' if text.endswith('.') else '.'}"
