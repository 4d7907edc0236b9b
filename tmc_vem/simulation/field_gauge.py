"""Reads probes of fields off states: values at points, over regions and along lines. Equal on all ranks.

A line is taken in pieces, each in one cell: where it runs along sides, in that of the smallest number of those that it
may be in, solids first. In every piece a Gauss rule of k + 2 points is used;
smallest and largest values are those at its points and at the ends of the pieces.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.locate import TOLERANCE, find_cells
from tmc_vem.problems.base import Problem, media_of
from tmc_vem.problems.field_probes import (
    DENSITY,
    DISPLACEMENTS,
    INTEGRAL,
    LARGEST,
    MEAN,
    SMALLEST,
    FieldProbe,
    Over,
    PNorm,
    ValueAt,
)
from tmc_vem.problems.probes import Place
from tmc_vem.simulation.reading import State, along_x_and_y
from tmc_vem.support.distributed import Vec
from tmc_vem.support.errors import InputError
from tmc_vem.system.discretisation import Discretisation
from tmc_vem.system.places import Places
from tmc_vem.system.recovery import Patches, Recovered
from tmc_vem.system.stress import Stresses
from tmc_vem.system.tensors import SCALARS, values_of
from tmc_vem.vem.spaces.quadrature import gauss

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]

SHORT = 1e-9  # of a line: shorter pieces are rounding


class Pieces:
    """Pieces of a line, or of edges, each in one cell of one rank; all ranks make this together.

    Attributes:
        cell_n: (n,) cells of this rank at the points below.
        point_nx: (n, 2) ends and Gauss points of this rank's pieces.
        weight_n: (n,) weights of an integral over the length, 0 at ends.
        every_nx: (m, 2) the same points of all ranks.
        every_weight_n: (m,) their weights.
    """

    def __init__(self, system: Discretisation, starts: Float, ends: Float, cell_p: Int, order: int) -> None:
        t, w = gauss(order + 2)
        t, w = np.concatenate([[0.0], t, [1.0]]), np.concatenate([[0.0], w, [0.0]])
        length_p = np.hypot(*(ends - starts).T) if len(starts) else np.zeros(0)
        self.point_nx: Float = (starts[:, None] + t[:, None] * (ends - starts)[:, None]).reshape(-1, 2)
        self.weight_n: Float = (length_p[:, None] * w).ravel()
        self.cell_n: Int = np.repeat(cell_p, len(t))
        parts = system.comm.allgather((self.point_nx, self.weight_n))
        self.every_nx = np.concatenate([part[0] for part in parts])
        self.every_weight_n = np.concatenate([part[1] for part in parts])


class FieldReader:
    """Reads probes of fields; all ranks make and call it together.

    Args:
        probes: by name.
        problem: whose probes.
        system: its discretisation.

    Raises:
        InputError: a place is not there.

    Attributes:
        pieces: by name of the probe, of those along lines and edges; with what finds displacements there, if these are
            what is asked for.
    """

    def __init__(self, probes: Mapping[str, FieldProbe], problem: Problem, system: Discretisation) -> None:
        self._probes, self._system = dict(probes), system
        self._polygons = system.output_polygons()
        self._region_c = np.array(self._polygons.region_names)[self._polygons.region_c]
        self._is_medium_c = np.isin(self._region_c, media_of(problem))
        self._regions = problem.regions()
        integrands = {name: region.integrand for name, region in self._regions.items()}
        self._stresses = Stresses(system, integrands)
        self._patches = Patches(self._stresses, self._polygons, system.order)
        self._corners = [
            self._polygons.points_nx[self._polygons.cell(c)[:: system.order]] for c in range(self._polygons.n_cells)
        ]
        self._points: dict[str, tuple[Int, Float]] = {}
        self.pieces: dict[str, tuple[Pieces, Places | None]] = {}
        for name, probe in self._probes.items():
            try:
                self._locate(name, probe)
            except InputError as error:
                raise InputError(f"probes: {name}: {error}") from None

    def __call__(self, state: State) -> dict[str, float]:
        """Values by name of the probe."""
        at_nodes_of = [p.field for p in self._probes.values() if p.field in SCALARS and not isinstance(p, PNorm)]
        needed = tuple(dict.fromkeys(SCALARS[field].of for field in at_nodes_of))
        recovered = self._patches.recovered(state.u, needed)
        at_nodes = recovered.at_nodes()
        sums = self._sums(state.u)
        found = {}
        for name, probe in self._probes.items():
            if isinstance(probe, ValueAt):
                found[name] = self._at_point(name, probe, recovered)
            elif isinstance(probe, Over) and not probe.is_area:
                found[name] = self._along(name, probe, state.u, recovered)
            elif isinstance(probe, Over) and probe.what in (MEAN, INTEGRAL):
                integral, area = sums[probe.field, str(probe.region)]
                found[name] = integral if probe.what == INTEGRAL else integral / area
            elif isinstance(probe, Over):
                found[name] = self._extreme(probe, state.u, at_nodes)
            elif isinstance(probe, PNorm):
                found[name] = self._norm(probe, state.u)
        return found

    # -- places ----------------------------------------------------------------------------------------------------

    def _locate(self, name: str, probe: FieldProbe) -> None:
        if isinstance(probe, ValueAt):
            self._points[name] = self._cell_at(probe.at, probe.region)
            self._require_known(probe, self._points[name][0])
        if not isinstance(probe, Over) or probe.is_area:
            return
        starts, ends, cell_p = self._along_line(probe) if probe.line is not None else self._along_edges(probe)
        pieces = Pieces(self._system, starts, ends, cell_p, self._system.order)
        if not len(pieces.every_nx):
            raise InputError(f"{probe} goes through no cell{f' of {probe.region}' if probe.region else ''}")
        self._require_known(probe, pieces.cell_n)
        moves = Places(self._system, pieces.every_nx) if probe.field in DISPLACEMENTS else None
        self.pieces[name] = pieces, moves

    def _require_known(self, probe: FieldProbe, cell_n: Int) -> None:
        """Check that the regions of cells, those of all ranks, have the field."""
        parts = self._system.comm.allgather(np.unique(self._region_c[cell_n]).tolist())
        probe.require_across(sorted({name for part in parts for name in part}), self._regions)

    def _cell_at(self, at: Place, region: str | None) -> tuple[Int, Float]:
        """The cell of a point, on the rank that has it, and the point; nothing on others."""
        system = self._system
        point = system.point_coordinates((at,))[0] if isinstance(at, str) else np.array(at, dtype=float)
        chosen = np.flatnonzero(self._region_c == region) if region else np.arange(len(self._region_c))
        numbers = system.cell_numbers()[chosen] + self._is_medium_c[chosen] * system.n_cells_global  # solids first
        cells = find_cells([self._corners[c] for c in chosen], numbers, point[None], TOLERANCE * system.size)
        distance = float(cells.distance_n[0]) if len(chosen) else np.inf
        number = int(numbers[cells.cell_n[0]]) if len(chosen) else 0
        best = min(system.comm.allgather((distance, number, system.comm.rank)))
        if best[0] > TOLERANCE * system.size:
            raise InputError(f"point ({point[0]:g}, {point[1]:g}) lies {best[0]:.3g} outside of {region or 'the mesh'}")
        mine = best[2] == system.comm.rank
        return (chosen[cells.cell_n[:1]], point[None]) if mine else (np.empty(0, dtype=np.int64), np.empty((0, 2)))

    def _wanted(self, probe: Over) -> Bool:
        return self._region_c == probe.region if probe.region else np.ones(len(self._region_c), dtype=bool)

    def _preferred(self) -> Int:
        """(n_cells,) by which cells are taken where several may be: solids first, then by number."""
        numbers: Int = self._system.cell_numbers() + self._is_medium_c * self._system.n_cells_global
        return numbers

    def _along_line(self, probe: Over) -> tuple[Float, Float, Int]:
        """This rank's pieces of a line: starts, ends (n, 2) and cells (n,)."""
        import shapely

        assert probe.line is not None
        start, end = (np.array(point, dtype=float) for point in probe.line)
        along = end - start
        length2 = float(along @ along)
        mine: list[tuple[float, float, int, int]] = []
        preferred, tolerance = self._preferred(), TOLERANCE * 1e-3 * self._system.size
        line = shapely.linestrings([start, end])
        for cell in np.flatnonzero(self._wanted(probe)).tolist():
            corners = self._corners[cell]
            if (corners.max(axis=0) < np.minimum(start, end) - tolerance).any():
                continue
            if (corners.min(axis=0) > np.maximum(start, end) + tolerance).any():
                continue
            within = [
                shapely.get_coordinates(piece)
                for piece in shapely.get_parts(shapely.intersection(line, shapely.polygons(corners)))
            ]
            for points in (*within, *_on_line(corners, start, along / np.sqrt(length2), tolerance)):
                t = np.clip((points - start) @ along / length2, 0.0, 1.0)
                if len(t) and t.max() - t.min() > SHORT:
                    mine.append((float(t.min()), float(t.max()), int(preferred[cell]), cell))
        comm = self._system.comm
        every = [(*entry, rank) for rank, part in enumerate(comm.allgather(mine)) for entry in part]
        slack = 4.0 * tolerance / np.sqrt(length2)
        cuts = sorted({t for entry in every for t in entry[:2]})
        grid = [t for n, t in enumerate(cuts) if n == 0 or t - cuts[n - 1] > slack]
        found = []
        for a, b in itertools.pairwise(grid):
            having = [entry for entry in every if entry[0] <= a + slack and entry[1] >= b - slack]
            if having:
                best = min(having, key=lambda entry: entry[2])
                if best[4] == comm.rank:
                    found.append((a, b, best[3]))
        t_p = np.array([entry[:2] for entry in found], dtype=float).reshape(-1, 2)
        cell_p = np.array([entry[2] for entry in found], dtype=np.int64)
        return start + t_p[:, :1] * along, start + t_p[:, 1:] * along, cell_p

    def _along_edges(self, probe: Over) -> tuple[Float, Float, Int]:
        """This rank's sides of cells along named edges, each side of one cell: starts, ends and cells."""
        system = self._system
        sides = system.sides(str(probe.edges))
        local = {int(number): c for c, number in enumerate(system.cell_numbers().tolist())}
        cell_s = np.array([local[int(number)] for number in sides.cell_s.tolist()], dtype=np.int64)
        keep = np.flatnonzero(self._wanted(probe)[cell_s]) if len(cell_s) else cell_s
        preferred = self._preferred()
        keys = [tuple(sorted(ends)) for ends in sides.ends_se.tolist()]
        mine = {keys[s]: int(preferred[cell_s[s]]) for s in keep.tolist()}
        for s in keep.tolist():
            mine[keys[s]] = min(mine[keys[s]], int(preferred[cell_s[s]]))
        best: dict[tuple[int, ...], int] = {}
        for part in system.comm.allgather(mine):
            for key, number in part.items():
                best[key] = min(best.get(key, number), number)
        chosen = [s for s in keep.tolist() if best[keys[s]] == preferred[cell_s[s]]]
        points_sax = sides.points_sax[chosen]
        return points_sax[:, 0], points_sax[:, -1], cell_s[chosen]

    # -- values ----------------------------------------------------------------------------------------------------

    def _at_point(self, name: str, probe: ValueAt, recovered: Recovered) -> float:
        cell_n, points_nx = self._points[name]
        value = values_of(probe.field, recovered.at(cell_n, points_nx)).tolist()
        return float(next(part[0] for part in self._system.comm.allgather(value) if part))

    def _along(self, name: str, probe: Over, u: Vec, recovered: Recovered) -> float:
        pieces, moves = self.pieces[name]
        if moves is not None:
            values, weights = moves.displacements(u)[:, DISPLACEMENTS[probe.field]], pieces.every_weight_n
        else:
            mine = values_of(probe.field, recovered.at(pieces.cell_n, pieces.point_nx))
            values, weights = np.concatenate(self._system.comm.allgather(mine)), pieces.every_weight_n
        if probe.what in (SMALLEST, LARGEST):
            return float(values.min() if probe.what == SMALLEST else values.max())
        integral = float(weights @ values)
        return integral if probe.what == INTEGRAL else integral / float(weights.sum())

    def _norm(self, probe: PNorm, u: Vec) -> float:
        """A p-norm; the largest value is taken out, so that no power is too large for a number."""
        points = [
            (values_of(probe.field, tensors), states.w_cq)
            for states, tensors in self._stresses.at_points(u, [probe.region])
        ]
        comm = self._system.comm
        unit = max(comm.allgather(max((float(f.max(initial=0.0)) for f, _ in points), default=0.0))) or 1.0
        mine = sum(float((w * (f / unit) ** probe.p).sum()) for f, w in points), sum(float(w.sum()) for _, w in points)
        integral, area = np.sum(comm.allgather(np.array(mine)), axis=0).tolist()
        return float(unit * (integral / area) ** (1.0 / probe.p))

    def _extreme(self, probe: Over, u: Vec, at_nodes: Mapping[str, Float]) -> float:
        """Smallest or largest value at the nodes of a region; of the energy density, of its cells' means."""
        here_c = self._region_c == probe.region
        here_k = np.repeat(here_c, np.diff(self._polygons.offsets))
        if probe.field == DENSITY:
            values = (self._system.cell_energies(u) / self._system.cell_areas())[here_c]
        elif probe.field in DISPLACEMENTS:
            moved = self._system.output_displacements(u)[self._polygons.connectivity]
            values = moved[here_k, DISPLACEMENTS[probe.field]]
        else:
            values = values_of(probe.field, {name: value[here_k] for name, value in at_nodes.items()})
        sign = 1.0 if probe.what == SMALLEST else -1.0
        mine = float((sign * values).min()) if len(values) else np.inf
        return sign * float(min(self._system.comm.allgather(mine)))

    def _sums(self, u: Vec) -> dict[tuple[str, str], tuple[float, float]]:
        """Integrals over regions of the fields that are asked for, and the regions' areas."""
        asked = [(p.field, str(p.region)) for p in self._probes.values() if isinstance(p, Over) and p.is_area]
        wanted = [pair for pair in dict.fromkeys(asked) if pair[0] in SCALARS]
        mine = np.zeros((len(asked), 2))
        keys = list(dict.fromkeys(asked))
        for states, tensors in self._stresses.at_points(u, [region for _, region in wanted]) if wanted else ():
            for field, region in wanted:
                if region == states.region:
                    n = keys.index((field, region))
                    mine[n] += (states.w_cq * values_of(field, tensors)).sum(), states.w_cq.sum()
        for n, (field, region) in enumerate(keys):
            if field not in SCALARS:
                mine[n] = self._sum_of(field, region, u)
        total = np.sum(self._system.comm.allgather(mine), axis=0)
        return {key: (float(total[n, 0]), float(total[n, 1])) for n, key in enumerate(keys)}

    def _sum_of(self, field: str, region: str, u: Vec) -> tuple[float, float]:
        """This rank's share of the integral of a displacement component or of the energy density, and of the area."""
        here_c = self._region_c == region
        if field == DENSITY:
            return float(self._system.cell_energies(u)[here_c].sum()), float(self._system.cell_areas()[here_c].sum())
        weight_n = self._system.area_weights((region,))
        moved_ni = along_x_and_y(self._system, u)
        return float(weight_n @ moved_ni[:, DISPLACEMENTS[field]]), float(self._system.cell_areas()[here_c].sum())


def _on_line(corners: Float, start: Float, direction: Float, tolerance: float) -> Iterator[Float]:
    """Sides (2, 2) of a cell that are on a line."""
    x, y = (corners - start).T
    on = np.abs(direction[0] * y - direction[1] * x) <= tolerance
    for side in np.flatnonzero(on & np.roll(on, -1)).tolist():
        yield corners[[side, (side + 1) % len(corners)]]


def make_field_reader(probes: Mapping[str, Any], problem: Problem, system: Discretisation) -> FieldReader:
    """What reads probes of fields."""
    return FieldReader(probes, problem, system)
