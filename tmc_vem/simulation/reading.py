"""What reads probes of one kind off states: what a kind in a file of its own implements."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.problems.base import Problem
from tmc_vem.support.distributed import Vec
from tmc_vem.system.discretisation import Discretisation
from tmc_vem.system.layout import DISPLACEMENT

Float = NDArray[np.float64]
# Of two points, given by their places in the reference and in the deformed state.
Behind = Callable[[Sequence[Float], Sequence[Float]], bool]


@dataclass(frozen=True)
class State:
    """A converged state.

    Attributes:
        u: displacements.
        residual: full gradient of the potential there.
        behind: tells whether the second of two points is behind the surface of the first, where surfaces cross.
        contact: what is reported of contact, by name of body or pair.
    """

    u: Vec
    residual: Vec
    behind: Behind | None = None
    contact: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


# Values by name of the probe, equal on all ranks; called on all of them.
Reader = Callable[[State], Mapping[str, float]]
# Makes it for the probes of one kind, by name; on all ranks, once. Raises InputError for what is not there, with
# "probes: NAME: " before the message.
MakeReader = Callable[[Mapping[str, Any], Problem, Discretisation], Reader]


def along_x_and_y(system: Discretisation, u: Vec) -> Float:
    """(n_owned_nodes, 2) displacements along x and y of this rank's part of a vector; called on all ranks."""
    own_ni = DISPLACEMENT.nodal(u.getArray(readonly=True))
    first = sum(system.comm.allgather(len(own_ni))[: system.comm.rank])
    along_ni: Float = np.einsum("nij,nj->ni", system.turned().of(first + np.arange(len(own_ni))), own_ni)
    return along_ni
