"""The table that the order of the monomials is known by: against their exponents, and against another order."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_oracle import powers
from test_kernel_cells import kernel_of, random_batch, run

from tmc_vem.vem.kernel.batch import CellBatch
from tmc_vem.vem.spaces import monomials

DEGREES = [0, 1, 2, 3, 5]


@pytest.mark.parametrize("degree", DEGREES)
def test_products_with_the_coordinates_are_where_the_table_says(degree):
    table, higher = monomials.raised(degree), powers(degree + 1)
    assert table.position_mx.shape == (monomials.dimension(degree), 2)
    for m, (a, b) in enumerate(powers(degree)):
        assert [higher[n] for n in table.position_mx[m]] == [(a + 1, b), (a, b + 1)]
        assert table.power_mx[m].tolist() == [a + 1, b + 1]


@pytest.mark.parametrize("degree", DEGREES)
def test_derivatives_are_those_of_the_powers(degree):
    xi, eta = points = np.random.default_rng(degree).uniform(-1.0, 1.0, (2, 7))
    values = monomials.values(degree, points.T[None])[0]
    for x, matrix in enumerate(monomials.derivative_matrices(degree)):
        expected = [
            a * xi ** max(a - 1, 0) * eta**b if x == 0 else b * xi**a * eta ** max(b - 1, 0) for a, b in powers(degree)
        ]
        np.testing.assert_allclose(values @ matrix.T, np.transpose(expected), atol=1e-13)


@pytest.mark.parametrize("degree", DEGREES)
def test_degree_and_dimension_are_inverse(degree):
    assert monomials.degree_of(monomials.dimension(degree)) == degree


@pytest.mark.parametrize("name", ["solid", "medium_angle_damped"])
@pytest.mark.parametrize("n_pieces", [1, 2])
def test_kernels_know_the_order_from_the_table_alone(name, n_pieces, monkeypatch):
    """Monomials of each degree the other way round, and coefficients with them: the same numbers."""
    rng, kernel = np.random.default_rng(4), kernel_of(name)
    batch, arrays = random_batch(5, 7, 9, 5, rng, degrees=(2, 3), n_pieces=n_pieces)
    u = rng.normal(scale=0.003, size=(35, 2))
    expected, expected_residual, expected_tangents = run(kernel, batch, u)
    turned = {degree: [powers(degree).index(p[::-1]) for p in powers(degree)] for degree in (2, 3)}
    arrays["gradient_stxma"] = arrays["gradient_stxma"][:, :, :, turned[2]]
    arrays["second_sxma"] = arrays["second_sxma"][:, :, turned[3]]
    table = monomials.raised(2)
    other = monomials.Raised(
        np.ascontiguousarray(np.array(turned[3], dtype=np.int32)[table.position_mx[turned[2]]]),
        np.ascontiguousarray(table.power_mx[turned[2]]),
    )
    monkeypatch.setattr(monomials, "raised", lambda _: other)
    found, residual, tangents = run(kernel, CellBatch.pack(**arrays), u)
    np.testing.assert_allclose(found.energy_c, expected.energy_c, rtol=1e-13)
    np.testing.assert_allclose(residual, expected_residual, rtol=0, atol=1e-13 * np.abs(expected_residual).max())
    np.testing.assert_allclose(tangents, expected_tangents, rtol=0, atol=1e-13 * np.abs(expected_tangents).max())
