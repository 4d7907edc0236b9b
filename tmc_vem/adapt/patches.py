"""Polynomials that fit what a cell and its neighbours have at their quadrature points, region by region.

The patch of a cell is the cell and all cells of its region that share a vertex with it. What is fitted is the
polynomial of degree k whose projections on polynomials of degree k - 1 are, cell by cell, nearest to those of the
values, in mean square over the patch: these projections are what elements of order k know of a gradient. What a patch
cannot tell stays out of the polynomial: in a row of single cells, no projection of y^2 differs from that of a constant.

Axes in names: c cells, p pairs of a cell and one of its patch, q quadrature points, m monomials, t components.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from tmc_vem.mesh.geometry import centroids, diameters
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.system.recovery import exponents, monomials, shifts

Float = NDArray[np.float64]
Int = NDArray[np.int64]

SEEN = 0.02  # of the squared norm of a polynomial: where less of it is in the projections, it is taken for noise
RIDGE = 1e-12  # of a Gram matrix' diagonal: keeps those of patches with few points regular
AT_ONCE = 1024  # cells whose pairs are in memory together


@dataclass(frozen=True)
class PointValues:
    """Values at the quadrature points of some cells, each with equally many.

    Attributes:
        cells: (n_cells,) their numbers in the mesh.
        w_cq: (n_cells, n_points) quadrature weights.
        X_cqx: (n_cells, n_points, 2) points.
        value_cqt: (n_cells, n_points, n_components).
    """

    cells: Int
    w_cq: Float
    X_cqx: Float
    value_cqt: Float


def neighbours(mesh: PolygonMesh) -> tuple[Int, Int]:
    """Pairs (n_pairs,) of a cell and a cell of its region that shares a vertex with it, itself too, by the former."""
    cell_of_corner = np.repeat(np.arange(mesh.n_cells), mesh.n_sides_c)
    corners = np.ones(len(cell_of_corner), dtype=np.int32)
    at_vertex = csr_array((corners, (cell_of_corner, mesh.cell_vertices)), (mesh.n_cells, mesh.n_vertices))
    meeting = (at_vertex @ at_vertex.T).tocsr()
    meeting.sort_indices()
    cell_p = np.repeat(np.arange(mesh.n_cells), np.diff(meeting.indptr))
    other_p = meeting.indices.astype(np.int64)
    alike = mesh.region_c[cell_p] == mesh.region_c[other_p]
    return cell_p[alike], other_p[alike]


class Patches:
    """The patches of all cells of a mesh.

    Args:
        mesh: the mesh.
        degree: k, of the polynomials that are fitted.
    """

    def __init__(self, mesh: PolygonMesh, degree: int) -> None:
        self._mesh, self._degree = mesh, degree
        self._centre_cx, self._size_c = np.empty((mesh.n_cells, 2)), np.empty(mesh.n_cells)
        for _, cells, vertices_cv in mesh.cells_by_size():
            polygons = mesh.points_vx[vertices_cv]
            self._centre_cx[cells], self._size_c[cells] = centroids(polygons), diameters(polygons)

    def fitted(self, values: Sequence[PointValues]) -> list[Float]:
        """The fitted polynomials at each cell's own points, parallel to the values.

        Args:
            values: of all cells of the mesh, each once.
        """
        coefficient_cmt = self._coefficients(values)
        return [self._monomials(some) @ coefficient_cmt[some.cells] for some in values]

    def _monomials(self, at: PointValues) -> Float:
        """(n_cells, n_points, n_monomials) monomials about the cells' own centroids."""
        relative = at.X_cqx - self._centre_cx[at.cells][:, None]
        return monomials(self._degree, relative / self._size_c[at.cells][:, None, None])

    def _coefficients(self, values: Sequence[PointValues]) -> Float:
        gram_cmm, seen_cmm, moment_cmt = self._of_cells(values)
        coefficient_cmt = np.empty_like(moment_cmt)
        cell_p, other_p = neighbours(self._mesh)
        first_c = np.searchsorted(cell_p, np.arange(self._mesh.n_cells + 1))
        for start in range(0, self._mesh.n_cells, AT_ONCE):
            cells = slice(start, min(start + AT_ONCE, self._mesh.n_cells))
            some = slice(first_c[cells.start], first_c[cells.stop])
            cell, other, first = cell_p[some], other_p[some], first_c[cells] - some.start
            offset_px = (self._centre_cx[other] - self._centre_cx[cell]) / self._size_c[cell][:, None]
            shift_pmm = shifts(self._degree, offset_px, self._size_c[other] / self._size_c[cell])
            back_pmm = np.swapaxes(shift_pmm, 1, 2)
            coefficient_cmt[cells] = _solution(
                np.add.reduceat(shift_pmm @ gram_cmm[other] @ back_pmm, first),
                np.add.reduceat(shift_pmm @ seen_cmm[other] @ back_pmm, first),
                np.add.reduceat(shift_pmm @ moment_cmt[other], first),
            )
        return coefficient_cmt

    def _of_cells(self, values: Sequence[PointValues]) -> tuple[Float, Float, Float]:
        """About the cells' own centroids: Gram matrices (n_cells, n_monomials, n_monomials) of monomials and of their
        projections, and products (n_cells, n_monomials, n_components) of projections of monomials and values."""
        n, lower = len(exponents(self._degree)), len(exponents(self._degree - 1))
        gram_cmm = np.zeros((self._mesh.n_cells, n, n))
        seen_cmm = np.zeros_like(gram_cmm)
        moment_cmt = np.zeros((self._mesh.n_cells, n, values[0].value_cqt.shape[2]))
        for some in values:
            m_cqm = self._monomials(some)
            weighted_cmq = np.swapaxes(m_cqm * some.w_cq[..., None], 1, 2)
            gram, moment = weighted_cmq @ m_cqm, weighted_cmq @ some.value_cqt
            both = np.concatenate([gram[:, :lower], moment[:, :lower]], axis=2)
            projected = gram[:, :, :lower] @ np.linalg.solve(gram[:, :lower, :lower], both)
            gram_cmm[some.cells], seen_cmm[some.cells] = gram, projected[:, :, :n]
            moment_cmt[some.cells] = projected[:, :, n:]
        return gram_cmm, seen_cmm, moment_cmt


def _solution(gram_cmm: Float, seen_cmm: Float, moment_cmt: Float) -> Float:
    """Coefficients c with ``seen c = moment``, but for what is hardly seen, which is damped."""
    diagonal = np.arange(gram_cmm.shape[1])
    regular_cmm = gram_cmm.copy()
    regular_cmm[:, diagonal, diagonal] *= 1.0 + RIDGE
    # orthonormal polynomials: the part of each that is seen is between 0 and 1
    to_monomials = np.swapaxes(np.linalg.inv(np.linalg.cholesky(regular_cmm)), 1, 2)
    share_cm, vectors = np.linalg.eigh(np.swapaxes(to_monomials, 1, 2) @ seen_cmm @ to_monomials)
    basis_cmm = to_monomials @ vectors
    seen_cmt = np.swapaxes(basis_cmm, 1, 2) @ moment_cmt
    found: Float = basis_cmm @ (seen_cmt / np.maximum(share_cm, SEEN)[..., None])
    return found
