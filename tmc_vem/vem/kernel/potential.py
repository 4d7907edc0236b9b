"""Gradients that have a potential, in the form in which kernels keep them.

The gradient of a polynomial of degree d + 1 has (d + 1) (d + 2) coefficients, the polynomial without its constant only
(d + 2) (d + 3) / 2 - 1: 12 and 9 for d = 2. Polynomials are sums of ``xi^a eta^b`` by degree, then by b, in scaled
coordinates; gradients are with respect to the original ones, which are h times as large.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def _rows(degree: int) -> list[tuple[int, int, int, int]]:
    """For every monomial ``xi^a eta^b`` of the gradient: its place, those of its antiderivatives, a and b."""
    places = []
    m = 0
    for d in range(degree + 1):
        for b in range(d + 1):
            above = (d + 1) * (d + 2) // 2 - 1 + b  # of xi^(a + 1) eta^b, in the potential without its constant
            places.append((m, above, d - b, b))
            m += 1
    return places


def potential_of_gradient(gradient_stxma: Array, h_s: Array) -> Array:
    """Coefficients (n_shapes, n_pieces, dim P_(d+1) - 1, n_basis) of the potential, without the constant.

    Args:
        gradient_stxma: (n_shapes, n_pieces, 2, dim P_d, n_basis), free of curl.
        h_s: (n_shapes,) scales.
    """
    n_shapes, n_pieces, _, n_m, n_basis = gradient_stxma.shape
    degree = degree_of(n_m)
    potential = np.empty((n_shapes, n_pieces, n_m + degree + 1, n_basis))
    scaled = gradient_stxma * h_s[:, None, None, None, None]
    for m, above, a, b in _rows(degree):
        np.multiply(scaled[:, :, 0, m], 1.0 / (a + 1), out=potential[:, :, above])
        if a == 0:  # eta alone is seen by the other derivative only
            np.multiply(scaled[:, :, 1, m], 1.0 / (b + 1), out=potential[:, :, above + 1])
    return potential


def gradient_of_potential(potential_stma: Array, h_s: Array) -> Array:
    """The gradient again; see :func:`potential_of_gradient`."""
    n_shapes, n_pieces, n_potential, n_basis = potential_stma.shape
    degree = degree_of(n_potential + 1) - 1
    n_m = n_potential - degree - 1
    scaled = potential_stma / h_s[:, None, None, None]
    gradient = np.empty((n_shapes, n_pieces, 2, n_m, n_basis))
    for m, above, a, b in _rows(degree):
        np.multiply(scaled[:, :, above], a + 1, out=gradient[:, :, 0, m])
        np.multiply(scaled[:, :, above + 1], b + 1, out=gradient[:, :, 1, m])
    return gradient


def degree_of(dimension: int) -> int:
    """Degree of the polynomials of two variables with that many monomials."""
    degree = 0
    while (degree + 1) * (degree + 2) // 2 < dimension:
        degree += 1
    return degree
