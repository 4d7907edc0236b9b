"""States beside the load path, with lower gamma than the problem's: those so far, and the descent that goes on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from tmc_vem.results.records import StepRecord
from tmc_vem.simulation.saved import facts_of
from tmc_vem.solve.friction_steps import FrictionRecord
from tmc_vem.solve.states import States
from tmc_vem.solve.stepping import StepperState


@dataclass
class Descending:
    """A descent that goes on.

    Attributes:
        start: number of the load step from which gamma is lowered.
        records: of its states so far.
        states, position: from which its stepping can go on.
        passed: Newton iterations of states that are not recorded.
    """

    start: int
    records: list[StepRecord]
    states: States
    position: StepperState
    passed: int = 0

    def facts(self) -> dict[str, Any]:
        """Plain values for a checkpoint, which has the states themselves elsewhere."""
        return {
            "start": self.start,
            "records": [asdict(record) for record in self.records],
            **facts_of(self.states),
            "position": asdict(self.position),
            "passed": self.passed,
        }

    @staticmethod
    def from_facts(facts: Mapping[str, Any], states: States) -> Descending:
        """What a checkpoint has."""
        records = [StepRecord.from_plain(entry) for entry in facts["records"]]
        return Descending(facts["start"], records, states, stepper_state(facts["position"]), facts.get("passed", 0))


@dataclass
class Lowered:
    """What descents have recorded.

    Attributes:
        records: states in the order in which they were found; ``limit_of`` is the load step of each.
        done: for each load step from which gamma was lowered to the end, or as far as possible, why not further.
        failed_iterations: of Newton's method in steps of descents that have failed for good, or are not recorded.
        friction_error: the largest with any lower gamma, in problems with friction.
    """

    records: list[StepRecord] = field(default_factory=list)
    done: dict[int, str] = field(default_factory=dict)
    failed_iterations: int = 0
    friction_error: float = 0.0

    def end(self, start: int, records: Sequence[StepRecord], why: str, iterations: int) -> None:
        """A descent has ended.

        Args:
            start: number of the load step.
            records: of its states.
            why: it did not go further; empty if it went to its end.
            iterations: in vain since its last state.
        """
        self.records += records
        self.done[start] = why
        self.failed_iterations += iterations

    def iterations(self, goes_on: Descending | None) -> int:
        """Newton iterations with lower gamma, failed ones included, also of a descent that goes on."""
        records, passed = (goes_on.records, goes_on.passed) if goes_on is not None else ([], 0)
        counted = sum(r.iterations + r.wasted_iterations for r in (*self.records, *records))
        return self.failed_iterations + passed + counted

    def of(self, start: int) -> list[StepRecord]:
        """States below one load step."""
        return [record for record in self.records if record.limit_of == start]

    def facts(self) -> dict[str, Any]:
        """Plain values for a checkpoint."""
        done = [[start, why] for start, why in self.done.items()]
        return {**asdict(self), "done": done}

    @staticmethod
    def from_facts(facts: Mapping[str, Any]) -> Lowered:
        """What a checkpoint has."""
        records = [StepRecord.from_plain(entry) for entry in facts["records"]]
        done = {int(start): str(why) for start, why in facts["done"]}
        return Lowered(records, done, facts["failed_iterations"], facts.get("friction_error", 0.0))

    def friction_checks(self) -> dict[str, dict[str, float]]:
        """What a result says about friction with lower gamma; nothing without."""
        return {"friction_error_lowered": {"largest": self.friction_error}} if self.friction_error > 0.0 else {}


def stepper_state(facts: Mapping[str, Any]) -> StepperState:
    """Where the stepping of a checkpoint stands."""
    stiffer = tuple((float(time), float(factor)) for time, factor in facts["stiffer"])
    friction = FrictionRecord(**facts.get("friction", {}))
    return StepperState(**{**facts, "stiffer": stiffer, "friction": friction})
