"""Adaptive meshes against uniform ones: estimated and true errors, unknowns, times, and states that are carried over.

    OMP_NUM_THREADS=1 python benchmarks/adaptivity.py               # a quarter of an hour
    OMP_NUM_THREADS=1 python benchmarks/adaptivity.py hertz         # one problem

Uniform meshes are those of the problem's file with equal cells everywhere, adaptive ones begin with few cells. Times of
adaptive runs count all rounds, estimates and the path with the last mesh. The tables of docs/howto/adaptive-meshes.md
are made by ``scripts/refresh-numbers docs/howto/adaptive-meshes.md``.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tmc_vem import RunOptions, run
from tmc_vem.adapt.carried import carried
from tmc_vem.adapt.changes import every_cell_cut
from tmc_vem.adapt.solved import loaded, prepared
from tmc_vem.mesh.make.change import CellTree
from tmc_vem.problems.base import Problem
from tmc_vem.problems.on_mesh import OnMesh
from tmc_vem.results.adaptivity import SOLVED
from tmc_vem.results.run_result import RunResult
from tmc_vem.simulation.adapt_settings import AdaptSettings
from tmc_vem.simulation.adaptable import fitted
from tmc_vem.simulation.problem_file import read_problem

DEMOS = Path(__file__).resolve().parents[1] / "demos"
sys.path.insert(0, str(DEMOS))
PROBLEMS = DEMOS / "problems"
BOX = """
name = "box_pad"
gap = ["upper", "lower"]
[shapes]
outer = { rectangle = [0, 0, 2, 0.5] }
hollow = { rectangle = [0.1, 0.1, 1.9, 0.4] }
[regions.box]
shape = "outer - hollow"
solid = { K = 20, mu = 10 }
[regions.medium]
shape = "hollow"
medium = { regulariser = "huhu", beta = 0, alpha = 2.5, mu = 10, gamma = 1e-5 }
[mesh]
cells = "quadrilaterals"
size = 0.1
[points]
upper = [1.0, 0.4]
lower = [1.0, 0.1]
[edges]
feet = { line = [[0, 0], [2, 0]] }
pad = { line = [[0.8, 0.5], [1.2, 0.5]] }
[[support]]
at = "feet"
ux = 0
uy = 0
[load]
at = "pad"
uy = -0.31
"""


@dataclass(frozen=True)
class Case:
    """A problem that is adapted.

    Attributes:
        file: its file.
        changes: other values for entries of it.
        of: what its mesh is adapted to, one result at a time, and relative tolerances.
        sizes: of cells of uniform meshes.
    """

    file: str
    changes: Mapping[str, Any]
    of: Mapping[str, tuple[str, ...]]
    sizes: tuple[float, ...]


CASES = {
    "hertz": Case(
        "hertz.toml",
        {"mesh.refine": []},
        {"reaction": ("0.5%", "0.05%", "0.01%"), "gap": ("10%", "5%", "2%")},
        (0.016, 0.0125, 0.01),
    ),
    "cbox": Case(
        "cbox_pad.toml",
        {},
        {"reaction": ("1%", "0.5%", "0.2%"), "gap": ("0.5%", "0.2%")},
        (0.05, 0.025, 0.0125, 0.00625),
    ),
    "box": Case(
        "box",
        {},
        {"reaction": ("2%", "1%", "0.7%"), "gap": ("5%", "2%", "1%")},
        (0.05, 0.025, 0.0125, 0.00625),
    ),
}  # fmt: skip


def problem_of(case: Case, size: float | None = None) -> tuple[Problem, RunOptions]:
    """Problem and options of a case, with its own cells or with equal ones."""
    changes = dict(case.changes) if size is None else {**case.changes, "mesh.size": size}
    path = PROBLEMS / case.file
    if case.file == "box":
        from tempfile import TemporaryDirectory

        with TemporaryDirectory() as directory:
            path = Path(directory) / "box.toml"
            path.write_text(BOX)
            problem, options = read_problem(path, changes)
    else:
        problem, options = read_problem(path, changes)
    return (fitted(problem)[0] if size is None else problem), options


def pressures(result: RunResult) -> dict[str, float]:
    """Of line contact: mean pressure over the inner 15 % of Hertz' half width, and the peak of a fit."""
    from demo_hertz import analytic, fitted, pressure

    assert result.reaction is not None
    x, p, _ = pressure(result, "block")
    half_width = analytic(-2.0 * result.reaction)[0]
    mean = float(np.interp(np.linspace(0.0, 0.15 * half_width, 200), x, p).mean())
    return {"inner pressure": mean, "peak pressure": fitted(result, "block").pressure}


def summary(name: str, result: RunResult, seconds: float) -> dict[str, Any]:
    """What is told of a run."""
    values = {"reaction": result.reaction, "gap": result.gap}
    if name == "hertz":
        values |= pressures(result)
    rounds = [] if result.adaptivity is None else result.adaptivity.as_dict()["rounds"]
    iterations = result.newton_iterations
    return {"n_dofs": result.n_dofs, "iterations": iterations, "seconds": seconds, "values": values, "rounds": rounds}


def uniform(name: str) -> list[dict[str, Any]]:
    """Runs of a case on uniform meshes, the coarsest first."""
    found = []
    for size in CASES[name].sizes:
        began = time.perf_counter()
        problem, options = problem_of(CASES[name], size)
        result = run(problem, None, options)
        found.append({**summary(name, result, time.perf_counter() - began), "size": size})
    return found


def adaptive(name: str, of: str) -> list[dict[str, Any]]:
    """Runs of a case on meshes that are adapted to a result."""
    found = []
    for tolerance in CASES[name].of[of]:
        began = time.perf_counter()
        problem, options = problem_of(CASES[name])
        result = run(problem, None, replace(options, adapt=AdaptSettings(of, tolerance)))
        found.append({**summary(name, result, time.perf_counter() - began), "tolerance": tolerance})
    return found


def reference(runs: list[dict[str, Any]], of: str) -> float:
    """The value of the most refined round whose estimate is from a refined problem that was solved, corrected by it."""
    rounds = [each for run_ in runs for each in run_["rounds"] if each["estimate"] == SOLVED]
    last = max(rounds, key=lambda each: each["n_dofs"])
    return float(last["values"][of] + last["errors"].get(of, 0.0))


def carried_over(name: str) -> dict[str, Any]:
    """How a state at full load goes on where all cells are cut: iterations, against those from the beginning."""
    problem, options = problem_of(CASES[name])
    mesh = problem.make_mesh()
    solved = loaded(prepared(OnMesh(problem, mesh), options), mesh)
    change = every_cell_cut(problem, mesh, CellTree.of(mesh))
    other = carried(solved, change, OnMesh(problem, change.mesh))
    again = run(OnMesh(problem, change.mesh), None, options)
    return {
        "n_dofs": other.simulation.n_dofs,
        "found": other.found,
        "iterations": other.iterations,
        "from_start": again.newton_iterations,
        "difference": abs(other.values()["reaction"] / (again.reaction or 1.0) - 1.0),
    }


def main(names: list[str]) -> None:
    """Measure and print."""
    for name in names or list(CASES):
        case = CASES[name]
        print(f"== {name}")
        print("carried over:", carried_over(name), flush=True)
        by_result = {of: adaptive(name, of) for of in case.of}
        exact = {of: reference(runs, of) for of, runs in by_result.items()}
        print("references:", exact)
        for of, runs in by_result.items():
            for each in runs:
                told = {key: value for key, value in each["values"].items() if value is not None}
                off = {key: f"{100.0 * (told[key] / exact[key] - 1.0):+.3f} %" for key in exact}
                print(f"adapted to {of}, {each['tolerance']}: {each['n_dofs']} unknowns, {each['seconds']:.1f} s,",
                      f"{each['iterations']} iterations at the end, {told}, off by {off}", flush=True)  # fmt: skip
            for each in runs[-1]["rounds"]:
                error = exact[of] - each["values"][of]
                estimate = each["errors"].get(of, math.nan)
                effect = f"{estimate:.3g} estimated, {error:.3g} true, effectivity {estimate / error:.2f}"
                found = f"{each['found']}, {each['iterations']} and {each['refined_iterations']} iterations"
                text = f"{each['n_dofs']} unknowns, {effect}, {each['estimate']}, {found}, {each['seconds']:.1f} s"
                print(f"   round {each['number']}: {text}")
        for each in uniform(name):
            told = {key: value for key, value in each["values"].items() if value is not None}
            off = {key: f"{100.0 * (told[key] / exact[key] - 1.0):+.3f} %" for key in exact}
            print(f"uniform {each['size']}: {each['n_dofs']} unknowns, {each['seconds']:.1f} s, {told}, off by {off}",
                  flush=True)  # fmt: skip


if __name__ == "__main__":
    main(sys.argv[1:])
