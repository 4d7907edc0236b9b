"""Two degrees of freedom: a shallow truss that snaps through, and a stop that gives way, with known curves."""

from __future__ import annotations

from typing import Any

import numpy as np
from helpers_pair import Pair
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from tmc_vem.system.discretisation import Evaluation, RegionValues

Float = NDArray[np.float64]


class Truss(Pair):
    """A shallow truss of two bars, rise 1, pushed at its top through a spring; degrees of freedom: top, spring's end.

    Energy a/2 (v^2/2 - v)^2 + k/2 (d - v)^2; equilibrium a (v^2/2 - v) (v - 1) = k (d - v), d prescribed.
    """

    a, k, depth = 1.0, 0.2, 3.0

    def __init__(self) -> None:
        self._K = np.zeros((2, 2))

    def bars(self, v: Any) -> tuple[Any, Any, Any]:
        """Energy, force and stiffness of the bars."""
        g, dg = v**2 / 2 - v, v - 1
        return self.a / 2 * g**2, self.a * g * dg, self.a * (dg**2 + g)

    def energy(self, u: Any) -> Evaluation:
        v, d = u.getArray(readonly=True)
        energy = float(self.bars(v)[0]) + self.k / 2 * (d - v) ** 2
        return Evaluation(energy, {"truss": RegionValues(energy, 1.0)}, "J = 1")

    def residual(self, u: Any, out: Any) -> Evaluation:
        v, d = u.getArray(readonly=True)
        out.getArray()[:] = [self.bars(v)[1] - self.k * (d - v), self.k * (d - v)]
        return self.energy(u)

    def jacobian(self, u: Any, out: Any) -> None:
        v, _ = u.getArray(readonly=True)
        stiffness = float(self.bars(v)[2]) + self.k
        self._K = np.array([[stiffness, -self.k], [-self.k, self.k]])
        for i, row in enumerate([[stiffness, 0.0], [0.0, 1.0]]):
            for j, value in enumerate(row):
                out.setValue(i, j, value)
        out.assemble()

    def tangent_action(self, du: Any, out: Any) -> None:
        out.getArray()[:] = self._K @ du.getArray(readonly=True)

    def reaction(self, residual: Any, where: str, component: int) -> float:
        return float(residual.getArray(readonly=True)[1])

    def load_at(self, v: Float) -> Float:
        """Load factor in equilibrium with the top moved by v."""
        found: Float = (v + self.bars(v)[1] / self.k) / self.depth
        return found


class Stop(Truss):
    """A stop in place of the bars that gives way between v = 1 and 2, where dd/dv is the slope.

    It is 1 elsewhere, so the stop's force k (d(v) - v) is 0 before, falls, and stays; no limit point.
    """

    k, slope, ends = 1.0, 0.1, 0.1

    def __init__(self) -> None:
        super().__init__()
        at = [-9.0, 1.0 - self.ends, 1.0 + self.ends, 2.0 - self.ends, 2.0 + self.ends, 9.0]
        stiffness = np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0]) * self.k * (self.slope - 1.0)
        self._stiffness = PchipInterpolator(at, stiffness)
        self._force = self._stiffness.antiderivative()
        self._energy = self._force.antiderivative()

    def bars(self, v: Any) -> tuple[Any, Any, Any]:
        """Energy, force and stiffness of the stop."""
        return self._energy(v), self._force(v), self._stiffness(v)
