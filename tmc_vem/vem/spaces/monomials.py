"""Scaled monomials ``((x - x_E) / h_E)^a ((y - y_E) / h_E)^b``, ordered by degree: 1, xi, eta, xi^2, xi eta, eta^2, ...

This is the only place that knows the order: :func:`exponents` says what it is and :func:`raised` how its monomials are
made from each other, which is all that derivatives, potentials and the compiled kernels need.

All functions work in the scaled coordinates ``xi = (x - x_E) / h_E``; a derivative with respect to x therefore carries
the factor ``1 / h_E``, which the caller applies. The first axis of every array is the cell.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from tmc_vem.vem.spaces.quadrature import gauss

Float = NDArray[np.float64]
Int = NDArray[np.int64]


def dimension(degree: int) -> int:
    """Dimension of P_degree in the plane; 0 for a negative degree."""
    return (degree + 1) * (degree + 2) // 2 if degree >= 0 else 0


@cache
def exponents(degree: int) -> Int:
    """(dimension, 2) exponents of xi and eta, by degree, then by the power of eta."""
    table = np.array([(d - b, b) for d in range(degree + 1) for b in range(d + 1)], dtype=np.int64).reshape(-1, 2)
    table.setflags(write=False)
    return table


def position(a: int, b: int) -> int:
    """Position of ``xi^a eta^b`` in the order of :func:`exponents`."""
    return dimension(a + b - 1) + b


def degree_of(n_monomials: int) -> int:
    """Degree of the polynomials with that many monomials, the inverse of :func:`dimension`."""
    degree = 0
    while dimension(degree) < n_monomials:
        degree += 1
    return degree


@dataclass(frozen=True)
class Raised:
    """The products ``xi_x m`` of monomials m and coordinates, x = 0 for xi and 1 for eta.

    ``d(xi_x m)/dxi_x = power m``: read one way, the table differentiates, read the other way, it integrates.

    Attributes:
        position_mx: (n, 2) positions of the products.
        power_mx: (n, 2) powers of xi_x in them.
    """

    position_mx: NDArray[np.int32]
    power_mx: Float


@cache
def raised(degree: int) -> Raised:
    """The products of the monomials of P_degree and the coordinates, which are in P_(degree + 1)."""
    powers = exponents(degree)
    products = [(position(a + 1, b), position(a, b + 1)) for a, b in powers.tolist()]
    position_mx = np.array(products, dtype=np.int32).reshape(-1, 2)
    power_mx = powers + 1.0
    for table in (position_mx, power_mx):
        table.setflags(write=False)
    return Raised(position_mx, power_mx)


@cache
def derivative_matrices(degree: int) -> tuple[Float, Float]:
    """Matrices (dimension, dimension) of d/dxi and d/deta: row m has the coefficients of the derivative of m."""
    n, table = dimension(degree), raised(degree - 1)
    matrices = np.zeros((2, n, n))
    for x, matrix in enumerate(matrices):
        matrix[table.position_mx[:, x], np.arange(dimension(degree - 1))] = table.power_mx[:, x]
    return matrices[0], matrices[1]


def values(degree: int, xi_cqx: Float) -> Float:
    """Monomials (n_cells, n_points, dimension) at scaled points (n_cells, n_points, 2).

    In memory every monomial has its values side by side.
    """
    xi, eta = np.ascontiguousarray(np.moveaxis(xi_cqx, -1, 0))
    m = np.empty((dimension(degree), *xi.shape))
    m[0] = 1.0
    for d in range(1, degree + 1):
        lower, here = dimension(d - 2), dimension(d - 1)
        np.multiply(m[lower : lower + d], xi, out=m[here : here + d])
        np.multiply(m[lower + d - 1], eta, out=m[here + d])
    return np.moveaxis(m, 0, -1)


@cache
def _product_positions(degree: int) -> Int:
    """(dimension, dimension) position of the product of two monomials of P_degree within P_(2 degree)."""
    powers = exponents(degree)
    return np.array([[position(a + c, b + d) for c, d in powers.tolist()] for a, b in powers.tolist()])


def integrals(degree: int, xi_cvx: Float) -> Float:
    """Integrals (n_cells, dimension) of the monomials over polygons given in scaled coordinates.

    Exact: a monomial m of degree d is homogeneous about the origin, so
    ``int_E m = 1/(d + 2) sum_e (x_e . n_e) int_e m`` with the divergence theorem, and the integral over an edge is
    taken with a Gauss rule of sufficient degree. Area is in units of h_E^2.
    """
    s, weights = gauss(degree // 2 + 1)
    following = np.roll(xi_cvx, -1, axis=1)
    # x . n |e| = cross product of the end points, constant along the edge
    cross = xi_cvx[..., 0] * following[..., 1] - xi_cvx[..., 1] * following[..., 0]
    nodes = xi_cvx[:, :, None] * np.subtract(1.0, s)[:, None] + following[:, :, None] * s[:, None]
    n_cells = len(xi_cvx)
    m = values(degree, nodes.reshape(n_cells, -1, 2))
    edge_weights = (cross[:, :, None] * weights).reshape(n_cells, 1, -1)
    total: Float = (edge_weights @ m)[:, 0] / (exponents(degree).sum(axis=1) + 2.0)
    return total


def mass_matrices(degree: int, integrals_ca: Float) -> Float:
    """(n_cells, dimension, dimension) integrals of products, from the integrals of P_(2 degree)."""
    mass: Float = integrals_ca[:, _product_positions(degree)]
    return mass
