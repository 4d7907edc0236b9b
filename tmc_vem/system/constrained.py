"""Prescribed displacements as degrees of freedom of a rank, whatever the discretisation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from tmc_vem.system.constraints import Condition, Pair
from tmc_vem.system.control import Control
from tmc_vem.system.layout import DISPLACEMENT

Float = NDArray[np.float64]
Int = NDArray[np.int64]

PARALLEL = 1e-9  # directions are one if the sine of the angle between them is below this
Part = tuple[int, int]  # number of a condition, and of one of its axes


@dataclass(frozen=True)
class Frames:
    """Nodes whose two degrees of freedom are displacements along axes of their own, ``u = R q``.

    Where the displacement across an inclined edge is prescribed, q_0 is that displacement, and q_1 the one along it.

    Attributes:
        nodes: (n,) the nodes.
        turn_nij: (n, 2, 2) their rotations R.
    """

    nodes: Int = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    turn_nij: Float = field(default_factory=lambda: np.empty((0, 2, 2)))

    def displacements(self, values: Float) -> Float:
        """Values (n_nodes, 2) along x and y, of those along the axes; the same array where all axes are these."""
        return self._applied("nij,nj->ni", values)

    def forces(self, values: Float) -> Float:
        """Values (n_nodes, 2) along the axes, of those along x and y: work stays the same."""
        return self._applied("nji,nj->ni", values)

    def _applied(self, what: str, values: Float) -> Float:
        if not len(self.nodes):
            return values
        turned = values.copy()
        turned[self.nodes] = np.einsum(what, self.turn_nij, values[self.nodes])
        return turned

    def everywhere(self, n_nodes: int) -> Float:
        """(n_nodes, 2, 2) rotations of all nodes, those of the others the identity."""
        turn_nij = np.tile(np.eye(2), (n_nodes, 1, 1))
        turn_nij[self.nodes] = self.turn_nij
        return turn_nij

    def renumbered(self, number_n: Int) -> Frames:
        """The same at nodes that have other numbers (n_nodes,), without those whose number is negative."""
        kept = number_n[self.nodes] >= 0
        return Frames(number_n[self.nodes[kept]], self.turn_nij[kept])


@dataclass(frozen=True)
class Terms:
    """What a condition's displacement along one of its axes adds to degrees of freedom.

    Attributes:
        part: the condition and its axis.
        entries: (n,) positions among the constrained degrees of freedom.
        factors: (n,) what it is multiplied with there.
    """

    part: Part
    entries: Int
    factors: Float


@dataclass(frozen=True)
class Constrained:
    """Degrees of freedom whose displacements are prescribed.

    Attributes:
        prescribed: the conditions.
        dofs: (n,) the degrees of freedom, in order.
        points_dx: (n, 2) their nodes in the reference configuration.
        terms: what each condition adds.
        frames: nodes at which a direction is held that is not x or y, with the other one free.
    """

    prescribed: tuple[Condition, ...]
    dofs: Int
    points_dx: Float
    terms: tuple[Terms, ...]
    frames: Frames

    @staticmethod
    def of(
        conditions: Sequence[Condition], nodes_of: Callable[[str], Int], points_nx: Float | None = None
    ) -> Constrained:
        """In order and without duplicates; where several conditions prescribe one direction, the last one holds.

        At a node where two different directions are prescribed, both components are.

        Args:
            conditions: the conditions, with their axes.
            nodes_of: nodes (n,) that go by a name; called on all ranks alike.
            points_nx: (n_nodes, 2) places of the nodes, which rotations need; those of nodes that go by no name do not
                matter.
        """
        held: dict[int, list[Part]] = {}
        for number, condition in enumerate(conditions):
            for node in nodes_of(condition.where).tolist():
                for axis, _ in enumerate(condition.axes):
                    held.setdefault(node, []).append((number, axis))
        axes = {(n, k): axis for n, condition in enumerate(conditions) for k, axis in enumerate(condition.axes)}
        rows: dict[int, Mapping[Part, float]] = {}
        turned: dict[int, Float] = {}
        for node, parts in held.items():
            kept = _independent(parts, axes)
            directions = np.array([axes[part] for part in kept])
            if len(kept) == 1 and not _is_component(axes[kept[0]]):
                ((x, y),) = directions
                turned[node] = np.array([[x, -y], [y, x]])
                rows[int(DISPLACEMENT.dof(node, 0))] = {kept[0]: 1.0}
            elif all(_is_component(axes[part]) for part in kept):
                for part in kept:
                    component = int(axes[part][0] == 0.0)
                    rows[int(DISPLACEMENT.dof(node, component))] = {part: axes[part][component]}  # 1 or -1
            else:
                for i, factors in enumerate(np.linalg.inv(directions).tolist()):
                    rows[int(DISPLACEMENT.dof(node, i))] = dict(zip(kept, factors, strict=True))
        dofs = np.array(sorted(rows), dtype=np.int64)
        by_part: dict[Part, list[tuple[int, float]]] = {}
        for entry, dof in enumerate(dofs.tolist()):
            for part, factor in rows[dof].items():
                by_part.setdefault(part, []).append((entry, factor))
        terms = tuple(
            Terms(part, np.array([n for n, _ in found], dtype=np.int64), np.array([f for _, f in found]))
            for part, found in sorted(by_part.items())
        )
        nodes = np.array(sorted(turned), dtype=np.int64)
        frames = Frames(nodes, np.array([turned[node] for node in nodes.tolist()]).reshape(-1, 2, 2))
        points_dx = np.zeros((len(dofs), 2)) if points_nx is None else points_nx[DISPLACEMENT.node(dofs)]
        return Constrained(tuple(conditions), dofs, points_dx, terms, frames)

    def renumbered(self, number_n: Int) -> Constrained:
        """The same at nodes that have other numbers (n_nodes,), without those whose number is negative."""
        nodes = number_n[DISPLACEMENT.node(self.dofs)]
        some = self._some(nodes >= 0)
        dofs = DISPLACEMENT.dof(nodes[nodes >= 0], DISPLACEMENT.component(some.dofs))
        return replace(some, dofs=dofs, frames=self.frames.renumbered(number_n))

    def along_x_and_y(self) -> Constrained:
        """What is prescribed at nodes whose axes are x and y."""
        of_others = np.isin(DISPLACEMENT.node(self.dofs), self.frames.nodes)
        return replace(self._some(~of_others), frames=Frames())

    def _some(self, kept: NDArray[np.bool_]) -> Constrained:
        """Some of the degrees of freedom."""
        place = np.cumsum(kept) - 1
        terms = []
        for each in self.terms:
            here = kept[each.entries]
            terms.append(Terms(each.part, place[each.entries[here]], each.factors[here]))
        return replace(self, dofs=self.dofs[kept], points_dx=self.points_dx[kept], terms=tuple(terms))

    @property
    def condition_d(self) -> Int:
        """(n,) the condition that holds at each degree of freedom; of two, the last."""
        numbers = np.zeros(len(self.dofs), dtype=np.int64)
        for each in self.terms:
            numbers[each.entries] = each.part[0]
        return numbers

    @property
    def is_still_d(self) -> NDArray[np.bool_]:
        """(n,) whether nothing ever moves each degree of freedom."""
        still = np.ones(len(self.dofs), dtype=np.bool_)
        for each in self.terms:
            if self.prescribed[each.part[0]].value:
                still[each.entries[each.factors != 0.0]] = False
        return still

    def at(self, position: Control) -> Float:
        """Displacements (n,) at a position on the path, along the axes of the nodes."""
        return self._sum(lambda condition, points_nx: condition.along(position, points_nx))

    def per_load(self, position: Control) -> Float:
        """Their derivatives (n,) with respect to the load factor."""
        return self._sum(lambda condition, points_nx: condition.along_per_load(position, points_nx))

    def forces(self, values_ni: Float) -> Float:
        """(n, 2) forces along x and y that hold nodes, of values (n_nodes, 2) along their axes.

        A component that nothing holds is left out.
        """
        held = np.zeros(values_ni.size)
        held[self.dofs] = values_ni.ravel()[self.dofs]
        return self.frames.displacements(DISPLACEMENT.nodal(held))[np.unique(DISPLACEMENT.node(self.dofs))]

    def _sum(self, values: Callable[[Condition, Float], Float]) -> Float:
        total = np.zeros(len(self.dofs))
        for each in self.terms:
            number, axis = each.part
            along = values(self.prescribed[number], self.points_dx[each.entries])
            total[each.entries] += each.factors * along[axis]
        return total


def is_other(a: Pair, b: Pair) -> bool:
    """Whether two directions differ, whichever way they point."""
    return abs(a[0] * b[1] - a[1] * b[0]) > PARALLEL


def _is_component(axis: Pair) -> bool:
    return 0.0 in axis


def _independent(parts: Sequence[Part], axes: Mapping[Part, Pair]) -> list[Part]:
    """The last parts whose axes are independent, at most two, in their order."""
    kept: list[Part] = []
    for part in reversed(parts):
        if len(kept) < 2 and all(is_other(axes[part], axes[other]) for other in kept):
            kept.insert(0, part)
    return kept
