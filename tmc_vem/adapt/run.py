"""The way into a run: on the mesh as it is, or on one that is adapted first."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tmc_vem.problems.base import Problem
from tmc_vem.results.run_result import RunResult
from tmc_vem.simulation import simulation
from tmc_vem.simulation.monitor import Monitor
from tmc_vem.simulation.options import RunOptions
from tmc_vem.support.distributed import Comm


def run(
    problem: Problem,
    out: str | Path | None = None,
    options: RunOptions | None = None,
    *,
    comm: Comm | None = None,
    monitor: Monitor | None = None,
    resume: bool = False,
    command: Mapping[str, Any] | None = None,
) -> RunResult:
    """Solve a problem up to full load; where the options say so, on a mesh that is adapted to results.

    Args:
        problem: what to solve, for example ``Box()``.
        out: run directory for results, fields and a picture; None keeps the result in memory only.
        options: discretisation and load stepping, and in ``adapt`` what the mesh is adapted to.
        comm: MPI communicator, all ranks by default.
        monitor: hears about progress; called on rank 0 only.
        resume: go on from what is in ``out``; problem and options must be those it was made with.
        command: what the command line was asked, kept in the run directory so that ``tmc-vem resume`` can ask it again.

    Returns:
        The result on every rank; with an adapted mesh, ``adaptivity`` has the rounds and the estimated errors. If the
        load could not be applied in full, ``complete`` is False and ``reason`` says why.

    Raises:
        InputError: the problem, the options or the output directory are wrong; nothing is written then.
        CodegenError: an energy's kernel cannot be made.
        Interrupted: Ctrl-C or SIGTERM; what is needed to go on is in the run directory.
    """
    options = options or RunOptions()
    if not options.adapt.names:
        return simulation.run(problem, out, options, comm=comm, monitor=monitor, resume=resume, command=command)
    from tmc_vem.adapt.adaption import adapted_run  # what other runs need not wait for

    return adapted_run(problem, out, options, comm=comm, monitor=monitor, resume=resume, command=command)
