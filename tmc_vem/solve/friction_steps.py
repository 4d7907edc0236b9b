"""Load steps with friction: where each of them begins, and how long it may be.

Friction remembers the way, so that states of another way say nothing about it: nothing is extrapolated across a corner
of the path, and a step that is given up is undone. A step's friction goes by its beginning and is behind at its end, in
the first order of what happens meanwhile (:mod:`tmc_vem.system.friction_lag`). Steps in which it is too far behind are
shortened.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tmc_vem.solve.states import Beginning, States
from tmc_vem.support.distributed import Vec
from tmc_vem.system.discretisation import Discretisation
from tmc_vem.system.friction_lag import Lag, lag
from tmc_vem.system.friction_settings import FRICTION_ERROR
from tmc_vem.system.point_values import PointValues

# The shortest step that is cut because of friction, relative to the tolerated error. Where contact begins there is no
# friction yet to compare with; a load that grows evenly has steps as long as the error later on.
SHORTEST = 0.1
SMALLEST = 4e-5  # nor is any shorter than this cut for it; Newton's method may still halve it
STRETCHED = 1.3  # by how much a step is at most longer than it was made, so that no sliver is left before a stop
AIM = 0.8  # part of the tolerated error that the next step is made for
LEAST, MOST = 0.1, 0.5  # by how much a step is cut
ROUNDING = 1e-6
# Iterations of Newton's method go with the number of points that begin to slip or to stick, in short steps as in long
# ones: steps that shrink with them shrink to nothing. So they shrink above this number, and are given up at the other.
TARGET_ITERATIONS, MOST_ITERATIONS = 40, 60
# Where the medium slides, rates wander within what its points can do without sticking. Higher orders of extrapolation
# magnify that, and points stick that have to slide: twice the iterations, and steps fail.
EXTRAPOLATION = 1


@dataclass(frozen=True)
class FrictionRecord:
    """How far friction has been behind so far.

    Attributes:
        carried: the largest friction that could be carried in any step, see :class:`tmc_vem.system.friction_lag.Lag`.
        behind: the largest that it was behind in any step, in the same unit.
        load: load factor at the end of that step.
    """

    carried: float = 0.0
    behind: float = 0.0
    load: float = 0.0

    @property
    def error(self) -> float:
        """Largest part of the largest friction by which it was behind in a step; 0 without contact."""
        return self.behind / self.carried if self.carried > 0.0 else 0.0

    def checks(self) -> dict[str, dict[str, float]]:
        """What a result says about it; nothing without contact."""
        return {"friction_error": {"largest": self.error, "load": self.load}} if self.carried > 0.0 else {}

    def with_step(self, step: Lag, load: float) -> FrictionRecord:
        """After another step, up to a load factor."""
        carried = max(self.carried, step.carried)
        if step.behind > self.behind:
            return FrictionRecord(carried, step.behind, load)
        return replace(self, carried=carried)


@dataclass(frozen=True)
class FrictionSteps:
    """What the load stepper asks about friction.

    Attributes:
        system: that has it; None without friction, of which there is nothing to be said then.
        error: tolerated in a step, relative to the largest friction so far.
    """

    system: Discretisation | None = None
    error: float = FRICTION_ERROR

    @property
    def is_there(self) -> bool:
        """Whether there is some."""
        return self.system is not None

    def begin(self, u: Vec) -> Beginning | None:
        """A step begins at a converged state."""
        if self.system is None:
            return None
        beginning = Beginning(u.copy(), PointValues(*self.system.shear(u)))
        self.system.advance(u)
        return beginning

    def go_back(self, begun: Beginning | None, states: States) -> None:
        """The step that has begun does not converge: take up again the one before, if there was one."""
        if self.system is not None and begun is not None and states.beginning is not None:
            self.system.remember_shear(states.beginning.u, states.beginning.shear.at)

    def lag(self, begun: Beginning | None, u: Vec) -> Lag:
        """How far friction is behind where the step that has begun converges to ``u``, equal on all ranks."""
        if self.system is None or begun is None:
            return Lag()
        mine = lag(self.system.friction_states(begun.u), self.system.friction_states(u))
        behind, carried = np.sum(self.system.comm.allgather((mine.behind, mine.carried)), axis=0).tolist()
        return Lag(behind, carried)

    def ratio(self, step: Lag, before: FrictionRecord) -> float:
        """What a step's error is, in units of the tolerated one."""
        largest = max(step.carried, before.carried)
        return step.behind / (self.error * largest) if largest > 0.0 else 0.0

    def shortened(self, ratio: float, taken: float, leg: float) -> float | None:
        """Size of a step instead of one that was too long for friction, on a leg of the path; None if it was not."""
        shortest = self._shortest(leg)
        if ratio <= 1.0 or taken <= STRETCHED * shortest * (1.0 + ROUNDING):
            return None
        return max(taken * min(max(AIM / ratio, LEAST), MOST), shortest)

    def largest_next(self, ratio: float, taken: float, leg: float) -> float:
        """The largest step after one with this error, on a leg of the path."""
        return max(taken * AIM / ratio, self._shortest(leg)) if ratio > 0.0 else np.inf

    def _shortest(self, leg: float) -> float:
        """Step that is not cut any more because of friction, on a leg of this length."""
        return max(SHORTEST * self.error, SMALLEST) * min(leg, 1.0)
