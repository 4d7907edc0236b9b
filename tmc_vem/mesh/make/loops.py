"""Loops of vertices, one for each cell, and their corners and sides: what refinement and coarsening ask of them.

A side is the chain of edges between two corners, a corner is a vertex where the loop turns.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.polygon import PolygonMesh

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]

# A vertex is a corner if the boundary turns there by more than this angle (radians).
TURN = 1e-6


@dataclass(frozen=True)
class Loops:
    """Closed loops of vertices in compressed form.

    Attributes:
        offsets: (n + 1,) where each loop starts in ``vertices``.
        vertices: of all loops, one after the other.
    """

    offsets: Int
    vertices: Int

    @staticmethod
    def of(mesh: PolygonMesh) -> Loops:
        """The cells of a mesh."""
        return Loops(mesh.cell_offsets, mesh.cell_vertices)

    @staticmethod
    def of_sizes(sizes: Int, vertices: Int) -> Loops:
        """Loops by the numbers of their vertices."""
        return Loops(np.concatenate([[0], np.cumsum(sizes)]), vertices)

    def __len__(self) -> int:
        return len(self.offsets) - 1

    @cached_property
    def sizes(self) -> Int:
        """(n,) numbers of vertices."""
        return np.diff(self.offsets)

    @cached_property
    def loop_of_entry(self) -> Int:
        """(n_entries,) which loop an entry of ``vertices`` belongs to."""
        return np.repeat(np.arange(len(self)), self.sizes)

    @cached_property
    def following(self) -> Int:
        """(n_entries,) the entry after each, around its loop."""
        entries = np.arange(1, len(self.vertices) + 1)
        entries[self.offsets[1:] - 1] = self.offsets[:-1]
        return entries

    @cached_property
    def preceding(self) -> Int:
        """(n_entries,) the entry before each, around its loop."""
        entries = np.arange(-1, len(self.vertices) - 1)
        entries[self.offsets[:-1]] = self.offsets[1:] - 1
        return entries

    def chosen(self, which: Int) -> Loops:
        """Some of the loops."""
        return Loops.of_sizes(self.sizes[which], self.vertices[self.entries_from(which, np.zeros_like(which))])

    def entries_from(self, which: Int, first: Int) -> Int:
        """Entries of some loops, one loop after the other, each beginning at its local entry ``first``."""
        sizes = self.sizes[which]
        starts = np.concatenate([[0], np.cumsum(sizes)])
        local = np.arange(starts[-1]) - np.repeat(starts[:-1], sizes) + np.repeat(first, sizes)
        size = np.repeat(sizes, sizes)
        local -= np.where(local >= size, size, 0)
        entries: Int = np.repeat(self.offsets[which], sizes) + local
        return entries

    def by_size(self) -> Iterator[tuple[Int, Int]]:
        """Groups of loops with equally many vertices: loops (n,) and vertices (n, size)."""
        for size in np.unique(self.sizes):
            loops = np.flatnonzero(self.sizes == size)
            yield loops, self.vertices[self.offsets[loops][:, None] + np.arange(size)]

    def kept(self, keep: Bool) -> Loops:
        """Loops of those entries that are kept."""
        before = np.concatenate([[0], np.cumsum(keep)])
        return Loops(before[self.offsets], self.vertices[keep])

    def any(self, entries: Bool) -> Bool:
        """(n,) whether any entry of a loop is chosen."""
        return np.bincount(self.loop_of_entry[entries], minlength=len(self)) > 0

    def turns(self, points_vx: Float) -> Float:
        """(n_entries,) by how much each loop turns at a vertex (radians), to the left if positive."""
        here = points_vx[self.vertices]
        after = here[self.following] - here
        before = after[self.preceding]
        cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
        turn: Float = np.arctan2(cross, (before * after).sum(axis=1))
        return turn

    def corners(self, turn: Float, flat: float = 0.0, soft_v: Bool | None = None) -> Bool:
        """(n_entries,) whether each entry is a corner.

        Args:
            turn: by how much loops turn, to the left alone to leave out corners to the right.
            flat: vertices where the loop turns by less (degrees) are none, unless fewer than three corners are left.
            soft_v: (n_vertices,) for which vertices ``flat`` holds, None for all.
        """
        plain = np.abs(turn) > TURN
        if flat <= 0.0:
            return plain
        straight = np.abs(turn) < np.radians(flat)
        if soft_v is not None:
            straight &= soft_v[self.vertices]
        left = plain & ~straight
        few = np.bincount(self.loop_of_entry[left], minlength=len(self)) < 3
        return np.where(few[self.loop_of_entry], plain, left)

    def overloaded(self, points_vx: Float, born_v: Bool, flat: float, max_hanging: int) -> Bool:
        """(n,) loops with more than ``max_hanging`` hanging nodes on a side, at least one of which is born.

        Args:
            points_vx: (n_vertices, 2) where the vertices are.
            born_v: (n_vertices,) those made by refinement. Others hang only where the loop is straight.
            flat: turn in degrees below which those that are born hang.
            max_hanging: the limit.
        """
        corner = self.corners(self.turns(points_vx), flat, born_v)
        side = np.cumsum(corner) - 1
        last = side[self.offsets[1:] - 1]  # entries before the first corner belong to the side of the last
        first = np.concatenate([[0], last[:-1] + 1])
        side = np.where(side < first[self.loop_of_entry], last[self.loop_of_entry], side)
        n_sides = int(corner.sum())
        hanging = ~corner
        many = np.bincount(side[hanging], minlength=n_sides) > max_hanging
        many &= np.bincount(side[hanging & born_v[self.vertices]], minlength=n_sides) > 0
        return self.any(many[side])


def joined(blocks: Sequence[Loops]) -> Loops:
    """Loops one after the other."""
    sizes, vertices = (np.concatenate(arrays) for arrays in zip(*((b.sizes, b.vertices) for b in blocks), strict=True))
    return Loops.of_sizes(sizes, vertices)
