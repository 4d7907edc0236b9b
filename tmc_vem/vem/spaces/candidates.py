"""Spaces that a cell's gradients may be projected on, in the order in which they are tried, and their quadrature."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tmc_vem.vem.spaces.composite import CompositeSpace
from tmc_vem.vem.spaces.element_settings import LARGEST_DEGREE, ElementSettings
from tmc_vem.vem.spaces.macro import MacroSpace
from tmc_vem.vem.spaces.rules import CellRule, compressed, on_sub_triangles, simple
from tmc_vem.vem.spaces.spaces import FullSpace, HarmonicSpace, ProjectionSpace, Shapes
from tmc_vem.vem.spaces.stability import SPURIOUS

Float = NDArray[np.float64]
# Spaces with the stability constant that each of them needs.
Candidates = list[tuple[ProjectionSpace, float]]

# The smallest energy of a mode, as a fraction of what the reference element gives it. Modes without energy stay at
# rounding, below 1e-13; most cells are above 1e-2. In between are shapes close to a deficient one, such as a hanging
# node slightly off its straight side (1e-5 to 1e-9): no zero, but as harmful as one. So l is raised until STABLE is
# reached. Edges below a hundredth of the cell may not allow that; what counts as spurious for good is below SPURIOUS.
STABLE = 1e-3
# With 'auto', [P_l]^2 with l up to k + 1 is used where every mode has this fraction. For k = 2, triangles and
# quadrilaterals have 0.4 and more, convex pentagons about 0.15, cells with a hanging node up to 0.08, hexagons 0.03.
GOOD = 0.1
# [P_l]^2 is tried up to this many sides: of random hexagons none had a tenth.
MOST_SIDES = 5
# Composite functions have full rank on any polygon. Their smallest constants were measured on 6000 polygons, spikes and
# short sides included: where no sub-triangle is flatter than this (twice its area by its longest side squared), they
# are 5e-3 and more for k = 2, and 1e-3 for k = 3 and 4. The test is made where it may find something.
FLATTEST, FLATTEST_OF_2 = 0.1, 1e-3


def candidates(settings: ElementSettings, n_sides: int) -> Candidates:
    """Spaces to try one after another on polygons of ``n_sides``, with the stability constant that each needs."""
    if settings.degree is not None:
        return [(FullSpace(settings.degree), SPURIOUS)]
    return BY_PROJECTION[settings.projection](settings.order, n_sides)


def cell_rule(
    settings: ElementSettings, space: ProjectionSpace, polygons_svx: Float, triangles_stpx: Float
) -> CellRule:
    """Quadrature rule for a projection space on polygons (s, v, 2) with their sub-triangles (s, t, 3, 2)."""
    degree = settings.rule_degree(space.degree)
    if settings.rule == "triangles" or space.piecewise_degree is not None:
        return on_sub_triangles(triangles_stpx, degree)
    return (simple if settings.rule == "auto" else compressed)(polygons_svx, triangles_stpx, degree)


def needs_no_test(space: ProjectionSpace, shapes: Shapes) -> NDArray[np.bool_]:
    """(n_shapes,) whether it is known without a test that no mode is spurious."""
    if not isinstance(space, CompositeSpace):
        return np.zeros(len(shapes), dtype=bool)
    side_tpx = np.roll(shapes.triangles_ctpx, -1, axis=2) - shapes.triangles_ctpx
    first, second = side_tpx[:, :, 0], side_tpx[:, :, 1]
    twice = first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
    longest = (side_tpx**2).sum(axis=3).max(axis=2)
    flattest: NDArray[np.bool_] = (twice / longest).min(axis=1) > (FLATTEST_OF_2 if space.order == 2 else FLATTEST)
    return flattest


def first_candidate(n_sides: int, k: int) -> int:
    """Smallest l that the counting rule (40), N <= 2 l - 2 k + 5, allows; at least k - 1, which reproduces P_k."""
    return max(k - 1, -(-(n_sides + 2 * k - 5) // 2))


def _auto(k: int, n_sides: int) -> Candidates:
    degrees = range(first_candidate(n_sides, k), k + 2) if n_sides <= MOST_SIDES else ()
    return [*((FullSpace(m), GOOD) for m in degrees), (CompositeSpace(k), SPURIOUS)]


def _full(k: int, n_sides: int) -> Candidates:
    return [(FullSpace(m), _least(m)) for m in range(first_candidate(n_sides, k), LARGEST_DEGREE + 1)]


def _harmonic(k: int, n_sides: int) -> Candidates:
    return [(HarmonicSpace(k, m), _least(m)) for m in range(k + 1, LARGEST_DEGREE + 1)]


def _least(degree: int) -> float:
    """What a mode needs with this degree: of the last one, only not to be spurious."""
    return SPURIOUS if degree == LARGEST_DEGREE else STABLE


# One for each of PROJECTIONS: (order, sides of the polygon) -> spaces to try.
BY_PROJECTION: dict[str, Callable[[int, int], Candidates]] = {
    "auto": _auto,
    "full": _full,
    "harmonic": _harmonic,
    "macro": lambda k, _: [(MacroSpace(k), SPURIOUS)],
    "composite": lambda k, _: [(CompositeSpace(k), SPURIOUS)],
}
