"""Quadrature rules and monomials: exactness, and where exactness ends."""

from __future__ import annotations

from fractions import Fraction
from math import factorial

import numpy as np
import pytest
from helpers_mesh import SHAPES, SQUARE_IN_THREE
from helpers_oracle import integrate_polygon, powers

from tmc_vem.mesh.geometry import areas
from tmc_vem.vem.spaces import monomials
from tmc_vem.vem.spaces.delaunay import delaunay_pieces, ear_clipping
from tmc_vem.vem.spaces.quadrature import (
    fan,
    gauss,
    gauss_lobatto,
    on_triangles,
    sub_triangles,
    triangle,
)  # fmt: skip

ALL_SHAPES = {**SHAPES, "square, sides in three": SQUARE_IN_THREE}


@pytest.mark.parametrize("n", range(1, 9))
def test_gauss_is_exact_to_2n_minus_1_and_no_further(n):
    x, w = gauss(n)
    for d in range(2 * n):
        assert (w * x**d).sum() == pytest.approx(1.0 / (d + 1), abs=1e-14)
    assert abs((w * x ** (2 * n)).sum() - 1.0 / (2 * n + 1)) > 1e-12


@pytest.mark.parametrize("n", range(2, 8))
def test_gauss_lobatto_is_exact_to_2n_minus_3_and_no_further(n):
    x, w = gauss_lobatto(n)
    assert (x[0], x[-1]) == (0.0, 1.0)
    assert (np.diff(x) > 0).all()
    assert x + x[::-1] == pytest.approx(np.ones(n), abs=1e-14)  # edges are read in both directions
    for d in range(2 * n - 2):
        assert (w * x**d).sum() == pytest.approx(1.0 / (d + 1), abs=1e-14)
    assert abs((w * x ** (2 * n - 2)).sum() - 1.0 / (2 * n - 1)) > 1e-12


def test_gauss_lobatto_needs_both_ends():
    with pytest.raises(ValueError, match="at least 2 points, got 1"):
        gauss_lobatto(1)


@pytest.mark.parametrize("degree", range(1, 16))
def test_triangle_rules_are_exact_positive_and_inside(degree):
    points, weights = triangle(degree)
    assert weights.sum() == pytest.approx(1.0, abs=1e-14)
    assert points.sum(axis=1) == pytest.approx(np.ones(len(points)), abs=1e-14)
    assert (weights > 0).all()
    assert (points > 0).all()
    for a in range(degree + 1):
        for b in range(degree + 1 - a):
            for c in range(degree + 1 - a - b):
                # integral of barycentric monomials, divided by the area
                exact = float(Fraction(2 * factorial(a) * factorial(b) * factorial(c), factorial(a + b + c + 2)))
                value = (weights * points[:, 0] ** a * points[:, 1] ** b * points[:, 2] ** c).sum()
                assert value == pytest.approx(exact, rel=2e-13), (a, b, c)


@pytest.mark.parametrize(("degree", "n_points"), [(1, 1), (2, 3), (3, 6), (4, 6), (5, 7)])
def test_low_degrees_use_few_points(degree, n_points):
    assert len(triangle(degree)[1]) == n_points


@pytest.mark.parametrize("degree", range(1, 11))
@pytest.mark.parametrize("name", ALL_SHAPES)
def test_polygon_rules_are_exact(name, degree):
    polygon = ALL_SHAPES[name]
    ((cells, triangles),) = sub_triangles(polygon[None])
    assert cells.tolist() == [0]
    points, weights = on_triangles(triangles, degree)
    assert (weights > 0).all()
    scaled = (points[0] - 0.3) / 2.0
    for a, b in powers(degree):
        exact = integrate_polygon((polygon - 0.3) / 2.0, lambda x, y, a=a, b=b: x**a * y**b, degree) * 4.0
        assert (weights[0] * scaled[:, 0] ** a * scaled[:, 1] ** b).sum() == pytest.approx(exact, rel=1e-12, abs=1e-13)


@pytest.mark.parametrize("name", ALL_SHAPES)
def test_ear_clipping_partitions_any_polygon(name):
    polygon = ALL_SHAPES[name]
    triangles = polygon[np.array(ear_clipping(polygon))]
    assert triangles.shape == (len(polygon) - 2, 3, 2)
    assert_partition(polygon, triangles)


def test_only_polygons_that_are_not_star_shaped_need_ear_clipping():
    polygons = np.stack([SHAPES["U"], SHAPES["square, hanging node on every edge"]])
    found = {cells.tolist()[0]: triangles.shape[1] for cells, triangles in sub_triangles(polygons)}
    assert found == {0: 8, 1: 8}  # two in each arm and four about a hub between them; n sides of a fan
    assert_partition(polygons[1], fan(polygons[1:])[0])


def test_pieces_of_a_u_are_triangles_and_the_trapezoid_on_a_circle():
    pieces = sorted(sorted(piece) for piece in delaunay_pieces(SHAPES["U"]))
    assert pieces == [[0, 1, 4, 5], [0, 5, 7], [1, 2, 4], [2, 3, 4], [5, 6, 7]]
    assert [sorted(piece) for piece in delaunay_pieces(SHAPES["square"])] == [[0, 1, 2, 3]]


@pytest.mark.parametrize("seed", range(40))
def test_ear_clipping_of_random_polygons_with_collinear_vertices(seed):
    """Polygons about the origin with radii far apart, sides then divided, so that collinear vertices abound."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 12))
    angles = np.sort(rng.random(n)) * 2 * np.pi
    if np.diff(angles, append=angles[0] + 2 * np.pi).max() > 3.0:
        angles = np.arange(n) * 2 * np.pi / n
    corners = rng.uniform(0.1, 2.0, n)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    parts = rng.integers(1, 4, n)
    polygon = np.vstack(
        [
            c + (d - c) * np.arange(p)[:, None] / p
            for c, d, p in zip(corners, np.roll(corners, -1, 0), parts, strict=True)
        ]
    )
    assert_partition(polygon, polygon[np.array(ear_clipping(polygon))], check_inside=False)
    ((_, triangles),) = sub_triangles(polygon[None])
    assert_partition(polygon, triangles[0], check_inside=False)


def assert_partition(polygon, triangles, check_inside=True):
    """No triangle is inverted, they add up to the polygon, and all monomials integrate to the same."""
    pieces = areas(triangles)
    assert (pieces > -1e-13 * pieces.sum()).all()
    assert pieces.sum() == pytest.approx(areas(polygon[None])[0], rel=1e-12)
    points, weights = on_triangles(triangles[None], 4)
    for a, b in powers(4):
        exact = integrate_polygon(polygon, lambda x, y, a=a, b=b: x**a * y**b, 4)
        assert (weights[0] * points[0, :, 0] ** a * points[0, :, 1] ** b).sum() == pytest.approx(exact, abs=1e-11)
    if check_inside:
        for point in points[0]:
            assert winding(polygon, point) == 1


def winding(polygon, point):
    """How often the polygon goes around a point."""
    a = polygon - point
    b = np.roll(a, -1, axis=0)
    turn = np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(axis=1))
    return round(turn.sum() / (2 * np.pi))


def test_monomials_are_ordered_by_degree():
    assert monomials.exponents(3).tolist() == [list(p) for p in powers(3)]
    assert [monomials.dimension(d) for d in range(-2, 5)] == [0, 0, 1, 3, 6, 10, 15]
    assert all(monomials.position(a, b) == n for n, (a, b) in enumerate(powers(6)))


def test_values_of_monomials():
    points = np.random.default_rng(0).normal(size=(2, 5, 2))
    values = monomials.values(4, points)
    for n, (a, b) in enumerate(powers(4)):
        assert values[..., n] == pytest.approx(points[..., 0] ** a * points[..., 1] ** b, rel=1e-14)


@pytest.mark.parametrize("degree", range(0, 7))
def test_derivative_matrices(degree):
    """d/dxi and d/deta against complex steps, which are exact to rounding."""
    points = np.random.default_rng(1).normal(size=(6, 2))
    m = monomials.values(degree, points[None])[0]
    for axis, matrix in enumerate(monomials.derivative_matrices(degree)):
        for n, (a, b) in enumerate(powers(degree)):
            x = points.astype(complex)
            x[:, axis] += 1e-30j
            exact = (x[:, 0] ** a * x[:, 1] ** b).imag / 1e-30
            assert m @ matrix[n] == pytest.approx(exact, rel=1e-12, abs=1e-13)


@pytest.mark.parametrize("name", ALL_SHAPES)
def test_integrals_of_monomials(name):
    polygon = ALL_SHAPES[name] - 0.4
    fast = monomials.integrals(12, polygon[None])[0]
    for n, (a, b) in enumerate(powers(12)):
        exact = integrate_polygon(polygon, lambda x, y, a=a, b=b: x**a * y**b, 12)
        assert fast[n] == pytest.approx(exact, rel=1e-11, abs=1e-12), (a, b)


def test_mass_matrix_holds_integrals_of_products():
    polygon = SHAPES["L"] - 0.8
    mass = monomials.mass_matrices(3, monomials.integrals(6, polygon[None]))[0]
    for i, (a, b) in enumerate(powers(3)):
        for j, (c, d) in enumerate(powers(3)):
            exact = integrate_polygon(polygon, lambda x, y, p=a + c, q=b + d: x**p * y**q, 6)
            assert mass[i, j] == pytest.approx(exact, rel=1e-12, abs=1e-13)
