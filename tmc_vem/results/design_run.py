"""What a search for a design leaves behind: names of its files, and ``result.json`` as plain values.

A directory of a design holds ``design.toml`` (the problem as it was solved), ``history.csv`` (a row an evaluation),
``evaluations`` (each with its gradients), ``stiffness.npz`` and ``final.toml`` (the best design as a problem),
``design.vtu``, pictures, a report, and ``final``, a run of the best design; until there is a result, ``run.json``.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from tmc_vem.results.records import DESIGN, RESULT, finite
from tmc_vem.results.unfinished import unfinished
from tmc_vem.support.errors import InputError

# Schema that is written and read.
SCHEMA = 1
KIND = "design"
EVALUATIONS, DESIGNS, COLLECTION, BEST = "evaluations", "designs", "design.pvd", "design.vtu"
STIFFNESS, FINAL = "stiffness.npz", "final"
PICTURE, DEFORMED, CURVES, ANIMATION = "design.png", "deformed", "history.png", "design.gif"
OUTLINES = "outlines"  # what 'tmc-vem extract' makes of the design


@dataclass(frozen=True)
class LimitValue:
    """A limit, and how far the design is from it.

    Attributes:
        value: of the result.
        at_most, at_least: the limit; one of them.
        margin: what is left to the limit, in the unit of the value; negative where it is violated.
        satisfied: whether it is.
    """

    value: float
    margin: float
    satisfied: bool
    at_most: float | None = None
    at_least: float | None = None


@dataclass(frozen=True)
class DesignRun:
    """The best design of a search, as ``result.json`` has it.

    Attributes:
        problem: its name.
        minimise, maximise: what was made small or large; one of them.
        objective: its value, the weighted sum over the load cases.
        values: results of the best design by name, loaded from the beginning.
        volume: fraction of the design regions.
        limits: by name, the volume among them.
        feasible: whether all limits are satisfied.
        converged: whether the search ended because designs hardly changed any more.
        reason: why it ended.
        stationarity: what is left of the gradient, see :class:`tmc_vem.design.evaluation.Optimum`.
        evaluations, iterations, starts: how many there were.
        newton_iterations: of all evaluations.
        seconds: of all evaluations, and in all.
        method: of the search.
        beta: of the last projection; None without one.
        n_cells, n_dofs, n_variables: sizes.
        cases: names of the load cases; none if there is but one.
        runs: directories of runs of the best design by load case, relative to this one.
        notes: what else is to be said.
        inputs, versions: as of a run.
        directory: where it is; None if nothing was written.
    """

    problem: str
    minimise: str
    maximise: str
    objective: float
    values: Mapping[str, float]
    volume: float
    limits: Mapping[str, LimitValue]
    feasible: bool
    converged: bool
    reason: str
    stationarity: float
    evaluations: int
    iterations: int
    starts: int
    newton_iterations: int
    seconds: Mapping[str, float]
    method: str
    beta: float | None
    n_cells: int
    n_dofs: int
    n_variables: int
    cases: Sequence[str] = ()
    runs: Mapping[str, str] = field(default_factory=dict)
    notes: Sequence[str] = ()
    inputs: Mapping[str, Any] = field(default_factory=dict)
    versions: Mapping[str, Any] = field(default_factory=dict)
    directory: Path | None = None

    @property
    def of(self) -> str:
        """What was made small or large."""
        return self.minimise or self.maximise

    @property
    def sentence(self) -> str:
        """Whether the design does what was asked for, in a sentence."""
        if self.feasible:
            count = len(self.limits)
            kept = f"The design satisfies {'its limit' if count == 1 else f'all {count} limits'}" if count else (
                "The design has no limits"
            )  # fmt: skip
            return f"{kept}: {self.of} = {self.objective:.6g}."
        broken = [f"{name} by {-limit.margin:.3g}" for name, limit in self.limits.items() if not limit.satisfied]
        return f"NOT FEASIBLE: no design satisfied all limits; the best one violates {', '.join(broken)}."

    @property
    def ending(self) -> str:
        """How the search ended, in a sentence."""
        ended = "converged" if self.converged else "did not converge"
        return f"The search {ended} after {self.evaluations} evaluations: {self.reason}."

    def as_dict(self) -> dict[str, Any]:
        """Content of result.json."""
        plain = asdict(self)
        del plain["directory"]
        return {"schema": SCHEMA, "kind": KIND, **plain}

    def to_json(self) -> str:
        """Text of result.json; a value that is not a number becomes null."""
        return json.dumps(finite(self.as_dict()), indent=2, allow_nan=False) + "\n"

    @staticmethod
    def read(directory: str | Path) -> DesignRun:
        """Result of a directory of a design.

        Raises:
            InputError: it is not one, or the search has no result yet; the message says how it goes on.
        """
        path = Path(directory)
        try:
            data = json.loads((path / RESULT).read_text())
        except FileNotFoundError:
            raise InputError(_without_result(path)) from None
        except (OSError, ValueError) as error:
            raise InputError(f"{path} is not a readable directory of a design: {error}") from None
        if not isinstance(data, dict) or data.get("kind") != KIND:
            raise InputError(f"{path} is not a directory of 'tmc-vem optimise'")
        if data.get("schema") != SCHEMA:
            raise InputError(f"{path} has schema {data.get('schema')}, known is {SCHEMA}: use another version")
        plain = {name: value for name, value in data.items() if name not in ("schema", "kind")}
        try:
            plain["limits"] = {name: LimitValue(**limit) for name, limit in plain["limits"].items()}
            plain |= {name: tuple(plain[name]) for name in ("cases", "notes")}
            return DesignRun(**plain, directory=path)
        except (TypeError, KeyError, AttributeError) as error:
            raise InputError(f"{path} is not a readable directory of a design: {error}") from None


def _without_result(path: Path) -> str:
    """What there is to say about a directory without a result."""
    if not (path / DESIGN).is_file():
        return f"{path} is not a directory of 'tmc-vem optimise'"
    try:
        known = unfinished(path)
    except (OSError, ValueError) as error:
        return f"{path} is not a readable directory of a design: {error}"
    return f"{path} has no result yet ({known['unfinished']}): {known['reason']}"
