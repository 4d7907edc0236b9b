#!/usr/bin/env python3
"""Line contact of Hertz at small a/R: pressures of the medium over the analytic ones.

A cylinder is pressed onto a block of the same material (`demos/problems/hertz.toml`, half of a symmetric problem) by
the displacement of its top; the force F is the reaction there. The contact's half width a and peak pressure p0 that
belong to F are known,

$$a = \\sqrt{\\frac{4 F R}{\\pi E^*}}, \\quad p_0 = \\frac{2 F}{\\pi a}, \\quad p = p_0 \\sqrt{1 - x^2 / a^2}.$$

Half width and peak are those of a fit of $p^2$ over $x^2$ to the stations with more than half of the largest pressure:
the medium's pressure fades out beyond the contact, and no threshold says where that ends. Two gammas give the limit
gamma -> 0, as errors shrink like $\\gamma^{3/5}$.

    python demos/demo_hertz.py            # gamma = 1e-5 and 1e-6, half a minute
    python demos/demo_hertz.py --quick    # gamma = 1e-4 on a coarser mesh and its force only
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from tmc_vem import RunOptions, RunResult, run
from tmc_vem.results.contact.bump import Bump
from tmc_vem.simulation.problem_file import read_problem

PROBLEM = Path(__file__).parent / "problems" / "hertz.toml"
RADIUS, YOUNG, POISSON = 1.0, 1000.0, 0.3
EFFECTIVE = YOUNG / (2.0 * (1.0 - POISSON**2))  # E*, two bodies of the same material
COARSE = {"mesh.refine": [{"near": [[0.0, 0.01], [0.06, 0.01]], "size": 0.0098, "within": 0.01},
                          {"near": [[0.06, 0.01], [0.32, 0.04]], "size": 0.02}]}  # fmt: skip


def analytic(force: float) -> tuple[float, float]:
    """Half width and peak pressure of Hertz at a force per thickness."""
    half_width = math.sqrt(4.0 * force * RADIUS / (math.pi * EFFECTIVE))
    return half_width, 2.0 * force / (math.pi * half_width)


def limit(coarse: float, fine: float, ratio: float) -> float:
    """Value at gamma -> 0 from two gammas, of which the first is ``ratio`` times the second."""
    return fine - (coarse - fine) / (ratio**0.6 - 1.0)


def pressure(result: RunResult, body: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places (n,), pressures (n,) and lengths (n,) of the stations on a body, from the axis outwards."""
    curves = result.traction()
    mine = np.flatnonzero(curves.body_n == curves.bodies.index(body))
    mine = mine[np.argsort(curves.point_nx[mine, 0])]
    return curves.point_nx[mine, 0], curves.pressure_n[mine], curves.deformed_weight_n[mine]


def fitted(result: RunResult, body: str) -> Bump:
    """Pressure of Hertz that fits, with the mirrored stations of the half that is left out."""
    x, p, weight = pressure(result, body)
    high = p > 0.5 * p.max()
    both = [np.concatenate([sign * values[high][::-1], values[high]])
            for sign, values in ((-1.0, x), (1.0, p), (1.0, weight))]  # fmt: skip
    bump = Bump.fit(*both, low=-1.0, high=1.0)
    assert bump is not None
    return bump


def solve(gamma: float, out: Path, quick: bool) -> RunResult:
    """Run with one gamma; forces of both bodies must be the reaction."""
    problem, options = read_problem(PROBLEM, {"regions.medium.medium.gamma": gamma, **(COARSE if quick else {})})
    result = run(problem, out, RunOptions(**{**vars(options), "overwrite": True}))
    assert result.complete, result.reason
    assert result.reaction is not None
    for sign, body in ((1.0, "block"), (-1.0, "cylinder")):
        error = abs(sign * result.contact[body]["force_y"] / result.reaction - 1.0)
        assert error < 1e-8, f"pressures on {body} add up to the force but for {error:.1e}"
    return result


def draw(results: dict[float, RunResult], path: Path) -> None:
    """Pressures on the block in each run, and the analytic one at the force of the limit."""
    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    axes = figure.subplots()
    for gamma, result in results.items():
        x, p, _ = pressure(result, "block")
        axes.plot(x, p, "o-", markersize=3, linewidth=0.7, label=rf"medium, $\gamma$ = {gamma:.0e}")
    gammas = list(results)
    force = -2.0 * limit(*(float(results[gamma].reaction or 0.0) for gamma in gammas), gammas[0] / gammas[1])
    a, p0 = analytic(force)
    x = a * np.sin(np.linspace(0.0, 0.5 * math.pi, 200))
    axes.plot(x, p0 * np.sqrt(np.maximum(1.0 - (x / a) ** 2, 0.0)), "k-", label=r"Hertz, F at $\gamma \to 0$")
    axes.set(xlim=(0.0, 1.6 * a), ylim=(0.0, None), xlabel="distance from the axis, deformed",
             ylabel="contact pressure on the block")  # fmt: skip
    axes.legend(frameon=False)
    figure.savefig(path, dpi=150)


def main() -> None:
    """Run, compare and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="gamma = 1e-4 on a coarser mesh, and its force only")
    parser.add_argument("--out", type=Path, default=Path("runs/demo_hertz"), help="where the run directories go")
    options = parser.parse_args()
    gammas = [1e-4] if options.quick else [1e-5, 1e-6]
    results = {gamma: solve(gamma, options.out / f"gamma-{gamma:.0e}", options.quick) for gamma in gammas}
    if options.quick:
        return
    draw(results, options.out / "hertz.png")
    force = -2.0 * limit(*(float(results[gamma].reaction or 0.0) for gamma in gammas), gammas[0] / gammas[1])
    a, p0 = analytic(force)
    table = Table(title=f"Hertz at F = {force:.4f}: a = {a:.5f}, p0 = {p0:.3f}", box=SIMPLE, padding=(0, 0))
    for heading in ("face of", "half width", "to Hertz", "peak pressure", "to Hertz"):
        table.add_column(heading, justify="right", no_wrap=True)
    for body in ("block", "cylinder"):
        fits = [fitted(results[gamma], body) for gamma in gammas]
        width = limit(fits[0].half_width, fits[1].half_width, gammas[0] / gammas[1])
        peak = limit(fits[0].pressure, fits[1].pressure, gammas[0] / gammas[1])
        table.add_row(body, f"{width:.5f}", f"{width / a - 1:+.1%}", f"{peak:.3f}", f"{peak / p0 - 1:+.1%}")
        if body == "block":  # its face is flat, and has a node on the axis
            assert abs(width / a - 1.0) < 0.02, f"half width {width:.5f}, {a:.5f} by Hertz"
            assert abs(peak / p0 - 1.0) < 0.02, f"peak pressure {peak:.3f}, {p0:.3f} by Hertz"
    console = Console()
    console.print(table)
    console.print(f"picture: {options.out}/hertz.png", highlight=False, soft_wrap=True)


if __name__ == "__main__":
    main()
