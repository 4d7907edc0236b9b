"""A compiled energy of sides, on numpy arrays: energy, residual and tangent of batches of sides."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from codegen.driver import Driver
from codegen.integrand import Integrand
from codegen.kernel import ENERGY, GRADIENT, TANGENT, Kernel, compiled
from codegen.library import ARRAY, INT, INT64, POINTS, Signatures, address
from tmc_vem.system.interior_penalty import require_weights
from tmc_vem.vem.facets.batch import SideBatch
from tmc_vem.vem.facets.energy import ETA, JUMP_BY_NORMAL, facet_integrand
from tmc_vem.vem.kernel.cells import require_memory
from tmc_vem.vem.kernel.driver import LANE_PRODUCTS, PACKED_HESSIAN, STEP_LIMIT

Float = NDArray[np.float64]
Int32 = NDArray[np.int32]

HERE = Path(__file__).parent

SIDE_DRIVER = Driver(header=HERE / "sides_abi.h", files=(LANE_PRODUCTS, STEP_LIMIT, PACKED_HESSIAN, HERE / "sides.c"))


class SideKernel(Kernel):
    """Compiled energy at a point of a face, with the driver for sides."""

    signatures: ClassVar[Signatures] = {
        **POINTS,
        "tmc_side_terms": (INT64, (INT, *(ARRAY,) * 10)),
        "tmc_side_limits": (INT64, (ARRAY,) * 4),
    }

    @property
    def needs_positive_j(self) -> bool:
        """Whether the medium's density is read at the sides, which may be none where J <= 0; exp(-beta J) always is."""
        return JUMP_BY_NORMAL in self.layout.inputs

    def energies(
        self, batch: SideBatch, u_ni: Float, parameters: Float, residual_ni: Float | None = None
    ) -> tuple[Float, Float]:
        """Energy and smallest J (n_sides,) of each side; residuals are added to ``residual_ni`` if it is given.

        J is infinite where it may be what it likes, see :attr:`needs_positive_j`.

        Raises:
            MemoryError: the work space could not be allocated.
        """
        level = ENERGY if residual_ni is None else GRADIENT
        energy_s, min_j_s = self._terms(level, batch, u_ni, parameters, residual_ni)
        return energy_s, min_j_s if self.needs_positive_j else np.full(batch.n_sides, np.inf)

    def max_step(self, batch: SideBatch, u_ni: Float, du_ni: Float) -> Float:
        """Largest s of each side, (n_sides,), with J(u + t du) > 0 at its points for t < s, if it has to be.

        Raises:
            MemoryError: the work space could not be allocated.
        """
        if not self.needs_positive_j:
            return np.full(batch.n_sides, np.inf)
        step_s = np.empty(batch.n_sides)
        u_ni, du_ni = np.ascontiguousarray(u_ni), np.ascontiguousarray(du_ni)
        status = self._lib.tmc_side_limits(ctypes.byref(batch.struct), address(u_ni), address(du_ni), address(step_s))
        require_memory(self.name, status)
        return step_s

    def tangents(self, batch: SideBatch, u_ni: Float, parameters: Float) -> Float:
        """Tangents (n_sides, n_basis, 2, n_basis, 2).

        Raises:
            MemoryError: the work space could not be allocated.
        """
        dense = np.empty((batch.n_sides, batch.n_basis, 2, batch.n_basis, 2))
        self._terms(TANGENT, batch, u_ni, parameters, None, dense)
        return dense

    def add_tangents(
        self, batch: SideBatch, u_ni: Float, parameters: Float, values: Float, position_sab: Int32, row_length_n: Int32
    ) -> None:
        """Add tangents to the values of a matrix, see sides_abi.h.

        Raises:
            MemoryError: the work space could not be allocated.
        """
        self._terms(TANGENT, batch, u_ni, parameters, None, None, values, position_sab, row_length_n)

    def _terms(
        self, level: int, batch: SideBatch, u_ni: Float, parameters: Float, *out: NDArray[Any] | None
    ) -> tuple[Float, Float]:
        self.check_parameters(parameters)
        energy_s, min_j_s = np.empty((2, batch.n_sides))
        u_ni = np.ascontiguousarray(u_ni)  # kept while C reads it
        given = [address(array) for array in (*out, *(None,) * (5 - len(out)))]
        status = self._lib.tmc_side_terms(
            level, ctypes.byref(batch.struct), address(u_ni), address(parameters),
            address(energy_s), address(min_j_s), *given,
        )  # fmt: skip
        require_memory(self.name, status)
        return energy_s, min_j_s


@dataclass(frozen=True)
class SideEnergy:
    """The compiled energy of the sides of a region, and the values of its parameters in the kernel's order."""

    kernel: SideKernel
    parameters: Float


def compile_sides(
    region: str, medium: Integrand, values: Mapping[str, float], interior_penalty: str, eta: float
) -> SideEnergy:
    """The compiled energy of the sides of a medium, from the cache if it is there.

    Args:
        region: name of the medium.
        medium: energy of its cells.
        values: of that energy's parameters.
        interior_penalty: 'penalty' or 'full'.
        eta: factor of the penalty.

    Raises:
        InputError: the energy lacks a parameter that weights the penalty.
        CodegenError: a kernel cannot be made.
    """
    require_weights(region, medium)
    integrand = facet_integrand(medium, interior_penalty == "full")
    kernel = SideKernel(compiled(integrand, SIDE_DRIVER), integrand)
    return SideEnergy(kernel, kernel.parameter_array({**values, ETA: eta}))
