"""Friction at one point of a medium, written out step by step from its definitions, to compare the fast ones with.

One deformation gradient at a time, eigenvectors from numpy's solver, the stress of the medium from its own closed form,
and the potential from the formula with the square of what is cut off. Nothing here uses the code under test.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]

RIGHT_ANGLE = np.array([[0.0, -1.0], [1.0, 0.0]])


def layer(stretch: float, slip: float) -> Float:
    """Deformation gradient of a flat layer squeezed to ``stretch``, whose upper face has moved by ``slip`` widths."""
    return np.array([[1.0, slip], [0.0, stretch]])


def affine(F: Float) -> Callable[[Float], Float]:
    """Displacement of points (n, 2) with a deformation gradient."""
    return lambda x: x @ (F - np.eye(2)).T


def bent(stretch: float, slip: float) -> Callable[[Float], Float]:
    """Displacement of a squeezed layer whose slip, of both signs, and width vary from place to place."""

    def displacement(x: Float) -> Float:
        X, Y = x.T
        width = stretch * (1.0 + 0.3 * X * X)
        return np.stack([slip * Y * (X - 0.4) + 0.01 * X * X, (width - 1.0) * Y], axis=1)

    return displacement


def medium_stress(F: Float, level: float = 1.0) -> Float:
    """First Piola-Kirchhoff stress (..., 2, 2) of ``level / 2 (J^(-2/3) tr C - 3)``, in plane strain."""
    trace = np.sum(F * F, axis=(-2, -1))[..., None, None] + 1.0
    J = np.linalg.det(F)[..., None, None]
    stress: Float = level * J ** (-2 / 3) * (F - trace / 3.0 * np.swapaxes(np.linalg.inv(F), -1, -2))
    return stress


def parasitic(stretch: float, slip: Any) -> Any:
    """Shear over normal traction of the layer without friction, at one slip or several."""
    return 3.0 * stretch * slip / (2.0 + slip**2 - 2.0 * stretch**2)


def normal(F: Float) -> Float:
    """Eigenvector of F F^T to the smallest eigenvalue."""
    n: Float = np.linalg.eigh(F @ F.T)[1][:, 0]
    return n


def slip_direction(F: Float, n: Float) -> Float:
    """``s (x) F^-1 n + n (x) F^-1 s``."""
    s, inverse = RIGHT_ANGLE @ n, np.linalg.inv(F)
    A: Float = np.outer(s, inverse @ n) + np.outer(n, inverse @ s)
    return A


def bound(F: Float, coefficient: float, level: float = 1.0) -> float:
    """Largest Kirchhoff shear of a point: none unless it is squeezed to less than half."""
    if np.linalg.svd(F, compute_uv=False)[-1] >= 0.5 or np.linalg.det(F) >= 0.5:
        return 0.0
    n = normal(F)
    return coefficient * max(0.0, -float(n @ medium_stress(F, level) @ F.T @ n))


@dataclass(frozen=True)
class Step:
    """What a step has led to: stress with friction, shear, potential of the step, what its slip dissipated."""

    P: Float
    tau: float
    potential: float
    dissipated: float


def follow(
    path: Iterable[Float], coefficient: float, elastic_slip: float, level: float = 1.0, signs: Iterable[int] = ()
) -> list[Step]:
    """States along a path of deformation gradients that begins without deformation.

    Args:
        path: deformation gradients, a step each.
        coefficient, elastic_slip, level: friction and medium.
        signs: of the normals of the steps, 1 by default.
    """
    before, tau, steps, sign = np.eye(2), 0.0, [], iter(signs)
    for F in path:
        c = bound(before, coefficient, level)
        tau = min(max(tau, -c), c)
        A = slip_direction(before, next(sign, 1) * normal(before))
        potential = dissipated = 0.0
        if c > 0.0:
            stiffness, increment = c / elastic_slip, float(np.sum(A * (F - before)))
            trial = tau + stiffness * increment
            potential = (trial**2 - max(abs(trial) - c, 0.0) ** 2 - tau**2) / (2.0 * stiffness)
            start, tau = tau, min(max(trial, -c), c)
            dissipated = tau * (increment - (tau - start) / stiffness)
        steps.append(Step(medium_stress(F, level) + tau * A, tau, potential, dissipated))
        before = F
    return steps


def sliding_ratio(stretch: float, slip: float, coefficient: float) -> float:
    """Shear over normal traction of a layer that slides in steps without size, without the parasitic part."""
    F = layer(stretch, slip)
    A = slip_direction(F, normal(F))
    P = medium_stress(F) + bound(F, coefficient) * np.sign(A[0, 1]) * A
    return float(-P[0, 1] / P[1, 1]) - parasitic(stretch, slip)
