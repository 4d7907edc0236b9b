"""Stress and strain: tensors at points, and the numbers that are made of them.

Three tensors are kept, as vectors of their components in plane strain; all other fields are functions of one of them, of
whatever it is a value, a mean or a recovered one. With ``P = dpsi/dF`` of the energy, the second gradient held, double
stresses apart,

    sigma = P F^T / J,    sigma_zz = P_zZ / J,    von Mises: sqrt(3/2 s : s),  s = sigma - tr(sigma)/3 I.

The shear component of the Cauchy stress is the mean of both: in a medium with a second-gradient energy ``P F^T`` need not be symmetric.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.errors import InputError
from tmc_vem.support.units import NONE, STRESS

Float = NDArray[np.float64]

DEFORMATION, PIOLA, CAUCHY = "deformation_gradient", "first_piola_stress", "cauchy_stress"
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


def _components() -> dict[str, Scalar]:
    """The components of tensors, as numbers."""
    words = {CAUCHY: "Cauchy stress", PIOLA: "first Piola-Kirchhoff stress", DEFORMATION: "deformation gradient"}
    return {
        f"{tensor}_{name}": Scalar(
            tensor, _pick(lambda t: t, n), NONE if tensor == DEFORMATION else STRESS, f"{words[tensor]} {name}", name in ("zz", "zZ")
        )
        for tensor, names in COMPONENTS.items()
        for n, name in enumerate(names)
    }  # fmt: skip


SCALARS: Mapping[str, Scalar] = {
    "von_mises": Scalar(CAUCHY, von_mises, STRESS, "von Mises stress", across=True),
    **{
        f"principal_stress_{n + 1}": Scalar(CAUCHY, _pick(principal, n), STRESS, f"principal stress {n + 1}", across=True)
        for n in range(3)
    },
    **{
        f"in_plane_stress_{n + 1}": Scalar(CAUCHY, _pick(in_plane, n), STRESS, f"principal stress {n + 1} in the plane")
        for n in range(2)
    },
    "hydrostatic_stress": Scalar(CAUCHY, lambda s: s[..., :3].mean(axis=-1), STRESS, "mean normal stress", across=True),
    **{
        f"principal_stretch_{n + 1}": Scalar(DEFORMATION, _pick(stretches, n), NONE, f"principal stretch {n + 1}")
        for n in range(2)
    },
    "J": Scalar(DEFORMATION, determinant, NONE, "J"),
    **_components(),
    **{
        f"green_lagrange_strain_{name}": Scalar(DEFORMATION, _pick(green_lagrange, n), NONE, f"Green-Lagrange strain {name}")
        for n, name in enumerate(("XX", "YY", "XY"))
    },
    **{
        f"log_strain_{name}": Scalar(DEFORMATION, _pick(log_strain, n), NONE, f"logarithmic strain {name}")
        for n, name in enumerate(("xx", "yy", "xy"))
    },
}  # fmt: skip
DEFAULT = (CAUCHY, "von_mises")


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
    return SCALARS[name].kind if name in SCALARS else NONE if name == DEFORMATION else STRESS
