"""Units of results, of numbers of a problem, and of derivatives of the one by the other, where they are known."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from tmc_vem.problems.base import Problem
from tmc_vem.problems.columns import KINDS, named_loads, pair_of
from tmc_vem.problems.contact_quantities import OF_BODY
from tmc_vem.problems.field_probes import kind_of_field
from tmc_vem.results.records import CONTACT, OF
from tmc_vem.sensitivity.functionals import COMPLIANCE, ENERGY, P_NORM
from tmc_vem.support.assignments import keys
from tmc_vem.support.units import ANGLE, AREA, FORCE, LENGTH, NONE, STRESS, VOLUME, Units
from tmc_vem.support.units import ENERGY as WORK


class Dimension(NamedTuple):
    """Powers of force, length and degrees."""

    force: int = 0
    length: int = 0
    degrees: int = 0

    def over(self, other: Dimension) -> Dimension:
        """That of a quotient."""
        return Dimension(*(a - b for a, b in zip(self, other, strict=True)))

    def text(self, units: Units) -> str:
        """The unit in words, ``mm^3/N``; empty for a plain number."""
        words = list(zip((units.force, units.length, "degrees"), self, strict=True))
        above = " ".join(_power(word, n) for word, n in words if n > 0)
        below = "/".join(_power(word, -n) for word, n in words if n < 0)
        return f"{above or '1'}/{below}" if below else above


OF_KIND: Mapping[str, Dimension] = {
    LENGTH: Dimension(0, 1),
    AREA: Dimension(0, 2),
    VOLUME: Dimension(0, 3),
    FORCE: Dimension(1, -1),
    WORK: Dimension(1, 0),
    STRESS: Dimension(1, -2),
    ANGLE: Dimension(degrees=1),
    NONE: Dimension(),
}
# Numbers of problems and parameters of their energies by the last part of their names.
_NUMBERS: Mapping[str, Dimension] = {
    **dict.fromkeys(("K", "mu", "E", "lambda", "c10", "c01", "c1", "c2", "c3", "mu_r", "mu_medium"), OF_KIND[STRESS]),
    **dict.fromkeys(("pressure", "cavity_pressure", "traction"), OF_KIND[STRESS]),
    **dict.fromkeys(("ux", "uy", "normal", "tangential", "h"), OF_KIND[LENGTH]),
    **dict.fromkeys(("nu", "gamma", "beta", "alpha", "log_j", "J_m", "lambda_m", "stiffness"), OF_KIND[NONE]),
    "alpha_r": OF_KIND[WORK],
    "rotation": OF_KIND[ANGLE],
    "force": OF_KIND[FORCE],
    "body_force": Dimension(1, -3),
}
_UNKNOWN = ("parameters", "spring")  # places where a name says nothing of the unit


def of_result(name: str, problem: Problem) -> Dimension | None:
    """Dimension of a result by its name; None where it is not known."""
    probes = problem.probes()
    if name in probes:
        return OF_KIND.get(probes[name].kind)
    if name in (COMPLIANCE, ENERGY) or name.startswith(ENERGY + OF):
        return OF_KIND[WORK]
    if name.startswith(P_NORM):
        return OF_KIND[kind_of_field(keys(name)[1])]
    of, _, quantity = name.rpartition(OF)
    if name.startswith(CONTACT):
        return OF_KIND.get(OF_BODY.get(quantity, ""))
    loads = {load.name: load for load in named_loads(problem)} | {"": problem.load()}
    if not of and quantity in ("displacement", "reaction"):  # of the first load, whatever its own words for them
        quantity = pair_of(loads[of])[quantity == "reaction"]
    return OF_KIND.get(KINDS.get(quantity, "")) if of in loads else None


def of_number(name: str, problem: Problem) -> Dimension | None:
    """Dimension of a number by its name; None where it is not known, such as of parameters of energies of one's own."""
    way = [key for key in keys(name) if not key.isdecimal()]
    if not way or any(place in way[:-1] for place in _UNKNOWN):
        return None
    region = problem.regions().get(way[0]) if len(way) == 2 else None
    if region is not None and region.material is None and "gamma" not in region.values:  # an energy of one's own
        return None
    return _NUMBERS.get(way[-1])


def _power(word: str, n: int) -> str:
    return word if n == 1 else f"{word}^{n}"
