"""The rules for groups, planes, slits, cracks and repairs that hold for the files of all formats."""

from __future__ import annotations

import dataclasses
import importlib.util
from pathlib import Path

import meshio
import numpy as np
import pytest
from helpers_process import process

from tmc_vem import run
from tmc_vem.cli.main import main
from tmc_vem.mesh.check import find_faults
from tmc_vem.mesh.files import inp_keywords
from tmc_vem.mesh.files.io import read_mesh, write_mesh
from tmc_vem.mesh.files.record import Group
from tmc_vem.mesh.files.regions import regions_of
from tmc_vem.mesh.make.repair import repair
from tmc_vem.mesh.make.triangles import mesh_geometry
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.mesh.quality import measure
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.support.errors import InputError
from tmc_vem.support.notes import heard_by

CORPUS = Path(__file__).parents[1] / "corpus"
TWO = [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1)]


def obj(path: Path, points: list[tuple[float, ...]], faces: str) -> Path:
    lines = [f"v {' '.join(map(repr, (*map(float, point), 0.0)[:3]))}" for point in points]
    path.write_text("\n".join([*lines, *(f"f {face}" for face in faces.split(","))]) + "\n")
    return path


# -- groups ------------------------------------------------------------------------------------------------------------


def groups(**members: list[int]) -> tuple[list[Group], list[str]]:
    return [Group(np.array(cells), name) for name, cells in members.items()], list(members)


@pytest.mark.parametrize(
    ("members", "regions"),
    [
        ({"all": [0, 1, 2, 3], "a": [0, 1], "b": [2, 3]}, "aabb"),
        ({"a": [0, 1, 2, 3], "b": [0, 1, 2], "c": [0]}, "cbba"),
        ({"a": [1, 2]}, "?aa?"),
        ({}, "????"),
        ({"a": [0, 1], "b": [0, 1]}, "aa??"),
    ],
)
def test_the_innermost_group_is_a_cells_region(members: dict[str, list[int]], regions: str) -> None:
    region_c, names, _ = regions_of(4, *groups(**members))
    assert "".join("?" if names[r] == "domain" else names[r] for r in region_c) == regions
    assert len(set(regions)) == len(names)


def test_groups_that_overlap_are_refused_with_the_cell() -> None:
    with pytest.raises(InputError, match="cell 1 is in the groups 'a' and 'b', and neither contains the other"):
        regions_of(4, *groups(a=[0, 1], b=[1, 2, 3]))


def test_a_set_called_domain_is_not_mixed_with_cells_of_no_group() -> None:
    region_c, names, notes = regions_of(3, *groups(domain=[1]))
    assert [names[r] for r in region_c] == ["domain_", "domain", "domain_"]
    assert "2 cells (the first is 0) are in no group: region 'domain_'" in notes[0]


# -- planes ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("axes", "words"), [((0, 1), []), ((0, 2), ["xz plane"]), ((1, 2), ["yz plane"])])
def test_any_plane_along_two_axes(tmp_path: Path, axes: tuple[int, int], words: list[str]) -> None:
    points = np.full((6, 3), 0.3)
    points[:, axes] = TWO
    notes: list[str] = []
    mesh = read_mesh(obj(tmp_path / "a.obj", list(map(tuple, points)), "1 2 5 4,2 3 6 5"), notes=notes)
    assert mesh.points_vx.tolist() == np.array(TWO, dtype=float).tolist()
    assert len(notes) == len(words)
    assert all(word in note for word, note in zip(words, notes, strict=True))


def test_noise_of_single_precision_is_no_third_dimension(tmp_path: Path) -> None:
    points = [(x, y, 2.5 + 1e-7 * (n % 2)) for n, (x, y) in enumerate(TWO)]
    assert read_mesh(obj(tmp_path / "a.obj", points, "1 2 5 4,2 3 6 5")).n_cells == 2
    with pytest.raises(InputError, match=r"not a plane mesh: z runs from 0 to 1"):
        read_mesh(obj(tmp_path / "b.obj", [(*p, float(n == 3)) for n, p in enumerate(TWO)], "1 2 5 4,2 3 6 5"))


# -- slits, cracks and repairs -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("width", [1e-8, 1e-6, 2.5e-4, 9e-4])
def test_slits_of_any_width_are_named_and_joined(tmp_path: Path, width: float) -> None:
    right = [(1 + width, 0), (2, 0), (2, 1), (1 + width, 1)]
    file = obj(tmp_path / "a.obj", [(0, 0), (1, 0), (1, 1), (0, 1), *right], "1 2 3 4,5 6 7 8")
    with pytest.raises(InputError, match="vertices 1 and 4 nearly coincide at"):
        read_mesh(file)
    mended = repair(read_mesh(file, validate=False, notes=[]))
    assert (mended.n_vertices, len(mended.edges)) == (6, 7)
    notes: list[str] = []
    assert read_mesh(file, cracks="keep", notes=notes).n_vertices == 8
    assert notes == ["it falls into 2 parts that share no side"]


def test_hanging_nodes_beside_their_side_are_inserted(tmp_path: Path) -> None:
    points = [(0, 0), (1, 0), (1, 1), (0, 1), (1, 0.5 + 1e-7), (2, 0), (2, 0.5), (2, 1), (1 + 1e-5, 0.5)]
    file = obj(tmp_path / "a.obj", points, "1 2 3 4,2 6 7 9,9 7 8 3")
    with pytest.raises(InputError, match="vertex 7 lies on the side of cell 0 between vertices 1 and 2"):
        read_mesh(file, notes=[])
    mended = repair(read_mesh(file, validate=False, notes=[]))
    assert sorted(mended.n_sides_c.tolist()) == [4, 4, 5]


def test_repairs_never_change_a_material() -> None:
    cells = [[0, 1, 4, 3], [1, 2, 5, 4], [1, 2, 5, 4]]
    offsets, entries = np.arange(4) * 4, np.concatenate(cells)
    for regions, message in (([0, 1, 1], None), ([0, 0, 1], "is in 'medium': a cell has one region")):
        mesh = PolygonMesh(np.array(TWO, float), offsets, entries, regions, ("block", "medium"), validate=False)
        if message is None:
            assert repair(mesh).region_c.tolist() == [0, 1]
        else:
            assert any(message in fault.message for fault in find_faults(mesh))
            with pytest.raises(InputError, match=message):
                repair(mesh)


@pytest.mark.parametrize("name", ["s5.obj", "s6.obj", "lat6.obj", "fix8.vtu"])
def test_a_patch_test_is_exact_after_short_edges_are_collapsed(name: str, tmp_path: Path) -> None:
    with pytest.raises(SystemExit) as left:
        main(["mesh", "check", str(CORPUS / "short_edges" / name), "--fix", str(tmp_path / "good.vtu")])
    assert left.value.code == 0
    mesh = read_mesh(tmp_path / "good.vtu")
    quality = measure(mesh)
    assert (quality.shortest_edge_c / quality.diameter_c).min() > 1e-2
    problem, options = read_problem(patch_test(tmp_path, "good.vtu"))
    assert run(problem, options=options).reaction == pytest.approx(-7.54556079976, rel=1e-10)


def test_thin_cells_have_no_short_edges() -> None:
    """Across a layer the sides are as short as the cells are wide, with hanging nodes too."""
    points = np.array([(0, 0), (1, 0), (2, 0), (2, 1e-6), (0, 1e-6)], dtype=float)
    assert not find_faults(PolygonMesh.from_cells(points, [[0, 1, 2, 3, 4]]))


def patch_test(path: Path, mesh: str) -> Path:
    file = path / "patch.toml"
    file.write_text(
        f"""name = "patch"
mesh = {{ file = "{mesh}" }}
regions = {{ domain = {{ solid = {{ K = 20, mu = 10 }} }} }}
support = [{{ at = "bottom", uy = 0 }}, {{ at = "left", ux = 0 }}]
load = {{ at = "top", uy = -0.2 }}
solve = {{ steps = 2 }}
[edges]
bottom = {{ line = [[0, 0], [1, 0]] }}
top = {{ line = [[0, 1], [1, 1]] }}
left = {{ line = [[0, 0], [0, 1]] }}
"""
    )
    return file


def test_a_crack_that_is_meant_opens_and_its_run_is_not_resumed(tmp_path: Path) -> None:
    """Two squares above each other, joined at the left only: pulled at the top right, the faces part."""
    points = [(x, y) for y in (0, 1, 2) for x in (0, 1, 2)] + [(2, 1)]
    obj(tmp_path / "crack.obj", points, "1 2 5 4,2 3 6 5,4 5 8 7,5 10 9 8")
    text = """name = "crack"
mesh = { file = "crack.obj", cracks = "keep" }
regions = { domain = { solid = { K = 20, mu = 10 } } }
support = [{ at = "bottom", ux = 0, uy = 0 }]
load = { at = "tip", uy = 0.1 }
points = { tip = [2, 2] }
edges = { bottom = { line = [[0, 0], [2, 0]] } }
solve = { steps = 2 }
"""
    (tmp_path / "crack.toml").write_text(text)
    problem, options = read_problem(tmp_path / "crack.toml")
    result = run(problem, tmp_path / "run", options)
    displacement = result.to_meshio().point_data["displacement"][:, 1]
    at = result.to_meshio().points[:, :2]
    faces = np.sort(displacement[np.hypot(*(at - (2, 1)).T) < 1e-9])
    assert len(faces) == 2
    assert faces[1] - faces[0] > 0.02
    with pytest.raises(InputError, match="cracks, whose nodes are at the same place"):
        run(problem, tmp_path / "run", options, resume=True)
    (tmp_path / "joined.toml").write_text(text.replace(', cracks = "keep"', ""))
    with pytest.raises(InputError, match=r"vertices 5 and 9 are both at \(2, 1\)"):
        read_problem(tmp_path / "joined.toml")[0].make_mesh()


@pytest.mark.parametrize("method", ["vem", "fem"])
def test_a_support_at_a_group_of_points_holds_them_all(tmp_path: Path, method: str) -> None:
    """The file's two corners by their group, and by their places."""
    (tmp_path / "a.msh").write_bytes((CORPUS / "groups" / "named-4.1.msh").read_bytes())
    text = """name = "corners"
mesh = { file = "a.msh" }
regions = { block = { solid = { K = 20, mu = 10 } }, medium = { solid = { K = 20, mu = 10 } } }
load = { at = "top", uy = 0.1 }
"""
    group = 'support = [{ at = "corners", ux = 0, uy = 0 }]\n'
    both = 'support = [{ at = "left", ux = 0, uy = 0 }, { at = "right", ux = 0, uy = 0 }]\n'
    reactions = []
    for name, support in (("group", group), ("places", f"{both}points = {{ left = [0, 0], right = [1, 0] }}\n")):
        (tmp_path / f"{name}.toml").write_text(text + support)
        problem, options = read_problem(tmp_path / f"{name}.toml")
        notes: list[str] = []
        with heard_by(notes.append):
            result = run(problem, options=dataclasses.replace(options, method=method, steps=1))
        assert "points corners#1, corners#2" in notes[0]
        reactions.append(result.reaction)
    assert abs(reactions[0]) > 0.1
    assert reactions[0] == pytest.approx(reactions[1], rel=1e-9)


# -- others ------------------------------------------------------------------------------------------------------------


def test_instances_are_moved_then_turned() -> None:
    mesh = read_mesh(CORPUS / "abaqus" / "instances.inp", notes=[])
    boxes = [np.round([mesh.points_vx[c].min(axis=0), mesh.points_vx[c].max(axis=0)], 9).tolist() for c in mesh.cells()]
    assert boxes == [[[0, 0], [2, 1]], [[0.5, 3], [1.5, 4]], [[3, 0], [4, 1]]]


def test_region_data_of_files_with_numbers() -> None:
    mesh = read_mesh(
        CORPUS / "polygons" / "structure.mat", region_data="material", names={"1": "block", "region_2": "gap"}
    )
    assert mesh.region_names == ("block", "gap")
    with pytest.raises(InputError, match=r"no cell data 'soil' \(there are: .*material"):
        read_mesh(CORPUS / "polygons" / "structure.mat", region_data="soil")


def test_region_data_of_a_file_without_cell_data(tmp_path: Path) -> None:
    mesh = read_mesh(obj(tmp_path / "one.obj", [(0, 0), (1, 0), (1, 1), (0, 1)], "1 2 3 4"))
    points, cells = np.column_stack([mesh.points_vx, np.zeros(4)]), [("quad", mesh.cell_vertices.reshape(1, 4))]
    for data, known in (({"soil": [np.array([3])]}, "soil"), ({}, "none")):
        meshio.Mesh(points, cells, cell_data=data).write(tmp_path / "one.vtk")
        with pytest.raises(InputError, match=rf"there is no cell data 'rock' \(there are: {known}\)"):
            read_mesh(tmp_path / "one.vtk", region_data="rock")


def test_files_may_include_files_to_some_depth(tmp_path: Path) -> None:
    """Lines are counted in the file where they are, whose name is said if it is included."""
    deepest = inp_keywords.DEEPEST
    names = [tmp_path / f"{n}.inp" for n in range(deepest + 2)]
    for n, path in enumerate(names[:-1]):
        path.write_text(f"** {n}\n*NSET, NSET=SET{n}\n{n}\n*INCLUDE, INPUT={names[n + 1].name}\n")
    names[deepest].write_text("*NODE\n1, 0, 0\n")
    found = list(inp_keywords.keywords_of(names[0]))
    assert [keyword.name for keyword in found] == ["NSET"] * deepest + ["NODE"]
    names[deepest].write_text(f"*NODE\n1, 0, 0\n*INCLUDE, INPUT={names[-1].name}\n")
    names[-1].write_text("*NSET, NSET=LAST\n7\n")
    with pytest.raises(InputError, match=rf"^{names[-1].name} is included in itself$"):
        list(inp_keywords.keywords_of(names[0]))
    names[0].write_text("*NODE\n1, 0, 0\n*INCLUDE, INPUT=none.inp\n")
    with pytest.raises(InputError, match=r"^line 3: \*INCLUDE names the file 'none.inp', which is not there"):
        list(inp_keywords.keywords_of(names[0]))
    names[1].write_text("*INCLUDE\n")
    names[0].write_text(f"*INCLUDE,\nINPUT={names[1].name}\n")
    with pytest.raises(InputError, match=r"^1.inp, line 1: \*INCLUDE names the file '', which is not there"):
        list(inp_keywords.keywords_of(names[0]))


def test_info_prints_names_as_they_are(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mesh = read_mesh(CORPUS / "obj" / "o.obj")
    named = PolygonMesh(
        mesh.points_vx, mesh.cell_offsets, mesh.cell_vertices, mesh.region_c, ("[bold]steel", "medium [/]")
    )
    write_mesh(named, tmp_path / "a.obj")
    with pytest.raises(SystemExit) as left:
        main(["mesh", "info", str(tmp_path / "a.obj")])
    out = capsys.readouterr().out
    assert left.value.code == 0
    assert "region [bold]steel" in out
    assert "region medium [/]" in out


def test_surfaces_of_a_geometry_in_no_group(tmp_path: Path) -> None:
    """gmsh leaves them out, which is said, unless all are to be saved."""
    text = (
        "Point(1) = {0,0,0,0.5}; Point(2) = {1,0,0,0.5}; Point(3) = {0,1,0,0.5}; Point(4) = {1,1,0,0.5}; "
        "Line(1) = {1,2}; Line(2) = {2,3}; Line(3) = {3,1}; Line(4) = {2,4}; Line(5) = {4,3}; "
        "Curve Loop(1) = {1,2,3}; Plane Surface(1) = {1}; Curve Loop(2) = {4,5,-2}; Plane Surface(2) = {2}; "
        'Physical Surface("body") = {1};\n'
    )
    for option, regions, n_notes in (("", {"body"}, 1), ("Mesh.SaveAll = 1;\n", {"body", "domain"}, 1)):
        (tmp_path / "a.geo").write_text(option + text)
        said: list[str] = []
        with heard_by(said.append):
            mesh = mesh_geometry(tmp_path / "a.geo")
        assert set(mesh.region_names) == regions
        assert len(said) == n_notes
        assert ("in no physical group" if not option else "in no group: region 'domain'") in said[0]


def test_a_geometry_of_gmsh_without_its_last_line_break(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = (
        "Point(1) = {0,0,0,0.5}; Point(2) = {1,0,0,0.5}; Point(3) = {0,1,0,0.5}; Line(1) = {1,2}; Line(2) = {2,3}; "
        'Line(3) = {3,1}; Curve Loop(1) = {1,2,3}; Plane Surface(1) = {1}; Physical Curve("low") = {1};'
    )
    for mark in ("", "\ufeff"):
        (tmp_path / "a.geo").write_text(f'{mark}{text} Physical Surface("body") = {{1}};', encoding="utf-8")
        with pytest.raises(SystemExit) as left:
            main(["mesh", "info", str(tmp_path / "a.geo")])
        assert left.value.code == 0
        assert "region body" in capsys.readouterr().out
    (tmp_path / "a.geo").write_text("Lin(1) = {1,2};")
    with pytest.raises(SystemExit) as left:
        main(["mesh", "info", str(tmp_path / "a.geo")])
    said = capsys.readouterr().err
    assert left.value.code == 2
    assert "cannot mesh" in said
    assert "a.geo" in said.rpartition(":")[0]
    # gmsh's parser remembers it, but nobody else does
    (tmp_path / "a.geo").write_text(f'{text} Physical Surface("body") = {{1}};')
    assert read_mesh(tmp_path / "a.geo").region_names == ("body",)


SQUARES = """*Part, name=P
*Node
1, 0., 0.
2, 1., 0.
3, 2., 0.
4, 0., 1.
5, 1., 1.
6, 2., 1.
*Element, type=CPE4
1, 1, 2, 5, 4
2, 2, 3, 6, 5
{sets}
*End Part
*Assembly, name=A
*Instance, name=I, part=P
*End Instance
*End Assembly
"""


@pytest.mark.parametrize(
    ("row", "members"),
    [("4", [4]), ("1, 3", [1, 2, 3]), ("1, 5, 2", [1, 3, 5]), ("2, 3\n6", [2, 3, 6]), ("2, 2, 7", [2])],
)
def test_rows_of_sets_that_are_generated(row: str, members: list[int], tmp_path: Path) -> None:
    """First and last label and the step: one label alone is itself, and the step is 1 if it is left out."""
    (tmp_path / "a.inp").write_text(SQUARES.format(sets=f"*Nset, nset=chosen, generate\n{row}"))
    mesh = read_mesh(tmp_path / "a.inp", notes=[])
    place = {1: (0, 0), 2: (1, 0), 3: (2, 0), 4: (0, 1), 5: (1, 1), 6: (2, 1)}
    found = [v for name, v in mesh.named_points.items() if name.partition("#")[0] == "chosen"]
    found += np.unique(mesh.named_edges.get("chosen", [])).astype(int).tolist()  # where they run along sides
    assert sorted(map(tuple, mesh.points_vx[found].tolist())) == sorted(place[n] for n in members)


@pytest.mark.parametrize("inner", ["ROUND", "I.ROUND"])
def test_sets_that_contain_themselves_are_refused(inner: str, tmp_path: Path) -> None:
    """By their name or that of their instance before it; sets in sets are not, up to some fifty."""
    (tmp_path / "a.inp").write_text(SQUARES.format(sets=f"*Nset, nset=ROUND\n1\n*Nset, nset=ROUND\n{inner}"))
    with pytest.raises(InputError, match="set 'ROUND' contains itself"):
        read_mesh(tmp_path / "a.inp", notes=[])
    chain = "".join(f"*Nset, nset=S{n}\nI.S{n - 1}\n" for n in range(1, 20))
    (tmp_path / "b.inp").write_text(SQUARES.format(sets=f"*Nset, nset=S0\n5\n{chain}").replace("\n\n", "\n"))
    mesh = read_mesh(tmp_path / "b.inp", notes=[])
    assert mesh.points_vx[mesh.named_points["S19"]].tolist() == [1, 1]


def test_all_solid_cells_of_a_file_are_counted_by_their_type(tmp_path: Path) -> None:
    corners = "0 0 0 1 0 0 1 1 0 0 1 0 0 0 1 1 0 1 1 1 1 0 1 1"
    text = f"""# vtk DataFile Version 3.0
solids
ASCII
DATASET UNSTRUCTURED_GRID
POINTS 8 double
{corners}
CELLS 4 23
3 0 1 2
4 0 1 2 4
8 0 1 2 3 4 5 6 7
4 0 2 3 4
CELL_TYPES 4
5 10 12 10
"""
    (tmp_path / "a.vtk").write_text(text)
    with pytest.raises(InputError, match=r"solid cells \(2 of type tetrahedron, 1 of type hexahedron\)"):
        read_mesh(tmp_path / "a.vtk", notes=[])


BOTH_LIBRARIES = """
import sys
from pathlib import Path
import netCDF4, h5py
import numpy as np
from tmc_vem.mesh.files.netcdf import variables_of

with netCDF4.Dataset("a.nc", "w") as data:
    for name, size in (("n", 3), ("two", 2)):
        data.createDimension(name, size)
    data.createVariable("points", "f8", ("n", "two"))[:] = np.arange(6.0).reshape(3, 2)
    data["points"].units = "mm"
    data.createVariable("number", "i4", ("n",))[:] = [3, 4, 5]
    data.createVariable("mesh", "i4", ())[...] = 7
with h5py.File("b.nc", "w") as file:  # of another program, without names of dimensions
    file["points"] = np.zeros((3, 2))
one = variables_of(Path("a.nc"))
sys.modules["netCDF4"] = None
other = variables_of(Path("a.nc"))
assert one["points"].dimensions == ("n", "two")
for name, variable in one.items():
    assert other[name].dimensions == variable.dimensions, name
    assert np.array_equal(other[name].values, variable.values), name
    assert other[name].text("units") == variable.text("units"), name
assert variables_of(Path("b.nc"))["points"].dimensions == ("", "")
"""


def test_both_libraries_read_the_same_from_netcdf_4(tmp_path: Path) -> None:
    """In a process of its own: their HDF5 is not that of dolfinx."""
    if importlib.util.find_spec("netCDF4") is None or importlib.util.find_spec("h5py") is None:
        pytest.skip("netCDF4 or h5py is missing")
    ended = process(["-c", BOTH_LIBRARIES], cwd=tmp_path)
    assert ended.returncode == 0, ended.stderr
