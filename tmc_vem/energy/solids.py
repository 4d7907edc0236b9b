"""Hyperelastic solids by name: densities, their constants, and the moduli that they have at small strains.

All but one are sums of a volumetric part U(J) and an isochoric part, a function of the invariants of
``J^(-1/3) F``, ``I1b = J^(-2/3) I1`` and ``I2b = J^(-4/3) I2``. ``K`` is the bulk modulus at small strains in each, and
``mu``, where a model has it, the shear modulus. Energies are per unit reference volume, moduli are force per area.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from tmc_vem.energy import densities
from tmc_vem.energy import kinematics as kin
from tmc_vem.energy.declare import declare
from tmc_vem.energy.kinematics import Scalar, Tensor

Density = Callable[[Any, Any, Any, Any], Any]
Part = Callable[[Any, Any, Any], Any]  # of F, p and m
Values = Mapping[str, float]

NEO_HOOKE, LOG = "neo_hooke", "log"


# ---- Volumetric parts, U(1) = U'(1) = 0 and U''(1) = K --------------------------------------------------------------


def log(F: Tensor, p: Any, m: Any) -> Scalar:
    """``K/2 (ln J)^2`` of (2); its stress decreases beyond J = e."""
    log_j = m.log(kin.det(F))
    return p.K / 2 * log_j * log_j


def quadratic(F: Tensor, p: Any, m: Any) -> Scalar:
    """``K/2 (J - 1)^2``; it does not grow without bound as J -> 0."""
    J = kin.det(F)
    return p.K / 2 * (J - 1) * (J - 1)


def simo_taylor(F: Tensor, p: Any, m: Any) -> Scalar:
    """``K/4 (J^2 - 1 - 2 ln J)``, Simo & Taylor, CMAME 85 (1991) 273; convex in J."""
    J = kin.det(F)
    return p.K / 4 * (J * J - 1 - 2 * m.log(J))


VOLUMETRIC: dict[str, Part] = {LOG: log, "quadratic": quadratic, "simo_taylor": simo_taylor}


# ---- Isochoric parts ------------------------------------------------------------------------------------------------


def first_isochoric(F: Tensor, m: Any) -> Scalar:
    """``I1b - 3``."""
    return m.exp(-2 * m.log(kin.det(F)) / 3) * kin.trace_c(F) - 3


def second_isochoric(F: Tensor, m: Any) -> Scalar:
    """``I2b - 3``."""
    return m.exp(-4 * m.log(kin.det(F)) / 3) * kin.second_invariant(F) - 3


def neo_hooke(F: Tensor, p: Any, m: Any) -> Scalar:
    """``mu/2 (I1b - 3)`` of (2)."""
    return densities.isochoric(F, p.mu, m)


def mooney_rivlin(F: Tensor, p: Any, m: Any) -> Scalar:
    """``c10 (I1b - 3) + c01 (I2b - 3)``; mu = 2 (c10 + c01)."""
    return p.c10 * first_isochoric(F, m) + p.c01 * second_isochoric(F, m)


def yeoh(F: Tensor, p: Any, m: Any) -> Scalar:
    """``c1 x + c2 x^2 + c3 x^3`` with ``x = I1b - 3``, Yeoh, Rubber Chem. Technol. 63 (1990) 792; mu = 2 c1."""
    x = first_isochoric(F, m)
    return x * (p.c1 + x * (p.c2 + x * p.c3))


def gent(F: Tensor, p: Any, m: Any) -> Scalar:
    """``-mu J_m/2 ln(1 - (I1b - 3)/J_m)``, Gent, Rubber Chem. Technol. 69 (1996) 59; infinite at I1b - 3 = J_m."""
    return -p.mu * p.J_m / 2 * m.log(1 - first_isochoric(F, m) / p.J_m)


def arruda_boyce(F: Tensor, p: Any, m: Any) -> Scalar:
    """``mu_r sum c_i lambda_m^(2 - 2i) (I1b^i - 3^i)`` with five terms, Arruda & Boyce, JMPS 41 (1993) 389.

    ``c = 1/2, 1/20, 11/1050, 19/7000, 519/673750``. The rubbery modulus ``mu_r``, n k T of the chains, follows from
    the shear modulus: ``mu = mu_r`` :func:`stiffening`.
    """
    s, x = 1 / (p.lambda_m * p.lambda_m), first_isochoric(F, m)
    inner = _chains(5, s)
    for power in (4, 3, 2, 1):
        inner = _chains(power, s) + x * inner
    return p.mu / stiffening(s) * x * inner


def stiffening(s: Scalar) -> Scalar:
    """mu / mu_r of the Arruda-Boyce solid, ``1 + 3/5 s + 99/175 s^2 + ...`` with ``s = lambda_m^-2``."""
    return 2 * _chains(1, s)


_CHAINS = {1: (1, 2), 2: (1, 20), 3: (11, 1050), 4: (19, 7000), 5: (519, 673750)}  # c_i


def _chains(power: int, s: Scalar) -> Scalar:
    """Coefficient of ``(I1b - 3)^power`` in ``sum c_i s^(i - 1) (I1b^i - 3^i)``."""
    terms = [
        math.comb(i, power) * 3 ** (i - power) * above * s ** (i - 1) / below
        for i, (above, below) in _CHAINS.items()
        if i >= power
    ]
    return sum(terms[1:], terms[0])


def saint_venant_kirchhoff(F: Tensor, G: Tensor, p: Any, m: Any) -> Scalar:
    """``K/2 (tr E)^2 + mu dev E : dev E``, that is ``lambda/2 (tr E)^2 + mu E : E`` with lambda = K - 2 mu/3.

    For small strains: it softens in compression, uniaxially below a stretch of 1/sqrt(3), and is finite at J = 0.
    """
    e11, e22, e12, e33 = kin.strain(F)
    trace = e11 + e22 + e33
    squares = e11 * e11 + e22 * e22 + 2 * e12 * e12 + e33 * e33
    return p.K / 2 * trace * trace + p.mu * (squares - trace * trace / 3)


# ---- By name --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class SolidModel:
    """A hyperelastic solid with constants of its own.

    Attributes:
        name: in problem files.
        title: for tables.
        parameters: of its kernel, besides K.
        constants: what may be given besides moduli.
        needed: those of them that must be.
        isochoric: its part; None for one that is not split, which ``density`` is then.
        density: whole density of one that is not split.
        shear_modulus: mu at small strains, if the constants say it.
        values: of the kernel's parameters besides K, from mu and the constants.
        domain: positive where the energy has a value, 1 at F = I; None if that is everywhere.
    """

    name: str
    title: str
    parameters: tuple[str, ...] = ("mu",)
    constants: tuple[str, ...] = ()
    needed: tuple[str, ...] = ()
    isochoric: Part | None = None
    density: Density | None = None
    shear_modulus: Callable[[Values], float | None] = lambda _: None
    values: Callable[[float, Values], dict[str, float]] = lambda mu, constants: {"mu": mu, **constants}
    domain: Density | None = None


def _mooney_rivlin_modulus(c: Values) -> float | None:
    return 2.0 * (c["c10"] + c["c01"]) if len(c) == 2 else None


def _mooney_rivlin_values(mu: float, c: Values) -> dict[str, float]:
    c10 = c["c10"] if "c10" in c else mu / 2.0 - c["c01"]
    return {"c10": c10, "c01": c["c01"] if "c01" in c else mu / 2.0 - c10}


def _arruda_boyce_modulus(c: Values) -> float | None:
    if "mu_r" not in c:
        return None
    modulus: float = c["mu_r"] * stiffening(c["lambda_m"] ** -2)
    return modulus


MODELS: dict[str, SolidModel] = {
    model.name: model
    for model in (
        SolidModel(NEO_HOOKE, "neo-Hooke", isochoric=neo_hooke),
        SolidModel(
            "mooney_rivlin",
            "Mooney-Rivlin",
            ("c10", "c01"),
            ("c10", "c01"),
            isochoric=mooney_rivlin,
            shear_modulus=_mooney_rivlin_modulus,
            values=_mooney_rivlin_values,
        ),
        SolidModel(
            "yeoh",
            "Yeoh",
            ("c1", "c2", "c3"),
            ("c1", "c2", "c3"),
            ("c2", "c3"),
            isochoric=yeoh,
            shear_modulus=lambda c: 2.0 * c["c1"] if "c1" in c else None,
            values=lambda mu, c: {"c1": mu / 2.0, **c},
        ),
        SolidModel(
            "gent",
            "Gent",
            ("mu", "J_m"),
            ("J_m",),
            ("J_m",),
            isochoric=gent,
            domain=lambda F, G, p, m: 1 - first_isochoric(F, m) / p.J_m,
        ),
        SolidModel(
            "arruda_boyce",
            "Arruda-Boyce",
            ("mu", "lambda_m"),
            ("lambda_m", "mu_r"),
            ("lambda_m",),
            isochoric=arruda_boyce,
            shear_modulus=_arruda_boyce_modulus,
            values=lambda mu, c: {"mu": mu, "lambda_m": c["lambda_m"]},
        ),
        SolidModel("saint_venant_kirchhoff", "Saint Venant-Kirchhoff", density=saint_venant_kirchhoff),
    )
}


def solid_density(model: SolidModel, volumetric: str) -> Density:
    """Density of a model with a volumetric part; the paper's (2) is a function of its own."""
    if model.density is not None:
        return model.density
    if (model.name, volumetric) == (NEO_HOOKE, LOG):
        return densities.solid
    isochoric, bulk = model.isochoric, VOLUMETRIC[volumetric]
    assert isochoric is not None

    def density(F: Tensor, G: Tensor, p: Any, m: Any) -> Scalar:
        return bulk(F, p, m) + isochoric(F, p, m)

    return density if model.domain is None else declare(domain=model.domain)(density)


def solid_name(model: SolidModel, volumetric: str) -> str:
    """Name of the energy: that of the model, with the volumetric part unless it is the paper's or there is none."""
    if model.density is not None or volumetric == LOG:
        return "solid" if model.name == NEO_HOOKE else model.name
    return f"{model.name}_{volumetric}"
