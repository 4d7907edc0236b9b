"""Systems, meshes and states that the finite element tests share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from numpy.typing import NDArray

pytest.importorskip("dolfinx", reason="dolfinx is not installed")

from tmc_vem.energy import Regulariser
from tmc_vem.fem import compat
from tmc_vem.fem.system import FemSystem
from tmc_vem.mesh import PolygonMesh
from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
from tmc_vem.problems import Material, Medium, Problem
from tmc_vem.problems.base import RegionEnergy, medium_region, solid_region
from tmc_vem.system.constraints import Prescribed
from tmc_vem.system.fem_settings import FemSettings

Float = NDArray[np.float64]
Field = Callable[[Float], Float]

REGULARISERS = ("huhu", "huhu_lulu", "angle", "tangent")
CLAMPED = (Prescribed("boundary", 0), Prescribed("boundary", 1))


def grid(nx: int, ny: int, *, distort: float = 0.0, length: float = 1.0, height: float = 1.0) -> PolygonMesh:
    """Quadrilaterals on a rectangle, the inner nodes moved at random by a fraction of the spacing; all edges named."""
    mesh = structured_quadrilaterals(
        np.linspace(0.0, length, nx + 1), np.linspace(0.0, height, ny + 1), [Rectangle("all", 0.0, length, 0.0, height)]
    )
    points = np.array(mesh.points_vx)
    inner = (points > 1e-9).all(axis=1) & (points < np.array([length, height]) - 1e-9).all(axis=1)
    shift = np.random.default_rng(4).uniform(-1.0, 1.0, points.shape) * distort * [length / nx, height / ny]
    points[inner] += shift[inner]
    edges = mesh.edges
    border = edges.vertices_ev[edges.n_cells_e == 1]
    return PolygonMesh(
        points, mesh.cell_offsets, mesh.cell_vertices, mesh.region_c, mesh.region_names,
        {"corner": 0}, {"boundary": border},
    )  # fmt: skip


def layered(nx: int = 4, ny: int = 4, distort: float = 0.15) -> PolygonMesh:
    """Medium between two layers of solid."""
    mesh = grid(nx, ny, distort=distort)
    row = np.arange(mesh.n_cells) // nx
    region = ((row > 0) & (row < ny - 1)).astype(np.int64)
    return PolygonMesh(
        mesh.points_vx, mesh.cell_offsets, mesh.cell_vertices, region, ("solid", "medium"), mesh.named_points,
        mesh.named_edges,
    )  # fmt: skip


def medium(regulariser: str | Regulariser = "huhu_lulu", beta: float = 2.0, **values: Any) -> RegionEnergy:
    """Third medium that is stiff enough to matter in tests."""
    chosen = {"gamma": 0.3, "alpha_r": 0.7, **values}
    return medium_region(Medium(beta=beta, regulariser=regulariser, **chosen), mu=1.5)


SOLID = solid_region(Material(K=3.0, mu=1.5))


def make_system(
    mesh: PolygonMesh,
    energy: RegionEnergy | dict[str, RegionEnergy],
    prescribed: Sequence[Prescribed] = (),
    **settings: Any,
) -> FemSystem:
    """System on a mesh; one energy alone is that of every region."""
    regions = energy if isinstance(energy, dict) else dict.fromkeys(mesh.region_names, energy)
    return FemSystem(MPI.COMM_WORLD, lambda: mesh, regions, prescribed, FemSettings(**settings))


def problem_system(problem: Problem, comm: Any = MPI.COMM_WORLD, **settings: Any) -> FemSystem:
    """System of a benchmark problem."""
    return FemSystem(comm, problem.make_mesh, problem.regions(), problem.prescribed(), FemSettings(**settings))


def random_vector(system: FemSystem, seed: int, size: float) -> Any:
    """Vector of random numbers in [-size, size]."""
    vector = system.create_vector()
    array = vector.getArray()
    array[:] = np.random.default_rng(seed).uniform(-size, size, len(array))
    return vector


def wavy(x: Float) -> Float:
    """A smooth displacement with large rotations and second gradients, J > 0."""
    return 0.12 * np.stack([np.sin(2.0 * x[:, 0] + x[:, 1]), np.cos(x[:, 0] - 2.5 * x[:, 1])], axis=1)


def integral(system: FemSystem, u: Any, form: Any) -> float:
    """Assemble a scalar form of the system's function at ``u``."""
    system.energy(u)  # writes u into the function that the forms refer to
    return compat.assemble_scalar(compat.form(form))


def rates(sizes: Sequence[float], values: Sequence[float]) -> Float:
    """Observed orders between consecutive sizes."""
    order: Float = np.diff(np.log(values)) / np.diff(np.log(sizes))
    return order
