"""Kinematics of plane problems from the deformation gradient and its gradient.

``F[i][j] = delta_ij + d u_i / d X_j`` and ``G[i][j][k] = d^2 u_i / (d X_j d X_k)``. The third direction is a principal
one: ``F[2][2]`` is its stretch, 1 in plane strain and the same everywhere, and ``F[i][2] = F[2][i] = 0``. All eight
components of ``G`` are treated as independent: the projected gradient of the virtual element method is not curl-free,
so ``G[i][j][k]`` and ``G[i][k][j]`` may differ there.

Every function uses indexing and arithmetic only, so it accepts numbers, numpy arrays, UFL expressions and the
symbols of the code generator alike.
"""

from __future__ import annotations

from typing import Any

Scalar = Any  # a number, an array, a UFL expression or a traced symbol
Tensor = Any  # anything indexable as F[i][j] or G[i][j][k]

AXES = (0, 1)


def stretch_across(F: Tensor) -> Scalar:
    """``F[2][2]``, the stretch across the plane: 1 in plane strain, and for an F of two rows and columns only."""
    try:
        return F[2][2]
    except IndexError:
        return 1


def det(F: Tensor) -> Scalar:
    """Jacobian J = det F."""
    return stretch_across(F) * _det_in_plane(F)


def trace_c(F: Tensor) -> Scalar:
    """First invariant I1 of C = F^T F, its trace: F:F."""
    return _squares_in_plane(F) + stretch_across(F) ** 2


def second_invariant(F: Tensor) -> Scalar:
    """Second invariant I2 of C = F^T F: the trace of its cofactor."""
    in_plane, across = _det_in_plane(F), stretch_across(F)
    return in_plane * in_plane + across**2 * _squares_in_plane(F)


def _det_in_plane(F: Tensor) -> Scalar:
    return F[0][0] * F[1][1] - F[0][1] * F[1][0]


def _squares_in_plane(F: Tensor) -> Scalar:
    return F[0][0] * F[0][0] + F[1][0] * F[1][0] + F[0][1] * F[0][1] + F[1][1] * F[1][1]


def strain(F: Tensor) -> tuple[Scalar, Scalar, Scalar, Scalar]:
    """Green-Lagrange strain ``E = (C - I)/2``: its components E11, E22, E12 and E33."""
    C = [[F[0][i] * F[0][j] + F[1][i] * F[1][j] for j in AXES] for i in AXES]
    return (C[0][0] - 1) / 2, (C[1][1] - 1) / 2, C[0][1] / 2, (stretch_across(F) ** 2 - 1) / 2


def laplacian(G: Tensor) -> list[Scalar]:
    """Div(grad u), components ``Lu_i = G[i][j][j]``."""
    return [G[i][0][0] + G[i][1][1] for i in AXES]


def gradient_of_det(F: Tensor, G: Tensor) -> list[Scalar]:
    """grad J = cof F : grad F, equation (17) of Xu & Wriggers (2026)."""
    in_plane = [F[1][1] * G[0][0][k] - F[1][0] * G[0][1][k] - F[0][1] * G[1][0][k] + F[0][0] * G[1][1][k] for k in AXES]
    return [stretch_across(F) * component for component in in_plane]


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
