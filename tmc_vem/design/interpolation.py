"""From the density of a cell to its stiffness: SIMP and RAMP.

The factor s multiplies the energy of the solid; s = 0 is the bare medium, s = 1 the solid. Neither law has a stiffness
for the void in it: the medium is that.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import require_choice, require_known, require_within

Float = NDArray[np.float64]


class Interpolation(Protocol):
    """A law s(x) on [0, 1] with s(0) = 0 and s(1) = 1, which does not decrease."""

    def factor(self, x_c: Float) -> Float:
        """s (n_cells,) at densities (n_cells,)."""

    def slope(self, x_c: Float) -> Float:
        """ds/dx (n_cells,) at densities (n_cells,)."""


@dataclass(frozen=True)
class Simp:
    """s = x^p: solid isotropic material with penalisation (Bendsoe, Struct. Optim. 1 (1989) 193).

    Attributes:
        p: exponent, 1 to 10. With 3, material of half the density has an eighth of the stiffness.

    Raises:
        InputError: p is out of range.
    """

    p: float = 3.0

    def __post_init__(self) -> None:
        require_within("exponent p of SIMP", self.p, 1.0, 10.0, "1 for a stiffness proportional to the density")

    def factor(self, x_c: Float) -> Float:
        """s (n_cells,) at densities (n_cells,)."""
        return np.asarray(x_c**self.p, dtype=np.float64)

    def slope(self, x_c: Float) -> Float:
        """ds/dx (n_cells,) at densities (n_cells,): 0 at x = 0 where p > 1, so that a void has no gradient there."""
        return np.asarray(self.p * x_c ** (self.p - 1.0), dtype=np.float64)


@dataclass(frozen=True)
class Ramp:
    """s = x / (1 + q (1 - x)): rational approximation (Stolpe & Svanberg, Struct. Multidisc. Optim. 22 (2001) 116).

    Attributes:
        q: penalisation, 0 to 100. The slope at x = 0 is 1 / (1 + q), so that a void has a gradient.

    Raises:
        InputError: q is out of range.
    """

    q: float = 8.0

    def __post_init__(self) -> None:
        require_within("penalisation q of RAMP", self.q, 0.0, 100.0, "0 for a stiffness proportional to the density")

    def factor(self, x_c: Float) -> Float:
        """s (n_cells,) at densities (n_cells,)."""
        return np.asarray(x_c / (1.0 + self.q * (1.0 - x_c)), dtype=np.float64)

    def slope(self, x_c: Float) -> Float:
        """ds/dx (n_cells,) at densities (n_cells,): (1 + q) / (1 + q (1 - x))^2."""
        return np.asarray((1.0 + self.q) / (1.0 + self.q * (1.0 - x_c)) ** 2, dtype=np.float64)


# Laws by name, and the parameter that each has.
INTERPOLATIONS: Mapping[str, tuple[type[Simp] | type[Ramp], str]] = {"simp": (Simp, "p"), "ramp": (Ramp, "q")}


def interpolation(name: str, **parameters: Any) -> Interpolation:
    """The law of this name.

    Args:
        name: ``simp`` or ``ramp``.
        parameters: ``p`` of SIMP, ``q`` of RAMP; left out, the usual value.

    Raises:
        InputError: there is no such law, a parameter is not one of its own, or out of range.
    """
    require_choice("interpolation", name, INTERPOLATIONS)
    law, own = INTERPOLATIONS[name]
    require_known(parameters, [own], f"interpolation '{name}'")
    value = parameters.get(own)
    if isinstance(value, bool) or not isinstance(value, (int, float, type(None))):
        raise InputError(f"{own} = {value!r} of interpolation '{name}' is no number")
    return law() if value is None else law(float(value))
