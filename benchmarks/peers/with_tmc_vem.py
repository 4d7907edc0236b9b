"""Both problems in tmc-vem, with virtual elements on quadrilaterals or through dolfinx.

    .venv/bin/python benchmarks/peers/with_tmc_vem.py cbox --cells 24 12 [--method fem] [--steps 20]
    .venv/bin/python benchmarks/peers/with_tmc_vem.py box --cells 40 10

The C-box is a problem file whose energies are those of FElupe, in a file of one's own (``cbox_energy.py``). Nothing is
written by a run, as by those of the others. Without ``--steps`` load steps are automatic.
"""

from __future__ import annotations

import argparse
import dataclasses
import tempfile
from pathlib import Path
from typing import Any

from clock import Clock, say

CLOCK = Clock()

import numpy as np  # noqa: E402
from peer_problems import Box, CBox  # noqa: E402

from tmc_vem.mesh.files.io import write_mesh  # noqa: E402
from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals  # noqa: E402
from tmc_vem.problems import Box as PaperBox  # noqa: E402
from tmc_vem.problems import Medium  # noqa: E402
from tmc_vem.problems.base import Problem  # noqa: E402
from tmc_vem.simulation import RunOptions, prepare, run  # noqa: E402
from tmc_vem.simulation.problem_file import read_problem  # noqa: E402

ENERGIES = Path(__file__).resolve().with_name("cbox_energy.py")
CBOX = """\
name = "felupe_cbox"
[mesh]
file = "cbox.msh"
[regions.solid]
density = "{energies}:solid"
parameters = {{ mu = {mu!r}, lmbda = {lmbda!r} }}
[regions.medium]
density = "{energies}:medium"
parameters = {{ mu = {mu!r}, lmbda = {lmbda!r}, gamma = {gamma!r}, alpha_r = {alpha_r!r} }}
[points]
load = [{length!r}, {height!r}]
[edges]
back = {{ line = [[0.0, 0.0], [0.0, {height!r}]] }}
[[support]]
at = "back"
ux = 0
uy = 0
[load]
at = "load"
uy = {uy!r}
"""


def cbox(problem: CBox, cells: tuple[int, int], directory: Path) -> Problem:
    """The C-box as a problem file in a directory, with its mesh."""
    t, length, height = problem.wall, problem.length, problem.height
    rectangles = [
        Rectangle("medium", 0.0, length + problem.column, 0.0, height),
        Rectangle("solid", 0.0, length, 0.0, height),
        Rectangle("medium", t, length, t, height - t),
    ]
    write_mesh(structured_quadrilaterals(*problem.lines(cells), rectangles), directory / "cbox.msh")
    (directory / "cbox.toml").write_text(CBOX.format(energies=ENERGIES, **dataclasses.asdict(problem)))
    return read_problem(directory / "cbox.toml")[0]


def box(problem: Box, cells: tuple[int, int]) -> Problem:
    """The paper's box."""
    medium = Medium(gamma=problem.gamma, alpha_r=problem.alpha_r, beta=problem.beta, regulariser="huhu_lulu")
    made = PaperBox(cells=cells, medium=medium, uy=problem.uy)
    assert (made.length, made.height, made.wall) == (problem.length, problem.height, problem.wall)
    assert (made.material.K, made.material.mu) == (problem.K, problem.mu)
    return made


def made(name: str, cells: tuple[int, int], directory: Path, **changes: Any) -> Problem:
    """A problem by name."""
    if name == "cbox":
        return cbox(CBox(**changes), cells, directory)
    return box(Box(**changes), cells)


def relative_residual(system: Any, u: Any) -> float:
    """Norm of the residual at free degrees of freedom relative to that with the reactions."""
    residual = system.create_vector()
    system.residual(u, residual)
    everywhere = residual.getArray().copy()
    free = everywhere.copy()
    free[system.constrained()] = 0.0
    return float(np.linalg.norm(free) / np.linalg.norm(everywhere))


def main() -> None:
    """Solve a problem."""
    parser = argparse.ArgumentParser()
    parser.add_argument("problem", choices=("cbox", "box"))
    parser.add_argument("--cells", type=int, nargs=2, default=(12, 6))
    parser.add_argument("--method", choices=("vem", "fem"), default="vem")
    parser.add_argument("--steps", type=int)
    parser.add_argument("--keep", type=Path, help="write the last state")
    arguments = parser.parse_args()
    cells, name = tuple(arguments.cells), arguments.problem
    options = RunOptions(method=arguments.method, steps=arguments.steps)
    with tempfile.TemporaryDirectory() as directory:
        place = Path(directory)
        smallest = (12, 6) if name == "cbox" else (20, 10)
        run(made(name, smallest, place, uy=-0.01), None, RunOptions(method=arguments.method, steps=1))  # loads the rest
        CLOCK.started_up()
        with CLOCK("set-up"):
            simulation = prepare(made(name, cells, place), None, options)
        with CLOCK("run"):
            result = simulation.go()
    if not result.complete:
        raise SystemExit(f"only {result.load:g} of the load was reached: {result.reason}")
    system, u = simulation.system, result.end.give(simulation.system)
    if arguments.keep:
        points = system.node_labels()[:, :2]
        np.savez(arguments.keep, points=points, u=u.getArray().reshape(-1, 2), reaction=result.reaction)
    for part in ("assembly", "linear solve"):
        CLOCK.parts[part] = {"wall": result.seconds[part]}
    say({
        "unknowns": result.n_dofs,
        "steps": result.steps,
        "attempts": result.steps + result.cut_backs,
        "iterations": result.newton_iterations,
        "loads": [record.load for record in result.history],
        "residual": relative_residual(system, u),
        "reaction": result.reaction,
        "gap": result.gap,
        "phases": dict(result.seconds),
        "versions": {name: str(value) for name, value in result.versions.items()},
        "seconds": CLOCK.parts,
    })  # fmt: skip


if __name__ == "__main__":
    main()
