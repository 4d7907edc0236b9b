"""Composite functions against their definition, solved for one cell at a time without any structure."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_mesh import SHAPES, subdivide

from tmc_vem.vem.spaces import monomials, triangulation
from tmc_vem.vem.spaces.composite import CompositeSpace
from tmc_vem.vem.spaces.potential import gradient_of_potential, potential_of_gradient
from tmc_vem.vem.spaces.projector import edge_basis, moments_of_basis
from tmc_vem.vem.spaces.quadrature import sub_triangles, triangle
from tmc_vem.vem.spaces.spaces import Shapes

SQUARE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
POLYGONS = {**SHAPES, "three hanging nodes on two sides": subdivide(SQUARE, [4, 4, 1, 1])}
BARYCENTRIC = np.array([[0.6, 0.3, 0.1], [0.2, 0.2, 0.6], [1 / 3, 1 / 3, 1 / 3], [0.05, 0.9, 0.05]])


def shapes_of(polygons, k):
    ((_, triangles),) = sub_triangles(polygons)
    return Shapes.of(polygons, triangles, k, k + 1)


def gradient_by_definition(polygon, k):
    """Gradients (n_triangles, n_points, 2, n_basis) at ``BARYCENTRIC``, in scaled coordinates, and their rounding.

    On every sub-triangle a polynomial of its own; continuity, traces and moments are all constraints of one
    minimisation. The constraints are solved with the condition number of their matrix. The minimisation has that of the
    energy on what they leave free, of which a gradient sees the root: what has little energy has little gradient.
    """
    shapes = shapes_of(polygon[None], k)
    xi, corners = shapes.geometry.xi_cvx[0], shapes.scaled_triangles[0]
    n_sides, n_t, n_m = len(xi), len(corners), monomials.dimension(k + 1)
    values = lambda points: monomials.values(k + 1, points[None])[0]  # noqa: E731
    slopes = lambda points: np.stack([values(points) @ d.T for d in monomials.derivative_matrices(k + 1)], axis=1)  # noqa: E731

    def row(t, entries):
        full = np.zeros((len(entries), n_t, n_m))
        full[:, t] = entries
        return full.reshape(len(entries), -1)

    s = np.linspace(0.0, 1.0, k + 2)
    ends = {}
    for t, corner in enumerate(corners):
        for side in range(3):
            a, b = corner[side], corner[(side + 1) % 3]
            ends.setdefault(tuple(sorted([tuple(np.round(a, 10)), tuple(np.round(b, 10))])), []).append((t, a, b))
    constraints, targets = [], []
    for sides in ends.values():
        (t, a, b), *other = sides
        points = a + s[:, None] * (b - a)
        entries = row(t, values(points))
        if other:
            constraints.append(entries - row(other[0][0], values(points)))
            targets.append(np.zeros((len(s), shapes.n_basis)))
            continue
        first = int(np.abs(xi - a).max(axis=1).argmin())
        trace = np.zeros((len(s), shapes.n_basis))
        inside = n_sides + first * (k - 1) + np.arange(k - 1)
        trace[:, [first, *inside, (first + 1) % n_sides]] = edge_basis(k, s)
        constraints.append(entries)
        targets.append(trace)
    barycentric, weights = triangle(2 * k + 2)
    root = np.zeros((n_t, 2 * len(weights), n_t, n_m))  # of the stiffness, which would square the condition
    moments = []
    for t, corner in enumerate(corners):
        points, (u, v) = barycentric @ corner, corner[1:] - corner[0]
        w = weights * 0.5 * (u[0] * v[1] - u[1] * v[0])
        root[t, :, t] = (np.sqrt(w)[:, None, None] * slopes(points)).reshape(-1, n_m)
        moments.append(monomials.values(k - 1, points[None])[0].T @ (w[:, None] * values(points)))
    constraints.append(np.concatenate(moments, axis=1))
    targets.append(moments_of_basis(shapes.geometry, k, k - 1, shapes.elliptic_cad)[0])
    C, d = np.concatenate(constraints), np.concatenate(targets)
    left, singular, right = np.linalg.svd(C)
    rank = int((singular > 1e-9 * singular[0]).sum())
    known = right[:rank].T @ ((left[:, :rank].T @ d) / singular[:rank, None])
    assert C @ known == pytest.approx(d, abs=1e-10)  # the constraints can be met
    free, S = right[rank:].T, root.reshape(-1, n_t * n_m)
    coefficients = known - free @ np.linalg.lstsq(S @ free, S @ known, rcond=None)[0]
    rounding = np.finfo(float).eps * (singular[0] / singular[rank - 1] + np.linalg.cond(S @ free))
    coefficients = coefficients.reshape(n_t, n_m, -1)
    gradients = np.stack([slopes(BARYCENTRIC @ corner) @ c for corner, c in zip(corners, coefficients, strict=True)])
    return gradients, rounding


@pytest.mark.parametrize("name", POLYGONS)
@pytest.mark.parametrize("k", [2, 3])
def test_the_gradient_is_that_of_the_minimiser(name, k):
    polygon = np.array(POLYGONS[name], dtype=float)
    polygons = np.stack([polygon, polygon * [1.7, 0.8] @ np.array([[0.8, 0.6], [-0.6, 0.8]]) + [3.0, -1.0]])
    shapes = shapes_of(polygons, k)
    gradients = CompositeSpace(k).gradients(shapes).first_stxma
    xi = shapes.scaled_points(BARYCENTRIC).reshape(2, -1, len(BARYCENTRIC), 2)
    for s, one in enumerate(polygons):
        m = monomials.values(k, xi[s])
        found = np.moveaxis(m[:, None] @ gradients[s], 1, 2) * shapes.geometry.diameter_c[s]
        expected, rounding = gradient_by_definition(one, k)
        assert np.abs(found - expected).max() < 10 * rounding * np.abs(expected).max()


def test_powers_of_affine_functions():
    linear = np.random.default_rng(1).normal(size=(3, 2, 5))
    points = np.random.default_rng(2).normal(size=(5, 7, 2))
    s, t = (linear[0, p, :, None] + points[..., 0] * linear[1, p, :, None] + points[..., 1] * linear[2, p, :, None]
            for p in (0, 1))  # fmt: skip
    powers = triangulation.affine_powers(4, linear)
    expected = monomials.values(4, np.stack([s, t], axis=-1))
    found = np.einsum("jmn,nqm->nqj", powers, monomials.values(4, points))
    assert found == pytest.approx(expected, abs=1e-9)


def test_clipped_ears_are_told_apart():
    """Cells that are not star-shaped may be triangulated differently; each must get what it gets alone."""
    polygon = np.array(SHAPES["U"], dtype=float)
    moved = polygon.copy()
    moved[np.argmax(polygon @ [1.0, 0.2])] += [0.4, 0.3]
    polygons = np.stack([polygon, polygon[np.roll(np.arange(len(polygon)), 3)], moved])
    shapes = shapes_of(polygons, 2)
    assert len(triangulation.equal_topologies(shapes.polygons_cvx, shapes.triangles_ctpx)) > 1
    together = CompositeSpace(2).gradients(shapes).first_stxma
    for s in range(len(polygons)):
        alone = CompositeSpace(2).gradients(shapes_of(polygons[s : s + 1], 2)).first_stxma
        np.testing.assert_allclose(together[s : s + 1], alone, rtol=0, atol=1e-12 * np.abs(alone).max())


@pytest.mark.parametrize("k", [2, 3])
def test_gradients_have_a_potential_on_every_sub_triangle(k):
    """So blocks keep that potential: what they give back is the gradient."""
    for polygon in POLYGONS.values():
        shapes = shapes_of(np.array([polygon], dtype=float), k)
        gradients, h = CompositeSpace(k).gradients(shapes), shapes.geometry.diameter_c
        assert gradients.has_potential
        first = gradients.first_stxma
        again = gradient_of_potential(potential_of_gradient(first, h), h)
        np.testing.assert_allclose(again, first, rtol=0, atol=1e-10 * np.abs(first).max())
