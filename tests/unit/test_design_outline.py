"""Outlines of designs: densities of known shapes, on quadrilaterals and Voronoi cells."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from tmc_vem.design.extract import Outlines, contour
from tmc_vem.design.extract_options import ExtractOptions
from tmc_vem.design.outline import DensityField, density_field
from tmc_vem.design.outline_domain import Domain, chains
from tmc_vem.design.outline_smooth import Smoother, blunted, offset_line, resampled, spaced, taubin
from tmc_vem.mesh.make.outline import Region
from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
from tmc_vem.mesh.make.voronoi import voronoi_mesh
from tmc_vem.mesh.parts import with_names
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]

KINDS = ("quadrilaterals", "voronoi")
SQUARE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
NAMES = {"design": ("solid", "medium")}
MIDDLE = shapely.Point(0.5, 0.5)
C_SHAPE = MIDDLE.buffer(0.32, 64) - MIDDLE.buffer(0.17, 64) - shapely.box(0.5, 0.45, 1, 0.55)


@functools.cache
def square(kind: str, n: int) -> PolygonMesh:
    """Unit square with cells of size 1/n, its left and right sides named."""
    if kind == "voronoi":
        mesh = voronoi_mesh([Region("design", SQUARE)], 1.0 / n)
    else:
        lines = np.linspace(0.0, 1.0, n + 1)
        mesh = structured_quadrilaterals(lines, lines, [Rectangle("design", 0.0, 1.0, 0.0, 1.0)])
    return with_names(mesh, None, {"wall": ((0.0, 0.0), (0.0, 1.0)), "right": ((1.0, 0.0), (1.0, 1.0))})


@functools.cache
def polygons(kind: str, n: int) -> Any:
    mesh = square(kind, n)
    return np.array([shapely.Polygon(mesh.points_vx[loop]) for loop in mesh.cells()])


def fractions(kind: str, n: int, shape: Any) -> Float:
    """(n_cells,) how much of every cell a shape covers."""
    cells = polygons(kind, n)
    return np.asarray(shapely.area(shapely.intersection(cells, shape)) / shapely.area(cells))


def field_of(kind: str, n: int, shape: Any) -> DensityField:
    mesh = square(kind, n)
    return density_field(mesh, fractions(kind, n, shape), np.ones(mesh.n_cells, dtype=bool))


def outlines(
    kind: str, n: int, shape: Any, held: tuple[str, ...] = (), loaded: tuple[str, ...] = (), **options: Any
) -> Outlines:
    domain = Domain(square(kind, n), ("design",), (), held, loaded)
    return contour(domain, fractions(kind, n, shape), NAMES, ExtractOptions(**options))


# -- level lines -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_lines_enclose_what_is_above_the_level(kind: str) -> None:
    """Polygons through the lines have the area of the linear pieces above the level, cut triangle by triangle."""
    field = field_of(kind, 20, shapely.Point(0.05, 0.4).buffer(0.3) | shapely.Point(0.7, 0.6).buffer(0.2))
    for level in (0.2, 0.5, 0.9):
        solid = field.solids(level)
        assert solid.is_valid
        assert len(solid.geoms) == 2
        assert solid.area == pytest.approx(field.area_above(level), rel=1e-12)


def test_a_bar_and_a_gap_of_one_cell_keep_their_widths() -> None:
    solid = field_of("quadrilaterals", 10, shapely.box(0.4, 0.0, 0.5, 1.0)).solids(0.5)
    assert solid.area == pytest.approx(0.1, rel=1e-4)
    assert solid.bounds == pytest.approx((0.4, 0.0, 0.5, 1.0), abs=1e-5)
    solids = field_of("quadrilaterals", 10, shapely.box(0, 0, 0.4, 1) | shapely.box(0.5, 0, 1, 1)).solids(0.5)
    assert solids.area == pytest.approx(0.9, rel=1e-4)
    assert solids.geoms[0].distance(solids.geoms[1]) == pytest.approx(0.1, rel=1e-4)


def test_the_level_with_the_volume_of_the_densities() -> None:
    field = field_of("voronoi", 12, C_SHAPE)
    level = field.level_of_volume()
    assert level != pytest.approx(0.5, abs=1e-4)
    assert field.solids(level).area == pytest.approx(field.volume, rel=1e-8)
    assert outlines("voronoi", 12, C_SHAPE).volume == pytest.approx(field.volume, rel=1e-5)


def test_all_solid() -> None:
    field = field_of("quadrilaterals", 4, shapely.box(-1, -1, 2, 2))
    assert field.solids(0.5).area == pytest.approx(1.0, rel=1e-12)
    assert outlines("quadrilaterals", 4, shapely.box(-1, -1, 2, 2)).volume == pytest.approx(1.0, rel=1e-12)


def test_cells_that_are_not_star_shaped() -> None:
    """An L-shaped cell is cut into triangles of its own corners."""
    points = [(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3), (3, 3)]
    mesh = PolygonMesh.from_cells(points, [[0, 1, 2, 3, 4, 5], [3, 2, 6, 4]])
    field = density_field(mesh, [1.0, 0.0], np.ones(2, dtype=bool))
    assert field.area_above(-1.0) == pytest.approx(9.0)
    assert field.solids(0.5).area == pytest.approx(field.area_above(0.5), rel=1e-12)


@pytest.mark.parametrize(
    ("densities", "message"),
    [
        ([0.1, 0.2, 0.3], "densities have shape (3,) for 16 cells: give one for each cell"),
        ([0.5] * 15 + [np.nan], "cell 15 has density nan: it must be a number from 0 to 1"),
        ([0.5] * 15 + [1.1], "density of cell 15 = 1.1: use -1e-06 to 1"),
    ],
)
def test_densities_that_are_none(densities: list[float], message: str) -> None:
    with pytest.raises(InputError) as refused:
        density_field(square("quadrilaterals", 4), densities, np.ones(16, dtype=bool))
    assert str(refused.value).startswith(message)


def test_no_design_cells() -> None:
    with pytest.raises(InputError, match="no cell is a design cell"):
        density_field(square("quadrilaterals", 4), np.ones(16), np.zeros(16, dtype=bool))


def test_nothing_is_solid() -> None:
    mesh = square("quadrilaterals", 4)
    with pytest.raises(InputError, match=r"nothing is solid at level 0\.5: the densities reach 0\.4 at most"):
        contour(Domain(mesh, ("design",)), np.full(16, 0.4), NAMES, ExtractOptions(level=0.5))
    with pytest.raises(
        InputError, match=r"no level from 0\.01 to 0\.99 has the volume of the densities, 0\.4: they are"
    ):
        contour(Domain(mesh, ("design",)), np.full(16, 0.4), NAMES, ExtractOptions())


def test_densities_of_passive_cells_are_not_read() -> None:
    mesh = structured_quadrilaterals(
        np.linspace(0, 1, 11), np.linspace(0, 1, 11), [Rectangle("design", 0, 1, 0, 1), Rectangle("pad", 0.5, 1, 0, 1)]
    )
    passive = mesh.region_c == mesh.region_names.index("pad")
    found = contour(Domain(mesh, ("design",), ("pad",)), np.where(passive, np.nan, 1.0), NAMES, ExtractOptions())
    assert found.volume == pytest.approx(0.5)
    assert found.faces["pad"].area == pytest.approx(0.5)


# -- outlines of known shapes ------------------------------------------------------------------------------------------


def ring(n: int) -> Any:
    """Annuli at six places."""
    middle = 0.5 + 0.01 * np.sqrt(n) * np.array([np.cos(2.4 * n), np.sin(2.4 * n)])
    return shapely.Point(middle).buffer(0.35, 64) - shapely.Point(middle + 0.03).buffer(0.15, 64)


@pytest.mark.parametrize("kind", KINDS)
def test_outlines_converge(kind: str) -> None:
    """Of an annulus with one hole: the area like the square of the size, what is between outlines a little slower."""
    area, between = np.zeros((2, 2))
    for level, n in enumerate((16, 32)):
        errors = []
        for place in range(6):
            shape = ring(place)
            found = outlines(kind, n, shape, level=0.5)
            assert (found.parts, found.holes, found.notes) == (1, 1, ())
            assert found.solid.is_valid
            errors.append([found.volume / shape.area - 1.0, found.solid.symmetric_difference(shape).area / shape.area])
        area[level], between[level] = np.sqrt(np.mean(np.square(errors), axis=0))[0], np.mean(errors, axis=0)[1]
    assert (area < 2.5 / np.array([16, 32]) ** 2).all()
    assert np.log2(between[0] / between[1]) > 1.1
    assert between[1] < 0.015


@pytest.mark.parametrize("kind", KINDS)
def test_densities_of_zero_and_one(kind: str) -> None:
    """A staircase becomes a smooth outline of the same area."""
    mesh, shape = square(kind, 32), ring(0)
    stairs = np.round(fractions(kind, 32, shape))
    found = contour(Domain(mesh, ("design",)), stairs, NAMES, ExtractOptions())
    assert found.volume == pytest.approx(found.volume_level, rel=1e-5)
    assert found.volume == pytest.approx(shape.area, rel=0.02)
    smooth, rough = (
        found.solid.length,
        density_field(mesh, stairs, np.ones(mesh.n_cells, dtype=bool)).solids(0.5).length,
    )
    assert smooth == pytest.approx(shape.length, rel=0.03)
    assert rough > 1.05 * shape.length


@pytest.mark.parametrize("kind", KINDS)
def test_a_slot_stays_open_or_is_closed(kind: str) -> None:
    """A slot of three cells stays; asked to close gaps of four, it is closed, with a note, and makes a hole."""
    found = outlines(kind, 32, C_SHAPE)
    assert (found.parts, found.holes, found.notes) == (1, 0, ())
    assert found.volume == pytest.approx(C_SHAPE.area, rel=5e-3)
    closed = outlines(kind, 32, C_SHAPE, narrowest=4.0)
    assert (closed.parts, closed.holes) == (1, 1)
    assert any("1 gap(s) narrower than 0.12" in note and "closed" in note for note in closed.notes)
    assert closed.volume == pytest.approx(C_SHAPE.area + 0.1 * 0.15, rel=0.02)


@pytest.mark.parametrize("kind", KINDS)
def test_two_parts_with_a_gap(kind: str) -> None:
    shape = shapely.box(0.0, 0.0, 0.45, 1.0) | shapely.box(0.55, 0.2, 0.9, 0.8)
    found = outlines(kind, 32, shape)
    assert (found.parts, found.holes) == (2, 0)
    assert found.volume == pytest.approx(shape.area, rel=0.01)
    first, second = sorted(found.solid.geoms, key=lambda part: float(part.bounds[0]))
    assert first.distance(second) == pytest.approx(0.1, abs=0.005)


# -- what is removed ---------------------------------------------------------------------------------------------------


def test_specks_and_holes() -> None:
    shape = (shapely.box(0, 0, 0.5, 1) - shapely.box(0.2, 0.4, 0.25, 0.5)) | shapely.box(0.8, 0.8, 0.85, 0.9)
    found = outlines("quadrilaterals", 20, shape)
    assert (found.parts, found.holes) == (1, 0)
    assert [note.partition(",")[0] for note in found.notes] == [
        "1 island(s) smaller than 0.01 removed", "1 hole(s) smaller than 0.01 filled"
    ]  # fmt: skip
    assert found.volume == pytest.approx(0.5, rel=1e-6)
    kept = outlines("quadrilaterals", 20, shape, smallest=0.5)
    assert (kept.parts, kept.holes, kept.notes) == (2, 1, ())


def test_films_are_cut_and_necks_widened() -> None:
    plates = shapely.box(0, 0, 1, 0.3) | shapely.box(0, 0.7, 1, 1)
    film = outlines("quadrilaterals", 20, plates | shapely.box(0.5, 0.3, 0.55, 0.6), narrowest=2.0)
    assert film.parts == 2
    assert "film(s) thinner than 0.1 cut off" in film.notes[0]
    neck = outlines("quadrilaterals", 20, plates | shapely.box(0.5, 0.3, 0.55, 0.7), narrowest=2.0)
    assert neck.parts == 1
    assert "neck(s) thinner than 0.1 widened" in neck.notes[0]
    across = neck.solid.intersection(shapely.LineString([(0, 0.5), (1, 0.5)]))
    assert 0.08 < across.length < 0.13


def test_parts_that_carry_nothing() -> None:
    shape = shapely.box(0.0, 0.4, 1.0, 0.6) | shapely.box(0.3, 0.8, 0.7, 0.95)
    found = outlines("quadrilaterals", 20, shape, held=("wall",), loaded=("right",), level=0.5)
    assert found.parts == 1
    assert "1 part(s) that carry nothing removed" in found.notes[0]
    assert "near (0.5, 0.8" in found.notes[0]
    assert found.volume == pytest.approx(0.2, rel=1e-3)


def test_not_connected() -> None:
    with pytest.raises(InputError, match=r"the solid is not connected to a support: 'wall' is nearest, 0\.3 away"):
        outlines("quadrilaterals", 20, shapely.box(0.3, 0.4, 1.0, 0.6), held=("wall",), loaded=("right",))
    with pytest.raises(InputError, match=r"load: nothing is solid at 'right', the nearest solid is 0\.2 away"):
        outlines("quadrilaterals", 20, shapely.box(0.0, 0.4, 0.8, 0.6), held=("wall",), loaded=("right",))
    apart = shapely.box(0.0, 0.4, 0.4, 0.6) | shapely.box(0.6, 0.4, 1.0, 0.6)
    found = outlines("quadrilaterals", 20, apart, held=("wall",), loaded=("right",), level=0.5)
    assert "the part under load 'right', near (0.8, 0.5), has no support of its own" in found.notes[0]
    with pytest.raises(InputError, match="'nothing' is neither a point nor edges of the mesh"):
        outlines("quadrilaterals", 20, apart, held=("nothing",))
    with pytest.raises(InputError, match="there is no region 'other'"):
        Domain(square("quadrilaterals", 4), ("other",))


def test_islands_only() -> None:
    with pytest.raises(InputError, match="nothing is solid but islands of less than smallest = 4 cells"):
        outlines("quadrilaterals", 20, shapely.box(0.5, 0.5, 0.6, 0.55))


def test_a_volume_that_is_not_kept() -> None:
    """Waves of a few cells go with enough passes, and what stands then is another shape; the volume says so."""
    with pytest.raises(InputError, match="smoothing changes the volume of the solid by"):
        outlines("quadrilaterals", 20, shapely.Point(0.5, 0.5).buffer(0.07), smoothing=1000, volume=1e-9, smallest=1)


# -- named places ------------------------------------------------------------------------------------------------------


def test_outlines_go_to_named_points_nearby() -> None:
    """A load just beside the solid, on a border or inside, is on its outline; so is the end of a loaded edge."""
    mesh = with_names(
        square("quadrilaterals", 20), {"side": (1.0, 0.5), "inside": (0.5, 0.5), "below": (0.3, 0.0)},
        {"patch": ((1.0, 0.5), (1.0, 0.8))},
    )  # fmt: skip
    mesh_density = fractions("quadrilaterals", 20, shapely.box(0, 0.52, 1, 0.8))
    for name in ("side", "inside", "patch"):
        found = contour(Domain(mesh, ("design",), (), ("wall",), (name,)), mesh_density, NAMES, ExtractOptions())
        x, y = (0.5, 0.5) if name == "inside" else (1.0, 0.5)
        assert found.solid.boundary.distance(shapely.Point(x, y)) < 1e-12
        assert found.solid.distance(shapely.Point(x, y - 0.01)) == pytest.approx(0.01, rel=0.05)
    with pytest.raises(InputError, match=r"load: nothing is solid at 'below', the nearest solid is 0\.5"):
        contour(Domain(mesh, ("design",), (), ("wall",), ("below",)), mesh_density, NAMES, ExtractOptions())


def test_outlines_keep_clear_of_borders() -> None:
    """A line that smoothing has brought close to a border, or to a corner of a passive region, is half a cell away."""
    lines = np.linspace(0.0, 1.0, 21)
    block = Rectangle("block", 0.5, 1.0, 0.0, 0.5)
    domain = Domain(structured_quadrilaterals(lines, lines, [Rectangle("design", 0, 1, 0, 1), block]), ("design",))
    smoother = Smoother(domain.room, domain, 0.05, ExtractOptions(narrowest=0.5))
    along = smoother._clear(np.array([[0.0, 0.7], [0.01, 0.75], [0.2, 0.8], [0.49, 0.52], [0.6, 0.9]]))
    assert along[0].tolist() == [0.0, 0.7]
    assert along[1].tolist() == pytest.approx([0.025, 0.75])
    assert shapely.Point(0.5, 0.5).distance(shapely.LineString(along)) > 0.024


# -- lines -------------------------------------------------------------------------------------------------------------


def circle(n: int, radius: float = 1.0) -> Float:
    angle = np.linspace(0.0, 2.0 * np.pi, n + 1)
    points: Float = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    points[-1] = points[0]
    return points


def test_smoothing_keeps_long_waves_and_ends() -> None:
    line = circle(40)
    assert np.abs(np.hypot(*taubin(line, 20).T) - 1.0).max() < 0.01
    stairs = line * (1.0 + 0.05 * (-1.0) ** np.arange(41)[:, None])
    stairs[-1] = stairs[0]
    assert np.abs(np.hypot(*taubin(stairs, 20).T) - 1.0).max() < 0.01
    open_line = np.column_stack([np.arange(20.0), 0.3 * (-1.0) ** np.arange(20)])
    smooth = taubin(open_line, 20)
    assert (smooth[[0, -1]] == open_line[[0, -1]]).all()
    assert np.abs(smooth[5:-5, 1]).max() < 0.01


def test_offsets_are_to_the_right() -> None:
    assert np.hypot(*offset_line(circle(60), 0.1).T) == pytest.approx(1.1, abs=1e-3)
    straight = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
    assert offset_line(straight, 0.5).tolist() == [[0.0, -0.5], [1.0, -0.5], [2.0, -0.5]]


def test_points_at_equal_distances() -> None:
    line = np.array([[0.0, 0.0], [0.1, 0.0], [3.0, 0.0], [3.0, 1.0]])
    points = resampled(line, 0.5)
    assert (points[[0, -1]] == line[[0, -1]]).all()
    assert np.abs(np.diff(points, axis=0)).sum(axis=1) == pytest.approx(0.5)
    assert len(resampled(line, 100.0)) == 5
    assert spaced(np.array([[0.0, 0.0], [0.1, 0.0], [1.0, 0.0], [1.95, 0.0], [2.0, 0.0]]), 0.2).tolist() == [
        [0.0, 0.0], [1.0, 0.0], [2.0, 0.0]
    ]  # fmt: skip


def test_sharp_turns_are_cut() -> None:
    hairpin = np.array([[0.0, 0.0], [2.0, 0.2], [0.0, 0.4]])
    points = blunted(hairpin)
    arms = np.diff(points, axis=0)
    turns = (arms[:-1] * arms[1:]).sum(axis=1) / (np.hypot(*arms[:-1].T) * np.hypot(*arms[1:].T))
    assert np.degrees(np.arccos(turns)).max() <= 70.0 + 1e-9
    assert (points[[0, -1]] == hairpin[[0, -1]]).all()
    closed = blunted(np.array([[0.0, 0.0], [2.0, 0.2], [0.0, 0.4], [0.0, 0.0]]))
    assert (closed[0] == closed[-1]).all()
    assert shapely.Polygon(closed).is_valid
    assert (blunted(circle(12)) == circle(12)).all()


def test_chains_of_edges() -> None:
    edges = np.array([[0, 1], [2, 1], [2, 3], [5, 6], [6, 7], [7, 5], [3, 8], [3, 9]])
    found = sorted(chains(edges, [1]))
    assert found == [[0, 1], [1, 2, 3], [3, 8], [3, 9], [5, 6, 7, 5]]
