"""Pictures of friction: where contact sticks and slips, shear under its bound, and slip along the outlines."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.report.contact_sides import SEEN, Side, around, axis_name, draw_solids, figure_of, runs_of
from tmc_vem.report.labels import label
from tmc_vem.report.plots import COLOURS
from tmc_vem.results.contact.curves import ContactCurves, FrictionCurves
from tmc_vem.results.records import heading
from tmc_vem.support.units import LENGTH, STRESS, Units
from tmc_vem.system.fields import Fields

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]

STICK, SLIP = "#0b5394", "#c55a11"  # colours of zones
HALF = 0.5  # of the bound beside a station: what sticks more is drawn as sticking
MARGIN = 0.25  # around contact, of its extent
WIDTH, INWARDS = 3.5, 0.006  # of lines of zones in points; how far they are in the solid, of the picture's extent
HEIGHT = 3.6  # inches


def zones(curves: ContactCurves, fields: Fields | None, sides: list[Side], units: Units) -> Any:
    """Contact from near: outlines that stick in one colour, those that slip in another."""
    from matplotlib.collections import LineCollection

    near = curves.point_nx[np.concatenate([side.stations for side in sides])]
    low, high = around(near, MARGIN)
    figure, (axes,) = figure_of(1, HEIGHT)
    draw_solids(axes, curves, fields)
    pieces, sticks = _segments(curves, INWARDS * float(np.max(high - low)))
    for chosen, colour, name in ((sticks, STICK, "sticks"), (~sticks, SLIP, "slips")):
        axes.add_collection(LineCollection(pieces[chosen], colors=colour, linewidths=WIDTH, label=name))
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    axes.set_xlabel(axis_name("x", units))
    axes.set_ylabel(axis_name("y", units))
    axes.legend(fontsize=8, frameon=False, loc="upper left", bbox_to_anchor=(1.01, 1.0))
    return figure


def shear_and_slip(curves: ContactCurves, sides: list[Side], units: Units) -> Any:
    """Shear of friction along every outline with its bound, full marks where it sticks, and the slip."""
    friction = _friction(curves)
    figure, axes = figure_of(2, HEIGHT)
    for n, side in enumerate(sides):
        stations, colour = side.stations, COLOURS[n % len(COLOURS)]
        middle = _middle(curves, stations)
        for number, run in enumerate(runs_of(curves, stations)):
            x = curves.deformed_arc_length_n[run] - middle
            name = label(side.name) if not number else None
            axes[0].plot(x, friction.shear_n[run], color=colour, linewidth=1.3, label=name)
            for sign in (1.0, -1.0):
                axes[0].plot(x, sign * friction.bound_n[run], color=colour, linewidth=0.8, linestyle=":")
            sticks = friction.sticking_n[run] > HALF
            for chosen, style in ((sticks, "full"), (~sticks, "none")):
                y = friction.shear_n[run][chosen]
                axes[0].plot(x[chosen], y, "o", color=colour, markersize=3.5, fillstyle=style)
            axes[1].plot(x, friction.slip_n[run], color=colour, linewidth=1.3, marker=".", markersize=3.5)
    for one, what, kind in zip(axes, ("shear of friction", "slip"), (STRESS, LENGTH), strict=True):
        one.set_xlabel(axis_name("length along the outline, from the middle", units))
        one.set_ylabel(label(heading(what, units.of(kind) if units.declared else "")))
        one.grid(True, linewidth=0.4, color="0.88")
    axes[0].legend(fontsize=8, frameon=False)
    return figure


def rubbing_sides(curves: ContactCurves) -> list[Side]:
    """Outlines in contact with friction, by body and what it faces; a body that faces none is on ground."""
    touches, found = _rubs(curves), []
    for body, name in enumerate(curves.bodies):
        mine = touches & (curves.body_n == body)
        faced = sorted({*curves.faces_n[mine].tolist()} - {-1}) or [-1]
        for other in faced if mine.any() else ():
            what = "the ground" if other < 0 else "itself" if other == body else curves.bodies[other]
            found.append(Side(f"on {name}, from {what}", np.flatnonzero(mine & (curves.faces_n == other))))
    return found


def _friction(curves: ContactCurves) -> FrictionCurves:
    assert curves.friction is not None  # asked for with friction only
    return curves.friction


def _rubs(curves: ContactCurves) -> Bool:
    """(n_stations,) where there is enough friction to be seen."""
    bound = _friction(curves).bound_n
    rubs: Bool = bound > SEEN * bound.max(initial=0.0)
    return rubs


def _middle(curves: ContactCurves, stations: Int) -> float:
    """Length along the outline to the middle of some stations."""
    arc, weight = curves.deformed_arc_length_n[stations], curves.deformed_weight_n[stations]
    return float(arc @ weight) / float(weight.sum())


def _segments(curves: ContactCurves, inwards: float) -> tuple[Float, Bool]:
    """Ends (m, 2, 2) of the pieces between stations in contact, moved into their solid, and whether they stick."""
    sticking = np.where(_rubs(curves), _friction(curves).sticking_n, np.nan)
    ends = np.concatenate([np.column_stack([line[:-1], line[1:]]) for line in curves.lines(closing=True)])
    ends = ends[np.isfinite(sticking[ends]).all(axis=1)]
    return (curves.point_nx - inwards * curves.normal_nx)[ends], sticking[ends].mean(axis=1) > HALF
