"""Arrays inside PETSc objects, in place: petsc4py hands out copies, or one entry at a time."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.distributed import Mat
from tmc_vem.support.petsc import PETSc


def in_place(function: str, petsc_object: Mat, n: int, dtype: Any) -> NDArray[Any]:
    """The array (n,) that a function of PETSc, such as MatSeqAIJGetArray, points to; valid as long as the object.

    Raises:
        PETSc.Error: PETSc refuses.
    """
    if n == 0:
        return np.empty(0, dtype=dtype)
    pointer = ctypes.POINTER(np.ctypeslib.as_ctypes_type(dtype))()
    library = ctypes.CDLL(PETSc.__file__)  # finds the functions of the PETSc that petsc4py is linked with
    error = getattr(library, function)(ctypes.c_void_p(petsc_object.handle), ctypes.byref(pointer))
    if error:
        raise PETSc.Error(error)
    return np.ctypeslib.as_array(pointer, shape=(n,))


def compressed_rows(matrix: Mat) -> tuple[NDArray[Any], NDArray[Any]]:
    """Row starts and columns of a sequential AIJ matrix, in place; valid as long as its pattern, and not to be changed.

    Raises:
        PETSc.Error: PETSc refuses.
        ValueError: the matrix has no compressed rows.
    """
    integer = np.ctypeslib.as_ctypes_type(np.dtype(PETSc.IntType))
    n, done = integer(), ctypes.c_int()
    starts, columns = (ctypes.POINTER(integer)() for _ in range(2))
    error = ctypes.CDLL(PETSc.__file__).MatGetRowIJ(
        ctypes.c_void_p(matrix.handle), integer(0), 0, 0, ctypes.byref(n), ctypes.byref(starts), ctypes.byref(columns),
        ctypes.byref(done),
    )  # fmt: skip
    if error:
        raise PETSc.Error(error)
    if not done.value:
        raise ValueError(f"a matrix of type {matrix.getType()} has no compressed rows")
    row_starts = np.ctypeslib.as_array(starts, shape=(n.value + 1,))
    n_entries = int(row_starts[-1])
    if n_entries == 0:
        return row_starts, np.empty(0, dtype=PETSc.IntType)
    return row_starts, np.ctypeslib.as_array(columns, shape=(n_entries,))
