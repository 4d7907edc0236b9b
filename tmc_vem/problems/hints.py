"""What the geometry of a problem says about contact before anything is solved: known causes of bodies that overlap.

J > 0 at quadrature points does not keep bodies apart everywhere. Where the medium has a free side that ends flush with
the bodies, the side is drawn in as a notch and the bodies' ends pass through it; a sharp corner of a solid slips
between points where J is checked; a medium whose regulariser has a length that is small against the gap folds.
docs/solver.md tells more. This module is geometry only; it looks at the undeformed mesh once.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tmc_vem.energy import REGULARISERS, energy_name
from tmc_vem.mesh.interface import Interface, body_numbers, free_chains, interface, solid_angles
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.mesh.rigid import without_rounding
from tmc_vem.problems.base import RegionEnergy
from tmc_vem.problems.conditions import held_components, vertices_at
from tmc_vem.problems.design_region import design_regions
from tmc_vem.system.constraints import Condition
from tmc_vem.system.control import Control

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]
Point = tuple[float, float]

FLUSH, CORNER, THIN, SHORT = "flush end", "sharp corner", "thin medium", "short length"
# alpha_r / (mu t^2), t the gap's width: with this or more, and medium beyond free sides, blocks did not pass each other
ENOUGH_ALPHA = 2.5
# sqrt(alpha_r / mu) / t below which the regulariser hardly ties the medium together over the gap; the box of the paper
# with alpha_r = 0.1 has 0.33
SHORT_LENGTH = 0.25
# Bodies come near each other if their prescribed displacements close this part of the gap between them; a corner on a
# flat shows late.
NEAR, NEAR_CORNER = 0.5, 0.75
# A corner that meets another one, up to this part of the gap, is kept off by enough alpha_r, as in the C-box; on a flat
# a square punch went in 4e-4 with it, and rounded it did not.
AT_CORNER = 0.1
# Inner angle of a solid at a sharp corner, at most; arcs are divided into turns of 45 degrees or less.
SHARP = np.deg2rad(130.0)
DRAWS_NOTHING_IN = {
    energy_name(REGULARISERS[regulariser], damped, "balanced")
    for regulariser in ("angle_log", "huhu_log")
    for damped in (False, True)
}
# Medium ends flush where surfaces are seen in directions that differ by 180 degrees up to this much: a quarter of the
# gap's width beyond the bodies would make 53 degrees, an eighth 28.
OPPOSITE = np.cos(np.deg2rad(28.0))
STRAIGHT = np.cos(np.deg2rad(37.0))  # largest angle between such a direction and the surface's normal


@dataclass(frozen=True)
class Hint:
    """A place where bodies may come to overlap, and why.

    Attributes:
        kind: ``FLUSH``, ``CORNER``, ``THIN`` or ``SHORT``.
        places: the points that the sentence names; for ``FLUSH`` the two ends of the medium.
        regions: names of the regions concerned, that of the medium first.
        width: of the gap there, in the undeformed state.
        likely: whether prescribed displacements close the gap and the medium does not make up for the fault, so that
            it is worth a warning before anything is solved.
        sentence: what to tell the user.
    """

    kind: str
    places: tuple[Point, ...]
    regions: tuple[str, ...]
    width: float
    likely: bool
    sentence: str

    @property
    def where(self) -> Point:
        """The middle of the places."""
        x, y = np.mean(self.places, axis=0).tolist()
        return x, y


def hints(
    mesh: PolygonMesh, regions: Mapping[str, RegionEnergy], prescribed: Sequence[Condition],
    loads: Sequence[float] = (1.0,),
) -> list[Hint]:  # fmt: skip
    """Known causes of overlap in a problem's geometry, likely ones or not.

    Args:
        mesh: the whole mesh.
        regions: energies of its regions.
        prescribed: supports and loads.
        loads: load factors that are gone to.
    """
    is_medium = np.array([name in regions and regions[name].is_medium for name in mesh.region_names])[mesh.region_c]
    if is_medium.all() or not is_medium.any():
        return []
    scene = _Scene(mesh, regions, prescribed, tuple(loads), is_medium)
    if not len(scene.sides):
        return []
    found = [*scene.flush_ends(), *scene.sharp_corners(), *scene.short_media(), *scene.thin_gaps()]
    designs = design_regions(regions)  # whether there will be a gap is not known
    return [hint for hint in found if hint.regions[0] not in designs]


def likely(found: Iterable[Hint]) -> list[str]:
    """Sentences to say before solving: those of likely causes, each once, no more than three of a kind."""
    said: dict[str, list[str]] = {}
    for hint in found:
        if hint.likely and hint.sentence not in said.setdefault(hint.kind, []):
            said[hint.kind].append(hint.sentence)
    more = {kind: len(sentences) - 3 for kind, sentences in said.items()}
    return [
        sentence + (f" ({more[kind]} more such places)" if n == 2 and more[kind] > 0 else "")
        for kind, sentences in said.items()
        for n, sentence in enumerate(sentences[:3])
    ]


def cause_at(found: Iterable[Hint], place: Point) -> Hint | None:
    """The cause nearest to a place where bodies overlap, likely or not; None if none is within a gap's width.

    Args:
        found: of :func:`hints`.
        place: coordinates in the reference configuration.
    """
    near = [(min(math.dist(place, point) for point in hint.places) - hint.width, hint) for hint in found]
    away, hint = min(near, key=lambda pair: pair[0], default=(1.0, None))
    return hint if away <= 0.0 else None


@dataclass(frozen=True)
class _Gaps:
    """Pairs of sides (n,) across a gap, its width (n,) and the middle (n, 2) between them."""

    first_n: Int
    second_n: Int
    width_n: Float
    middle_nx: Float


@dataclass(frozen=True)
class _Scene:
    mesh: PolygonMesh
    regions: Mapping[str, RegionEnergy]
    prescribed: Sequence[Condition]
    loads: tuple[float, ...]
    is_medium: Bool

    @cached_property
    def sides(self) -> Interface:
        return interface(self.mesh, self.is_medium)

    @cached_property
    def body_c(self) -> Int:
        """(n_cells,) body of each solid cell."""
        return body_numbers(self.mesh, ~self.is_medium)

    @cached_property
    def body_s(self) -> Int:
        """(n_sides,) body of the solid at each side."""
        body: Int = self.body_c[self.sides.solid_s]
        return body

    @cached_property
    def held_vi(self) -> Bool:
        """(n_vertices, 2) which components are prescribed at which vertices."""
        return held_components(self.mesh, self.prescribed)

    @cached_property
    def moves_lbci(self) -> Float:
        """(n_loads, n_bodies, 2, 2) smallest and largest displacement by body and component at the loads; 0 where
        free."""
        body_v = np.full(self.mesh.n_vertices, -1)
        solid = np.repeat(~self.is_medium, self.mesh.n_sides_c)
        body_v[self.mesh.cell_vertices[solid]] = np.repeat(self.body_c, self.mesh.n_sides_c)[solid]
        moves = np.tile([np.inf, -np.inf], (len(self.loads), int(self.body_c.max()) + 1, 2, 1))
        for condition in self.prescribed:
            vertices = vertices_at(self.mesh, condition.where)
            body = body_v[vertices]
            for load, load_bci in zip(self.loads, moves, strict=True):
                along_kn = condition.along(Control(load), self.mesh.points_vx[vertices])
                for axis, along_n in zip(condition.axes, along_kn, strict=True):
                    for i in np.flatnonzero(axis):
                        for b in np.unique(body[body >= 0]):
                            shifts = along_n[body == b] * axis[i]
                            low, high = load_bci[b, i]
                            load_bci[b, i] = min(low, shifts.min()), max(high, shifts.max())
        return np.where(np.isfinite(moves), moves, 0.0)

    def closing(self, first_n: Int, second_n: Int, direction_nx: Float) -> Float:
        """(n,) how far prescribed displacements move bodies towards each other.

        Args:
            first_n, second_n: (n,) bodies.
            direction_nx: (n, 2) unit vectors from the first to the second.
        """
        shifts = []
        for moves_bci in self.moves_lbci:
            low_a, high_a = np.moveaxis(moves_bci[first_n], -1, 0)
            low_b, high_b = np.moveaxis(moves_bci[second_n], -1, 0)
            most, least = high_a - low_b, low_a - high_b
            shifts.append(np.maximum(direction_nx * most, direction_nx * least).sum(axis=1))
        closed: Float = np.max(shifts, axis=0)
        return closed

    def flush_ends(self) -> list[Hint]:
        """Free sides of the medium that lie straight between two surfaces."""
        chains = [chain for chain in free_chains(self.mesh, self.is_medium) if not self._held(chain)]
        return [hint for chain in chains for hint in self._flush(chain)]

    def _flush(self, chain: Int) -> list[Hint]:
        x = self.mesh.points_vx[chain]
        points = 0.5 * (x[:-1] + x[1:])
        near = self.sides.seen(points)
        with np.errstate(invalid="ignore", divide="ignore"):
            away = (points - near.point_nx) / near.distance_n[:, None]
        far = self.sides.nearest(points, away[:, None], float(OPPOSITE), STRAIGHT)
        both = np.flatnonzero((near.side_n >= 0) & (far.side_n >= 0))
        if not len(both):
            return []
        n = int(both[np.argmin(far.distance_n[both] + near.distance_n[both])])
        a, b = int(near.side_n[n]), int(far.side_n[n])
        first, second = near.point_nx[n], far.point_nx[n]
        width = float(np.hypot(*(second - first)))
        medium, *solids = self._names(self.sides.medium_s[a], self.sides.solid_s[a], self.sides.solid_s[b])
        places = (self._point(first), self._point(second))
        return [
            Hint(
                FLUSH, places, (medium, *solids), width,
                self._close(a, b, (second - first) / width, width) and self._draws_in(medium),
                f"{medium} ends flush at {_said(places[0])}-{_said(places[1])} between bodies that approach: "
                f"let it reach at least one gap width ({width:.3g}) beyond, as its free side is drawn in there and "
                'bodies pass through the notch; or take energy = "balanced", regulariser = "angle_log", '
                f"alpha = {ENOUGH_ALPHA:g}",
            )
        ]  # fmt: skip

    def _draws_in(self, medium: str) -> bool:
        """Whether a free side of a medium is drawn in where it is squeezed; see docs/solver.md."""
        return self.regions[medium].energy.name.removesuffix("_log_j") not in DRAWS_NOTHING_IN

    def _held(self, chain: Int) -> bool:
        """Whether the medium is held on a side of the chain, across it: by symmetry, for example."""
        arm = np.diff(self.mesh.points_vx[chain], axis=0)
        normal = np.abs(arm[:, ::-1]) / np.hypot(*arm.T)[:, None]
        held = self.held_vi[chain]
        return bool((held[1:] & held[:-1] & (normal > 0.7)).any())

    def sharp_corners(self) -> list[Hint]:
        """Convex corners of solids inside the medium that have a surface in front of them."""
        sides, x = self.sides, self.mesh.points_vx
        angle_v = solid_angles(self.mesh, ~self.is_medium)
        into = np.full(self.mesh.n_vertices, -1)
        out = np.full(self.mesh.n_vertices, -1)
        out[sides.ends_sv[:, 0]] = into[sides.ends_sv[:, 1]] = np.arange(len(sides))
        corner = np.flatnonzero((into >= 0) & (out >= 0) & (angle_v < SHARP) & (angle_v > 0.0))
        if not len(corner):
            return []
        normals = np.stack([sides.normal_sx[into[corner]], sides.normal_sx[out[corner]]], axis=1)
        ahead = sides.nearest(x[corner], normals, 0.9, 0.3)
        ends = np.union1d(corner, np.flatnonzero((into >= 0) != (out >= 0)))
        found = []
        for n in np.flatnonzero(ahead.side_n >= 0).tolist():
            a, b, width = int(out[corner[n]]), int(ahead.side_n[n]), float(ahead.distance_n[n])
            medium, solid, other = self._names(sides.medium_s[a], sides.solid_s[a], sides.solid_s[b])
            direction = (ahead.point_nx[n] - x[corner[n]]) / width
            to_corner = np.hypot(*(x[ends] - ahead.point_nx[n]).T).min() <= AT_CORNER * width
            close = self._close(a, b, direction, width, NEAR_CORNER)
            risky = not to_corner or self._alpha(medium, width) < ENOUGH_ALPHA * (1.0 - 1e-9)
            place = self._point(x[corner[n]])
            found.append(
                Hint(
                    CORNER, (place,), (medium, solid, other), width, risky and close,
                    f"the corner of region '{solid}' at {_said(place)} is sharp and meets region '{other}', "
                    f"{width:.3g} away: it may slip into it between points where J is checked; round it, with a radius "
                    f"of some cells{self._advice(medium, width)}",
                )
            )  # fmt: skip
        return found

    @cached_property
    def approaching(self) -> _Gaps:
        """Sides that face a side of a body that comes near."""
        sides = self.sides
        middle = sides.start_sx + 0.5 * sides.arm_sx
        across = sides.nearest(middle, sides.normal_sx[:, None], 0.95, 0.95)
        a = np.flatnonzero(across.side_n >= 0)
        b, width, arm = across.side_n[a], across.distance_n[a], across.point_nx[a] - middle[a]
        close = self.closing(self.body_s[a], self.body_s[b], arm / width[:, None]) >= NEAR * width
        return _Gaps(a[close], b[close], width[close], (middle[a] + 0.5 * arm)[close])

    def short_media(self) -> list[Hint]:
        """Media with a regulariser whose length is small against their narrowest gap."""
        gaps, found = self.approaching, []
        for n in self._narrowest(np.ones(len(gaps.width_n), dtype=np.bool_)):
            names, width, place = self._gap(n)
            alpha = self._alpha(names[0], width)
            if alpha < SHORT_LENGTH**2:
                value = self.regions[names[0]].values["alpha_r"]
                sentence = (
                    f"alpha_r = {value:g} of region '{names[0]}' has the length sqrt(alpha_r / mu) = "
                    f"{np.sqrt(alpha) * width:.3g}, small against the gap of {width:.3g} at {_said(place)}, so the "
                    f"medium may fold and let bodies pass: use about 2.5 mu gap^2 = {ENOUGH_ALPHA * value / alpha:.3g} "
                    "(alpha = 2.5)"
                )
                found.append(Hint(SHORT, (place,), names, width, True, sentence))
        return found

    def thin_gaps(self) -> list[Hint]:
        """The narrowest gap of each medium that has a single cell across."""
        gaps, found = self.approaching, []
        for n in self._narrowest(self._reached(gaps.first_n, gaps.second_n)):
            names, width, place = self._gap(n)
            sentence = (
                f"region '{names[0]}' has a single cell across the gap of {width:.3g} at {_said(place)}: use cells of "
                f"size {0.5 * width:.3g} or less there"
            )
            found.append(Hint(THIN, (place,), names, width, True, sentence))
        return found

    def _narrowest(self, chosen_n: Bool) -> list[int]:
        """For each medium the narrowest of some gaps, if it has any."""
        gaps = self.approaching
        order = np.flatnonzero(chosen_n)[np.argsort(gaps.width_n[chosen_n], kind="stable")]
        _, first = np.unique(self.mesh.region_c[self.sides.medium_s[gaps.first_n[order]]], return_index=True)
        narrowest: list[int] = order[first].tolist()
        return narrowest

    def _gap(self, n: int) -> tuple[tuple[str, ...], float, Point]:
        """Regions, width and place of a gap."""
        gaps, sides = self.approaching, self.sides
        a, b = gaps.first_n[n], gaps.second_n[n]
        names = self._names(sides.medium_s[a], sides.solid_s[a], sides.solid_s[b])
        return names, float(gaps.width_n[n]), self._point(gaps.middle_nx[n])

    def _reached(self, a: Int, b: Int) -> Bool:
        """(n,) whether the medium's cell at sides ``a`` has a vertex of sides ``b``, which share none with ``a``."""
        mesh, sides = self.mesh, self.sides
        cell_of_side = np.repeat(np.arange(mesh.n_cells), mesh.n_sides_c)
        asked = np.zeros(mesh.n_cells, dtype=np.bool_)
        asked[sides.medium_s[a]] = True
        mine = asked[cell_of_side]
        corners = cell_of_side[mine] * mesh.n_vertices + mesh.cell_vertices[mine]
        wanted = sides.medium_s[a][:, None] * mesh.n_vertices + sides.ends_sv[b]
        apart = (sides.ends_sv[a][:, :, None] != sides.ends_sv[b][:, None, :]).all(axis=(1, 2))
        reached: Bool = np.isin(wanted, corners).any(axis=1) & apart
        return reached

    def _close(self, a: int, b: int, direction: Float, width: float, part: float = NEAR) -> bool:
        """Whether the bodies at two sides come near each other."""
        first, second = self.body_s[[a]], self.body_s[[b]]
        return bool(self.closing(first, second, direction[None])[0] >= part * width)

    def _alpha(self, medium: str, width: float) -> float:
        """alpha_r / (mu t^2) of a medium, infinite if its energy has no such parameters."""
        values = self.regions[medium].values
        if "alpha_r" not in values or "mu" not in values:
            return float("inf")
        return values["alpha_r"] / (values["mu"] * width**2)

    def _advice(self, medium: str, width: float) -> str:
        if not np.isfinite(self._alpha(medium, width)):
            return ""
        wanted = ENOUGH_ALPHA * self.regions[medium].values["mu"] * width**2
        return f", and use alpha_r of about 2.5 mu gap^2 = {wanted:.3g}"

    def _point(self, x: Float) -> Point:
        return without_rounding(x, float(np.ptp(self.mesh.points_vx, axis=0).max()))

    def _names(self, *cells: int) -> tuple[str, ...]:
        return tuple(self.mesh.region_names[self.mesh.region_c[c]] for c in cells)


def _said(place: Point) -> str:
    return f"({place[0]:.4g}, {place[1]:.4g})"
