#!/usr/bin/env python3
"""A contact found from a coarse mesh, with the error of the force said beside it.

Line contact of Hertz (`demos/problems/hertz.toml`, half of a symmetric problem) without the file's own refinement: the
mesher fits cells between cylinder and block, the program refines where the force needs it, and says how far it is off.
Uniform meshes, all of whose cells are cut, tell whether that is true.

    python demos/demo_adaptive.py            # two minutes; runs/adaptive has adapted.png and adapted.gif
    python demos/demo_adaptive.py --quick    # a coarse tolerance and one uniform mesh
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from tmc_vem import RunResult, run
from tmc_vem.adapt.changes import every_cell_cut
from tmc_vem.mesh.make.change import CellTree
from tmc_vem.problems.on_mesh import OnMesh
from tmc_vem.report.animation import animate_meshes, meshes_of
from tmc_vem.simulation.adapt_settings import AdaptSettings
from tmc_vem.simulation.adaptable import fitted
from tmc_vem.simulation.problem_file import read_problem

PROBLEM = Path(__file__).parent / "problems" / "hertz.toml"
COARSE = {"mesh.refine": []}  # the file's own refinement is left out


def row(table: Table, what: str, result: RunResult, said: str) -> None:
    """Add a run to the table."""
    seconds = result.seconds["total"]
    if result.adaptivity is not None:
        seconds += sum(each.seconds for each in result.adaptivity.rounds)
    table.add_row(what, str(result.n_dofs), f"{-2.0 * (result.reaction or 0.0):.5f}", said, f"{seconds:.1f}")


def main() -> None:
    """Run adaptive and uniform meshes and compare the forces."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--quick", action="store_true", help="a coarse tolerance and one uniform mesh")
    parser.add_argument("--out", type=Path, default=Path("runs/adaptive"), help="run directory")
    arguments = parser.parse_args()
    problem, options = read_problem(PROBLEM, COARSE)
    options = replace(options, overwrite=True)
    tolerance = "0.05%" if arguments.quick else "0.01%"

    table = Table("mesh", "unknowns", "force", "estimated error", "seconds", box=SIMPLE)
    adapted = run(problem, arguments.out, replace(options, adapt=AdaptSettings("reaction", tolerance)))
    assert adapted.complete
    assert adapted.adaptivity is not None
    assert adapted.adaptivity.reached, adapted.adaptivity.reason
    for each in adapted.adaptivity.rounds:
        error = each.relative("reaction")
        assert error is not None
        force = -2.0 * each.values["reaction"]
        said = f"{100.0 * error:.3f} %"
        table.add_row(f"round {each.number}", str(each.n_dofs), f"{force:.5f}", said, f"{each.seconds:.1f}")
    row(table, "adapted, whole path", adapted, f"{100.0 * (adapted.adaptivity.last.relative('reaction') or 0.0):.3f} %")

    start, mesh = fitted(problem)
    tree = CellTree.of(mesh)
    uniform: list[RunResult] = []
    for _ in range(1 if arguments.quick else 3):
        uniform.append(run(OnMesh(start, mesh), None, options))
        row(table, "all cells cut" if len(uniform) > 1 else "first mesh", uniform[-1], "")
        change = every_cell_cut(start, mesh, tree)
        mesh, tree = change.mesh, change.tree
    Console().print(table)
    if not arguments.quick:
        finest, force = uniform[-1].reaction or 0.0, adapted.reaction or 0.0
        off = abs(force / finest - 1.0)
        print(f"adapted and finest uniform mesh differ by {100.0 * off:.3f} %, with {adapted.n_dofs} unknowns for "
              f"{uniform[-1].n_dofs}")  # fmt: skip
        assert off < 5e-4, "the adapted mesh does not have the force of the finest uniform one"
    animate_meshes(meshes_of(adapted), arguments.out / "adapted.gif")
    print(f"'tmc-vem plot {arguments.out}' makes its page; pictures: {arguments.out}/adapted.png and adapted.gif")


if __name__ == "__main__":
    main()
