"""One region for every cell, where a file puts cells in any number of groups."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.files.record import Group
from tmc_vem.support.errors import InputError

Int = NDArray[np.int64]

REST = "domain"  # region of cells that are in no group


def regions_of(n_cells: int, groups: Sequence[Group], labels: Sequence[str]) -> tuple[Int, list[str], list[str]]:
    """Region of every cell, the names of the regions, and notes about cells in several groups.

    A cell in several groups belongs to the one that lies within all the others. Cells in none are one more region.

    Args:
        n_cells: number of cells.
        groups: of cells.
        labels: what they are called; groups of the same name are one.

    Raises:
        InputError: a cell is in two groups of which neither contains the other.
    """
    names = list(dict.fromkeys(labels))
    members: list[Int] = []
    ranks: list[int] = []
    for name in names:
        same = [group for group, label in zip(groups, labels, strict=True) if label == name]
        members.append(np.unique(np.concatenate([group.members for group in same]).astype(np.int64)))
        ranks.append(max(group.rank for group in same))

    group_c = np.full(n_cells, -1, dtype=np.int64)
    count_c = np.zeros(n_cells, dtype=np.int64)
    for n, cells in enumerate(members):
        count_c[cells] += 1
        group_c[cells] = n
    notes = _nested(group_c, count_c, names, members, ranks)

    rest = REST
    while rest in names:
        rest += "_"
    chosen = [n for n in range(len(names)) if (group_c == n).any()]
    number = np.full(len(names) + 1, 0, dtype=np.int64)
    left = bool((group_c < 0).any())
    number[chosen] = np.arange(len(chosen)) + left
    if left and chosen:
        first = int(np.flatnonzero(group_c < 0)[0])
        notes.append(f"{_cells(int((group_c < 0).sum()), first)} in no group: region '{rest}'")
    return number[group_c], ([rest] if left else []) + [names[n] for n in chosen], notes


def _nested(
    group_c: Int, count_c: Int, names: Sequence[str], members: Sequence[Int], ranks: Sequence[int]
) -> list[str]:
    """Choose the innermost group of every cell that is in several; sets ``group_c``."""
    several = np.flatnonzero(count_c > 1)
    if not len(several):
        return []
    together: dict[int, list[int]] = {int(c): [] for c in several}
    for n, cells in enumerate(members):
        for c in cells[count_c[cells] > 1].tolist():
            together[c].append(n)
    alike: dict[tuple[int, ...], list[int]] = {}
    for c, found in together.items():
        alike.setdefault(tuple(found), []).append(c)
    notes = []
    for combination, cells_in in alike.items():
        innermost = min(combination, key=lambda n: (len(members[n]), -ranks[n], n))
        for n in combination:
            if not np.isin(members[innermost], members[n], assume_unique=True).all():
                first, second = sorted((n, innermost))
                raise InputError(
                    f"cell {cells_in[0]} is in the groups '{names[first]}' and '{names[second]}', and neither contains "
                    "the other: a cell has one region"
                )
        group_c[cells_in] = innermost
        others = [names[n] for n in combination if n != innermost and ranks[n] == ranks[innermost]]
        if others:
            listed = " and ".join(f"'{name}'" for name in others)
            notes.append(
                f"{_cells(len(cells_in), cells_in[0])} in {listed} as well as in '{names[innermost]}', the smallest of "
                "these groups, which is their region"
            )
    return notes


def _cells(n: int, first: int) -> str:
    return f"cell {first} is" if n == 1 else f"{n} cells (the first is {first}) are"
