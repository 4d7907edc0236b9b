"""Sub-triangulations as graphs, and Bernstein polynomials on them: what piecewise spaces share.

Bernstein polynomials ``B_a = k!/a! lambda^a`` of neighbouring triangles agree on the common side if their coefficients
there do, for any k and any orientation: numbering them is all that continuity takes.
"""

from __future__ import annotations

from functools import cache
from math import factorial

import numpy as np
from numpy.typing import NDArray

from tmc_vem.vem.spaces.projector import edge_basis
from tmc_vem.vem.spaces.quadrature import is_fan

Float = NDArray[np.float64]
Int = NDArray[np.int64]


def equal_topologies(polygons_cvx: Float, triangles_ctpx: Float) -> list[tuple[Int, Int]]:
    """Pairs of cells (n,) and the vertices (n_triangles, 3) at the corners of their sub-triangles, the same in all.

    Numbers from n_sides on stand for hubs, which are inside.
    """
    n_cells, n_sides = polygons_cvx.shape[:2]
    if is_fan(triangles_ctpx):
        first = np.arange(n_sides)
        return [(np.arange(n_cells), np.stack([np.full(n_sides, n_sides), first, (first + 1) % n_sides], axis=1))]
    flat = np.stack([_corner_numbers(*cell) for cell in zip(polygons_cvx, triangles_ctpx, strict=True)])
    kinds, kind_of = np.unique(flat, axis=0, return_inverse=True)
    return [(np.flatnonzero(kind_of.reshape(-1) == n), kind.reshape(-1, 3)) for n, kind in enumerate(kinds)]


def _corner_numbers(polygon_vx: Float, triangles_tpx: Float) -> Int:
    """(n_triangles * 3,) numbers of the corners of a cell's triangles: its vertices, then hubs as they come."""
    numbers = {tuple(point): n for n, point in enumerate(polygon_vx.tolist())}
    corners = triangles_tpx.reshape(-1, 2).tolist()
    return np.array([numbers.setdefault(tuple(corner), len(numbers)) for corner in corners])


def sides_of(corners_tp: Int) -> dict[tuple[int, int], list[tuple[int, int]]]:
    """Triangles and their local side (from corner s to s + 1) at every side, by its sorted ends."""
    sides: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for t, corners in enumerate(corners_tp.tolist()):
        for s in range(3):
            a, b = corners[s], corners[(s + 1) % 3]
            sides.setdefault((min(a, b), max(a, b)), []).append((t, s))
    return sides


@cache
def barycentric_exponents(degree: int) -> Int:
    """(n, 3) exponents of the barycentric coordinates."""
    table = [(i, j, degree - i - j) for i in range(degree, -1, -1) for j in range(degree - i, -1, -1)]
    return np.array(table, dtype=np.int64)


def lattice(degree: int) -> Float:
    """Points (dim P_degree, 3), in barycentric coordinates, that determine a polynomial; inside the triangle."""
    interior: Float = (barycentric_exponents(degree) + 1.0 / 3.0) / (degree + 1.0)
    return interior


def bernstein(degree: int, barycentric_qp: Float) -> Float:
    """Bernstein polynomials (n_points, n)."""
    powers = [np.ones_like(barycentric_qp)]
    for _ in range(degree):
        powers.append(powers[-1] * barycentric_qp)
    values = np.empty((len(barycentric_qp), len(barycentric_exponents(degree))))
    for n, (i, j, m) in enumerate(barycentric_exponents(degree).tolist()):
        factor = factorial(degree) // (factorial(i) * factorial(j) * factorial(m))
        values[:, n] = factor * powers[i][:, 0] * powers[j][:, 1] * powers[m][:, 2]
    return values


def bernstein_gradients(degree: int, barycentric_qp: Float) -> Float:
    """Derivatives (n_points, n, 3) with respect to the barycentric coordinates."""
    lower = {tuple(row): n for n, row in enumerate(barycentric_exponents(degree - 1).tolist())}
    values = bernstein(degree - 1, barycentric_qp)
    result = np.zeros((len(barycentric_qp), len(barycentric_exponents(degree)), 3))
    for n, row in enumerate(barycentric_exponents(degree).tolist()):
        for p in range(3):
            if row[p]:
                below = tuple(a - (i == p) for i, a in enumerate(row))
                result[:, n, p] = degree * values[:, lower[below]]
    return result


def coefficient_numbers(corners_tp: Int, n_sides: int, degree: int) -> tuple[Int, int]:
    """Number (n_triangles, n) of every coefficient of continuous piecewise polynomials, and how many there are.

    The first ``n_sides degree`` are on the boundary: vertices, then side after side in the polygon's direction.
    """
    numbers: dict[tuple[int, ...], int] = {(v,): v for v in range(n_sides)}
    for s in range(n_sides):
        for m in range(1, degree):
            numbers[_on_side(s, (s + 1) % n_sides, degree - m, m)] = n_sides + s * (degree - 1) + m - 1
    free = n_sides * degree
    table = np.empty((len(corners_tp), len(barycentric_exponents(degree))), dtype=np.int64)
    for t, corners in enumerate(corners_tp.tolist()):
        for n, powers in enumerate(barycentric_exponents(degree).tolist()):
            ends = [p for p in range(3) if powers[p]]
            if len(ends) == 1:
                key: tuple[int, ...] = (corners[ends[0]],)
            elif len(ends) == 2:
                key = _on_side(corners[ends[0]], corners[ends[1]], powers[ends[0]], powers[ends[1]])
            else:
                key = (t, *powers, -1, -1)
            if key not in numbers:
                numbers[key] = free
                free += 1
            table[t, n] = numbers[key]
    return table, free


def _on_side(a: int, b: int, power_a: int, power_b: int) -> tuple[int, ...]:
    return (a, b, power_a, power_b) if a < b else (b, a, power_b, power_a)


def boundary_coefficients(n_sides: int, degree: int, k: int) -> Float:
    """Boundary coefficients (n_sides degree, n_sides k) of degree ``degree`` of the functions of degree k on each side
    that have given values at vertices and Gauss-Lobatto points."""
    points = np.linspace(0.0, 1.0, degree + 1)
    along = bernstein(degree, np.stack([1.0 - points, points, np.zeros_like(points)], axis=1))
    on_side = [n for n, powers in enumerate(barycentric_exponents(degree).tolist()) if powers[2] == 0]
    from_values = np.linalg.solve(along[:, on_side], edge_basis(k, points))
    result = np.zeros((n_sides * degree, n_sides * k))
    result[:n_sides, :n_sides] = np.eye(n_sides)
    for s in range(n_sides):
        rows = n_sides + s * (degree - 1) + np.arange(degree - 1)
        inside = n_sides + s * (k - 1) + np.arange(k - 1)
        result[np.ix_(rows, [s, *inside, (s + 1) % n_sides])] = from_values[1:degree]
    return result


def barycentric_gradients(triangles_ctpx: Float) -> tuple[Float, Float]:
    """Gradients (n_cells, n_triangles, 3, 2) of the barycentric coordinates, and areas (n_cells, n_triangles)."""
    edge1, edge2 = triangles_ctpx[:, :, 1] - triangles_ctpx[:, :, 0], triangles_ctpx[:, :, 2] - triangles_ctpx[:, :, 0]
    twice = edge1[..., 0] * edge2[..., 1] - edge1[..., 1] * edge2[..., 0]
    second = np.stack([edge2[..., 1], -edge2[..., 0]], axis=-1) / twice[..., None]
    third = np.stack([-edge1[..., 1], edge1[..., 0]], axis=-1) / twice[..., None]
    return np.stack([-second - third, second, third], axis=2), 0.5 * twice
