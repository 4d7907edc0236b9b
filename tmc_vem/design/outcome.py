"""What a search has found: its result, files of the best design, pictures, a report, and the run of the best design."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.design.directory import DesignDirectory, read_rows
from tmc_vem.design.final import called, final_problems, write_final, write_problems
from tmc_vem.design.optimise import FEASIBLE, DesignResult, Optimisation
from tmc_vem.design.snapshots import DesignSnapshots
from tmc_vem.problems.base import media_of
from tmc_vem.problems.design_table import VOLUME
from tmc_vem.problems.own import OwnProblem
from tmc_vem.results.design_run import DesignRun, LimitValue
from tmc_vem.simulation.options import RunOptions
from tmc_vem.simulation.provenance import versions
from tmc_vem.simulation.simulation import run as solve
from tmc_vem.support.distributed import Comm
from tmc_vem.support.errors import TmcError
from tmc_vem.support.parallel import on_root
from tmc_vem.system.fields import Fields, Polygons

Float = NDArray[np.float64]

FRAMES = 60  # of the animation, at most
# Results of the run of the best design and those of the search are the same within this part.
SAME = 1e-5


class Outcome:
    """Makes a result of a search, and writes it; all ranks together.

    Args:
        problem, options: what was solved.
        search: after it has gone.
        result: what it gave.
        inputs: as of a run.
        comm: ranks.
    """

    def __init__(
        self, problem: OwnProblem, options: RunOptions, search: Optimisation, result: DesignResult,
        inputs: Mapping[str, Any], comm: Comm,
    ) -> None:  # fmt: skip
        self._problem, self._options, self._search, self._result = problem, options, search, result
        self._inputs, self._comm = inputs, comm

    def write(
        self, directory: DesignDirectory | None, snapshots: DesignSnapshots | None, seconds: float, *, animation: bool,
        final: bool,
    ) -> DesignRun:  # fmt: skip
        """The result, and everything that goes into the directory, if there is one.

        Args:
            directory: where.
            snapshots: of the same directory.
            seconds: that the search took in all.
            animation: write an animated picture of the designs.
            final: run the best design.
        """
        run = self._summary(seconds)
        if directory is None or snapshots is None:
            return run
        path, result, evaluator = directory.path, self._result, self._search.evaluator
        run = replace(run, directory=path)
        fields = snapshots.fields(result.density_c, result.stiffness_c)
        snapshots.write_best(fields)
        on_root(self._comm, lambda: write_final(path, evaluator, result.stiffness_c, result.density_c))
        problems = final_problems(self._problem, path)
        on_root(self._comm, lambda: write_problems(path, problems, self._options, self._problem.name))
        if final:
            run = self._with_runs(run, problems, path)
        on_root(self._comm, lambda: self._draw(path, run, fields, animation))
        on_root(self._comm, lambda: directory.write_run(run))
        return run

    # -- parts -----------------------------------------------------------------------------------------------------

    def _summary(self, seconds: float) -> DesignRun:
        search, result, table = self._search, self._result, self._search.table
        evaluator, optimum = search.evaluator, result.optimum
        worth = result.worth
        known = worth is not None and bool(worth.values)
        values = worth.values if worth is not None and known else self._best_worth().values
        system = next(iter(evaluator.cases.values())).system
        worths = [step.worth for step in search.steps]
        notes = [] if known else ["the best design has no equilibrium that loading from the beginning leads to"]
        notes += list(worth.notes) if worth is not None and known else []
        limits = self._limits(values)
        feasible = optimum.feasible and all(limit.satisfied for limit in limits.values())
        if optimum.feasible and not feasible:
            notes.append("loaded from the beginning, the design does not satisfy what it did in the search")
        objective = self._objective(values)
        return DesignRun(
            problem=self._problem.name, minimise=table.minimise, maximise=table.maximise, objective=objective,
            values=dict(values), volume=evaluator.parametrisation.volume(optimum.z), limits=limits, feasible=feasible,
            converged=optimum.converged, reason=optimum.reason, stationarity=optimum.stationarity,
            evaluations=len(search.steps), iterations=sum(step.iterate.better for step in search.steps),
            starts=optimum.starts, newton_iterations=sum(each.iterations for each in worths),
            seconds={"evaluations": sum(each.seconds for each in worths), "total": seconds}, method=table.method,
            beta=None if result.projection is None else result.projection.beta,
            n_cells=system.n_cells_global, n_dofs=system.n_dofs, n_variables=evaluator.parametrisation.n_variables,
            cases=tuple(case for case in evaluator.cases if case), notes=tuple(notes), inputs=self._inputs,
            versions=versions(self._comm.size),
        )  # fmt: skip

    def _best_worth(self) -> Any:
        best = self._result.optimum.z.tobytes()
        return next(step.worth for step in reversed(self._search.steps) if step.iterate.z.tobytes() == best)

    def _objective(self, values: Mapping[str, float]) -> float:
        evaluator = self._search.evaluator
        if evaluator.table.by_volume:
            return evaluator.parametrisation.volume(self._result.optimum.z)
        several = len(evaluator.cases) > 1
        return sum(
            evaluator.weights[case]
            * values[f"{case}.{evaluator.table.objective}" if several else evaluator.table.objective]
            for case in evaluator.cases
        )

    def _limits(self, values: Mapping[str, float]) -> dict[str, LimitValue]:
        evaluator, table = self._search.evaluator, self._search.table
        found = {}
        if table.volume is not None:
            volume = evaluator.parametrisation.volume(self._result.optimum.z)
            margin = table.volume - volume
            found[VOLUME] = LimitValue(volume, margin, margin >= -FEASIBLE * table.volume, at_most=table.volume)
        several = len(evaluator.cases) > 1
        for case in evaluator.cases:
            for name, limit in table.limits.items():
                of = limit.of or name
                value = values[f"{case}.{of}" if several else of]
                margin = limit.sign * (limit.bound - value)
                found[f"{case}.{name}" if several else name] = LimitValue(
                    value, margin, margin >= -FEASIBLE * (abs(limit.bound) or 1.0), limit.at_most, limit.at_least
                )
        return found

    def _with_runs(self, run: DesignRun, problems: Mapping[str, OwnProblem], path: Path) -> DesignRun:
        """Solve the best design with every load case, as runs in directories of their own."""
        runs, notes = {}, []
        options = replace(self._options, overwrite=True, max_iterations=None, max_seconds=None)
        for case, problem in problems.items():
            where = called("") if not case else f"{called('')}/{case}"
            try:
                found = solve(problem, path / where, options, comm=self._comm)
            except TmcError as error:
                notes.append(f"{where}: {error}")
                continue
            runs[case] = where
            if not found.complete:
                notes.append(f"{where}: the load could not be applied in full: {found.reason}")
                continue
            for name, value in {**found.probes, "reaction": found.reaction}.items():
                here = f"{case}.{name}" if case else name
                if value is not None and here in run.values and abs(value - run.values[here]) > SAME * abs(value):
                    notes.append(f"{where}: {name} = {value:.6g}, in the search {run.values[here]:.6g}")
        return replace(run, runs=runs, notes=(*run.notes, *notes))

    def _draw(self, path: Path, run: DesignRun, fields: Mapping[str, Fields], animation: bool) -> None:
        from tmc_vem.report.design_page import write_design

        frames: list[tuple[str, Float]] = []
        if animation:
            parametrisation, cells = self._search.evaluator.parametrisation, self._search.evaluator.mesh.n_cells
            better = [step for step in self._search.steps if step.iterate.better]
            chosen = sorted({round(n) for n in np.linspace(0, len(better) - 1, min(FRAMES, len(better)))})
            for step in (better[n] for n in chosen):
                density_c = np.full(cells, np.nan)
                of = parametrisation.with_projection(step.projection)
                density_c[of.cells] = of.physical(step.iterate.z)
                frames.append((f"evaluation {step.number}", density_c))
        mesh = self._search.evaluator.mesh
        polygons = Polygons(
            mesh.points_vx, mesh.cell_offsets, mesh.cell_vertices, mesh.region_c, mesh.region_names,
            tuple(media_of(self._problem)),
        )  # fmt: skip
        write_design(path, run, read_rows(path), polygons, self._result.density_c, fields, frames)
