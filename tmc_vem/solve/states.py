"""The last converged states, and what they say about the next one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.distributed import Vec
from tmc_vem.system.point_values import PointValues

Float = NDArray[np.float64]

# Cubic extrapolation from four states; docs/solver.md compares it with lower and higher orders.
ORDER = 3
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


class States:
    """Converged states with the point of the control path that each belongs to, the last one at the end.

    Args:
        vector: any vector of the system, to make others like it.
        kept: how many states are remembered.

    Attributes:
        beginning: of the step that has led to the last state, in problems with friction; None without, and at first.
    """

    beginning: Beginning | None = None

    def __init__(self, vector: Vec, kept: int = ORDER + 1) -> None:
        self._like, self._kept = vector, kept
        self.controls: list[Float] = []
        self.vectors: list[Vec] = []

    def __len__(self) -> int:
        return len(self.vectors)

    def append(self, control: Float, u: Vec) -> None:
        """Add a copy of a state; the oldest is forgotten when there are too many."""
        vector = self.vectors.pop(0) if len(self.vectors) == self._kept else self._like.duplicate()
        del self.controls[: len(self.controls) - len(self.vectors)]
        u.copy(vector)
        self.controls.append(np.array(control, dtype=float))
        self.vectors.append(vector)

    def forget(self) -> None:
        """Keep the last state only: the branch that the others belong to has ended."""
        for vector in self.vectors[:-1]:
            vector.destroy()
        self.controls, self.vectors = self.controls[-1:], self.vectors[-1:]

    def restart(self, control: Float) -> None:
        """Keep the last state only, at another point of control: the path is another one."""
        self.forget()
        self.controls = [np.array(control, dtype=float)]

    def orders(self, control: Float) -> Sequence[int]:
        """Orders of extrapolation that are possible to a point, the highest first."""
        return range(len(self._along(control)[0]) - 1, 0, -1)

    def extrapolate(self, control: Float, order: int, out: Vec) -> None:
        """Polynomial through the last ``order + 1`` states, at another point, into ``out`` (Lagrange's formula)."""
        x, x_wanted = self._along(control)
        x = x[-(order + 1) :]
        out.set(0.0)
        for i, vector in enumerate(self.vectors[-(order + 1) :]):
            others = np.delete(x, i)
            out.axpy(float(np.prod((x_wanted - others) / (x[i] - others))), vector)

    def _along(self, control: Float) -> tuple[Float, float]:
        """Coordinates along the line from the last state's point to another, of the states on that line, and of it.

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
        return np.array(x[::-1]), distance
