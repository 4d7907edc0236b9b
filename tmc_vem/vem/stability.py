"""Whether an element is stable: the energy of its modes against that of an element with stabilisation.

The tangent K of plane elasticity at F = I is compared with that of a conventional virtual element with stabilisation,
R, which has full rank on any polygon. The eigenvalues of ``K x = lambda R x`` depend neither on the size of the cell
nor on the scaling of its degrees of freedom, and edges short or long count alike. Rigid motions have no energy in
either.
"""

from __future__ import annotations

import contextlib

import numpy as np
from numpy.typing import NDArray

from tmc_vem.vem.projector import PolygonGeometry, dofs_of_monomials, elliptic_projector, gradient_projector
from tmc_vem.vem.spaces import Shapes
from tmc_vem.vem.tables import Tables

Float = NDArray[np.float64]
Int = NDArray[np.int64]

RIGID_MODES = 3
# Modes with a smaller energy than this fraction of what the reference gives them are spurious.
SPURIOUS = 1e-5
CHUNK = 64  # cells whose matrices stay in the second-level cache


def stability_constants(polygons_svx: Float, tables: Tables, k: int) -> Float:
    """Generalised eigenvalues (n_shapes, 2 n_basis - 3), ascending, without those of the rigid motions."""
    geometry = PolygonGeometry.of(polygons_svx, k)
    tangent = element_tangent(tables)
    spectrum, modes = np.linalg.eigh(stabilised_tangent(geometry, elliptic_projector(geometry, k), k))
    scaled = modes[:, :, RIGID_MODES:] / np.sqrt(spectrum[:, None, RIGID_MODES:])
    constants: Float = np.linalg.eigvalsh(np.swapaxes(scaled, 1, 2) @ tangent @ scaled)
    return constants


def spurious_modes(constants_sm: Float) -> Int:
    """(n_shapes,) number of modes with no, or hardly any, energy besides the three rigid motions."""
    count: Int = (constants_sm < SPURIOUS).sum(axis=1)
    return count


class StabilityTest:
    """Asks of many shapes whether all their constants reach a bound, which takes no eigenvalues.

    They do if K - least R is positive definite once the rigid motions, the common kernel, are lifted.

    Args:
        shapes: the polygons.
    """

    def __init__(self, shapes: Shapes) -> None:
        geometry, k = shapes.geometry, shapes.order
        self._reference = stabilised_tangent(geometry, shapes.elliptic_cad, k)
        one, xi, eta = np.moveaxis(dofs_of_monomials(geometry, k)[:, :, :3], 2, 0)
        zero = np.zeros_like(one)
        motions = np.stack([np.hstack([one, zero]), np.hstack([zero, one]), np.hstack([-eta, xi])], axis=2)
        motions /= np.linalg.norm(motions, axis=1, keepdims=True)
        size = np.einsum("saa->s", self._reference) / self._reference.shape[1]
        self._lifted = size[:, None, None] * (motions @ np.swapaxes(motions, 1, 2))

    def passes(self, tables: Tables, chosen: Int, least: float) -> NDArray[np.bool_]:
        """Whether each of the ``chosen`` shapes, whose tables are given, has no constant below ``least``."""
        result = np.empty(len(chosen), dtype=bool)
        for first in range(0, len(chosen), CHUNK):
            part = slice(first, first + CHUNK)
            at = chosen[part]
            tangent = element_tangent(tables.take(np.arange(len(chosen))[part]))
            result[part] = positive_definite(tangent - least * self._reference[at] + self._lifted[at])
        return result


def positive_definite(matrices_sab: Float) -> NDArray[np.bool_]:
    """Whether symmetric matrices are positive definite.

    numpy's factorisation of all stops at the first one that is not; then they are tried one by one.
    """
    from scipy.linalg.lapack import dpotrf

    if np.isfinite(matrices_sab).all():
        with contextlib.suppress(np.linalg.LinAlgError):
            np.linalg.cholesky(matrices_sab)
            return np.ones(len(matrices_sab), dtype=bool)
    return np.array([np.isfinite(a).all() and dpotrf(a.T, overwrite_a=1, clean=0)[1] == 0 for a in matrices_sab])


def element_tangent(tables: Tables) -> Float:
    """Tangent (n_shapes, 2 n_basis, 2 n_basis) of plane elasticity with the quadrature of the element."""
    gradient = np.moveaxis(tables.rows(2), 2, 0)
    return elastic_tangent(gradient, gradient * tables.w_sq[..., None])


def elastic_tangent(gradient_xsqa: Float, weighted_xsqa: Float) -> Float:
    """Tangent (n_shapes, 2 n, 2 n) of plane elasticity with lambda = mu = 1, all x components first."""
    d, w = gradient_xsqa, weighted_xsqa
    xx, yy, xy = (np.swapaxes(d[i], 1, 2) @ w[j] for i, j in ((0, 0), (1, 1), (0, 1)))
    n = xx.shape[1]
    tangent = np.empty((len(xx), 2 * n, 2 * n))
    tangent[:, :n, :n], tangent[:, n:, n:] = 3.0 * xx + yy, 3.0 * yy + xx
    tangent[:, :n, n:] = tangent[:, n:, :n] = xy + np.swapaxes(xy, 1, 2)
    return tangent


def stabilised_tangent(geometry: PolygonGeometry, elliptic_sad: Float, k: int) -> Float:
    """Elastic tangent of the virtual element with Pi0_(k-1) grad and the diagonal recipe for the stabilisation.

    The recipe, ``sum_i max(1, K_ii) dof_i(v - Pi v)^2``, is that of Beirao da Veiga, Dassi & Russo (2017) for high k.
    """
    gradient = np.stack(gradient_projector(geometry, k, k - 1, elliptic_sad))
    mass = geometry.mass(k - 1) * geometry.diameter_c[:, None, None] ** 2
    reference = elastic_tangent(gradient, mass @ gradient)
    remainder = np.eye(elliptic_sad.shape[2]) - dofs_of_monomials(geometry, k) @ elliptic_sad
    n_basis = len(remainder[0])
    weight = np.maximum(1.0, np.einsum("caa->ca", reference)[:, :n_basis])
    stabilisation = np.swapaxes(remainder, 1, 2) @ (weight[:, :, None] * remainder)
    reference[:, :n_basis, :n_basis] += stabilisation
    reference[:, n_basis:, n_basis:] += stabilisation
    return reference
