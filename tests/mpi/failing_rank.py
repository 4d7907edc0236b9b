"""Run under mpirun: a kernel that fails on one rank cuts the load step on all of them, and the run goes on.

One failure is an error of the kernel (no memory), the other a value that is not a number.
"""

from __future__ import annotations

import dataclasses
import functools
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from helpers_system import problem_system

from tmc_vem.problems import Box, Medium
from tmc_vem.solve.newton import NewtonSolver
from tmc_vem.solve.stepping import LoadStepper, SteppingOptions
from tmc_vem.support.errors import TmcError

comm = MPI.COMM_WORLD
# calls of the kernel that fail
FAILURES = {
    "no memory": (5, 6),
    "no memory for a tangent": (5,),
    "not a number": (7, 8, 9),
    "for good": range(20, 9999),
}


class Failing:
    """A kernel that does what the wrapped one does, except in some of its calls."""

    def __init__(self, kernel: Any, failure: str) -> None:
        self._kernel, self._failure, self._calls = kernel, failure, 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._kernel, name)

    def cells(self, batch: Any, u_ni: Any, parameters: Any, residual_ni: Any = None, tangents: Any = None) -> Any:
        if self._failure != "no memory for a tangent" or tangents is not None:
            self._calls += 1
            if self._calls in FAILURES[self._failure] and self._failure != "not a number":
                raise MemoryError("kernel 'solid' could not allocate its work space")
        values = self._kernel.cells(batch, u_ni, parameters, residual_ni, tangents)
        if self._failure == "not a number" and self._calls in FAILURES[self._failure]:
            values.min_j_c[0] = np.nan
        return values


report = {}
for failure in FAILURES:
    system = problem_system(Box(cells=(20, 5), medium=Medium(gamma=1e-4), uy=-0.1))
    if comm.rank == comm.size - 1:
        first, *others = system.blocks
        system.blocks = [dataclasses.replace(first, kernel=Failing(first.kernel, failure)), *others]
    steps: list[Any] = []
    stepper = LoadStepper(NewtonSolver(system), SteppingOptions(steps=4))
    stepper.on_step = functools.partial(lambda steps, step, *_: steps.append(step), steps)
    try:
        outcome = stepper.run(system.create_vector())
        complete, reason = outcome.complete, outcome.reason
    except TmcError as error:
        complete, reason = False, str(error)
    report[failure] = comm.allgather([complete, sum(step.cut_backs for step in steps), reason])
if comm.rank == 0:
    print(json.dumps(report))
