"""Friction of virtual elements: the slip systems of a load step at the quadrature points, where kernels read them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.distributed import Vec
from tmc_vem.system.friction import FrictionLaw, FrictionStates, SlipSystem, shear_of
from tmc_vem.system.unloaded import Unloaded
from tmc_vem.vem.blocks import Block, RegionKernel
from tmc_vem.vem.kernel.friction_packs import FrictionPacks
from tmc_vem.vem.point_states import point_states

Float = NDArray[np.float64]


@dataclass(frozen=True)
class BlockFriction:
    """Friction of one block.

    Attributes:
        block: whose batch has room for it.
        law: of its region.
        mesh: of this rank.
        normal_cqi: (n_cells, n_points, 2) normals of contact at the beginning of the step.
    """

    block: Block
    law: FrictionLaw
    mesh: PolygonMesh
    normal_cqi: Float

    def states(self, u_ni: Float) -> Iterator[FrictionStates]:
        """Points at displacements (n_nodes, 2) of the nodes, as many cells at a time as of stresses."""
        found = point_states([self.block], self.mesh, u_ni)
        for chosen, points in zip(self.block.chunks(), found, strict=True):
            slip = SlipSystem.of_entries(self.packs.cells(chosen), self.normal_cqi[chosen])
            yield FrictionStates(points, slip, slip.response(points.F_cqij), self.law)

    def begin_step(self, u_ni: Float, shear_at: Callable[[Float], Float] | None = None) -> None:
        """Freeze the slip systems of the step that begins at displacements of the nodes.

        Args:
            u_ni: (n_nodes, 2).
            shear_at: gives the shear (n,) reached there at points (n, 2) of the reference configuration; what the step
                before has led to by default.
        """
        for chosen, states in zip(self.block.chunks(), self.states(u_ni), strict=True):
            slip = states.next_slip(shear_at)
            self.packs.set_cells(chosen, slip.entries())
            self.normal_cqi[chosen] = slip.n_i

    @property
    def packs(self) -> FrictionPacks:
        """What kernels read."""
        packs = self.block.batch.friction
        assert packs is not None  # blocks without have no object of this class
        return packs


def friction_of(blocks: Iterable[Block], kernels: Mapping[str, RegionKernel], mesh: PolygonMesh) -> list[BlockFriction]:
    """Friction of the blocks whose regions have some; there is none yet in the undeformed state."""
    found = []
    for block in blocks:
        law = kernels[block.region].friction
        if law is not None:
            found.append(BlockFriction(block, law, mesh, np.zeros((len(block.cells), block.batch.n_points, 2))))
    return found


class WithFriction(Unloaded):
    """What a system of blocks says of friction."""

    _friction: Sequence[BlockFriction]
    _has_friction: bool  # of any rank

    def _local_values(self, u: Vec) -> Float:
        raise NotImplementedError

    def friction_states(self, u: Vec) -> Iterator[FrictionStates]:
        """This rank's cells with friction at their quadrature points, some at a time."""
        u_nodes = self._local_values(u).copy()
        return (states for friction in self._friction for states in friction.states(u_nodes))

    def advance(self, u: Vec) -> None:
        """Friction of the step that begins at ``u``."""
        u_nodes = self._local_values(u)
        for friction in self._friction:
            friction.begin_step(u_nodes)

    def damp_slip(self, fraction: float) -> bool:
        """Tangents have this fraction of the stiffness of sticking points where points slip."""
        for friction in self._friction:
            friction.packs.damping[:] = fraction
        return self._has_friction

    def shear(self, u: Vec) -> tuple[Float, Float]:
        """Points (n, 2) with friction of this rank, and the shear (n,) there."""
        return shear_of(self.friction_states(u))

    def remember_shear(self, u: Vec, shear_at: Callable[[Float], Float]) -> None:
        """Begin a step at ``u`` with the shear that a function gives at points."""
        u_nodes = self._local_values(u)
        for friction in self._friction:
            friction.begin_step(u_nodes, shear_at)
