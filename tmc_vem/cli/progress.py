"""Live progress and the summary of a run on a terminal."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.text import Text

from tmc_vem.cli.columns import names_and_values, plain
from tmc_vem.problems.base import Problem
from tmc_vem.problems.probes import GAP
from tmc_vem.problems.solids import conversions
from tmc_vem.report.tables import reached
from tmc_vem.results.adaptivity import Round, error_in_words
from tmc_vem.results.records import StepRecord
from tmc_vem.results.run_result import RunResult
from tmc_vem.simulation.monitor import Monitor

SILENCE = 20.0  # seconds without a line
DECADE = 0.11  # gamma is said again where it is a decade lower


class ConsoleMonitor(Monitor):
    """Load factor, iterations, gap and smallest J while a run goes on: a live bar on a terminal, else a line now and
    then. Writes to stderr, so that stdout stays clean."""

    def __init__(self) -> None:
        self.console = Console(stderr=True)
        self._progress: Progress | None = None
        self._task: Any = None
        self._last = ""
        self._shown = self._reached = 0.0
        self._spoke = time.monotonic()
        self._said: set[str] = set()
        self._lowered = 0.0  # gamma that was said last
        self._below: int | None = None  # the step that it was lowered from

    def started(self, problem: Problem, n_cells: int, n_dofs: int) -> None:
        """Print what is solved and show the bar; that of a run before on another mesh is gone."""
        self.aborted()
        self._last, self._shown, self._reached, self._lowered, self._below = "", 0.0, 0.0, 0.0, None
        size = f": {n_cells} cells, {n_dofs} degrees of freedom"
        self.console.print(Text.assemble(plain(problem.name, "bold"), size), highlight=False, soft_wrap=True)
        if self.console.is_terminal:
            self._progress = Progress(
                TextColumn("load"), BarColumn(bar_width=30), TextColumn("{task.percentage:5.1f} %"),
                TextColumn("{task.fields[state]}", markup=False),
                TimeElapsedColumn(), console=self.console, transient=True,
            )  # fmt: skip
            self._task = self._progress.add_task("load", total=self.end, state="")
            self._progress.start()

    def warned(self, sentences: Sequence[str]) -> None:
        """Print what is said before solving."""
        new = [sentence for sentence in sentences if sentence not in self._said]
        self._said.update(new)
        for sentence in new:
            self.console.print(Text.assemble(("warning", "yellow"), f": {sentence}"), highlight=False)

    def iterated(self, iteration: int, residual: float) -> None:
        """Update the bar's text, or print a line where steps take long."""
        if self._progress:
            self._progress.update(self._task, state=f"{self._last}iteration {iteration}, residual {residual:.1e}")
        elif time.monotonic() > self._spoke + SILENCE:
            self._spoke = time.monotonic()
            text = f"after load {self._reached:.4g}: {self._last}iteration {iteration}, residual {residual:.1e}"
            self.console.print(text, highlight=False)

    def stepped(self, record: StepRecord) -> None:
        """Advance the bar, or print a line for every tenth of the load."""
        gap = "" if record.gap is None else f"gap {record.gap:.4g}, "
        self._last = f"step {record.step}, {gap}min J {min(record.min_j.values()):.2g}, "
        self._reached = record.load
        if self._progress:
            self._progress.update(self._task, completed=record.coordinate, state=self._last)
        elif record.coordinate >= self._shown + 0.1 - 1e-9:
            self._shown, self._spoke = record.coordinate, time.monotonic()
            self.console.print(f"load {record.load:.3f}, {self._last}{record.iterations} iterations", highlight=False)

    def lowered(self, record: StepRecord) -> None:
        """Say how far gamma is lowered."""
        at = ", ".join(f"{name} {value:.2e}" for name, value in record.parameters.items())
        gap = "" if record.gap is None else f"gap {record.gap:.4g}, "
        value = next(iter(record.parameters.values()))
        if self._progress:
            self._progress.update(self._task, state=f"{at}, {gap}")
        elif value <= self._lowered * DECADE or record.limit_of != self._below:
            self._spoke, self._lowered, self._below = time.monotonic(), value, record.limit_of
            text = f"load {record.load:.3f} with {at}, {gap}{record.iterations} iterations"
            self.console.print(text, highlight=False)

    def adapted(self, round_: Round, of: Sequence[str]) -> None:
        """Say what a round has come to."""
        self.aborted()
        errors = ", ".join(f"{name} {round_.values[name]:.6g} {error_in_words(round_, name)}" for name in of)
        cells = f"{round_.n_cells} cells, {round_.n_dofs} degrees of freedom"
        cut = f", {round_.refined} cells are cut" if round_.refined else ""
        text = f"round {round_.number}, load {round_.load:.4g}: {cells}, {errors}{cut}"
        self.console.print(text, highlight=False, soft_wrap=True)

    def aborted(self) -> None:
        """Remove the bar."""
        if self._progress:
            self._progress.stop()
            self._progress = None

    def finished(self, result: RunResult) -> None:
        """Remove the bar."""
        self.aborted()


def print_summary(result: RunResult) -> None:
    """Print a table of the results on stdout, what is wrong with them last and in colour."""
    table = names_and_values(summary_rows(result), {"ERROR": "red", "warning": "yellow"})
    # mpirun gives each rank a terminal of its own, whatever its output goes to
    Console(force_terminal=False if result.parallel.get("ranks", 1) > 1 else None).print(table, highlight=False)


def summary_rows(result: RunResult) -> list[tuple[str, str]]:
    """Names and values of the summary."""

    def with_unit(value: str, column: str) -> str:
        return f"{value} {result.unit(column)}".rstrip()

    medium = result.inputs.get("medium", {})
    rows = [("load reached", reached(result))]
    last = result.last
    if last:
        gap = {} if last.gap is None else {GAP: last.gap}
        measured = {**gap, "reaction": last.reaction, **last.reported}  # gap and reaction first
        rows.append(("displacement", with_unit(f"{last.displacement:g}", "displacement")))
        rows += [(name, with_unit(f"{value:.6e}", name)) for name, value in measured.items()]
        dense = result.checks.get("dense_min_j", {})
        for region, value in last.min_j.items():
            between = f", {dense[region]:.2e} between quadrature points" if dense.get(region) is not None else ""
            rows.append((f"smallest J, {region}", f"{value:.4e}{between}"))
        rows += [
            (f"energy, {region}", with_unit(f"{value:.6e}", f"energy_{region}"))
            for region, value in last.energy.items()
        ]
        if last.negative_pivots:
            rows.append(("unstable", f"{last.negative_pivots} negative pivots"))
    rows += limit_rows(result)
    rows += adaptivity_rows(result)
    rows += conversions(result.inputs)
    if "alpha" in medium:
        made = f"alpha_r = {medium['alpha_r']:g} (alpha = {medium['alpha']:g}, h = {medium['h']:g})"
        rows.append(("regulariser", made))
    if result.checks:
        column = next((column for column in result.units if column.startswith("energy_")), "")
        energy = with_unit(f"{result.checks['regulariser_energy']:.6e}", column)
        if "penalty_energy" in result.checks:
            energy += " in cells, " + with_unit(f"{result.checks['penalty_energy']:.6e}", column) + " between them"
        rows.append(("energy, regulariser", f"{energy}, a part of the medium's"))
        rows.append(("contact", result.checks["summary"]))
        lost = result.checks.get("energy_balance") or {}
        if "dissipated" in lost:
            parts = ("dissipated", "slip", "released", "integration_error")
            gone, slip, released, error = (with_unit(f"{lost[part]:.4e}", column) for part in parts)
            text = f"{gone} of {lost['work']:.4e} done, {slip} in elastic slip, {released} released, off by {error}"
            rows.append(("energy dissipated", text))
        if lost.get("jumps"):
            energy = with_unit(f"{lost['lost']:.3e}", column)
            off = with_unit(f"{sum(jump['uncertainty'] for jump in lost['jumps']):.1e}", column)
            rows.append(("energy lost", f"{energy} in {len(lost['jumps'])} jumps, known to {off}"))
        rows.append(("imbalance", f"{result.checks['imbalance']:.1e} of the largest reaction"))
    cuts = f", {result.cut_backs} cut-backs" if result.cut_backs else ""
    rows.append(("load steps", f"{result.steps} with {result.newton_iterations} Newton iterations{cuts}"))
    if result.projection_degrees:
        cells = ", ".join(
            f"{'l = ' if space.isdigit() else ''}{space}: {count}" for space, count in result.projection_degrees.items()
        )
        rows.append(("cells", f"{result.n_cells} ({cells}), {result.n_dofs} degrees of freedom"))
    else:
        rows.append(("cells", f"{result.n_cells}, {result.n_dofs} degrees of freedom"))
    seconds = dict(result.seconds)
    total = seconds.pop("total")
    rows.append(("time", f"{total:.2f} s ({', '.join(f'{phase} {value:.2f}' for phase, value in seconds.items())})"))
    if result.directory:
        rows.append(("written to", str(result.directory)))
    rows += [("ERROR", text) for text in result.errors]
    return rows + [("warning", text) for text in result.warnings]


def adaptivity_rows(result: RunResult) -> list[tuple[str, str]]:
    """Estimated errors of the results that the mesh was adapted to, and how it went."""
    adaptivity = result.adaptivity
    if adaptivity is None:
        return []
    last = adaptivity.last
    rows = [(f"estimated error, {name}", error_in_words(last, name)) for name in adaptivity.of]
    n, first = len(adaptivity.rounds), adaptivity.rounds[0]
    cells = f"{last.n_cells} cells" if n == 1 else f"{first.n_cells} to {last.n_cells} cells"
    return [*rows, ("mesh", f"adapted in {n} round{'s' if n > 1 else ''}, {cells}: {adaptivity.reason}")]


def limit_rows(result: RunResult) -> list[tuple[str, str]]:
    """Limits for gamma to 0, as far as they are given; warnings say why others are withheld."""
    limit = result.limit
    if limit is None:
        return []
    gammas = ", ".join(f"{gamma:.3g}" for gamma in limit.gammas)
    rows = [("limit of gamma", f"from {gammas}, with {limit.newton_iterations} Newton iterations")]
    for name, entry in limit.values.items():
        ratio = "" if entry.ratio is None else f" (ratio {entry.ratio:.3f}, {limit.expected_ratio:.3f} in contact)"
        unit = "" if entry.value is None else result.unit(name)
        rows.append((f"limit, {name}", f"{entry} {unit}".rstrip() + ratio))
    return rows
