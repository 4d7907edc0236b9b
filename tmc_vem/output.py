"""Fields of a running computation: collected from the discretisation, written for ParaView and drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tmc_vem.fields import Fields, Polygons, write_pvd, write_pvtu
from tmc_vem.parallel import on_every_rank, on_root
from tmc_vem.results import COLLECTION, FIELDS
from tmc_vem.units import Units
from tmc_vem.vtu import VtuWriter

Float = NDArray[np.float64]


class FieldSource(Protocol):
    """What a discretisation offers for output, for the cells of this rank."""

    comm: Any

    def output_polygons(self) -> Polygons:
        """The cells as polygons through all nodes of their boundary."""

    def output_displacements(self, u: Any) -> Float:
        """(n_points, 2) displacements of the polygons' points."""

    def cell_energies(self, u: Any) -> Float:
        """(n_cells,) energies."""

    def cell_areas(self) -> Float:
        """(n_cells,) reference areas."""

    def cell_jacobians(self, u: Any) -> tuple[Float, Float]:
        """(n_cells,) mean and smallest J."""


def polygons_of(source: FieldSource, media: Sequence[str] | None) -> Polygons:
    """This rank's cells, of which those in ``media`` are third medium; None leaves it to the names."""
    return replace(source.output_polygons(), media=None if media is None else tuple(media))


def fields_of(source: FieldSource, u: Any, polygons: Polygons) -> Fields:
    """Fields of this rank's cells at state ``u``."""
    mean_j, min_j = source.cell_jacobians(u)
    return Fields(
        polygons=polygons,
        displacement_ni=source.output_displacements(u),
        jacobian_c=mean_j,
        min_jacobian_c=min_j,
        energy_density_c=source.cell_energies(u) / source.cell_areas(),
    )


def gather_fields(source: FieldSource, u: Any, media: Sequence[str] | None = None) -> Fields | None:
    """Fields of all cells on rank 0, None elsewhere."""
    mine = fields_of(source, u, polygons_of(source, media))
    parts = [mine] if source.comm.size == 1 else source.comm.gather(mine)
    return Fields.merge(parts) if parts else None


class SnapshotWriter:
    """Writes VTU files of selected load steps, a piece a rank, and the PVD collection that ParaView opens.

    Args:
        source: the discretisation.
        directory: run directory.
        loads: coordinates along the load path; the first converged step at or past each is written.
        units: of the problem.
        media: names of the regions of third medium.
    """

    def __init__(
        self, source: FieldSource, directory: Path, loads: tuple[float, ...], units: Units | None = None,
        media: Sequence[str] | None = None,
    ) -> None:  # fmt: skip
        self.source = source
        self.directory = directory
        self._pending = sorted(loads)
        self.entries: list[tuple[float, list[str]]] = []
        self._polygons = polygons_of(source, media)
        self._units = units or Units()
        self._writer = VtuWriter(self._polygons, self._units)

    def restore(self, entries: Sequence[Sequence[Any]]) -> None:
        """Go on after these load factors and files, which an interrupted run has written.

        After a power cut the latest of them may be missing or empty: those are left out of the collection.
        """
        comm, plain = self.source.comm, [(float(load), list(names)) for load, names in entries]
        reached = plain[-1][0] if plain else 0.0
        self._pending = [wanted for wanted in self._pending if wanted > reached + 1e-9]
        self.entries = comm.bcast(on_root(comm, lambda: [entry for entry in plain if self._is_there(entry[1])]))
        if plain:
            on_root(comm, lambda: write_pvd(self.directory / COLLECTION, self.entries))

    def _is_there(self, names: Sequence[str]) -> bool:
        files = [self.directory / name for name in names]
        pieces = [piece for file in files if file.suffix == ".pvtu" for piece in file.parent.glob(f"{file.stem}_*.vtu")]
        return all(file.is_file() and file.stat().st_size > 0 for file in (*files, *pieces))

    def offer(self, step: int, load: float, u: Any) -> None:
        """Write this step if one of the selected loads has been reached; called on all ranks."""
        if self._pending and load >= self._pending[0] - 1e-9:
            self.write(step, load, u)

    def write(self, step: int, load: float, u: Any) -> None:
        """Write this step unless it is there already; called on all ranks."""
        if self.entries and load <= self.entries[-1][0]:
            return
        self._pending = [wanted for wanted in self._pending if wanted > load + 1e-9]
        comm = self.source.comm
        here = self.directory / FIELDS
        whole = f"step_{step:05d}.{'vtu' if comm.size == 1 else 'pvtu'}"
        pieces = [f"step_{step:05d}_{rank}.vtu" for rank in range(comm.size)] if comm.size > 1 else [whole]
        fields = fields_of(self.source, u, self._polygons)
        on_every_rank(comm, lambda: self._writer.write(here / pieces[comm.rank], fields))
        filled = [name for name, n_cells in zip(pieces, comm.allgather(self._polygons.n_cells), strict=True) if n_cells]
        self.entries.append((load, [f"{FIELDS}/{whole}"]))
        on_root(comm, lambda: self._collect(here / whole, filled))

    def _collect(self, whole: Path, pieces: Sequence[str]) -> None:
        if self.source.comm.size > 1:
            write_pvtu(whole, pieces, self._units)
        write_pvd(self.directory / COLLECTION, self.entries)
