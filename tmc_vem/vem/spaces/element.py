"""Virtual elements: derivatives of the projected basis at quadrature points, for classes of congruent cells.

What the gradient is projected on is chosen per shape by a spectral test: only the three rigid motions may have no
energy in plane elasticity at F = I. For [P_l]^2 the smallest l is taken that passes. The counting rule (40) of the
paper is only where the search starts: it is not sufficient (squares and pentagons fail at its l = 2), and a larger l
than needed costs accuracy. "No energy" is measured against a stabilised element of the same shape, so that modes
which are merely close to spurious do not pass. By default, shapes without a good l up to k + 1, such as those with
hanging nodes, get the composite space instead, which has full rank on any polygon; docs/projection.md compares the
spaces.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.faults import SHORT, short_edges
from tmc_vem.mesh.geometry import diameters
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError
from tmc_vem.support.notes import say
from tmc_vem.vem.spaces.candidates import candidates, cell_rule, needs_no_test
from tmc_vem.vem.spaces.element_settings import LARGEST_DEGREE, ElementSettings
from tmc_vem.vem.spaces.quadrature import star_shaped, sub_triangles
from tmc_vem.vem.spaces.rules import convex
from tmc_vem.vem.spaces.spaces import ProjectionSpace, Shapes
from tmc_vem.vem.spaces.stability import StabilityTest, spurious_modes, stability_constants
from tmc_vem.vem.spaces.tabulated import Tables, tabulate
from tmc_vem.vem.spaces.triangulation import equal_topologies

Float = NDArray[np.float64]
Int = NDArray[np.int64]

CHUNK = 256  # shapes whose arrays stay in the second-level cache
# Cells whose vertices agree up to a translation and this fraction of their diameter share a projector.
CONGRUENCE = 1e-10


@dataclass(frozen=True)
class ElementGroup:
    """Cells of one region with equally many sides and quadrature points and the same projection space.

    Attributes:
        cells: (n,) cells of the mesh, by shape.
        shape_c: (n,) int32, class of congruent cells of each, ascending.
        tables: projected basis and quadrature of every class.
        region: number of the cells' region.
        n_sides: vertices of each cell.
        degree: degree of the space's polynomials, the l of [P_l]^2.
        projection: the l of [P_l]^2, or the name of another space.
        most_shapes: how many classes there are at most in all groups of this kind.
    """

    cells: Int
    shape_c: NDArray[np.int32]
    tables: Tables
    region: int
    n_sides: int
    degree: int
    projection: str
    most_shapes: int

    @property
    def n_basis(self) -> int:
        """Scalar degrees of freedom of a cell."""
        return self.tables.n_basis


def build_elements(mesh: PolygonMesh, settings: ElementSettings, cell_ids: Int | None = None) -> list[ElementGroup]:
    """Element groups that cover the mesh, all of :func:`element_groups`."""
    return list(element_groups(mesh, settings, cell_ids))


def element_groups(mesh: PolygonMesh, settings: ElementSettings, cell_ids: Int | None = None) -> Iterator[ElementGroup]:
    """Element groups that cover the mesh, a few hundred shapes at a time.

    Args:
        mesh: this rank's cells.
        settings: order, degree and quadrature.
        cell_ids: names of the cells in messages, if they are not their positions.

    Raises:
        InputError: a forced l leaves spurious modes on some cell, or no l up to the largest one has full rank; the
            message names the cell, the number of spurious modes and the l that works.
    """
    if settings.projection in ("auto", "composite"):
        _note_short_edges(mesh, settings.order, cell_ids)
    for n_sides, all_cells, _ in mesh.cells_by_size():
        for region in np.unique(mesh.region_c[all_cells]).tolist():
            cells = all_cells[mesh.region_c[all_cells] == region]
            polygons_cvx = mesh.points_vx[mesh.cell_vertices[mesh.cell_offsets[cells][:, None] + np.arange(n_sides)]]
            representatives, class_c = congruence_classes(polygons_cvx)
            by_class, count = np.argsort(class_c, kind="stable"), np.bincount(class_c)
            first = np.cumsum(count) - count
            for kind in _alike(polygons_cvx[representatives]):
                for start in range(0, len(kind), CHUNK):
                    classes = kind[start : start + CHUNK]
                    chosen = representatives[classes]
                    names = cells[chosen] if cell_ids is None else cell_ids[cells[chosen]]
                    for space, found, tables in _choose_space(polygons_cvx[chosen], names, settings):
                        shapes = classes[found]
                        members, shape_c = _members(by_class, first[shapes], count[shapes])
                        yield ElementGroup(
                            cells[members], shape_c, tables, region, n_sides, space.degree, space.label, len(kind)
                        )


def _note_short_edges(mesh: PolygonMesh, order: int, cell_ids: Int | None) -> None:
    """Say which edges are so short that composite functions on the slivers there lose digits."""
    limit = SHORT * 10.0 ** (order - 2)
    short = short_edges(mesh, limit)
    if short:
        a, b = short[0]
        c = next(c for c, loop in enumerate(mesh.cells()) if len(loop) > 4 and a in loop and b in loop)
        x, y = mesh.points_vx[a]
        say(
            f"{len(short)} edges are shorter than {limit:g} of the width of their cells; with order {order} this costs "
            f"digits: the first is of cell {c if cell_ids is None else cell_ids[c]} at ({x:.6g}, {y:.6g}); "
            f"'tmc-vem mesh check FILE --fix OUT --tolerance {limit:g}' collapses them"
        )


def _members(by_class: Int, first: Int, count: Int) -> tuple[Int, NDArray[np.int32]]:
    """``by_class[first : first + count]`` of several classes one after the other, and which of them each is in."""
    number = np.repeat(np.arange(len(count), dtype=np.int32), count)
    before = np.cumsum(count) - count
    return by_class[(first - before)[number] + np.arange(len(number))], number


def congruence_classes(polygons_cvx: Float) -> tuple[Int, Int]:
    """Representatives (n_classes,), ascending, and class (n_cells,) of polygons that are equal up to a translation."""
    diameter = diameters(polygons_cvx)
    relative = (polygons_cvx[:, 1:] - polygons_cvx[:, :1]) / diameter[:, None, None]
    keys = np.column_stack([relative.reshape(len(polygons_cvx), -1), np.log(diameter)])
    rounded = np.round(keys / CONGRUENCE).astype(np.int64)
    # sorting numbers is faster than sorting rows; should two rows have the same number, rows are sorted
    number = rounded @ np.random.default_rng(0).integers(2**62, size=rounded.shape[1])
    _, first, classes = np.unique(number, return_index=True, return_inverse=True)
    if not np.array_equal(rounded[first[classes]], rounded):
        _, first, classes = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
        classes = classes.reshape(-1)
    # in the order of the mesh, whose cells are neighbours: kernels then find nodes in the cache
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return first[order], rank[classes]


def _alike(polygons_cvx: Float) -> Iterator[Int]:
    """Cells (n,) whose sub-triangles hang together alike, and that take the same kind of quadrature rule."""
    star = star_shaped(polygons_cvx)
    others = np.flatnonzero(~star)
    # for quadrilaterals the rule depends on convexity, and must not depend on what else is on a rank
    kind = convex(polygons_cvx) if polygons_cvx.shape[1] == 4 else np.ones(len(star), dtype=bool)
    together = [
        others[found[same]]
        for found, triangles in sub_triangles(polygons_cvx[others])
        for same, _ in equal_topologies(polygons_cvx[others[found]], triangles)
    ]
    for alike in (np.flatnonzero(star), *together):
        for chosen in (alike[kind[alike]], alike[~kind[alike]]):
            if len(chosen):
                yield chosen


def _choose_space(
    shapes: Float, names: Int, settings: ElementSettings
) -> Iterator[tuple[ProjectionSpace, Int, Tables]]:
    """Split shapes of one kind by the space they get: (space, positions among ``shapes``, tables)."""
    ((_, triangles),) = sub_triangles(shapes)
    k, n_sides = settings.order, shapes.shape[1]
    pending = np.arange(len(shapes))
    to_try = candidates(settings, n_sides)
    largest = max((space.degree for space, _ in to_try), default=k)  # there may be none for many sides
    known = Shapes.of(shapes, triangles, k, max(k, min(k + 1, largest)))
    test = StabilityTest(known)
    for space, least in to_try:
        rule = cell_rule(settings, space, shapes[pending], triangles[pending])
        needed = known if len(pending) == len(known) else known.take(pending)
        if space.degree > known.geometry.degree:
            needed = Shapes.of(shapes[pending], triangles[pending], k, space.degree)
        tables = tabulate(needed, space, rule)
        passes = test.passes(tables, pending, least, known_to=needs_no_test(space, needed))
        if settings.degree is not None and not passes.all():
            worst = int(np.flatnonzero(~passes)[0])
            constants = stability_constants(shapes[worst : worst + 1], tables.take(np.array([worst])), k)
            raise InputError(_refusal(shapes, names, settings, worst, spurious_modes(constants)[0]))
        if passes.any():
            chosen = np.flatnonzero(passes)
            yield space, pending[chosen], tables if passes.all() else tables.take(chosen)
        pending = pending[~passes]
        if not len(pending):
            return
    cell = f"cell {names[pending[0]]} has {n_sides} vertices and spurious modes"
    if settings.projection in ("full", "harmonic"):
        raise InputError(
            f"{cell} for every l up to {LARGEST_DEGREE}: leave the projection to 'auto', split the cell, or use fewer "
            "nodes on its straight sides"
        )
    raise InputError(f"{cell} with the projection '{settings.projection}': its shape is degenerate, check the mesh")


def _refusal(shapes: Float, names: Int, settings: ElementSettings, worst: int, spurious: int) -> str:
    """Message for a forced l that leaves spurious modes, with the l that does not."""
    free = ElementSettings(settings.order, None, settings.quadrature, "full")
    chosen = slice(worst, worst + 1)
    problem = (
        f"cell {names[worst]} has {shapes.shape[1]} vertices: l = {settings.degree} leaves {spurious} "
        f"spurious mode{'s' if spurious > 1 else ''}; "
    )
    try:
        works = next(_choose_space(shapes[chosen], names[chosen], free))[0].degree
    except InputError:
        return f"{problem}so does every other l up to {LARGEST_DEGREE}: leave the projection to the spectral test"
    return f"{problem}use l >= {works}, or leave l to the spectral test"
