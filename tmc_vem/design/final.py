"""The best design as a problem of its own, which 'tmc-vem run' solves: stiffnesses of design regions from a file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tmc_vem.design.evaluator import Evaluator
from tmc_vem.mesh.cells import centroids_and_areas
from tmc_vem.problems.own import OwnProblem
from tmc_vem.problems.stiffness_file import write_stiffness
from tmc_vem.results.design_run import FINAL, STIFFNESS
from tmc_vem.simulation.options import RunOptions
from tmc_vem.simulation.problem_file import solved_table, with_changes
from tmc_vem.support.files import write_atomically
from tmc_vem.support.toml_text import toml_text

Float = NDArray[np.float64]

HEADER = "# The design that 'tmc-vem optimise' found in {of}: 'tmc-vem run' on this file loads it.\n"


def designed(problem: OwnProblem, stiffness: Path) -> OwnProblem:
    """A problem whose design regions have the stiffnesses of a file, and whose table [design] is left out."""
    regions = {
        name: replace(region, stiffness=str(stiffness.resolve())) if region.is_design else region
        for name, region in problem.table.regions.items()
    }
    return replace(problem, table=replace(problem.table, regions=regions, design=None))


def write_final(directory: Path, evaluator: Evaluator, stiffness_c: Float, density_c: Float) -> None:
    """Write a design as ``stiffness.npz``.

    Args:
        directory: where.
        evaluator: knows the mesh and the cells of the design.
        stiffness_c, density_c: (n_cells of the mesh,) of the design.

    Raises:
        OSError: it could not be written.
    """
    cells = evaluator.parametrisation.cells
    centroid_cx = centroids_and_areas(evaluator.mesh)[0][cells]
    write_stiffness(directory / STIFFNESS, centroid_cx, stiffness_c[cells], density_c[cells])


def final_problems(problem: OwnProblem, directory: Path) -> dict[str, OwnProblem]:
    """The problem of each load case with the design in ``stiffness.npz``; under no name where there is but one.

    Raises:
        InputError: the file is no design.
    """
    design = problem.table.design
    assert design is not None
    made = designed(problem, directory / STIFFNESS)
    return {case.name: with_changes(made, case.set) for case in design.cases} or {"": made}


def write_problems(directory: Path, problems: Mapping[str, OwnProblem], options: RunOptions, of: str) -> None:
    """Write ``final.toml``, or one for each load case; the stiffness in them lies beside them.

    Args:
        directory: of the design.
        problems: by load case.
        options: how they are solved.
        of: name of the problem.
    """
    for name, problem in problems.items():
        table = solved_table(problem, options)
        for region in table["regions"].values():
            if isinstance(region.get("stiffness"), str):
                region["stiffness"] = STIFFNESS
        write_atomically(directory / f"{called(name)}.toml", HEADER.format(of=of) + toml_text(table))


def called(case: str) -> str:
    """What files of a load case are called."""
    return f"{FINAL}-{case}" if case else FINAL
