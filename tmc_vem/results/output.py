"""Fields of a running computation: collected from the discretisation, written for ParaView and drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.results.records import COLLECTION, FIELDS, TRIANGULATED
from tmc_vem.results.subtriangles import SubTriangles
from tmc_vem.results.vtu import VtuWriter
from tmc_vem.support.distributed import Vec
from tmc_vem.support.parallel import from_root, on_every_rank, on_root
from tmc_vem.support.units import FIELDS as UNITS_OF
from tmc_vem.support.units import Units
from tmc_vem.system.discretisation import Discretisation
from tmc_vem.system.fields import Fields, Polygons, write_pvd, write_pvtu
from tmc_vem.system.recovery import Patches
from tmc_vem.system.stress import Stresses
from tmc_vem.system.tensors import tensors_needed, values_of


def polygons_of(system: Discretisation, media: Sequence[str]) -> Polygons:
    """This rank's cells, of which those in the regions ``media`` are third medium."""
    return replace(system.output_polygons(), media=tuple(media))


def fields_of(system: Discretisation, u: Vec, polygons: Polygons) -> Fields:
    """Fields of this rank's cells at state ``u``."""
    mean_j, min_j = system.cell_jacobians(u)
    return Fields(
        polygons=polygons,
        displacement_ni=system.output_displacements(u),
        jacobian_c=mean_j,
        min_jacobian_c=min_j,
        energy_density_c=system.cell_energies(u) / system.cell_areas(),
    )


def gather_fields(system: Discretisation, u: Vec, media: Sequence[str]) -> Fields | None:
    """Fields of all cells on rank 0, None elsewhere; those in the regions ``media`` are third medium."""
    mine = fields_of(system, u, polygons_of(system, media))
    parts = [mine] if system.comm.size == 1 else system.comm.gather(mine)
    return Fields.merge(parts) if parts else None


def by_region(polygons: Polygons) -> tuple[Polygons, NDArray[np.int64]]:
    """The same cells with points that several regions share once for each, and the point (n_points,) that each was."""
    n_points = len(polygons.points_nx)
    region_k = np.repeat(polygons.region_c, np.diff(polygons.offsets))
    first = np.full(n_points, -1)
    first[polygons.connectivity[::-1]] = region_k[::-1]  # the region that a point is met in first keeps its number
    others = region_k != first[polygons.connectivity]
    keys, number = np.unique(region_k[others] * n_points + polygons.connectivity[others], return_inverse=True)
    connectivity = polygons.connectivity.copy()
    connectivity[others] = n_points + number
    origin = np.concatenate([np.arange(n_points), keys % max(n_points, 1)])
    return replace(polygons, points_nx=polygons.points_nx[origin], connectivity=connectivity), origin


class SnapshotWriter:
    """Writes VTU files of selected load steps, a piece a rank, and the PVD collection that ParaView opens.

    Args:
        system: the discretisation.
        directory: run directory.
        loads: coordinates along the load path; the first converged step at or past each is written.
        media: names of the regions of third medium.
        units: of the problem.
        triangulated: write each of these steps once more, cut into triangles in which VTK interpolates exactly.
        order: of the elements.
        stresses, names: what else is written, of stress and strain, by name (:mod:`tmc_vem.system.tensors`). Points
            that several regions share are then there once for each, as stress jumps there.
    """

    def __init__(
        self, system: Discretisation, directory: Path, loads: tuple[float, ...], media: Sequence[str],
        units: Units | None = None, *, triangulated: bool = False, order: int = 2,
        stresses: Stresses | None = None, names: Sequence[str] = (),
    ) -> None:  # fmt: skip
        self._system = system
        self.directory = directory
        self._pending = sorted(loads)
        self.entries: list[tuple[float, list[str]]] = []
        self._polygons = polygons_of(system, media)
        self._units = units or Units()
        self._order = order
        self._stresses = stresses if names else None
        self._names = tuple(name for name in names if name not in UNITS_OF)
        self._patches: Patches | None = None
        self._whole, self._origin_n = by_region(self._polygons)
        if self._stresses is None:
            self._whole = self._polygons
        self._writer = VtuWriter(self._whole, self._units)
        self._parts: SubTriangles | None = None
        if triangulated:
            self._parts = on_every_rank(system.comm, lambda: SubTriangles(system, self._polygons, order))
            self._part_writer = VtuWriter(self._parts.polygons, self._units)

    def restore(self, entries: Sequence[Sequence[Any]]) -> None:
        """Go on after these load factors and files, which an interrupted run has written.

        After a power cut the latest of them may be missing or empty: those are left out of the collection.
        """
        comm, plain = self._system.comm, [(float(load), list(names)) for load, names in entries]
        reached = plain[-1][0] if plain else 0.0
        self._pending = [wanted for wanted in self._pending if wanted > reached + 1e-9]
        self.entries = from_root(comm, lambda: [entry for entry in plain if self._is_there(entry[1])])
        if plain:
            on_root(comm, self._collect)

    def _is_there(self, names: Sequence[str]) -> bool:
        files = [self.directory / name for name in names]
        pieces = [piece for file in files if file.suffix == ".pvtu" for piece in file.parent.glob(f"{file.stem}_*.vtu")]
        return all(file.is_file() and file.stat().st_size > 0 for file in (*files, *pieces))

    def offer(self, step: int, load: float, u: Vec) -> bool:
        """Write this step if one of the selected loads has been reached; whether it was. Called on all ranks."""
        return bool(self._pending) and load >= self._pending[0] - 1e-9 and self.write(step, load, u)

    def write(self, step: int, load: float, u: Vec) -> bool:
        """Write this step unless it is there already; whether it was written. Called on all ranks."""
        if self.entries and load <= self.entries[-1][0]:
            return False
        self._pending = [wanted for wanted in self._pending if wanted > load + 1e-9]
        comm = self._system.comm
        fields = self._fields(u)
        whole = self._write_pieces(f"step_{step:05d}", self._writer, fields)
        self.entries.append((load, [whole]))
        if self._parts is not None:
            cell_t = self._parts.cell_t
            of_cells = (fields.jacobian_c, fields.min_jacobian_c, fields.energy_density_c)
            more = {name: values[cell_t] for name, values in fields.cell_fields.items()}
            moved = self._parts.displacements(u)
            jacobian_c, min_jacobian_c, density_c = (values[cell_t] for values in of_cells)
            cut = Fields(self._parts.polygons, moved, jacobian_c, min_jacobian_c, density_c, cell_fields=more)
            self._write_pieces(f"{TRIANGULATED}_{step:05d}", self._part_writer, cut)
        on_root(comm, self._collect)
        return True

    def _fields(self, u: Vec) -> Fields:
        """What is written of a state."""
        fields = fields_of(self._system, u, self._polygons)
        if self._stresses is None:
            return fields
        if self._patches is None:
            self._patches = Patches(self._stresses, self._polygons, self._order)
        needed = tensors_needed(self._names)
        recovered, means = self._patches.recovered_and_means(u, needed)
        at_points = {}
        for name, values_k in recovered.at_nodes().items():
            at_points[name] = np.zeros((len(self._origin_n), values_k.shape[1]))
            at_points[name][self._whole.connectivity] = values_k
        return replace(
            fields,
            polygons=self._whole,
            displacement_ni=fields.displacement_ni[self._origin_n],
            cell_fields={name: values_of(name, means) for name in self._names},
            point_fields={name: values_of(name, at_points) for name in self._names},
        )

    def _write_pieces(self, name: str, writer: VtuWriter, fields: Fields) -> str:
        """Write a state, a piece a rank; the name of the file that holds or names all of it."""
        comm, here = self._system.comm, self.directory / FIELDS
        whole = f"{name}.{'vtu' if comm.size == 1 else 'pvtu'}"
        pieces = [f"{name}_{rank}.vtu" for rank in range(comm.size)] if comm.size > 1 else [whole]
        on_every_rank(comm, lambda: writer.write(here / pieces[comm.rank], fields))
        filled = [
            name for name, n_cells in zip(pieces, comm.allgather(fields.polygons.n_cells), strict=True) if n_cells
        ]
        if comm.size > 1:
            more = [writer.elements(group) for group in (fields.cell_fields, fields.point_fields)]
            on_root(comm, lambda: write_pvtu(here / whole, filled, self._units, *more))
        return f"{FIELDS}/{whole}"

    def _collect(self) -> None:
        write_pvd(self.directory / COLLECTION, self.entries)
        if self._parts is not None:
            cut = [
                (load, [name.replace("/step_", f"/{TRIANGULATED}_") for name in names]) for load, names in self.entries
            ]
            write_pvd(self.directory / f"{TRIANGULATED}.pvd", cut)
