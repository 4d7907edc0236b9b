"""Meshes survive writing and reading; malformed ones are refused or listed by name, and repaired where that is safe."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from helpers_mesh import non_convex
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tmc_vem.mesh import PolygonMesh, Rectangle, structured_quadrilaterals
from tmc_vem.mesh.check import find_faults
from tmc_vem.mesh.files.io import FORMATS, read_mesh, write_mesh
from tmc_vem.mesh.files.msh import TYPES
from tmc_vem.mesh.make.outline import Region
from tmc_vem.mesh.make.repair import repair
from tmc_vem.mesh.make.triangles import triangle_mesh
from tmc_vem.mesh.parts import with_names
from tmc_vem.problems import Box, CBox, Punch
from tmc_vem.support.errors import InputError, Note


@cache
def meshes():
    quads = structured_quadrilaterals(
        np.linspace(0, 1, 4) ** 1.3, [0, 1 / 3, 1], [Rectangle("a b", 0, 1, 0, 1), Rectangle("50%", 0, 1, 1 / 3, 1)]
    )
    lines = {"low side": ((0.0, 0.0), (1.0, 0.0)), "left": ((0.0, 0.0), (0.0, 1.0))}
    mixed = triangle_mesh([Region("x", [(0, 0), (1, 0), (1.3, 1), (0, 1)])], 0.3, quadrilaterals=True)
    return {
        "quadrilaterals": with_names(quads, {"p one": (0.0, 0.0), "q": (1.0, 1.0)}, lines),
        "mixed": with_names(mixed, lines={"low": lines["low side"]}),
        "polygons": Punch(size=0.2).make_mesh(),
        "hanging nodes": Box(cells=(20, 5), medium_refinement=4).make_mesh(),
        "welded": CBox(medium_refinement=2).make_mesh(),
        "not convex": non_convex(),
    }


def assert_same(a, b):
    for name in ("points_vx", "cell_offsets", "cell_vertices", "region_c"):
        assert np.array_equal(getattr(a, name), getattr(b, name)), name
    assert a.region_names == b.region_names
    assert dict(a.named_points) == dict(b.named_points)
    assert set(a.named_edges) == set(b.named_edges)
    for name, pairs in a.named_edges.items():
        rows = [np.unique(np.sort(p, axis=1), axis=0).tolist() for p in (pairs, b.named_edges[name])]
        assert rows[0] == rows[1], name


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize("name", ["quadrilaterals", "mixed", "polygons", "hanging nodes", "welded", "not convex"])
def test_round_trip(name, suffix, tmp_path):
    mesh = meshes()[name]
    path = tmp_path / f"mesh{suffix}"
    if suffix in (".msh", ".inp") and mesh.n_sides_c.max() > 4:
        with pytest.raises(InputError, match=r"cell \d+ has \d+ sides, but .* triangles and quadrilaterals only"):
            write_mesh(mesh, path)
        assert not path.exists()
        return
    write_mesh(mesh, path)
    assert_same(mesh, read_mesh(path))


def test_gmsh_model_with_physical_groups(tmp_path):
    """As another program would write it, with second-order cells and points that no cell uses."""
    import gmsh

    gmsh.initialize([])
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.add("other")
        box = gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
        disc = gmsh.model.occ.addDisk(0.5, 0.5, 0, 0.2, 0.2)
        gmsh.model.occ.fragment([(2, box)], [(2, disc)])
        gmsh.model.occ.synchronize()
        gmsh.model.setPhysicalName(2, gmsh.model.addPhysicalGroup(2, [2]), "disc")
        gmsh.model.setPhysicalName(2, gmsh.model.addPhysicalGroup(2, [3]), "around")
        low = [tag for _, tag in gmsh.model.getEntitiesInBoundingBox(-1, -1e-3, -1, 2, 1e-3, 1, 1)]
        gmsh.model.setPhysicalName(1, gmsh.model.addPhysicalGroup(1, low), "low")
        gmsh.option.setNumber("Mesh.CharacteristicLengthMax", 0.2)
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(2)
        gmsh.write(str(tmp_path / "other.msh"))
    finally:
        gmsh.finalize()
    mesh = read_mesh(tmp_path / "other.msh")
    assert set(mesh.region_names) == {"disc", "around"}
    assert (mesh.n_sides_c == 3).all()
    assert not find_faults(mesh)
    assert np.abs(mesh.points_vx[mesh.named_edges["low"]][..., 1]).max() < 1e-12
    assert np.ptp(mesh.points_vx[mesh.named_edges["low"]][..., 0]) == pytest.approx(1.0)


def test_types_of_elements_are_those_of_gmsh():
    """Dimension, corners and nodes of every type in the table; all lines and plane cells that gmsh knows are in it."""
    import gmsh

    gmsh.initialize([])
    try:
        for number, (dimension, corners, nodes) in TYPES.items():
            name, *found = gmsh.model.mesh.getElementProperties(number)
            assert (found[0], found[4], found[2]) == (dimension, corners, nodes), name
        for family in ("Line", "Triangle", "Quadrangle"):
            known = {
                gmsh.model.mesh.getElementType(family, k, inside) for k in range(1, 11) for inside in (False, True)
            }
            assert known <= TYPES.keys(), family
    finally:
        gmsh.finalize()


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.stl", "", r"unknown mesh format '\.stl', use one of \.vtu"),
        ("a.obj", None, r"a\.obj does not exist"),
        ("a.obj", "", r"a\.obj has no faces"),
        ("a.obj", "v 0 0\nv 1 0\nv x 1\nf 1 2 3\n", r"a\.obj, line 3: 'v x 1' is not understood"),
        ("a.obj", "v 0 0 1\nv 1 0 0\nv 1 1 0\nf 1 2 3\n", r"a\.obj is not a plane mesh: z runs from 0 to 1"),
        ("a.obj", "v 0 0\nv 1 0\nv 1 1\nf 1 2 0\n", r"line 4: .* vertices count from 1"),
        ("a.obj", "v 0 0\nv 1 0\nv 1 1\nf 1 2 9\n", r"cell 0 refers to vertex 8; there are 3 vertices"),
        ("a.obj", "v 0 0\nv 1 0\nv 2 0\nf 1 3 2\n", r"a\.obj: cell 0 has no area"),
        ("a.vtu", "not xml", r"a\.vtu is not a readable \.vtu file"),
        ("a.vtk", "nor this", r"a\.vtk is not a readable \.vtk file"),
        ("a.msh", "$Nothing\n", r"a\.msh (is not a readable \.msh file|has no plane cells)"),
        ("a.inp", "*NODE\n1, 0., 0., 0.\n", r"a\.inp (is not a readable \.inp file|has no plane cells)"),
    ],
)
def test_unreadable_files(name, text, message, tmp_path):
    path = tmp_path / name
    if text is not None:
        path.write_text(text)
    with pytest.raises(InputError, match=message):
        read_mesh(path)


def test_not_plane_and_no_directory(tmp_path):
    import meshio

    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 1], [0, 1, 0]], dtype=float)
    meshio.Mesh(points, [("quad", np.array([[0, 1, 2, 3]]))]).write(tmp_path / "a.vtu")
    with pytest.raises(InputError, match="is not a plane mesh: z runs from 0 to 1"):
        read_mesh(tmp_path / "a.vtu")
    meshio.Mesh(points, [("tetra", np.array([[0, 1, 2, 3]]))]).write(tmp_path / "b.vtu")
    with pytest.raises(InputError, match=r"has solid cells .1 of type tetrahedron"):
        read_mesh(tmp_path / "b.vtu")
    with pytest.raises(InputError, match="there is no directory"):
        write_mesh(meshes()["quadrilaterals"], tmp_path / "none" / "a.vtu")


# -- malformed meshes --------------------------------------------------------------------------------------------------


def raw(points, cells, region_c=None):
    """A mesh that nobody has looked at."""
    sizes = [len(cell) for cell in cells]
    return PolygonMesh(
        points_vx=np.array(points, dtype=float),
        cell_offsets=np.concatenate([[0], np.cumsum(sizes)]),
        cell_vertices=np.concatenate([np.asarray(cell) for cell in cells]),
        region_c=np.zeros(len(cells)) if region_c is None else region_c,
        validate=False,
    )


def good(n=3):
    """n x n squares as lists."""
    lines = np.linspace(0.0, 1.0, n + 1)
    mesh = structured_quadrilaterals(lines, lines, [Rectangle("domain", 0, 1, 0, 1)])
    return mesh.points_vx.tolist(), [loop.tolist() for loop in mesh.cells()]


def turn(points, cells, c):
    cells[c].reverse()
    return "clockwise", rf"cell {c} is clockwise"


def cross(points, cells, c):
    cells[c][1], cells[c][2] = cells[c][2], cells[c][1]
    return "polygon", rf"cell {c} intersects itself"


def repeat(points, cells, c):
    cells[c].insert(2, cells[c][0])
    return "polygon", rf"cell {c} repeats vertex {cells[c][0]}"


def zero_edge(points, cells, c):
    points.append(list(points[cells[c][1]]))
    cells[c].insert(2, len(points) - 1)
    return "polygon", rf"cell {c} has an edge of length zero between vertices {cells[c][1]} and {len(points) - 1}"


def too_few(points, cells, c):
    del cells[c][2:]
    return "structure", rf"cell {c} has 2 vertices"


def out_of_range(points, cells, c):
    cells[c][0] = len(points) + 5
    return "structure", rf"cell {c} refers to vertex {len(points) + 5}"


def not_finite(points, cells, c):
    points[cells[c][3]] = [np.nan, 0.0]
    return "structure", rf"vertex {cells[c][3]} has a coordinate that is not a finite number"


def unused(points, cells, c):
    points.append([0.31, 0.47])
    return "unreferenced vertex", rf"vertex {len(points) - 1} belongs to no cell"


def twice(points, cells, c):
    cells.append(list(cells[c]))
    return "duplicate cell", rf"cell {len(cells) - 1} has the same vertices as cell {c}"


def doubled_vertex(points, cells, c):
    points.append(list(points[cells[c][0]]))
    old, cells[c][0] = cells[c][0], len(points) - 1
    return "duplicate vertex", rf"vertices {old} and {len(points) - 1} are both at"


def overlap(points, cells, c):
    """One more square, shifted by half a cell to lie on others."""
    corners = np.array([points[v] for v in cells[c]]) + np.array([0.11, 0.13])
    cells.append(list(range(len(points), len(points) + 4)))
    points += corners.tolist()
    return "overlap", rf"cells {c} and {len(cells) - 1} overlap"


def nested(points, cells, c):
    """One more square, inside a cell."""
    corners = np.array([points[v] for v in cells[c]])
    cells.append(list(range(len(points), len(points) + 4)))
    points += (0.5 * corners + 0.5 * corners.mean(axis=0)).tolist()
    return "overlap", rf"cells {c} and {len(cells) - 1} overlap"


def t_junction(points, cells, c):
    """A triangle whose tip is on the side of a cell, which does not know it."""
    a, b = np.array(points[cells[2][1]]), np.array(points[cells[2][2]])  # right side of the lower right cell
    tip = 0.5 * (a + b)
    cells.append(list(range(len(points), len(points) + 3)))
    points += [tip.tolist(), [1.2, tip[1] - 0.1], [1.2, tip[1] + 0.1]]
    return "T-junction", r"lies on the side of cell 2 between vertices .* not one of its vertices"


def gap(points, cells, c):
    """The last column does not quite reach the others."""
    moved = {}
    for cell in cells[2::3]:
        for corner in (0, 3):
            v = cell[corner]
            if v not in moved:
                moved[v] = len(points)
                points.append([points[v][0] + 0.004, points[v][1]])
            cell[corner] = moved[v]
    return "gap", r"there is a gap at .* between cells \d+ and \d+"


FAULTS = [turn, cross, repeat, zero_edge, too_few, out_of_range, not_finite, unused, twice, doubled_vertex, overlap,
          nested, t_junction, gap]  # fmt: skip
CORPUS = [(fault, c) for fault in FAULTS for c in (0, 2, 4, 8)]  # 56 meshes


@pytest.mark.parametrize(("fault", "c"), CORPUS, ids=lambda x: getattr(x, "__name__", str(x)))
def test_malformed_meshes_are_named(fault, c):
    points, cells = good()
    kind, message = fault(points, cells, c)
    faults = find_faults(raw(points, cells))
    found = [f for f in faults if f.kind == kind]
    assert found, faults
    import re

    assert any(re.search(message, f.message) for f in found), found


@pytest.mark.parametrize("fault", [turn, unused, twice, doubled_vertex, zero_edge, t_junction])
def test_repair(fault):
    points, cells = good()
    kind, _ = fault(points, cells, 4)
    mesh = raw(points, cells)
    assert all(f.fixable for f in find_faults(mesh)) or kind == "polygon"
    fixed = repair(mesh)
    assert not find_faults(fixed)
    assert fixed.n_cells == 9 + (kind == "T-junction")


@pytest.mark.parametrize("fault", [cross, overlap, nested, gap])
def test_what_cannot_be_repaired_is_refused(fault):
    points, cells = good()
    fault(points, cells, 4)
    with pytest.raises(InputError, match=r"cells? \d"):
        repair(raw(points, cells))


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_random_damage_is_never_accepted_and_never_crashes(data):
    """One to three faults at once: some fault is listed, and the message names a cell or vertex."""
    points, cells = good()
    chosen = data.draw(st.lists(st.sampled_from(FAULTS), min_size=1, max_size=3))
    kinds = []
    for fault in chosen:
        if min(map(len, cells)) < 4 or max(map(max, cells)) >= len(points):
            break  # the other faults need something to work on
        kinds.append(fault(points, cells, data.draw(st.integers(0, 8)))[0])
    if chosen.count(turn) == 2 or chosen.count(cross) >= 2:
        return  # the second may undo the first
    faults = find_faults(raw(points, cells))
    assert faults
    assert all("cell" in f.message or "vert" in f.message for f in faults)


@pytest.mark.parametrize(("fault", "c"), CORPUS, ids=lambda x: getattr(x, "__name__", str(x)))
def test_reading_refuses_every_malformed_mesh(fault, c, tmp_path):
    points, cells = good()
    fault(points, cells, c)
    lines = [f"v {x} {y}" for x, y in points] + ["f " + " ".join(str(v + 1) for v in cell) for cell in cells]
    (tmp_path / "bad.obj").write_text("\n".join(lines))
    # vertices that no cell uses are dropped: files have centres of arcs among their points; clockwise cells are turned
    if fault in (unused, turn) or (fault is doubled_vertex and c == 0):
        with pytest.warns(Note, match=r"belongs? to no cell|clockwise"):
            assert not find_faults(read_mesh(tmp_path / "bad.obj"))
        return
    with pytest.raises(InputError, match=r"cells? \d|vert"):
        read_mesh(tmp_path / "bad.obj")


@pytest.mark.parametrize("suffix", [".obj", ".vtu", ".vtk"])
def test_names_that_end_with_a_backslash(tmp_path, suffix):
    """In OBJ a line that ends so goes on in the next."""
    left, right = Rectangle("a\\", 0.0, 0.5, 0.0, 1.0), Rectangle("b%5C", 0.5, 1.0, 0.0, 1.0)
    plain = structured_quadrilaterals([0.0, 0.5, 1.0], [0.0, 1.0], [left, right], {"p\\": (0.0, 0.0)})
    mesh = PolygonMesh(
        plain.points_vx, plain.cell_offsets, plain.cell_vertices, plain.region_c, plain.region_names,
        plain.named_points, {"e\\": plain.edges.vertices_ev[:1]},
    )  # fmt: skip
    write_mesh(mesh, tmp_path / f"a{suffix}")
    again = read_mesh(tmp_path / f"a{suffix}")
    assert again.region_names == mesh.region_names
    assert np.array_equal(again.region_c, mesh.region_c)
    assert dict(again.named_points) == dict(mesh.named_points)
    assert list(again.named_edges) == ["e\\"]
