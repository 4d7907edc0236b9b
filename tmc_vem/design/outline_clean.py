"""Outlines of a design without what no part can be made of: specks, films, slits that nothing resolves, loose parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tmc_vem.design.extract_options import ExtractOptions
from tmc_vem.design.outline import polygons_of
from tmc_vem.design.outline_domain import MARGIN, Domain
from tmc_vem.support.errors import InputError

# What is narrow is at least this long compared with the width; the rest are corners, which are always narrow.
LONG = 2.0
# Widened again by more than it was narrowed, so that chords of circles leave no films.
MORE = 1.05


@dataclass(frozen=True)
class Cleaned:
    """A design's solid and what was done to it.

    Attributes:
        solid: shapely MultiPolygon.
        notes: a sentence for each kind of change.
    """

    solid: Any
    notes: tuple[str, ...]


def cleaned(solid: Any, domain: Domain, cell: float, options: ExtractOptions) -> Cleaned:
    """The solid without specks, narrow gaps, films and parts that nothing holds; small holes are filled, necks widened.

    Args:
        solid: shapely MultiPolygon within the design regions.
        domain: what is around.
        cell: size of the design's cells, a length.
        options: widths and areas in such cells.

    Raises:
        InputError: nothing is left, or a load acts where nothing is solid.
    """
    work = _Work(solid, domain, cell, options.narrowest * cell, options.smallest * cell**2)
    work.remove_specks()
    work.fill_holes()
    work.close_gaps()
    work.cut_films()
    work.remove_specks()
    if work.solid.is_empty:
        raise InputError(
            f"nothing is solid but islands of less than smallest = {options.smallest:g} cells: use less, or a lower "
            "level"
        )
    work.remove_loose()
    return Cleaned(work.solid, tuple(work.notes))


class _Work:
    """A solid that changes, and what is said about that."""

    def __init__(self, solid: Any, domain: Domain, cell: float, width: float, area: float) -> None:
        self.solid, self.domain, self.cell, self.width, self.area = solid, domain, cell, width, area
        self.notes: list[str] = []

    def remove_specks(self) -> None:
        """Islands that are small, unless they join two passive solids."""
        small = [p for p in self.solid.geoms if p.area < self.area and self._joints(p, self.domain.solids) < 2]
        self._without(small)
        self._note(small, f"island(s) smaller than {self.area:.3g} removed")

    def fill_holes(self) -> None:
        """Holes that are small, unless a passive medium goes on there."""
        void = polygons_of(self.domain.room.difference(self.solid))
        media = self.domain.media
        small = [p for p in void.geoms if p.area < self.area and not self.domain.contact(p, media)]
        self._with(small)
        self._note(small, f"hole(s) smaller than {self.area:.3g} filled")

    def close_gaps(self) -> None:
        """Gaps in which no cells fit."""
        room = self.domain.room
        void = self._joined([room.difference(self.solid), self.domain.media])
        narrow = [p for piece in self._narrow(void) for p in polygons_of(piece.intersection(room)).geoms]
        self._with(narrow)
        self._note(narrow, f"gap(s) narrower than {self.width:.3g} closed")

    def cut_films(self) -> None:
        """Films and whiskers, which end somewhere; what is narrow and joins two parts is widened instead."""
        room = self.domain.room
        whole = self._joined([self.solid, self.domain.solids])
        wide = self._opened(whole)
        films: list[Any] = []
        necks: list[Any] = []
        for piece in self._narrow(whole):
            for part in polygons_of(piece.intersection(room)).geoms:
                (necks if self._joints(part, wide) > 1 else films).append(part)
        self._without(films)
        self._note(films, f"film(s) thinner than {self.width:.3g} cut off")
        self._with([neck.buffer(0.5 * self.width - neck.area / neck.length).intersection(room) for neck in necks])
        self._note(necks, f"neck(s) thinner than {self.width:.3g} widened to about that")

    def remove_loose(self) -> None:
        """Parts that are neither held nor loaded.

        Raises:
            InputError: nothing solid is held, or a load acts where nothing is solid.
        """
        domain = self.domain
        if not (domain.held or domain.loaded):
            return
        parts = connected([*self.solid.geoms, *domain.solids.geoms], domain)
        slack = MARGIN * self.cell  # outlines that come so near to a point will pass through it
        domain.require_touched(parts, slack)
        loose = [
            part
            for part in parts
            if not any(domain.touches(part, name, slack) for name in (*domain.held, *domain.loaded))
            and not domain.contact(part, domain.solids)
        ]
        gone = [p for p in self.solid.geoms if any(part.intersection(p).area > 0.5 * p.area for part in loose)]
        self._without(gone)
        self._note(gone, "part(s) that carry nothing removed: neither a support nor a load is on them")
        for name in domain.loaded:
            part = next(part for part in parts if domain.touches(part, name, slack))
            if not any(domain.touches(part, other, slack) for other in domain.held):
                x, y = part.representative_point().coords[0]
                self.notes.append(
                    f"the part under load '{name}', near ({x:.4g}, {y:.4g}), has no support of its own: the medium "
                    "alone holds it"
                )

    # -- tools -----------------------------------------------------------------------------------------------------

    def _joined(self, geometries: Sequence[Any]) -> Any:
        """Union without the hairlines that rounding leaves between neighbours."""
        t = 10.0 * self.domain.tolerance
        wider = _union([each.buffer(t, join_style="mitre") for each in geometries])
        return polygons_of(wider.buffer(-t, join_style="mitre"))

    def _opened(self, of: Any) -> Any:
        r = 0.5 * self.width
        return of.buffer(-r).buffer(MORE * r)

    def _narrow(self, of: Any) -> Sequence[Any]:
        """Pieces that no disc of the width fits in, and that are long or have something wide at both ends."""
        wide = self._opened(of)
        pieces = polygons_of(of.difference(wide)).geoms
        return [p for p in pieces if p.area > LONG * 0.5 * self.width**2 or self._joints(p, wide) > 1]

    def _joints(self, part: Any, others: Any) -> int:
        """At how many separate places a part touches others."""
        if others.is_empty:
            return 0
        shared = part.boundary.intersection(others.buffer(10.0 * self.domain.tolerance, quad_segs=1))
        around = shared.buffer(20.0 * self.domain.tolerance, quad_segs=1)
        return len([p for p in polygons_of(around).geoms if p.length > 0.2 * self.width]) if not around.is_empty else 0

    def _with(self, pieces: Sequence[Any]) -> None:
        if pieces:
            more = _union([piece.buffer(10.0 * self.domain.tolerance, join_style="mitre") for piece in pieces])
            self.solid = polygons_of(_union([self.solid, more.intersection(self.domain.room)]))

    def _without(self, pieces: Sequence[Any]) -> None:
        if pieces:
            less = _union([piece.buffer(10.0 * self.domain.tolerance, join_style="mitre") for piece in pieces])
            left = polygons_of(self.solid.difference(less))
            self.solid = polygons_of(_union([p for p in left.geoms if p.area > 1e-3 * self.width**2]))

    def _note(self, pieces: Sequence[Any], what: str) -> None:
        if pieces:
            largest = max(pieces, key=lambda piece: float(piece.area))
            x, y = largest.representative_point().coords[0]
            self.notes.append(
                f"{len(pieces)} {what}, the largest near ({x:.4g}, {y:.4g}) with an area of {largest.area:.3g}"
            )


def connected(polygons: Sequence[Any], domain: Domain) -> list[Any]:
    """Unions of the polygons that hang together by more than points."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    n = len(polygons)
    pairs = [(i, j) for i in range(n) for j in range(i) if domain.contact(polygons[i], polygons[j])]
    i, j = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
    label = connected_components(coo_array((np.ones(len(i)), (i, j)), shape=(n, n)), directed=False)[1]
    return [
        _union([polygons[k] for k in np.flatnonzero(label == part)]) for part in range(int(label.max(initial=-1)) + 1)
    ]


def _union(geometries: Sequence[Any]) -> Any:
    import shapely

    return shapely.union_all(list(geometries))
