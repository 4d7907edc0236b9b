"""Derivatives of fields of stress and strain by the components of the tensors that they are made of.

The fields are those of ``SCALARS`` of :mod:`tmc_vem.system.tensors`. Where two principal values are equal, the
derivatives of both are those of their mean; where there is no stress at all, that of the von Mises stress is 0.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from tmc_vem.system.tensors import COMPONENTS, in_plane

Float = NDArray[np.float64]
Slope = Callable[[Float], Float]

_FEW = 1e-3  # of the argument of a series with _TERMS terms: what is left out is below rounding
_TERMS = 6


def _stacked(*parts: Float | float) -> Float:
    stacked: Float = np.stack(np.broadcast_arrays(*parts), axis=-1).astype(np.float64)
    return stacked


def _over(a: Float, b: Float) -> Float:
    """a / b, 0 where b is 0."""
    ratio: Float = np.where(b != 0.0, a, 0.0) / np.where(b != 0.0, b, 1.0)
    return ratio


def _von_mises(sigma: Float) -> Float:
    xx, yy, zz, xy = np.moveaxis(sigma, -1, 0)
    root = np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3.0 * xy * xy)
    parts = (2.0 * xx - yy - zz, 2.0 * yy - xx - zz, 2.0 * zz - xx - yy, 6.0 * xy)
    return _stacked(*(_over(0.5 * part, root) for part in parts))


def _in_plane(sigma: Float, sign: float) -> Float:
    xx, yy, _, xy = np.moveaxis(sigma, -1, 0)
    half = 0.5 * (xx - yy)
    radius = np.hypot(half, xy)
    away = 0.5 * sign * _over(half, radius)
    return _stacked(0.5 + away, 0.5 - away, 0.0, sign * _over(xy, radius))


def _principal(sigma: Float, n: int) -> Float:
    values = np.concatenate([in_plane(sigma), sigma[..., 2:3]], axis=-1)
    across = np.broadcast_to(np.eye(4)[2], sigma.shape)
    slopes = np.stack([_in_plane(sigma, 1.0), _in_plane(sigma, -1.0), across], axis=-2)
    which = np.argsort(-values, axis=-1, kind="stable")[..., n]
    found: Float = np.take_along_axis(slopes, which[..., None, None], axis=-2)[..., 0, :]
    return found


def _stretch(F: Float, sign: float) -> Float:
    xX, xY, yX, yY = np.moveaxis(F, -1, 0)
    sums, differences = (xX + yY, yX - xY), (xX - yY, yX + xY)
    plus, minus = np.hypot(*sums), np.hypot(*differences)
    of_plus = 0.5 * _stacked(_over(sums[0], plus), -_over(sums[1], plus), _over(sums[1], plus), _over(sums[0], plus))
    of_minus = 0.5 * _stacked(
        _over(differences[0], minus), _over(differences[1], minus), _over(differences[1], minus),
        -_over(differences[0], minus),
    )  # fmt: skip
    if sign > 0.0:
        return of_plus + of_minus
    smaller: Float = np.sign(plus - minus)[..., None] * (of_plus - of_minus)
    return smaller


def _j(F: Float) -> Float:
    xX, xY, yX, yY = np.moveaxis(F, -1, 0)
    return _stacked(yY, -yX, -xY, xX)


def _green_lagrange(F: Float, n: int) -> Float:
    xX, xY, yX, yY = np.moveaxis(F, -1, 0)
    return (_stacked(xX, 0.0, yX, 0.0), _stacked(0.0, xY, 0.0, yY), 0.5 * _stacked(xY, xX, yY, yX))[n]


def _log_strain(F: Float, n: int) -> Float:
    """Of ``ln(b) / 2`` with ``b = F F^T``: half the mean of its eigenvalues' logarithms, and the rest along b's own
    rest, times ``artanh(r) / r / q`` with r the difference of the eigenvalues over their sum q."""
    xX, xY, yX, yY = np.moveaxis(F, -1, 0)
    xx, yy, xy = xX**2 + xY**2, yX**2 + yY**2, xX * yX + xY * yY
    d_xx, d_yy, d_xy = _stacked(2 * xX, 2 * xY, 0.0, 0.0), _stacked(0.0, 0.0, 2 * yX, 2 * yY), _stacked(yX, yY, xX, xY)
    q, difference = xx + yy, xx - yy
    t = difference**2 + 4.0 * xy**2
    d_t = (2.0 * difference)[..., None] * (d_xx - d_yy) + (8.0 * xy)[..., None] * d_xy
    z = t / q**2
    d_z = d_t / (q**2)[..., None] - (2.0 * t / q**3)[..., None] * (d_xx + d_yy)
    ratio, slope = _artanh_over(z)
    d_factor = (slope / q)[..., None] * d_z - (ratio / q**2)[..., None] * (d_xx + d_yy)
    factor = (ratio / q)[..., None]
    if n == 2:
        shear: Float = d_xy * factor + xy[..., None] * d_factor
        return shear
    mean = 0.5 * _j(F) / (xX * yY - xY * yX)[..., None]
    away = 0.5 * ((d_xx - d_yy) * factor + difference[..., None] * d_factor)
    along: Float = mean + away if n == 0 else mean - away
    return along


def _artanh_over(z: Float) -> tuple[Float, Float]:
    """``artanh(sqrt(z)) / sqrt(z)`` and its derivative by z."""
    small = z < _FEW
    root = np.sqrt(np.where(small, 0.25, z))
    value = np.arctanh(root) / root
    slope = (1.0 / (1.0 - root**2) - value) / (2.0 * root**2)
    powers = [z**n for n in range(_TERMS + 1)]
    series = sum(powers[n] / (2 * n + 1) for n in range(_TERMS + 1))
    of_series = sum((n + 1) * powers[n] / (2 * n + 3) for n in range(_TERMS + 1))
    return np.where(small, series, value), np.where(small, of_series, slope)


def _unit(n: int, size: int) -> Slope:
    return lambda tensor: np.broadcast_to(np.eye(size)[n], tensor.shape)


def _plain(tensor: str) -> dict[str, Slope]:
    parts = COMPONENTS[tensor]
    return {f"{tensor}_{part}": _unit(n, len(parts)) for n, part in enumerate(parts)}


# By name of the field: of the tensor's components (..., n), the derivatives (..., n) by them.
SLOPES: Mapping[str, Slope] = {
    "von_mises": _von_mises,
    "principal_stress_1": lambda sigma: _principal(sigma, 0),
    "principal_stress_2": lambda sigma: _principal(sigma, 1),
    "principal_stress_3": lambda sigma: _principal(sigma, 2),
    "in_plane_stress_1": lambda sigma: _in_plane(sigma, 1.0),
    "in_plane_stress_2": lambda sigma: _in_plane(sigma, -1.0),
    "hydrostatic_stress": lambda sigma: np.broadcast_to(np.array([1.0, 1.0, 1.0, 0.0]) / 3.0, sigma.shape),
    "principal_stretch_1": lambda F: _stretch(F, 1.0),
    "principal_stretch_2": lambda F: _stretch(F, -1.0),
    "J": _j,
    **{name: slope for tensor in COMPONENTS for name, slope in _plain(tensor).items()},
    "green_lagrange_strain_XX": lambda F: _green_lagrange(F, 0),
    "green_lagrange_strain_YY": lambda F: _green_lagrange(F, 1),
    "green_lagrange_strain_XY": lambda F: _green_lagrange(F, 2),
    "log_strain_xx": lambda F: _log_strain(F, 0),
    "log_strain_yy": lambda F: _log_strain(F, 1),
    "log_strain_xy": lambda F: _log_strain(F, 2),
}
