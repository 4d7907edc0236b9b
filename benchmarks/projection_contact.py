"""Contact through hanging nodes: the measurements of the box behind docs/projection.md, which this prints.

    python benchmarks/projection_contact.py                 # all, some minutes
    python benchmarks/projection_contact.py medium          # one of them

Studies: points (only the cells at the three loaded nodes are refined), hanging (hanging nodes at the faces of the wall,
against conforming meshes and against refined ones), medium (hanging nodes all over the medium), crushed (squares with
composite functions), cbox (the C-box with various projections). ``scripts/refresh-numbers contact-medium`` measures the
same, keeps it, and writes it into the page.

The printed mean gap is the area between the deformed inner faces of the flanges where ``|X - 1| < 0.1``, over 0.2.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh import PolygonMesh
from tmc_vem.mesh.parts import with_names
from tmc_vem.problems import Box, CBox, Problem
from tmc_vem.problems.materials import Medium
from tmc_vem.results.run_result import RunResult
from tmc_vem.results.snapshots import read_fields, snapshots
from tmc_vem.simulation import RunOptions, run
from tmc_vem.system.fields import Fields
from tmc_vem.vem.spaces.element_settings import ElementSettings

Float = NDArray[np.float64]
Int = NDArray[np.int64]

UNIT = 64  # mesh lines are multiples of 0.1 / UNIT
COLUMNS, ROWS = 20, 5  # squares of 0.1, one of which is the wall
LOADED = ((COLUMNS // 2, ROWS), (0, 0), (COLUMNS, 0))  # load and supports
Split = Callable[[int, int, bool], tuple[int, int]]  # column, row, is it medium -> parts in x and y


@dataclass(frozen=True)
class Tiles:
    """Rectangles ``x0, y0, x1, y1`` in units of 0.1 / UNIT, and whether each is medium."""

    corners_tx: Int
    medium_t: NDArray[np.bool_]

    @staticmethod
    def of(split: Split) -> Tiles:
        """The squares of 0.1, each divided into equal parts."""
        corners, medium = [], []
        for i in range(COLUMNS):
            for j in range(ROWS):
                inside = 0 < i < COLUMNS - 1 and 0 < j < ROWS - 1
                x, y = (UNIT // n * np.arange(n + 1) for n in split(i, j, inside))
                lower, upper = np.meshgrid(x[:-1], y[:-1]), np.meshgrid(x[1:], y[1:])
                corners.append(np.stack([*lower, *upper], axis=-1).reshape(-1, 4) + UNIT * np.array([i, j, i, j]))
                medium += [inside] * len(corners[-1])
        return Tiles(np.concatenate(corners), np.array(medium))

    @staticmethod
    def bricks(n: int) -> Tiles:
        """``n`` x ``n`` parts; every second row of the medium is shifted by half a cell: all its cells but those at the
        ends of the rows have one hanging node on two sides."""
        tiles = Tiles.of(lambda i, j, medium: (n, n))
        corners, h = tiles.corners_tx.copy(), UNIT // n
        shifted = tiles.medium_t & (corners[:, 1] // h % 2 == 1)
        corners[shifted, ::2] += h // 2
        last = shifted & (corners[:, 2] > UNIT * (COLUMNS - 1))
        corners[last, 2] = UNIT * (COLUMNS - 1)
        rows = np.unique(corners[shifted, 1])
        first = [[UNIT, y, UNIT + h // 2, y + h] for y in rows.tolist()]
        return Tiles(np.concatenate([corners, first]), np.concatenate([tiles.medium_t, np.ones(len(rows), dtype=bool)]))

    def refined_at(self, points: tuple[tuple[int, int], ...], times: int) -> Tiles:
        """The tiles with a corner at one of the points (in squares of 0.1) divided by four, again and again."""
        tiles = self
        for _ in range(times):
            c = tiles.corners_tx
            touched = np.zeros(len(c), dtype=bool)
            for x, y in points:
                touched |= ((c[:, [0, 2]] == UNIT * x).any(axis=1)) & ((c[:, [1, 3]] == UNIT * y).any(axis=1))
            x0, y0, x1, y1 = c[touched].T
            x, y = (x0 + x1) // 2, (y0 + y1) // 2
            quarters = [(x0, y0, x, y), (x, y0, x1, y), (x0, y, x, y1), (x, y, x1, y1)]
            new = np.concatenate([np.stack(q, axis=1) for q in quarters])
            medium = np.concatenate([tiles.medium_t[~touched], np.tile(tiles.medium_t[touched], 4)])
            tiles = Tiles(np.concatenate([c[~touched], new]), medium)
        return tiles

    def mesh(self) -> PolygonMesh:
        """Polygons: corners of other tiles on the sides of a tile become hanging nodes."""
        corners = np.unique(self.corners_tx[:, [[0, 1], [2, 1], [2, 3], [0, 3]]].reshape(-1, 2), axis=0)
        on_x, on_y = ({int(v): corners[corners[:, a] == v, 1 - a] for v in np.unique(corners[:, a])} for a in (0, 1))
        points: dict[tuple[int, int], int] = {}
        loops = []
        for x0, y0, x1, y1 in self.corners_tx.tolist():
            lower, upper = (on_y[y][(on_y[y] >= x0) & (on_y[y] <= x1)].tolist() for y in (y0, y1))
            left, right = (on_x[x][(on_x[x] >= y0) & (on_x[x] <= y1)].tolist() for x in (x0, x1))
            loop = [(x, y0) for x in lower[:-1]] + [(x1, y) for y in right[:-1]]
            loop += [(x, y1) for x in upper[:0:-1]] + [(x0, y) for y in left[:0:-1]]
            loops.append([points.setdefault(p, len(points)) for p in loop])
        return PolygonMesh.from_cells(
            np.array(list(points)) * (0.1 / UNIT),
            loops,
            region_c=self.medium_t.astype(np.int64),
            region_names=("solid", "medium"),
        )


@dataclass(frozen=True)
class TiledBox(Box):
    """The box on given tiles."""

    cells: tuple[int, int] = (COLUMNS, ROWS)
    tiles: Tiles = field(default_factory=lambda: Tiles.of(lambda i, j, medium: (1, 1)))

    def make_mesh(self) -> PolygonMesh:
        """See :meth:`tmc_vem.problems.Box.make_mesh`."""
        middle, names = self.length / 2, {"support_left": (0.0, 0.0), "support_right": (self.length, 0.0)}
        names |= {"flange_top": (middle, self.height - self.wall), "flange_bottom": (middle, self.wall)}
        return with_names(self.tiles.mesh(), names | {"load": (middle, self.height)})


def mean_gap(fields: Fields, half: float = 0.1) -> float:
    """Area between the inner faces of the flanges for ``|X - 1| < half``, over ``2 half``; the faces are parabolas
    through three nodes, for which Simpson's rule integrates y x' exactly."""
    X, u = fields.polygons.points_nx, fields.displacement_ni
    area, ends = 0.0, []
    for sign, Y in ((1.0, 0.4), (-1.0, 0.1)):
        chosen = np.flatnonzero((np.abs(X[:, 1] - Y) < 1e-9) & (np.abs(X[:, 0] - 1.0) < half + 1e-9))
        _, first = np.unique(np.round(X[chosen, 0], 9), return_index=True)
        x, y = (X + u)[chosen[first]].T
        a, m, b = x[:-2:2], x[1:-1:2], x[2::2]
        slopes = np.stack([-3 * a + 4 * m - b, b - a, a - 4 * m + 3 * b])
        values = np.stack([y[:-2:2], 4 * y[1:-1:2], y[2::2]])
        area += sign * float((values * slopes).sum()) / 6.0
        ends.append([(x[0], y[0]), (x[-1], y[-1])])
    (left, right), (lower_left, lower_right) = ends
    area += 0.5 * (left[1] + lower_left[1]) * (left[0] - lower_left[0])
    area -= 0.5 * (right[1] + lower_right[1]) * (right[0] - lower_right[0])
    return float(area / (2.0 * half))


def solve(problem: Problem, projection: str = "auto") -> tuple[RunResult, Fields]:
    """A run and the fields of its last step."""
    with tempfile.TemporaryDirectory() as path:
        options = RunOptions(element=ElementSettings(projection=projection), snapshots=1, checkpoint_every=0)
        result = run(problem, path + "/run", options)
        return result, read_fields(result, snapshots(result)[-1])


def equal(n: int) -> Tiles:
    """Equal squares of 0.1 / n."""
    return Tiles.of(lambda i, j, medium: (n, n))


def points(n: int, times: int) -> Tiles:
    """Equal squares, of which those at the load and the supports are refined."""
    return equal(n).refined_at(LOADED, times)


def kept(n: int) -> Tiles:
    """Squares of 0.1 / n, but for those at the load and the supports, which stay."""
    loaded = [(i - dx, j - dy) for i, j in LOADED for dx in (0, 1) for dy in (0, 1)]
    return Tiles.of(lambda i, j, medium: (1, 1) if (i, j) in loaded else (n, n))


def conforming(r: int) -> Tiles:
    """Squares of 0.1 / r in the medium, and the wall's squares cut in r slices that fit to them: no hanging nodes."""
    return Tiles.of(lambda i, j, medium: (r if 0 < i < COLUMNS - 1 else 1, r if 0 < j < ROWS - 1 else 1))


def hanging(r: int) -> Tiles:
    """Squares of 0.1 / r in the medium: r - 1 hanging nodes on a side of the wall's."""
    return Tiles.of(lambda i, j, medium: (r, r) if medium else (1, 1))


def coarse_middle_row() -> Tiles:
    """The medium's middle row is coarser than its neighbours."""
    return Tiles.of(lambda i, j, medium: (2, 2) if medium and j != 2 else (1, 1))


MESHES: dict[str, Callable[..., Tiles]] = {
    "equal": equal, "points": points, "kept": kept, "conforming": conforming, "hanging": hanging,
    "bricks": Tiles.bricks, "coarse middle row": coarse_middle_row,
}  # fmt: skip


def tiled(mesh: str, numbers: list[int], gamma: float, projection: str = "auto") -> dict[str, float]:
    """Gap at the point, mean gap, reaction, energy of the regulariser, load and iterations of the box on tiles,
    alpha_r = 1.

    Args:
        mesh: of ``MESHES``.
        numbers: its arguments.
        gamma: of the medium.
        projection: of the elements.
    """
    problem = TiledBox(tiles=MESHES[mesh](*numbers), medium=Medium(gamma=gamma, alpha_r=1.0))
    result, fields = solve(problem, projection)
    return {**_values(result), "mean": mean_gap(fields)}


def cbox(medium_refinement: int, projection: str) -> dict[str, float]:
    """Gap, reaction, energy of the regulariser, load and iterations of the C-box."""
    settings = RunOptions(element=ElementSettings(projection=projection))
    return _values(run(CBox(medium_refinement=medium_refinement), None, settings))


def _values(result: RunResult) -> dict[str, float]:
    last = result.history[-1]
    assert last.gap is not None
    return {
        "gap": last.gap, "reaction": abs(last.reaction), "load": result.load, "iterations": result.newton_iterations,
        "regulariser": result.checks["regulariser_energy"],
    }  # fmt: skip


if __name__ == "__main__":
    from pages.contact import BLOCKS
    from pages.study import main

    main(__doc__, BLOCKS, "contact-")
