"""Prescribed displacements as degrees of freedom of a rank, whatever the discretisation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.system.constraints import Prescribed
from tmc_vem.system.control import Control
from tmc_vem.system.layout import DISPLACEMENT

Float = NDArray[np.float64]
Int = NDArray[np.int64]


@dataclass(frozen=True)
class Constrained:
    """Degrees of freedom whose displacements are prescribed.

    Attributes:
        prescribed: the conditions.
        dofs: (n,) the degrees of freedom.
        condition_d: (n,) the condition that holds at each.
    """

    prescribed: tuple[Prescribed, ...]
    dofs: Int
    condition_d: Int

    @staticmethod
    def of(prescribed: Sequence[Prescribed], nodes_of: Callable[[str], Int]) -> Constrained:
        """In order and without duplicates; where several conditions meet, the last one holds.

        Args:
            prescribed: the conditions.
            nodes_of: nodes (n,) that go by a name; called on all ranks alike.
        """
        numbers: dict[int, int] = {}
        for number, condition in enumerate(prescribed):
            for node in nodes_of(condition.where).tolist():
                numbers[int(DISPLACEMENT.dof(node, condition.component))] = number
        dofs = np.array(sorted(numbers), dtype=np.int64)
        return Constrained(tuple(prescribed), dofs, np.array([numbers[dof] for dof in dofs.tolist()], dtype=np.int64))

    def renumbered(self, number_n: Int) -> Constrained:
        """The same at nodes that have other numbers (n_nodes,), without those whose number is negative."""
        nodes = number_n[DISPLACEMENT.node(self.dofs)]
        kept = nodes >= 0
        dofs = DISPLACEMENT.dof(nodes[kept], DISPLACEMENT.component(self.dofs[kept]))
        return Constrained(self.prescribed, dofs, self.condition_d[kept])

    def at(self, position: Control) -> Float:
        """Displacements (n,) at a position on the path."""
        return self._of_dofs([condition.at(position) for condition in self.prescribed])

    def per_load(self, position: Control) -> Float:
        """Their derivatives (n,) with respect to the load factor."""
        return self._of_dofs([condition.per_load(position) for condition in self.prescribed])

    def _of_dofs(self, values: Sequence[float]) -> Float:
        of_dofs: Float = np.array(values, dtype=np.float64)[self.condition_d]
        return of_dofs
