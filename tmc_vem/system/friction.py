"""Coulomb friction in the third medium: a slip system at every point that is frozen over a load step.

Where the medium is squeezed to a layer, its own deformation says where the surfaces face each other: n is the
eigenvector of b = F F^T to the smallest eigenvalue, s = (-n2, n1). With F of the last converged state,

    A = s (x) (F^-1 n) + n (x) (F^-1 s)          A : dF is the slip per present width of the gap
    c = mu_f max(0, -n . (P F^T) n)              bound of the Kirchhoff shear, P the medium's stress without regulariser
    kt = c / g_c                                 g_c = elastic slip, per width of the gap, at which the bound is reached

and tau = clip(tau_n + kt A : (F - F_n), -c, c) adds tau A to P. So each step has a potential, whose second derivative
is of rank one; the scheme is of first order in the slip of a step. Points that are not squeezed to half carry no
friction.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codegen.stress import Stress
from tmc_vem.system.friction_settings import Friction
from tmc_vem.system.point_states import PointStates

Float = NDArray[np.float64]
Bool = NDArray[np.bool_]

SQUEEZED = 0.5  # smallest stretch below which the medium carries friction


@dataclass(frozen=True)
class SlipSystem:
    """What is frozen in a load step, at points with any leading axes.

    Attributes:
        A_ij: (..., 2, 2) direction of the shear, ``P += tau A``.
        AH: (...) ``A : (F_n - I)``.
        bound: (...) c, the largest Kirchhoff shear; 0 where there is no friction.
        stiffness: (...) kt, 0 with it.
        tau: (...) shear at the beginning of the step, within the bound.
        n_i: (..., 2) normal of contact in the deformed state, a unit vector without a sign.
    """

    A_ij: Float
    AH: Float
    bound: Float
    stiffness: Float
    tau: Float
    n_i: Float

    def response(self, F: Float) -> SlipResponse:
        """Shear and energies at other deformation gradients (..., 2, 2)."""
        dg = np.einsum("...ij,...ij->...", self.A_ij, F - np.eye(2)) - self.AH
        trial = self.tau + self.stiffness * dg
        tau = np.clip(trial, -self.bound, self.bound)
        compliance = np.divide(1.0, self.stiffness, out=np.zeros_like(tau), where=self.stiffness > 0.0)
        change = tau - self.tau
        return SlipResponse(
            tau=tau,
            dg=dg,
            energy=tau * dg - 0.5 * compliance * change**2,
            stored=0.5 * compliance * tau**2,
            dissipated=tau * (dg - compliance * change),
            sticks=np.abs(trial) < self.bound,
        )


@dataclass(frozen=True)
class SlipResponse:
    """Answer of a slip system to a deformation; all arrays have the leading axes of the points.

    Attributes:
        tau: Kirchhoff shear.
        dg: slip of the step, per width of the gap at its beginning.
        energy: potential of the step, 0 at its beginning: what its slip has stored elastically and dissipated.
        stored: elastic energy ``tau^2 / (2 kt)`` at the end, with the stiffness of this step.
        dissipated: ``tau (dg - (tau - tau_n) / kt)``, never negative.
        sticks: whether the shear is within the bound.
    """

    tau: Float
    dg: Float
    energy: Float
    stored: Float
    dissipated: Float
    sticks: Bool


@dataclass(frozen=True)
class FrictionStates:
    """Points of some cells of one region with friction, at a state on the way from the beginning of a step.

    Attributes:
        points: the states, as of stresses.
        slip: what is frozen in the step.
        response: at this state.
        law: of the region.
    """

    points: PointStates
    slip: SlipSystem
    response: SlipResponse
    law: FrictionLaw


@dataclass(frozen=True)
class FrictionLaw:
    """Friction of a region whose energy is known.

    Attributes:
        friction: what was said of it.
        stress: of the region's energy; without a second gradient it is the stress of the medium without regulariser.
    """

    friction: Friction
    stress: Stress

    def slip_system(self, F_cqij: Float, parameters: Mapping[str, float | Float], tau_cq: Float) -> SlipSystem:
        """That of the step which begins at a state.

        Args:
            F_cqij: (n_cells, n_points, 2, 2) deformation gradients.
            parameters: of the energy, numbers or (n_cells, 1).
            tau_cq: (n_cells, n_points) shear reached; it is cut to the new bound.
        """
        squeezed = smallest_stretch(F_cqij) < SQUEEZED
        P_cqij = np.zeros_like(F_cqij)
        if squeezed.any():
            where = np.nonzero(squeezed)
            F = F_cqij[where][:, None]
            values = {
                name: np.broadcast_to(value, squeezed.shape)[where][:, None] if np.ndim(value) else value
                for name, value in parameters.items()
            }
            G = np.zeros((*F.shape, 2)) if self.stress.uses_second_gradient else None
            P_cqij[where] = self.stress.at(F, G, values)[0][:, 0]
        return slip_system(F_cqij, P_cqij, self.friction, tau_cq)


def slip_system(F: Float, P_medium: Float, friction: Friction, tau: Float) -> SlipSystem:
    """The slip system of a step that begins at a state, at points with any leading axes.

    Args:
        F: (..., 2, 2) deformation gradients of the state.
        P_medium: (..., 2, 2) the medium's first Piola-Kirchhoff stress there, without its regulariser.
        friction: coefficient and elastic slip.
        tau: (...) Kirchhoff shear there; it is cut to the new bound.
    """
    n, s = contact_directions(F)
    kirchhoff = P_medium @ np.swapaxes(F, -1, -2)
    pressure = np.maximum(0.0, -np.einsum("...i,...ij,...j->...", n, kirchhoff, n))
    bound = np.where(smallest_stretch(F) < SQUEEZED, friction.coefficient * pressure, 0.0)
    inverse = np.linalg.inv(F)
    A = np.einsum("...i,...jk,...k->...ij", s, inverse, n) + np.einsum("...i,...jk,...k->...ij", n, inverse, s)
    A = np.where(bound[..., None, None] > 0.0, A, 0.0)
    return SlipSystem(
        A_ij=A,
        AH=np.einsum("...ij,...ij->...", A, F - np.eye(2)),
        bound=bound,
        stiffness=bound / friction.elastic_slip,
        tau=np.clip(tau, -bound, bound),
        n_i=n,
    )


def contact_directions(F: Float) -> tuple[Float, Float]:
    """Normal and tangent (..., 2) of contact: the eigenvector of b = F F^T to its smallest eigenvalue, and that turned
    by a right angle. Slip turns it away from the surface's normal by at most half of the smallest stretch."""
    b = F @ np.swapaxes(F, -1, -2)
    angle = 0.5 * np.arctan2(2.0 * b[..., 0, 1], b[..., 0, 0] - b[..., 1, 1])  # of the largest one
    along, across = np.cos(angle), np.sin(angle)
    return np.stack([-across, along], axis=-1), np.stack([-along, -across], axis=-1)


def smallest_stretch(F: Float) -> Float:
    """(...) smallest principal stretch: J by the largest one, which loses no digits where J is small."""
    b = F @ np.swapaxes(F, -1, -2)
    spread = np.hypot(b[..., 0, 0] - b[..., 1, 1], 2.0 * b[..., 0, 1])
    largest = np.sqrt(0.5 * (b[..., 0, 0] + b[..., 1, 1] + spread))
    J = F[..., 0, 0] * F[..., 1, 1] - F[..., 0, 1] * F[..., 1, 0]
    stretch: Float = J / largest
    return stretch
