#!/usr/bin/env python3
"""A block that sticks, slides and is pulled back: hysteresis of friction in the medium.

A block is pressed onto a rigid base by the force N and pulled to and fro at its side
(`demos/problems/sliding_block.toml`). Coulomb's law says that it slides at $R_t = \\mu_f R_n$. The medium without
friction resists as well, by a part that is known: in a layer that is squeezed to the stretch $l$ and sheared by $k$,
slip over its initial width, the medium of this problem, `balanced`, has

$$\\frac{\\text{shear}}{\\text{pressure}} = \\frac{3 k l}{3 + k^2 - 2 l^2 - l^{5/3}} \\le 0.87 \\, l.$$

Without it the ratio is compared with the coefficient. The work of a cycle of amplitude $s$ would be $4 \\mu_f N s$ if
the block were rigid and stuck without any elastic slip; both take a part of the way, more of it the larger the force.

    python demos/demo_sliding_block.py            # friction 0.3 and 0.6
    python demos/demo_sliding_block.py --quick    # a coarser mesh and longer steps, 0.3 only
"""

from __future__ import annotations

import argparse
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

PROBLEM = Path(__file__).parent / "problems" / "sliding_block.toml"
FORCE, WIDTH, SLIDE = 0.1, 0.05, 0.01  # N, initial width of the layer, amplitude s
TURNS = (2.0, 4.0, 6.0)  # times at which the block is farthest to the right, left and right
COARSE = {"mesh.refine": [{"near": [[0.0, 0.025], [1.0, 0.025]], "size": 0.05, "within": 0.025}]}


def parasitic(stretch: float | Float, shear: float | Float) -> float | Float:
    """Shear over pressure of a layer of the balanced medium without friction."""
    return 3.0 * shear * stretch / (3.0 + shear**2 - 2.0 * stretch**2 - stretch ** (5.0 / 3.0))


def ratios(result: RunResult) -> tuple[Float, Float, Float]:
    """Of the steps (n,) in which the block is pulled: its place, the pulling force over N, the same without the part
    that the medium has without friction."""
    steps = [step for step in result.history if step.load >= 1.0]
    place, force = (np.array([step.forces["slide"][name] for step in steps]) for name in ("displacement", "reaction"))
    stretch = np.array([step.probes["squeezed"] for step in steps])
    return place, force / FORCE, force / FORCE - parasitic(stretch, place / WIDTH)


@dataclass(frozen=True)
class Turn:
    """Where the block turns.

    Attributes:
        place: of its side.
        plain, ratio: pulling force over N, with and without the part that the medium has without friction.
        sign: of the direction in which it has slid.
    """

    place: float
    plain: float
    ratio: float
    sign: float

    def error(self, friction: float) -> float:
        """Its force over that of Coulomb, less 1."""
        return self.sign * self.ratio / friction - 1.0


def at_turns(result: RunResult) -> list[Turn]:
    """To the right, to the left, and to the right again."""
    place, plain, ratio = ratios(result)
    times = np.array([step.load for step in result.history if step.load >= 1.0])
    at = [int(np.argmin(abs(times - time))) for time in TURNS]
    return [Turn(float(place[n]), float(plain[n]), float(ratio[n]), sign)
            for n, sign in zip(at, (1.0, -1.0, 1.0), strict=True)]  # fmt: skip


def cycle_work(place: Float, ratio: Float) -> float:
    """Work over N of the last cycle, from the right to the left and back."""
    x, y = (of[int(np.argmax(place)) :] for of in (place, ratio))
    return float((0.5 * (y[1:] + y[:-1]) * np.diff(x)).sum())


def solve(friction: float, out: Path, quick: bool) -> RunResult:
    """Run with one coefficient."""
    problem, options = read_problem(PROBLEM, {"regions.medium.medium.friction": friction, **(COARSE if quick else {})})
    options = replace(options, overwrite=True, largest_step=0.25 if quick else options.largest_step)
    result = run(problem, out, options)
    assert result.complete, result.reason
    return result


def draw(results: dict[float, RunResult], path: Path) -> None:
    """Loops of force over N, and the forces of Coulomb."""
    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    axes = figure.subplots()
    for n, (friction, result) in enumerate(results.items()):
        place, _, ratio = ratios(result)
        axes.plot(
            place, ratio, ".-", color=f"C{n}", markersize=3, linewidth=0.9, label=f"medium, friction {friction:g}"
        )
        for sign in (-1.0, 1.0):
            axes.axhline(sign * friction, color=f"C{n}", linestyle="--", linewidth=0.7)
    axes.set(xlabel="displacement of the block's side", ylabel="pulling force over N, without parasitic part")
    axes.locator_params(axis="x", nbins=5)
    axes.legend(frameon=False, loc="center", bbox_to_anchor=(0.5, 0.4))
    figure.savefig(path, dpi=150)


def main() -> None:
    """Run, compare and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a coarser mesh, longer steps, one coefficient")
    parser.add_argument(
        "--out", type=Path, default=Path("runs/demo_sliding_block"), help="where the run directories go"
    )
    options = parser.parse_args()
    frictions = [0.3] if options.quick else [0.3, 0.6]
    results = {
        friction: solve(friction, options.out / f"friction-{friction:g}", options.quick) for friction in frictions
    }
    table = Table(title="Pulling force over N where the block turns", box=SIMPLE, padding=(0, 0))
    for heading in ("friction", "at", "ratio", "parasitic", "to friction", "cycle", "rigid"):
        table.add_column(heading, justify="right", no_wrap=True)
    for friction, result in results.items():
        place, _, ratio = ratios(result)
        for n, turn in enumerate(at_turns(result)):
            error = turn.error(friction)
            work = f"{cycle_work(place, ratio):.5f}" if n == len(TURNS) - 1 else ""
            medium = f"{turn.plain - turn.ratio:+.4f}"
            table.add_row(f"{friction:g}", f"{turn.place:+.3f}", f"{turn.plain:+.4f}", medium,
                          f"{error:+.1%}", work, f"{4.0 * friction * SLIDE:.5f}" if work else "")  # fmt: skip
            assert abs(error) < 0.02, f"the block slides at {turn.ratio:.4f} N, at {friction:g} N by Coulomb"
    draw(results, options.out / "sliding_block.png")
    console = Console()
    console.print(table)
    console.print(f"picture: {options.out}/sliding_block.png", highlight=False, soft_wrap=True)


if __name__ == "__main__":
    main()
