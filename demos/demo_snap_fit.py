#!/usr/bin/env python3
"""A snap-fit: the force that pushes its hook up the ramp, with and without friction.

The hook hangs on two elastic arms, side by side, and rides up a ramp of the angle $\\alpha$ as they are pushed in
(`demos/problems/snap_fit.toml`). Coulomb's law tilts the force on it: where the ramp pushes the hook up by $P$, it
pushes it back by $F = P \\tan(\\alpha + \\varphi)$, $\\tan \\varphi = \\mu_f$. The arms give way as beams do that are
built in at the plate and at the block, with shear, axial forces and what these take off the bending stiffness; the
block is rigid. That it stays on the ramp gives the displacement of the plate

$$u = u_0 + w / \\tan \\alpha - v$$

with those of the block, $w$ upwards and $v$ forwards, and the displacement $u_0$ at which rigid surfaces touch. The
medium between them gives way too until it is thin, so that the force begins earlier: slopes are compared. That without
friction is less than the frame's, as the block is no rigid one, so the last columns have slopes in parts of that.

    python demos/demo_snap_fit.py            # friction 0, 0.1 and 0.3
    python demos/demo_snap_fit.py --quick    # 0.3 only, with longer steps
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
TOUCHES = 0.05 / math.sin(ANGLE)  # u_0: way to close the gap of 0.05
YOUNG, POISSON = 3000.0, 0.3
LENGTH, THICKNESS, HEIGHTS = 1.045, 0.06, (0.43, 0.77)  # of the arms, which end at x = ENDS
ENDS, FACE = 0.045, (0.19, 0.1433)  # the middle of the hook's face, where the ramp pushes
RISES = 0.8  # part of the way from which on slopes are compared
FRICTIONS = (0.0, 0.1, 0.3)
ACCEPTED, RISES_BY = 0.04, 0.06  # errors of a coefficient, and of the factor by which friction raises the slope


def arm(force: float) -> Float:
    """(3, 3) stiffness of an arm's end, forwards, upwards and turning to the left, under an axial force."""
    modulus = YOUNG / (1.0 - POISSON**2)
    bending, shear = modulus * THICKNESS**3 / 12.0, YOUNG / (2.0 + 2.0 * POISSON) * THICKNESS * 5.0 / 6.0
    phi = 12.0 * bending / (shear * LENGTH**2)
    k, n = bending / (1.0 + phi) / LENGTH**3, force / LENGTH
    coupled = -6.0 * k * LENGTH + 0.1 * force
    turns = (4.0 + phi) * k * LENGTH**2 - 2.0 / 15.0 * force * LENGTH
    return np.array(
        [[modulus * THICKNESS / LENGTH, 0.0, 0.0], [0.0, 12.0 * k - 1.2 * n, coupled], [0.0, coupled, turns]]
    )


def insertion(push: float, friction: float) -> tuple[float, float]:
    """Displacement of the plate and force, per thickness, at which the ramp pushes the hook up by ``push``."""
    force = push * math.tan(ANGLE + math.atan(friction))
    ends = [np.array([[1.0, 0.0, FACE[1] - y], [0.0, 1.0, ENDS - FACE[0]], [0.0, 0.0, 1.0]]) for y in HEIGHTS]
    axial, moved = [0.5 * force] * len(ends), np.zeros(3)
    for _ in range(4):
        stiffness = sum(end.T @ arm(n) @ end for end, n in zip(ends, axial, strict=True))
        moved = np.linalg.solve(stiffness, np.array([-force, push, 0.0]))
        axial = [-float((arm(n) @ end @ moved)[0]) for end, n in zip(ends, axial, strict=True)]
    return TOUCHES + moved[1] / math.tan(ANGLE) - moved[0], force


def known(friction: float, farthest: float) -> tuple[Float, Float]:
    """Displacements (n,) of the plate up to one, and forces (n,) of the frame on a wedge."""
    u, force = np.array([insertion(push, friction) for push in np.linspace(0.0, 0.06, 121)]).T
    up_to = np.linspace(TOUCHES, farthest, 50)
    return up_to, np.interp(up_to, u, force)


def curve(result: RunResult) -> tuple[Float, Float]:
    """Displacements (n,) and forces (n,) of the plate."""
    return (
        np.array([step.displacement for step in result.history]),
        np.array([step.reaction for step in result.history]),
    )


def slope(u: Float, force: Float) -> float:
    """Force per displacement over the last part of the way."""
    last = u > RISES * u[-1]
    return float(np.polyfit(u[last], force[last], 1)[0])


def coefficient(result: RunResult) -> float:
    """That of Coulomb with which the force on the hook has its direction at the end."""
    force = result.history[-1].contact["hook"]
    return math.tan(math.atan2(-force["force_x"], force["force_y"]) - ANGLE)


def solve(friction: float, out: Path, quick: bool) -> RunResult:
    """Run with one coefficient."""
    problem, options = read_problem(PROBLEM, {"regions.medium.medium.friction": friction})
    if quick:
        options = replace(options, friction_error=0.2)
    result = run(problem, out, replace(options, overwrite=True))
    assert result.complete, result.reason
    return result


def draw(results: dict[float, RunResult], path: Path) -> None:
    """Forces over the way, and those of a frame on a wedge."""
    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    axes = figure.subplots()
    for n, (friction, result) in enumerate(results.items()):
        u, force = curve(result)
        axes.plot(u, force, ".-", color=f"C{n}", markersize=3, linewidth=0.9, label=f"medium, friction {friction:g}")
        axes.plot(*known(friction, u[-1]), "--", color=f"C{n}", linewidth=0.9)
    axes.plot([], [], "k--", linewidth=0.9, label="frame on a wedge")
    axes.set(xlabel="displacement of the plate", ylabel="insertion force, per thickness", xlim=(0.04, None))
    axes.set_ylim(0.0, None)
    axes.legend(frameon=False)
    figure.savefig(path, dpi=150)


def main() -> None:
    """Run, compare and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="friction 0.3 only, with longer steps")
    parser.add_argument("--out", type=Path, default=Path("runs/demo_snap_fit"), help="where the run directories go")
    options = parser.parse_args()
    frictions = FRICTIONS[-1:] if options.quick else FRICTIONS
    results = {
        friction: solve(friction, options.out / f"friction-{friction:g}", options.quick) for friction in frictions
    }
    draw(results, options.out / "snap_fit.png")
    table = Table(title="Insertion force of a snap-fit", box=SIMPLE, padding=(0, 0))
    for heading in ("friction", "force", "coefficient", "slope", "frame", "to it", "slope to 0", "frame"):
        table.add_column(heading, justify="right", no_wrap=True)
    plain = None if options.quick else (slope(*curve(results[0.0])), slope(*known(0.0, curve(results[0.0])[0][-1])))
    for friction, result in results.items():
        u, force = curve(result)
        found, wanted, seen = slope(u, force), slope(*known(friction, u[-1])), coefficient(result)
        rises = (found / plain[0], wanted / plain[1]) if plain else ()
        table.add_row(f"{friction:g}", f"{force[-1]:.5f}", f"{seen:.3f}", f"{found:.4f}", f"{wanted:.4f}",
                      f"{found / wanted - 1:+.1%}", *(f"{rise:.3f}" for rise in rises))  # fmt: skip
        assert abs(seen - friction) < ACCEPTED, f"the force is that of a coefficient of {seen:.3f}, not {friction:g}"
        assert not rises or abs(rises[0] / rises[1] - 1.0) < RISES_BY, (
            f"friction {friction:g} makes the slope {rises[0]:.3f} times that without, on a wedge {rises[1]:.3f} times"
        )
    console = Console()
    console.print(table)
    console.print(f"picture: {options.out}/snap_fit.png", highlight=False, soft_wrap=True)


if __name__ == "__main__":
    main()
