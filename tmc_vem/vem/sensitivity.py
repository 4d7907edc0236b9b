"""How cells of virtual elements change with the parameters of their energies, and what they do with given stresses."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.spread.distribute import DistributedMesh
from tmc_vem.support.distributed import Vec
from tmc_vem.support.errors import InputError
from tmc_vem.system.sensitivity import CellDerivatives, PointForces
from tmc_vem.vem.blocks import Block
from tmc_vem.vem.facets.penalty import InteriorPenalty
from tmc_vem.vem.insertion import CellTerms, add_products
from tmc_vem.vem.kernel.by_parameters import compile_cells_by_parameters
from tmc_vem.vem.point_states import point_states

Float = NDArray[np.float64]
Bool = NDArray[np.bool_]

NO_PENALTY = (
    "the interior penalty has parameters on sides between cells, which belong to two of them, and no derivatives by "
    'them: leave it out (--interior-penalty none, or interior_penalty = "none")'
)


def derivatives_of(block: Block, u_ni: Float, adjoint_ni: Float | None) -> CellDerivatives:
    """Derivatives of a block's cells with respect to their parameters, at displacements (n_nodes, 2) of the nodes."""
    kernel = compile_cells_by_parameters(block.kernel.integrand)
    energy_ck, residual_ck = kernel.cells(block.batch, u_ni, block.parameters, adjoint_ni)
    return CellDerivatives(block.region, block.cells, block.kernel.parameters, energy_ck, residual_ck)


class WithSensitivities:
    """What a system of blocks says of sensitivities."""

    blocks: list[Block]
    distributed: DistributedMesh
    penalty: InteriorPenalty | None

    def _local_values(self, u: Vec) -> Float:
        raise NotImplementedError

    def _add(self, total: Float, out: Vec) -> None:
        raise NotImplementedError

    def _together(self, compute: Callable[[], Any]) -> Any:
        raise NotImplementedError

    def create_vector(self) -> Vec:
        """A new global vector."""
        raise NotImplementedError

    def parameter_derivatives(self, u: Vec, adjoint: Vec | None = None) -> Iterator[CellDerivatives]:
        """Derivatives of this rank's cells with respect to their parameters, friction left out.

        Raises:
            InputError: there is an interior penalty.
        """
        if self.penalty is not None:
            raise InputError(NO_PENALTY)
        u_ni = self._local_values(u).copy()
        adjoint_ni = None if adjoint is None else self._local_values(adjoint).copy()
        found: Sequence[CellDerivatives] = self._together(
            lambda: [derivatives_of(block, u_ni, adjoint_ni) for block in self.blocks]
        )
        return iter(found)

    def set_factors(self, region: str, factor_ck: Float) -> None:
        """Change what multiplies the parameters of a region that vary from cell to cell.

        Raises:
            InputError: nothing varies there, or there is an interior penalty.
        """
        if self.penalty is not None:
            raise InputError(NO_PENALTY)
        for block in self.blocks:
            if block.region == region:
                if block.batch.factor_ck is None:
                    raise InputError(f"region '{region}' has no parameter that varies from cell to cell")
                block.batch.factor_ck[:] = factor_ck[block.cells]

    def add_point_forces(self, u: Vec, forces: PointForces, out: Vec) -> None:
        """Add to ``out`` what given stresses at the points of this rank's cells do on every basis function."""
        u_ni = self._local_values(u).copy()
        total = np.zeros_like(u_ni)
        for block in self.blocks:
            chunks = zip(block.chunks(), point_states([block], self.distributed.mesh, u_ni), strict=True)
            for chosen, points in chunks:
                found = forces(points)
                if found is not None:
                    P_cqij, T_cqijk = found
                    w_cq = points.w_cq[..., None, None]
                    f_cqri = np.swapaxes(w_cq * P_cqij, 2, 3)  # rows d1, d2
                    if T_cqijk is not None:  # rows d1 d1, d2 d1, d1 d2, d2 d2: of i j k, first j and then k
                        T_cqri = np.moveaxis(T_cqijk, 2, -1).swapaxes(2, 3).reshape(*T_cqijk.shape[:2], 4, 2)
                        f_cqri = np.concatenate([f_cqri, w_cq * T_cqri], axis=2)
                    rows_cqra = block.rows(f_cqri.shape[2], chosen)
                    n_cells, n_basis = len(rows_cqra), rows_cqra.shape[-1]
                    rows_cpa = rows_cqra.reshape(n_cells, -1, n_basis)
                    force_cai = np.swapaxes(rows_cpa, 1, 2) @ f_cqri.reshape(n_cells, -1, 2)
                    np.add.at(total, block.batch.nodes_ca[chosen], force_cai)
        self._add_to(out, total)

    def cell_tangent_action(self, u: Vec, du: Vec, chosen_c: Bool, out: Vec) -> None:
        """Add to ``out`` the product of the tangent at ``u`` of some cells (n_cells,) alone, and ``du``."""
        u_ni = self._local_values(u).copy()
        du_ni = self._local_values(du).copy()
        total = np.zeros_like(u_ni)

        def compute() -> None:
            for block in self.blocks:
                add_products(CellTerms(block, block.batch), u_ni, du_ni, total, chosen_c[block.cells])

        self._together(compute)
        self._add_to(out, total)

    def _add_to(self, out: Vec, total_ni: Float) -> None:
        """Add to ``out`` what this rank has at nodes (n_nodes, 2)."""
        vector = self.create_vector()
        self._add(total_ni.ravel(), vector)
        out.axpy(1.0, vector)
        vector.destroy()
