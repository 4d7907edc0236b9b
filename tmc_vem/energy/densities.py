"""Strain energy densities of Xu & Wriggers, CMAME 450 (2026) 118611, and three of our own beside them.

Each is ``density(F, G, p, m) -> scalar`` with the deformation gradient ``F[i][j]``, its gradient ``G[i][j][k]``,
the parameters ``p`` (attributes) and a maths namespace ``m`` with ``exp``, ``log``, ``sqrt`` and ``atan2``. Energies
are per unit reference area; see the equation numbers for the source of each.
"""

from __future__ import annotations

from typing import Any

from tmc_vem.energy import kinematics as kin
from tmc_vem.energy.declare import declare
from tmc_vem.energy.kinematics import Scalar, Tensor


def isochoric(F: Tensor, mu: Scalar, m: Any) -> Scalar:
    """Isochoric neo-Hookean part ``mu/2 (J^(-2/3) tr C - 3)``, the second term of (2), equal to (5)."""
    return mu / 2 * (m.exp(-2 * m.log(kin.det(F)) / 3) * kin.trace_c(F) - 3)


def solid(F: Tensor, G: Tensor, p: Any, m: Any) -> Scalar:
    """Hyperelastic solid (2) with bulk modulus ``K`` and shear modulus ``mu`` (force per area)."""
    log_j = m.log(kin.det(F))
    return p.K / 2 * log_j * log_j + isochoric(F, p.mu, m)


def medium(F: Tensor, G: Tensor, p: Any, m: Any) -> Scalar:
    """Third medium (5) before scaling by gamma: grows without bound as J -> 0."""
    return isochoric(F, p.mu, m)


def balanced(F: Tensor, G: Tensor, p: Any, m: Any) -> Scalar:
    """Third medium without stress across a squeeze, before scaling by gamma (own).

    ``mu/2 (J^(-2/3) (tr C + 1) - 4) + mu/3 (J - 1)``: free of stress at F = I, with the exponent of (5) and a barrier
    3/2 as strong. Where (5) is squeezed to a stretch lambda, it pulls in its sides with ``mu/3 (1 - lambda^2)
    lambda^(-2/3)``; this one pushes, with ``mu/3 (lambda - lambda^(4/3))``, which vanishes with lambda.
    """
    J = kin.det(F)
    return p.mu / 2 * (m.exp(-2 * m.log(J) / 3) * (kin.trace_c(F) + 1) - 4) + p.mu / 3 * (J - 1)


def huhu(F: Tensor, G: Tensor, p: Any, m: Any) -> Scalar:
    """Regulariser (6), ``1/2 G :. G``; it penalises bending as well as warping."""
    return kin.squared_norm(kin.all_second_gradients(G)) / 2


def huhu_lulu(F: Tensor, G: Tensor, p: Any, m: Any) -> Scalar:
    """Regulariser (9), ``1/2 (G :. G - 1/2 Lu . Lu)`` with ``Lu = Div grad u`` and n_dim = 2."""
    hu_hu = kin.squared_norm(kin.all_second_gradients(G))
    lu_lu = kin.squared_norm(kin.laplacian(G))
    return (hu_hu - lu_lu / 2) / 2


def huhu_log(F: Tensor, G: Tensor, p: Any, m: Any) -> Scalar:
    """Regulariser (6) with ``1/2 grad ln J . grad ln J``, which does not fade where the medium is squeezed (own)."""
    return huhu(F, G, p, m) + kin.squared_norm(kin.gradient_of_log_det(F, G)) / 2


def angle(F: Tensor, G: Tensor, p: Any, m: Any) -> Scalar:
    """Regulariser (15), ``1/2 (grad phi . grad phi + grad J . grad J)`` with the rotation angle phi."""
    return (kin.squared_norm(_gradient_of_angle(F, G)) + kin.squared_norm(kin.gradient_of_det(F, G))) / 2


def angle_log(F: Tensor, G: Tensor, p: Any, m: Any) -> Scalar:
    """(15) with ``grad ln J = grad J / J`` in place of grad J: it does not fade where the medium is squeezed (own)."""
    return (kin.squared_norm(_gradient_of_angle(F, G)) + kin.squared_norm(kin.gradient_of_log_det(F, G))) / 2


def _gradient_of_angle(F: Tensor, G: Tensor) -> list[Scalar]:
    """``grad phi = (b grad a - a grad b) / (a^2 + b^2)`` for ``a = F12 - F21`` and ``b = F11 + F22``.

    It is smooth for any rotation, also where b <= 0 (there ``atan(a / b)`` of (12) would jump).
    """
    a, b = F[0][1] - F[1][0], F[0][0] + F[1][1]
    weight = 1 / (a * a + b * b)
    return [(b * (G[0][1][k] - G[1][0][k]) - a * (G[0][0][k] + G[1][1][k])) * weight for k in kin.AXES]


@declare(objective=False, max_rotation=90.0)
def tangent(F: Tensor, G: Tensor, p: Any, m: Any) -> Scalar:
    """Regulariser (16), ``1/2 (grad t . grad t + grad J . grad J)`` with ``t = (F12 - F21) / (F11 + F22)``.

    Singular where F11 + F22 = 0, that is at rotations of 90 degrees, and not frame indifferent: as
    ``grad t = grad phi / cos^2 phi``, the first part grows with ``cos^-4`` of a superposed rotation. Use `angle` for
    large rotations.
    """
    a, b = F[0][1] - F[1][0], F[0][0] + F[1][1]
    t, inverse = a / b, 1 / b
    grad_t = [((G[0][1][k] - G[1][0][k]) - t * (G[0][0][k] + G[1][1][k])) * inverse for k in kin.AXES]
    return (kin.squared_norm(grad_t) + kin.squared_norm(kin.gradient_of_det(F, G))) / 2
