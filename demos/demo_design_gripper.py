#!/usr/bin/env python3
"""A gripper that is pushed in at one end and presses its jaw on a part: topology optimisation of a contact force.

The objective is the force of contact on the part (`demos/problems/design_gripper.toml`), which the medium around it
transmits: before anything touches it is a millionth of what it becomes, and still it has a gradient that says where
material is to go. The upper half is designed, the lower one is its mirror image. The design becomes black and white by
projection in stages; then it is meshed along its outlines, with real void as medium, and pushed in once more.

    python demos/demo_design_gripper.py            # some minutes
    python demos/demo_design_gripper.py --quick    # a coarse grid, no projection and few designs
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from tmc_vem import run
from tmc_vem.design.extract import DesignMaterials, extracted_problem
from tmc_vem.design.extract_files import write_extracted
from tmc_vem.design.session import optimise
from tmc_vem.simulation.problem_file import read_problem

PROBLEM = Path(__file__).parent / "problems" / "design_gripper.toml"
CONFIRMED = 0.1  # what the force by outlines may differ by
QUICK: dict[str, Any] = {"mesh.size": 0.025, "design.iterations": 25, "design.projection.largest": 1}


def main() -> None:
    """Search, mesh the outlines, push in and compare."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a coarse grid, no projection and few designs")
    parser.add_argument("--out", type=Path, default=Path("runs/demo_design_gripper"), help="where the directories go")
    arguments = parser.parse_args()
    out = arguments.out
    problem, options = read_problem(PROBLEM, QUICK if arguments.quick else {})
    options = replace(options, overwrite=True)
    found = optimise(problem, out / "design", options)
    grip = found.values["grip"]
    rows = [("on the grid", grip, found.volume)]

    if not arguments.quick:
        mesh, region = problem.make_mesh(), problem.table.regions["design"]
        assert region.solid is not None
        assert region.medium is not None
        density_c = np.zeros(mesh.n_cells)
        of_design = mesh.region_c == mesh.region_names.index("design")
        density_c[of_design] = np.load(out / "design" / "stiffness.npz")["density_c"]  # in the order of its cells
        bare = replace(problem, table=replace(problem.table, design=None))
        materials = {"design": DesignMaterials(region.solid, region.medium)}
        extracted = extracted_problem(bare, mesh, density_c, materials)
        _, made = write_extracted(extracted, out / "outlines")
        result = run(made, out / "outlines" / "run", options)
        assert result.complete, result.reason
        volume = found.volume * extracted.volume_mesh / extracted.outlines.volume_densities
        rows.append(("by its outlines", result.probes["grip"], volume))

    table = Table(title="Force on the part", box=SIMPLE, padding=(0, 1))
    for heading in ("design", "force", "to the grid's", "volume"):
        table.add_column(heading, justify="left" if heading == "design" else "right")
    for name, force, volume in rows:
        table.add_row(name, f"{-force:.5f}", f"{force / grip:.3f}", f"{volume:.4f}")
    Console().print(table)
    print(f"report: {out / 'design' / 'report.html'}")
    assert grip < -0.005
    if not arguments.quick:
        assert abs(rows[-1][1] / grip - 1.0) < CONFIRMED


if __name__ == "__main__":
    main()
