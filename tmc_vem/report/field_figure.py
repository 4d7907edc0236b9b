"""A picture of one field on the deformed body, with units on axes, title and colours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.report.figures import border_lines
from tmc_vem.report.labels import label
from tmc_vem.results.run_result import RunResult
from tmc_vem.results.snapshots import nearest, read_fields, record_of, snapshots
from tmc_vem.support.errors import InputError
from tmc_vem.support.units import LENGTH, NONE, STRESS, Units
from tmc_vem.support.validation import require_finite
from tmc_vem.system.fields import Fields
from tmc_vem.system.tensors import SCALARS, values_of

Float = NDArray[np.float64]
WIDTH, LEAST, MOST = 9.0, 2.6, 8.0  # inches: the figure, and how high it may be
UNKNOWN = "0.85"  # grey of what has no value
ALWAYS = {
    "ux": ("displacement in x", LENGTH),
    "uy": ("displacement in y", LENGTH),
    "J": ("J, mean of the cell", NONE),
    "min_J": ("smallest J of the cell", NONE),
    "energy_density": ("energy density", STRESS),
}


@dataclass(frozen=True)
class Shown:
    """What a picture shows.

    Attributes:
        field: its name; the load's displacement component by default.
        load: load factor, or coordinate on the load path; the nearest state that was written is shown.
        medium: whether the third medium is coloured as well.
        span: smallest and largest value of the colours; those of what is coloured by default.
    """

    field: str | None = None
    load: float = np.inf
    medium: bool = False
    span: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        for end in self.span or ():
            require_finite("range", end)
        if self.span is not None and not self.span[0] < self.span[1]:
            raise InputError(f"range = {self.span[0]:g} {self.span[1]:g}: give the smaller number first")


def available(fields: Fields) -> list[str]:
    """Names of the fields that can be drawn of what files hold."""
    there = {*fields.point_fields, *fields.cell_fields}
    return [*ALWAYS, *(name for name, of in SCALARS.items() if name not in ALWAYS and {name, of.of} & there)]


def points_or_cells(fields: Fields, name: str) -> tuple[Float | None, Float | None]:
    """Values of a field at all points of the polygons, or of the cells where files hold no others.

    Raises:
        InputError: the files do not have it.
    """
    if name in ("ux", "uy"):
        return fields.displacement_ni[:, "xy".index(name[1])], None
    own = {"J": fields.jacobian_c, "min_J": fields.min_jacobian_c, "energy_density": fields.energy_density_c}
    if name in own:
        return None, own[name]
    if name not in SCALARS:
        raise InputError(f"unknown field '{name}': the files hold {', '.join(available(fields))}")
    for of, is_of_points in ((fields.point_fields, True), (fields.cell_fields, False)):
        if name in of or SCALARS[name].of in of:
            values = of[name] if name in of else values_of(name, of)
            return (values, None) if is_of_points else (None, values)
    raise InputError(
        f"the files hold no {name}: they have {', '.join(available(fields))}; run again with --fields {name}"
    )


def component_of_load(result: RunResult) -> str:
    """``ux`` or ``uy``: the displacement component that the load prescribes; that in which more moves otherwise."""
    load = result.inputs.get("load")
    for name in ("ux", "uy"):
        if isinstance(load, dict) and (load.get(name) or load.get("component") == name):
            return name
    return "ux" if "ux" in result.inputs and "uy" not in result.inputs else "uy"


def field_figure(result: RunResult, shown: Shown) -> tuple[Any, str]:
    """A figure, and the name of the field in it.

    Raises:
        InputError: the run has no fields, or not this one.
    """
    snapshot = nearest(snapshots(result), shown.load if np.isfinite(shown.load) else result.history[-1].coordinate)
    fields, name = read_fields(result, snapshot), shown.field or component_of_load(result)
    units = Units(**result.inputs.get("units", {}))
    what, kind = ALWAYS[name] if name in ALWAYS else _known(fields, name)
    record = record_of(result, snapshot)
    moved = units.of(LENGTH) if units.declared else ""
    title = (
        f"{what[0].upper()}{what[1:]}, load factor {record.load:.4g}, displacement {record.displacement:.4g} {moved}"
    )
    coloured = fields.polygons.is_solid_c | shown.medium
    return _draw(
        fields, points_or_cells(fields, name), coloured, label(title.rstrip()), shown, units, (what, kind)
    ), name


def _known(fields: Fields, name: str) -> tuple[str, str]:
    points_or_cells(fields, name)  # says which there are
    return SCALARS[name].what, SCALARS[name].kind


def _draw(
    fields: Fields, values: tuple[Float | None, Float | None], coloured: NDArray[np.bool_], title: str, shown: Shown,
    units: Units, quantity: tuple[str, str],
) -> Any:  # fmt: skip
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    polygons = fields.polygons
    points = polygons.points_nx + fields.displacement_ni
    extent = np.ptp(points, axis=0)
    height = float(np.clip(0.75 * WIDTH * extent[1] / max(float(extent[0]), 1e-300), LEAST, MOST)) + 1.0
    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    at_points, at_cells = values
    corners_k = np.repeat(coloured, np.diff(polygons.offsets))
    seen = at_cells[coloured] if at_cells is not None else np.asarray(at_points)[polygons.connectivity[corners_k]]
    seen = seen[np.isfinite(seen)]
    low, high = shown.span or ((float(seen.min()), float(seen.max())) if len(seen) else (0.0, 1.0))
    if not high - low > 1e-12 * max(abs(low), abs(high)):
        low, high = low - 0.5 * (abs(low) or 1.0), high + 0.5 * (abs(high) or 1.0)
    scale = Normalize(low, high)
    loops = [points[polygons.cell(c)] for c in range(polygons.n_cells)]
    pale = [loops[c] for c in np.flatnonzero(~coloured)]
    axes.add_collection(PolyCollection(pale, facecolors="0.96", edgecolors="0.85", linewidths=0.2, rasterized=True))
    chosen = np.flatnonzero(coloured)
    if at_cells is not None:
        style: dict[str, Any] = {"array": at_cells[chosen], "cmap": _colours(), "norm": scale}
        axes.add_collection(PolyCollection([loops[c] for c in chosen], edgecolors="face", linewidths=0.2, **style))
    else:
        _shade(axes, fields, points, np.asarray(at_points), coloured, scale)
    lines = border_lines(polygons.offsets, polygons.connectivity, polygons.is_solid_c, points)
    axes.add_collection(LineCollection(lines, colors="black", linewidths=0.8, capstyle="round"))
    margin = 0.03 * extent.max()
    axes.set_xlim(points[:, 0].min() - margin, points[:, 0].max() + margin)
    axes.set_ylim(points[:, 1].min() - margin, points[:, 1].max() + margin)
    axes.set_aspect("equal")
    axes.set_xlabel(_with_unit("x, deformed", units, LENGTH))
    axes.set_ylabel(_with_unit("y, deformed", units, LENGTH))
    axes.set_title(title, fontsize=10)
    below, above = bool(len(seen) and seen.min() < low), bool(len(seen) and seen.max() > high)
    extend = "both" if below and above else "min" if below else "max" if above else "neither"
    bar = figure.colorbar(ScalarMappable(norm=scale, cmap=_colours()), ax=axes, extend=extend, shrink=0.9, pad=0.02)
    bar.set_label(_with_unit(quantity[0], units, quantity[1]))
    if not len(seen):
        axes.text(0.5, 0.5, "no value: the energy does not use F[2][2]", transform=axes.transAxes, ha="center")
    return figure


def _with_unit(what: str, units: Units, kind: str) -> str:
    return what if kind == NONE else f"{what} [{units.of(kind)}]"


def _colours() -> Any:
    from matplotlib import colormaps

    return colormaps["viridis"].with_extremes(bad=UNKNOWN)


def _shade(axes: Any, fields: Fields, points: Float, at_points: Float, coloured: NDArray[np.bool_], scale: Any) -> None:
    """Colours linear between the points of cells and a mean in their middle."""
    polygons = fields.polygons
    sizes = np.diff(polygons.offsets)
    cell = np.repeat(np.arange(polygons.n_cells), sizes)
    following = np.arange(len(cell)) + 1
    following[polygons.offsets[1:] - 1] = polygons.offsets[:-1]
    first, second = polygons.connectivity, polygons.connectivity[following]
    middle = np.add.reduceat(np.column_stack([points, at_points])[first], polygons.offsets[:-1]) / sizes[:, None]
    all_points, values = np.vstack([points, middle[:, :2]]), np.concatenate([at_points, middle[:, 2]])
    triangles = np.column_stack([first, second, len(points) + cell])
    known = np.isfinite(values[triangles]).all(axis=1) & coloured[cell]
    if known.any():
        used = np.where(np.isfinite(values), values, 0.0)
        axes.tripcolor(
            *all_points.T, triangles[known], used, shading="gouraud", cmap=_colours(), norm=scale, rasterized=True
        )
