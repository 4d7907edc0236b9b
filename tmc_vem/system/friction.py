"""Coulomb friction in the third medium: a slip system at every point that is frozen over a load step.

Where the medium is squeezed to a layer, its own deformation says where the surfaces face each other: n is the
eigenvector of b = F F^T to the smallest eigenvalue, s = (-n2, n1). With F of the last converged state,

    A = s (x) (F^-1 n) + n (x) (F^-1 s)          A : dF is the slip per present width of the gap
    c = mu_f max(0, -n . (P F^T) n)              bound of the Kirchhoff shear, P the medium's stress without regulariser
    kt = c / g_c                                 g_c = elastic slip, per width of the gap, at which the bound is reached

and tau = clip(tau_n + kt A : (F - F_n), -c, c) adds tau A to P. So each step has a potential, whose second derivative
is of rank one; the scheme is of first order in the slip of a step. Points that are not squeezed to half carry no
friction, and none does that is only sheared.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from codegen.stress import Stress
from tmc_vem.system.friction_settings import Friction
from tmc_vem.system.point_states import PointStates

Float = NDArray[np.float64]
Bool = NDArray[np.bool_]

SQUEEZED = 0.5  # smallest stretch, and J, below which the medium carries friction
N_ENTRIES = 8  # of a slip system as kernels and forms read it: A11 A21 A12 A22, A : (F_n - I), c, kt, tau_n


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

    @staticmethod
    def of_entries(k: Float, n_i: Float) -> SlipSystem:
        """From entries (..., 8) in the order of kernel_abi.h, and the normals (..., 2)."""
        A_ij = np.swapaxes(k[..., :4].reshape(*k.shape[:-1], 2, 2), -1, -2)
        return SlipSystem(A_ij, k[..., 4], k[..., 5], k[..., 6], k[..., 7], n_i)

    def entries(self) -> Float:
        """(..., 8) entries in the order of kernel_abi.h."""
        A_k = np.swapaxes(self.A_ij, -1, -2).reshape(*self.bound.shape, 4)
        return np.concatenate([A_k, np.stack([self.AH, self.bound, self.stiffness, self.tau], axis=-1)], axis=-1)

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
            dissipated=np.maximum(0.0, tau * (dg - compliance * change)),  # below it is rounding
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

    def next_slip(self, shear_at: Callable[[Float], Float] | None = None) -> SlipSystem:
        """The slip systems of the step that begins at this state.

        Args:
            shear_at: gives the shear (n,) reached here at points (n, 2) of the reference configuration; what the step
                has led to by default.
        """
        tau_cq, X_cqx = self.response.tau, self.points.X_cqx
        if shear_at is not None:
            tau_cq = shear_at(X_cqx.reshape(-1, 2)).reshape(tau_cq.shape)
        return self.law.slip_system(self.points.F_cqij, self.points.parameters, tau_cq)


def shear_of(states: Iterable[FrictionStates]) -> tuple[Float, Float]:
    """Points (n, 2) of the reference configuration, and the shear (n,) reached there."""
    X, tau = [np.empty((0, 2))], [np.empty(0)]
    for each in states:
        X.append(each.points.X_cqx.reshape(-1, 2))
        tau.append(each.response.tau.ravel())
    return np.concatenate(X), np.concatenate(tau)


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
        where = np.nonzero(is_squeezed(F_cqij))
        F = F_cqij[where][:, None]
        values = {
            name: np.broadcast_to(value, tau_cq.shape)[where][:, None] if np.ndim(value) else value
            for name, value in parameters.items()
        }
        G = np.zeros((*F.shape, 2)) if self.stress.uses_second_gradient else None
        found = slip_system(F, self.stress.at(F, G, values)[0], self.friction, tau_cq[where][:, None])
        everywhere = {
            entry.name: _scattered(getattr(found, entry.name)[:, 0], where, tau_cq.shape) for entry in fields(found)
        }
        return SlipSystem(**everywhere | {"n_i": contact_directions(F_cqij)[0]})


def _scattered(values: Float, where: tuple[NDArray[np.intp], ...], shape: tuple[int, ...]) -> Float:
    """Values (n, ...) of some points among zeros."""
    everywhere = np.zeros((*shape, *values.shape[1:]))
    everywhere[where] = values
    return everywhere


def slip_system(F: Float, P_medium: Float, friction: Friction, tau: Float) -> SlipSystem:
    """The slip system of a step that begins at a state, at points with any leading axes.

    Args:
        F: (..., 2, 2) deformation gradients of the state.
        P_medium: (..., 2, 2) the medium's first Piola-Kirchhoff stress there, without its regulariser.
        friction: coefficient and elastic slip.
        tau: (...) Kirchhoff shear there; it is cut to the new bound.
    """
    n, s = contact_directions(F)
    pressure = np.maximum(0.0, -_dot(_times(np.swapaxes(P_medium, -1, -2), n), _times(np.swapaxes(F, -1, -2), n)))
    bound = np.where(is_squeezed(F), friction.coefficient * pressure, 0.0)
    A = _product(s, _solved(F, n)) + _product(n, _solved(F, s))
    A *= (bound > 0.0)[..., None, None]
    return SlipSystem(
        A_ij=A,
        AH=np.einsum("...ij,...ij->...", A, F - np.eye(2)),
        bound=bound,
        stiffness=bound / friction.elastic_slip,
        tau=np.clip(tau, -bound, bound),
        n_i=n,
    )


def _dot(a_i: Float, b_i: Float) -> Float:
    product: Float = np.einsum("...i,...i->...", a_i, b_i)
    return product


def _product(a_i: Float, b_j: Float) -> Float:
    product: Float = np.einsum("...i,...j->...ij", a_i, b_j)
    return product


def _times(A_ij: Float, v_j: Float) -> Float:
    product: Float = np.einsum("...ij,...j->...i", A_ij, v_j)
    return product


def _solved(F: Float, v_i: Float) -> Float:
    """``F^-1 v``."""
    solution = np.empty_like(v_i)
    solution[..., 0] = F[..., 1, 1] * v_i[..., 0] - F[..., 0, 1] * v_i[..., 1]
    solution[..., 1] = F[..., 0, 0] * v_i[..., 1] - F[..., 1, 0] * v_i[..., 0]
    solution /= _det(F)[..., None]
    return solution


def _det(F: Float) -> Float:
    J: Float = F[..., 0, 0] * F[..., 1, 1] - F[..., 0, 1] * F[..., 1, 0]
    return J


def contact_directions(F: Float) -> tuple[Float, Float]:
    """Normal and tangent (..., 2) of contact: the eigenvector of b = F F^T to its smallest eigenvalue, and that turned
    by a right angle. Slip turns it away from the surface's normal by at most half of the smallest stretch."""
    twice_shear, difference, _ = _left_cauchy_green(F)
    angle = 0.5 * np.arctan2(twice_shear, difference)  # of the largest one
    along, across = np.cos(angle), np.sin(angle)
    return np.stack([-across, along], axis=-1), np.stack([-along, -across], axis=-1)


def is_squeezed(F: Float) -> Bool:
    """(...) whether the medium is squeezed to a layer. A small stretch alone does not tell: shear in an open gap has
    one as well, with J about 1."""
    J = F[..., 0, 0] * F[..., 1, 1] - F[..., 0, 1] * F[..., 1, 0]
    squeezed: Bool = (smallest_stretch(F) < SQUEEZED) & (J < SQUEEZED)
    return squeezed


def smallest_stretch(F: Float) -> Float:
    """(...) smallest principal stretch: J by the largest one, which loses no digits where J is small."""
    twice_shear, difference, trace = _left_cauchy_green(F)
    largest = np.sqrt(0.5 * (trace + np.hypot(difference, twice_shear)))
    stretch: Float = _det(F) / largest
    return stretch


def _left_cauchy_green(F: Float) -> tuple[Float, Float, Float]:
    """``2 b12``, ``b11 - b22`` and ``b11 + b22`` of b = F F^T."""
    x, y = F[..., 0, :], F[..., 1, :]
    b11, b22 = _dot(x, x), _dot(y, y)
    return 2.0 * _dot(x, y), b11 - b22, b11 + b22
