"""Functions of the cell driver for ctypes; the Python side of kernel_abi.h."""

from __future__ import annotations

from codegen.library import ARRAY, INT, INT64, POINTS, Signatures

# Arguments in the order of kernel_abi.h; a test compares them with the header.
CELLS: Signatures = {
    "tmc_cells": (INT64, (INT, *(ARRAY,) * 7)),
    "tmc_max_step": (INT64, (ARRAY,) * 4),
    "tmc_positions": (INT64, (INT64, INT, *(ARRAY,) * 6)),
}

SIGNATURES: Signatures = {**POINTS, **CELLS}

# The same of by_parameters_abi.h.
CELLS_BY_PARAMETERS: Signatures = {"tmc_cells_by_parameters": (INT64, (ARRAY,) * 6)}
