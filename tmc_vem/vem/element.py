"""Virtual elements: derivatives of the projected basis at quadrature points, for classes of congruent cells.

The degree l of the gradient's projection is chosen per shape by a spectral test: the smallest l for which the element
tangent of plane elasticity at F = I has exactly the three zero eigenvalues of the rigid motions. The counting rule (40)
of the paper is only where the search starts: it is not sufficient (squares and pentagons fail at its l = 2), and a
larger l than needed costs accuracy.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.errors import InputError
from tmc_vem.mesh.geometry import diameters
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.vem import monomials
from tmc_vem.vem.projector import PolygonGeometry, elliptic_projector, gradient_projector, n_scalar_dofs
from tmc_vem.vem.quadrature import on_triangles, sub_triangles

Float = NDArray[np.float64]
Int = NDArray[np.int64]

N_ROWS = 6
RIGID_MODES = 3
LARGEST_DEGREE = 8
# An eigenvalue below this fraction of the largest is a zero. Spurious modes stay at rounding, below 1e-15 up to l = 8;
# the smallest genuine eigenvalue of cells with edges longer than 1 % of the diameter is above 1e-6 for k = 2 and falls
# by two to three decades with every order, as the highest modes of the shortest edge soften.
ZERO_EIGENVALUE = {2: 1e-8, 3: 1e-10, 4: 1e-12}
# Cells whose vertices agree up to a translation and this fraction of their diameter share a projector.
CONGRUENCE = 1e-10


@dataclass(frozen=True)
class ElementSettings:
    """Choices for the discretisation.

    Attributes:
        order: k >= 2, polynomial degree on the edges.
        degree: l, degree of the gradient's projection; None lets the spectral test choose per shape.
        quadrature: degree of the rule on the sub-triangles; None means the larger of 2 k and l + k - 1, which
            integrates the product of a stress of degree k - 1 and a projected gradient, and so keeps the order of
            convergence. A lower degree is raised to l, below which constant stresses are out of balance. On the box,
            degrees 4 to 10 change the gap by less than one percent for k = 2.
    """

    order: int = 2
    degree: int | None = None
    quadrature: int | None = None

    def __post_init__(self) -> None:
        if self.order not in (2, 3, 4):
            raise InputError(f"element order k = {self.order}: use 2 (the paper's), 3 or 4")
        if self.degree is not None and not self.order - 1 <= self.degree <= LARGEST_DEGREE:
            raise InputError(f"projection degree l = {self.degree}: use {self.order - 1} to {LARGEST_DEGREE}")
        if self.quadrature is not None and not 2 <= self.quadrature <= 20:
            raise InputError(f"quadrature degree {self.quadrature}: use 2 to 20")

    @property
    def quadrature_degree(self) -> int:
        """Degree of the rule on the sub-triangles, except for cells with a high l; see :meth:`rule_degree`."""
        return 2 * self.order if self.quadrature is None else self.quadrature

    def rule_degree(self, degree: int) -> int:
        """Degree of the rule on the sub-triangles of cells with the projection degree l = ``degree``."""
        if self.quadrature is None:
            return max(2 * self.order, degree + self.order - 1)
        return max(self.quadrature, degree)


@dataclass(frozen=True)
class ElementGroup:
    """Cells with equally many sides and quadrature points and the same l.

    Attributes:
        cells: (n,) cells of the mesh.
        shape_c: (n,) int32, class of congruent cells of each.
        B_sqra: (n_shapes, n_points, 6, stride) derivatives d1, d2, d1d1, d2d1, d1d2, d2d2 of the projected basis.
        w_sq: (n_shapes, n_points) weights.
        n_basis: scalar degrees of freedom of a cell; the last axis of B is padded with zeros beyond.
        n_sides, degree: vertices of each cell and the l in use.
        values_sqa: (n_shapes, n_points, n_basis) values of Pi_nabla_k of the basis, for loads and errors.
        points_sqx: (n_shapes, n_points, 2) quadrature points relative to the cell's first vertex.
    """

    cells: Int
    shape_c: NDArray[np.int32]
    B_sqra: Float
    w_sq: Float
    n_basis: int
    n_sides: int
    degree: int
    values_sqa: Float
    points_sqx: Float


def padded(n: int, multiple: int = 4) -> int:
    """``n`` rounded up for the vectorised cell driver."""
    return -(-n // multiple) * multiple


def build_elements(mesh: PolygonMesh, settings: ElementSettings, cell_ids: Int | None = None) -> list[ElementGroup]:
    """Element groups that cover the mesh.

    Args:
        mesh: this rank's cells.
        settings: order, degree and quadrature.
        cell_ids: names of the cells in messages, if they are not their positions.

    Raises:
        InputError: a forced l leaves spurious modes on some cell, or no l up to the largest one has full rank; the
            message names the cell, the number of spurious modes and the l that works.
    """
    groups = []
    for _, cells, vertices_cv in mesh.cells_by_size():
        polygons_cvx = mesh.points_vx[vertices_cv]
        representatives, shape_of = congruence_classes(polygons_cvx)
        for part, triangles in sub_triangles(polygons_cvx[representatives]):
            shapes = polygons_cvx[representatives[part]]
            names = cells[representatives[part]] if cell_ids is None else cell_ids[cells[representatives[part]]]
            for degree, chosen, tables in _choose_degree(shapes, triangles, names, settings):
                position = np.full(len(representatives), -1, dtype=np.int64)
                position[part[chosen]] = np.arange(len(chosen))
                members = np.flatnonzero(position[shape_of] >= 0)
                groups.append(
                    ElementGroup(
                        cells=cells[members],
                        shape_c=position[shape_of[members]].astype(np.int32),
                        n_sides=vertices_cv.shape[1],
                        degree=degree,
                        n_basis=n_scalar_dofs(vertices_cv.shape[1], settings.order),
                        B_sqra=tables.B_sqra,
                        w_sq=tables.w_sq,
                        values_sqa=tables.values_sqa,
                        points_sqx=tables.points_sqx,
                    )
                )
    return groups


def congruence_classes(polygons_cvx: Float) -> tuple[Int, Int]:
    """Representatives (n_classes,) and class (n_cells,) of polygons that are equal up to a translation."""
    diameter = diameters(polygons_cvx)
    relative = (polygons_cvx[:, 1:] - polygons_cvx[:, :1]) / diameter[:, None, None]
    keys = np.column_stack([relative.reshape(len(polygons_cvx), -1), np.log(diameter)])
    rounded = np.round(keys / CONGRUENCE).astype(np.int64)
    _, representatives, classes = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    return representatives, classes.reshape(-1)


@dataclass(frozen=True)
class Tables:
    """The arrays of :class:`ElementGroup` for every shape."""

    B_sqra: Float
    w_sq: Float
    values_sqa: Float
    points_sqx: Float

    def take(self, chosen: Int) -> Tables:
        return Tables(self.B_sqra[chosen], self.w_sq[chosen], self.values_sqa[chosen], self.points_sqx[chosen])


def tabulate(polygons_cvx: Float, triangles_ctpx: Float, k: int, degree: int, quadrature: int) -> Tables:
    """Projected basis and its derivatives at the quadrature points of every polygon; see :class:`ElementGroup`."""
    geometry = PolygonGeometry.of(polygons_cvx, max(degree, k))
    elliptic = elliptic_projector(geometry, k)
    grad_x, grad_y = gradient_projector(geometry, k, degree, elliptic)
    points, weights = on_triangles(triangles_ctpx, quadrature)
    xi = (points - geometry.centroid_cx[:, None]) / geometry.diameter_c[:, None, None]
    m = monomials.values(max(degree, k), xi)
    m_l = m[..., : monomials.dimension(degree)]
    d_xi, d_eta = monomials.derivative_matrices(degree)
    inverse_h = 1.0 / geometry.diameter_c[:, None, None]
    dm_x, dm_y = (m_l @ d_xi.T) * inverse_h, (m_l @ d_eta.T) * inverse_h

    n_shapes, n_points = weights.shape
    n_basis = grad_x.shape[2]
    B_sqra = np.zeros((n_shapes, n_points, N_ROWS, padded(n_basis)))
    # second derivatives first index fastest: d1 of (d/dx v), d1 of (d/dy v), then d2 of both
    rows = (m_l @ grad_x, m_l @ grad_y, dm_x @ grad_x, dm_x @ grad_y, dm_y @ grad_x, dm_y @ grad_y)
    for r, row in enumerate(rows):
        B_sqra[:, :, r, :n_basis] = row
    return Tables(
        B_sqra=B_sqra,
        w_sq=weights,
        values_sqa=m[..., : monomials.dimension(k)] @ elliptic,
        points_sqx=points - polygons_cvx[:, :1],
    )


def elastic_spectra(tables: Tables) -> Float:
    """Eigenvalues (n_shapes, 2 n_basis), ascending, of the tangent of plane elasticity at F = I (lambda = mu = 1).

    The material is isotropic in the coordinates in which the polygon has equal principal moments of inertia. This
    changes no rank, and keeps the genuine bending modes of a slender cell from looking like spurious ones.
    """
    center = np.einsum("sq,sqx->sx", tables.w_sq, tables.points_sqx) / tables.w_sq.sum(axis=1)[:, None]
    arm = tables.points_sqx - center[:, None]
    inertia = np.einsum("sq,sqx,sqy->sxy", tables.w_sq, arm, arm)
    moments, axes = np.linalg.eigh(inertia)
    stretch = axes * np.sqrt(moments / moments[:, -1:])[:, None, :]  # d/dy = stretch^T d/dx along the principal axes
    n_basis = tables.values_sqa.shape[2]
    gradient = np.einsum("sxy,sqxa->ysqa", stretch, tables.B_sqra[:, :, :2, :n_basis])
    weighted = gradient * tables.w_sq[..., None]
    xx, yy, xy = (np.swapaxes(gradient[i], 1, 2) @ weighted[j] for i, j in ((0, 0), (1, 1), (0, 1)))
    K = np.empty((len(xx), 2 * n_basis, 2 * n_basis))
    K[:, :n_basis, :n_basis] = 3.0 * xx + yy
    K[:, n_basis:, n_basis:] = 3.0 * yy + xx
    K[:, :n_basis, n_basis:] = xy + np.swapaxes(xy, 1, 2)
    K[:, n_basis:, :n_basis] = np.swapaxes(K[:, :n_basis, n_basis:], 1, 2)
    spectrum: Float = np.linalg.eigvalsh(K)
    return spectrum


def spurious_modes(spectra_sm: Float, k: int) -> Int:
    """(n_shapes,) number of zero eigenvalues beyond the three rigid motions."""
    zero = np.abs(spectra_sm) < ZERO_EIGENVALUE[k] * spectra_sm[:, -1:]
    count: Int = zero.sum(axis=1) - RIGID_MODES
    return count


def first_candidate(n_sides: int, k: int) -> int:
    """Smallest l that the counting rule (40), N <= 2 l - 2 k + 5, allows; at least k - 1, which reproduces P_k."""
    return max(k - 1, -(-(n_sides + 2 * k - 5) // 2))


def _choose_degree(
    shapes: Float, triangles: Float, names: Int, settings: ElementSettings
) -> Iterator[tuple[int, Int, Tables]]:
    """Split shapes by the l they get: (l, positions among ``shapes``, tables)."""
    k, n_sides = settings.order, shapes.shape[1]
    if settings.degree is not None:
        tables = tabulate(shapes, triangles, k, settings.degree, settings.rule_degree(settings.degree))
        spurious = spurious_modes(elastic_spectra(tables), k)
        bad = np.flatnonzero(spurious > 0)
        if len(bad):
            free = ElementSettings(order=k, quadrature=settings.quadrature)
            first = bad[:1]
            works = next(_choose_degree(shapes[first], triangles[first], names[first], free))[0]
            raise InputError(
                f"cell {names[bad[0]]} has {n_sides} vertices: l = {settings.degree} leaves {spurious[bad[0]]} "
                f"spurious mode{'s' if spurious[bad[0]] > 1 else ''}; use l >= {works}, or leave l to the spectral test"
            )
        yield settings.degree, np.arange(len(shapes)), tables
        return

    pending = np.arange(len(shapes))
    for degree in range(first_candidate(n_sides, k), LARGEST_DEGREE + 1):
        tables = tabulate(shapes[pending], triangles[pending], k, degree, settings.rule_degree(degree))
        full_rank = spurious_modes(elastic_spectra(tables), k) <= 0
        if full_rank.any():
            chosen = np.flatnonzero(full_rank)
            yield degree, pending[chosen], tables.take(chosen)
        pending = pending[~full_rank]
        if not len(pending):
            return
    raise InputError(
        f"cell {names[pending[0]]} has {n_sides} vertices and spurious modes for every l up to {LARGEST_DEGREE}: "
        "split it, or use fewer nodes on its straight sides"
    )
