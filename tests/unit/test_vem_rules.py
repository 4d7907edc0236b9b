"""Quadrature rules with few points: exact, positive, few, inside; the same numbers whoever else is in the batch."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_mesh import SHAPES, regular, voronoi
from helpers_oracle import powers

from tmc_vem.vem.point_weights import _projection
from tmc_vem.vem.spaces.candidates import cell_rule
from tmc_vem.vem.spaces.composite import CompositeSpace
from tmc_vem.vem.spaces.element_settings import ElementSettings
from tmc_vem.vem.spaces.macro import MacroSpace
from tmc_vem.vem.spaces.quadrature import SYMMETRIC, fan, on_triangles, sub_triangles, triangle
from tmc_vem.vem.spaces.rules import compressed, convex, on_sub_triangles
from tmc_vem.vem.spaces.spaces import FullSpace, HarmonicSpace, Shapes
from tmc_vem.vem.spaces.stability import stability_constants
from tmc_vem.vem.spaces.tabulated import tabulate

POLYGONS = {**SHAPES, "octagon": regular(8), "decagon": regular(10)}
DART = np.array([(0.0, 0.0), (2.0, 0.0), (0.7, 0.6), (0.0, 2.0)])


@pytest.mark.parametrize("degree", [2, 4, 5, 7])
@pytest.mark.parametrize("name", [*POLYGONS, "dart"])
def test_compressed_rules_are_exact_positive_and_small(name, degree):
    polygon = DART if name == "dart" else POLYGONS[name]
    ((_, triangles),) = sub_triangles(polygon[None])
    rule = compressed(polygon[None], triangles, degree)
    points, weights = on_triangles(triangles, degree)
    assert (rule.w_sq > 0.0).all()
    assert rule.w_sq.shape[1] <= (degree + 1) * (degree + 2) // 2 or len(polygon) <= 4
    assert rule.w_sq.shape[1] <= weights.shape[1]
    for a, b in powers(degree):
        found = (rule.w_sq * rule.points_sqx[..., 0] ** a * rule.points_sqx[..., 1] ** b).sum()
        size = (weights * np.abs(points[..., 0] ** a * points[..., 1] ** b)).sum()
        expected = (weights * points[..., 0] ** a * points[..., 1] ** b).sum()
        assert found == pytest.approx(expected, abs=1e-13 * size), (a, b)
    assert not rule.piece_q.any()
    assert (rule.points_sqx.min(axis=1) >= polygon.min(axis=0)).all()
    assert (rule.points_sqx.max(axis=1) <= polygon.max(axis=0)).all()


def test_quadrilaterals_get_the_product_rule_where_they_are_convex():
    square, trapezoid = np.array([(0, 0), (1, 0), (1, 1), (0, 1.0)]), np.array([(0, 0), (3, 0), (2, 1), (0.5, 1.0)])
    assert convex(np.stack([square, trapezoid, DART])).tolist() == [True, True, False]
    both = np.stack([square, trapezoid])
    ((_, triangles),) = sub_triangles(both)
    rule = compressed(both, triangles, 4)
    assert rule.w_sq.shape == (2, 9)
    assert rule.points_sqx[0].mean(axis=0) == pytest.approx([0.5, 0.5])
    assert sorted(rule.w_sq[0] * 324) == pytest.approx([25] * 4 + [40] * 4 + [64])


def test_a_rule_does_not_depend_on_the_other_cells():
    mesh = voronoi(60)
    cells = [c for c in range(mesh.n_cells) if mesh.n_sides_c[c] == 5]
    polygons = mesh.points_vx[np.stack([mesh.cell(c) for c in cells])]
    ((_, triangles),) = sub_triangles(polygons)
    together = compressed(polygons, triangles, 4)
    for n in (0, len(cells) - 1):
        alone = compressed(polygons[n : n + 1], triangles[n : n + 1], 4)
        np.testing.assert_array_equal(alone.points_sqx[0], together.points_sqx[n])
        np.testing.assert_array_equal(alone.w_sq[0], together.w_sq[n])


def test_points_of_sub_triangles_know_their_piece():
    polygon = regular(6)[None]
    ((_, triangles),) = sub_triangles(polygon)
    rule = on_sub_triangles(triangles, 2)
    assert rule.piece_q.tolist() == [t for t in range(6) for _ in range(3)]
    for q, piece in enumerate(rule.piece_q):
        coordinates = np.linalg.solve(np.vstack([triangles[0, piece].T, np.ones(3)]), [*rule.points_sqx[0, q], 1.0])
        assert (coordinates > 0.0).all()


@pytest.mark.parametrize("name", [name for name in POLYGONS if len(POLYGONS[name]) < 9])
@pytest.mark.parametrize("k", [2, 3])
def test_few_points_keep_elements_as_stable_as_many(k, name):
    """Stability constants with the compressed rule against those with the full rule on every sub-triangle."""
    polygon = POLYGONS[name][None]
    ((_, triangles),) = sub_triangles(polygon)
    for space in (FullSpace(k), FullSpace(k + 1), HarmonicSpace(k, k + 2), CompositeSpace(k), MacroSpace(k)):
        shapes, found = Shapes.of(polygon, triangles, k, space.degree), []
        for rule in ("compressed", "triangles"):
            chosen = cell_rule(ElementSettings(k, rule=rule), space, polygon, triangles)
            found.append(stability_constants(polygon, tabulate(shapes, space, chosen), k)[0, 0])
        assert found[0] > 0.4 * found[1] - 1e-8, space.label


def test_the_default_takes_few_points_on_quadrilaterals_only():
    for polygon, points in ((SHAPES["triangle"], 6), (SHAPES["square"], 16), (SHAPES["pentagon"], 30), (DART, 0)):
        ((_, triangles),) = sub_triangles(polygon[None])
        rule = cell_rule(ElementSettings(), FullSpace(3), polygon[None], triangles)
        assert rule.w_sq.shape == (1, 6 * triangles.shape[1] if polygon is DART else points)
        few = cell_rule(ElementSettings(rule="compressed"), FullSpace(3), polygon[None], triangles)
        assert few.w_sq.shape[1] <= 15
        piecewise = cell_rule(ElementSettings(rule="compressed"), CompositeSpace(2), polygon[None], triangles)
        assert piecewise.w_sq.shape[1] == 6 * triangles.shape[1]


def test_triangles_without_a_hub_are_cut_in_three_where_a_rule_singles_out_a_corner():
    """Fans from a hub are not, nor where the rule is symmetric."""
    square = np.array([[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]])
    two = np.stack([square[:, [0, 1, 2]], square[:, [0, 2, 3]]], axis=1)
    for triangles, degree, pieces in ((two, SYMMETRIC, 2), (two, SYMMETRIC + 1, 6), (fan(square), SYMMETRIC + 1, 4)):
        points, weights = on_triangles(triangles, degree)
        assert points.shape[1] == weights.shape[1] == pieces * len(triangle(degree)[1])
        assert weights.sum() == pytest.approx(1.0)


def test_no_polygons_have_no_values():
    assert _projection(np.empty((0, 4, 2)), 2, np.empty((0, 2))).shape == (0, 9)
