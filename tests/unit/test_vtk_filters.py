"""What VTK's filters make of written fields: exact gradients, lines and areas, where it interpolates as elements do."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista
from helpers_mesh import hanging, voronoi
from helpers_system import interpolate, make_system, region

from tmc_vem import Box, RunOptions, run
from tmc_vem.mesh import PolygonMesh, Rectangle, structured_quadrilaterals
from tmc_vem.mesh.files.io import read_mesh, write_mesh
from tmc_vem.mesh.make.outline import Region
from tmc_vem.mesh.make.triangles import triangle_mesh
from tmc_vem.results.output import SnapshotWriter
from tmc_vem.support.errors import InputError
from tmc_vem.vem.spaces.element_settings import ElementSettings

SLOPE = np.array([[0.3, -0.2], [0.15, 0.4]])
SQUARE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]


def skewed(n: int = 3) -> PolygonMesh:
    """Quadrilaterals that are no rectangles."""
    lines = np.linspace(0.0, 1.0, n + 1)
    mesh = structured_quadrilaterals(lines, lines, [Rectangle("domain", 0, 1, 0, 1)])
    x, y = mesh.points_vx.T
    moved = np.column_stack([x + 0.1 * np.sin(3 * y), y + 0.2 * x * y])
    return PolygonMesh(moved, mesh.cell_offsets, mesh.cell_vertices, mesh.region_c)


def linear(x: Any) -> Any:
    return x @ SLOPE.T + 0.1


def written(mesh: PolygonMesh, path: Path, order: int = 2, *, triangulated: bool = False) -> pyvista.UnstructuredGrid:
    """A linear displacement as VTK reads it back."""
    system = make_system(mesh, region("solid", K=20.0, mu=10.0), settings=ElementSettings(order=order))
    (path / "fields").mkdir()
    writer = SnapshotWriter(system, path, (1.0,), ("medium",), triangulated=triangulated, order=order)
    writer.offer(1, 1.0, interpolate(system, linear))
    grid = pyvista.get_reader(path / ("triangulated.pvd" if triangulated else "fields.pvd")).read()[0]
    assert isinstance(grid, pyvista.UnstructuredGrid)
    return grid


def assert_filters_are_exact(grid: pyvista.UnstructuredGrid, area: float) -> None:
    gradient = grid.compute_derivative(scalars="displacement")["gradient"].reshape(-1, 3, 3)[:, :2, :2]
    np.testing.assert_allclose(gradient, np.broadcast_to(SLOPE, gradient.shape), atol=1e-9)
    low, high = np.array(grid.bounds).reshape(3, 2).T[:, :2]
    line = grid.sample_over_line([*(low + 0.21 * (high - low)), 0], [*(low + 0.73 * (high - low)), 0], resolution=40)
    inside = line["vtkValidPointMask"] == 1
    assert inside.sum() > 30
    expected = linear(np.asarray(line.points)[inside, :2])
    np.testing.assert_allclose(line["displacement"][inside, :2], expected, atol=1e-7)
    assert grid.compute_cell_sizes()["Area"].sum() == pytest.approx(area, rel=1e-9)
    moved = grid.warp_by_vector("displacement").compute_cell_sizes()["Area"].sum()
    assert moved == pytest.approx(area * np.linalg.det(np.eye(2) + SLOPE), rel=1e-9)


@pytest.mark.parametrize("name", ["triangles", "quadrilaterals"])
def test_plain_cells_are_exact_as_written(name: str, tmp_path: Path) -> None:
    mesh = triangle_mesh([Region("domain", SQUARE)], 0.3) if name == "triangles" else skewed()
    grid = written(mesh, tmp_path)
    assert set(grid.celltypes) == {22 if name == "triangles" else 23}
    area = float(mesh_area(mesh))
    assert_filters_are_exact(grid, area)


@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("name", ["hanging nodes", "Voronoi"])
def test_all_cells_are_exact_when_triangulated(name: str, order: int, tmp_path: Path) -> None:
    mesh = hanging(3) if name == "hanging nodes" else voronoi(20)
    grid = written(mesh, tmp_path, order, triangulated=True)
    assert set(grid.celltypes) <= {22, 23}
    assert_filters_are_exact(grid, mesh_area(mesh))
    plain = pyvista.get_reader(tmp_path / "fields.pvd").read()[0]
    assert set(plain.celltypes) >= {7}  # where this is not so, as the page on ParaView says
    wrong = plain.compute_derivative(scalars="displacement")["gradient"].reshape(-1, 3, 3)[:, :2, :2]
    assert np.abs(wrong - SLOPE).max() > 0.1


def mesh_area(mesh: PolygonMesh) -> float:
    from tmc_vem.mesh.quality import measure

    return float(measure(mesh).area_c.sum())


def test_a_run_writes_both_and_gives_both_to_pyvista(tmp_path: Path) -> None:
    problem = Box(cells=(20, 5), medium_refinement=2, uy=-0.05)
    result = run(problem, tmp_path / "run", RunOptions(steps=1, snapshots=1, triangulated=True))
    whole, cut = result.to_pyvista(), result.to_pyvista(triangulated=True)
    assert whole.n_cells == result.n_cells
    assert set(whole.celltypes) == {7, 23}
    assert set(cut.celltypes) == {22, 23}
    for name in ("region", "medium", "J"):
        sums = [(grid.cell_data[name] * grid.compute_cell_sizes()["Area"]).sum() for grid in (whole, cut)]
        assert sums[0] == pytest.approx(sums[1], rel=1e-6)
    for suffix in ("vtu", "vtk"):
        cut.save(tmp_path / f"cut.{suffix}")
        whole.save(tmp_path / f"whole.{suffix}")
        assert pyvista.read(tmp_path / f"cut.{suffix}").n_cells == cut.n_cells
    plain = run(problem, tmp_path / "plain", RunOptions(steps=1, snapshots=1))
    assert plain.reaction == result.reaction
    with pytest.raises(InputError, match="has no triangulated fields: run again with --triangulated"):
        plain.to_pyvista(triangulated=True)


def test_what_pyvista_saves_is_read_as_a_mesh(tmp_path: Path) -> None:
    """Points that are in files once for each of their regions are one again; so they are in the run's own files."""
    result = run(Box(cells=(20, 5), uy=-0.01), tmp_path / "run", RunOptions(steps=1, snapshots=1))
    grid = result.to_pyvista()
    assert grid.n_points > len(np.unique(grid.points, axis=0))
    grid.save(tmp_path / "saved.vtk")
    for file in (tmp_path / "saved.vtk", *(tmp_path / "run" / "fields").glob("*.vtu")):
        mesh = read_mesh(file)
        assert (mesh.n_cells, mesh.n_vertices, mesh.region_names) == (100, 126, ("region_0", "region_1"))
        assert (mesh.n_sides_c == 4).all()


@pytest.mark.parametrize("order", ["little", "big"])
@pytest.mark.parametrize("header", ["UInt32", "UInt64"])
@pytest.mark.parametrize("compressor", ["NONE", "ZLIB", "LZ4", "LZMA"])
@pytest.mark.parametrize("mode", ["ascii", "binary", "appended, raw", "appended, encoded"])
def test_files_in_any_encoding_of_vtk_are_read(
    mode: str, compressor: str, header: str, order: str, tmp_path: Path
) -> None:
    """Blocks of 64 bytes: arrays have many, and the last is not full."""
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

    mesh = skewed(5)
    write_mesh(mesh, tmp_path / "a.vtu")
    writer = vtkXMLUnstructuredGridWriter()
    writer.SetInputData(pyvista.read(tmp_path / "a.vtu"))
    writer.SetFileName(str(tmp_path / "b.vtu"))
    getattr(writer, f"SetDataModeTo{mode.partition(',')[0].capitalize()}")()
    writer.SetEncodeAppendedData(mode.endswith("encoded"))
    writer.SetCompressorType(getattr(writer, compressor))
    getattr(writer, f"SetHeaderTypeTo{header}")()
    writer.SetByteOrder(writer.LittleEndian if order == "little" else writer.BigEndian)
    writer.SetBlockSize(64)
    assert writer.Write()
    found = read_mesh(tmp_path / "b.vtu")
    assert np.array_equal(found.points_vx, mesh.points_vx)
    assert np.array_equal(found.cell_vertices, mesh.cell_vertices)
    assert found.region_names == mesh.region_names
