"""Rounds of solving, estimating and refining, at one load after another, on one rank."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from tmc_vem.adapt.carried import carried
from tmc_vem.adapt.changes import NextMesh, every_cell_cut, next_mesh
from tmc_vem.adapt.estimate import Estimate
from tmc_vem.adapt.recovered import recovered_estimate
from tmc_vem.adapt.refined import refined_estimate
from tmc_vem.adapt.solved import NotReached, Solved, let_go, loaded, loaded_further, prepared
from tmc_vem.mesh.make.change import CellTree
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems.base import Problem
from tmc_vem.problems.on_mesh import OnMesh
from tmc_vem.results.adaptivity import SOLVED, Round
from tmc_vem.simulation.adapt_settings import ANEW, RECOVERY, AdaptSettings
from tmc_vem.simulation.adaptable import ENERGY, REACTION, fitted
from tmc_vem.simulation.monitor import Monitor, OnTheWay
from tmc_vem.simulation.options import RunOptions
from tmc_vem.simulation.plan import loads_of
from tmc_vem.simulation.simulation import Simulation
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]

# Iterations that loading a next mesh from the beginning may take: so many, or that many times those of meshes before.
FEW, MORE = 200, 3
Prepared = tuple[Simulation, PolygonMesh]
NO_LIMIT = (
    "the cells that matter have been cut so often that they are at a load, a support or a corner where results have no "
    "limit under refinement: load or hold an edge, or round the corner"
)
CONVERGED = "the estimated errors are within the tolerance"


@dataclass(frozen=True)
class Standing:
    """Where the rounds stand: with it they go on.

    Attributes:
        solved: the state of the round that comes next.
        tree: of its mesh.
        before: energy and reaction before the state came to this mesh; empty if it did not.
        target: number of the load.
        at_target: rounds before at this load.
        rounds: all before.
        missed: why the tolerance was not reached at loads before, in sentences.
    """

    solved: Solved
    tree: CellTree
    before: Mapping[str, float] = field(default_factory=dict)
    target: int = 0
    at_target: int = 0
    rounds: tuple[Round, ...] = ()
    missed: tuple[str, ...] = ()


@dataclass(frozen=True)
class Finished:
    """What the rounds have led to.

    Attributes:
        mesh: the last one.
        rounds: all.
        reached: whether errors are within the tolerance at all loads.
        reason: why there are no more.
    """

    mesh: PolygonMesh
    rounds: tuple[Round, ...]
    reached: bool
    reason: str


@dataclass(frozen=True)
class _Following:
    """The next mesh, and the state there."""

    chosen: NextMesh
    solved: Solved


class Watcher:
    """Hears of rounds; all methods may be overridden."""

    def done(self, round_: Round, solved: Solved, estimate: Estimate) -> None:
        """A round is over."""

    def stands(self, standing: Standing) -> None:
        """The state of the next round is there."""


class Rounds:
    """Makes the rounds.

    Args:
        problem: whose mesh is adapted.
        options: how it is discretised and solved; ``adapt`` says how far.
        targets: load factors, from small to large; None for the end of the path.
        watcher: hears of every round.
        monitor: hears of loads that are gone to from the beginning.
    """

    def __init__(
        self, problem: Problem, options: RunOptions, targets: tuple[float | None, ...], watcher: Watcher,
        monitor: Monitor | None = None,
    ) -> None:  # fmt: skip
        self._problem, self._settings = problem, options.adapt
        self._monitor = None if monitor is None else OnTheWay(monitor)
        self._options, self._targets, self._watcher = _plain(options), targets, watcher

    def prepared(self) -> Prepared:
        """What is gone through on the first mesh.

        Raises:
            InputError: something about the problem is wrong.
        """
        mesh = fitted(self._problem)[1]
        return self._to_load(OnMesh(self._problem, mesh), 0, self._options.max_iterations), mesh

    def begin(self, first: Prepared | None = None) -> Standing:
        """The state on the first mesh, which may be prepared already.

        Raises:
            NotReached: the load could not be applied in full.
        """
        simulation, mesh = first or self.prepared()
        return Standing(loaded(simulation, mesh), CellTree.of(mesh))

    def go(self, standing: Standing) -> Finished:
        """Go on to the end.

        Raises:
            TmcError: the watcher's.
        """
        while True:
            self._watcher.stands(standing)
            following = self._round(standing)
            if isinstance(following, Finished):
                return following
            standing = following
            let_go()

    def _round(self, standing: Standing) -> Standing | Finished:
        began, solved = time.perf_counter(), standing.solved
        estimate = self._estimate(standing)
        round_ = Round(
            number=len(standing.rounds), load=solved.position.load, n_cells=solved.mesh.n_cells,
            n_dofs=solved.simulation.n_dofs, values=estimate.values, errors=estimate.errors, estimate=estimate.kind,
            doubt=estimate.doubt, found=solved.found, iterations=solved.iterations, before=standing.before,
            refined_dofs=estimate.n_dofs, refined_iterations=estimate.iterations,
        )  # fmt: skip
        following, why = None, self._end_of_target(standing, round_, estimate)
        if not why:
            following, why = self._following(standing, estimate)
        if following is not None:
            round_ = replace(round_, refined=following.chosen.n_refined)
        round_ = replace(round_, seconds=time.perf_counter() - began)
        self._watcher.done(round_, solved, estimate)
        if following is None:
            return self._next_target(standing, round_, why)
        before = {name: round_.values[name] for name in (ENERGY, REACTION) if name in round_.values}
        return replace(
            standing, solved=following.solved, tree=following.chosen.change.tree, before=before,
            at_target=standing.at_target + 1, rounds=(*standing.rounds, round_),
        )  # fmt: skip

    def _following(self, standing: Standing, estimate: Estimate) -> tuple[_Following | None, str]:
        """The next mesh with the state there; or None, and why there is none."""
        names, settings, solved = self._settings.names, self._settings, standing.solved
        contributions_c = estimate.relative_indicators(names)
        try:
            chosen = next_mesh(
                self._problem, solved.mesh, standing.tree, contributions_c, estimate.largest(names), settings.relative,
                anew=settings.meshes == ANEW,
            )  # fmt: skip
            if not chosen.n_refined:
                return None, NO_LIMIT
            n_cells = chosen.change.mesh.n_cells
            if n_cells > settings.cells:
                return None, f"the next mesh would have {n_cells} cells, and {settings.cells} are allowed"
            moved = self._carried(standing, chosen)
        except NotReached as error:
            return None, f"no equilibrium was found on the next mesh, with {n_cells} cells: {error}"
        except InputError as error:
            return None, f"the next mesh could not be made: {error}"
        return _Following(chosen, moved), ""

    def _estimate(self, standing: Standing) -> Estimate:
        """Errors on a mesh."""
        names, solved = self._settings.names, standing.solved
        if self._settings.estimator == RECOVERY:
            return recovered_estimate(solved, names)
        try:
            change = every_cell_cut(self._problem, solved.mesh, standing.tree)
            problem = OnMesh(self._problem, change.mesh)
            return refined_estimate(solved, names, change, problem, partial(self._from_start, standing))
        except NotReached as error:
            estimate = recovered_estimate(solved, names)
            return replace(estimate, doubt=f"{estimate.doubt}: {error}")

    def _end_of_target(self, standing: Standing, round_: Round, estimate: Estimate) -> str:
        """Why no further round is made at this load; empty if one is."""
        for name in self._settings.names:
            if not np.isfinite(estimate.values[name]):
                return f"'{name}' is no finite number there, and nothing can be adapted to it"
        if estimate.within(self._settings.names, self._settings.relative) and self._is_sure(standing, round_):
            return CONVERGED
        if standing.at_target >= self._settings.rounds:
            most = self._settings.rounds
            only = "1 round was made, which is all that is allowed"
            return only if most == 1 else f"{most} rounds were made, as many as are allowed"
        return ""

    def _is_sure(self, standing: Standing, round_: Round) -> bool:
        """Whether an estimate can be believed: where the refined problem was not solved, only if the results have not
        moved by more than the tolerance since the round before."""
        if round_.estimate == SOLVED:
            return True
        if not standing.at_target:
            return False
        before, now = standing.rounds[-1].values, round_.values
        tolerance = self._settings.relative
        return all(abs(now[name] - before[name]) <= tolerance * abs(now[name]) for name in self._settings.names)

    def _next_target(self, standing: Standing, round_: Round, why: str) -> Standing | Finished:
        """Go on to the next load, or end."""
        rounds, missed = (*standing.rounds, round_), standing.missed
        if why != CONVERGED:
            missed = (*missed, f"at load {round_.load:g}, {why}")
        target = standing.target + 1
        if target == len(self._targets):
            reason = "; ".join(missed) or CONVERGED
            return Finished(standing.solved.mesh, rounds, not missed, reason)
        load = self._targets[target]
        assert load is not None  # the end of the path is a load where there are several
        try:
            solved = loaded_further(standing.solved, load)
        except NotReached as error:
            return Finished(standing.solved.mesh, rounds, False, "; ".join((*missed, str(error))))
        return replace(
            standing, solved=solved, before={}, target=target, at_target=0, rounds=rounds, missed=missed
        )  # fmt: skip

    def _to_load(self, problem: OnMesh, target: int, most_iterations: int | None) -> Simulation:
        """What goes to a load from the beginning."""
        load, options = self._targets[target], replace(self._options, max_iterations=most_iterations)
        if load is not None:
            outputs = tuple(each for each in options.output_loads if each <= load)
            options = replace(options, path=(0.0, load), output_loads=outputs)
            if loads_of(problem, options)[-1] != load:  # the usual path ends where the histories do
                options = replace(options, path=(0.0, 0.5 * load, load))
        return prepared(problem, options, self._monitor)

    def _carried(self, standing: Standing, chosen: NextMesh) -> Solved:
        """Equilibrium on the next mesh: from the state of this one, or from the beginning where that fails."""
        change = chosen.change
        problem = OnMesh(self._problem, change.mesh)
        try:
            return carried(standing.solved, change, problem, nested=chosen.nested)
        except NotReached:
            return self._from_start(standing, problem)

    def _from_start(self, standing: Standing, problem: OnMesh) -> Solved:
        """Equilibrium at the load of a state on another mesh, gone to from the beginning.

        Raises:
            NotReached: there is none, or it takes many more iterations than on the meshes before.
        """
        before = [standing.solved.iterations, *(each.iterations for each in standing.rounds)]
        most = max(FEW, MORE * max(before))
        return loaded(self._to_load(problem, standing.target, most), problem.mesh)


def _plain(options: RunOptions) -> RunOptions:
    """Options of the runs on the way: nothing is done beside their path."""
    return replace(options, adapt=AdaptSettings(), extrapolate_gamma=False)
