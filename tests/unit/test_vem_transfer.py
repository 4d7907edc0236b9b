"""Displacements on another mesh: polynomials are carried over exactly, and nothing changes in cells that stay."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from helpers_mesh import grid, hanging, voronoi
from helpers_refined import CIRCLE, disc, squares
from helpers_system import local_interpolant, make_system, rates, region
from mpi4py import MPI
from numpy.typing import NDArray

from tmc_vem.mesh import PolygonMesh
from tmc_vem.mesh.cells import centroids_and_areas
from tmc_vem.mesh.make.change import CellTree, MeshChange
from tmc_vem.mesh.make.coarsen import coarsened
from tmc_vem.mesh.make.refine import refined
from tmc_vem.system.constraints import PrescribedAcross
from tmc_vem.system.inclined import TurnedSystem, with_axes
from tmc_vem.vem.spaces.element_settings import ElementSettings
from tmc_vem.vem.system import VemSystem
from tmc_vem.vem.transfer import transferred

Float = NDArray[np.float64]

SOLID = region("solid", K=1.0, mu=0.5)
MESHES: dict[str, Callable[[], PolygonMesh]] = {
    "squares": squares, "voronoi": lambda: voronoi(14), "hanging": lambda: hanging(3, distort=0.02),
}  # fmt: skip


def system_on(mesh: PolygonMesh, order: int = 2) -> VemSystem:
    return make_system(mesh, SOLID, (), ElementSettings(order=order), MPI.COMM_SELF)


def polynomial(degree: int) -> Callable[[Float], Float]:
    """All monomials up to a degree, none of them with a coefficient of 0."""
    rng = np.random.default_rng(degree)
    powers = [(p, q) for p in range(degree + 1) for q in range(degree + 1 - p)]
    coefficients_mi = rng.uniform(0.2, 1.0, (len(powers), 2))
    return lambda x_nx: np.stack([x_nx[:, 0] ** p * x_nx[:, 1] ** q for p, q in powers], axis=1) @ coefficients_mi


def wave(x_nx: Float) -> Float:
    x, y = x_nx.T
    return np.stack([np.sin(2.0 * x + y), np.cos(x - 3.0 * y)], axis=1)


def nodes_of(old: VemSystem, field: Callable[[Float], Float]) -> Float:
    return local_interpolant(old, field)[0]


def some(mesh: PolygonMesh) -> NDArray[np.int64]:
    """Every third cell."""
    return np.arange(0, mesh.n_cells, 3)


def changes(mesh: PolygonMesh) -> dict[str, MeshChange]:
    """Ways of changing a mesh."""
    partly = refined(mesh, some(mesh), max_hanging=3)
    return {
        "all": refined(mesh, np.arange(mesh.n_cells), max_hanging=3),
        "some": partly,
        "none": MeshChange(mesh, mesh.points_vx, np.arange(mesh.n_cells), CellTree.of(mesh)),
    }


@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("change", ["all", "some", "none"])
@pytest.mark.parametrize("mesh", MESHES)
def test_polynomials_are_carried_over_exactly(mesh: str, change: str, order: int) -> None:
    """Nodes on sides and within cells, and moments, of the whole degree k."""
    made = changes(MESHES[mesh]())[change]
    old, new = system_on(MESHES[mesh](), order), system_on(made.mesh, order)
    field = polynomial(order)
    expected_ni, is_moment = local_interpolant(new, field)
    found_ni = transferred(old, nodes_of(old, field), new, made.before_vx, made.parent_c)
    assert is_moment.any()
    assert np.abs(found_ni - expected_ni).max() < 1e-11


@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("mesh", MESHES)
def test_they_are_on_a_coarser_mesh(mesh: str, order: int) -> None:
    fine = refined(MESHES[mesh](), np.arange(MESHES[mesh]().n_cells), max_hanging=3)
    marked = np.isin(fine.tree.family_c, np.unique(fine.tree.family_c)[::2])
    coarse = coarsened(fine.mesh, fine.tree, marked, max_hanging=3)
    assert coarse.mesh.n_cells < fine.mesh.n_cells
    old, new = system_on(fine.mesh, order), system_on(coarse.mesh, order)
    field = polynomial(order)
    found_ni = transferred(old, nodes_of(old, field), new, coarse.before_vx, coarse.parent_c)
    assert np.abs(found_ni - nodes_of(new, field)).max() < 1e-11


@pytest.mark.parametrize("order", [2, 3])
def test_they_are_on_a_mesh_that_has_nothing_to_do_with_it(order: int) -> None:
    old, new = system_on(voronoi(14), order), system_on(hanging(3, distort=0.02), order)
    field = polynomial(order)
    found_ni = transferred(old, nodes_of(old, field), new)
    assert np.abs(found_ni - nodes_of(new, field)).max() < 1e-11


@pytest.mark.parametrize("parents", [True, False])
def test_other_fields_are_with_the_order_of_the_elements(parents: bool) -> None:
    """k + 1 in the largest value, that of moments included, whether the parents are known or not."""
    errors = []
    for n in (4, 8, 16):
        made = refined(grid(n, n), some(grid(n, n)), max_hanging=3)
        old, new = system_on(grid(n, n)), system_on(made.mesh)
        found_ni = transferred(old, nodes_of(old, wave), new, made.before_vx, made.parent_c if parents else None)
        errors.append(float(np.abs(found_ni - nodes_of(new, wave)).max()))
    assert min(rates([1 / 4, 1 / 8, 1 / 16], errors)) > 2.7


@pytest.mark.parametrize("order", [2, 3])
def test_cells_that_stay_keep_their_numbers(order: int) -> None:
    """Bit for bit: values of any size at nodes, moments that belong to no polynomial; also with more nodes on sides."""
    mesh = voronoi(14)
    made = changes(mesh)["some"]
    old, new = system_on(mesh, order), system_on(made.mesh, order)
    u_ni = np.random.default_rng(0).normal(size=(old.dofmap.n_nodes, 2))
    found_ni = transferred(old, u_ni, new, made.before_vx, made.parent_c)
    number = np.argsort(old.distributed.cell_ids)
    new_number = np.argsort(new.distributed.cell_ids)
    stay = np.flatnonzero(np.bincount(made.parent_c)[made.parent_c] == 1)
    assert 0 < len(stay) < mesh.n_cells
    mine = new.dofmap.cell_moments[new_number[stay]]
    before = old.dofmap.cell_moments[number[made.parent_c[stay]]]
    assert np.array_equal(found_ni[mine], u_ni[before])
    # nothing has happened to the first vertices either
    old_v, new_v = np.argsort(old.distributed.vertex_ids), np.argsort(new.distributed.vertex_ids)[: mesh.n_vertices]
    at = found_ni[new.dofmap.vertex_nodes[new_v]]
    assert np.abs(at - u_ni[old.dofmap.vertex_nodes[old_v]]).max() < 1e-12
    # and on an unchanged mesh, nothing at all
    same = changes(mesh)["none"]
    again = transferred(old, u_ni, system_on(mesh, order), same.before_vx, same.parent_c)
    assert np.abs(again - u_ni).max() < 1e-12


def test_moved_vertices_have_the_displacement_of_the_chord() -> None:
    """A vertex that was put onto the circle gets what the middle of the straight side had, not what is there."""
    mesh = disc()
    made = refined(mesh, np.arange(mesh.n_cells), max_hanging=3, flat=20.0, curves=CIRCLE)
    moved = np.flatnonzero((made.before_vx != made.mesh.points_vx).any(axis=1))
    assert len(moved) > 5
    old, new = system_on(mesh), system_on(made.mesh)
    field = polynomial(2)
    found_ni = transferred(old, nodes_of(old, field), new, made.before_vx, made.parent_c)
    nodes = new.dofmap.vertex_nodes[np.argsort(new.distributed.vertex_ids)[moved]]
    assert np.abs(found_ni[nodes] - field(made.before_vx[moved])).max() < 1e-12
    assert np.abs(found_ni[nodes] - field(made.mesh.points_vx[moved])).max() > 1e-4
    # sides and moments follow the straight cells, so that a rotation stays one
    turn = lambda x_nx: np.stack([-x_nx[:, 1], x_nx[:, 0]], axis=1)  # noqa: E731
    straight = system_on(replace(made.mesh, points_vx=made.before_vx, validate=False))
    found_ni = transferred(old, nodes_of(old, turn), new, made.before_vx, made.parent_c)
    assert np.abs(found_ni - nodes_of(straight, turn)).max() < 1e-12


def test_areas_of_cells() -> None:
    """Each is half the sum of cross products, and they fill the square."""
    mesh = hanging(3, distort=0.02)
    area_c = centroids_and_areas(mesh)[1]
    x_vx = mesh.points_vx[mesh.cell(4)]
    shifted = np.roll(x_vx, -1, axis=0)
    assert area_c[4] == pytest.approx(0.5 * (x_vx[:, 0] * shifted[:, 1] - x_vx[:, 1] * shifted[:, 0]).sum())
    assert area_c.sum() == pytest.approx(1.0)


def test_axes_of_nodes_on_an_incline() -> None:
    """A vector of displacements along x and y is turned to the axes of its nodes, and back."""
    held = PrescribedAcross("boundary", "normal", axis=(0.8, 0.6))
    system = with_axes(make_system(voronoi(14), SOLID, (held,), comm=MPI.COMM_SELF))
    assert isinstance(system, TurnedSystem)
    u_ni = np.random.default_rng(1).normal(size=(system.virtual_elements.dofmap.n_nodes, 2))
    vector = system.nodal_vector(u_ni)
    assert np.abs(system.nodal_values(vector) - u_ni).max() < 1e-14
    across = vector.getArray(readonly=True)[system.constrained()]
    assert len(across) > 10
    assert sorted(across) == pytest.approx(sorted(u_ni[system.virtual_elements.owned_nodes("boundary")] @ (0.8, 0.6)))
