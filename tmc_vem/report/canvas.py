"""Drawing with matplotlib's renderer Agg, without its figures and axes: loading those takes longer than a picture.

Lengths are in pixels, from the lower left corner, unless they are named points (1/72 inch).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Box = tuple[float, float, float, float]  # left, bottom, width, height

BLACK, TICK = (0.0, 0.0, 0.0), 3.5  # length of a tick in points
STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)


class Canvas:
    """A white picture to draw on.

    Args:
        width, height: in inches.
        dpi: pixels per inch.
    """

    def __init__(self, width: float, height: float, dpi: float) -> None:
        from matplotlib.backends.backend_agg import RendererAgg
        from matplotlib.transforms import IdentityTransform

        self.width, self.height, self.point = round(width * dpi), round(height * dpi), dpi / 72.0
        self._renderer = RendererAgg(self.width, self.height, dpi)
        self._as_it_is = IdentityTransform()
        self._pixels = np.asarray(self._renderer.buffer_rgba())  # (height, width, 4), the highest row first
        self._pixels[:] = 255

    def fill(self, path: Any, colour: Sequence[float] | Float) -> None:
        """Fill a path, every pixel in full or not at all, so that no gaps show between neighbours."""
        gc = self._renderer.new_gc()
        gc.set_linewidth(0.0)
        gc.set_antialiased(False)
        self._renderer.draw_path(gc, path, self._as_it_is, tuple(colour))

    def shade(self, box: Box, colours: Float) -> None:
        """Fill a box with colours (n, 3) from left to right."""
        left, bottom, width, height = map(round, box)
        columns = (np.arange(width) * len(colours)) // width
        rows = slice(self.height - bottom - height, self.height - bottom)
        self._pixels[rows, left : left + width, :3] = np.round(255.0 * colours[columns])

    def stroke(self, path: Any, points: float, colour: Sequence[float] = BLACK, alpha: float = 1.0) -> None:
        """Draw a path as a line, its width in points."""
        gc = self._renderer.new_gc()
        gc.set_linewidth(points)
        gc.set_foreground(tuple(colour), isRGBA=False)
        gc.set_alpha(alpha)
        gc.set_joinstyle("round")
        self._renderer.draw_path(gc, path, self._as_it_is, None)

    def text(
        self, x: float, y: float, text: str, points: float = 10.0, *, across: float = 0.5, up: float = 0.0,
        style: str = "normal",
    ) -> float:  # fmt: skip
        """Write a line; its width.

        Args:
            x, y: where.
            text: the line.
            points: size.
            across, up: which part of the text is there: 0 for its left and its lowest part, 1 for its right and top.
            style: 'normal' or 'italic'.
        """
        from matplotlib.font_manager import FontProperties

        font = FontProperties(size=points, style=style)
        width, height, descent = self._renderer.get_text_width_height_descent(text, font, False)
        left, base = x - across * width, y - up * height + descent
        self._renderer.draw_text(self._renderer.new_gc(), round(left), round(self.height - base), text, font, 0.0)
        return float(width)

    def scale(self, box: Box, side: str, low: float, high: float) -> None:
        """Ticks with numbers along the lower or the left side of a box.

        Args:
            box: the box.
            side: 'below' or 'left'.
            low, high: values at the ends.
        """
        left, bottom, width, height = box
        length = width if side == "below" else height
        tick, lines = TICK * self.point, []
        for value, label in ticks(low, high, int(np.clip(length / (72.0 * self.point) * 1.4, 2, 9))):
            along = (value - low) / (high - low) * length
            if side == "below":
                lines.append([(left + along, bottom), (left + along, bottom - tick)])
                self.text(left + along, bottom - 2.0 * tick, label, up=1.0)
            else:
                lines.append([(left, bottom + along), (left - tick, bottom + along)])
                self.text(left - 2.0 * tick, bottom + along, label, across=1.0, up=0.5)
        if lines:
            self.stroke(polylines(np.array(lines)), 0.8)

    def save(self, path: Path) -> None:
        """Write a PNG file.

        Raises:
            OSError: it could not be written.
        """
        from PIL import Image

        from tmc_vem.support.files import whole_file

        pixels = np.ascontiguousarray(self._pixels[..., :3])
        with whole_file(path, durable=False) as temporary:
            Image.fromarray(pixels).save(temporary, format="PNG", compress_level=1)


def ticks(low: float, high: float, most: int) -> list[tuple[float, str]]:
    """Round values between two others, with as many decimals as they need."""
    rough = (high - low) / most
    unit = 10.0 ** np.floor(np.log10(rough))
    step = unit * next(step for step in STEPS if step * unit >= rough * (1.0 - 1e-9))
    values = step * np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1) + 0.0
    most_digits, largest = 20, float(np.abs(values).max(initial=step))
    decimals = next((n for n in range(most_digits) if abs(round(step, n) - step) <= 1e-9 * step), most_digits)
    plain = decimals <= 5 and largest < 1e6
    digits = int(np.clip(np.ceil(np.log10(largest / step)) + 2.0, 4, most_digits))
    labels = [f"{value:.{decimals}f}" if plain else f"{value:.{digits}g}" for value in values]
    return [(float(value), label.replace("-", "\N{MINUS SIGN}")) for value, label in zip(values, labels, strict=True)]


def rectangle(box: Box) -> Any:
    """Path round a box."""
    left, bottom, width, height = box
    x, y = left + width, bottom + height
    return loops(np.array([[left, bottom], [x, bottom], [x, y], [left, y]]), np.array([0, 4]))


def loops(points_nx: Float, starts: Int) -> Any:
    """One path of closed loops through points (n, 2); ``starts`` (n_loops + 1,) says where each begins, and the end."""
    from matplotlib.path import Path as Line

    sizes = np.diff(starts)
    entries = np.insert(np.arange(len(points_nx)), starts[1:], starts[:-1])  # back to the first point of each
    ends = np.cumsum(sizes + 1)
    codes = np.full(len(entries), Line.LINETO, dtype=Line.code_type)
    codes[ends - sizes - 1], codes[ends - 1] = Line.MOVETO, Line.CLOSEPOLY
    return Line(points_nx[entries], codes)


def polylines(points_nkx: Float) -> Any:
    """One path of n open lines through k points each."""
    from matplotlib.path import Path as Line

    n, k, _ = points_nkx.shape
    codes = np.tile(np.array([Line.MOVETO, *[Line.LINETO] * (k - 1)], dtype=Line.code_type), n)
    return Line(points_nkx.reshape(-1, 2), codes)
