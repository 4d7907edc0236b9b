"""Pictures of states, by the colours of their pixels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib import colormaps
from PIL import Image

from tmc_vem.problems import Box
from tmc_vem.report.canvas import Canvas, ticks
from tmc_vem.report.figures import ABOVE, BELOW, DPI, LEFT, WIDTH, border_lines, draw_deformed
from tmc_vem.report.panels import draw_panels
from tmc_vem.report.problem_figure import draw_problem
from tmc_vem.system.fields import Fields, Polygons

VIRIDIS = colormaps["viridis"](np.linspace(0.0, 1.0, 256))[:, :3]


def squares(n: int, regions: list[int], uy: list[float]) -> Fields:
    """A row of unit squares, each with points of its own (as cells of several ranks) and moved as a whole."""
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    points = np.concatenate([corners + np.array([c, 0]) for c in range(n)])
    polygons = Polygons(
        points, 4 * np.arange(n + 1), np.arange(4 * n), np.array(regions), ("solid", "medium", "other"), ("medium",)
    )
    displacement = np.column_stack([np.zeros(4 * n), np.repeat(uy, 4)])
    return Fields(polygons, displacement, *np.zeros((3, n)))


def pixels(path: Path) -> np.ndarray:
    return np.asarray(Image.open(path).convert("RGB")) / 255.0


def test_cells_have_the_colours_of_their_displacements(tmp_path: Path) -> None:
    draw_deformed(squares(4, [0, 1, 2, 1], [-0.2, -0.1, 0.0, 0.1]), tmp_path / "a.png", "a title")
    image = pixels(tmp_path / "a.png")
    width = image.shape[1]
    assert width == WIDTH * DPI
    for c, (colour, strength) in enumerate(((0, 1.0), (85, 0.35), (171, 1.0), (255, 0.35))):
        expected = 1.0 - strength * (1.0 - VIRIDIS[colour])
        # columns: 5 percent of 4.0 on both sides of the cells
        column = image[:, round(width * (LEFT + 0.89 * (0.2 + c + 0.3) / 4.4))]
        near = np.abs(column - expected).max(axis=1) < 0.02
        # the widest run of that colour is the cell, of a height of about a unit
        assert near.sum() == pytest.approx(0.89 * width / 4.4, rel=0.15), c
    assert (image[0] == 1.0).all()
    assert (image[:, 0] == 1.0).all()


def test_the_solids_are_outlined_and_the_medium_is_not(tmp_path: Path) -> None:
    """Dark pixels along a row through the cells: frame, sides around the two solid squares together, frame."""
    draw_deformed(squares(4, [1, 0, 2, 1], [0.0, 0.1, 0.1, 0.1]), tmp_path / "a.png")
    image = pixels(tmp_path / "a.png")
    room = image.shape[0] - (ABOVE + BELOW) * DPI
    dark = np.flatnonzero(image[round(ABOVE * DPI + 0.5 * room) - 20].max(axis=1) < 0.3)
    lines = [group.mean() for group in np.split(dark, np.flatnonzero(np.diff(dark) > 3) + 1)][-4:]
    shares = (np.array(lines) - lines[0]) / (lines[-1] - lines[0])
    assert shares == pytest.approx([0.0, 1.2 / 4.4, 3.2 / 4.4, 1.0], abs=3e-3)  # 5 percent on both sides of the cells


def test_sides_of_small_cells_are_left_out(tmp_path: Path) -> None:
    n = 2000
    draw_deformed(squares(n, [0] * n, np.linspace(0, 1, n).tolist()), tmp_path / "many.png")
    colours = pixels(tmp_path / "many.png").reshape(-1, 3)
    assert np.abs(colours[:, None] - VIRIDIS[[20, 128, 235]]).max(axis=2).min(axis=0).max() < 0.01


def test_the_outline_leaves_out_sides_between_cells_whatever_their_points_are_called() -> None:
    fields = squares(5, [0, 0, 1, 0, 1], [0.0] * 5)
    polygons = fields.polygons
    lines = border_lines(polygons.offsets, polygons.connectivity, polygons.region_c == 0, polygons.points_nx)
    lengths = sorted(np.hypot(*np.diff(line, axis=0).T).sum() for line in lines)
    assert lengths == pytest.approx([4.0, 6.0])
    assert border_lines(polygons.offsets, polygons.connectivity, polygons.region_c == 7, polygons.points_nx) == []


@pytest.mark.parametrize(
    ("low", "high", "labels"),
    [
        (-1.0, 0.0, ["−1.0", "−0.8", "−0.6", "−0.4", "−0.2", "0.0"]),
        (-0.076, 1.6, ["0.00", "0.25", "0.50", "0.75", "1.00", "1.25", "1.50"]),
        (0.0, 3e-7, ["0", "5e−08", "1e−07", "1.5e−07", "2e−07", "2.5e−07", "3e−07"]),
        (1.1e7, 1.35e7, ["1.1e+07", "1.15e+07", "1.2e+07", "1.25e+07", "1.3e+07", "1.35e+07"]),
        (17.0, 61.0, ["20", "30", "40", "50", "60"]),
    ],
)
def test_ticks_are_round_numbers(low: float, high: float, labels: list[str]) -> None:
    found = ticks(low, high, 7)
    assert [label for _, label in found] == labels
    assert all(low - 1e-9 * abs(low) <= value <= high + 1e-9 * abs(high) for value, _ in found)
    for value, label in found:
        assert float(label.replace("−", "-")) == pytest.approx(value, rel=1e-12)


def test_panels_show_all_of_every_state_to_one_scale() -> None:
    """Also of the larger one beside a small one, moved far out of its place."""
    low, wide = squares(2, [0, 1], [0.0, 3.0]), squares(9, [0] * 9, [-1.0] * 9)
    figure = draw_panels([("low", low), ("wide", wide)])
    figure.canvas.draw()
    scales = []
    for axes, fields in zip(figure.axes, (low, wide), strict=False):
        points = fields.polygons.points_nx + fields.displacement_ni
        for (first, last), values in zip((axes.get_xlim(), axes.get_ylim()), points.T, strict=True):
            assert first < values.min()
            assert values.max() < last
        box = axes.get_window_extent()
        scales += [box.width / np.diff(axes.get_xlim())[0], box.height / np.diff(axes.get_ylim())[0]]
    assert scales == pytest.approx([scales[0]] * 4)


def test_a_picture_of_a_problem_shows_all_of_it_with_a_margin() -> None:
    box = Box(cells=(20, 5))
    mesh = box.make_mesh()
    (axes,) = draw_problem(mesh, ["medium"], box.prescribed(), box.load(), box.probes()).axes
    low, high, extent = mesh.points_vx.min(axis=0), mesh.points_vx.max(axis=0), np.ptp(mesh.points_vx, axis=0)
    for axis, limits in enumerate((axes.get_xlim(), axes.get_ylim())):
        assert 0.02 * extent.max() < low[axis] - limits[0] == pytest.approx(limits[1] - high[axis])


def test_a_picture_that_cannot_be_written_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="none"):
        Canvas(1.0, 1.0, 50).save(tmp_path / "none" / "a.png")
