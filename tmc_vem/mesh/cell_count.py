"""How many cells a mesh may have: a size that is a slip should not cost hours and all memory."""

from __future__ import annotations

import math

import numpy as np

from tmc_vem.support.environment import VARIABLE
from tmc_vem.support.errors import InputError

# cells in a square whose side is the size of cells
POLYGONS, QUADRILATERALS, TRIANGLES = 1.0, 1.0, 4.0 / np.sqrt(3.0)


def check_cells(n_cells: float, limit: float, hint: str, *, at_least: bool = False) -> None:
    """Check that a mesh would not have too many cells.

    Args:
        n_cells: estimate of how many it would have.
        limit: how many it may have, see :func:`tmc_vem.support.environment.cells_allowed`.
        hint: why, and what to change, for the message.
        at_least: it is a lower bound.

    Raises:
        InputError: they are more.
    """
    if not n_cells <= limit:
        allowed = "a larger number" if at_least else f"{1.2 * n_cells:.1e}"
        raise InputError(
            f"the mesh would have {'at least' if at_least else 'about'} {n_cells:.2g} cells, more than {limit:.3g}: "
            f"{hint}. With time and memory for it, set {VARIABLE} to {allowed} in the environment"
        )


def check_refined(cells: tuple[int, int], part: float, refinement: int, limit: float) -> None:
    """Check a structured mesh of ``cells`` in x and y, a part of whose area has edges that are divided.

    Raises:
        InputError: it would have too many cells.
    """
    plain = math.prod(cells)
    hint = f"{cells[0]} x {cells[1]} cells"
    hint += f", divided by {refinement} x {refinement} in the medium" if refinement > 1 else ""
    check_cells(plain * (1.0 + part * (refinement**2 - 1)), limit, f"{hint}; use fewer")
