"""An extracted problem as files: the mesh, and the problem file that names it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from tmc_vem.design.extract import Extracted
from tmc_vem.mesh.files.io import write_mesh
from tmc_vem.problems.mesh_tables import MeshTable
from tmc_vem.problems.own import OwnProblem
from tmc_vem.simulation.problem_file import from_root
from tmc_vem.support.files import whole_file
from tmc_vem.support.toml_text import as_table, toml_text

HEADER = "# A design by its outlines, with real void as third medium: 'tmc-vem run' on this file gives what it does.\n"


def write_extracted(
    extracted: Extracted, directory: str | Path, name: str = "extracted", solve: Mapping[str, Any] | None = None
) -> tuple[Path, OwnProblem]:
    """Write the mesh, ``NAME.vtu``, and the problem, ``NAME.toml``.

    Args:
        extracted: the problem.
        directory: where; it is made if it is not there.
        name: of both files.
        solve: how it is solved instead of as the design problem, as in a problem file.

    Returns:
        The problem file, and the problem.

    Raises:
        InputError: a name of the mesh does not fit into the file.
    """
    directory = Path(directory)
    directory.mkdir(parents=True, exist_ok=True)
    write_mesh(extracted.mesh, directory / f"{name}.vtu")
    table = replace(extracted.table, mesh=MeshTable(file=f"{name}.vtu"))
    if solve is not None:
        table = replace(table, solve=solve)
    plain = as_table(table)
    for region in plain["regions"].values():
        for place, key in ((region, "density"), (region.get("medium", {}), "regulariser")):
            if key in place:
                place[key] = from_root(place[key], extracted.directory)
    path = directory / f"{name}.toml"
    with whole_file(path, durable=False) as temporary:
        temporary.write_text(HEADER + _notes(extracted) + toml_text(plain), encoding="utf-8")
    regions = {r: _found_from_root(table.regions[r], plain["regions"][r]) for r in table.regions}
    return path, OwnProblem(replace(table, regions=regions), directory)


def _found_from_root(region: Any, plain: Mapping[str, Any]) -> Any:
    """A region's table with whole paths of files, as in the plain one."""
    if region.density is not None:
        return replace(region, density=plain["density"])
    if region.medium is not None and "regulariser" in plain["medium"]:
        return replace(region, medium=replace(region.medium, regulariser=plain["medium"]["regulariser"]))
    return region


def _notes(extracted: Extracted) -> str:
    """What became of the design, as comments."""
    of = extracted.outlines
    lines = [
        f"volume of the densities {of.volume_densities:.6g}, within their level {of.level:.4g}: {of.volume_level:.6g}, "
        f"of the outlines {of.volume:.6g}, of the mesh {extracted.volume_mesh:.6g}",
        *extracted.notes,
    ]
    return "".join(f"# {' '.join(line.split())}\n" for line in lines)
