"""The problem of a run directory on the mesh that it was adapted to."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.mesh.stored import DAMAGED, mesh_of
from tmc_vem.problems.base import Problem
from tmc_vem.problems.on_mesh import OnMesh
from tmc_vem.simulation.adapt_settings import AdaptSettings
from tmc_vem.simulation.options import RunOptions
from tmc_vem.support.errors import InputError

MESH = "adapt/mesh.npz"  # of a run directory: the mesh that rounds have ended with


def on_mesh(problem: Problem, mesh: PolygonMesh, settings: AdaptSettings) -> OnMesh:
    """A problem on a mesh that was adapted; its inputs are those of the problem that was asked for."""
    return OnMesh(problem, mesh, asdict(settings))


def on_adapted_mesh(directory: Path, problem: Problem, options: RunOptions) -> tuple[Problem, RunOptions]:
    """Problem and options of the run on the last mesh in a directory; the same ones if no mesh was adapted there.

    Raises:
        InputError: a file is damaged.
    """
    if not (directory / MESH).is_file():
        return problem, options
    try:
        with np.load(directory / MESH, allow_pickle=False) as file:
            mesh = mesh_of(file)
    except DAMAGED as error:
        raise InputError(f"{directory / MESH} is damaged ({error}): run it again with --overwrite") from None
    return on_mesh(problem, mesh, options.adapt), replace(options, adapt=AdaptSettings())
