"""Read and write meshes, in the formats of ``tmc_vem.mesh.files``.

Everything a mesh has survives writing and reading, in the same order: regions, named points and named edges. Each
format says so in its own way. MSH has physical groups and INP sets; in VTU and VTK, vertices and edges with names are
cells of their own, and arrays called ``region:NAME``, ``point:NAME`` and ``edges:NAME`` mark what the name is of. In
OBJ, groups are regions, and comments hold the names. MSH and INP know triangles and quadrilaterals only, OFF no names.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path

from tmc_vem.mesh.between import parts_of
from tmc_vem.mesh.check import find_faults, summaries
from tmc_vem.mesh.files import isolated
from tmc_vem.mesh.files.record import Reading, Record
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError
from tmc_vem.support.notes import say

# Formats that hold all of a mesh; those that are written without names; those that are only read.
FORMATS = (".vtu", ".vtk", ".msh", ".inp", ".obj", ".mat", ".nc")
WITHOUT_NAMES = (".off",)
READ_ONLY = (".med", ".vtp", ".geo")
_ISOLATED = (".mat", ".nc", ".med", ".geo")  # read by libraries in C
_READERS = {kind: kind[1:] for kind in (*FORMATS, *WITHOUT_NAMES, *READ_ONLY)} | {".nc": "ugrid", ".vtp": "vtu"}


def write_mesh(mesh: PolygonMesh, path: str | Path) -> None:
    """Write a mesh; the suffix of the file decides the format.

    Raises:
        InputError: the format is unknown, or cannot hold polygons with more than four sides (the message names a cell).
    """
    from tmc_vem.mesh.files.write import write

    path = Path(path)
    kind = _format(path, (*FORMATS, *WITHOUT_NAMES))
    if not path.parent.is_dir():
        raise InputError(f"{path} cannot be written: there is no directory {path.parent}")
    write(mesh, path, kind)


def read_mesh(
    path: str | Path, *, validate: bool = True, names: Mapping[str, str] | None = None, region_data: str | None = None,
    cracks: str = "join", notes: list[str] | None = None, called: str | None = None, cell_data: Sequence[str] = (),
) -> PolygonMesh:  # fmt: skip
    """Read a mesh that this program, gmsh or another one wrote.

    Higher-order cells become polygons through their corners, clockwise cells are turned, and vertices that no cell uses
    are dropped. Physical groups of surfaces, element sets, OBJ groups and numbers in cell data are regions; those of
    points and curves, and sets of nodes, are named points and edges. A cell in several groups belongs to the innermost.

    Args:
        path: file in one of the formats above.
        validate: refuse a mesh with bad cells; False only reads, for :mod:`tmc_vem.mesh.check`.
        names: for groups, by their number or their name in the file.
        region_data: cell data whose values are the regions' numbers.
        cracks: ``"keep"`` takes vertices at the same place for cracks; else they are refused.
        notes: gets what should be known about how the file was read; else it is said, see :mod:`tmc_vem.support.notes`.
        called: what messages call the file.
        cell_data: names of cell data (VTU, VTK, UGRID, MAT) that the mesh keeps, one number a cell.

    Raises:
        InputError: the file cannot be read, has no plane cells or others as well, is not plane, or has bad cells.
    """
    path = Path(path)
    called = called or str(path)
    kind = _format(path, tuple(_READERS))
    if not path.is_file():
        raise InputError(f"mesh file {path} does not exist")
    from tmc_vem.mesh.files.assemble import assemble

    reading = Reading(dict(names or {}), region_data, cracks, tuple(cell_data))
    record = _record(path, kind, reading, called)
    try:
        mesh = assemble(record, reading)
    except InputError as error:
        raise _of_file(called, "", str(error)) from None
    n_parts = int(parts_of(mesh).max()) + 1
    if n_parts > 1:
        record.notes.append(f"it falls into {n_parts} parts that share no side")
    if notes is not None:
        notes += record.notes
    else:
        for note in record.notes:
            say(f"{called}: {note}")
    faults = find_faults(mesh, cracks=cracks == "keep") if validate else []
    if faults:
        lines = summaries(faults)
        more = f"; {len(lines) - 1} other kinds of faults" if len(lines) > 1 else ""
        fix = " --fix repairs it" if all(fault.fixable for fault in faults) else ""
        remedy = f" ('tmc-vem mesh check' lists all,{fix})" if fix else " ('tmc-vem mesh check' lists all)"
        raise InputError(f"{called}: {lines[0]}{more}{remedy}")
    return mesh


def _record(path: Path, kind: str, reading: Reading, called: str) -> Record:
    """What the file says.

    Raises:
        InputError: it cannot be read; the message has the reason.
    """
    module = f"tmc_vem.mesh.files.{_READERS[kind]}"
    try:
        if kind in _ISOLATED:
            return isolated.read(module, path, reading, None if kind == ".geo" else isolated.LONGEST)
        record: Record = import_module(module).read(path, reading)
    except InputError as error:
        raise _of_file(called, "" if kind == ".geo" else kind, str(error)) from None
    except OSError as error:
        raise InputError(f"{called} cannot be read: {error.strerror or error}") from None
    except (ValueError, OverflowError, IndexError, KeyError, MemoryError, RecursionError) as error:
        # what is damaged in ways that no check foresees
        raise InputError(
            f"{called} is not a readable {kind} file: it is damaged ({str(error) or type(error).__name__})"
        ) from None
    return record


def _of_file(called: str, kind: str, reason: str) -> InputError:
    """What a reader says of "it", said of the file."""
    if reason.startswith("line "):
        return InputError(f"{called}, {reason}")
    if reason.startswith(("it has ", "it is not a plane ")):
        return InputError(f"{called} {reason[3:]}")
    return InputError(f"{called} is not a readable {kind} file: {reason}" if kind else f"{called}: {reason}")


def _format(path: Path, known: tuple[str, ...]) -> str:
    kind = path.suffix.lower()
    if kind not in known:
        raise InputError(f"{path}: unknown mesh format '{kind}', use one of {', '.join(known)}")
    return kind
