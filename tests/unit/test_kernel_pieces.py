"""Piecewise polynomials in kernels: the same numbers as with monomials on every sub-triangle."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_mesh import SHAPES, regular
from test_kernel_cells import PARAMETERS, kernel_of, run

from codegen.integrand import second_gradient_energy
from tmc_vem.energy import DENSITIES
from tmc_vem.vem.kernel.batch import CellBatch
from tmc_vem.vem.kernel.by_parameters import compile_cells_by_parameters
from tmc_vem.vem.kernel.packs import packed
from tmc_vem.vem.kernel.pieces import Pieces
from tmc_vem.vem.spaces import monomials
from tmc_vem.vem.spaces.composite import CompositeSpace
from tmc_vem.vem.spaces.piecewise import PiecewiseGradients
from tmc_vem.vem.spaces.quadrature import sub_triangles
from tmc_vem.vem.spaces.rules import CellRule, on_sub_triangles
from tmc_vem.vem.spaces.spaces import Shapes

CASES = {
    "pentagons": (SHAPES["pentagon"], 2, 3),
    "hexagons": (regular(6), 2, 4),
    "of order 3": (SHAPES["hexagon"], 3, 6),
    "not star-shaped, of order 4": (SHAPES["U"], 4, 8),
}


def shapes_and_rule(
    polygon: np.ndarray, k: int, degree: int, n: int, rng: np.random.Generator
) -> tuple[Shapes, CellRule]:
    """Different polygons of one kind, and the rule on their sub-triangles."""
    turns = rng.uniform(0.0, 2.0 * np.pi, n)
    turned = [polygon @ np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]]) for a in turns]
    polygons = np.stack(turned) * rng.uniform(0.5, 2.0, n)[:, None, None]
    ((_, triangles),) = sub_triangles(polygons)
    return Shapes.of(polygons, triangles, k, k + 1), on_sub_triangles(triangles, degree)


def by_monomials(gradients: PiecewiseGradients, shapes: Shapes, rule: CellRule, **cells: np.ndarray) -> CellBatch:
    """Batch whose gradients are polynomials in the scaled coordinates, fitted to the values at the rule's points."""
    assert rule.on_pieces is not None
    h_s, n, t = gradients.h_s, len(shapes), gradients.n_pieces
    xi = (rule.points_sqx - shapes.geometry.centroid_cx[:, None]) / h_s[:, None, None]
    values = monomials.values(shapes.order, xi).reshape(n, t, -1, monomials.dimension(shapes.order))
    rows = gradients.rows_of_rule(rule.on_pieces).reshape(*values.shape[:3], -1)
    first = (np.linalg.pinv(values) @ rows).reshape(n, t, values.shape[3], 2, -1)
    np.testing.assert_allclose((values @ first.reshape(n, t, values.shape[3], -1)), rows, atol=1e-9)
    return CellBatch.pack(
        **cells, piece_q=rule.piece_q, w_sq=rule.w_sq, xi_sqx=xi, h_s=h_s, gradient_stxma=np.moveaxis(first, 3, 2),
        second_sxma=gradients.second_sxma,
    )  # fmt: skip


def as_they_are(gradients: PiecewiseGradients, rule: CellRule, **cells: np.ndarray) -> CellBatch:
    """Batch that keeps the coefficients inside and the corners."""
    assert rule.on_pieces is not None
    return CellBatch(
        shape_c=cells["shape_c"].astype(np.int32), nodes_ca=cells["nodes_ca"].astype(np.int32),
        piece_q=rule.piece_q.astype(np.int32), w_sp=None, xi_sp=None, inverse_h_sp=packed(1.0 / gradients.h_s),
        gradient_sp=packed(gradients.inside_sba), second_sp=packed(gradients.second_sxma),
        gradient_degree=gradients.degree, second_degree=monomials.degree_of(gradients.second_sxma.shape[2]),
        n_pieces=gradients.n_pieces, corners_sp=packed(gradients.corners_sdx),
        pieces=Pieces(gradients.topology, rule.on_pieces),
    )  # fmt: skip


@pytest.mark.parametrize("name", ["solid", "medium_angle_damped"])
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("in_place", [True, False])
def test_kernels_take_piecewise_polynomials_as_they_are(name: str, case: str, in_place: bool) -> None:
    """Where the shapes are a pack, and where they are gathered."""
    rng = np.random.default_rng(len(case))
    (polygon, k, degree), n_cells, kernel = CASES[case], 19, kernel_of(name)
    shapes, rule = shapes_and_rule(np.array(polygon, dtype=float), k, degree, n_cells, rng)
    gradients = CompositeSpace(k).gradients(shapes)
    n = gradients.n_basis
    cells = {
        "shape_c": np.arange(n_cells) if in_place else rng.permutation(n_cells),
        "nodes_ca": rng.permutation(n_cells * n).reshape(n_cells, n),
    }
    expected, found = by_monomials(gradients, shapes, rule, **cells), as_they_are(gradients, rule, **cells)
    u, du = rng.normal(scale=1e-3 / n, size=(2, n_cells * n, 2))
    for one, other in zip(run(kernel, expected, u)[1:], run(kernel, found, u)[1:], strict=True):
        np.testing.assert_allclose(other, one, rtol=0, atol=1e-10 * np.abs(one).max())
    values, alone, parameters = run(kernel, expected, u)[0], np.zeros_like(u), kernel.parameter_array(PARAMETERS)
    below = kernel.cells(found, u, parameters, alone)  # no rows of the basis below the tangent
    residual = run(kernel, expected, u)[1]
    np.testing.assert_allclose(alone, residual, rtol=0, atol=1e-10 * np.abs(residual).max())
    for energies in (below, kernel.cells(found, u, parameters), run(kernel, found, u)[0]):
        np.testing.assert_allclose(energies.energy_c, values.energy_c, rtol=1e-10)
        np.testing.assert_allclose(energies.min_j_c, values.min_j_c, rtol=1e-11)
    np.testing.assert_allclose(kernel.max_step(found, u, 90.0 * du), kernel.max_step(expected, u, 90.0 * du), rtol=1e-8)

    shapes_asked = np.array([3, 0, 17])
    for one, other in zip(expected.points(shapes_asked), found.points(shapes_asked), strict=True):
        np.testing.assert_allclose(other, one, rtol=0, atol=1e-13)
    piece_q, h_s = rule.piece_q, gradients.h_s[shapes_asked]
    rows = [b.gradients(shapes_asked).rows(h_s, expected.points(shapes_asked)[0], piece_q) for b in (expected, found)]
    np.testing.assert_allclose(rows[1], rows[0], rtol=0, atol=1e-10 * np.abs(rows[0]).max())
    assert found.take(slice(4)).pieces is found.pieces
    assert found.nbytes < 0.6 * expected.nbytes


@pytest.mark.parametrize("with_adjoint", [True, False])
def test_derivatives_by_parameters_are_those_of_the_same_gradients(with_adjoint: bool) -> None:
    rng = np.random.default_rng(5)
    energy, n_cells = DENSITIES["medium_angle_damped"], 11
    kernel = compile_cells_by_parameters(second_gradient_energy(energy.density, energy.name, energy.parameters))
    shapes, rule = shapes_and_rule(regular(6), 2, 4, n_cells, rng)
    gradients = CompositeSpace(2).gradients(shapes)
    n = gradients.n_basis
    cells = {"shape_c": rng.permutation(n_cells), "nodes_ca": np.arange(n_cells * n).reshape(n_cells, n)}
    u, adjoint = rng.normal(scale=0.01 / n, size=(2, n_cells * n, 2))
    both = [
        kernel.cells(batch, u, kernel.parameter_array(PARAMETERS), adjoint if with_adjoint else None)
        for batch in (by_monomials(gradients, shapes, rule, **cells), as_they_are(gradients, rule, **cells))
    ]
    for one, other in zip(*both, strict=True):
        np.testing.assert_allclose(other, one, rtol=0, atol=1e-10 * max(np.abs(one).max(), 1e-300))
