"""How a mesh was adapted: rounds of solving, estimating and refining, with estimated errors beside the values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

# How an estimate was made: the refined problem was solved, only linearised, or gradients were recovered.
SOLVED, LINEARISED, RECOVERED = "solved", "linearised", "recovered"


@dataclass(frozen=True)
class Round:
    """A mesh at a load.

    Attributes:
        number: 0 for the first mesh.
        load: load factor.
        n_cells, n_dofs: of the mesh.
        values: results by name; gap, reaction, energy and all probes.
        errors: estimated errors of those that have one, exact value less value.
        estimate: ``"solved"``, ``"linearised"`` or ``"recovered"``; empty if there is none, and ``doubt`` says why.
        doubt: what is to be said about the estimates.
        found: how equilibrium was found on this mesh.
        iterations: of Newton's method for it.
        refined_dofs, refined_iterations: of the refined problem that the estimates are from.
        before: energy and reaction before the state came to this mesh, at the same load; empty on a first mesh.
        refined: how many cells of this mesh are cut for the next one.
        seconds: wall time, estimates and the next mesh included.
    """

    number: int
    load: float
    n_cells: int
    n_dofs: int
    values: Mapping[str, float]
    errors: Mapping[str, float] = field(default_factory=dict)
    estimate: str = ""
    doubt: str = ""
    found: str = ""
    iterations: int = 0
    refined_dofs: int = 0
    refined_iterations: int = 0
    before: Mapping[str, float] = field(default_factory=dict)
    refined: int = 0
    seconds: float = 0.0

    def relative(self, name: str) -> float | None:
        """Estimated error of a value relative to it, without a sign; None if there is no estimate."""
        if name not in self.errors:
            return None
        value = self.values[name]
        return abs(self.errors[name] / value) if value else float("inf")


def error_in_words(round_: Round, name: str) -> str:
    """The estimated error of a value: ``+0.3 %`` if the exact one is that much larger in size."""
    relative = round_.relative(name)
    if relative is None:
        return "without an estimate"
    larger = round_.errors[name] * round_.values[name] > 0.0
    return f"({'+' if larger else '-'}{100.0 * relative:.2g} %)"


@dataclass(frozen=True)
class Adaptivity:
    """All rounds of a run.

    Attributes:
        of: names of the results that the mesh was adapted to.
        tolerance: relative error that was asked for.
        rounds: in order; with several loads, those of each after those of the one before.
        reached: whether the estimates of all these results are within the tolerance at all loads.
        reason: why no more rounds were made.
    """

    of: tuple[str, ...]
    tolerance: float
    rounds: Sequence[Round]
    reached: bool
    reason: str

    @property
    def last(self) -> Round:
        """The last round."""
        return self.rounds[-1]

    @property
    def errors(self) -> Mapping[str, float]:
        """Estimated errors of results on the last mesh at the last load, exact value less value."""
        return self.last.errors

    def as_dict(self) -> dict[str, Any]:
        """Plain values."""
        return {**asdict(self), "of": list(self.of), "rounds": [asdict(each) for each in self.rounds]}

    @staticmethod
    def from_dict(data: Mapping[str, Any]) -> Adaptivity:
        """From plain values.

        Raises:
            TypeError: they have the wrong form.
        """
        try:
            rounds = tuple(Round(**each) for each in data["rounds"])
            made = Adaptivity(**{**data, "of": tuple(data["of"]), "rounds": rounds})
        except (KeyError, TypeError, AttributeError):
            raise TypeError("adaptivity has the wrong form") from None
        if not rounds:
            raise TypeError("adaptivity has no rounds")
        return made
