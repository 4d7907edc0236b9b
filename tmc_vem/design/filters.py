"""Filters of densities on polygon meshes: lengths that a design cannot fall short of.

A filter is a matrix A over the cells of a design: y = A x, with the chain rule dv/dx = A^T dv/dy. Both are averages: a
constant stays what it is, and 0 <= x <= 1 gives 0 <= y <= 1. Cells outside the design do not count.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import scipy.sparse
from numpy.typing import NDArray
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from tmc_vem.design.triangulation import triangulate
from tmc_vem.mesh.cells import centroids_and_areas
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import require_choice, require_positive

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]

MOST_NEIGHBOURS = 50_000_000  # entries of a cone filter's matrix: 600 MB
HOW_LONG = "give a length of a few cells"


class Filter(Protocol):
    """A linear map of densities."""

    def forward(self, x_c: Float) -> Float:
        """Filtered densities A x (n_cells,) of densities (n_cells,)."""

    def backward(self, dv_dy_c: Float) -> Float:
        """dv/dx = A^T dv/dy (n_cells,) of derivatives (n_cells,)."""


@dataclass(frozen=True)
class NoFilter:
    """The densities as they are."""

    def forward(self, x_c: Float) -> Float:
        """x (n_cells,)."""
        return x_c.copy()

    def backward(self, dv_dy_c: Float) -> Float:
        """dv/dy (n_cells,)."""
        return dv_dy_c.copy()


@dataclass(frozen=True)
class Within:
    """A filter over some cells; the others keep their densities, and nothing of them is in the filtered ones.

    Attributes:
        filter: over the cells within, in their order.
        inside_c: (n_cells,) which those are.
    """

    filter: Filter
    inside_c: Bool

    def forward(self, x_c: Float) -> Float:
        """Filtered within, as they are without (n_cells,)."""
        y_c = x_c.copy()
        y_c[self.inside_c] = self.filter.forward(x_c[self.inside_c])
        return y_c

    def backward(self, dv_dy_c: Float) -> Float:
        """A^T dv/dy (n_cells,)."""
        slope_c = dv_dy_c.copy()
        slope_c[self.inside_c] = self.filter.backward(dv_dy_c[self.inside_c])
        return slope_c


@dataclass(frozen=True)
class ConeFilter:
    """Weighted mean over the cells within a radius (Bruns & Tortorelli, CMAME 190 (2001) 3443).

    Attributes:
        matrix_cc: (n_cells, n_cells) sparse, with rows that add up to 1.
    """

    matrix_cc: Any

    def forward(self, x_c: Float) -> Float:
        """``y_c = sum_d w_cd a_d x_d / sum_d w_cd a_d`` with ``w_cd = max(0, r - |x_c - x_d|)`` (n_cells,)."""
        return np.asarray(self.matrix_cc @ x_c, dtype=np.float64)

    def backward(self, dv_dy_c: Float) -> Float:
        """A^T dv/dy (n_cells,)."""
        return np.asarray(self.matrix_cc.T @ dv_dy_c, dtype=np.float64)


@dataclass(frozen=True)
class HelmholtzFilter:
    """-l^2 lap y + y = x with l = r / (2 sqrt 3) and no flux through the outline, factorised once.

    Lazarov & Sigmund, IJNME 86 (2011) 765. Linear elements on the Delaunay triangles of the cells, with nodes at the
    centroids of cells and at vertices; terms without derivatives are integrated with one point a cell, its centroid.
    So A = (l^2 L + diag(a))^-1 diag(a) with L reduced to the cells. On any mesh, A 1 = 1, sum a y = sum a x (the volume
    is kept), 0 <= y <= 1 (L has no positive entry off its diagonal), and diag(a) A is symmetric. The error is of second
    order in the size of cells.

    Attributes:
        area_c: (n_cells,) areas.
        factors: of the matrix of all nodes, the cells' first.
        n_nodes: their number.
    """

    area_c: Float
    factors: Any
    n_nodes: int

    def forward(self, x_c: Float) -> Float:
        """y (n_cells,) of densities (n_cells,)."""
        return self._solved(self.area_c * x_c, "N")

    def backward(self, dv_dy_c: Float) -> Float:
        """A^T dv/dy (n_cells,)."""
        return self.area_c * self._solved(dv_dy_c, "T")

    def _solved(self, load_c: Float, how: str) -> Float:
        load = np.zeros(self.n_nodes)
        load[: len(self.area_c)] = load_c
        return np.asarray(self.factors.solve(load, trans=how)[: len(self.area_c)], dtype=np.float64)


def cone_filter(mesh: PolygonMesh, cells: Int, radius: float) -> ConeFilter:
    """Cone filter over some cells of a mesh; distances are between centroids, whatever lies between them.

    Args:
        mesh: the mesh.
        cells: (n_cells,) numbers of the design's cells, in the order of the densities.
        radius: r (length). Below the distance of cells nothing is filtered.

    Raises:
        InputError: the radius is not positive, or covers so many cells that the matrix does not fit.
    """
    require_positive("radius of the cone filter", radius, HOW_LONG)
    center, area = (values[cells] for values in centroids_and_areas(mesh))
    tree = cKDTree(center)
    count = int(tree.count_neighbors(tree, radius))
    if count > MOST_NEIGHBOURS:
        raise InputError(
            f"radius {radius:g} of the cone filter covers {count / len(cells):.0f} cells around each of {len(cells)}: "
            "use a smaller radius, or the Helmholtz filter, which costs the same for any"
        )
    first, second = tree.query_pairs(radius, output_type="ndarray").reshape(-1, 2).T
    weight = radius - np.hypot(*(center[first] - center[second]).T)
    own = np.arange(len(cells))
    row, column = np.concatenate([own, first, second]), np.concatenate([own, second, first])
    value = np.concatenate([np.full(len(cells), radius), weight, weight]) * area[column]
    matrix = scipy.sparse.csr_matrix((value, (row, column)), shape=(len(cells), len(cells)))
    total = np.asarray(matrix.sum(axis=1)).ravel()
    return ConeFilter(scipy.sparse.csr_matrix(scipy.sparse.diags(1.0 / total) @ matrix))


def helmholtz_filter(mesh: PolygonMesh, cells: Int, radius: float) -> HelmholtzFilter:
    """Helmholtz filter over some cells of a mesh; nothing passes through what is outside them.

    Args:
        mesh: the mesh.
        cells: (n_cells,) numbers of the design's cells, in the order of the densities.
        radius: r (length), that of the cone filter which smooths about as much.

    Raises:
        InputError: the radius is not positive.
    """
    require_positive("radius of the Helmholtz filter", radius, HOW_LONG)
    triangulation = triangulate(mesh, cells)
    n_nodes = len(triangulation.points_px)
    area = centroids_and_areas(mesh)[1][cells]
    ends, weight = triangulation.weights()
    (a, b), flux = ends.T, radius**2 / 12.0 * weight
    mass = np.append(area, np.zeros(n_nodes - len(cells)))
    diagonal = mass + np.bincount(a, flux, n_nodes) + np.bincount(b, flux, n_nodes)
    every = np.arange(n_nodes)
    row, column = np.concatenate([every, a, b]), np.concatenate([every, b, a])
    value = np.concatenate([diagonal, -flux, -flux])
    matrix = scipy.sparse.csc_matrix((value, (row, column)), shape=(n_nodes, n_nodes))
    factors = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    return HelmholtzFilter(area, factors, n_nodes)


FILTERS: Mapping[str, Callable[[PolygonMesh, Int, float], Filter]] = {
    "none": lambda mesh, cells, radius: NoFilter(), "cone": cone_filter, "helmholtz": helmholtz_filter,
}  # fmt: skip


def density_filter(name: str, mesh: PolygonMesh, cells: Int, radius: float) -> Filter:
    """The filter of this name over some cells of a mesh.

    Args:
        name: ``cone``, ``helmholtz`` or ``none``.
        mesh: the mesh.
        cells: (n_cells,) numbers of the design's cells, in the order of the densities.
        radius: r (length); not read without a filter.

    Raises:
        InputError: there is no such filter, or as for the filter itself.
    """
    require_choice("filter", name, FILTERS)
    return FILTERS[name](mesh, cells, radius)
