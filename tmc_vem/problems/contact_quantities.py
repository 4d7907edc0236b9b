"""What is reported of contact: forces of the medium on bodies, and contact of outlines that face each other."""

from __future__ import annotations

import itertools
import sys
from collections.abc import Mapping, Sequence

from tmc_vem.support.units import ENERGY, FORCE, LENGTH, NONE, STRESS

# Quantities with their kind; of a pair, the force is that on the first body.
OF_BODY: Mapping[str, str] = {"force": FORCE, "force_x": FORCE, "force_y": FORCE, "moment": ENERGY}
OF_PAIR: Mapping[str, str] = {
    **OF_BODY,
    "gap": LENGTH,
    "pressure_max": STRESS,
    "pressure_fit": STRESS,
    "half_width": LENGTH,
    "contact_length": LENGTH,
    "centre_x": LENGTH,
    "centre_y": LENGTH,
}
# What bodies and pairs have besides where the medium has friction.
OF_FRICTION: Mapping[str, str] = {
    "friction": FORCE,
    "friction_x": FORCE,
    "friction_y": FORCE,
    "apparent_coefficient": NONE,
    "friction_coefficient": NONE,
    "sticking": NONE,
    "slip_max": LENGTH,
}
FORCES_OF_FRICTION = ("friction", "friction_x", "friction_y")
JOINTS, FIRST_SIGN = ("-", "--"), 0x2013  # an en dash, and all signs from there on
# what bodies that do not face each other have no value of, not even 0
UNKNOWN_APART = (
    "gap",
    "pressure_fit",
    "centre_x",
    "centre_y",
    "apparent_coefficient",
    "friction_coefficient",
    "sticking",
)
SHOWN_OF_BODY, SHOWN_OF_PAIR = ("force",), ("force", "pressure_max", "half_width")
SHOWN_OF_FRICTION = ("friction", "apparent_coefficient")


def pair_name(bodies: Sequence[str], pair: tuple[int, int], joint: str) -> str:
    """Name of a pair of outlines: those of its bodies, with a joint between."""
    return joint.join(bodies[body] for body in pair)


def joint_of(bodies: Sequence[str]) -> str:
    """What stands between the names of a pair: a hyphen, or else what makes the names of all bodies and pairs differ;
    with bodies ``a``, ``b`` and ``a-b``, two hyphens. A sign that is in no name always does."""
    signs = map(chr, range(FIRST_SIGN, sys.maxunicode))
    return next(each for each in itertools.chain(JOINTS, signs) if _differ(bodies, each))


def _differ(bodies: Sequence[str], joint: str) -> bool:
    pairs = itertools.combinations_with_replacement(range(len(bodies)), 2)
    names = [*bodies, *(pair_name(bodies, pair, joint) for pair in pairs)]
    return len(set(names)) == len(names)


def is_pair(values: Mapping[str, float]) -> bool:
    """Whether quantities are those of a pair."""
    return "pressure_max" in values


def quantities_of(values: Mapping[str, float]) -> Mapping[str, str]:
    """All quantities of a body or pair with their kinds, from those that it has in a state."""
    more = OF_FRICTION if "friction" in values else {}
    return {**(OF_PAIR if is_pair(values) else OF_BODY), **more}


def shown(contact: Mapping[str, Mapping[str, float]]) -> dict[tuple[str, str], float]:
    """What is said of contact that is not in the files alone, by name of body or pair, and quantity.

    The force on the only body is left out if it faces itself: it is none but for what holds the medium. Friction of
    bodies is, where pairs have it.
    """
    pairs = [name for name, values in contact.items() if is_pair(values)]
    alone = len(contact) - len(pairs) == 1 and bool(pairs)
    of_pair, of_body = (*SHOWN_OF_PAIR, *SHOWN_OF_FRICTION), (*SHOWN_OF_BODY, *(() if pairs else SHOWN_OF_FRICTION))
    return {
        (name, quantity): values[quantity]
        for name, values in contact.items()
        for quantity in (of_pair if name in pairs else () if alone else of_body)
        if quantity in values
    }
