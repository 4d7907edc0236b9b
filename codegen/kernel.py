"""A compiled kernel as a Python object on numpy arrays."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codegen.abi import derivative_rows, load_library
from codegen.batch import CellBatch, Tangents, TangentsStruct, address
from codegen.build import build
from codegen.compiler import generate
from codegen.errors import CodegenError
from codegen.ordering import N_HESSIAN, N_X, UPPER_TRIANGLE
from codegen.trace import trace

Array = NDArray[np.float64]
Int32 = NDArray[np.int32]
Array64 = NDArray[np.int64]

ENERGY, GRADIENT, TANGENT = 0, 1, 2
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


class Kernel:
    """Compiled energy: cell driver and point evaluation.

    Args:
        library: path of the shared object.
        name: the energy's name.
        parameters: names of its parameters in the order of the kernel's array.
    """

    def __init__(self, library: Path, name: str, parameters: Sequence[str]) -> None:
        self.name = name
        self.parameters = tuple(parameters)
        self.library = library
        self._lib = load_library(library)

    @property
    def uses_second_gradient(self) -> bool:
        """Whether the energy depends on G."""
        return derivative_rows(self._lib) == 6

    def parameter_array(self, values: Mapping[str, float]) -> Array:
        """Values in the kernel's order.

        Raises:
            CodegenError: a value is missing.
        """
        missing = [name for name in self.parameters if name not in values]
        if missing:
            raise CodegenError(f"energy '{self.name}' needs a value for {', '.join(missing)}")
        return np.array([float(values[name]) for name in self.parameters], dtype=np.float64)

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
        self._check_parameters(parameters)
        u_ni = _nodal("u_ni", u_ni, batch)
        if residual_ni is not None and _nodal("residual_ni", residual_ni, batch) is not residual_ni:
            raise ValueError("residual_ni must be a C-contiguous array of doubles")
        level = TANGENT if tangents is not None else ENERGY if residual_ni is None else GRADIENT
        energy_c, min_j_c = np.empty(batch.n_cells), np.empty(batch.n_cells)
        struct = None if tangents is None else _checked_tangents(tangents, batch)
        status = self._lib.tmc_cells(
            level, ctypes.byref(batch.struct), address(u_ni), address(parameters), address(energy_c),
            address(min_j_c), address(residual_ni), None if struct is None else ctypes.byref(struct),
        )  # fmt: skip
        if status == OUT_OF_MEMORY:
            raise MemoryError(f"kernel '{self.name}' could not allocate its work space")
        return CellValues(energy_c, min_j_c, None if status < 0 else int(status))

    def max_step(self, batch: CellBatch, u_ni: Array, du_ni: Array) -> Array:
        """Largest s of each cell, (n_cells,), with J(u + t du) > 0 at all its points for t < s; may be infinite.

        Raises:
            ValueError: an array has a wrong shape or is not C-contiguous.
            MemoryError: the work space could not be allocated.
        """
        u_ni, du_ni = _nodal("u_ni", u_ni, batch), _nodal("du_ni", du_ni, batch)
        step_c = np.empty(batch.n_cells)
        status = self._lib.tmc_max_step(ctypes.byref(batch.struct), address(u_ni), address(du_ni), address(step_c))
        if status == OUT_OF_MEMORY:
            raise MemoryError(f"kernel '{self.name}' could not allocate its work space")
        return step_c

    def positions(
        self, batch: CellBatch, row_start_n: Array64, row_length_n: Int32, column_n: Int32, columns: Int32
    ) -> Int32:
        """Where the tangents of a batch go in a sparse matrix; see ``tmc_positions`` in kernel_abi.h.

        Args:
            batch: cells.
            row_start_n: (n_nodes,) position of the first entry of each node's row.
            row_length_n: (n_nodes,) entries of that row.
            column_n: (n_nodes,) column of a node's first component.
            columns: columns of all entries, sorted within each row.

        Raises:
            ValueError: the matrix lacks an entry.
            MemoryError: the work space could not be allocated.
        """
        n = batch.n_basis
        position_cab = np.empty((batch.n_cells, n, n), dtype=np.int32)
        status = self._lib.tmc_positions(
            batch.n_cells, n, address(batch.nodes_ca), address(row_start_n), address(row_length_n), address(column_n),
            address(columns), address(position_cab),
        )  # fmt: skip
        if status == OUT_OF_MEMORY:
            raise MemoryError(f"kernel '{self.name}' could not allocate its work space")
        if status >= 0:
            raise ValueError(f"the matrix has no room for the tangent of cell {status} of the batch")
        return position_cab

    def points(self, level: int, x_nx: Array, parameters: Array) -> tuple[Array, Array | None, Array | None]:
        """Energy density, gradient and Hessian at single states.

        Args:
            level: ENERGY, GRADIENT or TANGENT.
            x_nx: (n_states, 12) displacement gradient F - I and second gradient G in the order of Appendix C.
            parameters: from :meth:`parameter_array`.

        Returns:
            ``psi_n`` (n_states,), ``g_nx`` (n_states, 12) and ``h_nxy`` (n_states, 12, 12), None beyond the level.

        Raises:
            ValueError: an array has a wrong shape.
        """
        x_nx = np.ascontiguousarray(x_nx, dtype=np.float64).reshape(-1, N_X)
        self._check_parameters(parameters)
        n = len(x_nx)
        psi_n = np.empty(n)
        g_nx = np.empty((n, N_X)) if level >= GRADIENT else None
        h_nk = np.empty((n, N_HESSIAN)) if level >= TANGENT else None
        self._lib.tmc_points(
            level, n, address(x_nx), address(parameters), address(psi_n), address(g_nx),
            address(h_nk),
        )  # fmt: skip
        return psi_n, g_nx, None if h_nk is None else _unpack(h_nk)

    def _check_batch(self, batch: CellBatch) -> None:
        if self.uses_second_gradient and batch.second_sp is None:
            raise ValueError(f"energy '{self.name}' needs second derivatives, which the batch does not have")

    def _check_parameters(self, parameters: Array) -> None:
        if parameters.shape != (len(self.parameters),) or parameters.dtype != np.float64:
            names = ", ".join(self.parameters)
            raise ValueError(f"{len(self.parameters)} parameters expected ({names}), got {parameters.size}")


def _nodal(name: str, u_ni: Array, batch: CellBatch) -> Array:
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


def _unpack(h_nk: Array) -> Array:
    rows, columns = np.array(UPPER_TRIANGLE).T
    h_nxy = np.empty((len(h_nk), N_X, N_X))
    h_nxy[:, rows, columns] = h_nk
    h_nxy[:, columns, rows] = h_nk
    return h_nxy


def compile_energy(
    density: Callable[[Any, Any, Any, Any], Any], name: str, parameters: Sequence[str], description: str = ""
) -> Kernel:
    """Kernel of a density, from the cache if it is there.

    Raises:
        CodegenError: the density cannot be traced, or its kernel not generated, compiled or loaded.
    """
    traced = trace(density, name, parameters)
    library = build(name, traced.fingerprint(), lambda: generate(traced, description).c_source)
    return Kernel(library, name, parameters)
