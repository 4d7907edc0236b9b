"""Read geometries of gmsh (.geo): meshed with the sizes, kind of cells and physical groups that the file asks for.

This runs in a process of its own: after a faulty text the parser of gmsh keeps what it has not read of it, and refuses
the next geometry, which is good, for it (findings/gmsh-remembers-a-faulty-geometry.sh).
"""

from __future__ import annotations

import re
import tempfile
from pathlib import Path
from typing import Any

from tmc_vem.mesh.cell_count import TRIANGLES, check_cells
from tmc_vem.mesh.files import msh
from tmc_vem.mesh.files.record import Reading, Record
from tmc_vem.support.c_stdout import c_stdout_on_stderr
from tmc_vem.support.environment import cells_allowed
from tmc_vem.support.errors import InputError
from tmc_vem.support.optional import load

SIZE_MIN = "Mesh.MeshSizeMin"


def read(path: Path, reading: Reading) -> Record:
    """The mesh of a geometry.

    Raises:
        InputError: gmsh is missing, refuses the file, finds nothing plane to mesh in it, or would make too many cells.
    """
    gmsh = load("gmsh", "it needs")
    gmsh.initialize([])
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.logger.start()
    try:
        _open(gmsh, path)
        _check_curves(gmsh, cells_allowed())
        with c_stdout_on_stderr():  # quadrilaterals make gmsh print there, whatever it is told
            gmsh.model.mesh.generate(2)
        with tempfile.TemporaryDirectory() as directory:
            written = Path(directory) / "model.msh"
            notes = write_model(gmsh, written)
            record = msh.read(written, reading)
    except InputError:
        raise
    except Exception as error:  # gmsh raises plain exceptions
        said = [line.partition(":")[2].strip() for line in gmsh.logger.get() if line.startswith("Error")]
        reason = said[:1] or str(error).strip().splitlines()[-1:] or [type(error).__name__]
        shown = re.sub(rf"'?[^\s']*{re.escape(path.name)}'?", path.name, reason[0])  # not that of a copy
        raise InputError(f"gmsh cannot mesh it: {shown}") from None
    finally:
        gmsh.logger.stop()
        gmsh.finalize()
    record.notes += notes
    return record


def write_model(gmsh: Any, path: Path) -> list[str]:
    """Write the mesh of the current model of gmsh as MSH, and give notes on what is not written."""
    everything = gmsh.option.getNumber("Mesh.SaveAll") > 0.0
    # with all entities, version 2.2 loses the groups
    gmsh.option.setNumber("Mesh.MshFileVersion", 4.1 if everything else 2.2)
    gmsh.option.setNumber("Mesh.Binary", 1)
    gmsh.write(str(path))
    ungrouped = [tag for _, tag in gmsh.model.getEntities(2) if not len(gmsh.model.getPhysicalGroupsForEntity(2, tag))]
    if everything or not ungrouped or not gmsh.model.getPhysicalGroups():
        return []
    listed = ", ".join(map(str, ungrouped[:3])) + (" ..." if len(ungrouped) > 3 else "")
    return [f"gmsh leaves out surfaces in no physical group (Mesh.SaveAll = 1 keeps them): {listed}"]


def _open(gmsh: Any, path: Path) -> None:
    """Open a geometry. gmsh wants a line break at its end and no byte order mark at its start."""
    content = path.read_bytes()
    plain = content.removeprefix(b"\xef\xbb\xbf")
    if plain is content and plain.endswith(b"\n"):
        gmsh.open(str(path))
        return
    with tempfile.TemporaryDirectory() as directory:
        copy = Path(directory) / path.name
        # what the file includes is looked for beside it
        included = f'Include "{path.resolve().as_posix()}";\n\n'.encode()
        copy.write_bytes(included if plain is content else plain + b"\n")
        gmsh.open(str(copy))


def _check_curves(gmsh: Any, limit: float) -> None:
    """Estimate the cells from the nodes along the curves of each surface, before gmsh fills it.

    For this, no size is below the extent over the largest number of cells: a long curve of less has too many nodes.
    """
    low_x, low_y, _, high_x, high_y, _ = gmsh.model.getBoundingBox(-1, -1)
    smallest = gmsh.option.getNumber(SIZE_MIN)
    gmsh.option.setNumber(SIZE_MIN, max(smallest, max(high_x - low_x, high_y - low_y) / limit))
    gmsh.model.mesh.generate(1)
    gmsh.option.setNumber(SIZE_MIN, smallest)
    n_cells = 0.0
    for dimension, surface in gmsh.model.getEntities(2):
        edges = []
        for _, curve in gmsh.model.getBoundary([(dimension, surface)], oriented=False):
            _, coordinates, _ = gmsh.model.mesh.getNodes(1, curve, includeBoundary=True, returnParametricCoord=False)
            edges.append(max(len(coordinates) // 3 - 1, 1))
        low_x, low_y, _, high_x, high_y, _ = gmsh.model.getBoundingBox(dimension, surface)
        lengths = [high_x - low_x, high_y - low_y]
        h = 2.0 * sum(lengths) / max(sum(edges), 1)  # the outline is as long as the box around it, at least
        n_cells += max(TRIANGLES * lengths[0] * lengths[1] / h**2 if h > 0.0 else 0.0, 0.5 * sum(edges))
    check_cells(n_cells, limit, "going by the nodes that it asks for along its curves; use larger sizes in it")
    gmsh.model.mesh.clear()
