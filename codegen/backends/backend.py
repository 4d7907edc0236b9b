"""What printing a function of a point asks of a language.

A schedule says what is computed in which order; :mod:`codegen.functions` goes through it once for all languages. A
backend has the words for it: how a constant is declared, where arguments stand, how a number or a power is written, and
what a whole file consists of.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from codegen.driver import Driver
from codegen.ir import DerivedEnergy, Schedule, SymExpr


class Backend(Protocol):
    """A language that functions of a point are printed in."""

    def expression(self, value: SymExpr) -> str:
        """Text of an expression."""

    def constant(self, name: str, value: str) -> str:
        """Statement that gives a name to a value."""

    def parameter(self, number: int, n_uniform: int) -> str:
        """A parameter of the energy by its number; the first ``n_uniform`` are the same in all cells."""

    def entry(self, array: str, number: int) -> str:
        """An entry of an array that is read at a point."""

    def output(self, target: str, value: str) -> str:
        """Statement that writes a value to what a schedule calls ``psi`` or ``g[3]``."""

    def files(
        self, derived: DerivedEnergy, schedules: Mapping[str, Schedule], about: Sequence[str], driver: Driver | None
    ) -> dict[str, str]:
        """Texts of all files of an energy by their suffix.

        Args:
            derived: the energy and its derivatives.
            schedules: programs of its levels.
            about: lines about it, for a comment.
            driver: what there is besides the functions of a point, in the same language.
        """
