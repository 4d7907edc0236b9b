"""Arrays of shapes in packs of eight, the layout that kernels read: (n_packs, ..., 8), aligned for vectors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from codegen.integrand import LAYOUT

Array = NDArray[np.float64]

LANES, ALIGNMENT = LAYOUT.lanes, 64


class Packs:
    """Values of shapes that come in pieces and are put where they stay.

    Memory is reserved for the most shapes that there can be; the system gives it only where something is written.

    Args:
        capacity: how many shapes there are at most.
        rest: axes of the values of one shape.
    """

    def __init__(self, capacity: int, rest: Sequence[int]) -> None:
        self._packed = _aligned((-(-capacity // LANES), *rest, LANES))
        self._n_shapes = 0

    def append(self, values: Array) -> None:
        """Add the values (n, ...) of more shapes.

        Raises:
            ValueError: there are more than ``capacity``.
        """
        first, end = self._n_shapes, self._n_shapes + len(values)
        if end > len(self._packed) * LANES:
            raise ValueError(f"{end} shapes, but packs for {len(self._packed) * LANES}")
        self._n_shapes = end
        # packs that are whole in one go, before and after them shape by shape
        low = min(-(-first // LANES), end // LANES)
        whole = slice(low * LANES - first, max(end // LANES, low) * LANES - first)
        if whole.start < 0 or whole.stop <= whole.start:
            self._scatter(first, values)
            return
        self._scatter(first, values[: whole.start])
        blocks = values[whole].reshape(-1, LANES, *values.shape[1:])
        self._packed[low : low + len(blocks)] = np.moveaxis(blocks, 1, -1)
        self._scatter(first + whole.stop, values[whole.stop :])

    def _scatter(self, first: int, values: Array) -> None:
        for position, value in enumerate(values, first):
            self._packed[position // LANES, ..., position % LANES] = value

    def finish(self) -> Array:
        """The packs (n_packs, ..., 8); the last one is filled up with the last shape."""
        packed = self._packed[: -(-self._n_shapes // LANES)]
        used = self._n_shapes % LANES
        if used:
            packed[-1, ..., used:] = packed[-1, ..., used - 1 : used]
        return packed


def packed(values: Array) -> Array:
    """(n_packs, ..., 8) from (n_shapes, ...); the last pack is filled up with the last shape."""
    packs = Packs(len(values), values.shape[1:])
    packs.append(values)
    return packs.finish()


def _aligned(shape: Sequence[int]) -> Array:
    size = int(np.prod(shape)) * 8
    memory = np.empty(size + ALIGNMENT, dtype=np.uint8)
    start = -memory.ctypes.data % ALIGNMENT
    return memory[start : start + size].view(np.float64).reshape(shape)
