"""A homogeneous layer of medium with friction, F = [[1, k], [0, l]], taken along a path of its own: numpy alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from codegen.stress import stress_of
from tmc_vem.problems.base import medium_region
from tmc_vem.problems.materials import Medium
from tmc_vem.system.friction import FrictionLaw, FrictionStates, SlipSystem
from tmc_vem.system.friction_lag import Lag, lag
from tmc_vem.system.point_states import PointStates

Float = NDArray[np.float64]

REGION = medium_region(Medium(gamma=1.0, friction=0.3, regulariser="huhu", beta=0.0), 1.0)


def sheared(k: float, stretch: float) -> Float:
    """Deformation gradient of a layer that is squeezed and slips."""
    return np.array([[1.0, k], [0.0, stretch]])


class Layer:
    """One point with the given weight; each step gives the stress and how far friction is behind."""

    def __init__(self, weight: float = 1.0) -> None:
        assert REGION.friction is not None
        self.law = FrictionLaw(REGION.friction, stress_of(REGION.integrand))
        self.weight, self.F = weight, np.eye(2)
        self.slip: SlipSystem = self.law.slip_system(self.F[None, None], REGION.values, np.zeros((1, 1)))

    def states(self, F: Float) -> FrictionStates:
        """At a deformation gradient, in the step that has begun."""
        w, X = np.full((1, 1), self.weight), np.zeros((1, 1, 2))
        points = PointStates("medium", np.zeros(1, np.int64), w, X, F[None, None], None, REGION.values)
        return FrictionStates(points, self.slip, self.slip.response(F[None, None]), self.law)

    def lag(self, F: Float) -> Lag:
        """How far friction is behind if the step ends there."""
        return lag([self.states(self.F)], [self.states(F)])

    def step(self, F: Float) -> tuple[Float, Lag]:
        """Nominal stress (2, 2) at the end of a step, and how far friction is behind; the next one begins there."""
        end, behind = self.states(F), self.lag(F)
        medium = self.law.stress.at(F[None, None], np.zeros((1, 1, 2, 2, 2)), REGION.values)[0][0, 0]
        stress: Float = medium + end.response.tau[0, 0] * self.slip.A_ij[0, 0]
        self.slip = self.law.slip_system(F[None, None], REGION.values, end.response.tau)
        self.F = F
        return stress, behind
