#!/usr/bin/env python3
"""A C-shape that rests on itself: topology optimisation with self-contact.

The tip of the upper arm is pushed down by five times the width of the slot between both arms
(`demos/problems/design_c.toml`), and the design, 70 % of the plate, is to resist as much as it can. The upper arm
alone cannot use so much material: what is left helps only where the upper arm comes to rest on the lower one. A design
that is made for a displacement so small that nothing touches knows nothing of that.

The force is compared with that of the design for small displacements, as it is, with whatever contact it happens to
make, and without contact, in proportion to the displacement. The search is done from two starts; and the best design is
meshed along its outlines, with real void as medium, and loaded once more: the number that a designer wants.

    python demos/demo_design_c.py            # some minutes
    python demos/demo_design_c.py --quick    # a coarse grid and few designs
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from tmc_vem import RunResult, run
from tmc_vem.design.extract import DesignMaterials, extracted_problem
from tmc_vem.design.extract_files import write_extracted
from tmc_vem.design.final import designed
from tmc_vem.design.session import optimise
from tmc_vem.simulation.problem_file import read_problem

PROBLEM = Path(__file__).parent / "problems" / "design_c.toml"
SMALL = -0.004  # displacement at which nothing touches
BETTER, SAME, CONFIRMED = 1.2, 0.02, 0.05  # factor of the force, and what two starts and the outlines may differ by
QUICK: dict[str, Any] = {
    "mesh.size": 1 / 30,
    "design.iterations": 12,
    "design.filter.radius": 0.07,
    "design.passive": [  # walls of the slot would be thinner than a cell
        {"is": "void", "box": [0.2, 0.2333, 1, 0.2667]},
        {"is": "solid", "box": [0.95, 0.4667, 1, 0.5]},
    ],
}


def search(name: str, changes: dict[str, Any], out: Path) -> float:
    """Find a design, which is then in the directory ``out / name``; its force at the displacement it was made for."""
    problem, options = read_problem(PROBLEM, changes)
    found = optimise(problem, out / name, replace(options, overwrite=True))
    return -found.values["reaction"]


def load(name: str, changes: dict[str, Any], out: Path) -> RunResult:
    """Push the tip of a design all the way down."""
    problem, options = read_problem(PROBLEM, changes)
    made = designed(problem, out / name / "stiffness.npz")
    result = run(made, out / name / "pushed", replace(options, overwrite=True))
    assert result.complete, result.reason
    return result


def fitted(name: str, changes: dict[str, Any], out: Path) -> tuple[RunResult, float]:
    """The same of the design by its outlines, and by how much its volume differs."""
    problem, options = read_problem(PROBLEM, changes)
    mesh, region = problem.make_mesh(), problem.table.regions["design"]
    assert region.solid is not None
    assert region.medium is not None
    materials = {"design": DesignMaterials(region.solid, region.medium)}
    bare = replace(problem, table=replace(problem.table, design=None))
    density_c = np.load(out / name / "stiffness.npz")["density_c"]  # all cells are of the design, in their order
    extracted = extracted_problem(bare, mesh, density_c, materials)
    _, made = write_extracted(extracted, out / "outlines")
    result = run(made, out / "outlines" / "run", replace(options, overwrite=True))
    assert result.complete, result.reason
    return result, extracted.volume_mesh / extracted.outlines.volume_densities - 1.0


def draw(results: dict[str, RunResult], without: float, path: Path) -> None:
    """Forces over the displacement."""
    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    axes = figure.subplots()
    for name, result in results.items():
        u = np.array([-step.displacement for step in result.history])
        axes.plot(u, [-step.reaction for step in result.history], ".-", markersize=3, linewidth=0.9, label=name)
    end = -next(iter(results.values())).history[-1].displacement
    axes.plot([0.0, end], [0.0, without], "k--", linewidth=0.9, label="for small displacements, no contact")
    axes.set(xlabel="displacement of the tip", ylabel="force, per thickness", xlim=(0.0, None), ylim=(0.0, None))
    axes.legend(frameon=False)
    figure.savefig(path, dpi=150)


def main() -> None:
    """Search, load, compare and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a coarse grid and few designs")
    parser.add_argument("--out", type=Path, default=Path("runs/demo_design_c"), help="where the directories go")
    options = parser.parse_args()
    changes, out = (QUICK if options.quick else {}), options.out
    best = search("contact", changes, out)
    small = search("small", {**changes, "load.uy": SMALL}, out)
    results = {"with contact": load("contact", changes, out), "for small displacements": load("small", changes, out)}
    touching = -results["for small displacements"].history[-1].reaction
    full = -results["with contact"].history[-1].displacement
    without = small * full / -SMALL

    table = Table(title="Force at the full displacement", box=SIMPLE, padding=(0, 1))
    for heading in ("design", "force", "contact to it"):
        table.add_column(heading, justify="left" if heading == "design" else "right")
    rows = [("with contact", best), ("for small displacements, no contact", without)]
    rows.append(("the same with the contact it makes", touching))
    if not options.quick:
        again = search("again", {"design.noise": 0.3, "design.seed": 1}, out)
        fit, volume = fitted("contact", changes, out)
        results["by its outlines"] = fit
        rows.append(("with contact, from another start", again))
        rows.append(("with contact, by its outlines", -fit.history[-1].reaction))
    for name, force in rows:
        table.add_row(name, f"{force:.5f}", f"{best / force:.3f}")
    Console().print(table)
    draw(results, without, out / "design_c.png")
    print(f"forces: {out / 'design_c.png'}; design: {out / 'contact' / 'report.html'}")
    if not options.quick:
        print(f"volume by outlines {volume:+.2%}")
        assert best / without > BETTER
        assert abs(again / best - 1.0) < SAME
        assert abs(-fit.history[-1].reaction / best - 1.0) < CONFIRMED
    assert best > touching


if __name__ == "__main__":
    main()
