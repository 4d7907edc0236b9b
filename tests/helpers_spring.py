"""A system of two unknowns, one of them prescribed, for tests of the solver that know its numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from helpers_pair import Pair

from tmc_vem.support.petsc import PETSc
from tmc_vem.system.discretisation import Evaluation, RegionValues

Of = Callable[[float, float], Any]


class Spring(Pair):
    """Energy of a free unknown x and a prescribed one d; by default k/2 (d - x)^2 + c/2 x^2 with c = k = 1."""

    worst = "J = 1 in cell 0"

    def __init__(self, energy: Of | None = None, gradient: Of | None = None, hessian: Of | None = None) -> None:
        self.of = energy or (lambda x, d: 0.5 * (d - x) ** 2 + 0.5 * x**2)
        self.gradient = gradient or (lambda x, d: (2 * x - d, d - x))
        self.hessian = hessian or (lambda x, d: (2.0, -1.0, 1.0))
        self.tangents = self.evaluations = 0
        self.parameters: list[dict[str, float]] = []

    def set_parameters(self, values: Mapping[str, float]) -> None:
        self.parameters.append(dict(values))

    def energy(self, u: Any) -> Evaluation:
        energy = self.of(*u.getArray(readonly=True).tolist())
        return Evaluation(energy, {"spring": RegionValues(energy, 1.0)}, self.worst)

    def residual(self, u: Any, out: Any) -> Evaluation:
        self.evaluations += 1
        out.getArray()[:] = self.gradient(*u.getArray(readonly=True).tolist())
        return self.energy(u)

    def jacobian(self, u: Any, out: Any) -> None:
        self.tangents += 1
        free, mixed, held = self.hessian(*u.getArray(readonly=True).tolist())
        self._K = np.array([[free, mixed], [mixed, held]])
        out.zeroEntries()
        for i, j, value in ((0, 0, free), (0, 1, 0.0), (1, 0, 0.0), (1, 1, 1.0)):
            out.setValue(i, j, value)
        out.assemble()

    def tangent_action(self, du: Any, out: Any) -> None:
        out.getArray()[:] = self._K @ du.getArray(readonly=True)


def at(x: float, d: float) -> Any:
    return PETSc.Vec().createWithArray(np.array([x, d]))


class Refusal:
    def sentence(self) -> str:
        return "bodies overlap"

    def advice(self) -> str:
        return "Use more medium"


class Admission:
    """Refuses states above a place, and jumps farther than another."""

    def __init__(self, most: float, farthest: float = math.inf) -> None:
        self.most, self.farthest = most, farthest

    def refusal(self, u: Any, evaluation: Evaluation) -> Refusal | None:
        return Refusal() if u.getArray()[0] > self.most else None

    def refusal_of_jump(self, before: Any, after: Any) -> Refusal | None:
        return Refusal() if (after - before).getArray()[0] > self.farthest else None
