"""What there is to say about a design before it is looked for: all that a search checks first, and its sizes."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from mpi4py import MPI

from tmc_vem.design.evaluator import CELLS_OF_FILTER, Evaluator
from tmc_vem.design.projection import Continuation
from tmc_vem.mesh.cells import centroids_and_areas
from tmc_vem.problems.own import OwnProblem
from tmc_vem.simulation.options import RunOptions

# Radius of a filter in sizes of cells below which it reaches no neighbour, or next to none.
SMALL = 1.5
# Density between solid and void for which cautions look at the stiffness.
MIDDLE, SOFT = 0.5, 1e-3


@dataclass(frozen=True)
class DesignCheckup:
    """A design that passes all checks of a search, in numbers.

    Attributes:
        what: what is made small or large, in words.
        n_cells, n_variables: cells of the design regions, and what varies of them.
        area: of the design regions.
        limits: names of all limits.
        cases: names of load cases; none if there is but one.
        method, iterations: of the search.
        filter_radius: None without a filter.
        cell_size: median of the square roots of the areas of the design's cells.
        betas: of the projection, in the order of its levels; those that the evaluations suffice for.
        cautions: what may go wrong, each with its remedy.
    """

    what: str
    n_cells: int
    n_variables: int
    area: float
    limits: tuple[str, ...]
    cases: tuple[str, ...]
    method: str
    iterations: int
    filter_radius: float | None
    cell_size: float
    betas: tuple[float, ...]
    cautions: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """As plain values."""
        return {name: list(v) if isinstance(v, tuple) else v for name, v in asdict(self).items()}

    def lines(self) -> list[str]:
        """In words."""
        radius = "no filter"
        if self.filter_radius is not None:
            radius = f"filter of radius {self.filter_radius:.4g}, {self.filter_radius / self.cell_size:.3g} cells"
        betas = f", projection with beta = {', '.join(f'{beta:g}' for beta in self.betas)}" if self.betas else ""
        limits, cases = ", ".join(self.limits) or "none", ", ".join(self.cases) or "the load of the file"
        return [
            f"design: {self.what}, {self.n_variables} variables in {self.n_cells} cells, area {self.area:.4g}",
            f"  limits: {limits}; load cases: {cases}",
            f"  {self.method}, up to {self.iterations} evaluations, {radius}{betas}",
        ]


def check_design(problem: OwnProblem, options: RunOptions) -> DesignCheckup:
    """Check the table ``[design]`` of a problem as a search would before its first design.

    Raises:
        InputError: a search would not begin.
    """
    evaluator = Evaluator(problem, options, MPI.COMM_WORLD)
    table, of = evaluator.table, evaluator.parametrisation
    size = float(np.sqrt(np.median(centroids_and_areas(evaluator.mesh)[1][of.cells])))
    radius = None if table.filter.kind == "none" else table.filter.radius or CELLS_OF_FILTER * size
    betas: list[float] = []
    planned: list[float] = []
    if table.projection is not None:
        of_levels = table.projection
        levels = Continuation(of_levels.first, of_levels.largest, every=of_levels.every, eta=of_levels.eta).levels()
        planned = [level.beta for level in levels]
        betas = planned[: -(-table.iterations // of_levels.every)]
    evaluator.start()
    return DesignCheckup(
        f"{'minimise' if table.minimise else 'maximise'} {table.objective}", len(of.cells), of.n_variables,
        float(of.area_c.sum()), evaluator.constraints, tuple(case for case in evaluator.cases if case), table.method,
        table.iterations, radius, size, tuple(betas), tuple(_cautions(evaluator, size, radius, betas, planned)),
    )  # fmt: skip


def _cautions(
    evaluator: Evaluator, size: float, radius: float | None, betas: list[float], planned: list[float]
) -> list[str]:
    found, table = [], evaluator.table
    if radius is None:
        found.append(
            "design: there is no filter: bars become as thin as cells, and on another mesh there is another design; "
            f"give filter = {{ radius = {3.0 * size:.3g} }}"
        )
    elif radius < SMALL * size:
        found.append(
            f"design: the filter's radius {radius:g} is {radius / size:.2g} of the cells' size {size:.3g}: it reaches "
            f"no neighbours; use {3.0 * size:.3g} or more, or smaller cells"
        )
    if len(betas) < len(planned):
        assert table.projection is not None
        enough, every = table.projection.every * len(planned), table.iterations // len(planned) or 1
        found.append(
            f"design: {table.iterations} evaluations end with beta = {betas[-1]:g}, not with {planned[-1]:g}: use "
            f"iterations = {enough}, or projection = {{ every = {every} }}"
        )
    if table.volume is None and not table.limits:
        found.append("design: there is no limit at all: give a volume, or limits of other results")
    middle = evaluator.parametrisation.interpolation.factor(np.array([MIDDLE]))[0]
    if middle < SOFT:
        found.append(
            f"design: a density of {MIDDLE:g} has a stiffness of {middle:.1e}: a design of that density collapses "
            "under its load; use a smaller p or q, or start with a higher density"
        )
    return found
