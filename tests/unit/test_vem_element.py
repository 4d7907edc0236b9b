"""Elements: rank by the spectral test, the choice of l, messages, sharing between congruent cells."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_mesh import SHAPES, SQUARE_IN_THREE, grid, hanging, mesh_of, regular, voronoi
from helpers_oracle import Oracle, powers

from tmc_vem.support.errors import InputError
from tmc_vem.vem.spaces.candidates import STABLE, first_candidate
from tmc_vem.vem.spaces.composite import CompositeSpace
from tmc_vem.vem.spaces.element import build_elements, congruence_classes
from tmc_vem.vem.spaces.element_settings import ElementSettings
from tmc_vem.vem.spaces.quadrature import sub_triangles
from tmc_vem.vem.spaces.rules import compressed, on_sub_triangles
from tmc_vem.vem.spaces.spaces import FullSpace, Shapes
from tmc_vem.vem.spaces.stability import StabilityTest, element_tangent, positive_definite, stability_constants
from tmc_vem.vem.spaces.tabulated import points_and_values, tabulate

# Smallest l of full rank for k = 2. Those of squares, pentagons, halved triangles and hanging nodes are known from
# spectra computed elsewhere; the counting rule N <= 2 l - 2 k + 5 promises less for all of them.
SMALLEST_DEGREE = {
    "square": 3,
    "pentagon": 3,
    "regular pentagon": 3,
    "triangle, halved sides": 4,
    "square, hanging node on every edge": 5,
    "square, three hanging nodes on one edge": 6,
    "square, sides in three": 7,
}
ALL_SHAPES = {**SHAPES, "square, sides in three": SQUARE_IN_THREE}


def tables_of(polygon, k, degree):
    ((_, triangles),) = sub_triangles(polygon[None])
    return tabulate(
        Shapes.of(polygon[None], triangles, k, degree), FullSpace(degree), on_sub_triangles(triangles, 2 * k)
    )


def rank_deficit(tables):
    """2 n_dof - rank of the matrix of all strains at all points, by singular values: nothing but linear algebra."""
    d1, d2 = np.moveaxis(tables.rows(2)[0], 1, 0)
    zero = np.zeros_like(d1)
    strain = np.vstack([np.hstack([d1, zero]), np.hstack([zero, d2]), np.hstack([d2, d1])])
    singular = np.linalg.svd(strain, compute_uv=False)
    singular = np.pad(singular, (0, max(0, strain.shape[1] - len(singular))))
    return int((singular < 1e-6 * singular[0]).sum())


def test_the_memory_of_tables_is_that_of_their_arrays():
    for degree in (2, 3):
        tables = tables_of(SHAPES["square"], 2, degree)
        gradients = tables.gradients
        second = 0 if gradients.shared else gradients.second_sxma.size
        parts = (gradients.first_stxma.size, second, tables.w_sq.size, tables.xi_sqx.size, tables.h_s.size)
        assert tables.nbytes == 8 * sum(parts)


@pytest.mark.parametrize(("name", "degree"), SMALLEST_DEGREE.items())
def test_known_degrees_of_full_rank(name, degree):
    (group,) = build_elements(mesh_of(ALL_SHAPES[name]), ElementSettings(projection="full"))
    assert group.degree == degree
    assert rank_deficit(tables_of(ALL_SHAPES[name], 2, degree)) == 3
    for lower in range(1, degree):
        assert rank_deficit(tables_of(ALL_SHAPES[name], 2, lower)) > 3, lower


@pytest.mark.parametrize(
    ("name", "k"),
    [(n, 2) for n in SHAPES] + [(n, 3) for n in SHAPES if "three" not in n] + [(n, 4) for n in ("triangle", "square")],
)
def test_only_rigid_motions_have_no_energy(name, k):
    polygon = SHAPES[name]
    (group,) = build_elements(mesh_of(polygon), ElementSettings(order=k, projection="full"))
    assert rank_deficit(tables_of(polygon, k, group.degree)) == 3

    def smallest_constant(degree):
        return stability_constants(polygon[None], tables_of(polygon, k, degree), k)[0, 0]

    assert smallest_constant(group.degree) >= STABLE
    lower = range(first_candidate(len(polygon), k), group.degree)
    assert all(smallest_constant(degree) < STABLE for degree in lower)  # the smallest that does


def test_l_2_on_squares_is_refused_with_the_remedy():
    assert rank_deficit(tables_of(SHAPES["square"], 2, 2)) == 5
    with pytest.raises(InputError, match=r"cell 0 has 4 vertices: l = 2 leaves 2 spurious modes; use l >= 3"):
        build_elements(grid(3, 2), ElementSettings(degree=2))
    names = np.arange(6) + 70
    with pytest.raises(InputError, match=r"cell 7\d has 4 vertices: l = 2"):
        build_elements(grid(3, 2), ElementSettings(degree=2), names)
    (group,) = build_elements(grid(3, 2), ElementSettings(degree=3))
    assert group.degree == 3


def test_number_of_spurious_modes_in_the_message_is_right():
    polygon = ALL_SHAPES["square, hanging node on every edge"]
    for degree in (2, 3, 4):
        spurious = rank_deficit(tables_of(polygon, 2, degree)) - 3
        message = rf"l = {degree} leaves {spurious} spurious modes?; use l >= 5"
        with pytest.raises(InputError, match=message):
            build_elements(mesh_of(polygon), ElementSettings(degree=degree))


def test_cells_without_any_degree_are_refused():
    with pytest.raises(
        InputError, match=r"cell 0 has 7 vertices and spurious modes for every l up to 8: leave .* 'auto'"
    ):
        build_elements(
            mesh_of(SHAPES["square, three hanging nodes on one edge"]), ElementSettings(order=3, projection="full")
        )
    with pytest.raises(InputError, match=r"cell 0 has 7 vertices"):
        build_elements(mesh_of(SHAPES["square, three hanging nodes on one edge"]), ElementSettings(order=3, degree=4))


def test_no_degree_is_even_tried_on_very_many_sides():
    """(40) asks for l > 8 from 18 sides on."""
    for n_sides in (18, 40):
        with pytest.raises(InputError, match=rf"cell 0 has {n_sides} vertices and spurious modes for every l up to 8"):
            build_elements(mesh_of(regular(n_sides)), ElementSettings(projection="full"))
        (group,) = build_elements(mesh_of(regular(n_sides)), ElementSettings())
        assert group.projection == "composite"


@pytest.mark.parametrize("stretch", [1.0, 3.0, 30.0, 200.0])
def test_slender_cells_get_the_degree_of_their_shape(stretch):
    for name, degree in (("square", 3), ("triangle", 2), ("square, hanging node on every edge", 5)):
        (group,) = build_elements(mesh_of(SHAPES[name] * [1.0, 1.0 / stretch]), ElementSettings(projection="full"))
        assert group.degree == degree


@pytest.mark.parametrize("turn", np.linspace(0.0, np.pi / 2, 5))
@pytest.mark.parametrize("size", [1e-4, 1.0, 1e4])
def test_degree_does_not_depend_on_size_and_direction(turn, size):
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    for name, degree in SMALLEST_DEGREE.items():
        (group,) = build_elements(mesh_of(size * ALL_SHAPES[name] @ rotation.T), ElementSettings(projection="full"))
        assert group.degree == degree, name


@pytest.mark.parametrize("bend", [1e-9, 1e-5, 1e-3, 1e-2])
def test_nearly_deficient_shapes_get_the_degree_of_the_deficient_one(bend):
    """A hanging node a little off its side leaves a mode with hardly any energy, which is as bad as none."""
    for name in ("square, hanging node on every edge", "square, one hanging node", "square"):
        polygon = ALL_SHAPES[name].copy()
        polygon[1] += np.array([0.3, -1.0]) * bend
        (group,) = build_elements(mesh_of(polygon), ElementSettings(projection="full"))
        assert group.degree == (5 if "every" in name else 3), name


@pytest.mark.parametrize("k", [2, 3])
def test_stability_constants_do_not_depend_on_size_place_and_numbering(k):
    polygon = SHAPES["pentagon"]
    expected = stability_constants(polygon[None], tables_of(polygon, k, k + 1), k)[0]
    assert expected[-1] < 30.0  # the reference is comparable, not only of full rank
    for other in (polygon * 1e-3, polygon + 50.0, polygon[[2, 3, 4, 0, 1]]):
        found = stability_constants(other[None], tables_of(other, k, k + 1), k)[0]
        assert found == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("k", [2, 3, 4])
@pytest.mark.parametrize("degree", [None, 2, 20])
def test_quadrature_is_exact_for_projected_gradients(k, degree):
    """Else constant stresses would be out of balance where l is high."""
    settings = ElementSettings(order=k, quadrature=degree)
    for projection in range(k - 1, 9):
        assert settings.rule_degree(projection) >= projection
        assert settings.rule_degree(projection) >= settings.quadrature_degree
        if degree is None:
            assert settings.rule_degree(projection) >= projection + k - 1


@pytest.mark.parametrize("edge", [0.3, 0.1, 0.03])
def test_short_edges_are_no_spurious_modes(edge):
    polygon = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (edge, 1.0), (0.0, 1.0 - edge)])
    (group,) = build_elements(mesh_of(polygon), ElementSettings(projection="full"))
    assert group.degree == 3


@pytest.mark.parametrize("k", [2, 3])
def test_group_tables_reproduce_polynomials_at_every_point(k):
    """Rows of B on the degrees of freedom of P_k are its first and second derivatives, in the order of Appendix C."""
    mesh = voronoi(9)
    for group in build_elements(mesh, ElementSettings(order=k, projection="full")):
        for c, s in zip(group.cells.tolist(), group.shape_c.tolist(), strict=True):
            polygon = mesh.points_vx[mesh.cell(c)]
            oracle = Oracle(polygon, k)
            all_points, values = points_and_values(polygon[None], k, group.tables.xi_sqx[s : s + 1])
            points, rows = all_points[0], group.tables.rows()[s]
            for p in powers(k):
                dofs = oracle.dofs_of(lambda x, y, p=p: x ** p[0] * y ** p[1], k)
                found = rows @ dofs
                x, y = points.T
                a, b = p
                d1 = a * x ** max(a - 1, 0) * y**b
                d2 = b * x**a * y ** max(b - 1, 0)
                d11 = a * (a - 1) * x ** max(a - 2, 0) * y**b
                d22 = b * (b - 1) * x**a * y ** max(b - 2, 0)
                d12 = a * b * x ** max(a - 1, 0) * y ** max(b - 1, 0)
                assert found == pytest.approx(np.stack([d1, d2, d11, d12, d12, d22], axis=1), abs=1e-8)
                assert values[0] @ dofs == pytest.approx(x**a * y**b, abs=1e-10)


def test_second_derivatives_differentiate_the_projected_gradient():
    """d_j of row i, by differences of the polynomial through the points: rows 2 to 5 are (d1 d1, d2 d1... first index
    fastest), and mixed ones differ, as the projected gradient is not curl-free."""
    polygon = SHAPES["pentagon"]
    tables = tables_of(polygon, 2, 3)
    points = tables.xi_sqx[0] * tables.h_s[0]
    V = np.array([[x**a * y**b for a, b in powers(3)] for x, y in points])
    Vx = np.array([[a * x ** max(a - 1, 0) * y**b for a, b in powers(3)] for x, y in points])
    Vy = np.array([[b * x**a * y ** max(b - 1, 0) for a, b in powers(3)] for x, y in points])
    rows = tables.rows()[0]
    along_x, along_y = (np.linalg.lstsq(V, rows[:, i], rcond=None)[0] for i in (0, 1))
    # G[i][j][k] = d_k of (d_j u): row 2 + 2 k + j
    assert rows[:, 2] == pytest.approx(Vx @ along_x, abs=1e-8)
    assert rows[:, 3] == pytest.approx(Vx @ along_y, abs=1e-8)
    assert rows[:, 4] == pytest.approx(Vy @ along_x, abs=1e-8)
    assert rows[:, 5] == pytest.approx(Vy @ along_y, abs=1e-8)
    assert np.abs(rows[:, 3] - rows[:, 4]).max() > 1e-2


def test_congruent_cells_share_a_projector():
    (group,) = build_elements(grid(40, 30, 2.0, 0.7), ElementSettings(projection="full"))
    assert len(group.tables.h_s) == 1
    assert sorted(group.cells.tolist()) == list(range(1200))
    # a chess board of cut and uncut squares: small squares, and by position of their hanging nodes the large ones
    groups = build_elements(hanging(6), ElementSettings(projection="full"))
    assert sum(len(g.cells) for g in groups) == hanging(6).n_cells
    assert {(g.n_sides, g.degree): len(g.tables.h_s) for g in groups} == {(4, 3): 1, (6, 3): 2, (7, 4): 4, (8, 5): 1}


def test_cells_that_differ_do_not_share():
    square = SHAPES["square"]
    polygons = np.stack([square, square + 5.0, square * 2.0, square * (1 + 1e-7), square[[1, 2, 3, 0]], square + 0.1])
    _, classes = congruence_classes(polygons)
    assert classes[0] == classes[1] == classes[5]
    assert len(set(classes.tolist())) == 4


@pytest.mark.parametrize("collide", [False, True])
def test_classes_are_those_of_equal_rows(monkeypatch, collide):
    """Also where all rows get the same number, by which they are sorted."""
    rng = np.random.default_rng(5)
    different = np.stack([SHAPES["pentagon"] * size for size in (1.0, 1.5, 0.7)])
    polygons = different[rng.integers(3, size=40)] + rng.normal(size=(40, 1, 2))
    if collide:
        monkeypatch.setattr(np.random, "default_rng", lambda seed: Zeros())
    representatives, classes = congruence_classes(polygons)
    sizes = polygons[:, 1, 0] - polygons[:, 0, 0]
    assert len(representatives) == 3
    assert (np.diff(representatives) > 0).all()
    for c, size in enumerate(sizes):
        assert sizes[representatives[classes[c]]] == pytest.approx(size)
        assert representatives[classes[c]] == np.flatnonzero(np.abs(sizes - size) < 1e-9)[0]


class Zeros:
    """A generator of the number 0."""

    def integers(self, high, size):
        return np.zeros(size, dtype=np.int64)


def test_groups_hold_all_cells_of_their_shapes():
    mesh = hanging(6)
    for group in build_elements(mesh, ElementSettings(projection="full")):
        assert group.shape_c.tolist() == sorted(group.shape_c.tolist())
        assert set(group.shape_c.tolist()) == set(range(len(group.tables.h_s)))
        assert len(group.tables.h_s) <= group.most_shapes
        for shape in range(len(group.tables.h_s)):
            polygons = np.stack([mesh.points_vx[mesh.cell(c)] for c in group.cells[group.shape_c == shape]])
            assert polygons - polygons[:, :1] == pytest.approx(
                np.broadcast_to(polygons[0] - polygons[0, 0], polygons.shape)
            )


def test_every_cell_is_in_one_group_and_weights_add_up():
    mesh = hanging(4, 0.05)
    groups = build_elements(mesh, ElementSettings(projection="full"))
    assert sorted(c for g in groups for c in g.cells.tolist()) == list(range(mesh.n_cells))
    assert sum(g.tables.w_sq[g.shape_c].sum() for g in groups) == pytest.approx(1.0, abs=1e-13)
    for g in groups:
        assert g.n_sides == mesh.n_sides_c[g.cells[0]]
        assert g.shape_c.dtype == np.int32


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"order": 1}, r"element order k = 1: use 2"),
        ({"order": 5}, r"element order k = 5: use 2"),
        ({"degree": 0}, r"projection degree l = 0: use 1 to 8"),
        ({"order": 3, "degree": 1}, r"projection degree l = 1: use 2 to 8"),
        ({"degree": 9}, r"projection degree l = 9: use 1 to 8"),
        ({"quadrature": 1}, r"quadrature degree 1: use 2 to 20"),
        ({"quadrature": 21}, r"quadrature degree 21: use 2 to 20"),
        ({"rule": "few"}, r"unknown rule 'few': choose one of auto, compressed, triangles"),
    ],
)
def test_settings_are_checked(arguments, message):
    with pytest.raises(InputError, match=message):
        ElementSettings(**arguments)


@pytest.mark.parametrize("k", [2, 3])
def test_the_stability_test_agrees_with_the_eigenvalues(k):
    """Positive definiteness after lifting the rigid motions says the same as the smallest constant, on either side."""
    for polygon in ALL_SHAPES.values():
        ((_, triangles),) = sub_triangles(polygon[None])
        shapes = Shapes.of(polygon[None], triangles, k, k + 1)
        for degree in (k, k + 1):
            tables = tables_of(polygon, k, degree)
            smallest = stability_constants(polygon[None], tables, k)[0, 0]
            test = StabilityTest(shapes)
            if smallest > 1e-8:
                assert test.passes(tables, np.zeros(1, dtype=int), 0.99 * smallest)[0]
            assert not test.passes(tables, np.zeros(1, dtype=int), 1.01 * max(smallest, 1e-8))[0]


@pytest.mark.parametrize("space", [FullSpace(1), FullSpace(3), FullSpace(4), CompositeSpace(2)], ids=lambda s: s.label)
def test_the_tangent_of_the_test_is_the_sum_over_points(space):
    """Fewer points than monomials, more, and several pieces."""
    polygon = SHAPES["pentagon"]
    ((_, triangles),) = sub_triangles(polygon[None])
    rule = on_sub_triangles(triangles, 4) if space.degree < 4 else compressed(polygon[None], triangles, 3)
    tables = tabulate(Shapes.of(polygon[None], triangles, 2, space.degree), space, rule)
    rows, n = tables.rows(2)[0], tables.n_basis
    expected = np.zeros((2 * n, 2 * n))
    for w, (dx, dy) in zip(tables.w_sq[0], rows, strict=True):
        zero = np.zeros(n)
        xx, yy, shear = np.append(dx, zero), np.append(zero, dy), np.append(dy, dx)
        expected += w * (
            np.outer(xx + yy, xx + yy) + 2 * np.outer(xx, xx) + 2 * np.outer(yy, yy) + np.outer(shear, shear)
        )
    np.testing.assert_allclose(element_tangent(tables)[0], expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_positive_definite_matrices_are_told_from_others():
    rng = np.random.default_rng(3)
    spectra = np.sort(rng.uniform(0.1, 10.0, (150, 7)), axis=1)
    spectra[::3, 0] *= -1.0
    bases, _ = np.linalg.qr(rng.normal(size=(150, 7, 7)))
    found = positive_definite(bases * spectra[:, None] @ np.swapaxes(bases, 1, 2))
    assert found.tolist() == (spectra[:, 0] > 0.0).tolist()
    assert not positive_definite(np.full((1, 2, 2), np.nan))[0]
