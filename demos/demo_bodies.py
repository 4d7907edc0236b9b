#!/usr/bin/env python3
"""Complex contact of several bodies: a beam between half discs (section 5.4 of Xu & Wriggers).

A beam of 8 x 0.2 lies between seven half discs of radius 0.2, a thousand times stiffer than itself, that move towards
it, four from above and three from below. Third medium fills the space between; nothing knows which bodies will touch.

Case 1: both ends of the beam are fixed and the half discs are guided, so the beam has to stretch. Case 2: the right
end of the beam slides and the half discs are free in x, held by nothing but the medium: the beam's end comes
closer as it bends, and the half discs slide on its slopes.

Placement and amplitude are in figures of the paper only; here the half discs divide the beam's length into equal parts,
start at a distance of 0.1 and move by 0.25: all of these are parameters of the problem.

    python demos/demo_bodies.py            # both cases
    python demos/demo_bodies.py --quick    # both cases with three half discs on half a beam
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from tmc_vem import RunOptions, run
from tmc_vem.cli.progress import ConsoleMonitor
from tmc_vem.problems import Bodies
from tmc_vem.report.animation import animate, draw_states, states_of
from tmc_vem.results.contact.contact import check_contact
from tmc_vem.system.fields import Fields

# %%
# One potential holds beam, half discs and medium, $\Pi = \int \psi_s + \int \gamma (\psi_m + \alpha_r \psi_r)$, and no
# pair of surfaces is ever named: which bodies touch, and where, follows from its minimum.


def displacement_of_discs(fields: Fields, discs: int) -> list[float]:
    """Mean u_x of every half disc, from left to right."""
    polygons = fields.polygons
    region = polygons.region_names.index("discs")
    nodes = np.unique(np.concatenate([polygons.cell(c) for c in np.flatnonzero(polygons.region_c == region)]))
    x = polygons.points_nx[nodes, 0]
    length = polygons.points_nx[:, 0].max()
    number = np.round(x / length * (discs + 1)).astype(int)
    return [float(fields.displacement_ni[nodes[number == n + 1], 0].mean()) for n in range(discs)]


def main() -> None:
    """Run both cases, draw them, print the table and check what must hold."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="three half discs on half a beam")
    parser.add_argument("--out", type=Path, default=Path("runs/demo_bodies"), help="where the run directories go")
    options = parser.parse_args()
    discs, length = (3, 4.0) if options.quick else (7, 8.0)

    table = Table(title=f"Beam between {discs} half discs", box=SIMPLE, padding=(0, 0))
    for heading in ("case", "cells", "steps", "Newton", "min J", "force", "largest u_x of a disc", "smallest gap"):
        table.add_column(heading, justify="right", no_wrap=True)
    forces, slides = {}, {}
    for case in (1, 2):
        problem = Bodies(case=case, discs=discs, length=length)
        out = options.out / f"case_{case}"
        result = run(problem, out, RunOptions(overwrite=True, snapshots=16), monitor=ConsoleMonitor())
        assert result.complete, result.reason
        assert result.reaction is not None
        states = states_of(result)
        contact = check_contact(states[-1][1])
        assert not contact.interpenetrates, contact.summary()
        assert contact.smallest_gap is not None
        assert contact.smallest_gap < 0.2 * problem.gap0, f"a gap of {contact.smallest_gap:.3e} is left"
        forces[case] = -result.reaction
        slides[case] = displacement_of_discs(states[-1][1], discs)
        draw_states([states[len(states) // 2], states[-1]], options.out / f"case_{case}.png", columns=1)
        animate(states, options.out / f"case_{case}.gif")
        table.add_row(
            str(case), str(result.n_cells), str(result.steps), str(result.newton_iterations),
            f"{min(result.min_j.values()):.2e}", f"{result.reaction:.4f}", f"{max(map(abs, slides[case])):.4f}",
            f"{contact.smallest_gap:.2e}",
        )  # fmt: skip
    assert max(map(abs, slides[1])) < 1e-3, f"guided half discs must not slide: {slides[1]}"
    assert max(map(abs, slides[2])) > 0.03, f"free half discs must slide on the bent beam: {slides[2]}"
    assert forces[2] < forces[1], "a beam that may shorten is softer"
    console = Console()
    console.print(table)
    console.print(f"pictures and animations: {options.out}/*.png, *.gif", highlight=False, soft_wrap=True)
    console.print(f"ParaView:  {options.out}/*/fields.pvd (warp by 'displacement')", highlight=False, soft_wrap=True)


if __name__ == "__main__":
    main()
