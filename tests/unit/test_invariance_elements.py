"""Every choice for an element is the same wherever a cell lies, however it is turned, reflected and numbered."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_mesh import SHAPES, SQUARE_IN_THREE, mesh_of, non_convex, subdivide
from helpers_motion import Motion
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tmc_vem.mesh.quality import measure
from tmc_vem.support.errors import InputError
from tmc_vem.vem.spaces.element import ElementGroup, ElementSettings, build_elements
from tmc_vem.vem.spaces.quadrature import triangle
from tmc_vem.vem.spaces.spaces import Shapes
from tmc_vem.vem.spaces.stability import element_tangent, stabilised_tangent, stability_constants

Float = NDArray[np.float64]

ZOO = {
    **SHAPES,
    "square, sides in three": SQUARE_IN_THREE,
    "dart": np.array([(0.0, 0.0), (2.0, 0.0), (0.7, 0.6), (0.0, 2.0)]),
    "symmetric dart": np.array([(0.0, 0.0), (2.0, 0.0), (0.3, 0.3), (0.0, 2.0)]),
    "long L": np.array([(0, 0), (5, 0), (5, 1), (1, 1), (1, 5), (0, 5)], dtype=float),
    "T": np.array([(2, 0), (3, 0), (3, 5), (5, 5), (5, 6), (0, 6), (0, 5), (2, 5)], dtype=float),
    "comb": np.array(
        [(0, 0), (5, 0), (5, 3), (4, 3), (4, 1), (3, 1), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3.0)]
    ),
    "spiral": np.array([(0, 0), (4, 0), (4, 4), (1, 4), (1, 2), (2, 2), (2, 3), (3, 3), (3, 1), (0, 1.0)]),
    "U, divided": subdivide([(0, 0), (3, 0), (3, 2), (2, 2), (2, 1), (1, 1), (1, 2), (0, 2)], [3, 2, 1, 1, 1, 1, 1, 2]),
}
MOTIONS = st.builds(
    Motion,
    angle=st.floats(0.0, 360.0),
    reflect=st.booleans(),
    scale=st.sampled_from([1e-3, 1.0, 7.0]),
    shift=st.tuples(st.floats(-10.0, 10.0), st.floats(-10.0, 10.0)),
    seed=st.integers(0, 11),
)
TURNED = [
    Motion(angle=37.0), Motion(angle=90.0), Motion(reflect=True), Motion(seed=1), Motion(seed=2),
    Motion(211.0, True, 1e-3, (10.0, -7.0), 3),
]  # fmt: skip
SETTINGS = [
    ElementSettings(),
    ElementSettings(order=3),
    ElementSettings(rule="triangles"),
    ElementSettings(projection="full"),
    ElementSettings(projection="harmonic"),
    ElementSettings(projection="macro"),
    ElementSettings(order=3, projection="composite", quadrature=7),
    ElementSettings(quadrature=8),
]


@st.composite
def polygons(draw: st.DrawFn) -> Float:
    """Convex ones and stars, Ls and Us, some with hanging nodes on straight sides, up to ten times as long as wide."""
    kind = draw(st.sampled_from(["radii", "radii", "L", "U", "T"]))
    if kind == "radii":
        radii = np.array(draw(st.lists(st.floats(0.25, 1.0), min_size=4, max_size=8)))
        angles = 2.0 * np.pi * np.arange(len(radii)) / len(radii)
        corners = radii[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    else:
        corners = ZOO[kind] * [1.0, draw(st.floats(0.5, 2.0))]
    parts = [1 + draw(st.integers(0, 2)) * draw(st.booleans()) for _ in corners[:3]] + [1] * (len(corners) - 3)
    return subdivide(corners.tolist(), parts) * [1.0, draw(st.floats(0.1, 1.0))]


def element(polygon: Float, chosen: ElementSettings) -> ElementGroup:
    (group,) = build_elements(mesh_of(polygon), chosen)
    return group


def spectrum(group: ElementGroup) -> Float:
    """Energies of the modes of an element in plane elasticity; up to order 3 motions only turn them."""
    values: Float = np.linalg.eigvalsh(element_tangent(group.tables))[0]
    return values


def points_and_weights(group: ElementGroup) -> Float:
    """(n_points, 3) scaled points about the centroid, and weights, of an element's rule."""
    tables = group.tables
    return np.column_stack([tables.xi_sqx[0], tables.w_sq[0] / tables.h_s[0] ** 2])


def check(polygon: Float, motion: Motion, chosen: ElementSettings) -> None:
    """Compare the element of a polygon with that of the moved one: space, rule, energies of modes."""
    try:
        before = element(polygon, chosen)
    except InputError as refusal:
        with pytest.raises(InputError, match=str(refusal).split(":")[0]):
            element(motion.polygon(polygon), chosen)
        return
    after = element(motion.polygon(polygon), chosen)
    assert (after.projection, after.degree) == (before.projection, before.degree)
    expected, found = points_and_weights(before), points_and_weights(after)
    expected[:, :2] = expected[:, :2] @ motion.linear.T
    assert found.shape == expected.shape
    distance, of = cKDTree(found).query(expected)
    assert sorted(of.tolist()) == list(range(len(found)))
    assert distance.max() < 1e-10
    rounding = 1e-5 if before.projection == "macro" else 1e-9  # macro solves with an ill-conditioned kernel
    assert spectrum(after) == pytest.approx(spectrum(before), abs=rounding * spectrum(before)[-1])


@pytest.mark.parametrize("name", ZOO)
def test_elements_of_the_zoo_do_not_depend_on_how_cells_lie(name: str) -> None:
    for motion in TURNED:
        check(ZOO[name], motion, ElementSettings())
    check(ZOO[name], TURNED[-1], ElementSettings(order=3))


@settings(max_examples=30, deadline=None)
@given(name=st.sampled_from(list(ZOO)), motion=MOTIONS, chosen=st.sampled_from(SETTINGS))
def test_elements_do_not_depend_on_any_motion(name: str, motion: Motion, chosen: ElementSettings) -> None:
    check(ZOO[name], motion, chosen)


@settings(max_examples=30, deadline=None)
@given(polygon=polygons(), motion=MOTIONS, chosen=st.sampled_from(SETTINGS[:2]))
def test_elements_of_any_polygon_do_not_depend_on_motions(
    polygon: Float, motion: Motion, chosen: ElementSettings
) -> None:
    """What is at a threshold to rounding is left out: where a slight change of the shape changes the choice."""
    tilted = polygon * (1.0 + 1e-7)
    tilted[0] += 1e-7 * np.ptp(polygon, axis=0).min()
    as_it_is, nearly = element(polygon, chosen), element(tilted, chosen)
    assume(as_it_is.projection == nearly.projection)
    assume(as_it_is.tables.w_sq.shape == nearly.tables.w_sq.shape)
    check(polygon, motion, chosen)


@pytest.mark.parametrize("k", [2, 3, 4])
def test_the_reference_of_the_stability_test_turns_with_the_cell(k: int) -> None:
    """A diagonal of the xx components alone, or moments weighted one by one, moves constants by percents."""
    for polygon in (ZOO["pentagon"], ZOO["hexagon"], ZOO["quadrilateral"] * [1.0, 0.4]):
        found = []
        for motion in (Motion(), *TURNED):
            moved = motion.polygon(polygon)[None]
            chosen = ElementSettings(order=k, degree=k + 1)
            found.append(stability_constants(moved, element(moved[0], chosen).tables, k)[0])
        for other in found[1:]:
            assert other == pytest.approx(found[0], rel=1e-6)


def test_the_reference_has_full_rank_whatever_its_weights() -> None:
    from tmc_vem.vem.spaces.quadrature import fan

    for k in (2, 3, 4):
        polygon = ZOO["hexagon"][None]
        shapes = Shapes.of(polygon, fan(polygon), k, k)
        values = np.linalg.eigvalsh(stabilised_tangent(shapes.geometry, shapes.elliptic_cad, k))[0]
        assert (values[3:] > 1e-3).all()
        assert np.abs(values[:3]).max() < 1e-9


@pytest.mark.parametrize("degree", range(1, 7))
def test_rules_on_triangles_are_symmetric_in_all_corners(degree: int) -> None:
    points, weights = triangle(degree)
    both = np.column_stack([points, weights])
    for order in ([1, 0, 2, 3], [1, 2, 0, 3]):
        assert sorted(np.round(both[:, order], 12).tolist()) == sorted(np.round(both, 12).tolist())


@pytest.mark.parametrize("degree", range(7, 12))
def test_rules_of_high_degree_are_symmetric_about_the_first_corner(degree: int) -> None:
    points, weights = triangle(degree)
    both = np.column_stack([points, weights])
    assert sorted(np.round(both[:, [0, 2, 1, 3]], 12).tolist()) == sorted(np.round(both, 12).tolist())


def test_quality_does_not_depend_on_motions() -> None:
    mesh = non_convex()
    before = measure(mesh)
    for motion in TURNED:
        after = measure(motion.mesh(mesh))
        for name, power in (("area_c", 2), ("diameter_c", 1), ("shortest_edge_c", 1), ("aspect_c", 0)):
            moved = np.sort(getattr(after, name)) / motion.scale**power
            assert moved == pytest.approx(np.sort(getattr(before, name)), rel=1e-9), name
        for name in ("convex_c", "star_shaped_c"):
            assert getattr(after, name).sum() == getattr(before, name).sum()
