"""Stress and strain: tensors at points, and the numbers that are made of them.

Three tensors are kept, as vectors of their components in plane strain; all other fields are functions of one of them,
whether it is a value, a mean or a recovered one. With ``P = dpsi/dF`` of the energy, the second gradient held, double
stresses apart,

    sigma = P F^T / J,    sigma_zz = P_zZ / J,    von Mises: sqrt(3/2 s : s),  s = sigma - tr(sigma)/3 I.

The shear component of the Cauchy stress is the mean of both: in a medium with a second-gradient energy ``P F^T`` need
not be symmetric.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.errors import InputError
from tmc_vem.support.units import LENGTH, NONE, STRESS

Float = NDArray[np.float64]

DEFORMATION, PIOLA, CAUCHY = "deformation_gradient", "first_piola_stress", "cauchy_stress"
# Of designs: fields of cells, and what displacements of load cases begin with.
OF_DESIGNS, MOVED = ("density", "stiffness"), "displacement_"
# Components of the tensors; where the energy does not say what acts across the plane, those with z are no numbers.
COMPONENTS: Mapping[str, tuple[str, ...]] = {
    DEFORMATION: ("xX", "xY", "yX", "yY"),
    PIOLA: ("xX", "xY", "yX", "yY", "zZ"),
    CAUCHY: ("xx", "yy", "zz", "xy"),
}


def tensors_of(F: Float, P: Float, across: Float | None) -> dict[str, Float]:
    """The tensors (..., n_components) of deformation gradients and first Piola-Kirchhoff stresses (..., 2, 2).

    Args:
        F, P: deformation gradient and stress.
        across: (...) stress ``P_zZ`` across the plane, None if it is not known.
    """
    zz = np.full(F.shape[:-2], np.nan) if across is None else across
    J = F[..., 0, 0] * F[..., 1, 1] - F[..., 0, 1] * F[..., 1, 0]
    sigma = P @ np.swapaxes(F, -1, -2) / J[..., None, None]
    shear = 0.5 * (sigma[..., 0, 1] + sigma[..., 1, 0])
    return {
        DEFORMATION: F.reshape(*F.shape[:-2], 4),
        PIOLA: np.concatenate([P.reshape(*P.shape[:-2], 4), zz[..., None]], axis=-1),
        CAUCHY: np.stack([sigma[..., 0, 0], sigma[..., 1, 1], zz / J, shear], axis=-1),
    }


@dataclass(frozen=True)
class Scalar:
    """A number that is made of a tensor.

    Attributes:
        of: name of the tensor.
        value: of its components (..., n).
        kind: of quantity, as in :mod:`tmc_vem.support.units`.
        what: in words.
        across: whether it needs the stress across the plane.
    """

    of: str
    value: Callable[[Float], Float]
    kind: str
    what: str
    across: bool = False


def von_mises(sigma: Float) -> Float:
    """``sqrt(((xx-yy)^2 + (yy-zz)^2 + (zz-xx)^2)/2 + 3 xy^2)``."""
    xx, yy, zz, xy = np.moveaxis(sigma, -1, 0)
    root: Float = np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3.0 * xy * xy)
    return root


def in_plane(sigma: Float) -> Float:
    """(..., 2) the two principal stresses in the plane, the larger one first."""
    xx, yy, _, xy = np.moveaxis(sigma, -1, 0)
    middle, radius = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    return np.stack([middle + radius, middle - radius], axis=-1)


def principal(sigma: Float) -> Float:
    """(..., 3) principal stresses, the largest one first; no numbers without the stress across the plane."""
    ordered: Float = np.sort(np.concatenate([in_plane(sigma), sigma[..., 2:3]], axis=-1), axis=-1)[..., ::-1]
    return np.where(np.isnan(sigma[..., 2:3]), np.nan, ordered)


def stretches(F: Float) -> Float:
    """(..., 2) principal stretches in the plane, the singular values of F, the larger one first; the third is 1."""
    xX, xY, yX, yY = np.moveaxis(F, -1, 0)
    # half the sum and half the difference of the singular values
    plus, minus = np.hypot(xX + yY, yX - xY) / 2.0, np.hypot(xX - yY, yX + xY) / 2.0
    return np.stack([plus + minus, np.abs(plus - minus)], axis=-1)


def green_lagrange(F: Float) -> Float:
    """(..., 3) ``E = (F^T F - I) / 2``: XX, YY, XY."""
    xX, xY, yX, yY = np.moveaxis(F, -1, 0)
    return np.stack([0.5 * (xX**2 + yX**2 - 1.0), 0.5 * (xY**2 + yY**2 - 1.0), 0.5 * (xX * xY + yX * yY)], axis=-1)


def log_strain(F: Float) -> Float:
    """(..., 3) ``ln sqrt(F F^T)``: xx, yy, xy."""
    xX, xY, yX, yY = np.moveaxis(F, -1, 0)
    xx, yy, xy = xX**2 + xY**2, yX**2 + yY**2, xX * yX + xY * yY
    large, small = np.moveaxis(stretches(F), -1, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        mean, half = 0.5 * np.log(large * small), 0.5 * np.log(large / small)
        slope = np.where(large > small, 2.0 * half / np.where(large > small, large**2 - small**2, 1.0), 0.5 / large**2)
    away = 0.5 * (xx - yy) * slope
    return np.stack([mean + away, mean - away, xy * slope], axis=-1)


def determinant(F: Float) -> Float:
    """(...) J."""
    J: Float = F[..., 0] * F[..., 3] - F[..., 1] * F[..., 2]
    return J


def _pick(function: Callable[[Float], Float], n: int) -> Callable[[Float], Float]:
    return lambda tensor: function(tensor)[..., n]


def _several(
    of: str,
    function: Callable[[Float], Float],
    names: Sequence[str],
    kind: str,
    what: str,
    across: Collection[str] = (),
) -> dict[str, Scalar]:
    """Numbers that a function gives side by side, by the ends of their names; ``across`` are those that need the stress
    across the plane."""
    return {
        name: Scalar(of, _pick(function, n), kind, f"{what} {name.rpartition('_')[2]}", name in across)
        for n, name in enumerate(names)
    }


def _plain(tensor: Float) -> Float:
    return tensor


def _numbered(name: str, n: int) -> list[str]:
    return [f"{name}_{number + 1}" for number in range(n)]


_PRINCIPAL = _numbered("principal_stress", 3)
_PARTS = {tensor: [f"{tensor}_{part}" for part in parts] for tensor, parts in COMPONENTS.items()}
SCALARS: Mapping[str, Scalar] = {
    "von_mises": Scalar(CAUCHY, von_mises, STRESS, "von Mises stress", across=True),
    **_several(CAUCHY, principal, _PRINCIPAL, STRESS, "principal stress", _PRINCIPAL),
    **_several(CAUCHY, in_plane, _numbered("in_plane_stress", 2), STRESS, "principal stress in the plane"),
    "hydrostatic_stress": Scalar(CAUCHY, lambda s: s[..., :3].mean(axis=-1), STRESS, "mean normal stress", across=True),
    **_several(DEFORMATION, stretches, _numbered("principal_stretch", 2), NONE, "principal stretch"),
    "J": Scalar(DEFORMATION, determinant, NONE, "J"),
    **_several(CAUCHY, _plain, _PARTS[CAUCHY], STRESS, "Cauchy stress", ("cauchy_stress_zz",)),
    **_several(PIOLA, _plain, _PARTS[PIOLA], STRESS, "first Piola-Kirchhoff stress", ("first_piola_stress_zZ",)),
    **_several(DEFORMATION, _plain, _PARTS[DEFORMATION], NONE, "deformation gradient"),
    **_several(
        DEFORMATION, green_lagrange, [f"green_lagrange_strain_{of}" for of in ("XX", "YY", "XY")], NONE,
        "Green-Lagrange strain",
    ),
    **_several(
        DEFORMATION, log_strain, [f"log_strain_{of}" for of in ("xx", "yy", "xy")], NONE, "logarithmic strain"
    ),
}  # fmt: skip


def require_fields(names: tuple[str, ...]) -> None:
    """Check names of fields of stress and strain.

    Raises:
        InputError: one is unknown.
    """
    for name in names:
        if name not in SCALARS and name not in COMPONENTS:
            raise InputError(f"unknown field '{name}': choose from {', '.join((*COMPONENTS, *SCALARS))}")


def tensors_needed(names: tuple[str, ...]) -> tuple[str, ...]:
    """Names of the tensors that fields are made of."""
    return tuple(dict.fromkeys(name if name in COMPONENTS else SCALARS[name].of for name in names))


def values_of(name: str, tensors: Mapping[str, Float]) -> Float:
    """A field (...) or (..., n_components) of the tensors."""
    return tensors[name] if name in COMPONENTS else SCALARS[name].value(tensors[SCALARS[name].of])


def kind_of(name: str) -> str:
    """Kind of quantity of a field."""
    if name in (DEFORMATION, *OF_DESIGNS):
        return NONE
    return LENGTH if name.startswith(MOVED) else SCALARS[name].kind if name in SCALARS else STRESS
