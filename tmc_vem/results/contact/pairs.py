"""Outlines that face each other across the medium, two by two, and what is said of the contact between them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.problems.contact_quantities import pair_name
from tmc_vem.results.contact.bump import Bump, vanishes
from tmc_vem.results.contact.facing import Facing, facing
from tmc_vem.results.contact.traction import Traction

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]
Also = Callable[[Bool], dict[str, float]]  # of some stations (n,)

CLOSED = 0.1  # contact is where the gap has shrunk to less than this part of what it was
LEVEL = 0.5  # of the largest pressure: what is above it makes the width
FADED = 0.1  # of the largest pressure: contact has ended where it is below
ROUNDING = 1e-9  # of positions, relative to the length of a contact


@dataclass(frozen=True)
class Pair:
    """Two outlines that face each other: of two bodies, or two parts of one body's.

    Attributes:
        bodies: numbers of the bodies; twice the same where a body faces itself.
        first_n, second_n: (n,) stations of the first and of the second one that face the other. Where a body faces
            itself, those of the first one come before what they face along its lines.
    """

    bodies: tuple[int, int]
    first_n: Bool
    second_n: Bool


def pairs_of(traction: Traction, seen: Facing) -> list[Pair]:
    """All pairs in a state, in the order of the bodies."""
    body, station = traction.surface.body_n, seen.station_n
    sees = station >= 0
    mine, other = body, np.where(sees, body[station], -1)
    first_of = (mine < other) | ((mine == other) & (np.arange(len(body)) < station))
    low, high = np.minimum(mine, other), np.maximum(mine, other)
    found = sorted(set(zip(low[sees].tolist(), high[sees].tolist(), strict=True)))
    between = {pair: sees & (low == pair[0]) & (high == pair[1]) for pair in found}
    return [Pair(pair, chosen & first_of, chosen & ~first_of) for pair, chosen in between.items()]


def measure(traction: Traction, also: Also | None = None) -> dict[str, dict[str, float]]:
    """What is reported of a state, by name of body and of pair: see
    ``OF_BODY`` of :mod:`tmc_vem.problems.contact_quantities` and ``OF_PAIR``.

    As long as the gap is open, widths are 0 and there is no centre. A half width is left out where the pressure is that
    of no round contact.

    Args:
        traction: of the state.
        also: what else there is to say about some stations: those of a body, or of the first one of a pair.
    """
    surface, seen = traction.surface, facing(traction)
    chosen = {name: surface.body_n == body for body, name in enumerate(surface.bodies)}
    found = {name: traction.resultant(mine) for name, mine in chosen.items()}
    for pair in pairs_of(traction, seen):
        name = pair_name(surface.bodies, pair.bodies, surface.joint)
        chosen[name], found[name] = pair.first_n, _measure(traction, seen, pair)
    return found if also is None else {name: values | also(chosen[name]) for name, values in found.items()}


def _measure(traction: Traction, seen: Facing, pair: Pair) -> dict[str, float]:
    both = pair.first_n | pair.second_n
    found = traction.resultant(pair.first_n)
    found["gap"] = float(seen.gap_n[both].min())
    found["pressure_max"] = float(traction.pressure_n[both].max())
    peak = int(np.flatnonzero(both)[traction.pressure_n[both].argmax()])
    reference = traction.surface.points_nx
    apart = float(np.hypot(*(reference[peak] - reference[seen.station_n[peak]])))
    if found["pressure_max"] <= 0.0 or not seen.gap_n[peak] < CLOSED * apart:
        return found | {"half_width": 0.0, "contact_length": 0.0}
    return found | _width(traction, pair)


def _width(traction: Traction, pair: Pair) -> dict[str, float]:
    """Width and centre of contact, from the pressures of both outlines along their common tangent."""
    runs = [_run(traction, chosen) for chosen in (pair.first_n, pair.second_n) if chosen.any()]
    stations, ends = (np.concatenate(part) for part in zip(*runs, strict=True))
    weight, pressure = traction.weight_n[stations], traction.pressure_n[stations]
    strength = weight * pressure
    outwards = np.where(pair.first_n[stations], 1.0, -1.0)[:, None]
    along = (strength[:, None] * outwards * traction.tangent_ni[stations]).sum(axis=0)
    along /= np.hypot(*along)
    middle = (strength @ traction.points_nx[stations]) / strength.sum()
    x, limits = ((traction.points_nx[some] - middle) @ along for some in (stations, ends))
    low, high = min(limits.min(), x.min()), max(limits.max(), x.max())
    bump = Bump.fit(x, pressure, weight, float(low), float(high))
    centre = 0.0 if bump is None else bump.centre
    rounding = ROUNDING * float(high - low)  # where a single station touches, all of x is rounding
    left, right = x <= centre + rounding, x >= centre - rounding
    first = -vanishes(-x[left], pressure[left], weight[left], -float(low))
    last = vanishes(x[right], pressure[right], weight[right], float(high))
    found = {"half_width": bump.half_width, "pressure_fit": bump.pressure} if bump is not None else {}
    centre = 0.5 * (first + last) if bump is None else centre
    centre_x, centre_y = (middle + centre * along).tolist()
    return found | {"contact_length": last - first, "centre_x": centre_x, "centre_y": centre_y}


def _run(traction: Traction, chosen: Bool) -> tuple[Int, Int]:
    """Stations around the largest pressure of some with more than half of it, as far as they follow each other; and to
    both sides the first one at which contact has ended, or the end of the line."""
    surface, pressure = traction.surface, traction.pressure_n
    peak = int(np.flatnonzero(chosen)[pressure[chosen].argmax()])
    line = np.flatnonzero(surface.line_n == surface.line_n[peak])
    here = peak - int(line[0])
    if surface.closed_l[surface.line_n[peak]]:  # from half way round before to half way round behind
        line, here = np.roll(line, len(line) // 2 - here), len(line) // 2
    run: list[Int] = [line[here : here + 1]]
    ends: list[int] = []
    for onwards in (line[here + 1 :], line[:here][::-1]):
        below = pressure[onwards] <= LEVEL * pressure[peak]
        run.append(onwards[: int(below.argmax()) if below.any() else len(onwards)])
        faded = onwards[pressure[onwards] < FADED * pressure[peak]]
        ends += [*faded[:1].tolist(), *onwards[-1:].tolist(), peak][:1]
    return np.concatenate(run), np.array(ends)
