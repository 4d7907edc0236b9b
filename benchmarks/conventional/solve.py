"""Equilibria of bodies in contact along a path of prescribed displacements."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import splu

from conventional.body import Body
from conventional.contact import Contact

Float = NDArray[np.float64]
ITERATIONS = 60
SMALLEST_STEP = 2.0**-12  # of the line search


class NotConvergedError(RuntimeError):
    """No equilibrium was found at a load."""


@dataclass
class System:
    """Bodies, contacts and prescribed degrees of freedom.

    Attributes:
        body: all bodies, as one set of cells.
        contacts: pairs of faces.
        held: degrees of freedom (2 node + component) with their displacement at load 1.
        iterations: of Newton's method, so far.
    """

    body: Body
    contacts: Sequence[Contact]
    held: Mapping[int, float]
    iterations: int = field(default=0, init=False)

    def energy(self, u: Float) -> float:
        """Potential of the displacements (2 n,)."""
        u_ni = u.reshape(-1, 2)
        inside = self.body.energy(u_ni)
        return inside + sum(contact.energy(u_ni) for contact in self.contacts) if np.isfinite(inside) else inside

    def forces(self, u: Float) -> Float:
        """(2 n,) its derivative: 0 at free, the support's force at held degrees of freedom."""
        u_ni = u.reshape(-1, 2)
        total: Float = self.body.forces(u_ni) + sum(contact.forces(u_ni) for contact in self.contacts)
        return total

    def tangent(self, u: Float) -> csr_matrix:
        """Derivative of :meth:`forces`."""
        u_ni = u.reshape(-1, 2)
        total: csr_matrix = self.body.tangent(u_ni) + sum(contact.tangent(u_ni) for contact in self.contacts)
        return total

    def equilibrium(self, u: Float, load: float, tolerance: float = 1e-11) -> Float:
        """Displacements (2 n,) at a load, by Newton's method from those at another.

        Raises:
            NotConvergedError: not within 60 iterations, or no step has J > 0.
        """
        held = np.array(list(self.held), dtype=np.int64)
        free = np.setdiff1d(np.arange(len(u)), held)
        u = u.copy()
        jump = load * np.array(list(self.held.values())) - u[held]
        r = self.forces(u)
        rounding = 1e-14 * float(self.body.K_c.max() * np.ptp(self.body.X_ni))  # of forces before anything touches
        for iteration in range(ITERATIONS):
            K = self.tangent(u)
            step = np.zeros_like(u)
            step[held] = jump
            right = -r[free] - K[free][:, held] @ jump
            step[free] = splu(K[free][:, free].tocsc()).solve(right)
            self.iterations += 1
            fraction = self._fraction(u, r, step, moving=iteration == 0)
            u = u + fraction * step
            if not np.isfinite(self.energy(u)):
                raise NotConvergedError(f"no admissible step at load {load:g}: a cell would be turned inside out")
            jump = jump * (1.0 - fraction)
            r = self.forces(u)
            scale = np.abs(r[held]).max()
            if not jump.any() and np.abs(r[free]).max() <= max(tolerance * scale, rounding):
                return u
        raise NotConvergedError(f"no equilibrium at load {load:g} within {ITERATIONS} iterations")

    def _fraction(self, u: Float, r: Float, step: Float, moving: bool) -> float:
        """Part of a step to take: one with J > 0 while held nodes move, then one that lowers the potential."""
        fraction, slope, start = 1.0, float(r @ step), self.energy(u)
        while fraction > SMALLEST_STEP:
            value = self.energy(u + fraction * step)
            rounding = 1e-13 * abs(start)
            if np.isfinite(value) and (moving or value <= start + 1e-4 * fraction * slope + rounding):
                return fraction
            fraction /= 2
        return 1.0 if np.isfinite(self.energy(u + step)) else fraction

    def path(self, loads: Sequence[float], report: Callable[[float, Float], None], largest: float = 0.05) -> Float:
        """Follow the path through all loads, in steps of at most ``largest``; tell ``report`` load and displacements.

        Raises:
            NotConvergedError: a step failed however small it was made.
        """
        u, at = np.zeros(2 * len(self.body.X_ni)), 0.0
        for load in loads:
            step = largest
            while abs(load - at) > 1e-12:
                target = load if abs(load - at) <= step * (1 + 1e-9) else at + step * np.sign(load - at)
                try:
                    u, at, step = self.equilibrium(u, float(target)), float(target), min(largest, 2 * step)
                except NotConvergedError:
                    step /= 2
                    if step < 1e-4 * largest:
                        raise
            report(load, u)
        return u
