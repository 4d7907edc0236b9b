#!/usr/bin/env python3
"""A round punch pressed into a block, soft and 100 times stiffer (section 5.3 of Xu & Wriggers).

The right half of a symmetric problem: a block of 2 x 1 with a fixed bottom, a quarter of a disc of radius 1 above it,
and third medium around the disc. All cells are Voronoi polygons whose diagram has the circle and the surface of the
block in it. The punch's flat top moves down by 1.3. A soft punch and the block share the deformation; a stiff one keeps
its shape and leaves all of it to the block.

The initial gap is in a figure of the paper only; here it is 0.6, a parameter of the problem.

    python demos/demo_punch.py            # both punches, some minutes
    python demos/demo_punch.py --quick    # soft punch, coarse cells, u_y = -1
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
from tmc_vem.problems import Punch
from tmc_vem.report.animation import animate, draw_states, states_of
from tmc_vem.results.contact.contact import check_contact
from tmc_vem.system.fields import Fields

# %%
# Contact pressure is carried by the squeezed medium: squeezed in one direction, its energy grows like
# $\gamma \mu J^{-2/3}$ as $J \to 0$, so the gap that is left falls with $\gamma$ and is checked against the one at the
# start.


def punch_height(fields: Fields) -> float:
    """Height of the deformed punch on the axis over its height at the start."""
    polygons = fields.polygons
    region = polygons.region_names.index("punch")
    nodes = np.unique(np.concatenate([polygons.cell(c) for c in np.flatnonzero(polygons.region_c == region)]))
    axis = nodes[np.abs(polygons.points_nx[nodes, 0]) < 1e-9]
    before = polygons.points_nx[axis, 1]
    return float(np.ptp(before + fields.displacement_ni[axis, 1]) / np.ptp(before))


def main() -> None:
    """Run, draw, print the table and check what must hold."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="soft punch only, coarse cells, less load")
    parser.add_argument("--out", type=Path, default=Path("runs/demo_punch"), help="where the run directories go")
    options = parser.parse_args()
    size, uy = (0.2, -1.0) if options.quick else (0.1, -1.3)

    table = Table(title=f"Punch at u_y = {uy:g}", box=SIMPLE, padding=(0, 0))
    for heading in ("punch", "cells", "steps", "Newton", "min J", "force", "punch height", "smallest gap"):
        table.add_column(heading, justify="right", no_wrap=True)
    forces, heights = {}, {}
    for name, stiffness in (("soft", 1.0),) if options.quick else (("soft", 1.0), ("stiff", 100.0)):
        problem = Punch(size=size, stiffness=stiffness, uy=uy)
        result = run(problem, options.out / name, RunOptions(overwrite=True, snapshots=20), monitor=ConsoleMonitor())
        assert result.complete, result.reason
        assert result.reaction is not None
        states = states_of(result)
        contact = check_contact(states[-1][1])
        assert not contact.interpenetrates, contact.summary()
        assert contact.smallest_gap is not None
        assert contact.smallest_gap < 0.02 * problem.gap0, f"a gap of {contact.smallest_gap:.3e} is left"
        forces[name], heights[name] = -result.reaction, punch_height(states[-1][1])
        draw_states([states[n] for n in (len(states) // 4, len(states) // 2, 3 * len(states) // 4, -1)],
                    options.out / f"{name}.png")  # fmt: skip
        animate(states, options.out / f"{name}.gif")
        table.add_row(
            name, str(result.n_cells), str(result.steps), str(result.newton_iterations),
            f"{min(result.min_j.values()):.2e}", f"{result.reaction:.4f}", f"{heights[name]:.4f}",
            f"{contact.smallest_gap:.2e}",
        )  # fmt: skip
    assert 0.6 < heights["soft"] < 0.95, "the soft punch must share the deformation"
    if "stiff" in heights:
        assert heights["stiff"] > 0.95, "the stiff punch must keep its shape"
        assert forces["stiff"] > 1.5 * forces["soft"], "and press harder"
    console = Console()
    console.print(table)
    console.print(f"pictures and animations: {options.out}/*.png, *.gif", highlight=False, soft_wrap=True)
    console.print(f"ParaView:  {options.out}/*/fields.pvd (warp by 'displacement')", highlight=False, soft_wrap=True)


if __name__ == "__main__":
    main()
