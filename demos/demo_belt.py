#!/usr/bin/env python3
"""A belt on a drum: tension that grows exponentially along the wrap.

A belt lies around half of a drum that does not turn; a weight pulls at its tail, and its head is pulled until the
belt slides, then let back until it slides the other way (`demos/problems/belt.toml`). The capstan's formula for a
belt that is thin against the drum's radius $R$ says

$$T = T_0 \\, e^{\\pm \\mu_f \\theta}, \\qquad p = T / R.$$

In a belt of thickness $H$ friction acts at $R$ and tension at $R + H / 2$; moments about the drum's axis leave
$\\mu_f R / (R + H / 2)$ in place of $\\mu_f$ in the exponent. Both are compared: the forces at the belt's ends, which
include what happens at both ends of the wrap, and the growth of the pressure along it.

    python demos/demo_belt.py            # friction 0.1 and 0.3, a minute
    python demos/demo_belt.py --quick    # coarser cells and longer steps, 0.3 only
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from tmc_vem import RunResult, run
from tmc_vem.simulation.problem_file import read_problem

Float = NDArray[np.float64]

PROBLEM = Path(__file__).parent / "problems" / "belt.toml"
RADIUS, THICKNESS, WRAP = 1.0, 0.04, math.pi
WEIGHT = 0.1  # force at the tail
COARSE = {"mesh.size": 0.04}
MARGIN = math.radians(20.0)  # of the wrap, left out at both ends where the growth of the pressure is measured
TURNS = {"pulled": 2.0, "let back": 4.0}  # times at the end of which the belt slides towards the head, and away from it


def exponent(friction: float, thickness: float = THICKNESS) -> float:
    """Growth of ln T per angle where a belt slides towards the end with the larger tension."""
    return friction * RADIUS / (RADIUS + 0.5 * thickness)


@dataclass(frozen=True)
class Found:
    """A state in which the belt slides.

    Attributes:
        ratio: force at the head over that at the tail.
        angle, pressure: (n,) of the stations on the belt's face, the angle from the tail's end of the wrap.
    """

    ratio: float
    angle: Float
    pressure: Float

    @staticmethod
    def at(result: RunResult, time: float) -> Found:
        """State at a time."""
        step = min(result.history, key=lambda step: abs(step.load - time))
        curves = result.traction(time)
        on_face = np.flatnonzero((np.hypot(*curves.reference_nx.T) < RADIUS + 1.5 * THICKNESS) & (curves.reference_nx[:, 1] > 0.0))
        angle = np.arctan2(curves.point_nx[on_face, 1], curves.point_nx[on_face, 0])
        order = np.argsort(angle)
        return Found(-step.forces["pull"]["reaction"] / WEIGHT, angle[order], curves.pressure_n[on_face][order])

    @property
    def growth(self) -> float:
        """Growth of the logarithm of the pressure per angle."""
        inner = (self.angle > MARGIN) & (self.angle < WRAP - MARGIN)
        return float(np.polyfit(self.angle[inner], np.log(self.pressure[inner]), 1)[0])


def solve(friction: float, out: Path, quick: bool) -> dict[str, Found]:
    """Run with one coefficient; the states in which the belt slides either way."""
    problem, options = read_problem(PROBLEM, {"regions.layer.medium.friction": friction, **(COARSE if quick else {})})
    options = replace(options, overwrite=True, largest_step=0.2 if quick else options.largest_step)
    result = run(problem, out, replace(options, output_loads=tuple(TURNS.values())))
    assert result.complete, result.reason
    return {name: Found.at(result, time) for name, time in TURNS.items()}


def draw(runs: dict[float, dict[str, Found]], path: Path) -> None:
    """Pressures along the wrap, and exponentials through their middle."""
    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    axes = figure.subplots()
    theta = np.linspace(0.0, WRAP, 100)
    known = "capstan"
    for n, (friction, states) in enumerate(runs.items()):
        for (name, found), sign, mark in zip(states.items(), (1.0, -1.0), "ox", strict=True):
            axes.plot(np.degrees(found.angle), found.pressure, mark, color=f"C{n}", markersize=3, linewidth=0.7,
                      label=f"friction {friction:g}, {name}")  # fmt: skip
            pressure = WEIGHT / RADIUS * np.exp(sign * exponent(friction) * theta)
            axes.plot(np.degrees(theta), pressure, "k-", linewidth=0.8, label=known)
            known = "_"
    axes.set(xlabel="angle from the tail (degrees)", ylabel="pressure on the belt", yscale="log",
             ylim=(0.2 * WEIGHT / RADIUS, 5.0 * WEIGHT / RADIUS))  # fmt: skip
    axes.legend(frameon=False, ncols=2)
    figure.savefig(path, dpi=150)


def main() -> None:
    """Run, compare and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="coarser cells, longer steps, one coefficient")
    parser.add_argument("--out", type=Path, default=Path("runs/demo_belt"), help="where the run directories go")
    options = parser.parse_args()
    frictions = [0.3] if options.quick else [0.1, 0.3]
    runs = {friction: solve(friction, options.out / f"friction-{friction:g}", options.quick) for friction in frictions}
    table = Table(title="A belt around half of a drum", box=SIMPLE, padding=(0, 0))
    for heading in ("friction", "", "head / tail", "capstan", "to it", "growth of p", "capstan", "to it"):
        table.add_column(heading, justify="right", no_wrap=True)
    for friction, states in runs.items():
        for (name, found), sign in zip(states.items(), (1.0, -1.0), strict=True):
            rate = sign * exponent(friction)
            ratio = math.exp(rate * WRAP)
            known = (f"{value / truth - 1.0:+.1%}" for value, truth in ((found.ratio, ratio), (found.growth, rate)))
            table.add_row(f"{friction:g}", name, f"{found.ratio:.4f}", f"{ratio:.4f}", next(known),
                          f"{found.growth:+.4f}", f"{rate:+.4f}", next(known))  # fmt: skip
            assert abs(found.growth / rate - 1.0) < (0.1 if options.quick else 0.05), (
                f"{found.growth:.4f}, not {rate:.4f}"
            )
    draw(runs, options.out / "belt.png")
    console = Console()
    console.print(table)
    console.print(f"picture: {options.out}/belt.png", highlight=False, soft_wrap=True)


if __name__ == "__main__":
    main()
