#!/usr/bin/env python3
"""Partial slip of a line contact: shear over that of Cattaneo and Mindlin.

A cylinder is pressed onto a block of the same material by P, and then pushed sideways by Q
(`demos/problems/cattaneo.toml`). The contact of Hertz with the half width $a$ and the peak pressure $p_0$ does not
slide as a whole: it sticks within $c$,

$$\\frac{c}{a} = \\sqrt{1 - \\frac{Q}{\\mu_f P}}, \\qquad
q = \\mu_f p_0 \\left( \\sqrt{1 - x^2 / a^2} - \\frac{c}{a} \\sqrt{1 - x^2 / c^2} \\right),$$

the second root within $c$ only. So $\\mu_f p - q$ is a pressure of Hertz of the half width $c$: the stick zone is
found by the same fit as the contact's own width, to the stations with more than half of the largest value.

    python demos/demo_cattaneo.py            # a minute
    python demos/demo_cattaneo.py --quick    # a coarser mesh, longer steps
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
from tmc_vem.results.contact.bump import Bump
from tmc_vem.simulation.problem_file import read_problem

Float = NDArray[np.float64]

PROBLEM = Path(__file__).parent / "problems" / "cattaneo.toml"
RADIUS, YOUNG, POISSON, FRICTION = 1.0, 1000.0, 0.3, 0.3
EFFECTIVE = YOUNG / (2.0 * (1.0 - POISSON**2))  # E*, two bodies of the same material
COARSE = {"mesh.refine": [{"near": [[-0.06, 0.01], [0.06, 0.01]], "size": 0.01, "within": 0.012},
                          {"near": [[-0.32, 0.04], [-0.06, 0.01]], "size": 0.02},
                          {"near": [[0.06, 0.01], [0.32, 0.04]], "size": 0.02}]}  # fmt: skip


@dataclass(frozen=True)
class Contact:
    """Line contact under a force that presses and one that pushes sideways, both per thickness.

    Attributes:
        press, push: P and Q, with Q below friction times P.
    """

    press: float
    push: float

    @property
    def half_width(self) -> float:
        """a."""
        return math.sqrt(4.0 * self.press * RADIUS / (math.pi * EFFECTIVE))

    @property
    def peak(self) -> float:
        """p_0."""
        return 2.0 * self.press / (math.pi * self.half_width)

    @property
    def stick(self) -> float:
        """c."""
        return self.half_width * math.sqrt(1.0 - self.push / (FRICTION * self.press))

    def pressure(self, x: Float) -> Float:
        """p (n,) at distances (n,) from the middle."""
        return self.peak * np.sqrt(np.maximum(1.0 - (x / self.half_width) ** 2, 0.0))

    def shear(self, x: Float) -> Float:
        """q (n,) at distances (n,) from the middle."""
        inner = self.stick / self.half_width * np.sqrt(np.maximum(1.0 - (x / self.stick) ** 2, 0.0))
        return FRICTION * (self.pressure(x) - self.peak * inner)


@dataclass(frozen=True)
class Found:
    """What a run has along the face of the block.

    Attributes:
        x, p, q, weight: (n,) place, pressure, shear in the direction of the push, and length of the stations.
        contact: the analytic one at the forces of the run.
    """

    x: Float
    p: Float
    q: Float
    weight: Float
    contact: Contact

    @staticmethod
    def of(result: RunResult) -> Found:
        """That of the last step."""
        curves = result.traction()
        mine = np.flatnonzero(curves.between("block", "cylinder"))
        mine = mine[np.argsort(curves.point_nx[mine, 0])]
        tangent = np.stack([curves.normal_nx[mine, 1], -curves.normal_nx[mine, 0]], axis=1)  # to the right
        traction = curves.force_ni[mine] / curves.deformed_weight_n[mine, None]
        forces = result.contact["block"]
        return Found(
            x=curves.point_nx[mine, 0],
            p=curves.pressure_n[mine],
            q=(traction * tangent).sum(axis=1),
            weight=curves.deformed_weight_n[mine],
            contact=Contact(-forces["force_y"], forces["force_x"]),
        )

    def fit(self, values: Float) -> Bump:
        """Pressure of Hertz that fits values (n,) where they are more than half of the largest."""
        high = values > 0.5 * values.max()
        bump = Bump.fit(self.x[high], values[high], self.weight[high], low=-1.0, high=1.0)
        assert bump is not None
        return bump

    @property
    def width(self) -> float:
        """Half width of the contact."""
        return self.fit(self.p).half_width

    @property
    def stick(self) -> float:
        """Half width of the zone that sticks."""
        return self.fit(FRICTION * self.p - self.q).half_width


def solve(out: Path, gamma: float, quick: bool) -> Found:
    """Run the problem file."""
    problem, options = read_problem(PROBLEM, {"regions.medium.medium.gamma": gamma, **(COARSE if quick else {})})
    result = run(problem, out, replace(options, overwrite=True, largest_step=0.2 if quick else options.largest_step))
    assert result.complete, result.reason
    return Found.of(result)


def draw(found: Found, path: Path) -> None:
    """Pressure times friction and shear, with the analytic ones."""
    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    axes = figure.subplots()
    contact, a = found.contact, found.contact.half_width
    x = a * np.sin(np.linspace(-0.5 * math.pi, 0.5 * math.pi, 401))
    for n, (mine, known, label) in enumerate((
        (FRICTION * found.p, FRICTION * contact.pressure(x), "friction times pressure"),
        (found.q, contact.shear(x), "shear"),
    )):  # fmt: skip
        axes.plot(found.x / a, mine, "o", color=f"C{n}", markersize=3, label=label)
        axes.plot(x / a, known, "-", color=f"C{n}", linewidth=0.9, label=f"{label}, analytic")
    for sign in (-1.0, 1.0):
        axes.axvline(sign * contact.stick / a, color="0.6", linestyle=":", linewidth=0.9)
    axes.set(xlim=(-1.5, 1.5), ylim=(0.0, 1.35 * FRICTION * contact.peak), xlabel="place along the contact over a",
             ylabel="traction on the block")  # fmt: skip
    axes.legend(frameon=False, ncols=2, loc="upper center")
    figure.savefig(path, dpi=150)


def main() -> None:
    """Run, compare and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="gamma = 1e-5 on a coarser mesh")
    parser.add_argument("--out", type=Path, default=Path("runs/demo_cattaneo"), help="where the run directories go")
    options = parser.parse_args()
    gammas = [1e-5] if options.quick else [1e-5, 1e-6]
    table = Table(title="Half widths of contact and stick zone", box=SIMPLE, padding=(0, 0))
    for heading in ("gamma", "P", "Q / (f P)", "a", "by Hertz", "c", "by Cattaneo", "difference / a"):
        table.add_column(heading, justify="right", no_wrap=True)
    for gamma in gammas:
        found = solve(options.out / f"gamma-{gamma:.0e}", gamma, options.quick)
        contact = found.contact
        error = (found.stick - contact.stick) / contact.half_width
        table.add_row(f"{gamma:.0e}", f"{contact.press:.4f}", f"{contact.push / FRICTION / contact.press:.3f}",
                      f"{found.width:.5f}", f"{contact.half_width:.5f}", f"{found.stick:.5f}", f"{contact.stick:.5f}",
                      f"{error:+.1%}")  # fmt: skip
        assert abs(error) < (0.1 if options.quick else 0.05), (
            f"stick zone of {found.stick:.5f}, not {contact.stick:.5f}"
        )
    draw(found, options.out / "cattaneo.png")
    console = Console()
    console.print(table)
    console.print(f"picture: {options.out}/cattaneo.png", highlight=False, soft_wrap=True)


if __name__ == "__main__":
    main()
