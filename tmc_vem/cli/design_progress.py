"""Progress and the summary of a search for a design on a terminal."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.text import Text

from tmc_vem.cli.columns import names_and_values, plain
from tmc_vem.design.evaluator import Evaluator
from tmc_vem.design.monitor import DesignMonitor
from tmc_vem.design.optimise import DesignStep
from tmc_vem.design.rows import LIMIT
from tmc_vem.problems.own import OwnProblem
from tmc_vem.results.design_run import DesignRun

HEAD = f"{'design':>6}  {'objective':>13}  {'volume':>7}  {'worst limit':>11}  {'change':>7}  {'Newton':>6}  {'s':>6}"


class ConsoleDesignMonitor(DesignMonitor):
    """A line for every design on stderr, so that stdout stays clean; a star marks those that are better than all
    before."""

    def __init__(self) -> None:
        self.console = Console(stderr=True)
        self._level = -1
        self._on_record = 0

    def started(self, problem: OwnProblem, evaluator: Evaluator, n_dofs: int, on_record: int) -> None:
        """Print what is designed."""
        table, n = evaluator.table, evaluator.parametrisation.n_variables
        what = f"{'minimise' if table.minimise else 'maximise'} {table.objective}"
        limits = ", ".join(evaluator.constraints) or "none"
        size = f": {what}; {n} variables, {evaluator.mesh.n_cells} cells, {n_dofs} degrees of freedom; limits: {limits}"
        self.console.print(Text.assemble(plain(problem.name, "bold"), size), highlight=False, soft_wrap=True)
        if on_record:
            self.console.print(f"{on_record} evaluations are on record", highlight=False)
        self.console.print(HEAD, style="bold", highlight=False, soft_wrap=True)
        self._on_record = on_record

    def designed(self, step: DesignStep, row: Mapping[str, Any]) -> None:
        """Print the line of a design."""
        if step.projection is not None and step.level != self._level:
            self.console.print(f"projection with beta = {step.projection.beta:g}", highlight=False)
        self._level = step.level
        if not step.fresh and step.number < self._on_record:  # the last on record says where the search stands
            return
        known = math.isfinite(step.iterate.evaluation.objective)
        objective = f"{row['objective']:13.6e}" if known else f"{'none':>13}"
        worst = max((row[name] for name in row if name.startswith(LIMIT)), default=None) if known else None
        limit = f"{worst:+11.2e}" if worst is not None else f"{'-':>11}"
        star = "*" if step.iterate.better else " "
        line = (
            f"{step.number:>6}{star} {objective}  {row['volume']:7.4f}  {limit}  {step.iterate.change:7.4f}  "
            f"{row['newton_iterations']:>6}  {row['seconds']:6.2f}"
        )
        style = "" if known else "yellow"
        self.console.print(Text.assemble((line, style)), highlight=False, soft_wrap=True)
        for note in step.worth.notes:
            self.console.print(Text.assemble(("        note", "yellow"), f": {note}"), highlight=False, soft_wrap=True)

    def saying(self, sentence: str) -> None:
        """Print what is done after the search."""
        self.console.print(sentence, highlight=False, soft_wrap=True)


def print_design(run: DesignRun) -> None:
    """Print a table of the result on stdout, what is wrong with it last and in colour."""
    table = names_and_values(rows_of(run), {"NOT FEASIBLE": "red", "note": "yellow"})
    ranks = run.versions.get("ranks", 1)
    # mpirun gives each rank a terminal of its own, whatever its output goes to
    Console(force_terminal=False if ranks > 1 else None).print(table, highlight=False)


def rows_of(run: DesignRun) -> list[tuple[str, str]]:
    """Names and values of the summary."""
    rows = [] if not run.feasible else [("feasible", run.sentence)]
    rows.append((run.of, f"{run.objective:.6e} ({'minimised' if run.minimise else 'maximised'})"))
    for name, limit in run.limits.items():
        bound = f"at most {limit.at_most:g}" if limit.at_most is not None else f"at least {limit.at_least:g}"
        rows.append((f"limit, {name}", f"{limit.value:.6g}, {bound}, margin {limit.margin:.3g}"))
    rows += [(name, f"{value:.6e}") for name, value in run.values.items() if name != run.of]
    if "volume" not in (run.of, *run.limits):
        rows.append(("volume", f"{run.volume:.6g}"))
    rows.append(("search", f"{'converged' if run.converged else 'not converged'}: {run.reason}"))
    rows.append(("stationarity", f"{run.stationarity:.3g} of the gradient is left"))
    better = f"{run.iterations} better than all before"
    rows.append(("evaluations", f"{run.evaluations} with {run.newton_iterations} Newton iterations, {better}"))
    rows.append(("time", f"{run.seconds['total']:.1f} s ({run.seconds['evaluations']:.1f} s of evaluations)"))
    if run.directory is not None:
        rows.append(("written to", str(run.directory)))
        rows.append(("report", str(run.directory / "report.html")))
        rows += [("run of it", str(run.directory / where)) for where in run.runs.values()]
    rows += [("note", text) for text in run.notes]
    return rows if run.feasible else [*rows, ("NOT FEASIBLE", run.sentence.removeprefix("NOT FEASIBLE: "))]
