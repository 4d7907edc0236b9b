"""How what is prescribed grows over a run: straight from one time to the next. A run's time is its load factor."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass

from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import check_fields
from tmc_vem.system.constraints import Amplitude
from tmc_vem.system.control import Control

LATEST = 1e3  # of the times of a run


@dataclass(frozen=True)
class History:
    """Amplitude that is given at some times, linear between them and constant before the first and after the last.

    Attributes:
        points: (time, amplitude), two or more, in the order of their times.

    Raises:
        InputError: times do not increase from 0 on, something is not finite, or it is 0 throughout or not 0 at first.
    """

    points: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        check_fields(self)
        for n, (time, amplitude) in enumerate(self.points, start=1):
            if not (math.isfinite(time) and math.isfinite(amplitude)):
                raise InputError(f"history, entry {n}: [{time:g}, {amplitude:g}] must be two finite numbers")
            if not 0.0 <= time <= LATEST:
                raise InputError(f"history, entry {n}: time {time:g} must be from 0 to {LATEST:g}")
        for n, (first, second) in enumerate(zip(self.times[:-1], self.times[1:], strict=True), start=2):
            if second <= first:
                raise InputError(f"history, entry {n}: time {second:g} must be later than {first:g} before it")
        if len(self.points) < 2:
            raise InputError("history has too few entries: give two or more, such as [[0, 0], [1, 1]]")
        if self.points[0][1] != 0.0:
            raise InputError(
                f"history, entry 1: it begins with {self.points[0][1]:g}, but a run begins without loads: begin with "
                f"[{self.points[0][0]:g}, 0]"
            )
        if not any(amplitude for _, amplitude in self.points):
            raise InputError("history is 0 throughout: leave the load out, or let it act")

    @property
    def times(self) -> tuple[float, ...]:
        """The times that are given."""
        return tuple(time for time, _ in self.points)

    def at(self, position: Control) -> float:
        """The amplitude; exactly what is given at a time that is."""
        before = bisect_right(self.times, position.load)
        if before in (0, len(self.points)):
            return self.points[0 if before == 0 else -1][1]
        (start, low), (end, high) = self.points[before - 1 : before + 1]
        return low + (position.load - start) / (end - start) * (high - low)

    def per_load(self, position: Control) -> float:
        """Its derivative with respect to the load factor; at a kink, that of the way to it."""
        for (start, low), (end, high) in zip(self.points[:-1], self.points[1:], strict=True):
            if start < position.load <= end or position.load == start == 0.0:
                return (high - low) / (end - start)
        return 0.0


RAMP = History(((0.0, 0.0), (1.0, 1.0)))


def kinks_of(amplitudes: Iterable[Amplitude]) -> tuple[float, ...]:
    """Times after 0 at which any of the amplitudes has a kink, in order; nothing where no one has a history."""
    times = {time for amplitude in amplitudes if isinstance(amplitude, History) for time in amplitude.times}
    return tuple(sorted(times - {0.0}))
