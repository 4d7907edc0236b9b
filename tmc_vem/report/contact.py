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

Float = NDArray[np.float64]
Int = NDArray[np.int64]

MEDIUM = "medium"
# Points are in contact if they are now closer than this fraction of their distance in the reference state ...
CLOSED = 0.1
# ... and than this fraction of the domain's size.
NEAR = 0.05
# Overlaps below this fraction of the domain's size squared are rounding of the polygon operations.
ROUNDING = 1e-12


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


def check_contact(fields: Fields, order: int = 2, samples: int = 8) -> ContactReport:
    """Check a state for interpenetration and measure the gap along contact.

    Solids are all regions whose name does not start with ``medium``. The displacement along a side is a polynomial
    through its nodes; with the chords between the nodes alone, bodies that touch along a curve would seem to overlap.

    Args:
        fields: the whole state; with several ranks, gathered on one.
        order: polynomial degree along the sides, so that each has ``order - 1`` nodes between its vertices.
        samples: straight pieces for each side.

    Returns:
        The report; without any solid, an empty one.
    """
    import shapely

    polygons = fields.polygons
    is_solid = np.array([not name.startswith(MEDIUM) for name in polygons.region_names])[polygons.region_c]
    if not is_solid.any():
        return ContactReport(0.0, 0.0, None, 0, None, None, None)
    reference, deformed, solid = _sampled(fields, np.flatnonzero(is_solid), order, samples)
    size = float(np.ptp(reference, axis=0).max())
    # a cell of a run that went astray may cross itself, which set operations refuse
    cells = shapely.make_valid(np.array([shapely.Polygon(deformed[loop]) for loop in solid]))
    sides = _outline(solid)
    overlap = float(shapely.area(cells).sum() - shapely.area(shapely.union_all(cells)))
    depth, place = _deepest(cells, solid, sides, reference, deformed, samples)
    gaps = _gaps(sides, reference, deformed, size)
    return ContactReport(
        overlap_area=overlap if overlap > ROUNDING * size**2 else 0.0,
        penetration_depth=depth,
        penetration_point=place,
        contact_nodes=len(gaps),
        smallest_gap=float(gaps.min()) if len(gaps) else None,
        mean_gap=float(gaps.mean()) if len(gaps) else None,
        largest_gap=float(gaps.max()) if len(gaps) else None,
    )


def _sampled(fields: Fields, cells: Int, order: int, samples: int) -> tuple[Float, Float, list[Int]]:
    """Reference and deformed points along the sides of some cells, and the cells as loops of them."""
    polygons = fields.polygons
    sides = np.concatenate([_side_nodes(polygons.cell(c), order) for c in cells.tolist()])
    n_sides = np.diff(polygons.offsets)[cells] // order
    nodes = np.arange(order + 1) / order
    at = polygons.points_nx[sides]
    length = np.hypot(*np.moveaxis(at[:, -1:] - at[:, :1], -1, 0))
    nodes_sn = np.hypot(*np.moveaxis(at - at[:, :1], -1, 0)) / length  # where the nodes are along their side
    nodes = nodes_sn[0] if len(nodes_sn) else nodes
    t = np.arange(samples) / samples
    lagrange = np.ones((samples, order + 1))
    for a in range(order + 1):
        for b in range(order + 1):
            if a != b:
                lagrange[:, a] *= (t - nodes[b]) / (nodes[a] - nodes[b])
    reference = np.einsum("ta,sax->stx", lagrange, at).reshape(-1, 2)
    moved = at + fields.displacement_ni[sides]
    deformed = np.einsum("ta,sax->stx", lagrange, moved).reshape(-1, 2)
    size = float(np.ptp(reference, axis=0).max())
    rounded = np.round(reference / (1e-9 * size)).astype(np.int64)
    _, first, label = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    loops = np.split(label.reshape(-1), np.cumsum(n_sides * samples)[:-1])
    return reference[first], deformed[first], loops


def _side_nodes(loop: Int, order: int) -> Int:
    """Nodes (n_sides, order + 1) of every side, its two vertices included."""
    inner = loop.reshape(-1, order)
    nodes: Int = np.column_stack([inner, np.roll(inner[:, 0], -1)])
    return nodes


def _outline(loops: list[Int]) -> Int:
    """Sides (n, 2) that belong to one of the cells only."""
    start = np.concatenate(loops)
    end = np.concatenate([np.roll(loop, -1) for loop in loops])
    n = int(start.max()) + 1
    key = np.minimum(start, end) * n + np.maximum(start, end)
    _, inverse, counts = np.unique(key, return_inverse=True, return_counts=True)
    once = counts[inverse] == 1
    return np.column_stack([start[once], end[once]])


def _deepest(
    cells: NDArray[Any], loops: list[Int], sides: Int, reference: Float, deformed: Float, samples: int
) -> tuple[float, tuple[float, float] | None]:
    """Depth and place of the outline's point that lies deepest in a cell that it does not belong to.

    The depth is the distance to the outline, without the part that the point itself is on: one side of its own body to
    either end.
    """
    import shapely

    nodes = np.unique(sides)
    points = shapely.points(deformed[nodes])
    node, cell = shapely.STRtree(cells).query(points, predicate="within")
    inside = {int(nodes[n]): n for n, c in zip(node.tolist(), cell.tolist(), strict=True) if nodes[n] not in loops[c]}
    now, before = shapely.linestrings(deformed[sides]), shapely.linestrings(reference[sides])
    body = _bodies(loops, len(reference))
    own = samples * float(np.hypot(*(reference[sides[:, 1]] - reference[sides[:, 0]]).T).max())
    depth, place = 0.0, None
    for v, n in inside.items():
        others = (body[sides[:, 0]] != body[v]) | (shapely.distance(shapely.points(reference[v]), before) > own)
        distance = float(shapely.distance(points[n], now[others]).min()) if others.any() else 0.0
        if distance > depth:
            depth, place = distance, (float(deformed[v, 0]), float(deformed[v, 1]))
    return depth, place


def _bodies(loops: list[Int], n_points: int) -> Int:
    """Number of the connected body of every point."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    start, end = np.concatenate(loops), np.concatenate([np.roll(loop, -1) for loop in loops])
    graph = coo_array((np.ones(len(start)), (start, end)), shape=(n_points, n_points))
    body: Int = connected_components(graph, directed=False)[1]
    return body


def _gaps(sides: Int, reference: Float, deformed: Float, size: float) -> Float:
    """Distances of the outline's nodes to parts of the outline that they have come close to."""
    import shapely

    nodes = np.unique(sides)
    now, before = shapely.linestrings(deformed[sides]), shapely.linestrings(reference[sides])
    node, side = shapely.STRtree(now).query(shapely.points(deformed[nodes]), predicate="dwithin", distance=NEAR * size)
    distance = shapely.distance(shapely.points(deformed[nodes[node]]), now[side])
    origin = shapely.distance(shapely.points(reference[nodes[node]]), before[side])
    closed = (distance < CLOSED * origin) & (sides[side] != nodes[node][:, None]).all(axis=1)
    smallest = np.full(len(nodes), np.inf)
    np.minimum.at(smallest, node[closed], distance[closed])
    found: Float = smallest[np.isfinite(smallest)]
    return found
