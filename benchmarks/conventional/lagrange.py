"""Quadratic Lagrange shape functions: on the line, on the square (Q2, nine nodes) and on the triangle (P2, six nodes).

Corners come first, then the middles of the sides (side s joins corners s and s + 1), then the centre of the square.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]

# where a node of the square stands in the products of functions of the line, at -1, 0, 1
PLACE_x = (0, 2, 2, 0, 1, 2, 1, 0, 1)
PLACE_y = (0, 0, 2, 2, 0, 1, 2, 1, 1)


def line(xi: Float) -> tuple[Float, Float, Float]:
    """(n, 3) functions of the nodes at -1, 0 and 1, and their first and second derivatives."""
    one = np.ones_like(xi)
    values = np.stack([xi * (xi - 1) / 2, 1 - xi * xi, xi * (xi + 1) / 2], axis=-1)
    first = np.stack([xi - one / 2, -2 * xi, xi + one / 2], axis=-1)
    second = np.stack([one, -2 * one, one], axis=-1)
    return values, first, second


def square(n_points: int) -> tuple[Float, Float, Float]:
    """Shape functions (q, 9), gradients (q, 9, 2) and weights (q,) at n x n Gauss points of the square [-1, 1]^2."""
    x, w = np.polynomial.legendre.leggauss(n_points)
    xi, eta = (grid.ravel() for grid in np.meshgrid(x, x, indexing="ij"))
    (f, df, _), (g, dg, _) = line(xi), line(eta)
    i, j = list(PLACE_x), list(PLACE_y)
    values, d_xi, d_eta = f[:, i] * g[:, j], df[:, i] * g[:, j], f[:, i] * dg[:, j]
    return values, np.stack([d_xi, d_eta], axis=-1), np.outer(w, w).ravel()


def triangle(n_points: int) -> tuple[Float, Float, Float]:
    """The same on the triangle (0, 0), (1, 0), (0, 1): n x n points of the square, collapsed into a corner."""
    x, w = np.polynomial.legendre.leggauss(n_points)
    a, b = (grid.ravel() for grid in np.meshgrid((1 + x) / 2, (1 + x) / 2, indexing="ij"))
    weights = np.outer(w, w).ravel() / 4 * (1 - a)
    xi, eta = a, b * (1 - a)
    L_qk = np.stack([1 - xi - eta, xi, eta], axis=-1)
    dL_ki = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    values = np.concatenate([L_qk * (2 * L_qk - 1), *(4 * L_qk[:, [s]] * L_qk[:, [(s + 1) % 3]] for s in range(3))], 1)
    corners = (4 * L_qk - 1)[:, :, None] * dL_ki
    middles = [4 * (L_qk[:, [s]] * dL_ki[(s + 1) % 3] + L_qk[:, [(s + 1) % 3]] * dL_ki[s]) for s in range(3)]
    return values, np.concatenate([corners, np.stack(middles, axis=1)], axis=1), weights
