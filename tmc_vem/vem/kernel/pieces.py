"""Piecewise polynomials as kernels take them: what cells whose sub-triangles hang together alike have in common."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.vem.spaces.piecewise import Topology
from tmc_vem.vem.spaces.quadrature import PieceRule
from tmc_vem.vem.spaces.triangulation import bernstein

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Pieces:
    """Sub-triangles and quadrature of a batch.

    Attributes:
        topology: how the sub-triangles hang together.
        rule: quadrature on each of them.
    """

    topology: Topology
    rule: PieceRule

    @property
    def numbers(self) -> tuple[int, int, int, int, int]:
        """``n_corners``, ``n_boundary``, ``n_inside``, ``n_trace`` and ``n_piece_points`` of ``tmc_batch``."""
        topology, n_boundary = self.topology, len(self.topology.known_ba)
        n_corners, n_inside = int(topology.corners_tp.max()) + 1, topology.n_coefficients - n_boundary
        return n_corners, n_boundary, n_inside, topology.order + 1, len(self.rule.w_q)

    @cached_property
    def values_qm(self) -> Array:
        """(n, dim P_k) Bernstein polynomials at the points of every sub-triangle."""
        return bernstein(self.topology.order, self.rule.barycentric_qp)

    @cached_property
    def arrays(self) -> tuple[NDArray[Any], ...]:
        """``corner_tp`` to ``bernstein_mq`` of ``tmc_batch``; slopes have the factor k + 1 in C."""
        topology, rule = self.topology, self.rule
        trace_bj, trace_value_bj = topology.traces
        integers = (topology.corners_tp, topology.raised_tmp, trace_bj)
        corner_tp, raised_tmp, trace_bj32 = (np.ascontiguousarray(a, dtype=np.int32) for a in integers)
        reals = (trace_value_bj, rule.barycentric_qp, rule.w_q, self.values_qm.T)
        return (corner_tp, raised_tmp, trace_bj32, *(np.ascontiguousarray(a, dtype=np.float64) for a in reals))
