"""Regions from combined shapes: areas against closed formulas and against a polygon library, and what is refused."""

from __future__ import annotations

import math
import operator
from typing import Any

import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tmc_vem.mesh.make.outline import Arc, Region
from tmc_vem.mesh.make.shapes import Shape, combine, disc, polygon, rectangle, signed_area
from tmc_vem.support.errors import InputError

EIGHTHS = st.integers(0, 16).map(lambda n: n / 8)
RADII = st.integers(1, 8).map(lambda n: n / 8)


def area(regions: list[Region]) -> float:
    """Exact area: of the outlines less that of their holes."""

    def of(loop: Any) -> float:
        return abs(sum(signed_area(curve) for curve in Region("loop", loop).curves()))

    return sum(of(region.outline) - sum(of(hole) for hole in region.holes) for region in regions)


def test_lens_of_two_discs_has_its_area_and_two_arcs() -> None:
    lens = combine({"a": disc(0, 0, 1), "b": disc(1, 0, 1)}, {"lens": "a & b"})
    assert len(lens) == 1
    arcs = [entry for entry in lens[0].outline if isinstance(entry, Arc)]
    assert len(arcs) == len(lens[0].outline) == 2
    # pi r^2 / 3 - sqrt(3) / 2 r^2 for each half is the textbook's 2 pi / 3 - sqrt(3) / 2
    assert area(lens) == pytest.approx(2 * math.pi / 3 - math.sqrt(3) / 2, rel=1e-12)


def test_difference_leaves_a_hole_and_a_union_has_none() -> None:
    shapes = {"plate": rectangle(0, 0, 2, 1), "bore": disc(1, 0.5, 0.25)}
    (plate,) = combine(shapes, {"plate": "plate - bore"})
    assert len(plate.holes) == 1
    assert area([plate]) == pytest.approx(2 - math.pi / 16, rel=1e-12)
    (whole,) = combine(shapes, {"whole": "plate + bore"})
    assert not whole.holes
    assert area([whole]) == pytest.approx(2.0, rel=1e-12)


def test_rounded_corners_convex_and_reentrant() -> None:
    r = 0.1
    (box,) = combine({"box": rectangle(0, 0, 1, 1, r)}, {"box": "box"})
    assert area([box]) == pytest.approx(1 - (4 - math.pi) * r**2, rel=1e-12)
    corners = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)]
    for order in (corners, corners[::-1]):
        (angle,) = combine({"L": polygon(order, r)}, {"L": "L"})
        # five convex corners lose what the sixth, re-entrant one gains
        assert area([angle]) == pytest.approx(3 - 4 * (1 - math.pi / 4) * r**2, rel=1e-12)


def test_a_cut_makes_two_parts() -> None:
    parts = combine({"a": rectangle(0, 0, 3, 1), "b": rectangle(1, -1, 2, 2)}, {"rest": "a - b"})
    assert sorted(part.polygon().centroid.x for part in parts) == pytest.approx([0.5, 2.5])


def test_parts_that_touch_in_a_point_keep_to_themselves() -> None:
    """Squares at a common corner, four leaves between discs, and a square whose quarters alternate."""
    squares = combine({"a": rectangle(0, 0, 1, 1), "b": rectangle(1, 1, 3, 2)}, {"both": "a + b"})
    assert sorted(area([part]) for part in squares) == pytest.approx([1.0, 2.0])
    assert [len(part.outline) for part in squares] == [4, 4]
    discs = {name: disc(x, y, 1) for name, x, y in (("e", 1, 0), ("n", 0, 1), ("w", -1, 0), ("s", 0, -1))}
    leaves = combine(discs, {"leaves": "(e + w) & (n + s)"})
    assert [area([leaf]) for leaf in leaves] == pytest.approx([math.pi / 2 - 1] * 4)
    assert all(len(leaf.outline) == 2 for leaf in leaves)


@settings(max_examples=150, deadline=None)
@given(
    shapes=st.lists(
        st.one_of(
            st.tuples(EIGHTHS, EIGHTHS, RADII, RADII).map(lambda v: ("rectangle", v)),
            st.tuples(EIGHTHS, EIGHTHS, RADII).map(lambda v: ("disc", v)),
        ),
        min_size=3,
        max_size=3,
    ),
    operators=st.tuples(st.sampled_from("+-&"), st.sampled_from("+-&")),
    nested=st.booleans(),
)
def test_areas_of_random_combinations(shapes: list[Any], operators: tuple[str, str], nested: bool) -> None:
    """On a grid of eighths, sides coincide and circles touch all the time."""
    ours: dict[str, Shape] = {}
    theirs: dict[str, Any] = {}
    for name, (kind, values) in zip("abc", shapes, strict=True):
        if kind == "disc":
            x, y, r = values
            ours[name], theirs[name] = disc(x, y, r), shapely.Point(x, y).buffer(r, quad_segs=400)
        else:
            x, y, width, height = values
            ours[name] = rectangle(x, y, x + width, y + height)
            theirs[name] = shapely.box(x, y, x + width, y + height)
    do = {"+": operator.or_, "-": operator.sub, "&": operator.and_}
    first, second = operators
    if nested:
        text = f"a {first} (b {second} c)"
        expected = do[first](theirs["a"], do[second](theirs["b"], theirs["c"])).area
    else:
        text = f"(a {first} b) {second} c"
        expected = do[second](do[first](theirs["a"], theirs["b"]), theirs["c"]).area
    assume(expected > 1e-3)
    assert area(combine(ours, {"region": text})) == pytest.approx(expected, rel=1e-3, abs=1e-5)


@pytest.mark.parametrize(
    ("regions", "words"),
    [
        ({"r": "a - c"}, ("region 'r'", "no shape 'c'", "a, b")),
        ({"r": "a -"}, ("region 'r'", "no combination")),
        ({"r": "a * b"}, ("'a * b'", "+ - &")),
        ({"r": "a - a"}, ("'r' is empty",)),
        ({"r": "a", "s": "b"}, ("'r' and 's' overlap",)),
        ({"r": "a.__class__"}, ("a.__class__",)),
        ({"r": ""}, ("no combination",)),
    ],
)
def test_bad_combinations(regions: dict[str, str], words: tuple[str, ...]) -> None:
    shapes = {"a": rectangle(0, 0, 1, 1), "b": rectangle(0.5, 0.5, 2, 2)}
    with pytest.raises(InputError) as raised:
        combine(shapes, regions)
    for word in words:
        assert word in str(raised.value)


@pytest.mark.parametrize(
    "make",
    [
        lambda: polygon([(0, 0), (1, 0)]),
        lambda: polygon([(0, 0), (1, 1), (1, 0), (0, 1)]),
        lambda: rectangle(0, 0, 0, 1),
        lambda: rectangle(0, 0, 1, 1, 0.6),
        lambda: rectangle(0, 0, 1, float("nan")),
        lambda: disc(0, 0, -1),
    ],
)
def test_bad_shapes(make: Any) -> None:
    with pytest.raises(InputError):
        make()
