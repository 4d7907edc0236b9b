"""Nodal values and shears of a checkpoint: in which order they stand there, and how they are found again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.simulation.checkpoint import Checkpoint
from tmc_vem.solve.states import Beginning, Slope, States
from tmc_vem.support.distributed import Vec
from tmc_vem.system.discretisation import Discretisation
from tmc_vem.system.layout import DISPLACEMENT
from tmc_vem.system.point_values import PointValues

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Saved:
    """What a run needs of states to go on.

    Attributes:
        main: the last ones of the load path, with their slopes.
        kept: what stages have kept of states before them, values of this rank's part of a vector.
        below: the last ones of a path beside it, with lower gamma, if there is one.
    """

    main: States
    kept: Sequence[Float] = field(default_factory=list)
    below: States | None = None

    def checkpoint(self, facts: Mapping[str, Any], labels_nz: Float) -> Checkpoint:
        """With the nodes and points of this rank, the nodes by their labels (n_nodes, 3)."""
        nodal = [_nodal(u) for u in _vectors(self.main)] + [DISPLACEMENT.nodal(values) for values in self.kept]
        nodal += [_nodal(u) for u in _vectors(self.below)] + [_nodal(beginning.u) for beginning in self._beginnings]
        shears = [beginning.shear for beginning in self._beginnings]
        if not shears:
            return Checkpoint(facts, labels_nz, np.array(nodal))
        shear_kp = np.array([shear.values_p for shear in shears])
        return Checkpoint(facts, labels_nz, np.array(nodal), shears[0].points_px, shear_kp)

    @staticmethod
    def read(checkpoint: Checkpoint, labels_nz: Float, points_px: Float, like: Vec) -> Saved:
        """What a checkpoint has for the nodes and points of this rank.

        Args:
            checkpoint: all of it.
            labels_nz: (n_nodes, 3) labels of the nodes.
            points_px: (n_points, 2) quadrature points with friction.
            like: any vector, which has the last state of the load path afterwards.

        Raises:
            InputError: it belongs to another mesh.
        """
        facts = checkpoint.facts
        lower = facts.get("descending")
        values_sni = checkpoint.values_at(labels_nz)
        begun = _beginnings(checkpoint, values_sni, points_px, like)
        end = len(values_sni) - len(checkpoint.shear_kp)
        n_main, n_below = _n_vectors(facts), _n_vectors(lower) if lower else 0
        main_sni, kept_sni, below_sni = np.split(values_sni[:end], [n_main, end - n_below])
        below = states_of(below_sni, lower, like) if lower else None
        main = states_of(main_sni, facts, like)
        main.beginning = next(begun, None)
        if below is not None:
            below.beginning = next(begun, None)
        return Saved(main, [kept_ni.ravel() for kept_ni in kept_sni], below)

    def give(self, system: Discretisation, stage: int) -> None:
        """Bring a system to where it stood in the last step of the load path, in a stage."""
        system.remember(stage, self.kept)
        if self.main.beginning is not None:
            system.remember_shear(self.main.beginning.u, self.main.beginning.shear.at)

    @property
    def _beginnings(self) -> list[Beginning]:
        """Where the last steps began, in problems with friction."""
        paths = [self.main] if self.below is None else [self.main, self.below]
        return [path.beginning for path in paths if path.beginning is not None]


def facts_of(states: States) -> dict[str, Any]:
    """Plain values of states for a checkpoint: their points of the path, and the directions of their slopes."""
    return {
        "controls": [control.tolist() for control in states.controls],
        "slopes": [slope.direction.tolist() if slope else None for slope in states.slopes],
    }


def states_of(values_sni: Any, facts: Mapping[str, Any], like: Vec) -> States:
    """States of a checkpoint, with the vector that they are written through; it has the last one afterwards.

    Args:
        values_sni: values of the states, and after them of the slopes that are known.
        facts: what :func:`facts_of` has said of them.
        like: the vector.
    """
    states, controls = States(like), facts["controls"]
    rates = iter(values_sni[len(controls) :])
    for control, direction, state_ni in zip(controls, facts["slopes"], values_sni, strict=False):
        slope = None
        if direction is not None:
            slope = Slope(np.array(direction), like.duplicate())
            slope.rate.getArray()[:] = next(rates).ravel()
        like.getArray()[:] = state_ni.ravel()
        states.append(np.array(control), like, slope)
    return states


def _vectors(states: States | None) -> list[Vec]:
    """The states, and after them their slopes."""
    return [] if states is None else [*states.vectors, *(slope.rate for slope in states.slopes if slope)]


def _n_vectors(facts: Mapping[str, Any]) -> int:
    """How many of them there are."""
    return len(facts["controls"]) + sum(direction is not None for direction in facts["slopes"])


def _beginnings(checkpoint: Checkpoint, values_sni: Float, points_px: Float, like: Vec) -> Iterator[Beginning]:
    """Where steps began: of the load path, and of the one beside it."""
    first = len(values_sni) - len(checkpoint.shear_kp)
    for state_ni, shear_p in zip(values_sni[first:], checkpoint.shear_kp, strict=True):
        u = like.duplicate()
        u.getArray()[:] = state_ni.ravel()
        yield Beginning(u, PointValues(points_px, PointValues(checkpoint.points_px, shear_p).at(points_px)))


def _nodal(vector: Vec) -> Float:
    return DISPLACEMENT.nodal(vector.getArray(readonly=True)).copy()
