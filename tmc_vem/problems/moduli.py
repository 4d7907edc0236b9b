"""Moduli of isotropic elasticity at small strains: any two of five say the others."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import require_finite, require_positive

NAMES = ("K", "mu", "E", "nu", "lambda")
PAIRS = "two of K, mu, E, nu and lambda"
_HINTS = {
    "K": "the bulk modulus, 20 for the box of the paper",
    "mu": "the shear modulus, 10 for the box of the paper",
    "E": "Young's modulus",
}


@dataclass(frozen=True)
class Moduli:
    """Bulk modulus K and shear modulus mu (force per area) at small strains."""

    K: float
    mu: float

    @property
    def nu(self) -> float:
        """Poisson's ratio."""
        return (3.0 * self.K - 2.0 * self.mu) / (6.0 * self.K + 2.0 * self.mu)


def _of_E_lambda(E: Any, lam: Any) -> tuple[Any, Any]:
    mu = (E - 3.0 * lam + (E * E + 9.0 * lam * lam + 2.0 * E * lam) ** 0.5) / 4.0
    return lam + 2.0 * mu / 3.0, mu


def _of_nu_lambda(nu: Any, lam: Any) -> tuple[Any, Any]:
    mu = lam * (1.0 - 2.0 * nu) / (2.0 * nu)
    return lam + 2.0 * mu / 3.0, mu


# (K, mu) from two moduli, numbers or arrays, in the order of NAMES
_FROM: Mapping[tuple[str, str], Callable[[Any, Any], tuple[Any, Any]]] = {
    ("K", "mu"): lambda K, mu: (K, mu),
    ("K", "E"): lambda K, E: (K, 3.0 * K * E / (9.0 * K - E)),
    ("K", "nu"): lambda K, nu: (K, 3.0 * K * (1.0 - 2.0 * nu) / (2.0 * (1.0 + nu))),
    ("K", "lambda"): lambda K, lam: (K, 1.5 * (K - lam)),
    ("mu", "E"): lambda mu, E: (E * mu / (3.0 * (3.0 * mu - E)), mu),
    ("mu", "nu"): lambda mu, nu: (2.0 * mu * (1.0 + nu) / (3.0 * (1.0 - 2.0 * nu)), mu),
    ("mu", "lambda"): lambda mu, lam: (lam + 2.0 * mu / 3.0, mu),
    ("E", "nu"): lambda E, nu: (E / (3.0 * (1.0 - 2.0 * nu)), E / (2.0 * (1.0 + nu))),
    ("E", "lambda"): _of_E_lambda,
    ("nu", "lambda"): _of_nu_lambda,
}


def moduli(given: Mapping[str, float]) -> Moduli:
    """K and mu from two moduli.

    Args:
        given: two of :data:`NAMES` with their values.

    Raises:
        InputError: there are not two of them, one is out of its range, or there is no solid that has both.
    """
    names = tuple(name for name in NAMES if name in given)
    if len(names) != 2:
        raise InputError(f"give {PAIRS}, not {' and '.join(names) or 'none'}")
    for name in names:
        _check(name, given[name])
    first, second = names
    said = f"{first} = {given[first]:g} and {second} = {given[second]:g}"
    try:
        K, mu = (float(modulus) for modulus in converted(given))
    except ZeroDivisionError:
        raise InputError(f"{said} do not say what K and mu are: give others of {', '.join(NAMES)}") from None
    if not (math.isfinite(K) and math.isfinite(mu) and K > 0.0 and mu > 0.0):
        raise InputError(f"{said} make K = {K:g} and mu = {mu:g}, which must be positive: there is no such solid")
    return Moduli(K, mu)


def converted(given: Mapping[str, Any]) -> tuple[Any, Any]:
    """K and mu from two moduli of :data:`NAMES`, numbers or arrays, as they come: nothing is checked."""
    first, second = (name for name in NAMES if name in given)
    return _FROM[first, second](given[first], given[second])


def _check(name: str, value: float) -> None:
    if name in _HINTS:
        require_positive(name, value, _HINTS[name])
        return
    require_finite(name, value)
    if name == "nu" and not -1.0 < value < 0.5:
        nearly = ": 0.499 is nearly incompressible, K / mu = 500" if value >= 0.5 else ""
        raise InputError(f"nu = {value:g} must be between -1 and 0.5, without these{nearly}")
