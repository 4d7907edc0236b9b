"""What a design does as densities, and as a body-fitted problem: both runs side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tmc_vem.design.extract import Extracted
from tmc_vem.report.page import Table
from tmc_vem.report.tables import number, percent, relative
from tmc_vem.results.records import StepRecord
from tmc_vem.results.run_result import RunResult
from tmc_vem.support.errors import InputError


@dataclass(frozen=True)
class Compared:
    """A quantity of both runs.

    Attributes:
        name: of the quantity; probes have theirs.
        design, extracted: its values.
        unit: of both, empty if none was declared.
    """

    name: str
    design: float
    extracted: float
    unit: str = ""

    @property
    def difference(self) -> float | None:
        """(extracted - design) / design; None if the design's value is 0."""
        return relative(self.extracted, self.design)


def compare_runs(design: RunResult, extracted: RunResult, of: Extracted | None = None) -> list[Compared]:
    """Volume, displacement, reaction, probes and loads that both runs have, at the last load that both reached.

    Between load steps, values are interpolated linearly.

    Args:
        design: run of the design problem.
        extracted: run of the extracted one.
        of: the extracted problem, for the volumes.

    Raises:
        InputError: one run has no load step.
    """
    for what, run in (("design", design), ("extracted", extracted)):
        if run.last is None:
            raise InputError(f"the run of the {what} problem has no load step: there is nothing to compare")
    at = common_load(design, extracted)
    first, second = _values(design.history, at), _values(extracted.history, at)
    found = [Compared(name, first[name], second[name], design.unit(name)) for name in first if name in second]
    if of is not None:
        found.insert(0, Compared("volume", of.outlines.volume_densities, of.volume_mesh))
    return found


def comparison_table(design: RunResult, extracted: RunResult, of: Extracted | None = None) -> Table:
    """The same as a table for a report.

    Raises:
        InputError: one run has no load step.
    """
    rows = [
        (f"{each.name} ({each.unit})" if each.unit else each.name, number(each.design), number(each.extracted),
         percent(each.difference))
        for each in compare_runs(design, extracted, of)
    ]  # fmt: skip
    at = common_load(design, extracted)
    return Table(
        f"The design as densities and as a body-fitted problem, at {at:.4g} of the load.",
        ("quantity", "densities", "body-fitted", "difference"),
        rows,
    )


def common_load(design: RunResult, extracted: RunResult) -> float:
    """How far along the path both runs came."""
    return min(run.last.coordinate for run in (design, extracted) if run.last is not None)


def _values(history: Sequence[StepRecord], at: float) -> dict[str, float]:
    """Everything reported, at a place on the path; 0 of displacement and reaction where it begins."""
    along = [step.coordinate for step in history]
    names = [name for name in history[-1].reported if all(name in step.reported for step in history)]
    values = {name: float(np.interp(at, along, [step.reported[name] for step in history])) for name in names}
    columns = {
        "displacement": [0.0, *(step.displacement for step in history)],
        "reaction": [0.0, *(step.reaction for step in history)],
    }
    return {name: float(np.interp(at, [0.0, *along], column)) for name, column in columns.items()} | values
