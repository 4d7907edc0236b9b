"""What is controlled during a run: the load, and parameters of the medium while they are continued."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.errors import InputError
from tmc_vem.system.control import Control

Float = NDArray[np.float64]

# How far along a path it is to change a parameter tenfold, in units of the full load.
DECADE = 0.2
CLOSE = 1e-12


class ControlPath:
    """A polyline in the space of the load factor and the logarithms of parameters, run through at unit speed.

    The coordinate along it, called time, is the load factor itself where the load goes from 0 to 1.

    Args:
        corners: two or more points; all have the same parameters.
        stops: load factors that are hit exactly wherever the path passes them.
        kinks: load factors at which what is prescribed changes its direction; those that the path passes are corners of
            it, and nothing is extrapolated across them.

    Raises:
        InputError: there are too few points, two that follow each other are equal, or a value is not usable.
    """

    def __init__(self, corners: Sequence[Control], stops: Sequence[float] = (), kinks: Sequence[float] = ()) -> None:
        if len(corners) < 2:
            raise InputError("a load path needs two load factors or more, for example 0 1 0")
        for corner in corners:
            if not math.isfinite(corner.load) or abs(corner.load) > 1e3:
                raise InputError(f"load factor {corner.load:g} of the load path: use a number from -1000 to 1000")
            for name, value in corner.parameters.items():
                if not (math.isfinite(value) and value > 0.0):
                    raise InputError(f"{name} = {value:g} on the load path must be a positive number")
        self.kinks = tuple(sorted(kinks))
        corners = _with_kinks(corners, self.kinks)
        self.corners = tuple(corners)
        self.names = tuple(corners[0].parameters)
        self._points_wc = np.array([self.vector(corner) for corner in corners])
        lengths = np.linalg.norm(np.diff(self._points_wc, axis=0), axis=1)
        if lengths.min() < CLOSE:
            where = int(lengths.argmin())
            raise InputError(f"the load path stays at load factor {corners[where].load:g}: leave the repetition out")
        self.times = np.concatenate([[0.0], np.cumsum(lengths)])
        self.loads = tuple(stops)  # that are hit exactly
        self.stops = self._stops(stops)

    @property
    def end(self) -> float:
        """Time at the end."""
        return float(self.times[-1])

    def vector(self, control: Control) -> Float:
        """A point as a vector: load factor, then the logarithms of the parameters."""
        return np.array([control.load, *(DECADE * math.log10(control.parameters[name]) for name in self.names)])

    def at(self, time: float) -> Control:
        """Load and parameters at a time; exactly those of a corner at its time."""
        nearest = int(np.abs(self.times - time).argmin())
        if abs(self.times[nearest] - time) <= CLOSE:
            return self.corners[nearest]
        leg = self.leg(time)
        share = (time - self.times[leg]) / (self.times[leg + 1] - self.times[leg])
        point = (1.0 - share) * self._points_wc[leg] + share * self._points_wc[leg + 1]
        if self.corners[leg].parameters == self.corners[leg + 1].parameters:
            parameters = self.corners[leg].parameters
        else:
            parameters = {name: 10.0 ** (x / DECADE) for name, x in zip(self.names, point[1:], strict=True)}
        load = self.corners[leg].load + (time - self.times[leg]) * self._slope(leg)
        return Control(float(load), parameters)

    def stiffened(self, time: float, parameters: Mapping[str, float], factor: float) -> ControlPath | None:
        """The path up to a time, then parameters raised, the rest of the loads, and the parameters brought back.

        Args:
            time: from where on.
            parameters: values to which they are brought back.
            factor: relative to these.

        Returns:
            The new path, the same up to ``time``; None if there are no other loads ahead.
        """
        now = self.at(time)
        done = [corner for corner, at in zip(self.corners, self.times, strict=True) if at < time - CLOSE]
        loads = [now.load]
        for corner, at in zip(self.corners, self.times, strict=True):
            if at > time + CLOSE and corner.load != loads[-1]:
                loads.append(corner.load)
        if len(loads) == 1:
            return None
        before = [Control(corner.load, {**parameters, **corner.parameters}) for corner in (*done, now)]
        stiff = {name: factor * value for name, value in parameters.items()}
        raised = [Control(load, stiff) for load in loads]
        return ControlPath([*before, *raised, Control(loads[-1], dict(parameters))], self.loads, self.kinks)

    def leg(self, time: float) -> int:
        """Number of the leg that starts at or before a time, from 0."""
        return min(int(np.searchsorted(self.times, time + CLOSE, side="right")) - 1, len(self.corners) - 2)

    def next_stop(self, time: float) -> float:
        """Time of the next corner or load that must be hit."""
        return self.stops[min(int(np.searchsorted(self.stops, time + CLOSE, side="right")), len(self.stops) - 1)]

    def is_kink(self, time: float) -> bool:
        """Whether what is prescribed has a kink at a time."""
        load = self.at(time).load
        return any(abs(load - kink) <= CLOSE for kink in self.kinks)

    def is_corner(self, time: float) -> bool:
        """Whether the path may turn at a time."""
        return bool(np.abs(self.times - time).min() <= CLOSE)

    def length_of_leg(self, time: float) -> float:
        """How long the leg is that a time belongs to."""
        leg = self.leg(time)
        return float(self.times[leg + 1] - self.times[leg])

    def start_of_leg(self, time: float) -> float:
        """Time at which the leg began that a time belongs to."""
        return float(self.times[self.leg(time)])

    def _slope(self, leg: int) -> float:
        """Load factor per time; exactly 1 where nothing but the load rises."""
        change = self._points_wc[leg + 1] - self._points_wc[leg]
        return float(change[0] / np.linalg.norm(change)) if change[1:].any() else float(np.sign(change[0]))

    def _stops(self, loads: Sequence[float]) -> list[float]:
        times = set(self.times[1:].tolist())
        for leg, (first, last) in enumerate(zip(self.corners[:-1], self.corners[1:], strict=True)):
            if first.load != last.load:
                low, high = sorted((first.load, last.load))
                times |= {
                    float(self.times[leg] + (load - first.load) / self._slope(leg))
                    for load in loads
                    if low + CLOSE < load < high - CLOSE
                }
        return sorted(times)


def _with_kinks(corners: Sequence[Control], kinks: Sequence[float]) -> list[Control]:
    """The corners, with one more wherever a leg between two of the same parameters passes a kink."""
    found = list(corners[:1])
    for first, last in itertools.pairwise(corners):
        low, high = sorted((first.load, last.load))
        if first.parameters == last.parameters:
            passed = [load for load in kinks if low + CLOSE < load < high - CLOSE]
            found += [Control(load, first.parameters) for load in (passed if first.load < last.load else passed[::-1])]
        found.append(last)
    return found


def load_path(loads: Sequence[float] = (0.0, 1.0), stops: Sequence[float] = ()) -> ControlPath:
    """A path of load factors, the parameters as the problem has them."""
    return ControlPath([Control(float(load)) for load in loads], stops)
