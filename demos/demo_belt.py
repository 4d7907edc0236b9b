#!/usr/bin/env python3
"""A belt on a drum: tension that grows exponentially along the wrap.

A belt lies around half of a drum that does not turn. Both its ends are pulled alike, then the belt is drawn over
the drum: its head goes on, and its tail gives way as far, until all of it slides. Euler's formula for the capstan says

$$T = T_0 \\, e^{\\mu_f \\theta}, \\qquad p = T / R.$$

Friction acts at the drum's radius $R$, tension in the middle of a belt of thickness $H$: moments about the drum's axis
leave $\\mu_f R / (R + H / 2)$ in place of $\\mu_f$. Both are compared. The frictionless medium resists as well, by
up to $0.87 J$ of the pressure (`demo_sliding_block.py`), here against the slip at the head and with it at the tail.

A belt of the radius $R + g$ that comes down on the drum by the gap $g$ is too long for it, and slips by $g$ times the
angle from the middle of the wrap. This is many widths of the squeezed gap. A straight side of a cell that is sheared
by the slip $s$ leaves the drum's tangent by $s^2 / 2 R$, and corners of drum and belt no longer face each other: where
this is as much as the squeezed gap, pressures alternate from node to node, the regulariser, which has no friction,
carries a part of them, and a part of the friction is lost. Therefore the drum's nodes lie where those of the belt
arrive: cells of the layer are askew at first, and upright in contact.

    python demos/demo_belt.py            # friction 0.1 and 0.3, a minute
    python demos/demo_belt.py --quick    # cells of twice the size, 0.3 only
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
from tmc_vem.mesh import PolygonMesh
from tmc_vem.mesh.files.io import write_mesh
from tmc_vem.simulation.problem_file import read_problem

Float = NDArray[np.float64]

RADIUS, GAP, THICKNESS, WRAP = 1.0, 0.01, 0.02, math.pi
FREE = 0.1  # length of the belt's straight ends
TIGHT = GAP * WRAP / 2 + 0.0008  # way of both ends: onto the drum, then into tension
DRAWN = 0.0015  # way of the belt over the drum
MARGIN = math.radians(20.0)  # of the wrap, left out at both ends where the growth of the pressure is measured
PROBLEM = f"""
name = "belt on a drum"

[mesh]
file = "belt.vtu"

[regions.belt]
solid = {{ E = 1e4, nu = 0 }}
hold = "medium"                                             # sideways, on the drum

[regions.layer]
medium = {{ energy = "balanced", regulariser = "angle_log", alpha = 2.5, h = {GAP}, mu = 10, gamma = 1e-5 }}

[edges]
drum = {{ circle = [0, 0, {RADIUS}] }}
tail = {{ line = [[{RADIUS + GAP}, {-FREE}], [{RADIUS + GAP + THICKNESS}, {-FREE}]] }}
head = {{ line = [[{-RADIUS - GAP - THICKNESS}, {-FREE}], [{-RADIUS - GAP}, {-FREE}]] }}

[[support]]
at = "drum"
ux = 0
uy = 0

[[load]]
name = "tail"
at = "tail"
uy = {-TIGHT}
history = [[0, 0], [1, 1], [2, {1.0 - DRAWN / TIGHT}]]

[[load]]
name = "head"
at = "head"
uy = {-TIGHT}
history = [[0, 0], [1, 1], [2, {1.0 + DRAWN / TIGHT}]]

[solve]
largest_step = 0.1
friction_error = 0.05
"""


def exponent(friction: float) -> float:
    """Growth of ln T per angle of a belt that slides, by moments about the drum's axis."""
    return friction * RADIUS / (RADIUS + 0.5 * THICKNESS)


def ratio(rate: float) -> float:
    """Force at the head over that at the tail, from the growth of ln T per angle."""
    return math.exp(rate * WRAP)


def belt_mesh(n: int, ahead: float = GAP / RADIUS) -> PolygonMesh:
    """Belt and layer in n cells along the wrap, one across each; straight ends in cells of the same length.

    Args:
        n: cells along the wrap.
        ahead: part by which the drum's nodes are farther from the middle of the wrap than the belt's. With GAP / RADIUS
            both are the same length apart, and meet.
    """
    m = round(FREE * n / (WRAP * RADIUS))
    free = np.linspace(0.0, FREE, m + 1)
    middle = 0.5 * WRAP
    theta = np.linspace(0.0, WRAP, n + 1)
    angle_s = np.concatenate([np.zeros(m), theta, np.full(m, WRAP)])
    beyond_s = np.concatenate([free[:0:-1], np.zeros(n + 1), free[1:]])
    askew = middle + (theta - middle) * (1.0 + ahead)
    rows = [RADIUS * np.column_stack([np.cos(askew), np.sin(askew)])]
    for radius in (RADIUS + GAP, RADIUS + GAP + THICKNESS):
        rows.append(np.column_stack([radius * np.cos(angle_s), radius * np.sin(angle_s) - beyond_s]))
    drum, inner, outer = (
        start + np.arange(len(row)) for start, row in zip((0, n + 1, 2 * (n + 1 + m)), rows, strict=True)
    )
    cells = [_between(drum, inner[m : m + n + 1]), _between(inner, outer)]
    return PolygonMesh.from_cells(
        np.concatenate(rows), np.concatenate(cells).tolist(), np.repeat([0, 1], [len(part) for part in cells]),
        ("layer", "belt"),
    )  # fmt: skip


def _between(below: NDArray[np.int64], above: NDArray[np.int64]) -> NDArray[np.int64]:
    """Quadrilaterals between two rows of vertices, counter-clockwise where the angle grows along them."""
    return np.column_stack([below[:-1], above[:-1], above[1:], below[1:]])


@dataclass(frozen=True)
class Found:
    """The state in which the belt slides.

    Attributes:
        ratio: force at the head over that at the tail.
        theta: (n,) angles of the belt's nodes on the drum from the tail's end of the wrap.
        tension, pressure: (n,) the first from the tail's force and the forces of the nodes, by moments about the axis;
            over the tail's force, and over the tail's force by the radius.
    """

    ratio: float
    theta: Float
    tension: Float
    pressure: Float

    @staticmethod
    def of(result: RunResult) -> Found:
        """That at the end of a run."""
        forces = result.history[-1].forces
        tail, head = (abs(forces[name]["reaction"]) for name in ("tail", "head"))
        curves = result.traction()
        X, Y = curves.reference_nx.T
        on_drum = np.flatnonzero((np.hypot(X, Y) < RADIUS + GAP + 0.5 * THICKNESS) & (Y > -1e-9))
        x, y = curves.point_nx[on_drum].T
        theta = np.arctan2(-x, y) + 0.5 * WRAP  # without a jump at the head
        moment = x * curves.force_ni[on_drum, 1] - y * curves.force_ni[on_drum, 0]
        order = np.argsort(theta)
        moment = moment[order]
        held = (0.5 * moment - np.cumsum(moment)) / (RADIUS + 0.5 * THICKNESS)  # up to the node itself
        return Found(head / tail, theta[order], 1.0 + held / tail, curves.pressure_n[on_drum][order] * RADIUS / tail)

    @property
    def growth(self) -> float:
        """Growth of the logarithm of the pressure per angle, away from the ends of the wrap."""
        inner = (self.theta > MARGIN) & (self.theta < WRAP - MARGIN)
        return float(np.polyfit(self.theta[inner], np.log(self.pressure[inner]), 1)[0])


def solve(friction: float, out: Path, mesh: PolygonMesh) -> RunResult:
    """Run with one coefficient."""
    out.mkdir(parents=True, exist_ok=True)
    write_mesh(mesh, out / "belt.vtu")
    (out / "belt.toml").write_text(PROBLEM)
    problem, options = read_problem(out / "belt.toml", {"regions.layer.medium.friction": friction})
    result = run(problem, out / "run", replace(options, overwrite=True))
    assert result.complete, result.reason
    return result


def draw(states: dict[float, Found], path: Path) -> None:
    """Tension and pressure along the wrap, over the analytic ones."""
    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    axes = figure.subplots()
    for n, (friction, found) in enumerate(states.items()):
        degrees = np.degrees(found.theta)
        axes.plot(degrees, found.pressure, "+", color=f"C{n}", markersize=4, markeredgewidth=0.6,
                  label=f"pressure R, friction {friction:g}")  # fmt: skip
        axes.plot(degrees[::6], found.tension[::6], "o", color=f"C{n}", markersize=4, markerfacecolor="none",
                  label=f"tension, friction {friction:g}")  # fmt: skip
    theta = np.linspace(0.0, WRAP, 100)
    for n, friction in enumerate(states):
        axes.plot(np.degrees(theta), np.exp(exponent(friction) * theta), "k-", linewidth=0.9,
                  label="_" if n else "capstan")  # fmt: skip
    axes.set(xlabel="angle from the tail (degrees)", ylabel="over the force at the tail", ylim=(0.0, None))
    axes.legend(frameon=False, loc="upper left")
    figure.savefig(path, dpi=150)


def main() -> None:
    """Run, compare and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="cells of twice the size, one coefficient")
    parser.add_argument("--out", type=Path, default=Path("runs/demo_belt"), help="where the run directories go")
    options = parser.parse_args()
    mesh = belt_mesh(60 if options.quick else 120)
    states = {
        friction: Found.of(solve(friction, options.out / f"friction-{friction:g}", mesh))
        for friction in ([0.3] if options.quick else [0.1, 0.3])
    }
    table = Table(title="A belt that slides over half of a drum", box=SIMPLE, padding=(0, 0))
    for heading in (
        "friction",
        "head / tail",
        "capstan",
        "thick belt",
        "to it",
        "growth of ln p",
        "thick belt",
        "to it",
    ):
        table.add_column(heading, justify="right", no_wrap=True)
    for friction, found in states.items():
        rate = exponent(friction)
        error, growth = found.ratio / ratio(rate) - 1.0, found.growth / rate - 1.0
        table.add_row(f"{friction:g}", f"{found.ratio:.4f}", f"{ratio(friction):.4f}",
                      f"{ratio(rate):.4f}", f"{error:+.1%}", f"{found.growth:.4f}", f"{rate:.4f}",
                      f"{growth:+.1%}")  # fmt: skip
        assert abs(error) < 0.05, f"the head is pulled {found.ratio:.4f} times as much as the tail"
    draw(states, options.out / "belt.png")
    console = Console()
    console.print(table)
    console.print(f"picture: {options.out}/belt.png", highlight=False, soft_wrap=True)


if __name__ == "__main__":
    main()
