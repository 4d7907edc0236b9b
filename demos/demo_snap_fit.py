#!/usr/bin/env python3
"""A snap-fit: the force that pushes its hook up the ramp, with and without friction.

The hook hangs on an elastic arm and rides up a ramp of the angle $\\alpha$ as it is pushed in
(`demos/problems/snap_fit.toml`). An arm of length $L$ and stiffness $E I$, with its nose at the depth $h$ below its
axis, on a rigid wedge: the ramp pushes the nose up by $P$ and back by $F = P \\tan(\\alpha + \\varphi)$, $\\tan
\\varphi = \\mu_f$. The nose moves up by $w$ and, as the arm's end turns, forwards; that it stays on the ramp gives

$$P \\left( \\frac{L^3}{3} - \\frac{h L^2}{2} \\tan(\\alpha + \\varphi)
  - \\tan \\alpha \\, h \\Big( \\frac{L^2}{2} - h L \\tan(\\alpha + \\varphi) \\Big) \\right)
  = E I \\tan \\alpha \\, (u - u_0),$$

with the displacement $u_0$ at which the nose touches. So friction makes insertion harder in two ways: it tilts the
force, and the tilted force stiffens the arm.

    python demos/demo_snap_fit.py            # friction 0, 0.1 and 0.3: minutes
    python demos/demo_snap_fit.py --quick    # 0.3 only, half of the way
"""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
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

PROBLEM = Path(__file__).parent / "problems" / "snap_fit.toml"
ANGLE = math.radians(30.0)
LENGTH, THICKNESS, DEPTH = 1.275, 0.15, 0.218  # of the arm from its plate to the nose; of the nose below the arm's axis
STIFFNESS = 1000.0 / (1.0 - 0.3**2) * THICKNESS**3 / 12.0  # E I in plane strain
TOUCHES = 0.03 / math.sin(ANGLE)  # u_0: way to close the gap of 0.03


def insertion(friction: float) -> float:
    """Force per displacement while the nose rides up the ramp."""
    tilt = math.tan(ANGLE + math.atan(friction))
    turn = LENGTH**2 / 2.0 - DEPTH * LENGTH * tilt
    give = LENGTH**3 / 3.0 - DEPTH * LENGTH**2 / 2.0 * tilt - math.tan(ANGLE) * DEPTH * turn
    return STIFFNESS * math.tan(ANGLE) * tilt / give


def curve(result: RunResult) -> tuple[Float, Float]:
    """Displacements (n,) and forces (n,) of the plate."""
    return (
        np.array([step.displacement for step in result.history]),
        np.array([step.reaction for step in result.history]),
    )


def slope(result: RunResult) -> float:
    """Force per displacement over the last half of the way."""
    u, force = curve(result)
    last = u > 0.5 * u[-1]
    return float(np.polyfit(u[last], force[last], 1)[0])


def solve(friction: float, out: Path, quick: bool) -> RunResult:
    """Run with one coefficient."""
    changes = {"regions.medium.medium.friction": friction, **({"load.ux": 0.1} if quick else {})}
    problem, options = read_problem(PROBLEM, changes)
    result = run(problem, out, replace(options, overwrite=True))
    assert result.complete, result.reason
    return result


def draw(results: dict[float, RunResult], path: Path) -> None:
    """Forces over the way, and those of an arm on a wedge."""
    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    axes = figure.subplots()
    for n, (friction, result) in enumerate(results.items()):
        u, force = curve(result)
        axes.plot(u, force, ".-", color=f"C{n}", markersize=3, linewidth=0.9, label=f"friction {friction:g}")
        rides = np.array([TOUCHES, u[-1]])
        axes.plot(rides, insertion(friction) * (rides - TOUCHES), "k--", linewidth=0.8,
                  label="arm on a wedge" if n == 0 else "_")  # fmt: skip
    axes.set(
        xlabel="displacement of the plate", ylabel="insertion force, per thickness", xlim=(0.0, None), ylim=(0.0, None)
    )
    axes.legend(frameon=False)
    figure.savefig(path, dpi=150)


def main() -> None:
    """Run, compare and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="friction 0.3 only, half of the way")
    parser.add_argument("--out", type=Path, default=Path("runs/demo_snap_fit"), help="where the run directories go")
    options = parser.parse_args()
    frictions = [0.3] if options.quick else [0.0, 0.1, 0.3]
    results = {
        friction: solve(friction, options.out / f"friction-{friction:g}", options.quick) for friction in frictions
    }
    table = Table(title="Insertion force of a snap-fit", box=SIMPLE, padding=(0, 0))
    for heading in ("friction", "force", "slope", "arm on a wedge", "to it", "slope to friction 0", "arm on a wedge"):
        table.add_column(heading, justify="right", no_wrap=True)
    for friction, result in results.items():
        found, known = slope(result), insertion(friction)
        change = "" if options.quick else f"{found / slope(results[0.0]):.3f}"
        table.add_row(f"{friction:g}", f"{result.reaction:.5f}", f"{found:.4f}", f"{known:.4f}",
                      f"{found / known - 1.0:+.1%}", change, f"{known / insertion(0.0):.3f}")  # fmt: skip
    draw(results, options.out / "snap_fit.png")
    console = Console()
    console.print(table)
    console.print(f"picture: {options.out}/snap_fit.png", highlight=False, soft_wrap=True)


if __name__ == "__main__":
    main()
