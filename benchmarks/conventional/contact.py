"""Frictionless penalty contact of deformed quadratic sides.

Where a point x of one face lies within the other body, at the distance d from the nearest point of its face, its
energy is ``penalty w d^2 / 2`` with w its share of the undeformed length. As d^2 is the smallest |x - y(xi)|^2, its
gradient is that of the square at fixed xi, and its tangent that of the square less the term of the elimination of xi;
no derivative of the normal is needed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix

from conventional.lagrange import line

Float = NDArray[np.float64]
Int = NDArray[np.int64]
SAMPLES = np.linspace(-1.0, 1.0, 7)
PROJECTIONS = 30  # Newton iterations of the nearest point at most


def rule(name: str) -> tuple[Float, Float]:
    """Points and weights on [-1, 1]: 'nodes' (Simpson), 'gauss N', or 'middles N' (N equal parts).

    Raises:
        ValueError: another name.
    """
    kind, _, count = name.partition(" ")
    if kind == "nodes":
        return np.array([-1.0, 0.0, 1.0]), np.array([1.0, 4.0, 1.0]) / 3
    if kind == "gauss":
        return np.polynomial.legendre.leggauss(int(count))
    if kind == "middles":
        n = int(count)
        return (2 * np.arange(n) + 1.0) / n - 1.0, np.full(n, 2.0 / n)
    raise ValueError(f"rule = {name!r}: use 'nodes', 'gauss N' or 'middles N'")


@dataclass(frozen=True)
class Touching:
    """Points within the other body.

    Attributes:
        slave_mk, N_mk: (m, 3) nodes of each point's side, and their functions there.
        master_mk, M_mk, dM_mk, ddM_mk: (m, 3) the same of the side opposite, at the nearest point, with derivatives.
        inner_m: (m,) whether that is within its side and no end of it.
        w_m: (m,) shares of the undeformed length.
        d_mi: (m, 2) from the nearest point to the point.
    """

    slave_mk: Int
    N_mk: Float
    master_mk: Int
    M_mk: Float
    dM_mk: Float
    ddM_mk: Float
    inner_m: NDArray[np.bool_]
    w_m: Float
    d_mi: Float


@dataclass(frozen=True)
class Contact:
    """One face's points against another face.

    Attributes:
        X_ni: undeformed nodes of all bodies.
        slave_sk, master_sk: (n, 3) nodes of the sides (end, middle, end), the body on the left; those of the master
            follow each other along a chain.
        penalty: force per area and length.
        points: name of a :func:`rule`.
        depth: points deeper than this are not within the other body but behind it.
    """

    X_ni: Float
    slave_sk: Int
    master_sk: Int
    penalty: float
    points: str = "gauss 4"
    depth: float = np.inf

    def _slave_points(self) -> tuple[Int, Float, Float]:
        """Nodes (m, 3) of each point's side, functions (m, 3) there, shares of the undeformed length (m,)."""
        xi, w = rule(self.points)
        N_qk, dN_qk, _ = line(xi)
        stretch = np.linalg.norm(np.einsum("qk,ski->sqi", dN_qk, self.X_ni[self.slave_sk]), axis=-1)
        n = len(self.slave_sk)
        return np.repeat(self.slave_sk, len(xi), axis=0), np.tile(N_qk, (n, 1)), (w * stretch).ravel()

    def touching(self, u_ni: Float) -> Touching:
        """The points that are within the other body."""
        x_ni = self.X_ni + u_ni
        slave, N, w = self._slave_points()
        x_mi = np.einsum("mk,mki->mi", N, x_ni[slave])
        side, xi = nearest(x_mi, x_ni[self.master_sk])
        M, dM, ddM = line(xi)
        y_mki = x_ni[self.master_sk[side]]
        d = x_mi - np.einsum("mk,mki->mi", M, y_mki)
        normal = _outward(self.master_sk, x_ni, side, xi)
        inner = np.abs(xi) < 1.0
        last = len(self.master_sk) - 1
        beyond = ((side == 0) & (xi <= -1.0)) | ((side == last) & (xi >= 1.0))
        depth = -np.einsum("mi,mi->m", normal, d)
        m = np.flatnonzero((depth > 0.0) & (np.linalg.norm(d, axis=1) < self.depth) & ~beyond)
        return Touching(slave[m], N[m], self.master_sk[side[m]], M[m], dM[m], ddM[m], inner[m], w[m], d[m])

    def energy(self, u_ni: Float) -> float:
        """Energy of the penetration."""
        found = self.touching(u_ni)
        return float(self.penalty / 2 * found.w_m @ np.einsum("mi,mi->m", found.d_mi, found.d_mi))

    def forces(self, u_ni: Float) -> Float:
        """(2 n,) derivative of :meth:`energy`."""
        found = self.touching(u_ni)
        r = np.zeros(2 * len(self.X_ni))
        on_point = self.penalty * found.w_m[:, None] * found.d_mi
        both = np.concatenate([found.N_mk, -found.M_mk], axis=1)
        np.add.at(r, _dofs(found).ravel(), np.einsum("mk,mi->mki", both, on_point).ravel())
        return r

    def tangent(self, u_ni: Float) -> csr_matrix:
        """Derivative of :meth:`forces` where no point begins or ceases to touch."""
        found = self.touching(u_ni)
        n = 2 * len(self.X_ni)
        both = np.concatenate([found.N_mk, -found.M_mk], axis=1)
        size = 12
        K = np.einsum("ma,mb,ij->maibj", both, both, np.eye(2)).reshape(-1, size, size)
        y_mki = (self.X_ni + u_ni)[found.master_mk]
        t, c = (np.einsum("mk,mki->mi", f, y_mki) for f in (found.dM_mk, found.ddM_mk))
        zero = np.zeros_like(found.dM_mk)
        rate = np.concatenate([zero, found.dM_mk], axis=1)
        # d/dq d/dxi of |d|^2 / 2, and its second derivative by xi
        mixed = -np.einsum("ma,mi->mai", both, t) - np.einsum("ma,mi->mai", rate, found.d_mi)
        curvature = np.einsum("mi,mi->m", t, t) - np.einsum("mi,mi->m", found.d_mi, c)
        flat = mixed.reshape(-1, size)
        K -= (found.inner_m / curvature)[:, None, None] * flat[:, :, None] * flat[:, None, :]
        K *= self.penalty * found.w_m[:, None, None]
        dofs = _dofs(found)
        rows, columns = np.repeat(dofs, size, axis=1), np.tile(dofs, (1, size))
        return coo_matrix((K.ravel(), (rows.ravel(), columns.ravel())), shape=(n, n)).tocsr()

    def pressure(self, u_ni: Float) -> tuple[Float, Float, Float]:
        """Deformed places (m, 2), nominal pressures (m,) and shares of the undeformed length (m,) where it touches."""
        found = self.touching(u_ni)
        x_mi = np.einsum("mk,mki->mi", found.N_mk, (self.X_ni + u_ni)[found.slave_mk])
        return x_mi, self.penalty * np.linalg.norm(found.d_mi, axis=1), found.w_m


def nearest(x_mi: Float, y_ski: Float) -> tuple[Int, Float]:
    """Side (m,) and position xi (m,) on it of the point of a chain of sides (s, 3, 2) next to each point (m, 2)."""
    N, _, _ = line(SAMPLES)
    samples = np.einsum("pk,ski->spi", N, y_ski)
    distance = np.linalg.norm(x_mi[:, None, None] - samples, axis=-1)
    best = distance.reshape(len(x_mi), -1).argmin(axis=1)
    start, sample = np.divmod(best, len(SAMPLES))
    found_side, found_xi, found_d = start, SAMPLES[sample], distance.reshape(len(x_mi), -1).min(axis=1)
    for shift in (0, -1, 1):
        side = np.clip(start + shift, 0, len(y_ski) - 1)
        xi = _on_side(x_mi, y_ski[side], SAMPLES[sample] - 2.0 * shift)
        d = np.linalg.norm(x_mi - np.einsum("mk,mki->mi", line(xi)[0], y_ski[side]), axis=1)
        closer = d < found_d
        found_side, found_xi = np.where(closer, side, found_side), np.where(closer, xi, found_xi)
        found_d = np.minimum(d, found_d)
    return found_side, found_xi


def _on_side(x_mi: Float, y_mki: Float, start_m: Float) -> Float:
    """xi of the nearest point within [-1, 1] of each point's own side, by Newton's method."""
    xi = np.clip(start_m, -1.0, 1.0)
    for _ in range(PROJECTIONS):
        M, dM, ddM = line(xi)
        d = x_mi - np.einsum("mk,mki->mi", M, y_mki)
        t, c = np.einsum("mk,mki->mi", dM, y_mki), np.einsum("mk,mki->mi", ddM, y_mki)
        speed = np.einsum("mi,mi->m", t, t)
        slope = speed - np.einsum("mi,mi->m", d, c)
        step = np.einsum("mi,mi->m", d, t) / np.where(slope > 0.1 * speed, slope, speed)
        new = np.clip(xi + step, -1.0, 1.0)
        if np.abs(new - xi).max(initial=0.0) < 1e-14:
            return new
        xi = new
    return xi


def _outward(master_sk: Int, x_ni: Float, side: Int, xi: Float) -> Float:
    """(m, 2) unit normals out of the body; at a node between two sides the mean of both."""
    total = np.zeros((len(side), 2))
    last = len(master_sk) - 1
    for shift, here in ((0, np.ones(len(side), dtype=bool)), (-1, xi <= -1.0), (1, xi >= 1.0)):
        other = side + shift
        here = here & (other >= 0) & (other <= last)
        at = np.where(shift == 0, xi, -xi)
        t = np.einsum("mk,mki->mi", line(at)[1], x_ni[master_sk[np.clip(other, 0, last)]])
        normal = np.stack([t[:, 1], -t[:, 0]], axis=1) / np.linalg.norm(t, axis=1)[:, None]
        total += np.where(here[:, None], normal, 0.0)
    found: Float = total / np.linalg.norm(total, axis=1)[:, None]
    return found


def _dofs(found: Touching) -> Int:
    """(m, 12) degrees of freedom of the point's side and the side opposite."""
    nodes = np.concatenate([found.slave_mk, found.master_mk], axis=1)
    return (2 * nodes[:, :, None] + np.arange(2)).reshape(len(nodes), 12)


def both_ways(X_ni: Float, one_sk: Int, other_sk: Int, penalty: float, points: str, depth: float) -> Sequence[Contact]:
    """Points of both faces, each with half the penalty, so that neither is preferred.

    Uniform pressure is found exactly where the faces' nodes match, and else to the accuracy with which the points of
    one side integrate functions of the other face: 5e-4 with three points on two sides against three.
    """
    return [
        Contact(X_ni, one_sk, other_sk, penalty / 2, points, depth),
        Contact(X_ni, other_sk, one_sk, penalty / 2, points, depth),
    ]
