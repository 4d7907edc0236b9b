"""The last converged states, and what they say about the next one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.distributed import Vec
from tmc_vem.system.point_values import PointValues

Float = NDArray[np.float64]
Int = NDArray[np.int64]

# Highest order of extrapolation: through three states and along their slopes. Where slopes are not known it is a cubic
# through four states. docs/solver.md compares them with lower and higher orders.
ORDER = 5
KEPT, SLOPES_KEPT = 4, 3
ON_LINE = 1e-9


@dataclass(frozen=True)
class Beginning:
    """Where a step with friction began.

    Attributes:
        u: the converged state.
        shear: that this rank's points with friction had reached there.
    """

    u: Vec
    shear: PointValues


@dataclass(frozen=True)
class Slope:
    """How a state changes along the control path.

    Attributes:
        direction: of the path at the state, a unit vector.
        rate: change of the state per length of the path in that direction.
    """

    direction: Float
    rate: Vec


class States:
    """Converged states with the point of the control path that each belongs to, the last one at the end.

    Args:
        vector: any vector of the system, to make others like it.
        kept: how many states are remembered.

    Attributes:
        controls, vectors: the points, and the states there.
        slopes: of the states, where they are known.
        beginning: of the step that has led to the last state, in problems with friction; None without, and at first.
    """

    beginning: Beginning | None = None

    def __init__(self, vector: Vec, kept: int = KEPT) -> None:
        self._like, self._kept = vector, kept
        self.controls: list[Float] = []
        self.vectors: list[Vec] = []
        self.slopes: list[Slope | None] = []

    def __len__(self) -> int:
        return len(self.vectors)

    def append(self, control: Float, u: Vec, slope: Slope | None = None) -> None:
        """Add a copy of a state; the oldest is forgotten when there are too many.

        Args:
            control: the point of the path.
            u: the state.
            slope: of it; its vector belongs to the states from now on.
        """
        vector = self.vectors.pop(0) if len(self.vectors) == self._kept else self._like.duplicate()
        forgotten = len(self.controls) - len(self.vectors)
        self._forget_slopes(forgotten)
        del self.controls[:forgotten], self.slopes[:forgotten]
        u.copy(vector)
        self.controls.append(np.array(control, dtype=float))
        self.vectors.append(vector)
        self.slopes.append(slope)
        self._forget_slopes(len(self.slopes) - SLOPES_KEPT)

    def forget(self) -> None:
        """Keep the last state only, without its slope: the branch that the others belong to has ended."""
        for vector in self.vectors[:-1]:
            vector.destroy()
        self._forget_slopes(len(self.slopes))
        self.controls, self.vectors, self.slopes = self.controls[-1:], self.vectors[-1:], self.slopes[-1:]

    def restart(self, control: Float) -> None:
        """Keep the last state only, at another point of control: the path is another one."""
        self.forget()
        self.controls = [np.array(control, dtype=float)]

    def orders(self, control: Float, *, slopes: bool = True) -> Sequence[int]:
        """Orders of extrapolation that are possible to a point, the highest first.

        Args:
            control: the point.
            slopes: whether it goes along slopes, where they are known, or through states alone.
        """
        return [order for order, _ in self._choices(control, slopes)]

    def extrapolate(self, control: Float, order: int, out: Vec, *, slopes: bool = True) -> None:
        """Polynomial through the last states, and along their slopes where they are known, at another point into
        ``out`` (Hermite's formula; without slopes it is Lagrange's). Arguments are those of :meth:`orders`."""
        known = dict(self._choices(control, slopes))[order]
        n, (x, signs, x_wanted) = len(known), self._along(control)
        of_values, of_slopes = hermite_weights(x[-n:], known, x_wanted)
        out.set(0.0)
        for i in range(n):
            out.axpy(of_values[i], self.vectors[i - n])
            slope = self.slopes[i - n]
            if known[i] == 2 and slope is not None:
                out.axpy(of_slopes[i] * signs[i - n], slope.rate)

    def knows_slope(self, control: Float) -> bool:
        """Whether the last state's slope towards a point is known."""
        return bool(self._along(control)[1][-1])

    def _choices(self, control: Float, slopes: bool) -> list[tuple[int, Int]]:
        """Orders of extrapolation to a point, the highest first, each with what it takes of the last states: 1 for
        the state, 2 for its slope as well."""
        signs = self._along(control)[1]
        known = 1 + (np.abs(signs) if slopes else 0 * signs)
        orders = [(int(known[-n:].sum()) - 1, known[-n:]) for n in range(len(known), 0, -1)]
        return [(order, some) for order, some in orders if 1 <= order <= ORDER]

    def _forget_slopes(self, n: int) -> None:
        """Forget the first n slopes."""
        for i in range(n):
            slope, self.slopes[i] = self.slopes[i], None
            if slope is not None:
                slope.rate.destroy()

    def _along(self, control: Float) -> tuple[Float, Int, float]:
        """The line from the last state's point to another: coordinates of the states on it, the sign with which the
        slope of each counts along it, 0 where none is known, and the other point's coordinate.

        States count as long as they go on in one direction: after a reversal of the load, the states before it lie
        ahead, and those after it behind.
        """
        now = self.controls[-1]
        distance = float(np.linalg.norm(control - now))
        direction = (control - now) / distance
        x = [0.0]
        for point in reversed(self.controls[:-1]):
            along = float((point - now) @ direction)
            off = np.linalg.norm(point - now - along * direction)
            turned = len(x) > 1 and (along - x[-1]) * (x[-1] - x[-2]) <= 0.0
            if off > ON_LINE or turned or abs(along - x[-1]) <= ON_LINE:
                break
            x.append(along)
        signs = [_sign(slope, direction) for slope in self.slopes[-len(x) :]]
        return np.array(x[::-1]), np.array(signs, dtype=np.int64), distance


def _sign(slope: Slope | None, direction: Float) -> int:
    """1 for a slope in a direction, -1 for one against it, 0 for none."""
    if slope is None:
        return 0
    along = float(slope.direction @ direction)
    off = float(np.linalg.norm(slope.direction - along * direction))
    return round(math.copysign(1.0, along)) if off <= ON_LINE else 0


def hermite_weights(x: Float, known: Int, x_wanted: float) -> tuple[Float, Float]:
    """Weights with which values and slopes at points give the value of their polynomial at another point.

    Args:
        x: (n,) coordinates of the points.
        known: (n,) 1 where the value is known, 2 where the slope is as well.
        x_wanted: coordinate of the other point.

    Returns:
        (n,) weights of the values, and (n,) of the slopes, 0 where none is known.
    """
    of_values, of_slopes = np.empty(len(x)), np.zeros(len(x))
    for i, way in enumerate(x_wanted - x):
        others = np.arange(len(x)) != i
        apart = x[i] - x[others]
        of_values[i] = np.prod(((x_wanted - x[others]) / apart) ** known[others])
        if known[i] == 2:
            of_slopes[i] = way * of_values[i]
            of_values[i] *= 1.0 - way * float(np.sum(known[others] / apart))
    return of_values, of_slopes
