"""What users set in the environment; asked by commands and public functions, which hand it on as an argument."""

from __future__ import annotations

import math
import os

from tmc_vem.support.errors import InputError

# A million cells are about ten million degrees of freedom, and four minutes of meshing.
MOST_CELLS = 1_000_000
VARIABLE = "TMC_VEM_MOST_CELLS"


def cells_allowed(most_cells: float | None = None) -> float:
    """Cells that a mesh may have: those that are given, or else what the environment says, or MOST_CELLS.

    Raises:
        InputError: that of the environment is no positive number.
    """
    if most_cells is not None:
        return most_cells
    text = os.environ.get(VARIABLE, "")
    try:
        limit = float(text) if text else float(MOST_CELLS)
    except ValueError:
        limit = math.nan
    if not limit > 0.0:
        raise InputError(f"{VARIABLE} = {text!r} in the environment must be a positive number, such as 2e6")
    return limit
