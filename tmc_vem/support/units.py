"""Units of results, made from those of length and force that a problem declares; any consistent set will do.

Everything is plane strain: forces and energies are per unit of thickness.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import check_fields, shown

LENGTH, FORCE, ENERGY, STRESS, NONE = "length", "line force", "line energy", "stress", "number"
AREA, ANGLE, VOLUME = "area", "angle", "volume"
# of the arrays in VTU files and of the columns of the history; names that end in _ are followed by that of a region
COORDINATES = "Points"
FIELDS = {
    COORDINATES: LENGTH,
    "displacement": LENGTH,
    "J": NONE,
    "min_J": NONE,
    "energy_density": STRESS,
    "region": NONE,
    "medium": NONE,
}
COLUMNS = {
    "displacement": LENGTH,
    "reaction": FORCE,
    "load_force": ENERGY,
    "load_work": ENERGY,
    "energy_": ENERGY,
    "min_j_": NONE,
}
_WORD = re.compile(r"[^\[\]\"<>&\s]{1,20}")


@dataclass(frozen=True)
class Units:
    """What lengths and forces are measured in; moduli are in force / length^2.

    Attributes:
        length: such as ``mm``; a word for any unit if it is not declared.
        force: such as ``N``.
    """

    length: str = "length"
    force: str = "force"

    def __post_init__(self) -> None:
        check_fields(self)
        for name, value in (("length", self.length), ("force", self.force)):
            if not (_WORD.fullmatch(value) and value.isprintable()):
                raise InputError(f"unit of {name} = {shown(value)}: use a short word such as mm or N")
        if (self.length == Units.length) != (self.force == Units.force):
            raise InputError("give the units of both length and force, such as mm and N, or of neither")

    @property
    def declared(self) -> bool:
        """Whether they are units, and not words for any."""
        return self.length != Units.length

    def of(self, kind: str) -> str:
        """Unit of a kind of quantity, ``1`` for a plain number."""
        return {
            LENGTH: self.length,
            FORCE: f"{self.force}/{self.length}",
            ENERGY: self.force,
            STRESS: f"{self.force}/{self.length}^2",
            AREA: f"{self.length}^2",
            VOLUME: f"{self.length}^3",
            ANGLE: "degrees",
            NONE: "1",
        }[kind]

    def of_fields(self) -> dict[str, str]:
        """Units of the arrays in VTU files by name."""
        return {name: self.of(kind) for name, kind in FIELDS.items()}

    def of_columns(self, columns: Iterable[str], probes: Mapping[str, str]) -> dict[str, str]:
        """Units of those columns of the history that have one.

        Args:
            columns: their names.
            probes: kind of quantity by name of the probe.
        """
        found = {}
        for column in columns:
            starts = [start for start in COLUMNS if start == column or (start[-1] == "_" and column.startswith(start))]
            if column in probes or starts:
                found[column] = self.of(probes[column] if column in probes else COLUMNS[starts[0]])
        return found
