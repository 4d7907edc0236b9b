"""Physical checks of a deformed state: do solids interpenetrate, and what is left of the gap where they touch.

Third medium contact has no contact constraint that could be violated, so nothing in the solver would notice if solids
overlapped between the nodes of the medium. Here the deformed outlines are looked at as polygons.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.fields import Fields
from tmc_vem.report.distances import closed_gaps, distances_beyond
from tmc_vem.report.solids import Chains, Solids, covered

Float = NDArray[np.float64]
Int = NDArray[np.int64]

# Points are in contact if they are now closer than this fraction of their distance in the reference state ...
CLOSED = 0.1
# ... and than this fraction of the domain's size.
NEAR = 0.05
# Overlaps below this fraction of the domain's size squared are rounding of the polygon operations.
ROUNDING = 1e-12
EQUAL = 1e-9  # relative difference of depths that are the same but for rounding


@dataclass(frozen=True)
class ContactReport:
    """What the polygons of the deformed solids say.

    Attributes:
        overlap_area: area covered more than once by deformed solid cells (length squared), 0 without interpenetration.
        penetration_depth: largest depth of a node of the solids' outline inside a solid cell (length), 0 if none is.
        penetration_point: where that is in the deformed state, or None.
        contact_nodes: nodes of the outlines whose distance to another part of them has shrunk to a tenth or less.
        smallest_gap, mean_gap, largest_gap: distances of these nodes to that other part (length), or None.
    """

    overlap_area: float
    penetration_depth: float
    penetration_point: tuple[float, float] | None
    contact_nodes: int
    smallest_gap: float | None
    mean_gap: float | None
    largest_gap: float | None

    @property
    def interpenetrates(self) -> bool:
        """Whether solids overlap by more than rounding."""
        return self.overlap_area > 0.0 or self.penetration_depth > 0.0

    def as_dict(self) -> dict[str, Any]:
        """Plain values for result files."""
        return {**asdict(self), "interpenetrates": self.interpenetrates}

    def summary(self) -> str:
        """One line for a terminal."""
        if self.interpenetrates:
            where = "" if self.penetration_point is None else " at ({:.4g}, {:.4g})".format(*self.penetration_point)
            state = f"solids overlap: depth {self.penetration_depth:.2e}{where}, area {self.overlap_area:.2e}"
        else:
            state = "no interpenetration"
        if not self.contact_nodes:
            return f"{state}, no contact"
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
        return ContactReport(0.0, 0.0, None, 0, None, None, None)
    solids = Solids(fields, is_solid, order, pieces)
    size = solids.size
    outline = solids.chains(solids.outline())
    overlap, is_covered_twice = _overlap(solids)
    depth, place = _deepest(solids, outline) if is_covered_twice else (0.0, None)
    gaps = closed_gaps(outline, CLOSED, NEAR * size)
    return ContactReport(
        overlap_area=overlap if overlap > ROUNDING * size**2 else 0.0,
        penetration_depth=depth,
        penetration_point=place,
        contact_nodes=len(gaps),
        smallest_gap=float(gaps.min()) if len(gaps) else None,
        mean_gap=float(gaps.mean()) if len(gaps) else None,
        largest_gap=float(gaps.max()) if len(gaps) else None,
    )


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


def _deepest(solids: Solids, outline: Chains) -> tuple[float, tuple[float, float] | None]:
    """Depth and place of the outline's point that lies deepest in a cell that it does not belong to.

    The depth is the distance to the outline, without the part that the point itself is on: one side of its own body to
    either end. Of equally deep points the place is that of the lowest, so that it does not depend on the numbering.
    """
    where = _inside(solids, outline)
    if not len(where[0]):
        return 0.0, None
    body = solids.bodies()
    own = float(np.hypot(*(outline.before[:, -1] - outline.before[:, 0]).T).max())
    distance = distances_beyond(outline, where, body[outline.cell], own)
    depth = float(distance.max())
    if not depth > 0.0:
        return 0.0, None
    deepest = outline.now[where][distance >= (1.0 - EQUAL) * depth]
    x, y = deepest[np.lexsort(deepest.T)[0]]
    return depth, (float(x), float(y))


def _inside(solids: Solids, outline: Chains) -> tuple[Int, Int]:
    """Points of the outline (side, position in it) that are inside a cell, and not on its outline."""
    import shapely

    ids = outline.ids[:, :-1]
    _, first = np.unique(ids, return_index=True)
    points = shapely.points(outline.now[:, :-1].reshape(-1, 2)[first])
    point, cell = shapely.STRtree(solids.boxes()).query(points, predicate="intersects")
    cells, number = np.unique(cell, return_inverse=True)
    polygons = solids.polygons(cells)
    shapely.prepare(polygons)
    within = shapely.within(points[point], polygons[number])
    side, position = np.unravel_index(first[np.unique(point[within])], ids.shape)
    return side, position
