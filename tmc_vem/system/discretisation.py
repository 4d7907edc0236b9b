"""What a discretisation offers to the solver, and nothing more: VEM and FEM look the same from here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]


@dataclass(frozen=True)
class RegionValues:
    """Integral and extreme values of one region."""

    energy: float
    min_j: float


@dataclass(frozen=True)
class Evaluation:
    """Result of evaluating the potential at a state; equal on all ranks.

    Attributes:
        energy: potential energy of all regions.
        regions: values by region name.
        worst: the smallest J and where it is, in words, for messages.
    """

    energy: float
    regions: Mapping[str, RegionValues]
    worst: str = ""

    @property
    def min_j(self) -> float:
        """Smallest J at any quadrature point."""
        return min(values.min_j for values in self.regions.values())

    @property
    def admissible(self) -> bool:
        """Whether J > 0 at every quadrature point (False also for a value that is not a number)."""
        return all(values.min_j > 0.0 for values in self.regions.values())


class Admission(Protocol):
    """Says of converged states whether they are states of the problem that was posed; called by all ranks together."""

    def refusal(self, u: Any, evaluation: Evaluation) -> str:
        """Why a converged state is none, in words, or nothing."""

    def refusal_of_jump(self, before: Any, after: Any) -> str:
        """Why a converged state on another branch cannot be reached from the state before, or nothing."""

    def complaint(self) -> tuple[str, str] | None:
        """The last refusal since a state was taken, and what to do about it; None if nothing was refused since."""


class NonlinearSystem(Protocol):
    """A discretised potential with prescribed displacements that are proportional to the load factor.

    Vectors and matrices are PETSc objects, distributed over the ranks of ``comm``. ``residual`` is the full gradient of
    the potential, so its entries at constrained degrees of freedom are the reactions.
    """

    comm: Any
    size: float

    def create_vector(self) -> Any:
        """A new global vector of displacement degrees of freedom, zero."""

    def create_matrix(self) -> Any:
        """A new preallocated matrix for the tangent."""

    def constrained(self) -> NDArray[np.int32]:
        """Constrained degrees of freedom that this rank owns, as positions in the rank's part of a vector."""

    def set_parameters(self, values: Mapping[str, float]) -> None:
        """Change parameters, by name, in every energy that has them."""

    def prescribed(self, load: float) -> Float:
        """Their values at a load factor, parallel to :meth:`constrained`."""

    def residual(self, u: Any, out: Any) -> Evaluation:
        """Gradient of the potential at ``u`` into ``out``, constrained entries included."""

    def energy(self, u: Any) -> Evaluation:
        """Potential at ``u`` alone."""

    def jacobian(self, u: Any, out: Any) -> None:
        """Tangent at ``u``; constrained rows and columns are those of the identity."""

    def tangent_action(self, du: Any, out: Any) -> None:
        """Product of the last tangent, constrained rows and columns included, with ``du``."""

    def max_step(self, u: Any, du: Any) -> float:
        """Largest s with J(u + t du) > 0 at every quadrature point for all t < s; exact in two dimensions."""

    def point_displacements(self, u: Any, names: Sequence[str]) -> Float:
        """Displacements (n, 2) of named points, equal on all ranks."""

    def reaction(self, residual: Any, where: str, component: int) -> float:
        """Sum of the residual's entries at a named point or edge set, equal on all ranks."""
