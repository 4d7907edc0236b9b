"""Derivatives of several results by several numbers: as a table, as JSON and as a data frame."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from tmc_vem.results.records import finite
from tmc_vem.support import optional

SCHEMA = 1


@dataclass(frozen=True)
class Entry:
    """A result and its derivative by a number.

    Attributes:
        of, by: names of the result and of the number.
        value, number: what they are.
        derivative: of the result by the number.
        units: of result, number and derivative; empty where there is none or it is not known.
        difference: the derivative by central differences, from runs with numbers nearby; None if there were none.
    """

    of: str
    by: str
    value: float
    number: float
    derivative: float
    units: tuple[str, str, str] = ("", "", "")
    difference: float | None = None

    @property
    def elasticity(self) -> float | None:
        """``p / v dv/dp``: by how many percent the result changes with one percent more of the number; None where the
        result is 0."""
        return self.number / self.value * self.derivative if self.value else None

    @property
    def deviation(self) -> float | None:
        """By how much derivative and central difference differ, relative to the larger; 0 if both are."""
        if self.difference is None:
            return None
        largest = max(abs(self.derivative), abs(self.difference))
        return abs(self.derivative - self.difference) / largest if largest else 0.0


@dataclass(frozen=True)
class SensitivityTable:
    """Derivatives at a state.

    Attributes:
        problem: its name.
        load: load factor of the state.
        entries: each result with each number, the numbers varying fastest.
        doubts: why values nearby may not follow the derivatives, in sentences.
    """

    problem: str
    load: float
    entries: Sequence[Entry]
    doubts: Sequence[str] = ()

    def entry(self, of: str, by: str) -> Entry:
        """That of a result and a number.

        Raises:
            KeyError: it is not in the table.
        """
        for entry in self.entries:
            if (entry.of, entry.by) == (of, by):
                return entry
        raise KeyError((of, by))

    def as_dict(self) -> dict[str, Any]:
        """All of it as plain values."""
        return {
            "schema": SCHEMA,
            "problem": self.problem,
            "load": self.load,
            "doubts": list(self.doubts),
            "derivatives": [_plain(entry) for entry in self.entries],
        }

    def to_json(self, more: Mapping[str, Any] | None = None) -> str:
        """Text of JSON, with entries of a caller's own; a value that is no number becomes null."""
        return json.dumps(finite({**self.as_dict(), **(more or {})}), indent=2, allow_nan=False) + "\n"

    def to_pandas(self) -> Any:
        """A data frame with a row for each result and number, which are its index; ``unit`` is that of the derivative.

        Raises:
            InputError: pandas is not installed.
        """
        pandas = optional.load("pandas", "this needs")
        rows = [{**_plain(entry), "units": entry.units[2]} for entry in self.entries]
        return pandas.DataFrame(rows).rename(columns={"units": "unit"}).set_index(["of", "by"])


def _plain(entry: Entry) -> dict[str, Any]:
    plain = asdict(entry)
    units = dict(zip(("value", "number", "derivative"), plain.pop("units"), strict=True))
    difference = plain.pop("difference")
    checked = {} if difference is None else {"difference": difference, "deviation": entry.deviation}
    return {**plain, "elasticity": entry.elasticity, **checked, "units": units}
