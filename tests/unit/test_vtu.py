"""VTU files against the readers of VTK and of meshio."""

from __future__ import annotations

import base64
import zlib
from pathlib import Path
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest
import pyvista

from tmc_vem.results.vtu import BLOCK, VtuWriter
from tmc_vem.support.units import Units
from tmc_vem.system.fields import Fields, Polygons, write_pvtu


def fields(sizes: list[int]) -> Fields:
    """Arbitrary values on cells that have these numbers of points, none of which they share."""
    rng = np.random.default_rng(3)
    offsets = np.concatenate([[0], np.cumsum(np.array(sizes, dtype=np.int64))])
    n = int(offsets[-1])
    polygons = Polygons(
        rng.random((n, 2)), offsets, rng.permutation(n), rng.integers(0, 3, len(sizes)), ("a", "b", "c")
    )
    return Fields(polygons, rng.random((n, 2)), *rng.random((3, len(sizes))))


MIXED = [3, 8, 4, 3, 10, 4, 4, 7]
MANY = [5, 4] * (BLOCK // 8 // 4 + 3)  # all values for cells take more than one block


@pytest.mark.parametrize("sizes", [MIXED, MANY], ids=["mixed", "more than a block"])
def test_vtk_and_meshio_read_what_was_written(tmp_path: Path, sizes: list[int]) -> None:
    state = fields(sizes)
    VtuWriter(state.polygons).write(tmp_path / "a.vtu", state)
    theirs, other = pyvista.read(tmp_path / "a.vtu"), meshio.read(tmp_path / "a.vtu")
    for points, moved in (
        (theirs.points, theirs.point_data["displacement"]),
        (other.points, other.point_data["displacement"]),
    ):
        np.testing.assert_array_equal(points, np.pad(state.polygons.points_nx, ((0, 0), (0, 1))))
        np.testing.assert_array_equal(moved, np.pad(state.displacement_ni, ((0, 0), (0, 1))))

    order = np.argsort(sizes, kind="stable")
    expected = np.concatenate([state.polygons.cell(c) for c in order])
    starts = np.cumsum([0, *np.array(sizes)[order][:-1]])
    np.testing.assert_array_equal(theirs.cells, np.insert(expected, starts, np.array(sizes)[order]))
    np.testing.assert_array_equal(np.concatenate([block.data.ravel() for block in other.cells]), expected)
    assert [len(block.data[0]) for block in other.cells] == sorted(set(sizes))
    assert set(theirs.celltypes) == {7}
    for name, values in (
        ("J", state.jacobian_c), ("min_J", state.min_jacobian_c), ("energy_density", state.energy_density_c),
        ("region", state.polygons.region_c),
    ):  # fmt: skip
        np.testing.assert_array_equal(theirs.cell_data[name], values[order])
        np.testing.assert_array_equal(np.concatenate(other.cell_data[name]), values[order])


def test_a_plain_xml_parser_reads_the_file(tmp_path: Path) -> None:
    state = fields(MIXED)
    VtuWriter(state.polygons).write(tmp_path / "a.vtu", state)
    arrays = {array.get("Name"): array for array in ElementTree.parse(tmp_path / "a.vtu").iter("DataArray")}
    assert {array.get("format") for array in arrays.values()} == {"binary"}  # meshio has no others with Python 3.13
    head, block = str(arrays["J"].text)[:44], str(arrays["J"].text)[44:]
    values = np.frombuffer(zlib.decompress(base64.b64decode(block)))
    np.testing.assert_array_equal(values, state.jacobian_c[np.argsort(MIXED, kind="stable")])
    assert np.frombuffer(base64.b64decode(head), np.uint64)[[0, 2]].tolist() == [1, 8 * len(MIXED)]


def test_a_rank_without_cells_writes_a_readable_piece(tmp_path: Path) -> None:
    state = fields([])
    VtuWriter(state.polygons).write(tmp_path / "a.vtu", state)
    assert pyvista.read(tmp_path / "a.vtu").n_cells == 0


def test_states_of_one_grid_share_its_bytes_and_differ_in_theirs(tmp_path: Path) -> None:
    first = fields(MIXED)
    second = Fields(first.polygons, 2 * first.displacement_ni, *(a + 1 for a in (
        first.jacobian_c, first.min_jacobian_c, first.energy_density_c)))  # fmt: skip
    writer = VtuWriter(first.polygons)
    files = [tmp_path / "first.vtu", tmp_path / "second.vtu"]
    for path, state in zip(files, (first, second), strict=True):
        writer.write(path, state)
    one, two = map(pyvista.read, files)
    np.testing.assert_array_equal(one.cell_connectivity, two.cell_connectivity)
    np.testing.assert_array_equal(2 * one["displacement"], two["displacement"])
    np.testing.assert_array_equal(one["energy_density"] + 1, two["energy_density"])


def labels(data: pyvista.DataSet) -> dict[str, str]:
    """Units that VTK has read, by the name of the array."""
    found = {"Points": data.GetPoints().GetData()}
    for group in (data.GetPointData(), data.GetCellData()):
        for n in range(group.GetNumberOfArrays()):
            found[group.GetArrayName(n)] = group.GetArray(n)
    return {name: array.GetInformation().Get(array.UNITS_LABEL()) for name, array in found.items()}


EXPECTED = {"Points": "mm", "displacement": "mm", "J": "1", "min_J": "1", "energy_density": "N/mm^2", "region": "1",
            "medium": "1"}  # fmt: skip


def test_vtk_reads_the_units_of_every_array(tmp_path: Path) -> None:
    state = fields(MIXED)
    VtuWriter(state.polygons, Units("mm", "N")).write(tmp_path / "a.vtu", state)
    assert labels(pyvista.read(tmp_path / "a.vtu")) == EXPECTED
    VtuWriter(state.polygons).write(tmp_path / "b.vtu", state)
    assert labels(pyvista.read(tmp_path / "b.vtu"))["energy_density"] == "force/length^2"


def test_vtk_reads_the_units_of_pieces_put_together(tmp_path: Path) -> None:
    first, second = fields(MIXED), fields([4, 4, 5])
    for name, state in (("a_0.vtu", first), ("a_1.vtu", second)):
        VtuWriter(state.polygons, Units("mm", "N")).write(tmp_path / name, state)
    write_pvtu(tmp_path / "a.pvtu", ["a_0.vtu", "a_1.vtu"], Units("mm", "N"))
    whole = pyvista.read(tmp_path / "a.pvtu")
    assert whole.n_cells == len(MIXED) + 3
    assert labels(whole) == EXPECTED
