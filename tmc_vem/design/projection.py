"""Projection of filtered densities towards 0 and 1, and how it is made steeper while a design settles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import require_positive, require_within

Float = NDArray[np.float64]

LARGEST_BETA = 1e4  # steeper than any mesh can show; tanh is 1 to the last bit long before


@dataclass(frozen=True)
class Projection:
    """Smoothed Heaviside function (Wang, Lazarov & Sigmund, Struct. Multidisc. Optim. 43 (2011) 767, eq. 9).

    x = (tanh(beta eta) + tanh(beta (y - eta))) / (tanh(beta eta) + tanh(beta (1 - eta))), which maps 0 to 0 and 1 to 1,
    and is the identity in the limit of small beta.

    Attributes:
        beta: steepness, positive.
        eta: threshold, 0 to 1. Above 1/2 the design is eroded, below it is dilated.

    Raises:
        InputError: a parameter is out of range.
    """

    beta: float = 1.0
    eta: float = 0.5

    def __post_init__(self) -> None:
        require_positive("beta of the projection", self.beta, "1 is nearly the identity, 64 nearly a step")
        require_within("beta of the projection", self.beta, 0.0, LARGEST_BETA)
        require_within("threshold eta of the projection", self.eta, 0.0, 1.0)

    def value(self, y_c: Float) -> Float:
        """Projected densities (n_cells,) of filtered ones (n_cells,)."""
        at_zero = np.tanh(self.beta * self.eta)
        return np.asarray((at_zero + np.tanh(self.beta * (y_c - self.eta))) / self._range(), dtype=np.float64)

    def slope(self, y_c: Float) -> Float:
        """dx/dy (n_cells,): beta (1 - tanh^2(beta (y - eta))) over the same denominator."""
        tanh = np.tanh(self.beta * (y_c - self.eta))
        return np.asarray(self.beta * (1.0 - tanh) * (1.0 + tanh) / self._range(), dtype=np.float64)

    def _range(self) -> float:
        return float(np.tanh(self.beta * self.eta) + np.tanh(self.beta * (1.0 - self.eta)))


@dataclass(frozen=True)
class Continuation:
    """beta in levels, each ``factor`` times the one before; a level ends after some iterations or when little changes.

    Attributes:
        first, largest: beta at the beginning and at the end. The last level is ``largest`` whatever the factor.
        factor: between levels, above 1.
        every: most iterations on a level but the last.
        change: a level ends before that when no variable changes by more in an iteration.
        eta: threshold of all levels.

    Raises:
        InputError: a parameter is out of range.
    """

    first: float = 1.0
    largest: float = 64.0
    factor: float = 2.0
    every: int = 40
    change: float = 0.01
    eta: float = 0.5

    def __post_init__(self) -> None:
        Projection(self.first, self.eta)
        Projection(self.largest, self.eta)
        if self.largest < self.first:
            raise InputError(
                f"beta begins with {self.first:g} and ends with {self.largest:g}: it grows; give a larger end"
            )
        require_within("factor of beta", self.factor, 1.05, 100.0, "2 doubles it")
        if isinstance(self.every, bool) or not isinstance(self.every, int) or self.every < 1:
            raise InputError(f"every = {self.every!r} iterations for a level of beta: use a whole number from 1 on")
        require_within("change that ends a level of beta", self.change, 0.0, 1.0)

    def levels(self) -> tuple[Projection, ...]:
        """The projections, one after the other."""
        betas = [self.first]
        while betas[-1] < self.largest:
            betas.append(min(self.factor * betas[-1], self.largest))
        return tuple(Projection(beta, self.eta) for beta in betas)

    def ended(self, iterations: int, change: float) -> bool:
        """Whether a level is over after ``iterations`` on it, the last of which changed a variable by ``change``."""
        return iterations >= self.every or change < self.change
