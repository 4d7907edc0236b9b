"""A linear problem of the second gradient with a known solution, and when its interior penalty is large enough.

``scripts/refresh-numbers docs/interior-penalty.md`` measures, keeps, and writes into the page.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

import helpers_penalty
import numpy as np
from helpers_mesh import grid, hanging, voronoi
from helpers_penalty import bricks, named, triangles

from tmc_vem.mesh import PolygonMesh

MESHES: dict[str, Callable[[int], PolygonMesh]] = {
    "squares": lambda n: grid(n, n),
    "triangles": lambda n: triangles(grid(n, n)),
    "Voronoi": lambda n: named(voronoi(n * n)),
    "bricks": bricks,
    "hanging nodes": lambda n: named(hanging(n)),
}
ROUNDING = 1e-10  # eigenvalues of this part of the largest one count as 0


def amplitude(mesh: str, n: int, kind: str, order: int = 2) -> float:
    """See :func:`helpers_penalty.amplitude`."""
    return helpers_penalty.amplitude(MESHES[mesh](n), kind, order)


def smallest_eta(mesh: str, n: int, order: int) -> float:
    """Smallest factor with which the regulariser alone, with its consistency term, has no negative eigenvalue.

    The stiffness is K + eta P: the factor is the largest eigenvalue of -K relative to P, where P is not 0. It is found
    by halving an interval, as P is singular.
    """
    without, one = (helpers_penalty.second_gradient_stiffness(MESHES[mesh](n), order, eta) for eta in (1.0, 2.0))
    penalty = one - without
    start = without - penalty
    low, high = 0.0, 64.0
    while high - low > 0.01:
        middle = 0.5 * (low + high)
        values = np.linalg.eigvalsh(start + middle * penalty)
        low, high = (low, middle) if values[0] > -ROUNDING * values[-1] else (middle, high)
    return high
