"""Welding with hanging nodes, parts of meshes, and the box with a finer medium."""

from __future__ import annotations

import numpy as np
import pytest

from tmc_vem.mesh import PolygonMesh, Rectangle, structured_quadrilaterals
from tmc_vem.mesh.check import find_faults
from tmc_vem.mesh.geometry import areas
from tmc_vem.mesh.make.outline import Arc, Region
from tmc_vem.mesh.make.voronoi import voronoi_mesh
from tmc_vem.mesh.make.weld import weld
from tmc_vem.mesh.parts import submesh, with_names
from tmc_vem.problems import Box
from tmc_vem.support.errors import InputError


def grid(nx, ny, x=(0.0, 1.0), y=(0.0, 1.0), name="domain"):
    return structured_quadrilaterals(
        np.linspace(*x, nx + 1), np.linspace(*y, ny + 1), [Rectangle(name, x[0], x[1], y[0], y[1])]
    )


def total_area(mesh):
    return sum(areas(mesh.points_vx[loop][None])[0] for loop in mesh.cells())


@pytest.mark.parametrize("ratio", [1, 2, 3, 4, 8])
def test_a_finer_neighbour_gives_hanging_nodes(ratio):
    left, right = grid(2, 2, name="a"), grid(ratio, 2 * ratio, (1.0, 2.0), name="b")
    mesh = weld([left, right])
    assert not find_faults(mesh)
    assert mesh.n_cells == left.n_cells + right.n_cells
    assert mesh.n_vertices == left.n_vertices + right.n_vertices - 3
    assert total_area(mesh) == pytest.approx(2.0, rel=1e-14)
    assert sorted(mesh.n_sides_c[:4].tolist()) == [4, 4, 3 + ratio, 3 + ratio]
    assert (mesh.n_sides_c[4:] == 4).all()
    for c, loop in enumerate(mesh.cells()):  # no cell has moved
        before = left if c < 4 else right
        corners = before.points_vx[before.cell(c if c < 4 else c - 4)].tolist()
        assert all(corner in mesh.points_vx[loop].tolist() for corner in corners)


def test_both_sides_may_have_hanging_nodes():
    mesh = weld([grid(1, 3), grid(1, 2, (1.0, 2.0))])
    assert not find_faults(mesh)
    assert mesh.n_sides_c.tolist() == [4, 5, 4, 5, 5]


def test_welding_is_idempotent_and_needs_a_mesh():
    mesh = weld([grid(2, 2), grid(3, 4, (1.0, 2.0))])
    again = weld([mesh])
    assert (again.cell_vertices == mesh.cell_vertices).all()
    assert (again.points_vx == mesh.points_vx).all()
    with pytest.raises(InputError, match="at least one mesh"):
        weld([])


def test_names_survive_and_named_edges_are_split():
    left = with_names(grid(1, 1), {"corner": (1.0, 1.0)}, {"side": ((1.0, 0.0), (1.0, 1.0))})
    right = with_names(grid(1, 4, (1.0, 2.0)), {"corner": (1.0, 1.0), "far": (2.0, 0.0)})
    mesh = weld([left, right])
    assert len(mesh.named_edges["side"]) == 4
    assert mesh.points_vx[mesh.named_vertex("corner")].tolist() == [1.0, 1.0]
    assert mesh.points_vx[mesh.named_vertex("far")].tolist() == [2.0, 0.0]
    other = with_names(grid(1, 1, (1.0, 2.0)), {"corner": (2.0, 1.0)})
    with pytest.raises(InputError, match=r"named point 'corner' is at \(1, 1\) in one mesh and at \(2, 1\)"):
        weld([left, other])


def test_overlapping_parts_are_refused():
    with pytest.raises(InputError, match="overlap"):
        weld([grid(1, 1), grid(1, 1)])


def test_different_chords_of_one_curve():
    """Polygons inside a circle of 12 segments and outside of one of 16: both get all nodes."""
    disc = voronoi_mesh([Region("disc", [Arc((0, 0), 1, 0, 180), Arc((0, 0), 1, 180, 360)])], 0.5)
    square = [(-2.0, -2.0), (2.0, -2.0), (2.0, 2.0), (-2.0, 2.0)]
    hole = [Arc((0, 0), 1, 0, 180), Arc((0, 0), 1, 180, 360)]
    around = voronoi_mesh([Region("around", square, [hole])], 0.36)
    chord = 1.0 - np.cos(0.25)
    mesh = weld([disc, around], off_side=chord)
    assert not find_faults(mesh)
    assert total_area(mesh) == pytest.approx(16.0, rel=1e-12)
    exact = weld([disc, around])  # without the tolerance the curve stays open between the shared nodes
    assert exact.edges.n_cells_e.tolist().count(1) > mesh.edges.n_cells_e.tolist().count(1)


def test_submesh_keeps_what_is_left_of_the_names():
    mesh = with_names(grid(3, 1), {"a": (0.0, 0.0), "b": (1.0, 0.0)}, {"low": ((0.0, 0.0), (1.0, 0.0))})
    part = submesh(mesh, [0, 1])
    assert dict(part.named_points) == {"a": 0}
    assert len(part.named_edges["low"]) == 2
    with pytest.raises(InputError, match="at least one cell"):
        submesh(mesh, np.zeros(3, dtype=bool))
    with pytest.raises(InputError, match="no edge of the mesh lies on the line"):
        with_names(mesh, lines={"x": ((0.0, 0.5), (1.0, 0.5))})
    with pytest.raises(InputError, match="named point 'p'"):
        with_names(mesh, {"p": (0.5, 0.5)})
    with pytest.raises(InputError, match="has no length"):
        with_names(mesh, lines={"x": ((0.0, 0.5), (0.0, 0.5))})


@pytest.mark.parametrize("ratio", [1, 2, 4, 8])
def test_box_with_a_finer_medium(ratio):
    mesh = Box(cells=(20, 5), medium_refinement=ratio).make_mesh()
    assert not find_faults(mesh)
    area = dict.fromkeys(mesh.region_names, 0.0)
    for c, loop in enumerate(mesh.cells()):
        area[mesh.region_names[mesh.region_c[c]]] += areas(mesh.points_vx[loop][None])[0]
    assert area == pytest.approx({"solid": 0.46, "medium": 0.54})
    assert set(mesh.named_points) == {"support_left", "support_right", "load", "flange_top", "flange_bottom"}
    assert isinstance(mesh, PolygonMesh)


def test_box_refuses_a_refinement_of_zero():
    with pytest.raises(InputError, match="medium_refinement = 0"):
        Box(medium_refinement=0)
