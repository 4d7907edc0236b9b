"""Assembled systems for tests: kernels by name, systems on any mesh, fields as vectors, errors of fields."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
from helpers_oracle import INSIDE, powers
from mpi4py import MPI
from numpy.typing import NDArray

from codegen.integrand import second_gradient_energy
from tmc_vem.energy.registry import DENSITIES
from tmc_vem.mesh import PolygonMesh
from tmc_vem.mesh.geometry import areas, centroids, diameters
from tmc_vem.mesh.spread.distribute import distribute
from tmc_vem.problems import Problem
from tmc_vem.system.constraints import Prescribed
from tmc_vem.vem.blocks import RegionKernel
from tmc_vem.vem.kernel.cells import CellKernel, compile_cells
from tmc_vem.vem.spaces.element_settings import ElementSettings
from tmc_vem.vem.spaces.quadrature import on_triangles, sub_triangles
from tmc_vem.vem.spaces.tabulated import points_and_values
from tmc_vem.vem.system import VemSystem

Float = NDArray[np.float64]
Field = Callable[[Float], Float]

CLAMPED = (Prescribed("boundary", 0), Prescribed("boundary", 1))


@cache
def kernel(name: str) -> CellKernel:
    """Compiled energy of the registry."""
    energy = DENSITIES[name]
    return compile_cells(second_gradient_energy(energy.density, energy.name, energy.parameters))


def region(name: str, **values: float) -> RegionKernel:
    """Energy of a region with the values of its parameters."""
    return RegionKernel(kernel(name), kernel(name).parameter_array(values))


def make_system(
    mesh: PolygonMesh | Callable[[], PolygonMesh],
    energies: Mapping[str, RegionKernel] | RegionKernel,
    prescribed: Sequence[Prescribed] = (),
    settings: ElementSettings | None = None,
    comm: Any = MPI.COMM_WORLD,
) -> VemSystem:
    """System on a mesh; one energy alone is that of every region."""
    distributed = distribute(comm, mesh if callable(mesh) else lambda: mesh)
    if isinstance(energies, RegionKernel):
        energies = dict.fromkeys(distributed.mesh.region_names, energies)
    return VemSystem(distributed, energies, prescribed, settings)


def problem_system(problem: Problem, settings: ElementSettings | None = None, comm: Any = MPI.COMM_WORLD) -> VemSystem:
    """System of a benchmark problem."""
    kernels = {name: region(r.energy.name, **r.values) for name, r in problem.regions().items()}
    return make_system(problem.make_mesh, kernels, problem.prescribed(), settings, comm)


def interpolate(system: VemSystem, field: Field) -> Any:
    """Global vector of the degrees of freedom of a displacement field (n, 2) -> (n, 2)."""
    local, _ = local_interpolant(system, field)
    work = system.dofmap.dm.createLocalVec()
    work.getArray()[:] = local.ravel()
    vector = system.create_vector()
    system.dofmap.dm.localToGlobal(work, vector, addv=False)
    return vector


def local_interpolant(system: VemSystem, field: Field) -> tuple[Float, NDArray[np.bool_]]:
    """Degrees of freedom (n_nodes, 2) on this rank, and which of the nodes are moments."""
    mesh, dofmap, edges = system.distributed.mesh, system.dofmap, system.distributed.edges
    k = dofmap.order
    values, is_moment = np.zeros((dofmap.n_nodes, 2)), np.zeros(dofmap.n_nodes, dtype=bool)
    values[dofmap.vertex_nodes] = field(mesh.points_vx)
    start, end = mesh.points_vx[edges.vertices_ev[:, 0]], mesh.points_vx[edges.vertices_ev[:, 1]]
    for i, t in enumerate(INSIDE[k]):
        values[dofmap.edge_nodes[:, i]] = field((1.0 - t) * start + t * end)
    for c in range(mesh.n_cells):
        polygon = mesh.points_vx[mesh.cell(c)]
        ((_, triangles),) = sub_triangles(polygon[None])
        points, weights = on_triangles(triangles, 12)
        xi = (points[0] - centroids(polygon[None])[0]) / diameters(polygon[None])[0]
        for a, (p, q) in enumerate(powers(k - 2)):
            m = xi[:, 0] ** p * xi[:, 1] ** q
            values[dofmap.cell_moments[c, a]] = (weights[0] * m) @ field(points[0]) / areas(polygon[None])[0]
            is_moment[dofmap.cell_moments[c, a]] = True
    return values, is_moment


def errors(system: VemSystem, u: Any, field: Field, gradient: Field) -> tuple[float, float]:
    """L2 norms of ``u - Pi_nabla u_h`` and ``grad u - Pi0 grad u_h``; ``gradient``: (n, 2) -> (n, 2, 2), du_i/dX_j."""
    nodes = system.nodal_values(u)
    mesh = system.distributed.mesh
    displacement = slope = 0.0
    for block in system.blocks:
        points, values = points_and_values(block.polygons(mesh), system.settings.order, block.scaled_points())
        weights, local = block.weights(), nodes[block.batch.nodes_ca]
        value = values @ local
        projected = np.einsum("cqja,cai->cqij", block.rows(2), local)
        flat = points.reshape(-1, 2)
        displacement += (weights[..., None] * (value - field(flat).reshape(value.shape)) ** 2).sum()
        slope += (weights[..., None, None] * (projected - gradient(flat).reshape(projected.shape)) ** 2).sum()
    return float(np.sqrt(displacement)), float(np.sqrt(slope))


def free_part(system: VemSystem, vector: Any) -> Float:
    """Copy of a vector's array with zeros at constrained entries."""
    array: Float = vector.getArray(readonly=True).copy()
    array[system.constrained()] = 0.0
    return array


def dense(matrix: Any) -> Float:
    """Matrix on one rank as a dense array."""
    n = matrix.getSize()[0]
    array: Float = matrix.getValues(range(n), range(n))
    return array


def rates(sizes: Sequence[float], values: Sequence[float]) -> Float:
    """Observed orders between consecutive sizes."""
    order: Float = np.diff(np.log(values)) / np.diff(np.log(sizes))
    return order
