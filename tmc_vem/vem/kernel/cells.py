"""A compiled energy with the cell driver, on numpy arrays: energy, residual and tangent of batches of cells."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from codegen.integrand import Integrand
from codegen.kernel import ENERGY, GRADIENT, TANGENT, Kernel, compiled
from codegen.library import Signatures, address
from tmc_vem.vem.kernel.abi import SIGNATURES
from tmc_vem.vem.kernel.batch import CellBatch, Tangents, TangentsStruct
from tmc_vem.vem.kernel.driver import CELL_DRIVER

Array = NDArray[np.float64]
Int32 = NDArray[np.int32]
Array64 = NDArray[np.int64]

OUT_OF_MEMORY = -2


@dataclass(frozen=True)
class CellValues:
    """What a kernel returns for a batch.

    Attributes:
        energy_c: (n_cells,) energy of each cell.
        min_j_c: (n_cells,) smallest J at the quadrature points of each cell.
        inadmissible: index of the first cell with J <= 0, or None.
    """

    energy_c: Array
    min_j_c: Array
    inadmissible: int | None


class CellKernel(Kernel):
    """Compiled energy with the cell driver; see :class:`codegen.kernel.Kernel` for what a kernel is made of."""

    signatures: ClassVar[Signatures] = SIGNATURES

    def cells(
        self,
        batch: CellBatch,
        u_ni: Array,
        parameters: Array,
        residual_ni: Array | None = None,
        tangents: Tangents | None = None,
    ) -> CellValues:
        """Energy of every cell of a batch and, where they are asked for, residual and tangents.

        Args:
            batch: cells and their projectors.
            u_ni: (n_nodes, 2) displacement degrees of freedom.
            parameters: from :meth:`parameter_array`.
            residual_ni: (n_nodes, 2) to which the cells' residuals (52) are added.
            tangents: to which the cells' tangents (56) are written or added.

        Raises:
            ValueError: an array has a wrong shape or is not C-contiguous.
            MemoryError: the work space could not be allocated.
        """
        self._check_batch(batch)
        self.check_parameters(parameters)
        u_ni = nodal("u_ni", u_ni, batch)
        if residual_ni is not None and nodal("residual_ni", residual_ni, batch) is not residual_ni:
            raise ValueError("residual_ni must be a C-contiguous array of doubles")
        level = TANGENT if tangents is not None else ENERGY if residual_ni is None else GRADIENT
        energy_c, min_j_c = np.empty(batch.n_cells), np.empty(batch.n_cells)
        struct = None if tangents is None else _checked_tangents(tangents, batch)
        batch.refresh()
        status = self._lib.tmc_cells(
            level, ctypes.byref(batch.struct), address(u_ni), address(parameters), address(energy_c),
            address(min_j_c), address(residual_ni), None if struct is None else ctypes.byref(struct),
        )  # fmt: skip
        require_memory(self.name, status)
        return CellValues(energy_c, min_j_c, None if status < 0 else int(status))

    def max_step(self, batch: CellBatch, u_ni: Array, du_ni: Array) -> Array:
        """Largest s of each cell, (n_cells,), with J(u + t du) > 0 at all its points for t < s; may be infinite.

        Raises:
            ValueError: an array has a wrong shape or is not C-contiguous.
            MemoryError: the work space could not be allocated.
        """
        u_ni, du_ni = nodal("u_ni", u_ni, batch), nodal("du_ni", du_ni, batch)
        step_c = np.empty(batch.n_cells)
        status = self._lib.tmc_max_step(ctypes.byref(batch.struct), address(u_ni), address(du_ni), address(step_c))
        require_memory(self.name, status)
        return step_c

    def positions(
        self, nodes_ca: Int32, row_start_n: Array64, row_length_n: Int32, column_n: Int32, columns: Int32
    ) -> Int32:
        """Where tangents go in a sparse matrix; see ``tmc_positions`` in kernel_abi.h.

        Args:
            nodes_ca: (n, n_basis) nodes of cells, or of whatever else has tangents; a node may be there twice.
            row_start_n: (n_nodes,) position of the first entry of each node's row.
            row_length_n: (n_nodes,) entries of that row.
            column_n: (n_nodes,) column of a node's first component.
            columns: columns of all entries, sorted within each row.

        Raises:
            ValueError: the matrix lacks an entry.
            MemoryError: the work space could not be allocated.
        """
        n_cells, n = nodes_ca.shape
        position_cab = np.empty((n_cells, n, n), dtype=np.int32)
        status = self._lib.tmc_positions(
            n_cells, n, address(nodes_ca), address(row_start_n), address(row_length_n), address(column_n),
            address(columns), address(position_cab),
        )  # fmt: skip
        require_memory(self.name, status)
        if status >= 0:
            raise ValueError(f"the matrix has no room for the tangent of cell {status} of the batch")
        return position_cab

    def _check_batch(self, batch: CellBatch) -> None:
        if self.uses_second_gradient and batch.second_sp is None:
            raise ValueError(f"energy '{self.name}' needs second derivatives, which the batch does not have")
        expected = (batch.n_cells, self.n_varying)
        if self.n_varying and (batch.factor_ck is None or batch.factor_ck.shape != expected):
            shape = None if batch.factor_ck is None else batch.factor_ck.shape
            raise ValueError(f"factor_ck of energy '{self.name}' has shape {shape}, expected {expected}")


def require_memory(kernel: str, status: int) -> None:
    """Check what a driver returned.

    Raises:
        MemoryError: the work space could not be allocated.
    """
    if status == OUT_OF_MEMORY:
        raise MemoryError(f"kernel '{kernel}' could not allocate its work space")


def nodal(name: str, u_ni: Array, batch: CellBatch) -> Array:
    """Values of nodes as kernels take them.

    Raises:
        ValueError: they have another shape, or are too few.
    """
    if np.ndim(u_ni) != 2 or np.shape(u_ni)[1] != 2 or len(u_ni) < batch.n_nodes:
        raise ValueError(f"{name} has shape {np.shape(u_ni)}, expected ({batch.n_nodes} or more, 2)")
    return np.ascontiguousarray(u_ni, dtype=np.float64)


def _checked_tangents(tangents: Tangents, batch: CellBatch) -> TangentsStruct:
    n, expected = batch.n_cells, (batch.n_basis, 2, batch.n_basis, 2)
    if tangents.dense_caibj is not None:
        if tangents.dense_caibj.size != n * int(np.prod(expected)):
            raise ValueError(f"dense_caibj has shape {tangents.dense_caibj.shape}, expected {(n, *expected)}")
    elif tangents.position_cab is None or tangents.position_cab.shape != (n, batch.n_basis, batch.n_basis):
        raise ValueError("position_cab does not belong to the batch")
    return tangents.struct


def compile_cells(integrand: Integrand) -> CellKernel:
    """Kernel of an integrand with the cell driver, from the cache if it is there.

    Raises:
        CodegenError: the integrand cannot be traced, or its kernel not generated, compiled or loaded.
    """
    return CellKernel(compiled(integrand, CELL_DRIVER), integrand)
