"""What friction costs: energy, residual and tangent without it, where nothing is squeezed yet, and at all points.

    python benchmarks/friction_cost.py [--n-dofs 16000] [--repetitions 9]

Every repetition does the same work on the same mesh in turn, and the ratios are those of pairs, so that a busy moment
falls on both. A layer is squeezed to a twentieth and sheared, until half of its points slide; in a run few cells are
squeezed, so that what is measured at all points is an upper bound. The beginning of a step is compared with a tangent.
"""

from __future__ import annotations

import argparse
import statistics
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from harness import Samples, interleaved, report
from meshes import DOFS_PER_CELL, ENERGIES, VALUES, square
from mpi4py import MPI
from numpy.typing import NDArray

from codegen.stress import stress_of
from tmc_vem.energy import DENSITIES
from tmc_vem.mesh.spread.distribute import distribute
from tmc_vem.problems.base import RegionEnergy
from tmc_vem.simulation.discretised import compile_region
from tmc_vem.support.memory import reuse_freed
from tmc_vem.system.friction import Friction, FrictionLaw
from tmc_vem.vem.blocks import RegionKernel
from tmc_vem.vem.system import VemSystem

STATES = ("without", "not squeezed", "at all points")
PARTS = ("energy", "residual", "tangent")


def squeezed(points: NDArray[np.float64], slip: float) -> NDArray[np.float64]:
    """Displacement of points (n, 2) of a layer whose shear varies along it."""
    x, y = points.T
    return np.stack([slip * np.sin(7.0 * x) * y, -0.95 * y], axis=1)


def system_of(kind: str, name: str, n_dofs: float, friction: bool) -> VemSystem:
    """A square of one medium."""
    energy = DENSITIES[ENERGIES[name]]
    region = RegionEnergy(energy, {key: VALUES[key] for key in energy.parameters}, is_medium=True)
    made = RegionKernel(*compile_region(region))
    if friction:
        made = replace(made, friction=FrictionLaw(Friction(0.3), stress_of(region.integrand)))
    return VemSystem(distribute(MPI.COMM_WORLD, lambda: square(kind, n_dofs)), {"body": made})


def work(kind: str, name: str, n_dofs: float) -> tuple[dict[str, Callable[[], object]], float]:
    """What is timed, by state and part, and the part of the points that slide."""
    reuse_freed()
    found: dict[str, Callable[[], object]] = {}
    slides = 0.0
    for state in STATES:
        system = system_of(kind, name, n_dofs, friction=state != "without")
        points = system.node_labels()[:, :2]
        u, out, matrix = system.create_vector(), system.create_vector(), system.create_matrix()
        u.getArray()[:] = squeezed(points, 0.02).ravel()
        if state == "at all points":
            before = system.create_vector()
            before.getArray()[:] = squeezed(points, 0.0).ravel()
            system.advance(before)
            sticks = np.concatenate([s.response.sticks.ravel() for s in system.friction_states(u)])
            slides = 1.0 - sticks.mean()
            assert all((s.slip.bound > 0.0).all() for s in system.friction_states(u))
            found["beginning of a step"] = lambda system=system, before=before: system.advance(before)  # type: ignore[misc]
        found[f"energy, {state}"] = lambda system=system, u=u: system.energy(u)  # type: ignore[misc]
        found[f"residual, {state}"] = lambda system=system, u=u, out=out: system.residual(u, out)  # type: ignore[misc]
        found[f"tangent, {state}"] = lambda system=system, u=u, matrix=matrix: system.jacobian(u, matrix)  # type: ignore[misc]
    return found, slides


def ratio(one: Samples, other: Samples) -> float:
    """Median of the ratios of pairs."""
    return statistics.median(a / b for a, b in zip(one.seconds, other.seconds, strict=True))


def measure(kind: str, name: str, n_dofs: float, repetitions: int) -> dict[str, Any]:
    """Ratios to the times without friction, and the time of the beginning of a step in tangents."""
    pieces, slides = work(kind, name, n_dofs)
    samples = interleaved(pieces, repetitions)
    found: dict[str, Any] = {"cells": kind, "density": name, "slides": slides}
    for part in PARTS:
        without = samples[f"{part}, without"]
        found[part] = {state: ratio(samples[f"{part}, {state}"], without) for state in STATES[1:]}
        found[part]["seconds"] = without.median
    found["begin"] = ratio(samples["beginning of a step"], samples["tangent, without"])
    return found


def main() -> None:
    """Print ratios and write them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--n-dofs", type=float, default=16000.0)
    parser.add_argument("--repetitions", type=int, default=9)
    parser.add_argument("--energies", nargs="+", default=["huhu_lulu", "angle"])
    arguments = parser.parse_args()
    results = [
        measure(kind, name, arguments.n_dofs, arguments.repetitions)
        for name in arguments.energies
        for kind in DOFS_PER_CELL
    ]
    rows = []
    for r in results:
        ratios = [f"{r[part][state]:.2f}" for part in PARTS for state in STATES[1:]]
        rows.append((f"{r['density']}, {r['cells']}", f"{100 * r['slides']:.0f} %", *ratios, f"{r['begin']:.2f}"))
    heads = [f"{part}: {state}" for part in PARTS for state in STATES[1:]]
    columns = ("energy, cells", "sliding", *heads, "new step, in tangents")
    report(
        "friction_cost", "Time with friction over time without, medians of pairs", columns, rows, {"results": results}
    )


if __name__ == "__main__":
    main()
