"""How many cells a mesh may have: a size that is a slip should not cost hours and all memory."""

from __future__ import annotations

import math
import os

import numpy as np

from tmc_vem.support.errors import InputError

# A million cells are about ten million degrees of freedom, and four minutes of meshing.
MOST_CELLS = 1_000_000
VARIABLE = "TMC_VEM_MOST_CELLS"
# cells in a square whose side is the size of cells
POLYGONS, QUADRILATERALS, TRIANGLES = 1.0, 1.0, 4.0 / np.sqrt(3.0)


def most_cells() -> float:
    """Cells that a mesh may have: MOST_CELLS, or what the environment says.

    Raises:
        InputError: that is no positive number.
    """
    text = os.environ.get(VARIABLE, "")
    try:
        limit = float(text) if text else float(MOST_CELLS)
    except ValueError:
        limit = np.nan
    if not limit > 0.0:
        raise InputError(f"{VARIABLE} = {text!r} in the environment must be a positive number, such as 2e6")
    return limit


def check_cells(n_cells: float, hint: str, *, at_least: bool = False) -> None:
    """Check that a mesh would not have too many cells.

    Args:
        n_cells: estimate of how many it would have.
        hint: why, and what to change, for the message.
        at_least: it is a lower bound.

    Raises:
        InputError: they are more than :func:`most_cells`.
    """
    limit = most_cells()
    if not n_cells <= limit:
        allowed = "a larger number" if at_least else f"{1.2 * n_cells:.1e}"
        raise InputError(
            f"the mesh would have {'at least' if at_least else 'about'} {n_cells:.2g} cells, more than {limit:.3g}: "
            f"{hint}. With time and memory for it, set {VARIABLE} to {allowed} in the environment"
        )


def check_refined(cells: tuple[int, int], part: float, refinement: int) -> None:
    """Check a structured mesh of ``cells`` in x and y, a part of whose area has edges that are divided.

    Raises:
        InputError: it would have too many cells.
    """
    plain = math.prod(cells)
    hint = f"{cells[0]} x {cells[1]} cells"
    hint += f", divided by {refinement} x {refinement} in the medium" if refinement > 1 else ""
    check_cells(plain * (1.0 + part * (refinement**2 - 1)), f"{hint}; use fewer")
