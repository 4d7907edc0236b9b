"""Load a compiled kernel with ctypes, and pass arrays to it.

ctypes and not cffi: parsing the header takes cffi 30 ms in every process, as much as everything else that a cached
kernel needs.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from codegen.errors import CodegenError

INT, INT64, ARRAY = ctypes.c_int, ctypes.c_int64, ctypes.c_void_p

Signatures = Mapping[str, tuple[type | None, tuple[type, ...]]]  # result and arguments of functions by name

# Arguments in the order of points.h; a test compares them with the header.
POINTS: Signatures = {"tmc_points": (None, (INT, INT64, *(ARRAY,) * 5))}


def load_library(path: Path, signatures: Signatures) -> ctypes.CDLL:
    """The shared object of a kernel with its functions typed.

    Raises:
        CodegenError: it is damaged, for another machine, or not a kernel.
    """
    try:
        library = ctypes.CDLL(str(path))
        for name, (result, arguments) in signatures.items():
            function = getattr(library, name)
            function.restype, function.argtypes = result, arguments
    except (OSError, AttributeError) as error:
        raise CodegenError(f"kernel {path} cannot be loaded ({error}); delete it and try again") from error
    return library


def derivative_rows(library: ctypes.CDLL) -> int:
    """Number of derivative rows that the energy uses: 2 (F only) or 6 (F and G)."""
    return ctypes.c_int.in_dll(library, "tmc_n_rows").value


def address(array: NDArray[Any] | None) -> int | None:
    """Address of an array's data for C.

    Raises:
        ValueError: the array is not C-contiguous.
    """
    if array is None:
        return None
    if not array.flags.c_contiguous:
        raise ValueError("kernels take C-contiguous arrays only")
    return array.ctypes.data
