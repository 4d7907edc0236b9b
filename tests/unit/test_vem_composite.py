"""Composite functions against their definition, solved for one cell at a time without any structure."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_mesh import SHAPES, subdivide

from tmc_vem.mesh import PolygonMesh
from tmc_vem.vem.spaces import monomials, triangulation
from tmc_vem.vem.spaces.composite import CompositeSpace
from tmc_vem.vem.spaces.element import build_elements
from tmc_vem.vem.spaces.element_settings import ElementSettings
from tmc_vem.vem.spaces.projector import edge_basis, moments_of_basis
from tmc_vem.vem.spaces.quadrature import PieceRule, sub_triangles, triangle
from tmc_vem.vem.spaces.spaces import FullSpace, Shapes

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
    rows = CompositeSpace(k).gradients(shapes).rows_of_rule(PieceRule(BARYCENTRIC, np.full(4, 0.25)))
    rows = rows.reshape(2, -1, len(BARYCENTRIC), 2, shapes.n_basis)
    for s, one in enumerate(polygons):
        found = rows[s] * shapes.geometry.diameter_c[s]
        expected, rounding = gradient_by_definition(one, k)
        assert np.abs(found - expected).max() < 10 * rounding * np.abs(expected).max()


@pytest.mark.parametrize("name", POLYGONS)
@pytest.mark.parametrize("k", [2, 3])
def test_values_rows_and_polynomials_say_the_same(name, k):
    """At points given by coordinates, at those of a rule, and for displacements instead of the basis."""
    rng = np.random.default_rng(k)
    polygon = np.array(POLYGONS[name], dtype=float)
    shapes = shapes_of(np.stack([polygon, 3.0 * polygon @ np.array([[0.8, 0.6], [-0.6, 0.8]])]), k)
    gradients, h_s = CompositeSpace(k).gradients(shapes), shapes.geometry.diameter_c
    rule = PieceRule(BARYCENTRIC, np.full(4, 0.25))
    xi, piece_q = shapes.scaled_points(BARYCENTRIC), np.repeat(np.arange(gradients.n_pieces), len(BARYCENTRIC))
    by_rule, everywhere = gradients.rows_of_rule(rule), gradients.rows(h_s, xi, piece_q)
    size = np.abs(by_rule).max()
    np.testing.assert_allclose(everywhere[:, :, :2], by_rule, rtol=0, atol=1e-12 * size)
    u = rng.normal(size=(2, shapes.n_basis, 2))
    found = (gradients.values(xi) @ gradients.polynomials(u)).reshape(2, len(piece_q), 2, 2)
    np.testing.assert_allclose(found, by_rule @ u[:, None], rtol=0, atol=1e-11 * size)
    taken = gradients.take(np.array([1]))
    np.testing.assert_array_equal(taken.rows_of_rule(rule), by_rule[1:])
    assert taken.nbytes == 8 * (taken.inside_sba.size + taken.corners_sdx.size + taken.second_sxma.size)
    with pytest.raises(ValueError, match="equally many points"):
        gradients.rows(h_s, xi, piece_q[::-1])


def test_second_gradients_are_those_of_the_smooth_field():
    shapes = shapes_of(np.array([POLYGONS["L"]], dtype=float), 2)
    gradients, h_s = CompositeSpace(2).gradients(shapes), shapes.geometry.diameter_c
    xi, piece_q = shapes.scaled_points(BARYCENTRIC), np.repeat(np.arange(gradients.n_pieces), len(BARYCENTRIC))
    smooth = FullSpace(2).gradients(shapes).rows(h_s, xi, np.zeros_like(piece_q))
    np.testing.assert_allclose(gradients.rows(h_s, xi, piece_q)[:, :, 2:], smooth[:, :, 2:], atol=1e-12)


def test_coefficients_on_the_boundary_depend_on_one_side():
    """A vertex on itself, what lies on a side on the values of that side: what kernels read is the whole matrix."""
    for k in (2, 3):
        topology = CompositeSpace(k).gradients(shapes_of(np.array([SQUARE]), k)).topology
        node_bj, value_bj = topology.traces
        again = np.zeros_like(topology.known_ba)
        np.add.at(again, (np.arange(len(node_bj))[:, None], node_bj), value_bj)
        np.testing.assert_array_equal(again, topology.known_ba)
        assert ((value_bj != 0.0).sum(axis=1)[:4] == 1).all()


def test_clipped_ears_are_told_apart():
    """Cells that are not star-shaped may be triangulated differently; each must get what it gets alone."""
    polygon = np.array(SHAPES["U"], dtype=float)
    moved = polygon.copy()
    moved[np.argmax(polygon @ [1.0, 0.2])] += [0.4, 0.3]
    polygons = np.stack([polygon, polygon[np.roll(np.arange(len(polygon)), 3)], moved])
    shapes = shapes_of(polygons, 2)
    assert len(triangulation.equal_topologies(shapes.polygons_cvx, shapes.triangles_ctpx)) > 1
    with pytest.raises(ValueError, match="hang together in"):
        CompositeSpace(2).gradients(shapes)
    cells = np.arange(polygons.shape[0] * polygons.shape[1]).reshape(len(polygons), -1)
    apart = polygons + np.array([0.0, 20.0, 40.0])[:, None, None]
    mesh = PolygonMesh.from_cells(apart.reshape(-1, 2), cells.tolist())
    groups = build_elements(mesh, ElementSettings(projection="composite"))
    assert len(groups) > 1
    for group in groups:
        for c, s in zip(group.cells, group.shape_c, strict=True):
            alone = CompositeSpace(2).gradients(shapes_of(polygons[c : c + 1], 2))
            found = group.tables.gradients.take(np.array([s]))
            assert found.topology is alone.topology
            np.testing.assert_allclose(found.inside_sba, alone.inside_sba, rtol=0, atol=1e-10)
