"""Projectors: identities, and the batched code against a slow oracle written from the definitions."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_mesh import SHAPES
from helpers_oracle import Oracle, integrate_polygon, powers, product

from tmc_vem.vem.spaces import monomials
from tmc_vem.vem.spaces.projector import (
    PolygonGeometry,
    dofs_of_monomials,
    edge_basis,
    elliptic_projector,
    gradient_projector,
    moments_of_basis,
    n_scalar_dofs,
    n_translated_dofs,
    value_projector,
)  # fmt: skip
from tmc_vem.vem.spaces.quadrature import gauss_lobatto

NAMES = [
    "triangle", "square", "pentagon", "L", "U", "arrow", "square, one hanging node",
    "square, off-centre hanging node", "square, hanging node on every edge",
]  # fmt: skip
ORDERS = [2, 3, 4]


def fast(polygon, k, degree):
    geometry = PolygonGeometry.of(polygon[None], max(k, degree))
    elliptic = elliptic_projector(geometry, k)
    grad_x, grad_y = gradient_projector(geometry, k, degree, elliptic)
    return geometry, elliptic[0], grad_x[0], grad_y[0]


@pytest.mark.parametrize("k", ORDERS)
@pytest.mark.parametrize("name", NAMES)
def test_polynomials_of_degree_k_are_reproduced(name, k):
    """Pi_nabla_k p = p and Pi0_l grad p = grad p for every monomial of degree up to k and every l."""
    polygon = SHAPES[name]
    oracle = Oracle(polygon, k)
    dofs = np.array([oracle.dofs_of(oracle.m(p), k) for p in powers(k)]).T
    _, elliptic, _, _ = fast(polygon, k, k)
    assert elliptic @ dofs == pytest.approx(np.eye(len(powers(k))), abs=1e-10)
    for degree in range(k - 1, 9):
        _, _, grad_x, grad_y = fast(polygon, k, degree)
        # compare functions, not coefficients: those of high degrees are ill conditioned and cancel
        m = monomials.values(degree, (polygon[None] - oracle.center) / oracle.h)[0]
        d_xi = monomials.derivative_matrices(degree)[0]
        for axis, grad in enumerate((grad_x, grad_y)):
            expected = np.zeros((monomials.dimension(degree), len(powers(k))))
            for j, p in enumerate(powers(k)):
                if p[axis]:
                    lower = (p[0] - 1, p[1]) if axis == 0 else (p[0], p[1] - 1)
                    expected[powers(degree).index(lower), j] = p[axis] / oracle.h
            assert m @ (grad @ dofs) == pytest.approx(m @ expected, abs=1e-9 / oracle.h)
            assert m @ d_xi.T @ (grad @ dofs) == pytest.approx(m @ d_xi.T @ expected, abs=1e-7 / oracle.h)


@pytest.mark.parametrize("k", ORDERS)
def test_polynomials_of_degree_k_plus_1_are_not(k):
    oracle = Oracle(SHAPES["pentagon"], k)
    dofs = oracle.dofs_of(oracle.m((k + 1, 0)), k + 1)
    _, elliptic, _, _ = fast(SHAPES["pentagon"], k, k)
    points = SHAPES["pentagon"]
    projected = monomials.values(k, (points[None] - oracle.center) / oracle.h)[0] @ elliptic @ dofs
    assert np.abs(projected - [oracle.m((k + 1, 0))(*x) for x in points]).max() > 1e-3


@pytest.mark.parametrize(
    ("name", "k"),
    [(name, k) for name in ("triangle", "square", "U", "square, one hanging node") for k in (2, 3)] + [("pentagon", 4)],
)
def test_batched_projectors_equal_the_slow_ones(name, k):
    polygon = SHAPES[name]
    degree = k + 1
    oracle = Oracle(polygon, k)
    _, elliptic, grad_x, grad_y = fast(polygon, k, degree)
    slow = oracle.elliptic()
    assert elliptic == pytest.approx(slow, abs=1e-9 * np.abs(slow).max())
    for ours, theirs in zip((grad_x, grad_y), oracle.gradient(degree), strict=True):
        assert ours == pytest.approx(theirs, abs=1e-9 * np.abs(theirs).max())


@pytest.mark.parametrize(("name", "k"), [("pentagon", 2), ("L", 2), ("pentagon", 3), ("square, one hanging node", 3)])
def test_elliptic_projection_of_bubbles_is_orthogonal_with_equal_mean(name, k):
    """A bubble vanishes on the boundary and has one moment that is 1: both sides of (36) by slow integrals."""
    polygon = SHAPES[name]
    _, elliptic, _, _ = fast(polygon, k, k)
    oracle = Oracle(polygon, k)
    n = len(polygon)
    for a in range(monomials.dimension(k - 2)):
        coefficients = elliptic[:, n * k + a]  # projection of the bubble whose moment number a is 1

        def projected(x, y, c=coefficients):
            return sum(c[i] * oracle.m(p)(x, y) for i, p in enumerate(powers(k)))

        mean = integrate_polygon(polygon, projected, k) / oracle.area
        assert mean == pytest.approx(1.0 if a == 0 else 0.0, abs=1e-11)
        for p in powers(k)[1:]:
            left = sum(
                coefficients[i]
                * sum(integrate_polygon(polygon, product(oracle.dm(p, ax), oracle.dm(q, ax)), 2 * k) for ax in (0, 1))
                for i, q in enumerate(powers(k))
            )
            # int grad v . grad p = -int v lap p, as v vanishes on the boundary
            right = -sum(f * oracle.area for f, q in oracle.laplacian(p) if powers(k - 2).index(q) == a)
            assert left == pytest.approx(right, abs=1e-10)


@pytest.mark.parametrize("k", ORDERS)
@pytest.mark.parametrize("name", ["triangle", "pentagon", "U"])
def test_moments_of_the_basis(name, k):
    """Up to degree k - 2 the moments are degrees of freedom, beyond they are those of Pi_nabla."""
    polygon = SHAPES[name]
    degree = k + 1
    geometry, elliptic, _, _ = fast(polygon, k, degree)
    moments = moments_of_basis(geometry, k, degree, elliptic[None])[0]
    oracle = Oracle(polygon, k)
    for i, p in enumerate(powers(degree)):
        expected = np.zeros(oracle.n_dofs)
        if sum(p) <= k - 2:
            expected = oracle.moment_row(p)
        else:
            for j, q in enumerate(powers(k)):
                both = integrate_polygon(polygon, product(oracle.m(p), oracle.m(q)), degree + k)
                expected = expected + both * elliptic[j]
        assert moments[i] * oracle.h**2 == pytest.approx(expected, abs=1e-11)


@pytest.mark.parametrize("k", ORDERS)
def test_projectors_do_not_depend_on_where_the_cell_is(k):
    polygon = SHAPES["pentagon"]
    here, there = fast(polygon, k, k + 1)[1:], fast(polygon + np.array([1000.0, -500.0]), k, k + 1)[1:]
    for a, b in zip(here, there, strict=True):
        assert b == pytest.approx(a, abs=1e-9 * np.abs(a).max())


@pytest.mark.parametrize("k", ORDERS)
@pytest.mark.parametrize("size", [1e-6, 1e5])
def test_projectors_scale_with_the_cell(k, size):
    polygon = SHAPES["U"]
    _, elliptic, grad_x, grad_y = fast(polygon, k, k + 1)
    _, scaled, scaled_x, scaled_y = fast(polygon * size, k, k + 1)
    assert scaled == pytest.approx(elliptic, abs=1e-10 * np.abs(elliptic).max())
    for a, b in ((grad_x, scaled_x), (grad_y, scaled_y)):
        assert b * size == pytest.approx(a, abs=1e-9 * np.abs(a).max())


@pytest.mark.parametrize("k", ORDERS)
def test_starting_vertex_only_renumbers(k):
    polygon = SHAPES["pentagon"]
    n = len(polygon)
    turned = np.roll(polygon, -1, axis=0)
    vertices = np.roll(np.arange(n), -1)
    sides = np.roll(np.arange(n * (k - 1)).reshape(n, -1), -1, axis=0).ravel() + n
    order = np.concatenate([vertices, sides, np.arange(n * k, n_scalar_dofs(n, k))])
    for a, b in zip(fast(polygon, k, k + 1)[1:], fast(turned, k, k + 1)[1:], strict=True):
        assert b == pytest.approx(a[:, order], abs=1e-10 * np.abs(a).max())


def test_a_batch_is_its_cells_one_by_one():
    polygons = np.stack([SHAPES["pentagon"], SHAPES["regular pentagon"], SHAPES["square, one hanging node"]])
    geometry = PolygonGeometry.of(polygons, 3)
    elliptic = elliptic_projector(geometry, 2)
    grad_x, grad_y = gradient_projector(geometry, 2, 3, elliptic)
    for c, polygon in enumerate(polygons):
        for batch, single in zip((elliptic[c], grad_x[c], grad_y[c]), fast(polygon, 2, 3)[1:], strict=True):
            assert batch == pytest.approx(single, abs=1e-13)


@pytest.mark.parametrize("k", ORDERS)
def test_edge_basis_is_nodal_and_reproduces_polynomials(k):
    nodes, _ = gauss_lobatto(k + 1)
    assert edge_basis(k, nodes) == pytest.approx(np.eye(k + 1), abs=1e-13)
    t = np.linspace(-0.2, 1.2, 7)
    for d in range(k + 1):
        assert edge_basis(k, t) @ nodes**d == pytest.approx(t**d, abs=1e-12)


@pytest.mark.parametrize(("n", "k", "expected"), [(3, 2, 7), (4, 2, 9), (5, 2, 11), (4, 3, 15), (6, 4, 30)])
def test_number_of_degrees_of_freedom(n, k, expected):
    assert n_scalar_dofs(n, k) == expected


@pytest.mark.parametrize("k", ORDERS)
@pytest.mark.parametrize("name", ["pentagon", "U"])
def test_value_projector_reproduces_polynomials_and_keeps_moments(name, k):
    polygon = SHAPES[name]
    oracle = Oracle(polygon, k)
    geometry = PolygonGeometry.of(polygon[None], k)
    projector = value_projector(geometry, k, elliptic_projector(geometry, k))[0]
    dofs = np.array([oracle.dofs_of(oracle.m(p), k) for p in powers(k)]).T
    assert projector @ dofs == pytest.approx(np.eye(len(powers(k))), abs=1e-9)
    for p in powers(k - 2):
        moment = sum(
            projector[j] * integrate_polygon(polygon, product(oracle.m(p), oracle.m(q)), 2 * k)
            for j, q in enumerate(powers(k))
        )
        assert moment == pytest.approx(oracle.moment_row(p), abs=1e-10)


def test_elliptic_projector_does_not_keep_higher_moments():
    """So it must not stand in for the L2 projection in loads, except for k = 2 where the two are the same."""
    for k, same in ((2, True), (3, False)):
        geometry = PolygonGeometry.of(SHAPES["pentagon"][None], k)
        elliptic = elliptic_projector(geometry, k)
        difference = np.abs(value_projector(geometry, k, elliptic) - elliptic).max()
        assert (difference < 1e-10) == same


@pytest.mark.parametrize("k", ORDERS)
def test_degrees_of_freedom_of_monomials(k):
    oracle = Oracle(SHAPES["U"], k)
    expected = np.array([oracle.dofs_of(oracle.m(p), k) for p in powers(k)]).T
    found = dofs_of_monomials(PolygonGeometry.of(SHAPES["U"][None], k), k)[0]
    assert found == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("k", ORDERS)
@pytest.mark.parametrize("name", NAMES)
def test_a_translation_is_one_in_the_first_degrees_of_freedom_and_zero_in_the_others(name, k):
    one = dofs_of_monomials(PolygonGeometry.of(SHAPES[name][None], k), k)[0, :, 0]
    n = n_translated_dofs(len(SHAPES[name]), k)
    if n:
        assert one[:n] == pytest.approx(1.0, abs=1e-14)
        assert one[n:] == pytest.approx(0.0, abs=1e-14)
    else:  # neither one nor zero, so that nothing can be taken out
        assert ((np.abs(one) > 1e-3) & (np.abs(one - 1.0) > 1e-3)).any()
