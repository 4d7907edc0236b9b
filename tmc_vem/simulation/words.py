"""What files of a run are headed with: units of columns, the title of the picture; what is said if they fail."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from tmc_vem.problems.base import Problem
from tmc_vem.problems.columns import KINDS, named_loads, pair_of, quantities_of
from tmc_vem.results.records import OF, StepRecord
from tmc_vem.results.unfinished import how_to_go_on
from tmc_vem.support.errors import TmcError
from tmc_vem.system.forces import BodyForce


def units_of_columns(problem: Problem, more: Mapping[str, str], record: StepRecord | None = None) -> dict[str, str]:
    """Units of the columns of the history.

    Args:
        problem: what is solved.
        more: kinds of columns of probes and of contact, by name.
        record: whose columns; without one, those that every step will have.
    """
    named = named_loads(problem)
    by_name = {load.name + OF + quantity: KINDS[quantity] for load in named for quantity in quantities_of(load)}
    first = dict(zip(("displacement", "reaction"), pair_of(problem.load()), strict=True))
    kinds = {**more, **by_name, **{name: KINDS[quantity] for name, quantity in first.items()}}
    by_region = [f"{group}{name}" for group in ("min_j_", "energy_") for name in problem.regions()]
    columns = ["displacement", *more, "reaction", *by_region, *by_name] if record is None else record.as_row()
    return problem.units().of_columns(columns, kinds)


def title_of(problem: Problem, history: Sequence[StepRecord]) -> str:
    """Title of a picture of the last state."""
    if not history:
        return f"{problem.name}, undeformed"
    last, load = history[-1], problem.load()
    gap = "" if last.gap is None else f", gap {last.gap:.4g}"
    where = "" if isinstance(load, BodyForce) else f"{load.where} "
    return f"{problem.name} at {where}{pair_of(load)[0]} {last.displacement:g}{gap}"


@contextmanager
def reported(directory: Path) -> Iterator[None]:
    """Say in one line that a file could not be written; called on all ranks together.

    Raises:
        TmcError: the disk is full, for example.
    """
    try:
        yield
    except OSError as error:
        reason, how = error.strerror or str(error), how_to_go_on(directory)
        after = f"; with more room, {how} from the last checkpoint" if how else ""
        raise TmcError(f"{directory} cannot be written ({reason}){after}") from error
