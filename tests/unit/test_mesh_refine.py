"""Local refinement: children, hanging nodes, names, and the bound on hanging nodes."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_mesh import SHAPES, mesh_of, regular

from tmc_vem.mesh import Rectangle, structured_quadrilaterals
from tmc_vem.mesh.check import find_faults
from tmc_vem.mesh.geometry import areas
from tmc_vem.mesh.make.outline import Region
from tmc_vem.mesh.make.refine import refine
from tmc_vem.mesh.make.voronoi import voronoi_mesh
from tmc_vem.mesh.parts import with_names
from tmc_vem.support.errors import InputError
from tmc_vem.vem.spaces.element import build_elements
from tmc_vem.vem.spaces.element_settings import ElementSettings


def squares(n=4):
    lines = np.linspace(0.0, 1.0, n + 1)
    regions = [Rectangle("a", 0, 1, 0, 1), Rectangle("b", 0, 0.5, 0, 0.5)]
    mesh = structured_quadrilaterals(lines, lines, regions, {"corner": (0, 0), "middle": (0.5, 0.5)})
    return with_names(mesh, lines={"low": ((0.0, 0.0), (1.0, 0.0))})


def total_area(mesh):
    return sum(areas(mesh.points_vx[loop][None])[0] for loop in mesh.cells())


def test_one_square_becomes_four():
    mesh = refine(squares(), [5])
    assert not find_faults(mesh)
    assert mesh.n_cells == 19
    assert np.bincount(mesh.n_sides_c).tolist() == [0, 0, 0, 0, 15, 4]
    assert total_area(mesh) == pytest.approx(1.0)
    assert np.bincount(mesh.region_c).tolist() == [12, 7]
    assert {n: mesh.points_vx[v].tolist() for n, v in mesh.named_points.items()} == {
        "corner": [0, 0],
        "middle": [0.5, 0.5],
    }


@pytest.mark.parametrize("marked", [[0], [1, 2], [5, 6, 9, 10], list(range(16))])
def test_children_have_the_region_of_their_parent(marked):
    """Wherever they are: next to cells of another region too, with or without hanging nodes."""
    before = squares()
    mesh = refine(before, marked)
    for c, loop in enumerate(mesh.cells()):
        x, y = mesh.points_vx[loop].mean(axis=0)
        assert mesh.region_names[mesh.region_c[c]] == ("b" if max(x, y) < 0.5 else "a")
    for region in (0, 1):
        both = [
            sum(areas(m.points_vx[loop][None])[0] for loop, r in zip(m.cells(), m.region_c, strict=True) if r == region)
            for m in (before, mesh)
        ]
        assert both[0] == pytest.approx(both[1])


def test_named_edges_are_named_in_pieces():
    mesh = refine(squares(), [0, 1])
    pairs = mesh.named_edges["low"]
    assert len(pairs) == 6
    length = np.hypot(*np.diff(mesh.points_vx[pairs], axis=1)[:, 0].T)
    assert sorted(length.tolist()) == pytest.approx([0.125] * 4 + [0.25] * 2)


def test_all_cells_is_a_regular_refinement():
    mesh = refine(squares(), np.ones(16, dtype=bool))
    assert mesh.n_cells == 64
    assert (mesh.n_sides_c == 4).all()
    assert mesh.n_vertices == 81


@pytest.mark.parametrize("n_sides", [3, 5, 6, 7])
def test_a_polygon_becomes_one_quadrilateral_a_corner(n_sides):
    mesh = refine(mesh_of(regular(n_sides)), [0])
    assert mesh.n_cells == n_sides
    assert (mesh.n_sides_c == 4).all()
    assert total_area(mesh) == pytest.approx(areas(regular(n_sides)[None])[0])


def test_repeated_refinement_towards_a_point_stays_balanced():
    mesh = squares()
    for _ in range(5):
        near = [np.hypot(*(mesh.points_vx[loop].mean(axis=0) - 0.5)) for loop in mesh.cells()]
        mesh = refine(mesh, np.argsort(near)[:4])
        assert not find_faults(mesh)
        assert mesh.n_sides_c.max() <= 8  # at most one hanging node on a side
    assert total_area(mesh) == pytest.approx(1.0)
    assert max(group.degree for group in build_elements(mesh, ElementSettings())) <= 5


def test_without_the_bound_sides_collect_hanging_nodes():
    mesh = loose = squares()
    for _ in range(3):
        corner = [c for c, loop in enumerate(mesh.cells()) if mesh.points_vx[loop].max() <= 0.25 + 1e-9]
        mesh = refine(mesh, corner)
        corner = [c for c, loop in enumerate(loose.cells()) if loose.points_vx[loop].max() <= 0.25 + 1e-9]
        loose = refine(loose, corner, max_hanging=99)
    assert loose.n_sides_c.max() == 4 + 7
    assert mesh.n_sides_c.max() <= 8
    assert mesh.n_cells > loose.n_cells


def test_voronoi_cells():
    mesh = voronoi_mesh([Region("a", [(0, 0), (1, 0), (1, 1), (0, 1)])], 0.2)
    fine = refine(mesh, [3, 7, 11])
    assert not find_faults(fine)
    assert total_area(fine) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("marked", "more", "message"),
    [
        ([16], {}, r"cells 16 to 16 are marked, but cells run from 0 to 15"),
        ([-1], {}, r"cells -1 to -1 are marked"),
        (np.ones(3, dtype=bool), {}, r"the mask has 3 entries for 16 cells"),
        ([0], {"max_hanging": 0}, r"max_hanging = 0"),
    ],
)
def test_bad_input(marked, more, message):
    with pytest.raises(InputError, match=message):
        refine(squares(), marked, **more)


def test_a_cell_that_does_not_see_its_centroid_is_refused():
    with pytest.raises(InputError, match="cell 0 cannot be refined: it is not star-shaped"):
        refine(mesh_of(SHAPES["U"]), [0])
