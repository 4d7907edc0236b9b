"""How a design becomes a body-fitted problem: what can be chosen."""

from __future__ import annotations

from dataclasses import dataclass, field

from tmc_vem.problems.mesh_tables import CELLS
from tmc_vem.support.errors import InputError
from tmc_vem.support.settings import about, described
from tmc_vem.support.validation import check_fields, require_choice, require_positive, require_within


@described
@dataclass(frozen=True)
class ExtractOptions:
    """Outlines of a design and the mesh in them. Widths are in sizes of the design's cells where it changes."""

    level: float | None = field(
        default=None,
        metadata=about(
            "Density from which on a place is solid.", none="that at which the volume is the densities' own"
        ),
    )
    smallest: float = field(
        default=4.0, metadata=about("Area, in design cells, below which islands are removed and holes are filled.")
    )
    narrowest: float = field(
        default=0.5, metadata=about("Width, in design cells, below which gaps are closed, films cut and necks widened.")
    )
    smoothing: int = field(default=10, metadata=about("Passes of smoothing along outlines, 0 for none."))
    tolerance: float = field(
        default=0.02, metadata=about("How far, in design cells, points of outlines that are left out may be from them.")
    )
    volume: float = field(
        default=0.01, metadata=about("Largest relative change of the volume by smoothing, without a refusal.")
    )
    cells: str = field(default="voronoi", metadata=about("Kind of cells of the new mesh.", choices=CELLS))
    size: float | None = field(
        default=None, metadata=about("Size of these cells, a length.", none="that of the design's cells")
    )
    across: float = field(default=2.0, metadata=about("Cells that fit across narrow gaps and thin members at least."))
    growth: float = field(default=0.3, metadata=about("By how much cells grow for each unit of distance from there."))

    def __post_init__(self) -> None:
        check_fields(self)
        if self.level is not None:
            require_within("level", self.level, 0.01, 0.99, "a density between void and solid, try 0.5")
        require_within("smallest", self.smallest, 0.0, 1e6, "an area in cells, try 4")
        require_within("narrowest", self.narrowest, 0.05, 10.0, "a width in cells, try 0.5")
        if not 0 <= self.smoothing <= 1000:
            raise InputError(f"smoothing = {self.smoothing}: use 0 to 1000 passes")
        require_within("tolerance", self.tolerance, 0.0, 1.0, "a distance in cells, try 0.02")
        require_positive("volume", self.volume, "a relative change, try 0.01")
        require_choice("cells", self.cells, CELLS)
        if self.size is not None:
            require_positive("size", self.size, "of the cells, a length")
        require_within("across", self.across, 1.0, 100.0, "a number of cells, try 2")
        require_within("growth", self.growth, 0.01, 1.0, "try 0.3")
