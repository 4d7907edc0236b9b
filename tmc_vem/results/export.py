"""Runs in the data structures of other programs: pandas, PyVista, meshio. Each is imported when it is asked for."""

from __future__ import annotations

from typing import Any

import numpy as np

from tmc_vem.results.records import COLUMNS, Written
from tmc_vem.results.snapshots import nearest, read_fields, snapshots
from tmc_vem.support import optional
from tmc_vem.support.units import AREA, COORDINATES, LENGTH, NONE, STRESS, Units
from tmc_vem.support.vtk_types import cell_types, to_vtk
from tmc_vem.system.fields import Fields, Polygons
from tmc_vem.system.tensors import COMPONENTS, kind_of


def to_pandas(result: Written) -> Any:
    """Load steps as a data frame, a row a step, with the columns of history.csv; ``frame.attrs["units"]`` has units.

    Raises:
        InputError: pandas is not installed.
    """
    pandas = optional.load("pandas", "this needs")
    rows = [record.as_row() for record in result.history]
    frame = pandas.DataFrame(rows, columns=None if rows else list(COLUMNS)).set_index("step")
    frame.attrs["units"] = dict(result.units)
    return frame


def cells_to_pandas(result: Written, load: float = 1.0) -> Any:
    """Cells of the written load step nearest to a load factor as a data frame, a row a cell.

    Columns are region, centroid and area in the reference configuration, J, min_J, energy_density, and what the run has
    written of stress and strain, a column a component; ``frame.attrs["units"]`` has units.

    Raises:
        InputError: pandas is not installed, or the run has no fields.
    """
    pandas = optional.load("pandas", "this needs")
    fields = fields_at(result, load)
    polygons = fields.polygons
    units = Units(**result.inputs.get("units", {}))
    columns = {"region": np.array(polygons.region_names)[polygons.region_c], **_geometry(polygons)}
    kinds = {"x": LENGTH, "y": LENGTH, "area": AREA, "J": NONE, "min_J": NONE, "energy_density": STRESS}
    columns |= {name: values for name, values in _cell_data(fields).items() if name in kinds}
    for name, values in fields.cell_fields.items():
        parts = {f"{name}_{part}": values[:, n] for n, part in enumerate(COMPONENTS.get(name, ()))} or {name: values}
        columns |= parts
        kinds |= dict.fromkeys(parts, kind_of(name))
    frame = pandas.DataFrame(columns).rename_axis("cell")
    frame.attrs["units"] = {name: units.of(kind) for name, kind in kinds.items()}
    return frame


def _geometry(polygons: Polygons) -> dict[str, Any]:
    """Centroids and areas of the cells in the reference configuration."""
    start = np.repeat(
        polygons.points_nx[polygons.connectivity[polygons.offsets[:-1]]], np.diff(polygons.offsets), axis=0
    )
    following = np.arange(1, len(polygons.connectivity) + 1)
    following[polygons.offsets[1:] - 1] = polygons.offsets[:-1]
    arm = polygons.points_nx[polygons.connectivity] - start
    after = arm[following]
    cross = arm[:, 0] * after[:, 1] - arm[:, 1] * after[:, 0]
    twice = np.add.reduceat(cross, polygons.offsets[:-1])
    moment = np.add.reduceat((arm + after) * cross[:, None], polygons.offsets[:-1]) / (3.0 * twice[:, None])
    x, y = (start[polygons.offsets[:-1]] + moment).T
    return {"x": x, "y": y, "area": 0.5 * twice}


def to_meshio(result: Written, load: float = 1.0) -> Any:
    """Fields of the written load step nearest to a load factor, as a ``meshio.Mesh`` of polygons.

    Point data: displacement; cell data: J, min_J, energy_density, region; both: what the run has written of stress and
    strain. ``field_data`` has the regions' numbers.

    Raises:
        InputError: the run has no fields.
    """
    import meshio

    fields = fields_at(result, load)
    order, blocks = _blocks(fields)
    return meshio.Mesh(
        _in_space(fields.polygons.points_nx),
        [("polygon", block) for block in blocks],
        point_data={"displacement": _in_space(fields.displacement_ni), **fields.point_fields},
        cell_data={name: [values[cells] for cells in order] for name, values in _cell_data(fields).items()},
        field_data={name: np.array([n, 2]) for n, name in enumerate(fields.polygons.region_names)},
    )


def to_pyvista(result: Written, load: float = 1.0, *, triangulated: bool = False) -> Any:
    """Fields of the written load step nearest to a load factor, as a ``pyvista.UnstructuredGrid``, undeformed.

    ``mesh.warp_by_vector("displacement")`` deforms it. Filters that interpolate are exact in plain triangles and
    quadrilaterals, and in all cells if ``triangulated``. ``field_data`` has the regions' names and the fields' units,
    which are also in the arrays' information, as in the VTU files.

    Args:
        result: the run.
        load: factor, or coordinate on the load path.
        triangulated: the cells cut into triangles that a run with this option has written.

    Raises:
        InputError: PyVista is not installed, or the run has no such fields.
    """
    pyvista = optional.load("pyvista", "this needs")
    fields = fields_at(result, load, triangulated=triangulated)
    polygons = fields.polygons
    types = cell_types(polygons.points_nx, polygons.offsets, polygons.connectivity)
    nodes = to_vtk(polygons.offsets, polygons.connectivity, types)
    cells = np.insert(nodes, polygons.offsets[:-1], np.diff(polygons.offsets))
    mesh = pyvista.UnstructuredGrid(cells, types.astype(np.uint8), _in_space(polygons.points_nx))
    mesh.point_data["displacement"] = _in_space(fields.displacement_ni)
    for name, values in fields.point_fields.items():
        mesh.point_data[name] = values
    for name, values in _cell_data(fields).items():
        mesh.cell_data[name] = values
    mesh.field_data["region_names"] = list(polygons.region_names)
    of_problem = Units(**result.inputs.get("units", {}))
    more = {*fields.point_fields, *fields.cell_fields}
    units = of_problem.of_fields() | {name: of_problem.of(kind_of(name)) for name in sorted(more)}
    mesh.field_data["units"] = [f"{name}: {unit}" for name, unit in units.items() if name != COORDINATES]
    for data in (mesh.GetPointData(), mesh.GetCellData()):
        for array in map(data.GetArray, range(data.GetNumberOfArrays())):
            array.GetInformation().Set(array.UNITS_LABEL(), units[array.GetName()])
            for n, component in enumerate(COMPONENTS.get(array.GetName(), ())):
                array.SetComponentName(n, component)
    return mesh


def fields_at(result: Written, load: float, *, triangulated: bool = False) -> Fields:
    """Fields of the written load step nearest to a load factor, as they are or cut into triangles.

    Raises:
        InputError: the run has no such fields.
    """
    return read_fields(result, nearest(snapshots(result, triangulated=triangulated), load))


def _blocks(fields: Fields) -> tuple[list[Any], list[Any]]:
    """Cells, and their points, in groups of equally many points."""
    polygons = fields.polygons
    sizes = np.diff(polygons.offsets)
    order = [np.flatnonzero(sizes == size) for size in np.unique(sizes)]
    blocks = [polygons.connectivity[polygons.offsets[cells][:, None] + np.arange(sizes[cells[0]])] for cells in order]
    return order, blocks


def _cell_data(fields: Fields) -> dict[str, Any]:
    return {
        "J": fields.jacobian_c,
        "min_J": fields.min_jacobian_c,
        "energy_density": fields.energy_density_c,
        "region": fields.polygons.region_c,
        "medium": (~fields.polygons.is_solid_c).astype(np.uint8),
        **fields.cell_fields,
    }


def _in_space(plane: Any) -> Any:
    return np.column_stack([plane, np.zeros(len(plane))])
