"""A load case of a design: solved again and again for other stiffnesses, from the last state where that is possible.

A design that changes little moves its equilibrium little. So the last state is where Newton's method begins, at full
load; the state that it finds has to be stable and near, else the load is applied anew from the beginning. As a state
that was followed from design to design can be on another branch than the one that loading leads to, the whole path is
gone through now and then too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from tmc_vem.problems.base import Problem
from tmc_vem.problems.design_region import design_regions
from tmc_vem.sensitivity.equilibrium import Equilibrium, SingularTangent
from tmc_vem.sensitivity.functionals import functional_of
from tmc_vem.sensitivity.functionals_record import Functional
from tmc_vem.sensitivity.gradient import Gradients
from tmc_vem.simulation.options import RunOptions
from tmc_vem.simulation.overlap import OverlapWatch
from tmc_vem.simulation.plan import control_path
from tmc_vem.simulation.simulation import prepare, stepping_of
from tmc_vem.solve.budget import Budget, OutOfBudget
from tmc_vem.solve.newton import Iteration, OnIteration
from tmc_vem.solve.stepping import LoadStepper, Step
from tmc_vem.support.distributed import Comm, Vec
from tmc_vem.support.errors import EvaluationError, InputError
from tmc_vem.support.petsc import PETSc

Float = NDArray[np.float64]

INFINITY = 3  # PETSc's number of this norm
PARTS = (1, 4)  # in which a design is changed to the next one, if the first does not do
MOST_ITERATIONS = 500  # of Newton's method for one load case of a design, unless max_iterations says otherwise
FAR = 0.1  # of the mesh's size: a state that has moved further between two designs is looked at again from load 0
SAME = 1e-5  # relative: results of the same state, found in two ways


@dataclass(frozen=True)
class Solved:
    """A load case in equilibrium at full load.

    Attributes:
        values: of the results that were asked for, by name.
        by_stiffness: (n_cells of the whole mesh,) derivatives of each by the stiffness of every cell, by name.
        iterations: of Newton's method.
        from_start: whether the load was applied from the beginning.
        jumped: whether a branch ended on the way.
        note: what is to be said about it; empty for nothing.
    """

    values: Mapping[str, float]
    by_stiffness: Mapping[str, Float]
    iterations: int
    from_start: bool
    jumped: bool = False
    note: str = ""


class _NotReached(Exception):
    """The load could not be applied in full."""


class LoadCase:
    """A problem whose design regions get other stiffnesses; all ranks make and use it together.

    Args:
        name: of the case.
        problem, options: what is solved.
        wanted: names of results.
        comm: ranks.

    Raises:
        InputError: the problem has no design region, or a result has no derivative.

    Attributes:
        system: the discretisation.
        u: the last state at full load; None before there is one.
        stiffness_c: (n_cells of the whole mesh,) the design that it is of.
        on_iteration: called after every Newton iteration; what it raises ends the work.
        why_not: why no equilibrium was found for the last design; empty if one was.
    """

    def __init__(self, name: str, problem: Problem, options: RunOptions, wanted: tuple[str, ...], comm: Comm) -> None:
        self.name, self._problem, self._options, self._wanted = name, problem, options, wanted
        self._regions = design_regions(problem.regions())
        if not self._regions:
            raise InputError(
                f"load case '{name}': no region has both a solid and a medium, so that nothing is designed"
            )
        if options.follow:
            raise InputError("follow does not go with a design, whose results are those at full load: leave it out")
        simulation = prepare(problem, None, options, comm=comm)
        assert isinstance(simulation.solver.admission, OverlapWatch)
        self._watch = simulation.solver.admission
        self.system, self._solver = simulation.system, simulation.solver
        self._path, self._stepping = control_path(problem, options), stepping_of(options)
        self._end = self._path.at(self._path.end)
        self._functionals: dict[object, Functional] = {
            name: functional_of(name, problem, self.system) for name in wanted
        }
        for _ in self.system.parameter_derivatives(self.system.create_vector()):  # those that are refused, at once
            break
        self.u: Vec | None = None
        self.stiffness_c: Float | None = None
        self.on_iteration: OnIteration | None = None
        self.why_not = ""

    @property
    def shift(self) -> float:
        """What Newton's method remembers besides the state: the last shift of an indefinite tangent."""
        return self._solver.last_shift

    @property
    def watched(self) -> tuple[bool, bool]:
        """Whether solids are watched for overlaps by now, and whether some have crossed."""
        return self._watch.is_active, self._watch.crossed

    def remember(self, u: Vec | None, stiffness_c: Float | None, shift: float, watched: tuple[bool, bool]) -> None:
        """Go on from the last state of a search that was stopped."""
        self.u, self.stiffness_c, self._solver.last_shift = u, stiffness_c, shift
        self._watch.is_active, self._watch.crossed = watched

    def solve(self, stiffness_c: Float, *, from_start: bool = False) -> Solved | None:
        """Equilibrium at full load with stiffnesses (n_cells of the whole mesh,), from 0 to 1; those of cells that are
        not of design regions are not read.

        Args:
            stiffness_c: the design.
            from_start: apply the load from the beginning, whatever state there is.

        Returns:
            None if no equilibrium was found.
        """
        PETSc.garbage_cleanup(self.system.comm)  # vectors of the design before, which petsc4py only puts aside
        mine = self._mine(stiffness_c)
        before = self._solver.iterations_done
        budget = Budget(self._options.max_iterations or MOST_ITERATIONS)
        self.why_not = ""
        try:
            warm = not from_start and self.u is not None and any(self._follow(mine, parts, budget) for parts in PARTS)
            self._set(mine)
            jumped = False if warm else self._load(budget)
        except (OutOfBudget, _NotReached) as error:
            limit = "; max_iterations is the limit for one design" if budget.used_up else ""
            self.why_not = f"{error}{limit}"
            return None
        self.stiffness_c = stiffness_c.copy()
        try:
            values, by_stiffness = self._results()
        except SingularTangent as error:
            self.why_not = str(error)
            return None
        iterations = self._solver.iterations_done - before
        note = f"{self.name}: a branch ended on the way to full load" if jumped else ""
        return Solved(values, by_stiffness, iterations, not warm, jumped, note)

    def displacements(self) -> Float:
        """(n_points, 2) displacements of this rank's output polygons at the last state."""
        assert self.u is not None
        return self.system.output_displacements(self.u)

    # -- parts -----------------------------------------------------------------------------------------------------

    def _mine(self, stiffness_c: Float) -> Float:
        """(n_cells of this rank, 1) of stiffnesses (n_cells of the whole mesh,)."""
        mine_c1: Float = stiffness_c[self.system.cell_numbers()][:, None]
        return mine_c1

    def _spending(self, budget: Budget) -> OnIteration:
        def on_iteration(iteration: Iteration, done: int) -> None:
            if self.on_iteration is not None:
                self.on_iteration(iteration, done)
            budget.spend()

        return on_iteration

    def _set(self, stiffness_c1: Float) -> None:
        for region in self._regions:
            self.system.set_factors(region, stiffness_c1)

    def _follow(self, stiffness_c1: Float, parts: int, budget: Budget) -> bool:
        """Go to equilibrium from the last state, the design changing in some equal parts; False if that leads nowhere,
        far away, or to an unstable state.

        Raises:
            OutOfBudget: of iterations.
        """
        assert self.u is not None
        assert self.stiffness_c is not None
        before_c1 = self._mine(self.stiffness_c)
        if self._end.parameters:  # a load that could not be applied may have left others
            self.system.set_parameters(self._end.parameters)
        u, moved = self.u.copy(), self.u.duplicate()
        for part in range(1, parts + 1):
            between_c1 = before_c1 + (part / parts) * (stiffness_c1 - before_c1)
            self._set(stiffness_c1 if part == parts else between_c1)
            trial = u.copy()
            self._solver.set_prescribed(trial, self._end)
            try:
                result = self._solver.solve(trial, on_iteration=self._spending(budget))
            except EvaluationError:
                return False
            moved.waxpy(-1.0, u, trial)
            if not result.converged or result.negative_pivots or moved.norm(INFINITY) > FAR * self.system.size:
                return False
            u = trial
        self.u = u
        return True

    def _load(self, budget: Budget) -> bool:
        """Apply the load step by step; whether a branch ended on the way.

        Raises:
            OutOfBudget: of iterations.
            _NotReached: the load could not be applied in full.
        """
        u, jumps = self.system.create_vector(), []

        def on_step(step: Step, *_: object) -> None:
            jumps.append(step.jumped)

        self._solver.last_shift = 0.0
        if self._end.parameters:
            self.system.set_parameters(self._path.at(0.0).parameters)
        stepper = LoadStepper(
            self._solver, self._stepping, on_step, control_path(self._problem, self._options),
            on_iteration=self._spending(budget),
        )  # fmt: skip
        outcome = stepper.run(u)
        if not outcome.complete:
            raise _NotReached(f"the load stopped at {outcome.load:.4g}: {outcome.reason}")
        self.u = u
        return any(jumps)

    def _results(self) -> tuple[dict[str, float], dict[str, Float]]:
        assert self.u is not None
        equilibrium = Equilibrium(self._solver, self.system, self.u, self._end, partial(self._watch.behind, self.u))
        gradients = Gradients(self._problem, equilibrium, self._functionals)
        values, slopes = {}, {}
        for name in self._wanted:
            found = gradients.sensitivity(name)
            values[name] = found.value
            slopes[name] = gradients.by_stiffness(found, self._regions)
        return values, slopes
