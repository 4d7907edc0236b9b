#!/usr/bin/env python3
"""Self-contact of the C-box: polygons in the solid, quadrilaterals in the medium (section 5.2 of Xu & Wriggers).

A C of length 1 and height 0.5 with arms of 0.1 is fixed along its back. The tip of its upper arm is pushed down until
it presses on the lower arm, at a point that nobody has told the program about: the cavity is filled with third medium,
and so is one column of cells to the right of the tips, because the medium there is what keeps the tips apart.

The solid has polygons and the medium quadrilaterals; where they meet, the polygons have hanging nodes. So the medium
can be refined without a change of the solid's mesh, which this demo does. The regulariser is (15), the gradients of the
angle of rotation and of J, not damped.

    python demos/demo_cbox.py            # u_y = -0.5 on two densities of the medium, then u_y = -1 with alpha_r = 20
    python demos/demo_cbox.py --quick    # u_y = -0.5 on the coarser one
"""

from __future__ import annotations

import argparse
from pathlib import Path

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from tmc_vem import Medium, RunOptions, RunResult, run
from tmc_vem.cli.progress import ConsoleMonitor
from tmc_vem.problems import CBox
from tmc_vem.report.animation import animate, draw_states, states_of
from tmc_vem.results.contact.contact import check_contact

# %%
# Regulariser (15) penalises gradients of the rotation angle and of the volume,
# $\psi_r = \frac{1}{2} \left( \nabla \varphi \cdot \nabla \varphi + \nabla J \cdot \nabla J \right)$ with
# $\tan \varphi = (F_{12} - F_{21}) / (F_{11} + F_{22})$. It costs nothing in a rigid rotation, however large.

# name: displacement, alpha_r, how often the medium divides an edge
CASES = {"coarse": (-0.5, 1.0, 1), "fine": (-0.5, 1.0, 2), "large": (-1.0, 20.0, 1)}


def solve(uy: float, alpha_r: float, refinement: int, out: Path) -> RunResult:
    """Run one case; its directory holds result, history, fields and a picture."""
    medium = Medium(gamma=1e-5, alpha_r=alpha_r, beta=0.0, regulariser="angle")
    problem = CBox(uy=uy, medium=medium, medium_refinement=refinement)
    return run(problem, out, RunOptions(overwrite=True, snapshots=20), monitor=ConsoleMonitor())


def main() -> None:
    """Run the cases, draw them, print the table and check what must hold."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="one case")
    parser.add_argument("--out", type=Path, default=Path("runs/demo_cbox"), help="where the run directories go")
    options = parser.parse_args()
    names = ["coarse"] if options.quick else list(CASES)

    table = Table(title="C-box", box=SIMPLE, padding=(0, 0))
    for heading in ("case", "cells", "u_y", "alpha_r", "steps", "Newton", "min J", "force", "smallest gap"):
        table.add_column(heading, justify="right", no_wrap=True)
    forces = {}
    for name in names:
        uy, alpha_r, refinement = CASES[name]
        result = solve(uy, alpha_r, refinement, options.out / name)
        assert result.complete, result.reason
        assert result.reaction is not None
        states = states_of(result)
        contact = check_contact(states[-1][1])
        assert not contact.interpenetrates, contact.summary()
        assert contact.smallest_gap is not None
        # contact carries the load from arm to arm: the lower arm, which nothing else touches, bends down with the tip
        lower = states[-1][1].displacement_ni[:, 1][states[-1][1].polygons.points_nx[:, 1] == 0.0]
        assert lower.min() < 0.2 * uy, f"the lower arm has moved by {lower.min():.3f} only: there is no contact"
        forces[name] = result.reaction
        draw_states([states[n] for n in (len(states) // 4, len(states) // 2, 3 * len(states) // 4, -1)],
                    options.out / f"{name}.png")  # fmt: skip
        animate(states, options.out / f"{name}.gif")
        table.add_row(
            name, str(result.n_cells), f"{uy:g}", f"{alpha_r:g}", str(result.steps), str(result.newton_iterations),
            f"{min(result.min_j.values()):.2e}", f"{result.reaction:.3e}", f"{contact.smallest_gap:.2e}",
        )  # fmt: skip
    # Two cantilevers in series: with the tip u down and the gap g closed, each bends by about (u - g)/2 more; the upper
    # one alone takes g. Beam theory, 3 E I / L^3 in plane strain for arms of length 0.9, overestimates at this size.
    k, mu = 5.0 / 3.0, 5.0 / 14.0
    young, poisson = 9.0 * k * mu / (3.0 * k + mu), (3.0 * k - 2.0 * mu) / (6.0 * k + 2.0 * mu)
    stiffness = 3.0 * young / (1.0 - poisson**2) * 0.1**3 / 12.0 / 0.9**3
    assert 0.5 < -forces["coarse"] / (stiffness * (0.3 + 0.1)) < 3.0, f"force {forces['coarse']:.3e}"
    console = Console()
    console.print(table)
    console.print(f"pictures and animations: {options.out}/*.png, *.gif", highlight=False, soft_wrap=True)
    console.print(f"ParaView:  {options.out}/*/fields.pvd (warp by 'displacement')", highlight=False, soft_wrap=True)


if __name__ == "__main__":
    main()
