#!/usr/bin/env python3
"""A bar that friction holds: loading, unloading and a cycle over the analytic forces.

A bar is pressed onto a rigid base with the pressure $p_0$ and pulled at its end (`demos/problems/shear_lag.toml`). It
slides over the length over which friction $t = \\mu_f p_0$ has taken up the force, and stands still beyond. With the
stiffness $E H$ of the bar its end moves by $u = F^2 / (2 E H t)$, so that

$$F = \\sqrt{2 E H t u}, \\qquad F = F_m - \\sqrt{4 E H t (u_m - u)}$$

where it is pulled, and let back from $(u_m, F_m)$: it then slides backwards from its end on, and stops where it is
pulled no longer, at $u_m / 2$. A cycle between $-u_m$ and $u_m$ takes the energy $2 F_m^3 / (3 E H t)$.

    python demos/demo_shear_lag.py            # a minute
    python demos/demo_shear_lag.py --quick    # on a coarse mesh
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

PROBLEM = Path(__file__).parent / "problems" / "shear_lag.toml"
LENGTH, HEIGHT, YOUNG, PRESSURE, FRICTION = 4.0, 0.2, 20.0, 0.1, 0.3
FARTHEST = 0.03  # u_m
C = YOUNG * HEIGHT * FRICTION * PRESSURE  # E H t
FORCE = math.sqrt(2.0 * C * FARTHEST)  # F_m


def pulled(u: Float) -> Float:
    """Force at the displacement of an end that is pulled for the first time."""
    return np.sqrt(2.0 * C * u)


def let_back(u: Float) -> Float:
    """Force at the displacement of an end that is let back from u_m, down to -u_m."""
    return FORCE - np.sqrt(4.0 * C * (FARTHEST - u))


def cycle_energy() -> float:
    """What friction takes in a cycle between -u_m and u_m."""
    return 2.0 * FORCE**3 / (3.0 * C)


@dataclass(frozen=True)
class Found:
    """A run next to the analytic forces.

    Attributes:
        u, force: (n,) displacement and force of the end in the steps in which it is pulled.
        turn, back: steps at u_m and at -u_m.
    """

    u: Float
    force: Float
    turn: int
    back: int

    @staticmethod
    def of(result: RunResult) -> Found:
        """That of a run of the problem file."""
        steps = [step for step in result.history if step.load >= 1.0]
        u, force = (np.array([step.forces["pull"][name] for step in steps]) for name in ("displacement", "reaction"))
        turn = int(np.argmin([abs(step.load - 2.0) for step in steps]))
        return Found(u, force, turn, int(np.argmin(u)))

    @property
    def loading(self) -> float:
        """Largest distance to the analytic force where the end is pulled, over F_m."""
        part = slice(0, self.turn + 1)
        return float(abs(self.force[part] - pulled(self.u[part])).max()) / FORCE

    @property
    def at_turn(self) -> float:
        """Force at u_m over F_m, less 1."""
        return float(self.force[self.turn]) / FORCE - 1.0

    @property
    def unloading(self) -> float:
        """Largest distance to the analytic force on the way from u_m / 2 to -u_m, over F_m; right after the turn the
        analytic force falls infinitely fast, and the elastic slip is seen."""
        way = slice(self.turn, self.back + 1)
        part = self.turn + np.flatnonzero(self.u[way] <= 0.5 * FARTHEST)
        return float(abs(self.force[part] - let_back(self.u[part])).max()) / FORCE

    @property
    def energy(self) -> float:
        """Energy of the cycle over the analytic one, less 1."""
        u, force = self.u[self.turn :], self.force[self.turn :]
        return float((0.5 * (force[1:] + force[:-1]) * np.diff(u)).sum()) / cycle_energy() - 1.0


def solve(gamma: float, cells: str, out: Path, quick: bool) -> Found:
    """Run with one gamma on one kind of cells."""
    changes = {"regions.medium.medium.gamma": gamma, "mesh.cells": cells, **({"mesh.size": 0.1} if quick else {})}
    problem, options = read_problem(PROBLEM, changes)
    result = run(problem, out, replace(options, overwrite=True, largest_step=0.2 if quick else options.largest_step))
    assert result.complete, result.reason
    return Found.of(result)


def draw(runs: dict[tuple[float, str], Found], path: Path) -> None:
    """Forces of all runs over the analytic ones."""
    figure = Figure(figsize=(6.4, 4.2), layout="constrained")
    axes = figure.subplots()
    u = FARTHEST * np.sin(np.linspace(-0.5 * math.pi, 0.5 * math.pi, 200))
    known = "analytic"
    for x, force in ((u[u >= 0.0], pulled(u[u >= 0.0])), (u, let_back(u)), (u, -let_back(-u))):
        axes.plot(x, force, "k-", linewidth=0.9, label=known)
        known = "_"
    for n, ((gamma, cells), found) in enumerate(runs.items()):
        axes.plot(found.u, found.force, "+x.1"[n % 4], color=f"C{n}", markersize=4, markevery=2,
                  label=rf"$\gamma$ = {gamma:.0e}, {cells}")  # fmt: skip
    axes.set(xlabel="displacement of the end", ylabel="force at the end, per thickness")
    axes.legend(frameon=False)
    figure.savefig(path, dpi=150)


def main() -> None:
    """Run, compare and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="gamma = 1e-5 on a coarse mesh of quadrilaterals")
    parser.add_argument("--out", type=Path, default=Path("runs/demo_shear_lag"), help="where the run directories go")
    options = parser.parse_args()
    pairs = [(1e-5, "quadrilaterals")]
    runs = {
        (gamma, cells): solve(gamma, cells, options.out / f"{cells}-{gamma:.0e}", options.quick)
        for gamma, cells in pairs
    }
    table = Table(
        title=f"Differences to the analytic forces, in parts of F_m = {FORCE:.5f}", box=SIMPLE, padding=(0, 0)
    )
    for heading in ("gamma", "cells", "at u_m", "pulled", "let back", "energy of a cycle"):
        table.add_column(heading, justify="right", no_wrap=True)
    for (gamma, cells), found in runs.items():
        table.add_row(f"{gamma:.0e}", cells, f"{found.at_turn:+.1%}", f"{found.loading:.1%}", f"{found.unloading:.1%}",
                      f"{found.energy:+.1%}")  # fmt: skip
        allowed = 2.0 if options.quick else 1.0
        for name, value, most in (("at u_m", found.at_turn, 0.02), ("let back", found.unloading, 0.04),
                                  ("energy", found.energy, 0.05)):  # fmt: skip
            assert abs(value) < allowed * most, f"{cells}, gamma {gamma:.0e}, {name}: {value:+.1%}"
    draw(runs, options.out / "shear_lag.png")
    console = Console()
    console.print(table)
    console.print(f"picture: {options.out}/shear_lag.png", highlight=False, soft_wrap=True)


if __name__ == "__main__":
    main()
