"""Packs of eight shapes, filled in pieces."""

from __future__ import annotations

import numpy as np
import pytest

from tmc_vem.vem.kernel.packs import Packs, packed


@pytest.mark.parametrize("pieces", [[20], [8, 8, 4], [3, 1, 9, 7], [1] * 11, [5, 30, 2], [16, 0, 1]])
def test_pieces_end_up_where_the_whole_would(pieces):
    values = np.random.default_rng(0).normal(size=(sum(pieces), 3, 2))
    packs = Packs(sum(pieces) + 13, (3, 2))
    for piece in np.split(values, np.cumsum(pieces)[:-1]):
        packs.append(piece)
    found = packs.finish()
    n = len(values)
    assert found.shape == (-(-n // 8), 3, 2, 8)
    np.testing.assert_array_equal(found, packed(values))
    for position in range(8 * len(found)):  # lanes past the end repeat the last shape
        np.testing.assert_array_equal(found[position // 8, ..., position % 8], values[min(position, n - 1)])
    assert found.ctypes.data % 64 == 0
    assert found.flags.c_contiguous


def test_more_shapes_than_there_is_room_for_are_refused():
    packs = Packs(9, ())
    packs.append(np.zeros(16))
    with pytest.raises(ValueError, match="17 shapes, but packs for 16"):
        packs.append(np.zeros(1))
