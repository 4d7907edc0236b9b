"""A block of numbers in a page, and the packages' common parts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from pages.runs import Batch, Measure

COSTS = ("seconds", "minutes", "hours")


@dataclass(frozen=True)
class Block:
    """What stands between two markers of a page.

    Attributes:
        name: in the marker.
        cost: 'seconds' (continuous integration checks these), 'minutes' or 'hours' of one core.
        write: its text from measurements.
    """

    name: str
    cost: str
    write: Callable[[Measure], str]


@dataclass(frozen=True)
class PaperBlock:
    """The same for runs of the paper's tables and figures, which :mod:`tmc_vem.study.paper` does."""

    name: str
    cost: str
    write: Callable[[Batch], str]


AnyBlock = Block | PaperBlock
