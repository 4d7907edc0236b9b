"""Load a compiled kernel with ctypes; the Python side of kernel_abi.h.

ctypes and not cffi: parsing the header takes cffi 30 ms in every process, as much as everything else that a cached
kernel needs.
"""

from __future__ import annotations

import ctypes
from pathlib import Path

from codegen.errors import CodegenError

_INT, _INT64, _ARRAY = ctypes.c_int, ctypes.c_int64, ctypes.c_void_p

# Arguments in the order of kernel_abi.h; a test compares them with the header.
SIGNATURES: dict[str, tuple[type | None, tuple[type, ...]]] = {
    "tmc_cells": (_INT64, (_INT, *(_ARRAY,) * 7)),
    "tmc_max_step": (_INT64, (_ARRAY,) * 4),
    "tmc_positions": (_INT64, (_INT64, _INT, *(_ARRAY,) * 6)),
    "tmc_points": (None, (_INT, _INT64, *(_ARRAY,) * 5)),
}


def load_library(path: Path) -> ctypes.CDLL:
    """The shared object of a kernel with its functions typed.

    Raises:
        CodegenError: it is damaged, for another machine, or not a kernel.
    """
    try:
        library = ctypes.CDLL(str(path))
        for name, (result, arguments) in SIGNATURES.items():
            function = getattr(library, name)
            function.restype, function.argtypes = result, arguments
    except (OSError, AttributeError) as error:
        raise CodegenError(f"kernel {path} cannot be loaded ({error}); delete it and try again") from error
    return library


def derivative_rows(library: ctypes.CDLL) -> int:
    """Number of derivative rows that the energy uses: 2 (F only) or 6 (F and G)."""
    return ctypes.c_int.in_dll(library, "tmc_n_rows").value
