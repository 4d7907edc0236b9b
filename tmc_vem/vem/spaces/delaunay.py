"""The constrained Delaunay triangulation of a simple polygon, which depends on the shape of the polygon alone.

Triangles of any kind, by clipping ears, are improved by flipping diagonals until opposite angles add up to no more than
pi (Lawson). The result is unique but for vertices on one circle, whose triangles are put together to one polygon.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.geometry import areas, diameters

Float = NDArray[np.float64]
Int = NDArray[np.int64]
# Counter-clockwise vertices of triangles, or of polygons.
Loops = list[list[int]]

# A triangle is flat if its area is below this fraction of its longest side squared.
FLAT = 1e-12
# A vertex this close to a diagonal, as a fraction of the diagonal's length, lies on it.
ON_DIAGONAL = 1e-6
# Angles opposite to a diagonal that add up to pi within this have their four vertices on one circle.
COCIRCULAR = 1e-6


def delaunay_pieces(polygon_vx: Float) -> Loops:
    """Vertices of the triangles, and convex polygons inscribed in circles, that a simple polygon consists of.

    Args:
        polygon_vx: (n_sides, 2) counter-clockwise.

    Raises:
        ValueError: the polygon is not simple.
    """
    pieces = ear_clipping(polygon_vx)
    while pair := _take_pair(polygon_vx, pieces, COCIRCULAR, np.inf):
        (a, b, c), (_, _, d) = pair
        pieces += [[a, d, c], [d, b, c]]
    while pair := _take_pair(polygon_vx, pieces, -COCIRCULAR, COCIRCULAR):
        pieces.append(pair[0][1:] + pair[1][1:])
    return pieces


def _take_pair(points: Float, pieces: Loops, least: float, most: float) -> tuple[list[int], list[int]] | None:
    """Take two neighbours out of the pieces, (a, b, c, ...) and (b, a, d, ...), by their angles at c and d less pi."""
    seen: dict[tuple[int, int], tuple[list[int], list[int]]] = {}
    for piece in pieces:
        for s in range(len(piece)):
            turned = piece[s:] + piece[:s]
            a, b, c = turned[:3]
            if (b, a) in seen:
                other, turned_other = seen[b, a]
                excess = _angle(points, a, c, b) + _angle(points, b, turned_other[2], a) - np.pi
                if least < excess <= most:
                    pieces[:] = [p for p in pieces if p is not piece and p is not other]
                    return turned, turned_other
            seen[a, b] = piece, turned
    return None


def _angle(points: Float, a: int, tip: int, b: int) -> float:
    """Angle of a triangle at its tip; pi where that is between the others, whatever rounding makes of it."""
    u, v = points[a] - points[tip], points[b] - points[tip]
    return float(np.arctan2(abs(u[0] * v[1] - u[1] * v[0]), u @ v))


def ear_clipping(polygon_vx: Float) -> Loops:
    """Vertices of n_sides - 2 triangles of any simple counter-clockwise polygon.

    At every step the ear with the largest smallest angle (by area over squared longest side) is cut off, which keeps
    triangles away from degenerate; ears of collinear points come last.

    Raises:
        ValueError: no ear is left, which a simple polygon cannot have.
    """
    remaining = list(range(len(polygon_vx)))
    triangles: Loops = []
    while len(remaining) > 3:
        best = _best_ear(polygon_vx, remaining, ON_DIAGONAL)
        if best < 0:
            best = _best_ear(polygon_vx, remaining, FLAT)
        if best < 0:  # nothing but collinear vertices may be left, and they enclose no area
            rest = polygon_vx[remaining]
            if abs(areas(rest[None])[0]) > FLAT * diameters(rest[None])[0] ** 2:
                raise ValueError("ear clipping found no ear: the polygon is not simple")
            best = 0
        triangles.append([remaining[best - 1], remaining[best], remaining[(best + 1) % len(remaining)]])
        del remaining[best]
    triangles.append(remaining)
    return triangles


def _best_ear(points: Float, remaining: list[int], tolerance: float) -> int:
    """Place in the list of the ear with the largest quality that no other vertex lies in; -1 if there is none."""
    best, best_quality = -1, 0.0
    for n in range(len(remaining)):
        a, b, c = (points[remaining[(n + d) % len(remaining)]] for d in (-1, 0, 1))
        quality = _triangle_quality(a, b, c)
        if quality > best_quality and not _contains_any(points, remaining, n, tolerance):
            best, best_quality = n, quality
    return best


def _triangle_quality(a: Float, b: Float, c: Float) -> float:
    area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    longest = max(np.dot(b - a, b - a), np.dot(c - b, c - b), np.dot(a - c, a - c))
    return float(area / longest) if area > FLAT * longest else 0.0


def _contains_any(points: Float, remaining: list[int], ear: int, tolerance: float) -> bool:
    """Whether the closed triangle of an ear contains another remaining vertex, apart from its own corners.

    A vertex as good as on the diagonal counts as inside, whatever rounding makes of it: else the next ear there would
    have no area.
    """
    corners = [remaining[ear - 1], remaining[ear], remaining[(ear + 1) % len(remaining)]]
    others = points[[v for v in remaining if v not in corners]]
    a, b, c = points[corners]
    inside = np.ones(len(others), dtype=bool)
    for p, q in ((a, b), (b, c), (c, a)):
        twice_area = (q[0] - p[0]) * (others[:, 1] - p[1]) - (q[1] - p[1]) * (others[:, 0] - p[0])
        inside &= twice_area >= -tolerance * np.dot(q - p, q - p)
    return bool(inside.any())
