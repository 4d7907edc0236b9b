"""Pictures of the meshes that a run was adapted on: first, middle and last, and where the error comes from."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.report.figures import border_lines
from tmc_vem.report.labels import label
from tmc_vem.report.panels import WIDE, deformed
from tmc_vem.report.problem_figure import region_colours
from tmc_vem.results.adapted_rounds import ERROR_OF, read_round
from tmc_vem.results.adaptivity import Adaptivity, Round, error_in_words
from tmc_vem.system.fields import Fields

Float = NDArray[np.float64]

WIDTH, HIGHEST = 10.0, 3.3  # inches: the figure, and one panel at most
MARGIN, TITLE, FOOT = 0.15, 0.3, 0.75  # inches: around panels, for their titles, for the colours' scale
DECADES = 3.0  # that the colours of shares go over at most
SHARES = "YlOrRd"
DPI = 110  # of the file


@dataclass(frozen=True)
class _Panel:
    """Cells with their points somewhere, coloured by region or by ``share_c``."""

    fields: Fields
    points: Float
    title: str = ""
    share_c: Float | None = None


@dataclass(frozen=True)
class _Row:
    """Panels beside one another, to the same scale, with a title of their own or one for all."""

    panels: Sequence[_Panel]
    title: str = ""

    def lines(self) -> list[_Row]:
        """The row, or one for each panel if they are much wider than high."""
        extent = np.max([np.ptp(panel.points, axis=0) for panel in self.panels], axis=0)
        if len(self.panels) == 1 or extent[0] <= WIDE * extent[1]:
            return [self]
        return [_Row([panel], self.title if n == 0 else "") for n, panel in enumerate(self.panels)]

    @property
    def _extents(self) -> Float:
        return np.array([1.02 * np.ptp(panel.points, axis=0) for panel in self.panels])

    @property
    def inch(self) -> float:
        """Inches per length."""
        room = WIDTH - MARGIN * (len(self.panels) + 1)
        return float(min(room / self._extents[:, 0].sum(), HIGHEST / self._extents[:, 1].max()))

    @property
    def above(self) -> float:
        """Inches for titles."""
        return TITLE if self.title or any(panel.title for panel in self.panels) else 0.0

    @property
    def height(self) -> float:
        """In inches, with titles and margin."""
        return self.inch * float(self._extents[:, 1].max()) + MARGIN + self.above

    @property
    def spans(self) -> list[tuple[float, float]]:
        """Left ends and widths of the panels in inches, what is left of the figure spread between them."""
        widths = self.inch * self._extents[:, 0]
        between = (WIDTH - widths.sum()) / (len(widths) + 1)
        lefts = between * np.arange(1, len(widths) + 1) + np.cumsum(widths) - widths
        return list(zip(lefts.tolist(), widths.tolist(), strict=True))


def meshes_figure(directory: Path, adaptivity: Adaptivity) -> Any:
    """Undeformed and deformed meshes of three rounds, and the last one that has an estimate, coloured by the share that
    each cell has in the estimated error of each result.

    Args:
        directory: of the run.
        adaptivity: its rounds.

    Raises:
        InputError: a file is missing or not readable.
    """
    chosen = shown_rounds(adaptivity.rounds)
    several = has_several_loads(adaptivity.rounds)
    states = [(title_of(each, load=several), read_round(directory, each.number)) for each in chosen]
    rows = [
        _Row([_Panel(fields, fields.polygons.points_nx, title) for title, fields in states]),
        _Row([_Panel(fields, deformed(fields)) for _, fields in states]),
    ]
    with_estimate = [each for each in adaptivity.rounds if each.estimate]
    if with_estimate:
        last = with_estimate[-1]
        rows += _error_rows(read_round(directory, last.number), last, adaptivity.of)
    return _figure([line for row in rows for line in row.lines()])


def draw_meshes_file(directory: Path, adaptivity: Adaptivity, path: Path) -> None:
    """The same as a PNG file.

    Raises:
        InputError: a file of the rounds is missing or not readable.
        OSError: the picture could not be written.
    """
    from tmc_vem.support.files import whole_file

    with whole_file(path, durable=False) as temporary:
        meshes_figure(directory, adaptivity).savefig(temporary, format="png", dpi=DPI)


def shown_rounds(rounds: Sequence[Round]) -> list[Round]:
    """First and last round, and the one between whose number of cells is nearest to the middle, by ratios."""
    if len(rounds) < 3:
        return list(rounds)
    middle = math.sqrt(rounds[0].n_cells * rounds[-1].n_cells)
    between = min(rounds[1:-1], key=lambda each: abs(math.log(each.n_cells / middle)))
    return [rounds[0], between, rounds[-1]]


def has_several_loads(rounds: Sequence[Round]) -> bool:
    """Whether the mesh was adapted at more than one load."""
    return len({each.load for each in rounds}) > 1


def title_of(round_: Round, of: Sequence[str] = (), *, load: bool = True) -> str:
    """Number, load and cells of a round; with values and estimated errors, if wanted."""
    values = "".join(f", {name} {round_.values[name]:.5g} {error_in_words(round_, name)}" for name in of)
    at = f", load {round_.load:.4g}" if load else ""
    return f"round {round_.number}{at}: {round_.n_cells} cells{values}"


def _error_rows(fields: Fields, round_: Round, of: Sequence[str]) -> list[_Row]:
    rows = []
    for name in of:
        values = fields.cell_fields.get(ERROR_OF + name)
        if values is None or not np.nansum(values) > 0.0:
            continue
        share_c = values / np.nansum(values)
        panels = [_Panel(fields, points, share_c=share_c) for points in (fields.polygons.points_nx, deformed(fields))]
        rows.append(_Row(panels, f"round {round_.number}: where the estimated error of {name} comes from"))
    return rows


def _figure(rows: Sequence[_Row]) -> Any:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure

    shares = [panel.share_c for row in rows for panel in row.panels if panel.share_c is not None]
    scale = _scale(shares) if shares else None
    height = sum(row.height for row in rows) + (FOOT if scale else MARGIN)
    figure = Figure(figsize=(WIDTH, height))
    FigureCanvasAgg(figure)
    top = height
    for row in rows:
        if row.title:
            figure.text(0.5, 1.0 - (height - top + 0.5 * TITLE) / height, label(row.title), fontsize=9, ha="center",
                        va="center")  # fmt: skip
        tall = row.height - row.above - MARGIN
        for panel, (left, wide) in zip(row.panels, row.spans, strict=True):
            box = np.array([left, top - row.above - tall, wide, tall])
            axes = figure.add_axes(tuple(box / (WIDTH, height, WIDTH, height)))
            axes.set_axis_off()
            draw_cells(axes, panel.fields, panel.points, panel.share_c, scale)
            low, high = panel.points.min(axis=0), panel.points.max(axis=0)
            middle, half = 0.5 * (low + high), 0.5 * box[2:] / row.inch
            axes.set_xlim(middle[0] - half[0], middle[0] + half[0])
            axes.set_ylim(middle[1] - half[1], middle[1] + half[1])
            axes.set_title(label(panel.title), fontsize=9, pad=4)
        top -= row.height
    if scale is not None:
        bar = figure.add_axes((0.25, 0.6 * FOOT / height, 0.5, 0.15 * FOOT / height))
        made = figure.colorbar(ScalarMappable(norm=scale, cmap=SHARES), cax=bar, orientation="horizontal", extend="min")
        made.set_label("share of the cell", fontsize=9)
        bar.tick_params(labelsize=8)
    return figure


def _scale(shares: Sequence[Float]) -> Any:
    """Logarithmic norm for shares of cells; those that are far smaller than the largest count as none."""
    from matplotlib.colors import LogNorm

    seen = np.concatenate([values[values > 0.0] for values in shares])
    high = float(seen.max())
    low = max(float(seen.min()), high * 10.0**-DECADES)
    return LogNorm(low if low < high else 0.5 * high, high, clip=True)


def draw_cells(axes: Any, fields: Fields, points: Float, share_c: Float | None = None, scale: Any = None) -> None:
    """Draw cells, solids outlined, coloured by their regions as in pictures of meshes, or by shares.

    Args:
        axes: where.
        fields: whose cells.
        points: (n_points, 2) where their points are.
        share_c: (n_cells,) values for colours.
        scale: norm of these.
    """
    from matplotlib.collections import LineCollection, PolyCollection

    polygons = fields.polygons
    loops = [points[polygons.cell(c)] for c in range(polygons.n_cells)]
    line = float(np.clip(8.0 / math.sqrt(max(polygons.n_cells, 1)), 0.05, 0.4))
    style: dict[str, Any] = {"edgecolors": "0.45", "linewidths": line, "rasterized": True}
    if share_c is not None:
        axes.add_collection(PolyCollection(loops, array=share_c, cmap=SHARES, norm=scale, **style))
    else:
        for number, colour in enumerate(region_colours(polygons.region_names, polygons.media).values()):
            chosen = np.flatnonzero(polygons.region_c == number)
            axes.add_collection(PolyCollection([loops[c] for c in chosen], facecolors=colour, **style))
    lines = border_lines(polygons.offsets, polygons.connectivity, polygons.is_solid_c, points)
    axes.add_collection(LineCollection(lines, colors="black", linewidths=0.7, capstyle="round"))
    axes.set_aspect("equal")
