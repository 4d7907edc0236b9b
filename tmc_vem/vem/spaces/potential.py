"""Gradients that have a potential, in the form in which kernels keep them.

The gradient of a polynomial of degree d + 1 has (d + 1) (d + 2) coefficients, the polynomial without its constant only
(d + 2) (d + 3) / 2 - 1: 12 and 9 for d = 2. Polynomials are sums of monomials in scaled coordinates; gradients are with
respect to the original ones, which are h times as large.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tmc_vem.vem.spaces import monomials

Array = NDArray[np.float64]


def potential_of_gradient(gradient_stxma: Array, h_s: Array) -> Array:
    """Coefficients (n_shapes, n_pieces, dim P_(d+1) - 1, n_basis) of the potential, without the constant.

    Args:
        gradient_stxma: (n_shapes, n_pieces, 2, dim P_d, n_basis), free of curl.
        h_s: (n_shapes,) scales.
    """
    n_shapes, n_pieces, _, n_m, n_basis = gradient_stxma.shape
    degree = monomials.degree_of(n_m)
    potential = np.empty((n_shapes, n_pieces, monomials.dimension(degree + 1) - 1, n_basis))
    scaled = gradient_stxma * h_s[:, None, None, None, None]
    table = monomials.raised(degree)
    seen = set()  # monomials that both derivatives see have equal coefficients in both
    for x in (0, 1):
        for m, (to, power) in enumerate(zip(table.position_mx[:, x], table.power_mx[:, x], strict=True)):
            if to not in seen:
                seen.add(to)
                np.multiply(scaled[:, :, x, m], 1.0 / power, out=potential[:, :, to - 1])
    return potential


def gradient_of_potential(potential_stma: Array, h_s: Array) -> Array:
    """The gradient again; see :func:`potential_of_gradient`."""
    n_shapes, n_pieces, n_potential, n_basis = potential_stma.shape
    degree = monomials.degree_of(n_potential + 1) - 1
    scaled = potential_stma / h_s[:, None, None, None]
    gradient = np.empty((n_shapes, n_pieces, 2, monomials.dimension(degree), n_basis))
    table = monomials.raised(degree)
    for x in (0, 1):
        for m, (of, power) in enumerate(zip(table.position_mx[:, x], table.power_mx[:, x], strict=True)):
            np.multiply(scaled[:, :, of - 1], power, out=gradient[:, :, x, m])
    return gradient
