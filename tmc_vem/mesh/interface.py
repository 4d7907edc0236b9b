"""Where the solids of a mesh end: sides between a solid and the medium, free sides of the medium, connected bodies."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.polygon import PolygonMesh

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]

# Points times sides that are looked at together.
PAIRS_AT_ONCE = 1 << 20


@dataclass(frozen=True)
class Nearest:
    """For some points, the nearest point of those sides that fulfil a condition.

    Attributes:
        side_n: (n,) the side, -1 where there is none.
        point_nx: (n, 2) the point on it.
        distance_n: (n,) how far it is, infinite where there is none.
    """

    side_n: Int
    point_nx: Float
    distance_n: Float


@dataclass(frozen=True)
class Interface:
    """Sides between a solid and the medium, each running so that the solid is on its left.

    Attributes:
        mesh: the mesh.
        ends_sv: (n_sides, 2) first and last vertex of each side.
        solid_s, medium_s: (n_sides,) cells on both sides of it.
    """

    mesh: PolygonMesh
    ends_sv: Int
    solid_s: Int
    medium_s: Int

    def __len__(self) -> int:
        return len(self.ends_sv)

    @cached_property
    def start_sx(self) -> Float:
        """(n_sides, 2) first points."""
        start: Float = self.mesh.points_vx[self.ends_sv[:, 0]]
        return start

    @cached_property
    def arm_sx(self) -> Float:
        """(n_sides, 2) from the first to the last point."""
        arm: Float = self.mesh.points_vx[self.ends_sv[:, 1]] - self.start_sx
        return arm

    @cached_property
    def normal_sx(self) -> Float:
        """(n_sides, 2) unit normals, out of the solid into the medium."""
        normal: Float = np.column_stack([self.arm_sx[:, 1], -self.arm_sx[:, 0]]) / np.hypot(*self.arm_sx.T)[:, None]
        return normal

    def nearest(self, points_nx: Float, normal_nkx: Float, facing: float, opposite: float) -> Nearest:
        """For each point, the nearest point of a side that lies in front of it and faces it.

        With d the unit vector to the point on the side: d . n >= ``facing`` for one of the point's directions n, and
        d . m <= -``opposite`` with the side's own normal m.

        Args:
            points_nx: (n, 2) points.
            normal_nkx: (n, k, 2) directions of each, unit vectors.
            facing, opposite: cosines of the largest angles.
        """
        found = []
        for rows in _chunks(len(points_nx), len(self)):
            foot, distance = self._feet(points_nx[rows])
            with np.errstate(invalid="ignore", divide="ignore"):
                d = (foot - points_nx[rows][:, None]) / distance[..., None]
            ahead = np.einsum("nsx,nkx->nsk", d, normal_nkx[rows]).max(axis=-1) >= facing
            towards = np.einsum("nsx,sx->ns", d, self.normal_sx) <= -opposite
            found.append(_closest(foot, np.where(ahead & towards, distance, np.inf)))
        return _joined(found)

    def seen(self, points_nx: Float) -> Nearest:
        """For each point, the nearest point of a side on whose medium's side it lies."""
        found = []
        for rows in _chunks(len(points_nx), len(self)):
            foot, distance = self._feet(points_nx[rows])
            above = np.einsum("nsx,sx->ns", points_nx[rows][:, None] - foot, self.normal_sx)
            found.append(_closest(foot, np.where(above >= -1e-9 * distance, distance, np.inf)))
        return _joined(found)

    def _feet(self, points_nx: Float) -> tuple[Float, Float]:
        """Nearest points (n, n_sides, 2) on all sides, and their distances (n, n_sides)."""
        arm = self.arm_sx
        along = np.einsum("nsx,sx->ns", points_nx[:, None] - self.start_sx, arm) / (arm**2).sum(axis=1)
        foot = self.start_sx + np.clip(along, 0.0, 1.0)[..., None] * arm
        return foot, np.hypot(*np.moveaxis(foot - points_nx[:, None], -1, 0))


def interface(mesh: PolygonMesh, is_medium_c: Bool) -> Interface:
    """Sides between solid and medium.

    Args:
        mesh: the mesh.
        is_medium_c: (n_cells,) which cells are medium.
    """
    left, right = mesh.cells_of_edges
    kind = np.append(is_medium_c.astype(np.int64), -1)  # the last for where there is no cell
    ends = mesh.edges.vertices_ev
    long = (mesh.points_vx[ends[:, 0]] != mesh.points_vx[ends[:, 1]]).any(axis=1)
    solid_left = np.flatnonzero(long & (kind[left] == 0) & (kind[right] == 1))
    solid_right = np.flatnonzero(long & (kind[left] == 1) & (kind[right] == 0))
    return Interface(
        mesh,
        np.concatenate([ends[solid_left], ends[solid_right][:, ::-1]]),
        np.concatenate([left[solid_left], right[solid_right]]),
        np.concatenate([right[solid_left], left[solid_right]]),
    )


def body_numbers(mesh: PolygonMesh, chosen_c: Bool) -> Int:
    """(n_cells,) number of the body of each chosen cell, -1 for the others; cells that share an edge are one body."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    left, right = mesh.cells_of_edges
    inner = (left >= 0) & (right >= 0)
    left, right = left[inner], right[inner]
    joined = chosen_c[left] & chosen_c[right]
    graph = coo_array((np.ones(int(joined.sum())), (left[joined], right[joined])), shape=(mesh.n_cells, mesh.n_cells))
    label = connected_components(graph, directed=False)[1]
    body = np.full(mesh.n_cells, -1)
    body[chosen_c] = np.unique(label[chosen_c], return_inverse=True)[1]
    return body


def free_chains(mesh: PolygonMesh, is_medium_c: Bool) -> list[Int]:
    """Vertices of each piece of the mesh's boundary that is medium's and runs from one solid to another, or the same.

    Closed pieces, all around a mesh, are no such pieces.
    """
    left, right = mesh.cells_of_edges
    outer = np.flatnonzero((left < 0) | (right < 0))
    ends = mesh.edges.vertices_ev[outer]
    ends = np.where((left[outer] >= 0)[:, None], ends, ends[:, ::-1])  # the cell is on the left
    free = ends[is_medium_c[np.maximum(left, right)[outer]]]
    following: dict[int, list[int]] = {}
    for start, end in free.tolist():
        following.setdefault(start, []).append(end)
    chains = []
    for start in np.setdiff1d(free[:, 0], free[:, 1]).tolist():
        chain = [start]
        while following.get(chain[-1]):
            chain.append(following[chain[-1]].pop())
        chains.append(np.array(chain))
    return chains


def solid_angles(mesh: PolygonMesh, is_solid_c: Bool) -> Float:
    """(n_vertices,) sum of the angles of solid cells at each vertex."""
    angle_v = np.zeros(mesh.n_vertices)
    for _, cells, loops in mesh.cells_by_size():
        loops = loops[is_solid_c[cells]]
        x = mesh.points_vx[loops]
        to, back = np.roll(x, -1, axis=1) - x, np.roll(x, 1, axis=1) - x
        cross = to[..., 0] * back[..., 1] - to[..., 1] * back[..., 0]
        np.add.at(angle_v, loops, np.arctan2(cross, (to * back).sum(axis=-1)) % (2.0 * np.pi))
    return angle_v


def _closest(foot: Float, distance: Float) -> Nearest:
    side = distance.argmin(axis=1)
    rows = np.arange(len(side))
    shortest = distance[rows, side]
    return Nearest(np.where(np.isfinite(shortest), side, -1), foot[rows, side], shortest)


def _chunks(n_points: int, n_sides: int) -> Iterator[slice]:
    step = max(1, PAIRS_AT_ONCE // max(1, n_sides))
    return (slice(first, first + step) for first in range(0, n_points, step))


def _joined(parts: list[Nearest]) -> Nearest:
    empty = Nearest(np.empty(0, dtype=np.int64), np.empty((0, 2)), np.empty(0))
    columns = [(part.side_n, part.point_nx, part.distance_n) for part in [empty, *parts]]
    side, point, distance = (np.concatenate(values) for values in zip(*columns, strict=True))
    return Nearest(side, point, distance)
