"""A compiled kernel as a Python object on numpy arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codegen.abi import derivative_rows, load_library
from codegen.build import build
from codegen.compiler import generate
from codegen.errors import CodegenError
from codegen.ordering import N_HESSIAN, N_X, UPPER_TRIANGLE
from codegen.trace import trace

Array = NDArray[np.float64]

ENERGY, GRADIENT, TANGENT = 0, 1, 2
OUT_OF_MEMORY = -2


@dataclass(frozen=True)
class CellBatch:
    """Cells with equally many basis functions and quadrature points, ready for a kernel.

    Attributes:
        shape_c: (n_cells,) int32, index of each cell's projector.
        B_sqra: (n_shapes, n_points, 6, stride) derivatives of the projected scalar basis, rows
            (d1, d2, d1d1, d2d1, d1d2, d2d2), padded with zeros from ``n_basis`` to ``stride``.
        w_sq: (n_shapes, n_points) quadrature weights (area).
        n_basis: scalar basis functions of a cell.
    """

    shape_c: NDArray[np.int32]
    B_sqra: Array
    w_sq: Array
    n_basis: int

    @property
    def n_cells(self) -> int:
        """Number of cells in the batch."""
        return len(self.shape_c)


@dataclass(frozen=True)
class CellValues:
    """What a kernel returns for a batch; arrays beyond the asked level are None.

    Attributes:
        energy_c: (n_cells,) energy of each cell.
        min_j_c: (n_cells,) smallest J at the quadrature points of each cell.
        residual_cai: (n_cells, n_basis, 2).
        tangent_caibj: (n_cells, n_basis, 2, n_basis, 2), symmetric.
        inadmissible: index of the first cell with J <= 0, or None.
    """

    energy_c: Array
    min_j_c: Array
    residual_cai: Array | None
    tangent_caibj: Array | None
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
        self, level: int, batch: CellBatch, u_cai: Array, parameters: Array, tangent_out: Array | None = None
    ) -> CellValues:
        """Energy, residual and tangent of every cell of a batch.

        Args:
            level: ENERGY, GRADIENT or TANGENT.
            batch: projectors and weights.
            u_cai: (n_cells, n_basis, 2) displacement degrees of freedom.
            parameters: from :meth:`parameter_array`.
            tangent_out: where to write the tangents, C-contiguous, or None for a new array.

        Raises:
            ValueError: an array has a wrong shape or is not C-contiguous.
            MemoryError: the work space of a cell could not be allocated.
        """
        n_cells, n_basis = batch.n_cells, batch.n_basis
        u_cai = _dofs("u_cai", u_cai, batch)
        self._check_parameters(parameters)
        energy_c, min_j_c = np.empty(n_cells), np.empty(n_cells)
        residual = np.empty((n_cells, n_basis, 2)) if level >= GRADIENT else None
        tangent = None
        if level >= TANGENT:
            shape = (n_cells, n_basis, 2, n_basis, 2)
            tangent = np.empty(shape) if tangent_out is None else _contiguous(tangent_out).reshape(shape)
        _, n_points, _, stride = batch.B_sqra.shape
        status = self._lib.tmc_cells(
            level, n_cells, n_basis, stride, n_points, _address(batch.shape_c), _address(batch.B_sqra),
            _address(batch.w_sq), _address(u_cai), _address(parameters), _address(energy_c),
            _address(min_j_c), _address(residual), _address(tangent),
        )  # fmt: skip
        if status == OUT_OF_MEMORY:
            raise MemoryError(f"kernel '{self.name}' could not allocate its work space")
        return CellValues(energy_c, min_j_c, residual, tangent, None if status < 0 else int(status))

    def max_step(self, batch: CellBatch, u_cai: Array, du_cai: Array) -> Array:
        """Largest s of each cell, (n_cells,), with J(u + t du) > 0 at all its points for t < s; may be infinite.

        Raises:
            ValueError: an array has a wrong shape or is not C-contiguous.
        """
        u_cai, du_cai = _dofs("u_cai", u_cai, batch), _dofs("du_cai", du_cai, batch)
        step_c = np.empty(batch.n_cells)
        _, n_points, _, stride = batch.B_sqra.shape
        self._lib.tmc_max_step(
            batch.n_cells, batch.n_basis, stride, n_points, _address(batch.shape_c), _address(batch.B_sqra),
            _address(u_cai), _address(du_cai), _address(step_c),
        )  # fmt: skip
        return step_c

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
            level, n, _address(x_nx), _address(parameters), _address(psi_n), _address(g_nx),
            _address(h_nk),
        )  # fmt: skip
        return psi_n, g_nx, None if h_nk is None else _unpack(h_nk)

    def _check_parameters(self, parameters: Array) -> None:
        if parameters.shape != (len(self.parameters),) or parameters.dtype != np.float64:
            names = ", ".join(self.parameters)
            raise ValueError(f"{len(self.parameters)} parameters expected ({names}), got {parameters.size}")


def _address(array: NDArray[Any] | None) -> int | None:
    return None if array is None else _contiguous(array).ctypes.data


def _dofs(name: str, u_cai: Array, batch: CellBatch) -> Array:
    expected = (batch.n_cells, batch.n_basis, 2)
    if np.shape(u_cai) != expected:
        raise ValueError(f"{name} has shape {np.shape(u_cai)}, expected {expected}")
    return np.ascontiguousarray(u_cai, dtype=np.float64)


def _contiguous(array: NDArray[Any]) -> NDArray[Any]:
    if not array.flags.c_contiguous:
        raise ValueError("kernels take C-contiguous arrays only")
    return array


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
