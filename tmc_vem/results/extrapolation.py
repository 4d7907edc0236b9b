"""The limit of a value for gamma to 0 from its values at some gammas, with a calibrated uncertainty.

A layer of thickness g0 that is squeezed to l g0, l << 1, has the pressure 2/3 gamma mu l^(-5/3). So what is left
of a gap under a given pressure, and with it every error of a contact, shrinks like gamma^(3/5) (docs/howto/limit.md):

    v(gamma) = v0 + a gamma^q,    v0 = v_b - (v_a - v_b) / (r^q - 1),    r = gamma_a / gamma_b,

with q = 3/5 where contact is established. It is 1 where nothing touches, about 3/8 where contact just begins, and up to
6/7 where the contact is a point: a fixed 3/5 is off by half a percent shortly after first contact. So q is measured,
from the last three values, and what else it may be makes the uncertainty: it still moves from one value of gamma to the
next, it rises after a first contact, and meshes let it scatter. With the numbers below the limit of box, C-box and
Hertz contact is within the uncertainty in more than nine of ten cases (benchmarks/gamma_limit.py).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]

EXPONENT = 0.6
PER_DECADE = 2  # values of gamma in each decade
NEEDED = 5  # values, the last of which are looked at
# How far the exponent may be from the one that was measured last: by scatter, and by what it has moved since the one
# before, times the half decades for which that may go on.
SCATTER, DRIFT = 0.06, 2.0
# Below this exponent contact begins: it rises from there, the farther below the more.
BEGINNING, RISE = 0.57, 2.5
LOWEST, HIGHEST = 0.3, 1.25  # exponents that occur
STRANGE = (0.2, 1.4)  # beyond these, values follow no power of gamma
# Changes below this part of the value are the solver's tolerance.
UNCHANGED = 1e-8
# Values that turn: their limit is known to this many of the last changes, and only if these are this part of it.
TURNING, SMALL = 3.0, 1e-3
VAGUE = 0.2  # uncertainty over the whole change with gamma from which on a limit is not given


@dataclass(frozen=True)
class Estimate:
    """A limit, or why there is none.

    Attributes:
        value: for gamma to 0; None if it is withheld.
        uncertainty: half the width of the interval around it in which the limit is expected.
        ratio: of the last two changes over a decade of gamma; 10^0.6 in an established contact. None without changes.
        reason: why the value is withheld; None if it is not.
    """

    value: float | None
    uncertainty: float | None
    ratio: float | None
    reason: str | None = None


def withheld(reason: str, ratio: float | None = None) -> Estimate:
    """No limit, and why."""
    return Estimate(None, None, ratio, reason)


def estimate(values: Sequence[float]) -> Estimate:
    """The limit of values at gammas that fall by equal factors, ``PER_DECADE`` a decade, from large to small.

    Args:
        values: five or more; the last five count.
    """
    v = np.array(values[-NEEDED:], dtype=float)
    if len(v) < NEEDED:
        return withheld(f"{len(v)} values of gamma, {NEEDED} are needed")
    if not np.isfinite(v).all():
        return withheld("it is not a number at every gamma")
    ratio = ratio_of(v)
    changes = v[:-1] - v[1:]
    if np.abs(changes).max() <= UNCHANGED * np.abs(v).max():
        return Estimate(float(v[-1]), UNCHANGED * float(np.abs(v).max()), None)
    exponents = local_exponents(changes)
    if exponents is None:
        return _turning(v, changes, ratio)
    low, high = _range_of(exponents)
    first, value, last = (float(v[-1] - changes[-1] * _rest(q)) for q in (low, 0.5 * (low + high), high))
    uncertainty = max(abs(value - first), abs(value - last), UNCHANGED * float(np.abs(v).max()))
    if uncertainty > VAGUE * abs(v[0] - value):
        return withheld("contact begins at this load: how its value goes on with gamma is too uncertain", ratio)
    return Estimate(value, uncertainty, ratio)


def ratio_of(values: Sequence[float] | Float) -> float | None:
    """Ratio of the last two changes over a decade; None where the last one is none."""
    a, b, c = (float(values[n]) for n in (-1 - 2 * PER_DECADE, -1 - PER_DECADE, -1))
    return (a - b) / (b - c) if b != c else None


def local_exponents(changes: Float) -> Float | None:
    """Exponents of gamma from each two changes that follow each other; None if some are of no power law."""
    if (changes == 0.0).any() or (changes[:-1] * changes[1:] <= 0.0).any():
        return None
    exponents: Float = float(PER_DECADE) * np.log10(changes[:-1] / changes[1:])
    low, high = STRANGE
    return exponents if low <= exponents[-1] <= high and low <= exponents[-2] <= high else None


def _range_of(exponents: Float) -> tuple[float, float]:
    """Exponents between which the one of all that is still to come lies."""
    last, drift = float(exponents[-1]), float(exponents[-1] - exponents[-2])
    low = last - SCATTER + DRIFT * min(drift, 0.0)
    high = last + SCATTER + DRIFT * max(drift, 0.0) + RISE * max(BEGINNING - last, 0.0)
    return (min(max(low, LOWEST), HIGHEST - SCATTER), max(min(high, HIGHEST), LOWEST + SCATTER))


def _rest(exponent: float) -> float:
    """What is still to come with smaller gamma, in units of the last change."""
    return 1.0 / (math.pow(10.0, exponent / PER_DECADE) - 1.0)


def _turning(v: Float, changes: Float, ratio: float | None) -> Estimate:
    """The limit of values that go up and down: the last one, if they hardly change any more."""
    last = float(np.abs(changes[-2:]).max())
    if last > SMALL * float(np.abs(v).max()):
        return withheld("it follows no power of gamma", ratio)
    return Estimate(float(v[-1] - changes[-1]), TURNING * last, ratio)
