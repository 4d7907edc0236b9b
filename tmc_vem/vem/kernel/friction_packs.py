"""Friction of the cells of a batch as kernels read it: packs of eight cells, whose values change between load steps."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.system.friction import N_ENTRIES
from tmc_vem.vem.kernel.packs import LANES, packed

Array = NDArray[np.float64]


class FrictionPacks:
    """Friction of cells, zero at first.

    Some of the cells may be taken apart, as the matrix does with those beside constraints: what is taken follows what
    it was taken from.

    Args:
        n_cells: how many.
        n_points: quadrature points of each.

    Attributes:
        values_cpqk: (n_packs, n_points, 8, 8), entries of kernel_abi.h by cell of a pack.
        damping: (1,) fraction of the stiffness that the tangent has where points slip.
    """

    def __init__(self, n_cells: int, n_points: int) -> None:
        self.n_cells = n_cells
        self.values_cpqk = np.zeros((-(-n_cells // LANES), n_points, N_ENTRIES, LANES))
        self.damping = np.zeros(1)
        self._version = 0
        self._from: tuple[FrictionPacks, NDArray[Any] | slice] | None = None

    @property
    def arrays(self) -> tuple[Array, Array]:
        """What kernels read."""
        return self.values_cpqk, self.damping

    def take(self, cells: NDArray[Any] | slice) -> FrictionPacks:
        """Some of the cells."""
        chosen = np.arange(self.n_cells)[cells]
        taken = FrictionPacks(len(chosen), self.values_cpqk.shape[1])
        taken._from, taken._version = (self, chosen), -1
        taken.damping = self.damping
        taken.refresh()
        return taken

    def cells(self, chosen: slice) -> Array:
        """Entries (n_cells, n_points, 8) of some cells, the first of which begins a pack; a copy."""
        packs = self._packs(chosen)
        by_cell = np.moveaxis(packs, -1, 1).reshape(-1, *packs.shape[1:3])
        return by_cell[: chosen.stop - chosen.start]

    def set_cells(self, chosen: slice, k_cqk: Array) -> None:
        """Change the entries of some cells, the first of which begins a pack."""
        self._packs(chosen)[:] = packed(k_cqk)
        self._version += 1

    def refresh(self) -> None:
        """Follow the cells that these were taken from."""
        if self._from is None:
            return
        source, chosen = self._from
        source.refresh()
        if self._version != source._version:
            self.values_cpqk[:] = packed(source.cells(slice(0, source.n_cells))[chosen])
            self._version = source._version

    def _packs(self, chosen: slice) -> Array:
        return self.values_cpqk[chosen.start // LANES : -(-chosen.stop // LANES)]
