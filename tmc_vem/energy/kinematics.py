"""Plane-strain kinematics from the deformation gradient and its gradient.

``F[i][j] = delta_ij + d u_i / d X_j`` and ``G[i][j][k] = d^2 u_i / (d X_j d X_k)``. All eight components of
``G`` are treated as independent: the projected gradient of the virtual element method is not curl-free, so
``G[i][j][k]`` and ``G[i][k][j]`` may differ there.

Every function uses indexing and arithmetic only, so it accepts numbers, numpy arrays, UFL expressions and the
symbols of the code generator alike.
"""

from __future__ import annotations

from typing import Any

Scalar = Any  # a number, an array, a UFL expression or a traced symbol
Tensor = Any  # anything indexable as F[i][j] or G[i][j][k]

AXES = (0, 1)


def det(F: Tensor) -> Scalar:
    """Jacobian J = det F."""
    return F[0][0] * F[1][1] - F[0][1] * F[1][0]


def trace_c(F: Tensor) -> Scalar:
    """Trace of the three-dimensional C = F^T F in plane strain: F:F + 1, since F33 = 1."""
    return F[0][0] * F[0][0] + F[1][0] * F[1][0] + F[0][1] * F[0][1] + F[1][1] * F[1][1] + 1


def laplacian(G: Tensor) -> list[Scalar]:
    """Div(grad u), components ``Lu_i = G[i][j][j]``."""
    return [G[i][0][0] + G[i][1][1] for i in AXES]


def gradient_of_det(F: Tensor, G: Tensor) -> list[Scalar]:
    """grad J = cof F : grad F, equation (17) of Xu & Wriggers (2026)."""
    return [F[1][1] * G[0][0][k] - F[1][0] * G[0][1][k] - F[0][1] * G[1][0][k] + F[0][0] * G[1][1][k] for k in AXES]


def gradient_of_log_det(F: Tensor, G: Tensor) -> list[Scalar]:
    """grad ln J = grad J / J."""
    inverse = 1 / det(F)
    return [component * inverse for component in gradient_of_det(F, G)]


def squared_norm(components: list[Scalar]) -> Scalar:
    """Sum of the squares of the components."""
    total = components[0] * components[0]
    for component in components[1:]:
        total = total + component * component
    return total


def all_second_gradients(G: Tensor) -> list[Scalar]:
    """The eight components of G, first index fastest (Appendix C)."""
    return [G[i][j][k] for k in AXES for j in AXES for i in AXES]
