"""Whether an element is stable: the energy of its modes against that of an element with stabilisation.

The tangent K of plane elasticity at F = I is compared with that of a conventional virtual element with stabilisation,
R, which has full rank on any polygon. The eigenvalues of ``K x = lambda R x`` depend neither on the size of the cell
nor on the scaling of its degrees of freedom, and edges short or long count alike. Rigid motions have no energy in
either.
"""

from __future__ import annotations

from functools import cached_property
from math import comb

import numpy as np
from numpy.typing import NDArray

from tmc_vem.vem.spaces import monomials
from tmc_vem.vem.spaces.piecewise import PiecewiseGradients
from tmc_vem.vem.spaces.projector import PolygonGeometry, dofs_of_monomials, elliptic_projector, gradient_projector
from tmc_vem.vem.spaces.spaces import Gradients, Shapes
from tmc_vem.vem.spaces.tabulated import Tables

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
        self._shapes = shapes

    def passes(
        self, tables: Tables, chosen: Int, least: float, known_to: NDArray[np.bool_] | None = None
    ) -> NDArray[np.bool_]:
        """Whether each of the ``chosen`` shapes, whose tables are given, has no constant below ``least``.

        Args:
            tables: of the chosen shapes.
            chosen: (n,) positions among all shapes.
            least: the bound.
            known_to: (n,) those that are known to pass.
        """
        result = np.ones(len(chosen), dtype=bool)
        (asked,) = np.nonzero(np.ones(len(chosen), dtype=bool) if known_to is None else ~known_to)
        for first in range(0, len(asked), CHUNK):
            part = asked[first : first + CHUNK]
            matrices = element_tangent(tables.take(part))
            reference, motions = self._compared_with
            matrices -= least * reference[chosen[part]]
            motions = motions[chosen[part]]
            matrices += np.swapaxes(motions, 1, 2) @ motions
            result[part] = positive_definite(matrices)
        return result

    @cached_property
    def _compared_with(self) -> tuple[Float, Float]:
        """Tangent (n_shapes, 2 n, 2 n) of the reference, and rigid motions (n_shapes, 3, 2 n) of a comparable size."""
        geometry, k = self._shapes.geometry, self._shapes.order
        reference = stabilised_tangent(geometry, self._shapes.elliptic_cad, k)
        one, xi, eta = np.moveaxis(dofs_of_monomials(geometry, k)[:, :, :3], 2, 0)
        zero = np.zeros_like(one)
        motions = np.stack([np.hstack([one, zero]), np.hstack([zero, one]), np.hstack([-eta, xi])], axis=1)
        size = np.einsum("saa->s", reference) / reference.shape[1]
        motions *= np.sqrt(size[:, None] / np.einsum("sma,sma->sm", motions, motions))[:, :, None]
        return reference, motions


def positive_definite(matrices_sab: Float) -> NDArray[np.bool_]:
    """Whether symmetric matrices, which are overwritten, are positive definite."""
    from scipy.linalg.lapack import dpotrf

    finite = np.isfinite(matrices_sab).all(axis=(1, 2)).tolist()
    # symmetric matrices are their own transposes, which LAPACK takes in place
    columns = np.swapaxes(matrices_sab, 1, 2)
    return np.array(
        [f and dpotrf(a, overwrite_a=1, clean=0)[1] == 0 for f, a in zip(finite, columns, strict=True)], bool
    )


def element_tangent(tables: Tables) -> Float:
    """Tangent (n_shapes, 2 n_basis, 2 n_basis) of plane elasticity with the quadrature of the element."""
    gradients = tables.gradients
    if isinstance(gradients, PiecewiseGradients) and tables.on_pieces is not None:
        return _from_rows(gradients.rows_of_rule(tables.on_pieces), tables.w_sq)
    if not isinstance(gradients, Gradients) or not _has_fewer_monomials(gradients, tables.w_sq.shape[1]):
        return _from_rows(tables.rows(2), tables.w_sq)
    # sums over points are products with the monomials' mass matrix
    m = gradients.values(tables.xi_sqx)[:, 0]
    mass = np.swapaxes(m, 1, 2) @ (m * tables.w_sq[..., None])
    coefficients = np.moveaxis(gradients.first_stxma[:, 0], 1, 0)
    return elastic_tangent(coefficients, mass @ coefficients)


def _has_fewer_monomials(gradients: Gradients, n_points: int) -> bool:
    _, n_pieces, _, n_m, _ = gradients.first_stxma.shape
    return n_pieces == 1 and n_m < n_points


def _from_rows(rows_sqxa: Float, w_sq: Float) -> Float:
    gradient_xsqa = np.moveaxis(rows_sqxa, 2, 0)
    return elastic_tangent(gradient_xsqa, gradient_xsqa * w_sq[..., None])


def elastic_tangent(gradient_xsqa: Float, weighted_xsqa: Float) -> Float:
    """Tangent (n_shapes, 2 n, 2 n) of plane elasticity with lambda = mu = 1, all x components first."""
    d, w = gradient_xsqa, weighted_xsqa
    xx, yy, xy = (np.swapaxes(d[i], 1, 2) @ w[j] for i, j in ((0, 0), (1, 1), (0, 1)))
    n = xx.shape[1]
    tangent = np.empty((len(xx), 2 * n, 2 * n))
    both = xx + yy
    tangent[:, :n, :n], tangent[:, n:, n:] = both + 2.0 * xx, both + 2.0 * yy
    tangent[:, :n, n:] = tangent[:, n:, :n] = xy + np.swapaxes(xy, 1, 2)
    return tangent


def stabilised_tangent(geometry: PolygonGeometry, elliptic_sad: Float, k: int) -> Float:
    """Elastic tangent of the virtual element with Pi0_(k-1) grad and the diagonal recipe for the stabilisation.

    The recipe, ``sum_i max(1, K_ii) dof_i(v - Pi v)^2``, is that of Beirao da Veiga, Dassi & Russo (2017) for high k.
    ``K_ii`` is the mean over everything that rotations mix, see :func:`_diagonal`, so that the eigenvalues do not
    depend on how a cell is turned or reflected.
    """
    gradient = np.stack(gradient_projector(geometry, k, k - 1, elliptic_sad))
    mass = geometry.mass(k - 1) * geometry.diameter_c[:, None, None] ** 2
    reference = elastic_tangent(gradient, mass @ gradient)
    remainder = np.eye(elliptic_sad.shape[2]) - dofs_of_monomials(geometry, k) @ elliptic_sad
    n_basis = len(remainder[0])
    binomial = _binomials(n_basis, k)
    weight = np.maximum(1.0, _diagonal(reference, binomial, k)) * binomial
    stabilisation = np.swapaxes(remainder, 1, 2) @ (weight[:, :, None] * remainder)
    reference[:, :n_basis, :n_basis] += stabilisation
    reference[:, n_basis:, n_basis:] += stabilisation
    return reference


def _diagonal(tangent_sab: Float, binomial_a: Float, k: int) -> Float:
    """Diagonal (n_shapes, n_basis) of a tangent, the mean of both components and of all moments of one degree.

    Rotations mix the components, and the moments of one degree. With ``m_a = xi^(d - b) eta^b``, the squares of the
    moments times the binomials of d and b add up to an invariant, as do the K_aa divided by them.
    """
    n_basis = len(binomial_a)
    both = np.einsum("caa->ca", tangent_sab).reshape(-1, 2, n_basis)
    diagonal: Float = both.mean(axis=1) / binomial_a
    first = n_basis - monomials.dimension(k - 2)
    for d in range(k - 1):
        alike = slice(first + monomials.dimension(d - 1), first + monomials.dimension(d))
        diagonal[:, alike] = diagonal[:, alike].mean(axis=1, keepdims=True)
    return diagonal


def _binomials(n_basis: int, k: int) -> Float:
    """(n_basis,) 1 for values, and for the moment with ``xi^a eta^b`` the number of ways to order its factors."""
    powers = monomials.exponents(k - 2).tolist()
    return np.concatenate([np.ones(n_basis - len(powers)), [float(comb(a + b, b)) for a, b in powers]])
