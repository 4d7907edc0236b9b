"""Tables 2 and 3 of Xu & Wriggers, CMAME 450 (2026) 118611, as printed, with the cells that cannot be right marked."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

COLUMNS = ("vem_mesh1", "vem_mesh2", "vem_mesh3", "fem_fine")


@dataclass(frozen=True)
class Printed:
    """A printed value.

    Attributes:
        value: the gap, or None where the paper reports that the computation does not converge.
        suspect: why the value cannot be right, or nothing. Such cells are shown, and never compared with.
    """

    value: float | None
    suspect: str = ""

    @property
    def usable(self) -> bool:
        """Whether there is a number to compare with."""
        return self.value is not None and not self.suspect


def _rows(name: str) -> Iterator[dict[str, str]]:
    text = (files("tmc_vem.study.paper") / name).read_text(encoding="utf-8")
    yield from csv.DictReader(text.splitlines())


@cache
def _reasons() -> dict[tuple[str, str, str], str]:
    return {(row["table"], row["row"], row["column"]): row["reason"] for row in _rows("suspect.csv")}


def _cell(table: str, row: str, column: str, text: str) -> Printed:
    return Printed(float(text) if text else None, _reasons().get((table, row, column), ""))


@cache
def table2() -> dict[tuple[float, float], dict[str, Printed]]:
    """Gap of the box at u_y = -1 by (alpha_r, gamma) and column: three VEM meshes and fine FEM; regulariser (9) damped
    by exp(-5 J)."""
    return {
        (float(row["alpha_r"]), float(row["gamma"])): {
            column: _cell("table2", f"{row['alpha_r']} {row['gamma']}", column, row[column]) for column in COLUMNS
        }
        for row in _rows("table2.csv")
    }


@cache
def table3() -> dict[str, dict[str, Printed]]:
    """Gap of the box at u_y = -1 by regulariser and column, three VEM meshes; alpha_r = 10, gamma = 1e-6."""
    return {
        row["regulariser"]: {column: _cell("table3", row["regulariser"], column, row[column]) for column in COLUMNS[:3]}
        for row in _rows("table3.csv")
    }
