"""Derivatives by the values that numbers have in each cell: as fields of all cells, as a VTU file and as a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tmc_vem.problems.base import media_of
from tmc_vem.report.sensitivity_figure import Panel, sensitivity_figure
from tmc_vem.results.output import gather_fields
from tmc_vem.results.vtu import VtuWriter
from tmc_vem.sensitivity.at_end import Sensitivities
from tmc_vem.sensitivity.changes import require_cells
from tmc_vem.sensitivity.units import OF_KIND, of_number, of_result
from tmc_vem.support.errors import InputError
from tmc_vem.support.parallel import on_root
from tmc_vem.support.units import AREA, Units
from tmc_vem.system.fields import Fields

Float = NDArray[np.float64]

PER_AREA = " per area"
SUFFIX, PICTURE = ".vtu", ".png"


@dataclass(frozen=True)
class CellSensitivities:
    """Derivatives of results by numbers, cell by cell, on rank 0.

    Attributes:
        fields: of the state, with cell fields ``d(gap)/d(E)``: derivatives by the value in the cell alone, whose sum is
            the derivative by the number; and the same per area of the cell, which does not depend on the mesh.
        panels: what a picture shows of each.
        units: of the problem.
        words: units of the cell fields by name, ``1`` where there is none or it is not known.
    """

    fields: Fields
    panels: Sequence[Panel]
    units: Units
    words: Mapping[str, str]

    def write(self, path: Path) -> tuple[Path, Path]:
        """Write a VTU file, and a picture of the same name beside it; their paths.

        Raises:
            InputError: the place cannot be written.
        """
        picture = path.with_suffix(PICTURE)
        try:
            VtuWriter(self.fields.polygons, self.units, self.words).write(path, self.fields)
            sensitivity_figure(self.fields, self.panels, self.units).savefig(picture, dpi=150)
        except OSError as error:
            raise InputError(f"{error.filename or path} cannot be written: {error.strerror or error}") from None
        return path, picture


def per_cell(found: Sensitivities, of: Sequence[str], by: Sequence[str]) -> CellSensitivities | None:
    """Derivatives of each result by each number in every cell, those of loads left out; on rank 0, None elsewhere.

    Raises:
        InputError: there is no such result or number, no derivative, or all numbers are those of loads and supports.
    """
    gradients, problem = found.gradients, found.problem
    system, u = gradients.equilibrium.system, gradients.equilibrium.state.u
    changes = {change.name: change for change in require_cells([gradients.by(name) for name in by])}
    mine = {(a, b): gradients.by_own_cells(a, change) for b, change in changes.items() for a in of}
    parts = system.comm.gather((system.cell_areas(), mine))
    fields = gather_fields(system, u, media_of(problem))
    if fields is None or parts is None:
        return None
    area_c = np.concatenate([area for area, _ in parts])
    short, units = short_names(list(changes)), problem.units()
    region_names = np.array(fields.polygons.region_names)[fields.polygons.region_c]
    cell_fields: dict[str, Float] = {}
    words: dict[str, str] = {}
    panels: list[Panel] = []
    for a in of:
        for b in changes:
            name, value_c = f"d({a})/d({short[b]})", np.concatenate([values[a, b] for _, values in parts])
            of_value, of_change = of_result(a, problem), of_number(b, problem)
            unit = of_value.over(of_change) if of_value and of_change and units.declared else None
            per_area = unit.over(OF_KIND[AREA]).text(units) if unit else ""
            cell_fields |= {name: value_c, name + PER_AREA: value_c / area_c}
            words |= {name: (unit.text(units) if unit else "") or "1", name + PER_AREA: per_area or "1"}
            panels.append(
                Panel(name, value_c / area_c, np.isin(region_names, list(changes[b].parameters)), per_area)
            )  # fmt: skip
    return CellSensitivities(replace(fields, cell_fields=cell_fields), panels, units, words)


def write_per_cell(
    found: Sensitivities, of: Sequence[str], by: Sequence[str], path: Path
) -> tuple[Path, Path] | None:  # fmt: skip
    """Write what :func:`per_cell` gives; paths of the VTU file and the picture on rank 0.

    Raises:
        InputError: see :func:`per_cell`; or the place cannot be written.
    """
    cells = per_cell(found, of, by)
    comm = found.gradients.equilibrium.system.comm
    return on_root(comm, lambda: cells.write(path) if cells else (path, path))


def short_names(names: Sequence[str]) -> dict[str, str]:
    """The last parts of names, as many of them as tell the names apart."""
    parts = {name: name.split(".") for name in names}
    short = {}
    for name in names:
        ends = {n: ".".join(parts[name][-n:]) for n in range(1, len(parts[name]) + 1)}
        own = [n for n, end in ends.items() if not any(_ends_so(parts[other], end) for other in names if other != name)]
        short[name] = ends[own[0]] if own else name
    return short


def _ends_so(parts: Sequence[str], end: str) -> bool:
    return ".".join(parts).endswith(f".{end}") or ".".join(parts) == end
