"""Derivatives of batches of cells with respect to the parameters of their energy, on numpy arrays."""

from __future__ import annotations

import ctypes
import functools
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from codegen.by_parameters import BY_PARAMETERS, ParameterKernel, compiled_by_parameters
from codegen.integrand import Integrand
from codegen.library import Signatures, address
from tmc_vem.vem.kernel.abi import CELLS_BY_PARAMETERS
from tmc_vem.vem.kernel.batch import CellBatch
from tmc_vem.vem.kernel.cells import nodal, require_memory
from tmc_vem.vem.kernel.driver import PARAMETER_DRIVER

Array = NDArray[np.float64]


class CellParameterKernel(ParameterKernel):
    """Compiled derivatives with respect to parameters, with the loop over cells."""

    signatures: ClassVar[Signatures] = {**BY_PARAMETERS, **CELLS_BY_PARAMETERS}

    def cells(
        self, batch: CellBatch, u_ni: Array, parameters: Array, adjoint_ni: Array | None = None
    ) -> tuple[Array, Array]:
        """Derivatives with respect to the value that each parameter has in each cell; friction is left out.

        Args:
            batch: cells and their projectors.
            u_ni: (n_nodes, 2) displacement degrees of freedom.
            parameters: from :meth:`parameter_array`.
            adjoint_ni: (n_nodes, 2) degrees of freedom of an adjoint field.

        Returns:
            ``energy_ck`` and ``residual_ck`` (n_cells, n_parameters): of the cell's energy, and of the product of the
            adjoint field and the cell's residual (52), which is 0 without such a field.

        Raises:
            ValueError: an array has a wrong shape.
            MemoryError: the work space could not be allocated.
        """
        self.check_parameters(parameters)
        batch.refresh()
        u_ni = nodal("u_ni", u_ni, batch)
        adjoint_ni = None if adjoint_ni is None else nodal("adjoint_ni", adjoint_ni, batch)
        energy_ck, residual_ck = np.empty((2, batch.n_cells, len(self.parameters)))
        status = self._lib.tmc_cells_by_parameters(
            ctypes.byref(batch.struct), address(u_ni), address(adjoint_ni), address(parameters), address(energy_ck),
            address(residual_ck),
        )  # fmt: skip
        require_memory(self.name, status)
        return energy_ck, residual_ck


@functools.cache
def compile_cells_by_parameters(integrand: Integrand) -> CellParameterKernel:
    """Kernel of the derivatives of an integrand with the loop over cells, from the cache if it is there.

    Raises:
        CodegenError: the integrand cannot be traced, or its kernel not generated, compiled or loaded.
    """
    return CellParameterKernel(compiled_by_parameters(integrand, PARAMETER_DRIVER), integrand)
