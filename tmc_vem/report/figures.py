"""Pictures of states."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tmc_vem.report.canvas import Box, Canvas, loops, polylines, rectangle
from tmc_vem.results.contact.solids import same_points
from tmc_vem.system.fields import Fields, Polygons

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]

COLOURS = "viridis"
WIDTH, DPI = 9.0, 130  # inches, pixels per inch
ABOVE, BELOW, LEFT, ACROSS = 0.4, 1.3, 0.08, 0.89  # inches, and fractions of the width
BAR = (0.5, 0.15)  # inches: where the colours' bar begins, and its height
PALE = 0.35  # how strong the medium's colours are
FINEST = 3.0  # pixels: of smaller cells no sides are drawn, they would hide the colours


def draw_deformed(fields: Fields, path: Path, title: str = "", *, component: int = 1) -> None:
    """Draw the deformed configuration, coloured by a displacement component.

    Solid cells are drawn in full colour with a dark outline of the solid; cells of the third medium are pale with
    hairline edges.

    Args:
        fields: the state.
        path: PNG file.
        title: text above the picture.
        component: 0 for u_x, 1 for u_y.

    Raises:
        OSError: the file could not be written.
    """
    from matplotlib import colormaps

    polygons = fields.polygons
    deformed = polygons.points_nx + fields.displacement_ni
    u = fields.displacement_ni[:, component]
    low, high = float(u.min()), float(u.max())
    high = high if high > low else low + 1.0
    sums = np.add.reduceat(u[polygons.connectivity], polygons.offsets[:-1])
    share_c = (sums / np.diff(polygons.offsets) - low) / (high - low)
    full = colormaps[COLOURS](np.linspace(0.0, 1.0, 256))[:, :3]
    pale = 1.0 - PALE * (1.0 - full)
    colour_c = np.clip((256.0 * share_c).astype(int), 0, 255)
    is_medium = ~polygons.is_solid_c

    extent = np.ptp(deformed, axis=0)
    height = float(np.clip(0.85 * WIDTH * extent[1] / extent[0], 1.5, 8.0)) + ABOVE + BELOW
    canvas = Canvas(WIDTH, height, DPI)
    box, scale = _axes(canvas, deformed)
    points = np.array(box[:2]) + scale * (deformed - _corner(deformed))
    for members, colours, width, edge in ((is_medium, pale, 0.15, 0.45), (~is_medium, full, 0.25, 0.25)):
        if not members.any():
            continue
        _fill_cells(canvas, polygons, points, members, colour_c, colours)
        if np.sqrt(scale**2 * extent.prod() / polygons.n_cells) >= FINEST:
            alpha = PALE if members is is_medium else 1.0
            canvas.stroke(polylines(points[_sides(polygons, members)]), width, (edge,) * 3, alpha)
    for line in border_lines(polygons.offsets, polygons.connectivity, ~is_medium, points):
        canvas.stroke(polylines(line[None]), 0.9)
    canvas.stroke(rectangle(box), 0.8)
    canvas.text(box[0] + 0.5 * box[2], box[1] + box[3] + 6.0 * canvas.point, title)
    _draw_bar(canvas, full, low, high, "xy"[component])
    if is_medium.any():
        _draw_legend(canvas, full[128], pale[128])
    canvas.save(path)


def _corner(points: Float) -> Float:
    """Lower left corner of what is shown: 5 percent of the extent around all points."""
    corner: Float = points.min(axis=0) - 0.05 * np.ptp(points, axis=0)
    return corner


def _axes(canvas: Canvas, points: Float) -> tuple[Box, float]:
    """The box in which points are shown, in the middle of the room for it, and pixels per length; with its scales."""
    inch, extent, corner = 72.0 * canvas.point, 1.1 * np.ptp(points, axis=0), _corner(points)
    room = np.array([ACROSS * canvas.width, canvas.height - (ABOVE + BELOW) * inch])
    scale = float((room / extent).min())
    width, height = scale * extent
    left, bottom = np.array([LEFT * canvas.width, BELOW * inch]) + 0.5 * (room - (width, height))
    box = (float(left), float(bottom), float(width), float(height))
    canvas.scale(box, "below", corner[0], corner[0] + extent[0])
    canvas.scale(box, "left", corner[1], corner[1] + extent[1])
    canvas.text(left + 0.5 * width, bottom - 22.0 * canvas.point, "x", up=1.0)
    canvas.text(left - 45.0 * canvas.point, bottom + 0.5 * height, "y", up=0.5)
    return box, scale


def _draw_bar(canvas: Canvas, colours: Float, low: float, high: float, axis: str) -> None:
    """The colours of a displacement component, with its scale."""
    inch = 72.0 * canvas.point
    left, bottom, width, height = LEFT * canvas.width, BAR[0] * inch, ACROSS * canvas.width, BAR[1] * inch
    canvas.shade((left, bottom, width, height), colours)
    canvas.stroke(rectangle((left, bottom, width, height)), 0.8)
    canvas.scale((left, bottom, width, height), "below", low, high)
    x, y = left + 0.5 * width, bottom - 27.0 * canvas.point
    x += canvas.text(x, y, "u", up=0.5, across=0.0, style="italic")
    canvas.text(x, y - 3.0 * canvas.point, axis, 7.0, up=0.5, across=0.0, style="italic")


def _draw_legend(canvas: Canvas, solid: Float, medium: Float) -> None:
    """What full and pale colours mean, below the right end of the bar."""
    point, right = canvas.point, (LEFT + ACROSS) * canvas.width
    y = BAR[0] * 72.0 * point - 27.0 * point
    for label, colour, line, edge in (("third medium", medium, 0.3, 0.45), ("solid", solid, 1.0, 0.0)):
        right -= canvas.text(right, y, label, 8.0, across=1.0, up=0.5) + 28.0 * point
        patch = rectangle((right, y - 4.0 * point, 22.0 * point, 8.0 * point))
        canvas.fill(patch, colour)
        canvas.stroke(patch, line, (edge,) * 3)
        right -= 12.0 * point


def _fill_cells(canvas: Canvas, polygons: Polygons, points: Float, chosen: Bool, colour_c: Int, colours: Float) -> None:
    """Fill the chosen cells, all that have the same of the colours at once."""
    cells = np.flatnonzero(chosen)
    cells = cells[np.argsort(colour_c[cells], kind="stable")]
    sizes = np.diff(polygons.offsets)[cells]
    starts = np.concatenate([[0], np.cumsum(sizes)])
    entries = np.arange(starts[-1]) + np.repeat(polygons.offsets[cells] - starts[:-1], sizes)
    ordered = points[polygons.connectivity[entries]]
    numbers, first = np.unique(colour_c[cells], return_index=True)
    for number, begin, end in zip(numbers, first, [*first[1:], len(cells)], strict=True):
        mine = slice(starts[begin], starts[end])
        canvas.fill(loops(ordered[mine], starts[begin : end + 1] - starts[begin]), colours[number])


def _ends(offsets: Int, connectivity: Int, chosen: Bool) -> Int:
    """Points (n, 2) at the ends of all pieces of the chosen cells' sides."""
    following = np.arange(1, len(connectivity) + 1)
    following[offsets[1:] - 1] = offsets[:-1]
    mine = np.repeat(chosen, np.diff(offsets))
    ends: Int = np.column_stack([connectivity, connectivity[following]])[mine]
    return ends


def _sides(polygons: Polygons, chosen: Bool) -> Int:
    """Points (n, 2) at the ends of the pieces of the chosen cells' sides, every piece once."""
    low, high = np.sort(_ends(polygons.offsets, polygons.connectivity, chosen), axis=1).T
    n = len(polygons.points_nx)
    once = np.unique(low.astype(np.int64) * n + high)
    return np.column_stack([once // n, once % n])


def border_lines(offsets: Int, connectivity: Int, chosen: Bool, points: Float) -> list[Float]:
    """Polylines of all sides that belong to exactly one of the chosen cells, compared by position (points of ranks are
    doubled). They are joined, as dots would show where single sides meet.

    Args:
        offsets: (n_cells + 1,) where each cell starts in ``connectivity``.
        connectivity: points of all cells, in order.
        chosen: (n_cells,) which cells.
        points: (n, 2).
    """
    import shapely

    if not chosen.any():
        return []
    number = same_points(points)
    n = int(number.max()) + 1
    place = np.empty((n, 2))
    place[number] = points
    low, high = np.sort(number[_ends(offsets, connectivity, chosen)], axis=1).T
    sides, count = np.unique(low * n + high, return_counts=True)
    once = np.column_stack([sides // n, sides % n])[(count == 1) & (sides // n != sides % n)]
    if not len(once):
        return []
    joined = shapely.line_merge(shapely.multilinestrings(shapely.linestrings(place[once])))
    return [shapely.get_coordinates(line) for line in shapely.get_parts(joined)]
