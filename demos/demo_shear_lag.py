#!/usr/bin/env python3
"""A bar that friction holds: loading, unloading and a cycle over the analytic forces.

A bar is pressed onto a rigid base with the pressure $p_0$ and pulled at its end (`demos/problems/shear_lag.toml`). It
slides over the length over which friction $t = \\mu_f p_0$ has taken up the force, and stands still beyond. With the
stiffness $E H$ of the bar its end moves by $u = F^2 / (2 E H t)$, so that

$$F = \\sqrt{2 E H t u}, \\qquad F = F_m - \\sqrt{4 E H t (u_m - u)}$$

where it is pulled, and let back from $(u_m, F_m)$: it then slides backwards from its end on, and stops where it is
pulled no longer, at $u_m / 2$. A cycle between $-u_m$ and $u_m$ takes the energy $2 F_m^3 / (3 E H t)$.

With gamma = 1e-6 a thinner bar is pulled less far.

    python demos/demo_shear_lag.py                                  # some minutes
    python demos/demo_shear_lag.py --cells quadrilaterals voronoi   # on Voronoi cells as well
    python demos/demo_shear_lag.py --quick                          # on a coarse mesh
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

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
PRESSURE, FRICTION = 0.1, 0.3
GAP, FINER = 0.05, 0.5  # initial thickness of the layer; size of Voronoi cells there over that of the others
CELLS = ("quadrilaterals", "voronoi")


@dataclass(frozen=True)
class Bar:
    """A bar that rests on friction, which takes up t per length.

    Attributes:
        length, height, young: L, H and E.
        farthest: u_m.
        elastic_slip: of the medium below.
    """

    length: float = 4.0
    height: float = 0.2
    young: float = 20.0
    farthest: float = 0.03
    elastic_slip: float = 0.2

    @property
    def c(self) -> float:
        """E H t."""
        return self.young * self.height * FRICTION * PRESSURE

    @property
    def force(self) -> float:
        """F_m."""
        return math.sqrt(2.0 * self.c * self.farthest)

    @property
    def cycle_energy(self) -> float:
        """What friction takes in a cycle between -u_m and u_m."""
        return 2.0 * self.force**3 / (3.0 * self.c)

    def pulled(self, u: Float) -> Float:
        """Force at the displacement of an end that is pulled for the first time."""
        return np.sqrt(2.0 * self.c * u)

    def let_back(self, u: Float) -> Float:
        """Force at the displacement of an end that is let back from u_m, down to -u_m."""
        return self.force - np.sqrt(4.0 * self.c * (self.farthest - u))

    def changes(self, size: float, cells: str) -> dict[str, Any]:
        """Those of the problem file, on a mesh of this size.

        Voronoi cells as thick as the layer would be one row; they are smaller there.
        """
        length, top = self.length, GAP + self.height
        fine: dict[str, Any] = {}
        if cells == "voronoi":
            near = [[0.0, 0.5 * GAP], [length, 0.5 * GAP]]
            fine["mesh.refine"] = [{"near": near, "size": FINER * size, "within": 0.5 * GAP}]
        return {
            "shapes.bar.rectangle": [0.0, GAP, length, top],
            "shapes.layer.rectangle": [0.0, 0.0, length, GAP],
            "regions.bar.solid.E": self.young,
            "edges.base.line": [[0.0, 0.0], [length, 0.0]],
            "edges.back.line": [[0.0, top], [length, top]],
            "edges.end.line": [[length, GAP], [length, top]],
            "load.pull.ux": self.farthest,
            "regions.medium.medium.elastic_slip": self.elastic_slip,
            "mesh.size": size,
            "mesh.cells": cells,
            **fine,
        }


# By gamma. Where the squeezed gap is smaller, so is what slips: a bar of the same stiffness that is pulled less far.
BARS = {1e-5: Bar(), 1e-6: Bar(length=2.0, height=0.05, young=80.0, farthest=0.006, elastic_slip=0.1)}


@dataclass(frozen=True)
class Found:
    """A run next to the analytic forces.

    Attributes:
        bar: whose forces they are.
        u, force: (n,) displacement and force of the end in the steps in which it is pulled.
        turn, back: steps at u_m and at -u_m.
    """

    bar: Bar
    u: Float
    force: Float
    turn: int
    back: int

    @staticmethod
    def of(bar: Bar, result: RunResult) -> Found:
        """That of a run of the problem file."""
        steps = [step for step in result.history if step.load >= 1.0]
        u, force = (np.array([step.forces["pull"][name] for step in steps]) for name in ("displacement", "reaction"))
        turn = int(np.argmin([abs(step.load - 2.0) for step in steps]))
        return Found(bar, u, force, turn, int(np.argmin(u)))

    @property
    def loading(self) -> float:
        """Largest distance to the analytic force where the end is pulled, over F_m."""
        part = slice(0, self.turn + 1)
        return float(abs(self.force[part] - self.bar.pulled(self.u[part])).max()) / self.bar.force

    @property
    def at_turn(self) -> float:
        """Force at u_m over F_m, less 1."""
        return float(self.force[self.turn]) / self.bar.force - 1.0

    @property
    def unloading(self) -> float:
        """Largest distance to the analytic force on the way from u_m / 2 to -u_m, over F_m; right after the turn the
        analytic force falls infinitely fast, and the elastic slip is seen."""
        way = slice(self.turn, self.back + 1)
        part = self.turn + np.flatnonzero(self.u[way] <= 0.5 * self.bar.farthest)
        return float(abs(self.force[part] - self.bar.let_back(self.u[part])).max()) / self.bar.force

    @property
    def all_the_way_back(self) -> float:
        """The same from the turn on."""
        way = slice(self.turn, self.back + 1)
        return float(abs(self.force[way] - self.bar.let_back(self.u[way])).max()) / self.bar.force

    @property
    def energy(self) -> float:
        """Energy of the cycle over the analytic one, less 1."""
        u, force = self.u[self.turn :], self.force[self.turn :]
        return float((0.5 * (force[1:] + force[:-1]) * np.diff(u)).sum()) / self.bar.cycle_energy - 1.0


def solve(bar: Bar, gamma: float, cells: str, out: Path, quick: bool) -> Found:
    """Run a bar with one gamma on one kind of cells."""
    changes = {"regions.medium.medium.gamma": gamma, **bar.changes(0.1 if quick else 0.05, cells)}
    problem, options = read_problem(PROBLEM, changes)
    result = run(problem, out, replace(options, overwrite=True, largest_step=0.2 if quick else options.largest_step))
    assert result.complete, result.reason
    return Found.of(bar, result)


def draw(runs: dict[tuple[float, str], Found], path: Path) -> None:
    """Forces of all runs over the analytic ones, which are one curve in parts of u_m and F_m."""
    figure = Figure(figsize=(6.4, 4.2), layout="constrained")
    axes = figure.subplots()
    bar = Bar()
    u = bar.farthest * np.sin(np.linspace(-0.5 * math.pi, 0.5 * math.pi, 201))
    known = "analytic"
    for x, force in ((u[u >= 0.0], bar.pulled(u[u >= 0.0])), (u, bar.let_back(u)), (u, -bar.let_back(-u))):
        axes.plot(x / bar.farthest, force / bar.force, "k-", linewidth=0.9, label=known)
        known = "_"
    for n, ((gamma, cells), found) in enumerate(runs.items()):
        axes.plot(found.u / found.bar.farthest, found.force / found.bar.force, "+x.1"[n % 4], color=f"C{n}",
                  markersize=4, markevery=2, label=rf"$\gamma$ = {gamma:.0e}, {cells}")  # fmt: skip
    axes.set(xlabel="displacement of the end over the largest", ylabel="force at the end over the largest, analytic")
    axes.legend(frameon=False)
    figure.savefig(path, dpi=150)


def main() -> None:
    """Run, compare and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="gamma = 1e-5 only, on coarse meshes in longer steps")
    parser.add_argument("--cells", nargs="+", choices=CELLS, default=CELLS[:1], help="kinds of cells")
    parser.add_argument("--out", type=Path, default=Path("runs/demo_shear_lag"), help="where the run directories go")
    options = parser.parse_args()
    runs = {
        (gamma, cells): solve(bar, gamma, cells, options.out / f"{cells}-{gamma:.0e}", options.quick)
        for gamma, bar in list(BARS.items())[: 1 if options.quick else None]
        for cells in options.cells
    }
    table = Table(title="Differences to the analytic forces, in parts of F_m", box=SIMPLE, padding=(0, 0))
    for heading in ("gamma", "cells", "F_m", "at u_m", "pulled", "let back", "energy of a cycle"):
        table.add_column(heading, justify="right", no_wrap=True)
    for (gamma, cells), found in runs.items():
        table.add_row(f"{gamma:.0e}", cells, f"{found.bar.force:.5f}", f"{found.at_turn:+.1%}", f"{found.loading:.1%}",
                      f"{found.unloading:.1%}", f"{found.energy:+.1%}")  # fmt: skip
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
