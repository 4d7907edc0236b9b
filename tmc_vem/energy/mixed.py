"""A solid in a medium: what a design region is made of, between nothing but medium and solid."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tmc_vem.energy.declare import declare, declared
from tmc_vem.energy.registry import Energy

STIFFNESS = "stiffness"
MEDIUM_MODULUS = "mu_medium"  # what the medium's mu is called beside that of the solid
_TRUE_OF_SUMS = ("objective", "max_rotation", "stress_free", "domain")


class _Renamed:
    """Parameters as attributes, some of which have other names."""

    def __init__(self, p: Any, names: Mapping[str, str]) -> None:
        self._p, self._names = p, names

    def __getattr__(self, name: str) -> Any:
        return getattr(self._p, self._names.get(name, name))


def solid_in_medium(solid: Energy, medium: Energy) -> Energy:
    """``stiffness psi_solid + psi_medium``: the medium alone where the stiffness is 0, the solid where it is 1.

    The medium is that of :func:`tmc_vem.energy.registry.third_medium`, its gamma and regulariser included, which the
    stiffness does not scale; in the solid it adds a fraction gamma. Its shear modulus is called ``mu_medium``, and the
    stiffness is the last of the parameters.

    Args:
        solid, medium: the energies.
    """
    renamed = {"mu": MEDIUM_MODULUS}
    facts = {key: value for energy in (solid, medium) for key, value in _restrictions(energy.density).items()}

    @declare(**facts)
    def density(F: Any, G: Any, p: Any, m: Any) -> Any:
        return p.stiffness * solid.density(F, G, p, m) + medium.density(F, G, _Renamed(p, renamed), m)

    own = tuple(renamed.get(name, name) for name in medium.parameters)
    return Energy(
        f"{solid.name}_in_{medium.name}",
        density,
        (*solid.parameters, *own, STIFFNESS),
        f"{solid.description}, weighted, in {medium.description}",
    )


def _restrictions(density: Any) -> dict[str, Any]:
    """What an author has declared that is true of a sum as well."""
    facts = declared(density)
    return {key: facts[key] for key in _TRUE_OF_SUMS if key in facts}
