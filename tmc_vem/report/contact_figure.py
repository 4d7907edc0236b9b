"""Pictures of contact: tractions on the deformed solids, and pressure along their outlines."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.report.contact_sides import WIDEST, Side, around, axis_name, draw_solids, figure_of, runs_of, sides_of
from tmc_vem.report.friction_figure import rubbing_sides, shear_and_slip, zones
from tmc_vem.report.labels import label
from tmc_vem.report.page import Picture, picture
from tmc_vem.report.plots import COLOURS
from tmc_vem.results.contact.curves import ContactCurves
from tmc_vem.results.contact_files import curves_at
from tmc_vem.results.records import heading
from tmc_vem.results.run_result import RunResult
from tmc_vem.results.snapshots import nearest, read_fields, record_of, snapshots
from tmc_vem.support.errors import InputError
from tmc_vem.support.units import STRESS, Units
from tmc_vem.system.fields import Fields

Float = NDArray[np.float64]

TALLEST = 0.24  # of the picture's smaller extent: the largest pressure
MARGIN = 0.6  # around contact, of its extent
MOST_ARROWS = 40  # of one outline
TALL = (3.0, 5.5)  # inches: height of a picture


def contact_of(result: RunResult, load: float | None = None) -> list[Picture]:
    """Pictures of the last state of a run, or of the snapshot nearest to a load factor; none where nothing presses.

    Args:
        result: the run, in a directory.
        load: factor, or coordinate on the load path; None for the last state.

    Raises:
        InputError: the run has no tractions.
    """
    curves, last = curves_at(result, load), result.history[-1]
    try:
        found = nearest(snapshots(result), last.coordinate if load is None else load)
        fields = read_fields(result, found) if load is not None or found.load == last.coordinate else None
        at = record_of(result, found) if load is not None else last
    except InputError:
        fields, at = None, last
    return contact_pictures(
        curves, fields, Units(**result.inputs.get("units", {})), f"at displacement {at.displacement:.4g}"
    )


def contact_pictures(curves: ContactCurves, fields: Fields | None, units: Units, state: str) -> list[Picture]:
    """Tractions on the deformed solids and pressure along the outlines, with friction also what sticks, shear and slip;
    none where nothing presses.

    Args:
        curves: the tractions.
        fields: the same state, whose solids are drawn; None for outlines alone.
        units: of the problem.
        state: what the state is called in captions.
    """
    sides, rubbing = list(sides_of(curves)), [] if curves.friction is None else rubbing_sides(curves)
    friction = []
    if rubbing:
        where = "Where contact sticks and where it slips,"
        under = "Shear of friction, the largest one dotted, and slip along the deformed outlines, full where it sticks,"
        friction = [
            picture(zones(curves, fields, rubbing, units), "contact-zones", f"{where} {state}."),
            picture(shear_and_slip(curves, rubbing, units), "contact-friction", f"{under} {state}."),
        ]
    if not sides:
        return friction
    arrows = "Tractions of the medium on the deformed solids, and their pressure as curves,"
    along = "True pressure and shear along the deformed outlines,"
    return [
        picture(_tractions(curves, fields, sides, units), "contact-tractions", f"{arrows} {state}."),
        picture(_pressures(curves, sides, units), "contact-pressure", f"{along} {state}."),
        *friction,
    ]


def _tractions(curves: ContactCurves, fields: Fields | None, sides: list[Side], units: Units) -> Any:
    """All of the solids, and contact from near."""
    points = _solid_points(curves, fields)
    near = curves.point_nx[np.concatenate([side.stations for side in sides])]
    extents = [around(points, 0.08), around(near, MARGIN)]
    shapes = [float(high[0] - low[0]) / float(high[1] - low[1]) for low, high in extents]
    tall = float(np.clip((WIDEST - 1.5) / sum(shapes), *TALL))
    figure, axes = figure_of(2, tall, [max(shape, 0.4) for shape in shapes])
    stress = units.of(STRESS) if units.declared else ""
    for one, (low, high) in zip(axes, extents, strict=True):
        draw_solids(one, curves, fields)
        scale = TALLEST * float(np.min(high - low)) / float(curves.pressure_n.max())
        for n, side in enumerate(sides):
            _draw_tractions(one, curves, side, scale, COLOURS[n % len(COLOURS)])
        one.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        one.set_xlabel(axis_name("x", units))
    axes[0].set_ylabel(axis_name("y", units))
    axes[1].set_title(label(f"largest pressure {curves.pressure_n.max():.4g} {stress}".rstrip()), fontsize=9)
    axes[0].set_title("deformed solids", fontsize=9)
    handles, names = axes[0].get_legend_handles_labels()
    figure.get_layout_engine().set(rect=(0.0, 0.28 / tall, 1.0, 1.0 - 0.28 / tall))
    figure.legend(handles, names, loc="lower center", ncols=min(len(sides), 4), fontsize=8, frameon=False)
    return figure


def _draw_tractions(axes: Any, curves: ContactCurves, side: Side, scale: float, colour: str) -> None:
    """Arrows of the traction that end on the solid, and the pressure as a curve over it."""
    from matplotlib.collections import PolyCollection

    bands = []
    for run in runs_of(curves, side.stations):
        foot = curves.point_nx[run]
        top = foot + scale * curves.pressure_n[run, None] * curves.normal_nx[run]
        bands.append(np.concatenate([foot, top[::-1]]))
        axes.plot(*top.T, color=colour, linewidth=1.2)
    axes.add_collection(PolyCollection(bands, facecolors=colour, alpha=0.18, linewidths=0.0, label=label(side.name)))
    every = max(1, -(-len(side.stations) // MOST_ARROWS))
    some = side.stations[::every]
    true = curves.force_ni[some] / curves.deformed_weight_n[some, None]
    axes.quiver(
        *(curves.point_nx[some] - scale * true).T, *(scale * true).T, color=colour, angles="xy", scale_units="xy",
        scale=1.0, width=0.0025, headwidth=4.0, headlength=5.0,
    )  # fmt: skip


def _pressures(curves: ContactCurves, sides: list[Side], units: Units) -> Any:
    """Pressure and shear of every outline, counted from the middle of its pressure."""
    figure, axes = figure_of(2, 3.4)
    for n, side in enumerate(sides):
        stations = side.stations
        strength = curves.pressure_n[stations] * curves.deformed_weight_n[stations]
        style = {"color": COLOURS[n % len(COLOURS)], "linewidth": 1.3, "marker": ".", "markersize": 3.5}
        for number, run in enumerate(runs_of(curves, stations)):
            arc = curves.deformed_arc_length_n
            mine = np.isin(stations, run)
            middle = float(strength[mine] @ arc[stations[mine]]) / float(strength[mine].sum())
            name = label(side.name) if not number else None
            axes[0].plot(arc[run] - middle, curves.pressure_n[run], label=name, **style)
            axes[1].plot(arc[run] - middle, curves.shear_n[run], **style)
    for one, what in zip(axes, ("pressure", "shear"), strict=True):
        one.set_xlabel(axis_name("length along the outline, from the middle of its pressure", units))
        one.set_ylabel(label(heading(what, units.of(STRESS) if units.declared else "")))
        one.grid(True, linewidth=0.4, color="0.88")
    axes[0].set_ylim(bottom=0.0)
    axes[0].legend(fontsize=8, frameon=False)
    return figure


def _solid_points(curves: ContactCurves, fields: Fields | None) -> Float:
    if fields is None:
        return curves.point_nx
    polygons = fields.polygons
    of_solid = np.repeat(polygons.is_solid_c, np.diff(polygons.offsets))
    used = np.unique(polygons.connectivity[of_solid])
    points: Float = (polygons.points_nx + fields.displacement_ni)[used]
    return points
