"""The neo-Hookean solid in plane strain, written out by hand."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]

# d cof(F)_ij / d F_kl in the plane: cof F = [[F11, -F10], [-F01, F00]]
COFACTOR_RATE_ijkl = np.zeros((2, 2, 2, 2))
COFACTOR_RATE_ijkl[0, 0, 1, 1] = COFACTOR_RATE_ijkl[1, 1, 0, 0] = 1.0
COFACTOR_RATE_ijkl[0, 1, 1, 0] = COFACTOR_RATE_ijkl[1, 0, 0, 1] = -1.0
IDENTITY_ijkl = np.einsum("ik,jl->ijkl", np.eye(2), np.eye(2))


def determinant(F_qij: Float) -> Float:
    """(n,) J of the deformation gradients (n, 2, 2)."""
    return F_qij[:, 0, 0] * F_qij[:, 1, 1] - F_qij[:, 0, 1] * F_qij[:, 1, 0]


def energy(F_qij: Float, K: Float, mu: Float) -> Float:
    """(n,) energy per undeformed area, ``K/2 (ln J)^2 + mu/2 (J^(-2/3) (F : F + 1) - 3)``.

    K and mu (force per area) are (n,) like the points; J must be positive.
    """
    J = determinant(F_qij)
    trace = np.einsum("qij,qij->q", F_qij, F_qij) + 1.0
    value: Float = K / 2 * np.log(J) ** 2 + mu / 2 * (J ** (-2 / 3) * trace - 3.0)
    return value


def stress(F_qij: Float, K: Float, mu: Float) -> Float:
    """(n, 2, 2) first Piola stress, the derivative of :func:`energy`."""
    J = determinant(F_qij)
    H_qij = np.einsum("ijkl,qkl->qij", COFACTOR_RATE_ijkl, F_qij)
    trace = np.einsum("qij,qij->q", F_qij, F_qij) + 1.0
    on_F = mu * J ** (-2 / 3)
    on_H = K * np.log(J) / J - on_F * trace / (3.0 * J)
    P_qij: Float = on_F[:, None, None] * F_qij + on_H[:, None, None] * H_qij
    return P_qij


def tangent(F_qij: Float, K: Float, mu: Float) -> Float:
    """(n, 2, 2, 2, 2) derivative of :func:`stress`."""
    J = determinant(F_qij)
    H_qij = np.einsum("ijkl,qkl->qij", COFACTOR_RATE_ijkl, F_qij)
    trace = np.einsum("qij,qij->q", F_qij, F_qij) + 1.0
    a = mu * J ** (-2 / 3)
    on_HH = K * (1.0 - np.log(J)) / J**2 + 5.0 / 9.0 * a * trace / J**2
    FH = np.einsum("qij,qkl->qijkl", F_qij, H_qij)
    mixed = FH + np.einsum("qijkl->qklij", FH)
    A_qijkl: Float = (
        np.einsum("q,ijkl->qijkl", a, IDENTITY_ijkl)
        + np.einsum("q,ijkl->qijkl", K * np.log(J) / J - a * trace / (3.0 * J), COFACTOR_RATE_ijkl)
        + np.einsum("q,qij,qkl->qijkl", on_HH, H_qij, H_qij)
        - np.einsum("q,qijkl->qijkl", 2.0 / 3.0 * a / J, mixed)
    )
    return A_qijkl
