"""Nodes whose degrees of freedom are displacements along axes of their own, as those of a roller on an incline are."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]
Int = NDArray[np.int64]


@dataclass(frozen=True)
class Turned:
    """Such nodes of all ranks, equal on all of them.

    Attributes:
        nodes: (n,) numbers over all ranks.
        axes_nij: (n, 2, 2) their axes, as columns: a displacement along x and y is ``axes @ q``.
    """

    nodes: Int = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    axes_nij: Float = field(default_factory=lambda: np.empty((0, 2, 2)))

    def of(self, nodes: Int) -> Float:
        """Axes (..., 2, 2) of nodes (...); those of x and y where a node is not turned."""
        found = np.broadcast_to(np.eye(2), (*nodes.shape, 2, 2)).copy()
        for node, axes in zip(self.nodes.tolist(), self.axes_nij, strict=True):
            found[nodes == node] = axes
        return found
