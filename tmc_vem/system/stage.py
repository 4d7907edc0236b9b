"""A stage of a run, as data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import check_fields, require_within
from tmc_vem.system.histories import LATEST

CLOSE = 1e-12  # times are one if they differ by less


@dataclass(frozen=True)
class Stage:
    """A part of a run, up to the beginning of the next one, in which the same supports hold.

    Attributes:
        name: what supports call it.
        begins: time at which it begins; 0 for the first.

    Raises:
        InputError: the time is not from 0 to the latest one.
    """

    name: str
    begins: float

    def __post_init__(self) -> None:
        check_fields(self)
        require_within("begins", self.begins, 0.0, LATEST, "a time")


def check_stages(stages: Sequence[Stage]) -> None:
    """Check that stages follow each other from 0 on, and have names of their own.

    Raises:
        InputError: they do not.
    """
    for n, stage in enumerate(stages, start=1):
        if n == 1 and stage.begins != 0.0:
            raise InputError(f"stage, entry 1: begins = {stage.begins:g}: the first stage begins at 0")
        if n > 1 and stage.begins <= stages[n - 2].begins:
            raise InputError(
                f"stage, entry {n}: begins = {stage.begins:g} must be later than {stages[n - 2].begins:g} before it"
            )
        if stage.name in [other.name for other in stages[: n - 1]]:
            raise InputError(f"stage, entry {n}: name = '{stage.name}' is that of another stage already")
