"""What meshes are adapted to, and how far."""

from __future__ import annotations

from dataclasses import dataclass, field

from tmc_vem.support.errors import InputError
from tmc_vem.support.settings import about, described
from tmc_vem.support.validation import check_fields, shown

REFINED, RECOVERY = "refined", "recovery"
ESTIMATORS = (REFINED, RECOVERY)
CUT, ANEW = "cut", "anew"
SMALLEST, LARGEST = 1e-9, 0.5  # tolerances


@described
@dataclass(frozen=True)
class AdaptSettings:
    """How a mesh is adapted to results."""

    of: str = field(
        default="",
        metadata=about(
            "Adapt the mesh to these results, names with commas between: gap, reaction, energy, a probe. Their errors "
            "are estimated, cells that matter are refined.",
            detail="Empty for the mesh as it is.",
        ),
    )
    tolerance: float | str = field(
        default="1%", metadata=about("Relative error of these results at which refinement ends: 0.5% or 0.005.")
    )
    rounds: int = field(default=8, metadata=about("Largest number of times that the mesh is refined at each load."))
    at: tuple[float, ...] = field(
        default=(),
        metadata=about(
            "Load factor at which the mesh is adapted, from small to large; the last load always is one.",
        ),
    )
    estimator: str = field(
        default=REFINED,
        metadata=about(
            "Errors are those to the mesh refined once more, or from recovered gradients, which is cheaper and cruder.",
            choices=ESTIMATORS,
        ),
    )
    meshes: str = field(
        default=CUT,
        metadata=about(
            "Cells are cut, or the mesh is made anew from the shapes, with smaller cells where they matter.",
            choices=(CUT, ANEW),
        ),
    )
    cells: int = field(default=200_000, metadata=about("Largest number of cells that refinement may lead to."))

    @property
    def names(self) -> tuple[str, ...]:
        """What the mesh is adapted to; nothing if it is not."""
        return tuple(dict.fromkeys(name.strip() for name in self.of.split(",") if name.strip()))

    @property
    def relative(self) -> float:
        """The tolerance as a number."""
        return parse_tolerance(self.tolerance)

    def __post_init__(self) -> None:
        check_fields(self)
        if self.of.strip() and not self.names:
            raise InputError(f"adapt: of = {shown(self.of)} names no result: gap, reaction, energy or a probe")
        _ = self.relative
        if not 1 <= self.rounds <= 50:
            raise InputError(f"adapt: rounds = {self.rounds}: use 1 to 50")
        if not 1 <= self.cells <= 10_000_000:
            raise InputError(f"adapt: cells = {self.cells}: use 1 to 10000000")
        if any(not 0.0 < load <= 1000.0 for load in self.at) or list(self.at) != sorted(set(self.at)):
            raise InputError(f"adapt: at = {list(self.at)}: give load factors above 0, each larger than the one before")


def parse_tolerance(text: float | str) -> float:
    """A relative tolerance, ``0.5%`` or ``0.005``.

    Raises:
        InputError: it is none.
    """
    number = str(text).strip()
    percent = number.endswith("%")
    try:
        value = float(number.removesuffix("%")) * (0.01 if percent else 1.0)
    except ValueError:
        raise InputError(f"adapt: tolerance = {shown(text)} is no number: write 0.5% or 0.005") from None
    if not SMALLEST <= value <= LARGEST:
        raise InputError(f"adapt: tolerance = {text}: use {SMALLEST:g} to {LARGEST:g}, 0.01 or 1% is usual")
    return value
