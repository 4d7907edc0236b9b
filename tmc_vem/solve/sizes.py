"""Sizes of steps along a path: equal ones, or automatic ones that go by what the last one took."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tmc_vem.solve.path import ControlPath

if TYPE_CHECKING:
    from tmc_vem.solve.stepping import SteppingOptions

DONE = 1e-12


@dataclass(frozen=True)
class StepSizes:
    """How long the steps along a path are.

    Attributes:
        options: of the stepping.
        path: that is gone along.
    """

    options: SteppingOptions
    path: ControlPath

    def first(self, time: float) -> float:
        """Size of the first step, from a time on."""
        return self._equal(time) if self.options.steps else self.options.first

    def target(self, time: float, size: float) -> float:
        """Time that a step of a size leads to, cut where something must be hit."""
        stop = self.path.next_stop(time)
        if self.options.steps:  # the next equal step's end, unless the step was cut
            start, equal = self.path.start_of_leg(time), self._equal(time)
            number = int((time - start) / equal + 1e-9) + 1
            following = min(stop, start + number * equal if number < self.options.steps else stop)
            return following if time + size > following - DONE else time + size
        if time + size > stop - 0.3 * size:  # no sliver of a last step
            return stop
        return time + size

    def following(self, size: float, taken: float, target: float, iterations: int, was_cut: bool) -> float:
        """Size of the step after one.

        Args:
            size: that the step was made for.
            taken: its length, which may be another so that something was hit.
            target: time that it has led to.
            iterations: that it took.
            was_cut: whether a longer one had failed.
        """
        options = self.options
        if options.steps:
            return taken if was_cut else self._equal(target)
        wanted = options.target_iterations
        factor = options.growth if iterations < wanted else max(0.5, wanted / iterations)
        if was_cut:
            factor = min(factor, 1.0)
        if taken < (1.0 - 1e-6) * size and iterations <= wanted:  # short only because something had to be hit
            return size
        return min(options.largest, taken * factor)

    def _equal(self, time: float) -> float:
        assert self.options.steps
        leg = self.path.leg(time)
        return float(self.path.times[leg + 1] - self.path.times[leg]) / self.options.steps
