"""Stress and strain recovered at points: polynomials fitted around every vertex, region by region.

Around a vertex, in one region, a tensor is the polynomial of degree k that is nearest to its values at the quadrature
points of the cells there, in the L2 norm. In a cell these polynomials are blended by mean value coordinates (Floater,
Comput. Aided Geom. Des. 20 (2003) 19), linear on its sides: what comes out is continuous in a region, reproduces
polynomials of degree k, and knows nothing of what is across an interface. Sums of a vertex that several ranks share are
added up, so that values do not depend on the distribution.

Axes in names: p patches, m monomials, k corners of cells, v corners of one cell, t components.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from tmc_vem.support.distributed import Comm, Vec
from tmc_vem.system.fields import Polygons
from tmc_vem.system.stress import Stresses, mean_of
from tmc_vem.system.tensors import COMPONENTS

Float = NDArray[np.float64]
Int = NDArray[np.int64]

SMALL = 1e-10  # of the largest eigenvalue of a patch' Gram matrix: below, its points do not tell the polynomial
ON = 1e-12  # of the size of a cell: so near to a side a point is on it


def exponents(degree: int) -> Int:
    """(n_monomials, 2) exponents of x and y up to a degree."""
    return np.array([(total - j, j) for total in range(degree + 1) for j in range(total + 1)])


def monomials(degree: int, xi: Float) -> Float:
    """(..., n_monomials) monomials at points (..., 2)."""
    powers = [np.ones(xi.shape)]
    for _ in range(degree):
        powers.append(powers[-1] * xi)
    return np.stack([powers[a][..., 0] * powers[b][..., 1] for a, b in exponents(degree).tolist()], axis=-1)


@dataclass(frozen=True)
class Recovered:
    """Recovered tensors of a state.

    Attributes:
        patches: around what.
        coefficients: (n_patches, n_monomials, n_components) of each tensor.
    """

    patches: Patches
    coefficients: Mapping[str, Float]

    def at_vertices(self) -> dict[str, Float]:
        """(n_patches, n_components) values at the vertices."""
        return {name: values[:, 0] for name, values in self.coefficients.items()}

    def at_nodes(self) -> dict[str, Float]:
        """(n_entries, n_components) values at all points of the polygons, parallel to their connectivity."""
        patches, found = self.patches, {}
        for name, coefficients in self.coefficients.items():
            values = np.zeros((len(patches.point_k), coefficients.shape[2]))
            for patch_e, weight_e, monomials_em in patches.along_sides:
                values += weight_e[:, None] * (monomials_em[:, None] @ coefficients[patch_e])[:, 0]
            found[name] = values
        return found

    def at(self, cell_n: Int, points_nx: Float) -> dict[str, Float]:
        """(n, n_components) values at points (n, 2) in some of this rank's cells (n,)."""
        found = {name: np.empty((len(cell_n), values.shape[2])) for name, values in self.coefficients.items()}
        for n, (cell, point_x) in enumerate(zip(cell_n.tolist(), points_nx, strict=True)):
            patch_v = self.patches.of_cell(cell)
            weight_v = mean_value_coordinates(self.patches.centre_px[patch_v], point_x)
            xi = (point_x - self.patches.centre_px[patch_v]) / self.patches.scale_p[patch_v, None]
            monomials_vm = monomials(self.patches.degree, xi)
            for name, values in self.coefficients.items():
                found[name][n] = np.einsum("v,vm,vmt->t", weight_v, monomials_vm, values[patch_v])
        return found


class Patches:
    """The vertices of every region with the cells around them; all ranks make this together.

    Args:
        stresses: of a discretisation.
        polygons: its cells, as it gives them.
        order: k, nodes on a side, the first vertex included, and degree of the polynomials.

    Attributes:
        point_k: points of all polygons, their connectivity.
        centre_px: (n_patches, 2) the vertices.
        region_p: (n_patches,) number of the region.
        scale_p: (n_patches,) length by which the polynomials' coordinates are divided.
    """

    def __init__(self, stresses: Stresses, polygons: Polygons, order: int) -> None:
        self._stresses, self._polygons, self._order, self.degree = stresses, polygons, order, order
        self.point_k = polygons.connectivity
        sizes = np.diff(polygons.offsets)
        within = np.arange(len(self.point_k)) - np.repeat(polygons.offsets[:-1], sizes)
        corner = within % order == 0
        region_k = np.repeat(polygons.region_c, sizes)
        n_points = len(polygons.points_nx)
        keys, patch = np.unique(region_k[corner] * n_points + self.point_k[corner], return_inverse=True)
        self._patch_k = np.full(len(self.point_k), -1)
        self._patch_k[corner] = patch
        # sums over the corners of cells that are at each patch' vertex
        self._at_corner = csr_array((np.ones(len(patch)), (patch, np.arange(len(patch)))), (len(keys), len(patch)))
        self.region_p, point_p = np.divmod(keys, max(n_points, 1))
        self.centre_px = polygons.points_nx[point_p]
        self._shared = _Shared(stresses.system.comm, self.centre_px, self.region_p, self._border(within, sizes))
        areas = stresses.system.cell_areas()
        total: Float = np.bincount(patch, np.repeat(areas, sizes)[corner], len(keys)).astype(float)[:, None]
        self.scale_p = np.sqrt(self._shared.added(total))[:, 0]
        self.along_sides = self._sides(within, sizes)
        self._inverse_pmm = self._inverses()

    def of_cell(self, cell: int) -> Int:
        """Patches (n_sides,) of the vertices of a cell, in order."""
        first, last = self._polygons.offsets[cell : cell + 2]
        return self._patch_k[first : last : self._order]

    def recovered(self, u: Vec, wanted: tuple[str, ...]) -> Recovered:
        """Tensors of a state; all ranks call this together."""
        return self.recovered_and_means(u, wanted)[0]

    def recovered_and_means(self, u: Vec, wanted: tuple[str, ...]) -> tuple[Recovered, dict[str, Float]]:
        """The same, and the means of the cells as :meth:`tmc_vem.system.stress.Stresses.cell_means` has them."""
        n_monomials, n_cells = len(exponents(self.degree)), self._polygons.n_cells
        parts = {name: np.zeros((self._at_corner.shape[1], n_monomials, len(COMPONENTS[name]))) for name in wanted}
        means = {name: np.full((n_cells, len(COMPONENTS[name])), np.nan) for name in wanted}
        for states, tensors in self._stresses.at_points(u):
            for corner_cv, _, shift_cvmm, moment_cqm in self._around(states.cells, states.w_cq, states.X_cqx):
                for name in wanted:
                    of_cells = np.swapaxes(moment_cqm, 1, 2) @ tensors[name]
                    parts[name][corner_cv] = shift_cvmm @ of_cells[:, None]
                    means[name][states.cells] = mean_of(name, states.w_cq, tensors)
        found = {}
        for name, part_kmt in parts.items():
            sums = self._at_corner @ part_kmt.reshape(len(part_kmt), -1)
            together = self._shared.added(sums).reshape(-1, *part_kmt.shape[1:])
            found[name] = self._inverse_pmm @ together
        return Recovered(self, found), means

    def _around(self, cells: Int, w_cq: Float, X_cqx: Float) -> list[tuple[Int, Int, Float, Float]]:
        """Cells of equally many sides: their corners and patches (n, n_sides), what takes monomials about their centres
        to those of patches (n, n_sides, n_monomials, n_monomials), and the former at their points, times weights."""
        offsets, found = self._polygons.offsets, []
        sides = (offsets[cells + 1] - offsets[cells]) // self._order
        if not len(cells):
            return []
        assert (sides == sides[0]).all()  # as discretisations give them
        patch_cv = self._patch_k[offsets[cells][:, None] + self._order * np.arange(sides[0])]
        area_c = w_cq.sum(axis=1)
        centre_cx = (w_cq[:, None] @ X_cqx)[:, 0] / area_c[:, None]
        scale_c = np.sqrt(area_c)
        moment_cqm = w_cq[..., None] * monomials(self.degree, (X_cqx - centre_cx[:, None]) / scale_c[:, None, None])
        scale_cv = self.scale_p[patch_cv]
        shift_cvmm = shifts(
            self.degree,
            (centre_cx[:, None] - self.centre_px[patch_cv]) / scale_cv[..., None],
            scale_c[:, None] / scale_cv,
        )
        corner_cv = offsets[cells][:, None] // self._order + np.arange(sides[0])
        found.append((corner_cv, patch_cv, shift_cvmm, moment_cqm))
        return found

    def _inverses(self) -> Float:
        """(n_patches, n_monomials, n_monomials) inverses of the patches' Gram matrices."""
        n = len(exponents(self.degree))
        gram_pmm = np.zeros((len(self.centre_px), n, n))
        for states in self._stresses.system.point_states(self._stresses.system.create_vector()):
            for _, patch_cv, shift_cvmm, moment_cqm in self._around(states.cells, states.w_cq, states.X_cqx):
                area_c = states.w_cq.sum(axis=1)
                centre_cx = (states.w_cq[:, None] @ states.X_cqx)[:, 0] / area_c[:, None]
                xi = (states.X_cqx - centre_cx[:, None]) / np.sqrt(area_c)[:, None, None]
                of_cells = np.swapaxes(moment_cqm, 1, 2) @ monomials(self.degree, xi)
                np.add.at(gram_pmm, patch_cv, shift_cvmm @ of_cells[:, None] @ np.swapaxes(shift_cvmm, 2, 3))
        together = self._shared.added(gram_pmm.reshape(len(gram_pmm), n * n)).reshape(gram_pmm.shape)
        if not len(together):
            return together
        inverse: Float = np.linalg.pinv(together, rcond=SMALL, hermitian=True)
        return inverse

    def _sides(self, within: Int, sizes: Int) -> list[tuple[Int, Float, Float]]:
        """For the vertex before and the one after every point of the polygons: its patch, its share in the value and
        the monomials of the point about it."""
        every = np.arange(len(self.point_k))
        first = np.repeat(self._polygons.offsets[:-1], sizes)
        before = every - within % self._order
        after = first + (before - first + self._order) % np.repeat(sizes, sizes)
        points = self._polygons.points_nx
        start, end, here = (points[self.point_k[entry]] for entry in (before, after, every))
        along = end - start
        t = ((here - start) * along).sum(axis=1) / np.maximum((along * along).sum(axis=1), np.finfo(float).tiny)
        found = []
        for entry, share in ((before, 1.0 - t), (after, t)):
            patch = self._patch_k[entry]
            xi = (here - self.centre_px[patch]) / self.scale_p[patch, None]
            found.append((patch, share, monomials(self.degree, xi)))
        return found

    def _border(self, within: Int, sizes: Int) -> NDArray[np.bool_]:
        """(n_patches,) whether a patch' vertex is on a side that only one cell of this rank has."""
        first = np.repeat(self._polygons.offsets[:-1], sizes)
        entries = np.flatnonzero(within % self._order == 0)
        following = first[entries] + (within[entries] + self._order) % np.repeat(sizes, sizes)[entries]
        pairs = np.sort(np.column_stack([self.point_k[entries], self.point_k[following]]), axis=1)
        _, position, count = np.unique(pairs, axis=0, return_inverse=True, return_counts=True)
        alone = count[position.ravel()] == 1
        at_border = np.zeros(len(self._polygons.points_nx), dtype=bool)
        at_border[pairs[alone].ravel()] = True
        flags = np.zeros(len(self.centre_px), dtype=bool)
        flags[self._patch_k[entries]] = at_border[self.point_k[entries]]
        return flags


class _Shared:
    """Patches that several ranks have a part of, known by vertex and region."""

    def __init__(self, comm: Comm, centre_px: Float, region_p: Int, border_p: NDArray[np.bool_]) -> None:
        self._comm = comm
        mine = np.flatnonzero(border_p) if comm.size > 1 else np.empty(0, dtype=np.int64)
        keys = [(*centre_px[p].tolist(), int(region_p[p])) for p in mine.tolist()]
        counts: dict[tuple[float, float, int], int] = {}
        for part in comm.allgather(keys) if comm.size > 1 else []:
            for key in part:
                counts[key] = counts.get(key, 0) + 1
        number = {key: n for n, key in enumerate(sorted(key for key, count in counts.items() if count > 1))}
        self._n = len(number)
        known = [(p, number[key]) for p, key in zip(mine.tolist(), keys, strict=True) if key in number]
        self._patch, self._number = np.array(known, dtype=np.int64).reshape(-1, 2).T

    def added(self, values_pt: Float) -> Float:
        """Values (n_patches, n) with what the other ranks have of the same patches; all ranks call this together."""
        if self._comm.size == 1:
            return values_pt
        part = np.zeros((self._n, values_pt.shape[1]))
        part[self._number] = values_pt[self._patch]
        total = np.sum(self._comm.allgather(part), axis=0)
        together = values_pt.copy()
        together[self._patch] = total[self._number]
        return together


def shifts(degree: int, offset: Float, ratio: Float) -> Float:
    """(..., n_monomials, n_monomials) matrices that take monomials of xi to those of ``offset + ratio xi``."""
    powers = [_powers(degree, offset[..., axis], ratio) for axis in range(2)]
    every = exponents(degree)
    found = np.zeros((*ratio.shape, len(every), len(every)))
    for n, (a, b) in enumerate(every.tolist()):
        for m, (c, d) in enumerate(every.tolist()):
            if c <= a and d <= b:
                found[..., n, m] = powers[0][a][c] * powers[1][b][d]
    return found


def _powers(degree: int, offset: Float, ratio: Float) -> list[list[Float]]:
    """Coefficients of ``(offset + ratio t)^a`` at t^c: [a][c]."""
    rows = [[np.ones_like(offset)]]
    for a in range(1, degree + 1):
        last = [*rows[-1], np.zeros_like(offset)]
        rows.append([offset * last[c] + (ratio * last[c - 1] if c else 0.0) for c in range(a + 1)])
    return rows


def mean_value_coordinates(corners_vx: Float, point_x: Float) -> Float:
    """(n_sides,) weights of a polygon's corners at a point in it or on a side; linear on the sides."""
    arm = corners_vx - point_x
    following = np.roll(arm, -1, axis=0)
    length, along = np.hypot(*arm.T), following - arm
    size = np.hypot(*along.T)
    cross = arm[:, 0] * following[:, 1] - arm[:, 1] * following[:, 0]
    dot = (arm * following).sum(axis=1)
    weights = np.zeros(len(corners_vx))
    n_sides = len(corners_vx)
    near = (np.abs(cross) <= ON * size.max() * size) & (dot <= (ON * size.max()) ** 2)
    if near.any():
        side = int(np.flatnonzero(near)[0])
        t = float(np.clip(-(arm[side] @ along[side]) / size[side] ** 2, 0.0, 1.0))
        weights[side] += 1.0 - t
        weights[(side + 1) % n_sides] += t
        return weights
    half = cross / (length * np.roll(length, -1) + dot)  # tan of half the angle under which a side is seen
    weights = (half + np.roll(half, 1)) / length
    total: Float = weights / weights.sum()
    return total
