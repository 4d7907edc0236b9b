"""A load case of a design: solved again and again for other stiffnesses, from the last state where that is possible.

A design that changes little moves its equilibrium little. So the last state is where Newton's method begins, at full
load; the state that it finds has to be stable and near, else the load is applied anew from the beginning. As a state
that was followed from design to design can be on another branch than the one that loading leads to, the whole path is
gone through now and then too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.problems.base import Problem
from tmc_vem.problems.design_region import design_regions
from tmc_vem.sensitivity.equilibrium import Equilibrium, SingularTangent
from tmc_vem.sensitivity.functionals_record import Functional
from tmc_vem.sensitivity.gradient import Gradients
from tmc_vem.simulation.options import RunOptions
from tmc_vem.simulation.plan import control_path
from tmc_vem.simulation.simulation import prepare, stepping_of
from tmc_vem.solve.newton import OnIteration
from tmc_vem.solve.stepping import LoadStepper, Step
from tmc_vem.support.distributed import Comm, Vec
from tmc_vem.support.errors import EvaluationError, InputError

Float = NDArray[np.float64]

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
        on_iteration: called after every Newton iteration; what it raises ends the work.
    """

    def __init__(self, name: str, problem: Problem, options: RunOptions, wanted: tuple[str, ...], comm: Comm) -> None:
        self.name, self._problem, self._options, self._wanted = name, problem, options, wanted
        self._regions = design_regions(problem.regions())
        if not self._regions:
            raise InputError(
                f"load case '{name}': no region has both a solid and a medium, so that nothing is designed"
            )
        simulation = prepare(problem, None, options, comm=comm)
        self.system, self._solver = simulation.system, simulation.solver
        self._path, self._stepping = control_path(problem, options), stepping_of(options)
        self._end = self._path.at(self._path.end)
        self._functionals: dict[object, Functional] = {}
        self.u: Vec | None = None
        self.on_iteration: OnIteration | None = None

    @property
    def shift(self) -> float:
        """What Newton's method remembers besides the state: the last shift of an indefinite tangent."""
        return self._solver.last_shift

    def remember(self, u: Vec | None, shift: float) -> None:
        """Go on from the last state of a search that was stopped."""
        self.u, self._solver.last_shift = u, shift

    def solve(self, stiffness_c: Float, *, from_start: bool = False) -> Solved | None:
        """Equilibrium at full load with stiffnesses (n_cells of the whole mesh,), from 0 to 1; those of cells that are
        not of design regions are not read.

        Args:
            stiffness_c: the design.
            from_start: apply the load from the beginning, whatever state there is.

        Returns:
            None if no equilibrium was found.
        """
        mine = stiffness_c[self.system.cell_numbers()][:, None]
        for region in self._regions:
            self.system.set_factors(region, mine)
        before = self._solver.iterations_done
        warm = None if from_start or self.u is None else self._from_last()
        jumped = False
        if warm is None:
            found, jumped = self._from_beginning()
            if not found:
                return None
        try:
            values, by_stiffness = self._results()
        except SingularTangent:
            return None
        iterations = self._solver.iterations_done - before
        note = f"{self.name}: a branch ended on the way to full load" if jumped else ""
        return Solved(values, by_stiffness, iterations, warm is None, jumped, note)

    def displacements(self) -> Float:
        """(n_points, 2) displacements of this rank's output polygons at the last state."""
        assert self.u is not None
        return self.system.output_displacements(self.u)

    # -- parts -----------------------------------------------------------------------------------------------------

    def _from_last(self) -> bool | None:
        """Go to equilibrium from the last state; None if that leads nowhere, far away, or to an unstable state."""
        assert self.u is not None
        trial = self.u.copy()
        self._solver.set_prescribed(trial, self._end)
        try:
            result = self._solver.solve(trial, on_iteration=self.on_iteration)
        except EvaluationError:
            return None
        if not result.converged or result.negative_pivots:
            return None
        moved = trial.duplicate()
        moved.waxpy(-1.0, self.u, trial)
        if moved.norm(3) > FAR * self.system.size:  # 3 is PETSc's infinity norm
            return None
        self.u = trial
        return True

    def _from_beginning(self) -> tuple[bool, bool]:
        """Apply the load step by step; whether it could be in full, and whether a branch ended on the way."""
        u, jumps = self.system.create_vector(), []

        def on_step(step: Step, *_: object) -> None:
            jumps.append(step.jumped)

        self._solver.last_shift = 0.0
        path = control_path(self._problem, self._options)
        stepper = LoadStepper(self._solver, self._stepping, on_step, path, on_iteration=self.on_iteration)
        if self._end.parameters:
            self.system.set_parameters(self._path.at(0.0).parameters)
        outcome = stepper.run(u)
        if not outcome.complete:
            return False, any(jumps)
        self.u = u
        return True, any(jumps)

    def _results(self) -> tuple[dict[str, float], dict[str, Float]]:
        assert self.u is not None
        equilibrium = Equilibrium(self._solver, self.system, self.u, self._end)
        gradients = Gradients(self._problem, equilibrium, self._functionals)
        values, slopes = {}, {}
        for name in self._wanted:
            found = gradients.sensitivity(name)
            values[name] = found.value
            slopes[name] = gradients.by_stiffness(found, self._regions)
        return values, slopes
