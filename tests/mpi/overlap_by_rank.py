"""Run under mpirun: what is said about states with and without overlap, by both methods, as JSON from rank 0."""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from helpers_blocks import blocks
from helpers_system import interpolate

from tmc_vem.simulation import RunOptions, discretise
from tmc_vem.simulation.overlap import OverlapWatch
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.system.discretisation import Evaluation, RegionValues

SQUEEZED = Evaluation(0.0, {"medium": RegionValues(0.0, 0.05)})


def lowered(amount: float) -> Callable[[Any], Any]:
    """The upper block is moved down as it is, and a little to the side."""

    def displacement(x: Any) -> Any:
        share = np.clip((x[:, 1] - 0.4) / 0.2, 0.0, 1.0)
        return np.column_stack([0.01 * share, -amount * share])

    return displacement


def words(refusal: Any) -> str:
    return refusal.sentence() if refusal else ""


def said(method: str) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as directory:
        problem, _ = read_problem(str(blocks(Path(directory), cells="quadrilaterals", size=0.1)))
    system = discretise(problem, RunOptions(method), MPI.COMM_WORLD)
    watch = OverlapWatch(system, ["medium"], 2)
    tolerant = OverlapWatch(system, ["medium"], 2, tolerated=True)
    states = [
        system.interpolate(lowered(amount)) if method == "fem" else interpolate(system, lowered(amount))
        for amount in (0.1, 0.25, 1.6)
    ]
    points = [np.array([0.5, 0.6]), np.array([0.5, 0.4])]
    now = [points[0] + [0.01, -0.25], points[1]]
    assert not tolerant.refusal(states[1], SQUEEZED)  # only states that are taken give gaps a sign
    return {
        "apart": words(watch.refusal(states[0], SQUEEZED)),
        "inside": words(watch.refusal(states[1], SQUEEZED)),
        "behind": tolerant.behind(states[1], points, now),
        "beyond": words(watch.refusal(states[2], SQUEEZED)),
        "jump": words(watch.refusal_of_jump(states[0], states[2])),
        "inverted": int(MPI.COMM_WORLD.allreduce(int((system.dense_jacobians(states[1]) <= 0.0).sum()))),
    }


report = {method: said(method) for method in ("vem", "fem")}
if MPI.COMM_WORLD.rank == 0:
    print(json.dumps(report))
