"""How far the friction of a load step is behind: its bounds, stiffnesses and directions are those of its beginning.

With those of the end, tau' = clip(tau_n + kt' A' : (F - F_n), -c', c') and the shear traction on the face with the
normal n' would be tau' s', where the step has tau A (F^T n'). Their difference is compared with the traction c' that
could be carried. Both are Kirchhoff tractions; over the smallest stretch they are those of the undeformed area of a
layer, whose integrals over the medium are forces times its thickness.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.system.friction import FrictionStates, smallest_stretch

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Lag:
    """Of a step.

    Attributes:
        behind: integral of the difference of the shear tractions.
        carried: integral of the largest shear traction that could be carried at the end.
    """

    behind: float = 0.0
    carried: float = 0.0


def lag(before: Iterable[FrictionStates], after: Iterable[FrictionStates]) -> Lag:
    """How far friction is behind at the end of a step, on one rank.

    Args:
        before, after: the same points at the beginning and at the end of the step.
    """
    behind = carried = 0.0
    for start, end in zip(before, after, strict=True):
        F_cqij = end.points.F_cqij
        new = end.law.slip_system(F_cqij, end.points.parameters, np.zeros_like(end.slip.tau))
        slip_cq = np.einsum("cqij,cqij->cq", new.A_ij, F_cqij - start.points.F_cqij)
        shear_cq = np.clip(end.slip.tau + new.stiffness * slip_cq, -new.bound, new.bound)
        tangent_cqi = np.stack([-new.n_i[..., 1], new.n_i[..., 0]], axis=-1)
        there_cqi = shear_cq[..., None] * tangent_cqi
        here_cqi = np.einsum("cq,cqij,cqkj,cqk->cqi", end.response.tau, end.slip.A_ij, F_cqij, new.n_i)
        weight_cq = end.points.w_cq / smallest_stretch(F_cqij)
        behind += float((weight_cq * np.hypot(*np.moveaxis(there_cqi - here_cqi, -1, 0))).sum())
        carried += float((weight_cq * new.bound).sum())
    return Lag(behind, carried)
