"""Tables of a problem file about geometry: shapes, the mesh, and edges that have names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tmc_vem.mesh.make.estimate import STEEPEST
from tmc_vem.mesh.make.far import near
from tmc_vem.mesh.make.shapes import HUGE, Shape, disc, polygon, rectangle
from tmc_vem.problems.cell_size import CellSize, check_size, is_field, scaled_size, size_text
from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import (
    require_choice,
    require_finite,
    require_positive,
    require_within,
    shown,
)

XY = tuple[float, float]
GRID = "grid"
CELLS = ("voronoi", "triangles", "quadrilaterals", GRID)
CRACKS = ("join", "keep")
# What says how cells are fitted to narrow places, and how many of them fit across one at most.
FITTING = ("across", "smallest")
MOST_ACROSS = 100.0


@dataclass(frozen=True)
class ShapeTable:
    """A simple shape: one of ``rectangle``, ``polygon`` and ``disc``.

    Attributes:
        rectangle: x0, y0, x1, y1 of two opposite corners.
        polygon: its corners in order.
        disc: x, y of the centre, and the radius.
        rounded: radius of the corners of a rectangle or polygon.
    """

    rectangle: tuple[float, float, float, float] | None = None
    polygon: tuple[XY, ...] | None = None
    disc: tuple[float, float, float] | None = None
    rounded: float = 0.0

    def shape(self) -> Shape:
        """The shape.

        Raises:
            InputError: there is not exactly one, or it has no area.
        """
        given = [name for name in ("rectangle", "polygon", "disc") if getattr(self, name) is not None]
        if len(given) != 1:
            raise InputError(f"give one of rectangle, polygon and disc, not {' and '.join(given) or 'none'}")
        if self.disc is not None:
            if self.rounded:
                raise InputError("'rounded' is for rectangles and polygons")
            return disc(*self.disc)
        if self.rectangle is not None:
            return rectangle(*self.rectangle, self.rounded)
        assert self.polygon is not None
        return polygon(self.polygon, self.rounded)

    def places(self) -> list[XY]:
        """Points that lie about the shape."""
        if self.disc is not None:
            x, y, r = self.disc
            return [(x - r, y - r), (x + r, y + r)]
        if self.rectangle is not None:
            return [self.rectangle[:2], self.rectangle[2:]]
        return list(self.polygon or ())

    def from_origin(self, origin: XY) -> ShapeTable:
        """The same shape with coordinates from another origin on."""
        return ShapeTable(
            None if self.rectangle is None else (*near(self.rectangle[:2], origin), *near(self.rectangle[2:], origin)),
            None if self.polygon is None else tuple(near(corner, origin) for corner in self.polygon),
            None if self.disc is None else (*near(self.disc[:2], origin), self.disc[2]),
            self.rounded,
        )


@dataclass(frozen=True)
class RefineTable:
    """Smaller cells in a part of the plane: near a point or a straight line.

    Attributes:
        near: a point x, y, or two points, the ends of a line.
        size: of the cells there.
        within: distance up to which cells have this size; beyond, it grows gradually to that of the mesh.
    """

    near: XY | tuple[XY, XY]
    size: float
    within: float = 0.0

    def __post_init__(self) -> None:
        require_positive("size", self.size, "of the cells, a length")
        require_finite("within", self.within, "a distance")
        for value in np.ravel(np.asarray(self.near)).tolist():
            require_within("near", value, -HUGE, HUGE)


@dataclass(frozen=True)
class MeshTable:
    """Where the mesh comes from: a file, or shapes with a size of cells.

    Attributes:
        file: mesh file (.vtu, .msh, .inp, .mat, ...) or gmsh geometry (.geo), relative to the problem file.
        names: for groups of the file, by their number or the name that they have there.
        region_data: cell data of the file whose values are regions.
        cracks: ``"keep"`` takes vertices of the file at the same place for cracks; ``"join"`` refuses them.
        cells: kind of cells made from shapes; ``"grid"`` for equal squares in shapes whose sides are lines of the grid.
        size: of these cells (length): a number, a formula of x and y, or in Python a function of points (n, 2).
        refine: places with smaller cells.
        growth: by how much cells grow for each unit of distance from such a place.
        fit: make cells smaller where regions are too narrow for them, or outlines have short pieces.
        across: cells that fit across narrow places, if ``fit`` is set.
        smallest: size of cells that no such place goes below; by default a hundredth of the size there.
    """

    file: str | None = None
    cells: str = "voronoi"
    size: CellSize | None = None
    refine: tuple[RefineTable, ...] = ()
    growth: float = 0.3
    fit: bool = False
    across: float = 2.0
    smallest: float | None = None
    names: Mapping[str, str] = field(default_factory=dict)
    region_data: str | None = None
    cracks: str = "join"

    def check_file(self) -> None:
        """Check that nothing is asked for beside a file that only cells made from shapes have.

        Raises:
            InputError: something is; the message names both.
        """
        for name in ("size", "refine", "cells", "growth", "fit"):
            value = getattr(self, name)
            if self.file is not None and value != getattr(MeshTable, name, ()):
                said = name if name == "refine" else f"{name} = {'true' if value is True else shown(value)}"
                raise InputError(
                    f"mesh: file = {shown(self.file)} and {said} do not go together: the file has its cells already, "
                    f"so leave out {name}"
                )

    def __post_init__(self) -> None:
        require_choice("cells", self.cells, CELLS)
        require_choice("cracks", self.cracks, CRACKS)
        if self.file is None and (self.names or self.region_data or self.cracks != "join"):
            raise InputError("names, region_data and cracks are for a mesh file")
        require_positive("growth", self.growth, "try 0.3")
        require_within("growth", self.growth, 0.0, STEEPEST, "a cell is twice as large as its neighbour at 1; try 0.3")
        self._check_size()
        for name in ("refine", "fit"):
            if self.cells == GRID and getattr(self, name):
                raise InputError(
                    f"{name} and cells = 'grid' do not go together: all its cells are equal; use other cells"
                )
        self._check_fit()

    @property
    def nominal(self) -> float:
        """What sizes of all cells are in proportion to: the size, or 1 where it varies."""
        return self.size if isinstance(self.size, float | int) else 1.0

    def possible(self, factors: Sequence[float]) -> tuple[float, ...]:
        """Factors for :meth:`scaled` in the same proportions, none of which makes cells too large to fit."""
        fitting = self.across / MeshTable.across / max(factors) if self.fit else 1.0
        return tuple(min(fitting, 1.0) * factor for factor in factors)

    def scaled(self, factor: float) -> MeshTable:
        """The same with all cells larger by a factor, which grow from place to place in proportion too.

        Raises:
            InputError: fewer cells than needed would fit across narrow places.
        """
        assert self.size is not None
        refine = tuple(replace(place, size=place.size * factor) for place in self.refine)
        size = scaled_size(self.size, factor)
        growth = min(self.growth * factor, STEEPEST) if self.fit or refine or is_field(self.size) else self.growth
        made = replace(self, size=size, refine=refine, growth=growth, fit=False, across=MeshTable.across, smallest=None)
        if not self.fit:
            return made
        across = self.across / factor
        if across < MeshTable.across:
            raise InputError(
                f"mesh: across = {self.across:g} with cells {factor:g} times as large leaves {across:.3g} cells across "
                f"narrow places, where {MeshTable.across:g} are needed: use cells up to "
                f"{self.across / MeshTable.across:g} times as large, or across = {MeshTable.across * factor:.3g}"
            )
        smallest = None if self.smallest is None else self.smallest * factor
        return replace(made, fit=True, across=across, smallest=smallest)

    def _check_size(self) -> None:
        if self.size is None:
            return
        check_size(self.size)
        if self.cells == GRID and is_field(self.size):
            raise InputError(
                f"size = {size_text(self.size)} and cells = 'grid' do not go together: all its cells are equal; give a "
                "number, or use other cells"
            )

    def _check_fit(self) -> None:
        if not self.fit:
            for name in FITTING:
                if getattr(self, name) != getattr(MeshTable, name):
                    raise InputError(f"{name} = {shown(getattr(self, name))} is for fit = true")
        require_within("across", self.across, 2.0, MOST_ACROSS, "cells across a narrow place; two is the least there")
        if self.smallest is not None:
            require_positive("smallest", self.smallest, "size of cells that no narrow place goes below")
            if isinstance(self.size, float | int) and self.smallest > self.size:
                raise InputError(
                    f"smallest = {self.smallest:g} is larger than size = {self.size:g}: cells that fit are smaller"
                )


@dataclass(frozen=True)
class EdgesTable:
    """Edges of the mesh, along outlines and interfaces, that fulfil everything given here.

    Attributes:
        line: ends of a straight line that they lie on.
        circle: centre x, y and radius of a circle that their ends lie on.
        box: x0, y0, x1, y1 of a rectangle that they lie in.
        between: two regions that they separate; ``"outside"`` is one.
    """

    line: tuple[XY, XY] | None = None
    circle: tuple[float, float, float] | None = None
    box: tuple[float, float, float, float] | None = None
    between: tuple[str, str] | None = None

    def __post_init__(self) -> None:
        if all(value is None for value in (self.line, self.circle, self.box, self.between)):
            raise InputError("give at least one of line, circle, box and between")
        for name in ("line", "circle", "box"):
            for value in np.ravel(np.asarray(getattr(self, name) or ())).tolist():
                require_within(name, value, -HUGE, HUGE)
