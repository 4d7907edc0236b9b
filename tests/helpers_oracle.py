"""Slow, plain implementations to compare the fast ones with: written from the definitions, one number at a time.

Nothing here uses the code under test. Integrals over a polygon are sums over the signed triangles of its first vertex
and its sides, which is exact for polynomials whatever the polygon's shape.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]
Function = Callable[[Any, Any], Any]

# Positions of the degrees of freedom inside a side: roots of the derivative of the Legendre polynomial of degree k.
INSIDE = {
    2: [0.5],
    3: [0.5 - 0.5 / np.sqrt(5.0), 0.5 + 0.5 / np.sqrt(5.0)],
    4: [0.5 - 0.5 * np.sqrt(3.0 / 7.0), 0.5, 0.5 + 0.5 * np.sqrt(3.0 / 7.0)],
}


def product(f: Function, g: Function) -> Function:
    """Their product."""
    return lambda x, y: f(x, y) * g(x, y)


def powers(degree: int) -> list[tuple[int, int]]:
    """Exponents of the monomials in the order 1, x, y, x^2, x y, y^2, ..."""
    return [(d - b, b) for d in range(degree + 1) for b in range(d + 1)]


def integrate_polygon(polygon: Float, f: Function, degree: int) -> float:
    """Integral of a polynomial of at most ``degree``, which takes arrays as well as numbers."""
    x, y, weights = _rule(tuple(map(tuple, polygon.tolist())), degree // 2 + 2)
    return float((weights * f(x, y)).sum())


@cache
def _rule(polygon: tuple[tuple[float, float], ...], n: int) -> tuple[Float, Float, Float]:
    """Points x, y and weights, n by n in each triangle of the first vertex and a side."""
    t, w = np.polynomial.legendre.leggauss(n)
    t, w = (t + 1.0) / 2.0, w / 2.0
    points, weights = [], []
    origin, *others = np.array(polygon)
    for first, second in itertools.pairwise(others):
        e1, e2 = first - origin, second - origin
        twice_area = e1[0] * e2[1] - e1[1] * e2[0]
        for a in range(n):
            for b in range(n):  # collapsed square: r along the ray, s across
                r, s = t[a], t[b]
                points.append(origin + r * ((1.0 - s) * e1 + s * e2))
                weights.append(twice_area * w[a] * w[b] * r)
    x, y = np.array(points).T
    return x, y, np.array(weights)


def integrate_side(a: Float, b: Float, f: Callable[[float, Float], float], degree: int) -> float:
    """Integral along a side of ``f(s, x)``, a polynomial of at most ``degree`` in s from 0 to 1, over the length."""
    t, w = np.polynomial.legendre.leggauss(degree // 2 + 1)
    length = np.hypot(*(b - a))
    return float(sum(w[i] / 2.0 * length * f((t[i] + 1) / 2, a + (b - a) * (t[i] + 1) / 2) for i in range(len(t))))


class Oracle:
    """Projectors of one polygon, section 4.1 of the paper, by the definitions."""

    def __init__(self, polygon: Float, k: int) -> None:
        self.polygon, self.k, self.n = polygon, k, len(polygon)
        self.area = integrate_polygon(polygon, lambda x, y: 1.0, 0)
        self.center = np.array([integrate_polygon(polygon, lambda x, y, i=i: (x, y)[i], 1) / self.area for i in (0, 1)])
        self.h = max(np.hypot(*(p - q)) for p in polygon for q in polygon)
        self.n_dofs = self.n * k + k * (k - 1) // 2
        self.nodes = [0.0, *INSIDE[k], 1.0]

    def m(self, p: tuple[int, int]) -> Function:
        """Scaled monomial with exponents ``p``."""
        (cx, cy), h = self.center, self.h
        return lambda x, y: ((x - cx) / h) ** p[0] * ((y - cy) / h) ** p[1]

    def dm(self, p: tuple[int, int], axis: int) -> Function:
        """Derivative of a scaled monomial with respect to x (axis 0) or y."""
        if p[axis] == 0:
            return lambda x, y: 0.0
        lower = (p[0] - 1, p[1]) if axis == 0 else (p[0], p[1] - 1)
        m, factor = self.m(lower), p[axis] / self.h
        return lambda x, y: factor * m(x, y)

    def laplacian(self, p: tuple[int, int]) -> list[tuple[float, tuple[int, int]]]:
        """Laplacian of a scaled monomial as a sum of factors and exponents."""
        terms = []
        for axis in (0, 1):
            if p[axis] >= 2:
                lower = (p[0] - 2, p[1]) if axis == 0 else (p[0], p[1] - 2)
                terms.append((p[axis] * (p[axis] - 1) / self.h**2, lower))
        return terms

    def dofs_of(self, v: Function, degree: int) -> Float:
        """Degrees of freedom of a polynomial of at most ``degree``."""
        values = [v(*x) for x in self.polygon]
        for s in range(self.n):
            a, b = self.polygon[s], self.polygon[(s + 1) % self.n]
            values += [v(*(a + t * (b - a))) for t in INSIDE[self.k]]
        for p in powers(self.k - 2):
            m = self.m(p)
            values.append(
                integrate_polygon(self.polygon, lambda x, y, m=m: v(x, y) * m(x, y), degree + self.k) / self.area
            )
        return np.array(values)

    def boundary(self, px: Function, py: Function, degree: int) -> Float:
        """``int_dE (p . n) v`` for every basis function v."""
        row = np.zeros(self.n_dofs)
        for s in range(self.n):
            a, b = self.polygon[s], self.polygon[(s + 1) % self.n]
            nx, ny = np.array([b[1] - a[1], a[0] - b[0]]) / np.hypot(*(b - a))
            inside = [self.n + s * (self.k - 1) + i for i in range(self.k - 1)]
            for j, dof in enumerate([s, *inside, (s + 1) % self.n]):
                others = [t for i, t in enumerate(self.nodes) if i != j]
                here = self.nodes[j]

                def integrand(t, x, others=others, here=here, nx=nx, ny=ny):
                    value = np.prod([(t - o) / (here - o) for o in others])
                    return value * (px(*x) * nx + py(*x) * ny)

                row[dof] += integrate_side(a, b, integrand, degree + self.k)
        return row

    def moment_row(self, p: tuple[int, int]) -> Float:
        """``int_E v m`` for every basis function, ``m`` of degree at most k - 2."""
        row = np.zeros(self.n_dofs)
        row[self.n * self.k + powers(self.k - 2).index(p)] = self.area
        return row

    def elliptic(self) -> Float:
        """Coefficients of Pi_nabla_k of every basis function: (dim P_k, n_dofs)."""
        basis = powers(self.k)
        A, rhs = np.zeros((len(basis), len(basis))), np.zeros((len(basis), self.n_dofs))
        for i, p in enumerate(basis):
            if i == 0:
                for j, q in enumerate(basis):
                    A[0, j] = integrate_polygon(self.polygon, self.m(q), self.k)
                rhs[0] = self.moment_row((0, 0))
                continue
            for j, q in enumerate(basis):
                A[i, j] = sum(
                    integrate_polygon(self.polygon, product(self.dm(p, i), self.dm(q, i)), 2 * self.k) for i in (0, 1)
                )
            rhs[i] = self.boundary(self.dm(p, 0), self.dm(p, 1), self.k)
            for factor, q in self.laplacian(p):
                rhs[i] -= factor * self.moment_row(q)
        return np.linalg.solve(A, rhs)

    def gradient(self, degree: int) -> tuple[Float, Float]:
        """Coefficients of the projections of d/dx and d/dy of every basis function on P_degree."""
        elliptic = self.elliptic()
        basis = powers(degree)
        mass = np.array(
            [[integrate_polygon(self.polygon, product(self.m(p), self.m(q)), 2 * degree) for q in basis] for p in basis]
        )
        result = []
        for axis in (0, 1):
            rhs = np.zeros((len(basis), self.n_dofs))
            for i, p in enumerate(basis):
                m, zero = self.m(p), lambda x, y: 0.0
                rhs[i] = self.boundary(*((m, zero) if axis == 0 else (zero, m)), degree)
                if p[axis] == 0:
                    continue
                lower = (p[0] - 1, p[1]) if axis == 0 else (p[0], p[1] - 1)
                factor = p[axis] / self.h
                if sum(lower) <= self.k - 2:
                    rhs[i] -= factor * self.moment_row(lower)
                else:  # enhanced space: higher moments are those of Pi_nabla
                    for j, q in enumerate(powers(self.k)):
                        both = integrate_polygon(self.polygon, product(self.m(lower), self.m(q)), degree + self.k)
                        rhs[i] -= factor * both * elliptic[j]
            result.append(np.linalg.solve(mass, rhs))
        return result[0], result[1]
