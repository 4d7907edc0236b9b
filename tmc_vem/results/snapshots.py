"""Fields of a run directory, read back from its VTU files."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tmc_vem.results.records import COLLECTION, TRIANGULATED, StepRecord, Written
from tmc_vem.support.errors import InputError
from tmc_vem.support.units import FIELDS as UNITS_OF
from tmc_vem.support.vtk_types import POLYGON, QUADRATIC_QUAD, QUADRATIC_TRIANGLE, from_vtk
from tmc_vem.system.fields import Fields, Polygons

QUADRATIC = {"triangle6": QUADRATIC_TRIANGLE, "quad8": QUADRATIC_QUAD}  # meshio's names


@dataclass(frozen=True)
class Snapshot:
    """Load step whose fields were written, in one file or pieces; ``load`` is its coordinate on the load path."""

    load: float
    files: tuple[Path, ...]


def snapshots(result: Written, *, triangulated: bool = False) -> list[Snapshot]:
    """Load steps of a run whose fields were written, by increasing load; of cells cut into triangles, if wanted.

    Raises:
        InputError: the run has no fields, or they are not readable.
    """
    if result.directory is None:
        raise InputError("the run was kept in memory only: it has no fields")
    path = result.directory / (f"{TRIANGULATED}.pvd" if triangulated else COLLECTION)
    try:
        entries = list(ElementTree.parse(path).iter("DataSet"))
    except FileNotFoundError:
        option = "--triangulated" if triangulated else "--snapshots 10"
        raise InputError(
            f"{result.directory} has no {'triangulated ' if triangulated else ''}fields: run again with {option}"
        ) from None
    except (OSError, ElementTree.ParseError) as error:
        raise InputError(f"{path} is not readable: {error}") from None
    by_load: dict[float, list[Path]] = {}
    for entry in entries:
        try:
            load, name = float(entry.attrib["timestep"]), entry.attrib["file"]
        except (KeyError, ValueError) as error:
            raise InputError(f"{path} is not readable: {error}") from None
        by_load.setdefault(load, []).extend(_pieces(path.parent / name))
    return [Snapshot(load, tuple(by_load[load])) for load in sorted(by_load)]


def _pieces(path: Path) -> list[Path]:
    """The VTU files of a file of a collection.

    Raises:
        InputError: it puts pieces together and is not readable.
    """
    if path.suffix != ".pvtu":
        return [path]
    try:
        return [path.parent / piece.attrib["Source"] for piece in ElementTree.parse(path).iter("Piece")]
    except (OSError, ElementTree.ParseError, KeyError) as error:
        raise InputError(f"{path} is not readable: {error}") from None


def nearest(available: list[Snapshot], load: float) -> Snapshot:
    """Snapshot with the load nearest to a wanted one."""
    if not available:
        raise InputError("no load step of the run was written")
    return min(available, key=lambda snapshot: abs(snapshot.load - load))


def record_of(result: Written, snapshot: Snapshot) -> StepRecord:
    """Load step that belongs to a snapshot."""
    return min(result.history, key=lambda record: abs(record.coordinate - snapshot.load))


def read_fields(result: Written, snapshot: Snapshot) -> Fields:
    """Fields of a snapshot, of all ranks.

    Raises:
        InputError: a file is missing or not readable.
    """
    names, media = tuple(result.min_j), tuple(result.media)
    return Fields.merge([_read(path, names, media) for path in snapshot.files])


def fields_of_file(path: Path) -> Fields:
    """Fields of a VTU file by itself: regions go by their numbers.

    Raises:
        InputError: it is missing or not readable.
    """
    return _read(path, None, ())


def _read(path: Path, region_names: tuple[str, ...] | None, media: tuple[str, ...]) -> Fields:
    import meshio

    try:
        return _fields(meshio.vtu.read(path), region_names, media)  # meshio.read would print, and leave the program
    except Exception as error:  # what meshio makes of a damaged file is anybody's guess
        raise InputError(f"{path} is not readable: {error or type(error).__name__}") from None


def _fields(mesh: Any, region_names: tuple[str, ...] | None, media: tuple[str, ...]) -> Fields:
    """The fields of a file; without names of regions, numbers are their names, and the file says which are medium.

    Raises:
        KeyError, ValueError: it lacks some, or has other regions.
    """
    sizes = np.concatenate([np.full(len(block.data), block.data.shape[1]) for block in mesh.cells])
    types = np.concatenate([np.full(len(block.data), QUADRATIC.get(block.type, POLYGON)) for block in mesh.cells])
    offsets = np.concatenate([[0], np.cumsum(sizes)])
    nodes = np.concatenate([np.ravel(block.data) for block in mesh.cells]).astype(np.int64)
    values = {name: np.concatenate(blocks) for name, blocks in mesh.cell_data.items()}
    region_c = values["region"].astype(np.int64)
    if region_names is None:
        region_names = tuple(f"region {n}" for n in range(int(region_c.max(initial=-1)) + 1))
        media = tuple(region_names[n] for n in np.unique(region_c[values["medium"] > 0]))
    if not (len(region_c) and region_c.min() >= 0 and region_c.max() < len(region_names)):
        raise ValueError(f"its regions are not the {len(region_names)} of the history")
    polygons = Polygons(
        points_nx=np.asarray(mesh.points[:, :2], dtype=float),
        offsets=offsets,
        connectivity=from_vtk(offsets, nodes, types),
        region_c=region_c,
        region_names=region_names,
        media=media,
    )
    return Fields(
        polygons=polygons,
        displacement_ni=np.asarray(mesh.point_data["displacement"][:, :2], dtype=float),
        jacobian_c=values["J"],
        min_jacobian_c=values["min_J"],
        energy_density_c=values["energy_density"],
        cell_fields={name: value for name, value in values.items() if name not in UNITS_OF},
        point_fields={name: np.asarray(value) for name, value in mesh.point_data.items() if name not in UNITS_OF},
    )
