"""Whether solids overlap, asked after every converged step, on all ranks together.

Equilibrium and J > 0 do not keep bodies apart: where the medium has a free side, or a corner's strains are too sharp
for its cells, a body passes through another without any cell being inverted (docs/solver.md, "Bodies that pass through
each other"). A state in which solids overlap is no equilibrium of the problem that was posed.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.locate import TOLERANCE
from tmc_vem.results.contact.contact import Overlap, find_overlap
from tmc_vem.results.contact.rings import Change, Rings
from tmc_vem.results.contact.solids import Chains, Solids, covered
from tmc_vem.results.output import polygons_of
from tmc_vem.results.records import StepRecord
from tmc_vem.support.distributed import Vec
from tmc_vem.support.parallel import from_root
from tmc_vem.system.discretisation import Discretisation, Evaluation
from tmc_vem.system.fields import Fields, Polygons

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Place = tuple[float, float]

# Smallest J of the medium below which solids may touch: from the first such state on every state is looked at.
SQUEEZED = 0.1
PIECES = 8  # straight pieces for a side
# On the way of a jump bodies may overlap by this part of the square of the thinnest one's thickness: the states between
# two snapped ones are not those of the snap. Bodies that end on the other side of each other overlap by more.
PASSED = 0.25
PER_THICKNESS, MOST_BETWEEN = 4.0, 64  # states that are looked at there, per thickness and at most
REMEDY = "Try smaller cells and more medium around that place, rounded corners, or a larger alpha_r"


def _unknown(_: Place | None) -> str | None:
    return None


@dataclass(frozen=True)
class Refusal:
    """A converged state that was refused.

    Attributes:
        overlap: how much solids overlap there, or would have on the way.
        cells: numbers in the mesh of the two cells, of the body that goes in and of the one that it goes into.
        regions: their regions.
        passed: the bodies are apart again, but on the other side of each other.
        cause: a sentence about the cause that is known for bodies to overlap at a place, or None; asked on all ranks
            together.
    """

    overlap: Overlap
    cells: tuple[int, ...] = ()
    regions: tuple[str, ...] = ()
    passed: bool = False
    cause: Callable[[Place | None], str | None] = _unknown

    def sentence(self) -> str:
        """What is wrong with the state, and where."""
        what = "solids would have passed through each other" if self.passed else "solids would overlap"
        if self.overlap == Overlap():
            return what
        size, (cell, *other) = self.overlap.summary(), self.cells or (None,)
        if cell is None or self.overlap.origin is None:
            return f"{what}: {size}"
        x, y = self.overlap.origin
        return (
            f"{what}: {size}, where cell {cell} of '{self.regions[0]}', undeformed near ({x:.4g}, {y:.4g}), is inside "
            f"cell {other[0]} of '{self.regions[1]}'"
        )

    def advice(self) -> str:
        """The cause that is known, or what helps in most cases; called by all ranks together."""
        cause = self.cause(self.overlap.origin)
        return f"Known cause: {cause}" if cause else REMEDY


class OverlapWatch:
    """Looks whether solids overlap; made, and asked, by all ranks together.

    Args:
        system: the discretisation.
        media: names of the regions that are third medium.
        order: polynomial degree along the sides.
        tolerated: accept states with any overlap, but know about it.
        cause: a sentence about the cause that is known for bodies to overlap at a place of the reference configuration,
            and what to do about it, or None; asked on all ranks together, once a run ends for it.

    Attributes:
        crossed: whether outlines have crossed in a state that was not refused, so that gaps have a sign from then on.
    """

    def __init__(
        self, system: Discretisation, media: Sequence[str], order: int, *, tolerated: bool = False,
        cause: Callable[[Place | None], str | None] = _unknown,
    ) -> None:  # fmt: skip
        self._system, self._media, self._order, self._tolerated = system, tuple(media), order, tolerated
        self._cause = cause
        self._outline: _Outline | None = None
        self.is_active = False
        self.crossed = False

    def refusal(self, u: Vec, evaluation: Evaluation) -> Refusal | None:
        """Why a converged state is no equilibrium of the problem, or None.

        Args:
            u: the state.
            evaluation: of it.
        """
        squeezed = [evaluation.regions[name].min_j < SQUEEZED for name in self._media if name in evaluation.regions]
        self.is_active = self.is_active or any(squeezed)
        if not self.is_active:
            return None
        return self._verdict(self._watched().look(u))

    def refusal_of_jump(self, before: Vec, after: Vec) -> Refusal | None:
        """Why a state on another branch cannot have been reached from the one before, or None.

        Bodies that are on the other side of each other do not overlap. What is looked at are states on the straight
        line between both.
        """
        if not self._media:
            return None
        return self._verdict(self._watched().between(before, after))

    def go_on(self, history: Sequence[StepRecord]) -> None:
        """Know what has been seen in the steps of a run that is resumed."""
        self.is_active = any(record.min_j[name] < SQUEEZED for record in history for name in self._media)
        self.crossed = any(record.gap is not None and record.gap < 0.0 for record in history)

    @contextmanager
    def aside(self) -> Iterator[None]:
        """For states beside the path: afterwards nothing is known of them."""
        seen = self.is_active, self.crossed
        try:
            yield
        finally:
            self.is_active, self.crossed = seen

    def behind(self, u: Vec, origins: Sequence[Float], places: Sequence[Float]) -> bool:
        """Whether the second of two points is behind the surface of the first one, where surfaces have crossed.

        Args:
            u: a state that was not refused.
            origins, places: (2,) coordinates of both points in the reference and in the deformed state.
        """
        return self.crossed and self._watched().behind(u, origins, places)

    def closely(self, u: Vec) -> Refusal | None:
        """What is to be said about a state that is looked at cell by cell, whatever its outline says."""
        return self._watched().closely(u)

    def _verdict(self, found: Refusal | None) -> Refusal | None:
        if found is None:
            return None
        if self._tolerated or not (found.passed or found.overlap.exceeds(self._system.size)):
            self.crossed = True
            return None
        return replace(found, cause=self._cause)

    def _watched(self) -> _Outline:
        if self._outline is None:
            self._outline = _Outline(self._system, self._media, self._order)
        return self._outline


class _Outline:
    """The outline of all solids on rank 0, and which of its points each rank has."""

    def __init__(self, system: Discretisation, media: Sequence[str], order: int) -> None:
        self._system, self._order = system, order
        mine = polygons_of(system, media)
        parts = system.comm.gather((mine, system.cell_numbers()))
        self._polygons: Polygons | None = None
        wanted: list[Int] = []
        if parts is not None:
            first = np.cumsum([0, *(len(part.points_nx) for part, _ in parts)])
            still = Fields.merge([_fields(part, np.zeros_like(part.points_nx)) for part, _ in parts])
            self._polygons = still.polygons
            self._numbers_c = np.concatenate([numbers for _, numbers in parts])
            self._rings, self._before, self._weights, nodes = self._join(still)
            used, inverse = np.unique(nodes, return_inverse=True)
            self._nodes = inverse.reshape(nodes.shape)
            self._points_nx = self._polygons.points_nx[used]
            wanted = [used[(used >= a) & (used < b)] - a for a, b in itertools.pairwise(first)]
        self._mine: Int = system.comm.scatter(wanted)

    def look(self, u: Vec) -> Refusal | None:
        """What is to be said about a state, or None if every body is as it should be; equal on all ranks."""
        comm, sides = self._system.comm, self._sides(u)
        change = from_root(comm, lambda: self._rings.compare(sides) if self._rings else Change.NONE)
        if change is Change.NONE:
            return None
        found = self.closely(u)
        return Refusal(Overlap(), passed=True) if found is None and change is Change.NESTED else found

    def between(self, before: Vec, after: Vec) -> Refusal | None:
        """The same about the states on the straight line between two; None if bodies do not pass through each other."""
        ends, comm = [self._sides(u) for u in (before, after)], self._system.comm
        share = from_root(comm, lambda: self._passing(ends[0], ends[1]))
        if share is None:
            return None
        u = after.copy()
        u.axpby(1.0 - share, share, before)
        found = self.closely(u) or Refusal(Overlap())
        u.destroy()
        return replace(found, passed=True)

    def behind(self, u: Vec, origins: Sequence[Float], places: Sequence[Float]) -> bool:
        """Whether the second of two points is behind the surface of the first one, as for a gap."""
        comm, sides = self._system.comm, self._sides(u)

        def decide() -> bool:
            for first, second in ((0, 1), (1, 0)):
                on = self._at(origins[first])
                if len(on):
                    before = (origins[second] - origins[first]) @ _normal(self._before[on])
                    return bool(before > 0.0 > (places[second] - places[first]) @ _normal(sides[on]))
            return False

        return from_root(comm, decide)

    def _at(self, point_x: Float) -> Int:
        """Sides of the outline that a point (2,) of the reference state is on."""
        start, arm = self._before[:, 0], self._before[:, -1] - self._before[:, 0]
        t = np.clip(((point_x - start) * arm).sum(axis=1) / (arm * arm).sum(axis=1), 0.0, 1.0)
        away = np.hypot(*(start + t[:, None] * arm - point_x).T)
        return np.flatnonzero(away <= TOLERANCE * self._system.size)

    def _join(self, fields: Fields) -> tuple[Rings | None, Float, Float, Int]:
        """Rings, sides in the reference state, weights of a side's nodes at its points, these nodes of the sides."""
        is_solid = fields.polygons.is_solid_c
        if not is_solid.any():
            none = np.zeros((0, self._order + 1), dtype=np.int64)
            return None, np.zeros((0, PIECES + 1, 2)), np.zeros((PIECES + 1, self._order + 1)), none
        solids = Solids(fields, is_solid, self._order, PIECES)
        outline = solids.outline()
        before = solids.chains(outline).before
        return Rings(before, solids.ends[outline]), before, solids.weights, solids.side_nodes[outline]

    def _sides(self, u: Vec) -> Float:
        """(n_sides, m + 1, 2) points along the outline's sides, on rank 0."""
        parts = self._system.comm.gather(self._system.output_displacements(u)[self._mine])
        if parts is None:
            return np.empty((0, 1, 2))
        sides: Float = self._weights @ (self._points_nx + np.concatenate(parts))[self._nodes]
        return sides

    def _passing(self, before: Float, after: Float) -> float | None:
        """Share of the way at which bodies overlap by more than a snap explains, or None."""
        import shapely

        if self._rings is None:
            return None
        thickness = self._rings.thickness(before)
        furthest = float(np.hypot(*(after - before).reshape(-1, 2).T).max(initial=0.0))
        pieces = int(np.clip(np.ceil(PER_THICKNESS * furthest / thickness), 2, MOST_BETWEEN))
        for share in (np.arange(1, pieces) / pieces).tolist():
            sides = (1.0 - share) * before + share * after
            if self._rings.compare(sides) is Change.CROSSED:
                faces, times = covered(Chains(before, sides, np.zeros(len(sides), dtype=np.int64)))
                if shapely.area(faces[times > 1]).sum() > PASSED * thickness**2:
                    return float(share)
        return None

    def closely(self, u: Vec) -> Refusal | None:
        """The state cell by cell."""
        comm = self._system.comm
        parts = comm.gather(self._system.output_displacements(u))
        return from_root(comm, lambda: self._refusal(np.concatenate(parts or [])))

    def _refusal(self, displacement_ni: Float) -> Refusal | None:
        assert self._polygons is not None
        polygons = self._polygons
        solids = Solids(_fields(polygons, displacement_ni), polygons.is_solid_c, self._order, PIECES)
        overlap = find_overlap(solids, solids.chains(solids.outline()))
        if not (overlap.depth > 0.0 or overlap.area > 0.0):
            return None
        cells = list(overlap.cells or ())
        regions = tuple(polygons.region_names[polygons.region_c[c]] for c in cells)
        return Refusal(overlap, tuple(self._numbers_c[cells].tolist()), regions)


def _normal(sides: Float) -> Float:
    """Mean of the outward normals (2,) of sides (n, m + 1, 2), solids to the left; by their chords' directions."""
    tangents = sides[:, -1] - sides[:, 0]
    normals = np.column_stack([tangents[:, 1], -tangents[:, 0]])
    mean: Float = (normals / np.hypot(*normals.T)[:, None]).sum(axis=0)
    return mean


def _fields(polygons: Polygons, displacement_ni: Float) -> Fields:
    """Displacements on polygons, nothing else."""
    nothing = np.zeros(polygons.n_cells)
    return Fields(polygons, displacement_ni, nothing, nothing, nothing)
