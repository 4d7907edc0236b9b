"""What a discretisation says of forces that knows of none."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.distributed import Vec
from tmc_vem.support.errors import InputError
from tmc_vem.system.control import Control
from tmc_vem.system.friction import FrictionStates
from tmc_vem.system.layout import DISPLACEMENT
from tmc_vem.system.turned import Turned

Float = NDArray[np.float64]


class Unloaded:
    """Base of discretisations: :class:`tmc_vem.system.loaded.LoadedSystem` adds forces to any of them."""

    def set_position(self, position: Control) -> None:
        """Nothing here depends on the position on the path."""

    def add_residual_per_load(self, u: Vec, position: Control, out: Vec) -> None:
        """Nothing here depends on the position on the path."""

    def external_forces(self, u: Vec) -> Float:
        """Nothing acts on the nodes."""
        return np.zeros_like(DISPLACEMENT.nodal(u.getArray(readonly=True)))

    def measures(self, u: Vec, position: Control) -> dict[str, dict[str, float]]:
        """Nothing: there are no forces."""
        return {}

    def holding_forces(self, residual: Vec) -> Float:
        """This rank's part of the residual, in which nothing else holds."""
        return residual.getArray(readonly=True).copy()

    def accept(self, u: Vec, residual: Vec, position: Control) -> None:
        """Nothing here depends on the states that were reached."""

    def memory(self) -> tuple[int, list[Float]]:
        """Nothing is kept of them."""
        return 0, []

    def remember(self, stage: int, kept: Sequence[Float]) -> None:
        """Nothing is kept of them."""

    def friction_states(self, u: Vec) -> Iterator[FrictionStates]:
        """Nothing: there is no friction."""
        return iter(())

    def advance(self, u: Vec) -> None:
        """Nothing here depends on the states that were reached."""

    def damp_slip(self, fraction: float) -> bool:
        """Nothing: there is no friction."""
        return False

    def shear(self, u: Vec) -> tuple[Float, Float]:
        """Nothing: there is no friction."""
        return np.empty((0, 2)), np.empty(0)

    def remember_shear(self, u: Vec, shear_at: Callable[[Float], Float]) -> None:
        """Nothing: there is no friction."""

    def turned(self) -> Turned:
        """None: the degrees of freedom of all nodes are displacements along x and y."""
        return Turned()


def require_regions(wanted: Iterable[str], known: Sequence[str]) -> None:
    """Check that regions are there.

    Raises:
        InputError: one is not.
    """
    for name in wanted:
        if name not in known:
            raise InputError(f"the mesh has no region '{name}' (it has: {', '.join(known)})")
