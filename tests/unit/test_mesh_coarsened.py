"""Coarsening: families become their parent again, exactly, and only those that may."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers_mesh import SHAPES, mesh_of
from helpers_refined import (
    CIRCLE,
    MESHES,
    area_of,
    disc,
    interface_vertices,
    most_hanging,
    squares,
)

from tmc_vem.mesh import PolygonMesh, Rectangle, structured_quadrilaterals
from tmc_vem.mesh.check import find_faults
from tmc_vem.mesh.make.change import CellTree
from tmc_vem.mesh.make.coarsen import coarsened
from tmc_vem.mesh.make.refine import refined
from tmc_vem.mesh.make.weld import weld
from tmc_vem.support.errors import InputError


def all_of(mesh):
    return np.ones(mesh.n_cells, dtype=bool)


def assert_same(mesh, first):
    """The same arrays to the last bit, in the same order."""
    for name in ("points_vx", "cell_offsets", "cell_vertices", "region_c"):
        assert np.array_equal(getattr(mesh, name), getattr(first, name)), name
    assert mesh.region_names == first.region_names
    assert dict(mesh.named_points) == dict(first.named_points)
    for name in ("named_edges", "cell_data"):
        old, new = getattr(first, name), getattr(mesh, name)
        assert set(old) == set(new)
        for key, values in old.items():
            assert np.array_equal(new[key], values), key


def taken_back(mesh, tree, **options):
    """The mesh after everything is coarsened as often as it takes, and its tree."""
    while len(tree.size_f):
        change = coarsened(mesh, tree, all_of(mesh), **options)
        assert change.mesh.n_cells < mesh.n_cells, "stuck"
        assert not find_faults(change.mesh)
        mesh, tree = change.mesh, change.tree
    return mesh, tree


# -- what was refined comes back ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("curves", [(), CIRCLE], ids=["straight", "curved"])
@pytest.mark.parametrize("flat", [0.0, 20.0])
@pytest.mark.parametrize("levels", [1, 2, 3])
@pytest.mark.parametrize("name", MESHES)
def test_all_levels_are_taken_back_exactly(name, levels, flat, curves):
    first = mesh = MESHES[name](size=0.15) if name == "voronoi" else MESHES[name]()
    tree = CellTree.of(mesh)
    for _ in range(levels):
        change = refined(mesh, all_of(mesh), tree=tree, flat=flat, curves=curves)
        mesh, tree = change.mesh, change.tree
    assert tree.level_c.min() == levels or name == "letters"
    mesh, tree = taken_back(mesh, tree, flat=flat)
    assert_same(mesh, first)
    for name, values in vars(CellTree.of(first)).items():
        assert np.array_equal(getattr(tree, name), values), name


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("name", MESHES)
def test_random_sequences(name, seed):
    """Limits hold after every step, areas stay, and in the end the first mesh is there again."""
    rng = np.random.default_rng(seed)
    first = mesh = disc(0.15, seed) if name == "voronoi" else MESHES[name]()
    limit, flat, curves = 1 + seed % 2, 20.0 * (seed % 3 > 0), CIRCLE if seed > 2 else ()
    tree = CellTree.of(mesh)
    for step in range(6):
        marked = rng.random(mesh.n_cells) < rng.choice([0.1, 0.3, 0.8])
        if step % 3 < 2:
            change = refined(mesh, marked, tree=tree, flat=flat, curves=curves, max_hanging=limit)
        else:
            change = coarsened(mesh, tree, marked | (rng.random(mesh.n_cells) < 0.5), flat=flat, max_hanging=limit)
        assert not find_faults(change.mesh)
        assert len(change.parent_c) == change.mesh.n_cells
        assert (change.mesh.region_c == mesh.region_c[change.parent_c]).all()
        assert (change.mesh.cell_data["modulus"] == mesh.cell_data["modulus"][change.parent_c]).all()
        mesh, tree = change.mesh, change.tree
        if name != "letters":  # which has more from the beginning
            assert most_hanging(mesh, flat, tree.born_v) <= limit
        if not curves:
            for region in first.region_names:
                assert area_of(mesh, region) == pytest.approx(area_of(first, region), rel=1e-12)
    assert tree.level_c.max() >= 2 or name == "letters"
    mesh, _ = taken_back(mesh, tree, flat=flat, max_hanging=limit)
    assert_same(mesh, first)


@pytest.mark.parametrize("name", SHAPES)
def test_any_polygon_comes_back(name):
    first = mesh = mesh_of(SHAPES[name])
    tree = None
    for _ in range(2):
        change = refined(mesh, all_of(mesh), tree=tree)
        mesh, tree = change.mesh, change.tree
    assert_same(taken_back(mesh, tree)[0], first)


def test_nodes_that_hung_before_hang_again():
    coarse = structured_quadrilaterals([0, 1, 2], [0, 1], [Rectangle("a", 0, 2, 0, 1)])
    fine = structured_quadrilaterals([2, 3], np.linspace(0, 1, 5), [Rectangle("b", 2, 3, 0, 1)])
    first = weld([coarse, fine])
    change = refined(first, [0, 1, 3])
    assert_same(taken_back(change.mesh, change.tree)[0], first)


# -- what is joined, and what is not -----------------------------------------------------------------------------------


def test_a_family_by_hand():
    """The first of two squares, cut and joined: numbers, parents, and the tree in between."""
    first = structured_quadrilaterals([0, 1, 2], [0, 1], [Rectangle("a", 0, 2, 0, 1)])
    change = refined(first, [0])
    assert change.tree.family_c.tolist() == [0, 0, 0, 0, -1]
    assert change.tree.level_c.tolist() == [1, 1, 1, 1, 0]
    assert [change.tree.size_f.tolist(), change.tree.above_f.tolist()] == [[4], [-1]]
    deeper = refined(change.mesh, [2], tree=change.tree, max_hanging=9)
    assert deeper.tree.family_c.tolist() == [0, 0, 1, 1, 1, 1, 0, -1]
    assert deeper.tree.above_f.tolist() == [-1, 0]
    assert coarsened(deeper.mesh, deeper.tree, [0, 1, 6]).mesh is deeper.mesh  # not all are there
    back = coarsened(deeper.mesh, deeper.tree, [4, 2, 3, 5, 0])
    assert_same(back.mesh, change.mesh)
    assert back.parent_c.tolist() == [0, 1, 2, 6, 7]
    assert (back.before_vx == back.mesh.points_vx).all()
    assert coarsened(back.mesh, back.tree, [0, 1, 2]).mesh is back.mesh  # not all are marked
    assert_same(coarsened(back.mesh, back.tree, [0, 1, 2, 3]).mesh, first)


def test_a_joined_cell_may_not_get_too_many_hanging_nodes():
    """Left of two squares once, right of them twice: four edges along the left one's side."""
    first = structured_quadrilaterals([0, 1, 2], [0, 1], [Rectangle("a", 0, 2, 0, 1)])
    one = refined(first, [0, 1])
    two = refined(one.mesh, np.arange(4, 8), tree=one.tree)
    assert two.mesh.n_cells == 4 + 16
    left = np.arange(4)
    for max_hanging, n_cells in ((1, 20), (2, 20), (3, 17)):
        change = coarsened(two.mesh, two.tree, left, max_hanging=max_hanging)
        assert change.mesh.n_cells == n_cells
    right = coarsened(two.mesh, two.tree, np.arange(4, 20))
    assert_same(right.mesh, one.mesh)
    both = coarsened(two.mesh, two.tree, all_of(two.mesh))  # all at once: the nodes that would be too many go as well
    assert both.mesh.n_cells == 5
    assert_same(coarsened(both.mesh, both.tree, all_of(both.mesh)).mesh, first)


def test_refused_families_refuse_others():
    """Three squares of levels 1, 2, 3: families of the middle one are held by the right one, and hold the left one."""
    first = structured_quadrilaterals([0, 1, 2, 3], [0, 1], [Rectangle("a", 0, 3, 0, 1)])
    one = refined(first, [0, 1, 2])
    two = refined(one.mesh, np.arange(4, 12), tree=one.tree)
    three = refined(two.mesh, np.arange(20, 36), tree=two.tree)
    assert three.tree.level_c.tolist() == [1] * 4 + [2] * 16 + [3] * 64
    marked = three.tree.level_c < 3
    change = coarsened(three.mesh, three.tree, marked)
    center = [three.mesh.points_vx[loop].mean(axis=0)[0] for loop in three.mesh.cells()]
    assert np.sort(center)[0] < 1.0
    # families of the middle square at its right side stay, so the left one, which its left families let go, is joined
    assert sorted(change.tree.level_c.tolist()) == [0] + [1] * 2 + [2] * 8 + [3] * 64
    assert most_hanging(change.mesh, 0.0, change.tree.born_v) == 1


def test_a_moved_vertex_stays_until_both_sides_are_coarse():
    first = disc(0.15)
    change = refined(first, all_of(first), flat=20.0, curves=CIRCLE)
    inside = first.region_names.index("disc")
    half = coarsened(change.mesh, change.tree, change.mesh.region_c == inside, flat=20.0)
    assert half.mesh.n_cells < change.mesh.n_cells
    assert len(interface_vertices(half.mesh)) == len(interface_vertices(change.mesh))
    assert area_of(half.mesh, "disc") == pytest.approx(area_of(change.mesh, "disc"), rel=1e-12)
    whole = coarsened(half.mesh, half.tree, all_of(half.mesh), flat=20.0)
    assert len(interface_vertices(whole.mesh)) * 2 == len(interface_vertices(half.mesh))
    assert_same(whole.mesh, first)


def test_a_family_is_not_joined_to_a_polygon_that_crosses_itself():
    """A thin cell below a deep arc of its neighbours, whose vertices were put there by hand."""
    first = PolygonMesh.from_cells(
        [(0, 0), (1, 0), (1, 1), (0, 1), (0, -0.1), (1, -0.1)], [[0, 1, 2, 3], [4, 5, 1, 0]], [0, 1], ("a", "b")
    )
    change = refined(first, [0, 1])
    points = change.mesh.points_vx.copy()
    middle = np.flatnonzero((points == (0.5, 0.0)).all(axis=1))[0]
    hub = np.flatnonzero((points == (0.5, -0.05)).all(axis=1))[0]
    low = np.flatnonzero((points == (0.5, -0.1)).all(axis=1))[0]
    points[middle], points[hub], points[low] = (0.5, -0.2), (0.5, -0.22), (0.5, -0.24)
    bent = replace(change.mesh, points_vx=points)
    assert not find_faults(bent)
    upper = np.arange(4)
    assert coarsened(bent, change.tree, np.arange(4, 8), max_hanging=9).mesh is bent
    assert coarsened(bent, change.tree, upper, max_hanging=9).mesh.n_cells == 5
    assert_same(coarsened(bent, change.tree, all_of(bent)).mesh, first)


def test_no_order_of_marks_and_cells_matters():
    first = disc(0.15)
    rng = np.random.default_rng(3)
    change = refined(first, rng.random(first.n_cells) < 0.6, flat=20.0, curves=CIRCLE)
    marked = np.flatnonzero(rng.random(change.mesh.n_cells) < 0.8)
    one = coarsened(change.mesh, change.tree, marked, flat=20.0)
    two = coarsened(change.mesh, change.tree, rng.permutation(marked).tolist(), flat=20.0)
    assert first.n_cells < one.mesh.n_cells < change.mesh.n_cells
    assert_same(one.mesh, two.mesh)


def test_refining_again_gives_the_same_mesh_again():
    first = disc(0.15)
    one = refined(first, np.arange(0, first.n_cells, 2), flat=20.0, curves=CIRCLE)
    back = coarsened(one.mesh, one.tree, all_of(one.mesh), flat=20.0)
    two = refined(back.mesh, np.arange(0, first.n_cells, 2), tree=back.tree, flat=20.0, curves=CIRCLE)
    assert_same(two.mesh, one.mesh)
    for name, values in vars(one.tree).items():
        assert np.array_equal(getattr(two.tree, name), values), name


# -- names, regions and data -------------------------------------------------------------------------------------------


def at(mesh, x, y):
    return mesh.find_vertex(x, y)


def test_named_points_stay():
    """One at a hub keeps its family; one on a side hangs there, and goes when its name does."""
    first = squares(2)
    change = refined(first, [0, 1])
    hub = replace(change.mesh, named_points={"hub": at(change.mesh, 0.25, 0.25)})
    joined = coarsened(hub, change.tree, all_of(hub))
    assert joined.mesh.n_cells == 4 + 3
    assert joined.mesh.points_vx[joined.mesh.named_points["hub"]].tolist() == [0.25, 0.25]
    side = replace(change.mesh, named_points={"side": at(change.mesh, 0.5, 0.25)})
    joined = coarsened(side, change.tree, all_of(side))
    assert joined.mesh.n_cells == 4
    assert joined.mesh.n_vertices == 9 + 1
    assert joined.mesh.points_vx[joined.mesh.named_points["side"]].tolist() == [0.5, 0.25]
    plain = replace(joined.mesh, named_points=first.named_points, named_edges=first.named_edges)
    assert_same(coarsened(plain, joined.tree, []).mesh, first)


def test_two_named_points_are_too_many_hanging_nodes():
    first = structured_quadrilaterals([0, 1, 2], [0, 1], [Rectangle("a", 0, 2, 0, 1)])
    one = refined(first, [0, 1])
    two = refined(one.mesh, all_of(one.mesh), tree=one.tree)
    named = replace(two.mesh, named_points={str(y): at(two.mesh, 1.0, y) for y in (0.25, 0.75)})
    one = coarsened(named, two.tree, all_of(named))
    assert one.mesh.n_cells == 8
    assert coarsened(one.mesh, one.tree, all_of(one.mesh)).mesh.n_cells == 8
    assert coarsened(one.mesh, one.tree, all_of(one.mesh), max_hanging=2).mesh.n_cells == 2


def test_named_edges():
    """Pieces are joined; where one piece alone has the name, it stays; one within a family keeps that."""
    first = squares(2)
    change = refined(first, [0, 1, 2, 3])
    mesh = change.mesh
    assert len(mesh.named_edges["low"]) == 4
    for pieces, n_vertices, n_named in (
        ([(0.0, 0.25)], 10, 1),
        ([(0.0, 0.25), (0.25, 0.5)], 9, 1),
        ([(0.25, 0.5), (0.25, 0.0)], 9, 1),
        ([(0.5, 0.25), (0.5, 0.75)], 11, 2),
        ([(0.5, 0.25), (0.5, 0.75), (1.0, 0.75)], 10, 2),
    ):
        pairs = np.array([[at(mesh, a, 0.0), at(mesh, b, 0.0)] for a, b in pieces])
        joined = coarsened(replace(mesh, named_edges={"some": pairs}), change.tree, all_of(mesh)).mesh
        assert (joined.n_cells, joined.n_vertices) == (4, n_vertices)
        assert len(joined.named_edges["some"]) == n_named
        length = np.abs(np.diff(joined.points_vx[joined.named_edges["some"]][..., 0], axis=1)).sum()
        assert length == pytest.approx(0.25 * len(pieces))
    inner = np.array([[at(mesh, 0.25, 0.25), at(mesh, 0.25, 0.0)]])
    assert coarsened(replace(mesh, named_edges={"inner": inner}), change.tree, all_of(mesh)).mesh.n_cells == 3 + 4


def test_regions_and_data():
    """Cells that were given another region are no family any more; data that differ are averaged by areas."""
    first = mesh_of(SHAPES["quadrilateral"])
    first = replace(first, region_names=("a", "b"), cell_data={"x": [3.0], "y": [0.1]})
    change = refined(first, [0])
    assert change.mesh.cell_data["x"].tolist() == [3.0] * 4
    other = replace(change.mesh, region_c=[0, 0, 1, 0])
    assert coarsened(other, change.tree, all_of(other)).mesh is other
    x = np.array([1.0, 2.0, 4.0, 8.0])
    filled = replace(change.mesh, cell_data={"x": x, "y": change.mesh.cell_data["y"]})
    joined = coarsened(filled, change.tree, all_of(filled)).mesh
    area = [area_of(mesh_of(filled.points_vx[loop])) for loop in filled.cells()]
    assert joined.cell_data["x"] == pytest.approx(np.dot(area, x) / np.sum(area), rel=1e-14)
    assert joined.cell_data["y"].tolist() == [0.1]


# -- trees -------------------------------------------------------------------------------------------------------------


def test_trees_are_saved_and_read(tmp_path):
    first = disc(0.15)
    one = refined(first, all_of(first))
    two = refined(one.mesh, np.arange(9), tree=one.tree)
    np.savez(tmp_path / "tree.npz", **vars(two.tree))
    with np.load(tmp_path / "tree.npz") as arrays:
        tree = CellTree(**arrays)
    assert_same(taken_back(two.mesh, tree)[0], first)
    with pytest.raises(ValueError, match="read-only"):
        tree.level_c[0] = 7


def test_bad_input():
    first = squares(2)
    change = refined(first, [0])
    mesh, tree = change.mesh, change.tree
    for marked, more, message in (
        ([7], {}, r"cells 7 to 7 are marked, but cells run from 0 to 6"),
        ([0], {"max_hanging": 0}, r"max_hanging = 0"),
        ([0], {"flat": 90.0}, r"flat = 90"),
    ):
        with pytest.raises(InputError, match=message):
            coarsened(mesh, tree, marked, **more)
    with pytest.raises(InputError, match=r"the tree is of a mesh with 7 cells, this one has 4: use the tree that came"):
        coarsened(first, tree, [0])
    with pytest.raises(InputError, match=r"the tree is of a mesh with 3 vertices, this one has 14"):
        coarsened(mesh, replace(tree, born_v=[True] * 3), [0])
    plain = replace(mesh, region_c=np.zeros(7))
    for wrong in ({"first_f": [13]}, {"family_c": [0, -1, -1, -1, -1, -1, 0], "size_f": [2]}):
        message = r"the tree does not go with the mesh: a family is not bounded by one clos"
        with pytest.raises(InputError, match=message):
            coarsened(plain, replace(tree, **wrong), all_of(mesh))
