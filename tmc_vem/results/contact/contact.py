"""Physical checks of a deformed state: do solids interpenetrate, and what is left of the gap where they touch.

Third medium contact has no contact constraint that could be violated, so nothing in the solver would notice if solids
overlapped between the nodes of the medium. Here the deformed outlines are looked at as polygons.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.results.contact.distances import closed_gaps, distances_beyond
from tmc_vem.results.contact.solids import Chains, Solids, covered
from tmc_vem.system.fields import Fields

Float = NDArray[np.float64]
Int = NDArray[np.int64]

# Points are in contact if they are now closer than this fraction of their distance in the reference state ...
CLOSED = 0.1
# ... and than this fraction of the domain's size.
NEAR = 0.05
# Overlaps below this fraction of the domain's size squared are rounding of the polygon operations.
ROUNDING = 1e-12
# What is tolerated: depth relative to the size of the domain, and area relative to its square.
OVERLAP = 1e-6
EQUAL = 1e-9  # relative difference of depths, and of places in the domain, that are the same but for rounding


@dataclass(frozen=True)
class Overlap:
    """Where solids cover the same place.

    Attributes:
        area: covered more than once by deformed solid cells (length squared); 0 if it is rounding.
        depth: largest depth of a node of the solids' outline inside a solid cell (length), 0 if none is.
        fold: the same for nodes on the flanks of a corner that has closed on itself, which do not count in ``depth``:
            between the flanks there is no gap to keep, and they cross by a small part of a cell.
        point, origin: where that node is in the deformed and in the reference state, or None.
        cells: the solid cell that the node belongs to and the one that it lies in, by position in the fields.
    """

    area: float = 0.0
    depth: float = 0.0
    fold: float = 0.0
    point: tuple[float, float] | None = None
    origin: tuple[float, float] | None = None
    cells: tuple[int, int] | None = None

    def exceeds(self, size: float) -> bool:
        """Whether it is more than what is tolerated in a domain of this size."""
        return self.depth > OVERLAP * size or self.area > OVERLAP * size**2

    def summary(self) -> str:
        """In words, without a verdict."""
        where = "" if self.point is None else " at ({:.4g}, {:.4g})".format(*self.point)
        folded = "" if self.depth or not self.fold else "a corner closes on itself: "
        return f"{folded}depth {self.depth or self.fold:.2e}{where}, area {self.area:.2e}"


@dataclass(frozen=True)
class ContactReport:
    """What the polygons of the deformed solids say.

    Attributes:
        overlap_area, penetration_depth, fold_depth, penetration_point: see :class:`Overlap`.
        contact_nodes: nodes of the outlines whose distance to another part of them has shrunk to a tenth or less.
        smallest_gap, mean_gap, largest_gap: distances of these nodes to that other part (length), or None.
    """

    overlap_area: float
    penetration_depth: float
    fold_depth: float
    penetration_point: tuple[float, float] | None
    contact_nodes: int
    smallest_gap: float | None
    mean_gap: float | None
    largest_gap: float | None

    @property
    def interpenetrates(self) -> bool:
        """Whether solids overlap by more than rounding."""
        return self.overlap_area > 0.0 or self.penetration_depth > 0.0 or self.fold_depth > 0.0

    def as_dict(self) -> dict[str, Any]:
        """Plain values for result files."""
        return {**asdict(self), "interpenetrates": self.interpenetrates}

    def summary(self) -> str:
        """One line for a terminal."""
        if self.interpenetrates:
            found = Overlap(self.overlap_area, self.penetration_depth, self.fold_depth, self.penetration_point)
            state = f"solids overlap: {found.summary()}"
        else:
            state = "no interpenetration"
        if not self.contact_nodes:
            return f"{state}, no solids in contact"
        return (
            f"{state}; gap {self.smallest_gap:.3e} to {self.largest_gap:.3e} at {self.contact_nodes} nodes in contact"
        )


def check_contact(fields: Fields, order: int = 2, pieces: int = 8) -> ContactReport:
    """Check a state for interpenetration and measure the gap along contact.

    Solids are all regions whose name does not start with ``medium``.

    Args:
        fields: the whole state; with several ranks, gathered on one.
        order: polynomial degree along the sides, so that each has ``order - 1`` nodes between its vertices.
        pieces: straight pieces for each side.

    Returns:
        The report; without any solid, an empty one.
    """
    is_solid = fields.polygons.is_solid_c
    if not is_solid.any():
        return ContactReport(0.0, 0.0, 0.0, None, 0, None, None, None)
    solids = Solids(fields, is_solid, order, pieces)
    outline = solids.chains(solids.outline())
    overlap = find_overlap(solids, outline)
    gaps = closed_gaps(outline, CLOSED, NEAR * solids.size)
    return ContactReport(
        overlap_area=overlap.area,
        penetration_depth=overlap.depth,
        fold_depth=overlap.fold,
        penetration_point=overlap.point,
        contact_nodes=len(gaps),
        smallest_gap=float(gaps.min()) if len(gaps) else None,
        mean_gap=float(gaps.mean()) if len(gaps) else None,
        largest_gap=float(gaps.max()) if len(gaps) else None,
    )


def find_overlap(solids: Solids, outline: Chains) -> Overlap:
    """Where solids cover the same place, and how deep they are in each other.

    Args:
        solids: the state.
        outline: all of its outline.
    """
    area, is_covered_twice = _overlap(solids)
    deepest = _deepest(solids, outline) if is_covered_twice else Overlap()
    return replace(deepest, area=area if area > ROUNDING * solids.size**2 else 0.0)


def _overlap(solids: Solids) -> tuple[float, bool]:
    """Area that cells cover more than once, times how often more; and whether there is any place that they do.

    A cell whose outline crosses itself (of a run that went astray) covers what it surrounds.
    """
    import shapely

    crossed = solids.crossed()
    faces, times = covered(solids.chains(solids.outline(~crossed)))
    areas = shapely.area(faces)
    area = float(areas @ np.maximum(times - 1, 0))
    if not crossed.any():
        return area, bool((times > 1).any())
    bad = solids.polygons(np.flatnonzero(crossed))
    good = faces[times > 0]
    both = float(shapely.area(shapely.union_all(np.concatenate([good, bad]))))
    return area + float(shapely.area(bad).sum() + areas[times > 0].sum()) - both, True


def _deepest(solids: Solids, outline: Chains) -> Overlap:
    """The outline's point that lies deepest in a cell that it does not belong to; one in a fold only if there are no
    others.

    The depth is the distance to the outline, without the part that the point itself is on: one side of its own body to
    either end. Where just that has closed on the point, it is in a fold. Of equally deep points the place is that of
    the lowest, so that it does not depend on the numbering.
    """
    where, inside_of = _inside(solids, outline)
    body = solids.bodies()
    own = float(np.hypot(*(outline.before[:, -1] - outline.before[:, 0]).T).max())
    beyond, closed = distances_beyond(outline, where, body[outline.cell], own, CLOSED)
    is_fold = closed < beyond
    depth = np.where(is_fold, closed, np.where(np.isfinite(beyond), beyond, 0.0))
    penetration, fold = (float(depth[kind].max(initial=0.0)) for kind in (~is_fold, is_fold))
    most = penetration or fold
    if not most > 0.0:
        return Overlap()
    deepest = np.flatnonzero((depth >= (1.0 - EQUAL) * most) & (is_fold == (penetration == 0.0)))
    side, position = (index[deepest] for index in where)
    n = np.lexsort(np.round(outline.now[side, position] / (EQUAL * solids.size)).T)[0]
    (x, y), (x0, y0) = outline.now[side[n], position[n]], outline.before[side[n], position[n]]
    cells = solids.numbers[[outline.cell[side[n]], inside_of[deepest[n]]]].tolist()
    return Overlap(0.0, penetration, fold, (float(x), float(y)), (float(x0), float(y0)), (cells[0], cells[1]))


def _inside(solids: Solids, outline: Chains) -> tuple[tuple[Int, Int], Int]:
    """Points of the outline (side, position in it) that are inside a cell, and not on its outline; and that cell."""
    import shapely

    ids = outline.ids[:, :-1]
    _, first = np.unique(ids, return_index=True)
    points = shapely.points(outline.now[:, :-1].reshape(-1, 2)[first])
    point, cell = shapely.STRtree(solids.boxes()).query(points, predicate="intersects")
    cells, number = np.unique(cell, return_inverse=True)
    polygons = solids.polygons(cells)
    shapely.prepare(polygons)
    within = shapely.within(points[point], polygons[number])
    unique, entry = np.unique(point[within], return_index=True)
    side, position = np.unravel_index(first[unique], ids.shape)
    return (side, position), cell[within][entry]
