"""Projection spaces: identities, patch tests, rank on polygons with many collinear nodes, what 'auto' chooses."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_mesh import SHAPES, grid, hanging, mesh_of, regular, subdivide, voronoi
from helpers_oracle import Oracle, powers
from helpers_system import CLAMPED, errors, free_part, interpolate, make_system, region

from tmc_vem.support.errors import InputError
from tmc_vem.vem.spaces import monomials, triangulation
from tmc_vem.vem.spaces.composite import CompositeSpace
from tmc_vem.vem.spaces.element import build_elements
from tmc_vem.vem.spaces.element_settings import ElementSettings
from tmc_vem.vem.spaces.macro import MacroSpace
from tmc_vem.vem.spaces.quadrature import on_triangles, sub_triangles
from tmc_vem.vem.spaces.rules import on_sub_triangles
from tmc_vem.vem.spaces.spaces import FullSpace, HarmonicSpace, Shapes, harmonic_fields
from tmc_vem.vem.spaces.stability import elastic_tangent, stability_constants
from tmc_vem.vem.spaces.tabulated import tabulate

SQUARE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
MANY = {
    "seven hanging nodes on one side": subdivide(SQUARE, [8, 1, 1, 1]),
    "seven on two sides": subdivide(SQUARE, [8, 8, 1, 1]),
    "three on every side": subdivide(SQUARE, [4, 4, 4, 4]),
    "dodecagon": regular(12),
}
POLYGONS = {**SHAPES, **MANY}


def spaces(k):
    return {s.label: s for s in (FullSpace(k + 1), HarmonicSpace(k, k + 2), MacroSpace(k), CompositeSpace(k))}


def rows_of(polygon, k, space, quadrature=None):
    ((_, triangles),) = sub_triangles(polygon[None])
    quadrature = quadrature or 2 * k + 2
    shapes = Shapes.of(polygon[None], triangles, k, space.degree)
    points, weights = on_triangles(triangles, quadrature)
    geometry = shapes.geometry
    xi = (points - geometry.centroid_cx[:, None]) / geometry.diameter_c[:, None, None]
    piecewise = space.piecewise_degree is not None
    pieces = np.repeat(np.arange(triangles.shape[1]) * piecewise, weights.shape[1] // triangles.shape[1])
    return space.gradients(shapes).rows(geometry.diameter_c, xi, pieces)[0], points[0], weights[0]


@pytest.mark.parametrize("name", POLYGONS)
@pytest.mark.parametrize("k", [2, 3])
def test_derivatives_of_polynomials_are_exact(name, k):
    oracle = Oracle(POLYGONS[name], k)
    for space in spaces(k).values():
        rows, points, _ = rows_of(POLYGONS[name], k, space)
        x, y = points.T
        for a, b in powers(k):
            found = rows @ oracle.dofs_of(lambda x, y, a=a, b=b: x**a * y**b, k)
            d1, d2 = a * x ** max(a - 1, 0) * y**b, b * x**a * y ** max(b - 1, 0)
            d11, d22 = a * (a - 1) * x ** max(a - 2, 0) * y**b, b * (b - 1) * x**a * y ** max(b - 2, 0)
            d12 = a * b * x ** max(a - 1, 0) * y ** max(b - 1, 0)
            expected = np.stack([d1, d2, d11, d12, d12, d22], axis=1)
            # the macro space solves with a basis of its kernel, ill conditioned next to many nodes
            assert found == pytest.approx(expected, abs=1e-4 if space.label == "macro" else 1e-9), space.label


@pytest.mark.parametrize("name", POLYGONS)
def test_projections_satisfy_their_definition(name):
    """``int p . Pi grad v = int_dE (p . n) v - int_E (div p) v`` for p that all spaces contain: [P_1]^2."""
    k, polygon = 2, POLYGONS[name]
    reference, points, weights = rows_of(polygon, k, FullSpace(1))
    for space in (FullSpace(3), HarmonicSpace(2, 4), MacroSpace(2), CompositeSpace(2)):
        rows, _, _ = rows_of(polygon, k, space)
        for p in (np.ones(len(points)), points[:, 0], points[:, 1]):
            for x in (0, 1):
                found, expected = (p * weights) @ rows[:, x], (p * weights) @ reference[:, x]
                assert found == pytest.approx(expected, abs=1e-6), space.label


@pytest.mark.parametrize("name", ["square", "pentagon", "U", "seven hanging nodes on one side"])
@pytest.mark.parametrize("k", [2, 3])
def test_composite_gradient_is_that_of_a_continuous_function_with_the_given_traces(name, k):
    """Around every sub-triangle the gradient is curl-free, and its boundary values are those of v: by Stokes,
    ``int curl(q) . grad w = int_dE w dq/dt`` for smooth q, which is known from the degrees of freedom."""
    polygon = POLYGONS[name]
    rows, points, weights = rows_of(polygon, k, CompositeSpace(k), 10)
    exact, _, _ = rows_of(polygon, k, FullSpace(4), 10)
    for a, b in powers(4):  # p = (dq/dy, -dq/dx) has no divergence: interior moments do not enter
        x, y = points.T
        p = (b * x**a * y ** max(b - 1, 0), -a * x ** max(a - 1, 0) * y**b)
        found, expected = (sum((weights * p[i]) @ r[:, i] for i in (0, 1)) for r in (rows, exact))
        assert found == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("parts", [(1, 1, 1, 1), (2, 1, 1, 1), (4, 1, 2, 1), (8, 8, 1, 1)])
def test_composite_functions_contain_the_serendipity_polynomials_of_a_rectangle(parts):
    """x^2 y and x y^2 have degree 2 on every side. A crushed layer needs them: its stretch varies along it."""
    polygon = subdivide(SQUARE, parts) * [2.0, 0.5]
    rows, points, _ = rows_of(polygon, 2, CompositeSpace(2))
    x, y = points.T
    oracle = Oracle(polygon, 2)
    for a, b in ((2, 1), (1, 2)):
        found = rows[:, :2] @ oracle.dofs_of(lambda x, y, a=a, b=b: x**a * y**b, 3)
        expected = np.stack([a * x ** (a - 1) * y**b, b * x**a * y ** (b - 1)], axis=1)
        assert found == pytest.approx(expected, abs=1e-10)


@pytest.mark.parametrize("parts", [(2, 1, 1, 1), (4, 1, 1, 1), (8, 1, 2, 1), (4, 4, 4, 4)])
def test_hanging_nodes_do_not_stiffen_a_composite_square(parts):
    """A displacement without hanging nodes has no more energy with them, where they follow it along the sides."""
    plain, fine = np.array(SQUARE), subdivide(SQUARE, parts)
    plain_dofs, fine_dofs = Oracle(plain, 2), Oracle(fine, 2)
    polynomials = [*powers(2), (2, 1), (1, 2)]  # they span all boundary values of the plain square
    bubble = lambda x, y: x * (1 - x) * y * (1 - y)  # noqa: E731
    functions = [lambda x, y, a=a, b=b: x**a * y**b for a, b in polynomials] + [bubble]
    energies = []
    for polygon, oracle in ((plain, plain_dofs), (fine, fine_dofs)):
        rows, _, weights = rows_of(polygon, 2, CompositeSpace(2))
        gradient = np.moveaxis(rows[None, :, :2], 2, 0)
        tangent = elastic_tangent(gradient, gradient * weights[None, :, None])[0]
        dofs = np.stack([oracle.dofs_of(f, 4) for f in functions], axis=1)
        both = np.kron(np.eye(2), dofs)
        energies.append(both.T @ tangent @ both)
    difference = np.linalg.eigvalsh(energies[0] - energies[1])
    assert difference.min() > -1e-10


@pytest.mark.parametrize("projection", ["auto", "macro", "composite"])
@pytest.mark.parametrize("name", MANY)
def test_full_rank_and_good_condition_with_many_nodes(projection, name):
    (group,) = build_elements(mesh_of(MANY[name]), ElementSettings(projection=projection))
    rows = np.moveaxis(group.tables.rows(2), 2, 0)
    eigenvalues = np.linalg.eigvalsh(elastic_tangent(rows, rows * group.tables.w_sq[..., None]))[0]
    assert np.abs(eigenvalues[:3]).max() < 1e-12 * eigenvalues[-1]
    assert eigenvalues[3] > 1e-4 * eigenvalues[-1]


@pytest.mark.parametrize("k", [2, 3])
def test_composite_elements_are_as_stiff_as_the_stabilised_one(k):
    for name, polygon in POLYGONS.items():
        ((_, triangles),) = sub_triangles(polygon[None])
        rule = on_sub_triangles(triangles, 2 * k)
        tables = tabulate(Shapes.of(polygon[None], triangles, k, k), CompositeSpace(k), rule)
        assert stability_constants(polygon[None], tables, k)[0, 0] > 0.05, name


def test_auto_keeps_full_polynomials_on_plain_cells_only():
    def projection(polygon, **more):
        return build_elements(mesh_of(polygon), ElementSettings(**more))[0].projection

    assert projection(SHAPES["triangle"]) == "2"
    assert projection(SHAPES["square"]) == projection(SHAPES["quadrilateral"]) == projection(SHAPES["pentagon"]) == "3"
    for name in ("square, one hanging node", "square, three hanging nodes on one edge", "hexagon"):
        assert projection(SHAPES[name]) == "composite"
        assert projection(SHAPES[name], projection="full").isdigit()
        assert projection(SHAPES[name], projection="macro") == "macro"
    assert projection(SHAPES["square"], projection="harmonic") == "harmonic 2+1"
    assert projection(SHAPES["square, one hanging node"], degree=3) == "3"


def test_unknown_and_contradictory_settings_are_refused():
    with pytest.raises(InputError, match="unknown projection 'best': choose one of auto, full"):
        ElementSettings(projection="best")
    with pytest.raises(InputError, match="a degree l belongs to the projection 'full'"):
        ElementSettings(degree=3, projection="macro")


@pytest.mark.parametrize("projection", ["auto", "harmonic", "macro", "composite"])
@pytest.mark.parametrize("mesh", [voronoi(12), hanging(2, 0.03), grid(3, 2)], ids=["Voronoi", "hanging", "grid"])
def test_patch_test(projection, mesh):
    """A linear displacement is in balance, and its gradient exact."""
    system = make_system(mesh, region("solid", K=5.0, mu=2.0), CLAMPED, ElementSettings(projection=projection))
    matrix = np.array([[0.1, 0.2], [-0.1, 0.05]])
    u = interpolate(system, lambda p: p @ matrix.T)
    out = system.create_vector()
    system.residual(u, out)
    assert np.abs(free_part(system, out)).max() < 1e-8
    exact = errors(system, u, lambda p: p @ matrix.T, lambda p: np.broadcast_to(matrix, (len(p), 2, 2)))
    assert exact == pytest.approx((0.0, 0.0), abs=1e-8)


def test_harmonic_fields_have_neither_divergence_nor_curl():
    p_xi, p_eta = harmonic_fields(2, 6)
    d_xi, d_eta = monomials.derivative_matrices(6)
    assert p_xi.shape == (2 * 6 + 2 * 4, monomials.dimension(6))
    added = slice(12, None)
    assert (p_xi @ d_xi + p_eta @ d_eta)[added] == pytest.approx(0.0)
    assert (p_xi @ d_eta - p_eta @ d_xi)[added] == pytest.approx(0.0)


@pytest.mark.parametrize("degree", [2, 3, 4])
def test_bernstein_polynomials(degree):
    points = np.random.default_rng(0).dirichlet([1, 1, 1], 7)
    assert triangulation.bernstein(degree, points).sum(axis=1) == pytest.approx(1.0)
    step, slopes = 1e-6, triangulation.bernstein_gradients(degree, points)
    for p in range(3):
        shift = step * np.eye(3)[p]
        values = [triangulation.bernstein(degree, points + sign * shift) for sign in (1, -1)]
        assert slopes[:, :, p] == pytest.approx((values[0] - values[1]) / (2 * step), abs=1e-6)


def test_piecewise_polynomials_are_numbered_once():
    corners = np.array([[4, 0, 1], [4, 1, 2], [4, 2, 3], [4, 3, 0]])
    numbers, total = triangulation.coefficient_numbers(corners, 4, 3)
    assert sorted(set(numbers.ravel().tolist())) == list(range(total))
    assert total == 4 * 3 + 1 + 4 * 2 + 4
