"""Gradients that are kept as potentials: the same numbers, in Python and in kernels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_kernel_cells import PARAMETERS, kernel_of, powers, random_batch, run

from tmc_vem.vem.kernel.batch import CellBatch
from tmc_vem.vem.kernel.packs import packed
from tmc_vem.vem.spaces.potential import gradient_of_potential, potential_of_gradient


@pytest.mark.parametrize("degree", [0, 1, 2, 3, 4])
def test_the_gradient_is_that_of_the_polynomial(degree):
    rng = np.random.default_rng(degree)
    n = (degree + 2) * (degree + 3) // 2
    potential, h = rng.normal(size=(3, 2, n - 1, 5)), np.array([0.5, 1.0, 3.0])
    gradient = gradient_of_potential(potential, h)
    x, y = points = rng.uniform(-1.0, 1.0, (2, 4))
    for direction in (0, 1):
        expected = np.zeros((3, 2, 4, 5))
        for m, (a, b) in enumerate(powers(n)[1:]):
            slope = a * x ** max(a - 1, 0) * y**b if direction == 0 else b * x**a * y ** max(b - 1, 0)
            expected += slope[:, None] * potential[:, :, m][:, :, None] / h[:, None, None, None]
        values = np.stack([points[0] ** a * points[1] ** b for a, b in powers(gradient.shape[3])], axis=1)
        assert values @ gradient[:, :, direction] == pytest.approx(expected, abs=1e-12)
    assert potential_of_gradient(gradient, h) == pytest.approx(potential, abs=1e-13)


@pytest.mark.parametrize("name", ["solid", "medium_angle_damped"])
@pytest.mark.parametrize(("degree", "n_pieces", "n_basis"), [(2, 5, 11), (1, 1, 6), (3, 2, 9)])
@pytest.mark.parametrize("in_place", [True, False])
def test_kernels_make_the_gradient_from_its_potential(name, degree, n_pieces, n_basis, in_place):
    """Where the shapes are a pack, and where they are gathered."""
    rng = np.random.default_rng(n_basis)
    kernel, n_cells = kernel_of(name), 19
    _, arrays = random_batch(n_cells, n_basis, 12, n_cells, rng, degrees=(degree, 2), n_pieces=n_pieces)
    arrays["shape_c"] = np.arange(n_cells) if in_place else rng.permutation(n_cells)
    potential = rng.normal(size=(n_cells, n_pieces, (degree + 2) * (degree + 3) // 2 - 1, n_basis))
    arrays["gradient_stxma"] = gradient_of_potential(potential, arrays["h_s"])
    batch = CellBatch.pack(**arrays)
    compact = replace(batch, gradient_sp=packed(potential), has_potential=True)
    u, du = rng.normal(scale=0.01 / n_basis, size=(2, n_cells * n_basis, 2))
    for expected, found in zip(run(kernel, batch, u)[1:], run(kernel, compact, u)[1:], strict=True):
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    alone, parameters = np.zeros_like(u), kernel.parameter_array(PARAMETERS)
    kernel.cells(compact, u, parameters, alone)  # below the tangent the potential itself is used
    residual = run(kernel, batch, u)[1]
    np.testing.assert_allclose(alone, residual, rtol=0, atol=1e-12 * np.abs(residual).max())
    energies = [kernel.cells(b, u, parameters).energy_c for b in (batch, compact)]
    np.testing.assert_allclose(energies[1], energies[0], rtol=1e-12)
    np.testing.assert_allclose(kernel.max_step(compact, u, 9.0 * du), kernel.max_step(batch, u, 9.0 * du), rtol=1e-10)
    shapes = np.array([3, 0, 17])
    assert compact.coefficients(shapes)[0] == pytest.approx(arrays["gradient_stxma"][shapes], abs=1e-12)
    assert compact.take(slice(4)).has_potential
    assert compact.nbytes < batch.nbytes
