"""Arrays inside PETSc objects, in place: petsc4py hands out copies, or one entry at a time."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc


def in_place(function: str, petsc_object: Any, n: int, dtype: Any) -> NDArray[Any]:
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
