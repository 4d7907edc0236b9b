"""The cell driver against sums written out in Python, and the ABI."""

from __future__ import annotations

import re

import numpy as np
import pytest

from codegen import abi
from codegen.ctext import abi_header
from codegen.errors import CodegenError
from codegen.kernel import ENERGY, GRADIENT, TANGENT, CellBatch, Kernel, compile_energy
from tmc_vem.energy import DENSITIES

PARAMETERS = {"K": 20.0, "mu": 10.0, "gamma": 0.5, "alpha_r": 0.7, "beta": 2.0}


def kernel_of(name: str) -> Kernel:
    energy = DENSITIES[name]
    return compile_energy(energy.density, energy.name, energy.parameters, energy.description)


def batch_of(n_cells: int, n_basis: int, n_points: int, n_shapes: int, rng: np.random.Generator) -> CellBatch:
    stride = 4 * (n_basis // 4 + 1)
    B = np.zeros((n_shapes, n_points, 6, stride))
    B[..., :n_basis] = rng.normal(size=(n_shapes, n_points, 6, n_basis))
    shape_c = rng.integers(0, n_shapes, n_cells).astype(np.int32)
    return CellBatch(shape_c, B, rng.uniform(0.5, 1.0, (n_shapes, n_points)), n_basis)


def by_sums(kernel: Kernel, batch: CellBatch, u_cai: np.ndarray):
    """Energy, residual (52) and tangent (56) from point values with the Kronecker products written out."""
    parameters = kernel.parameter_array(PARAMETERS)
    shape = (batch.n_cells, batch.n_basis, 2)
    energy, residual, tangent = np.zeros(shape[0]), np.zeros(shape), np.zeros((*shape, *shape[1:]))
    min_j = np.full(shape[0], np.inf)
    for c, s in enumerate(batch.shape_c):
        for q, w in enumerate(batch.w_sq[s]):
            B1 = np.kron(batch.B_sqra[s, q, :2, : batch.n_basis], np.eye(2))
            B2 = np.kron(batch.B_sqra[s, q, 2:, : batch.n_basis], np.eye(2))
            x = np.concatenate([B1 @ u_cai[c].ravel(), B2 @ u_cai[c].ravel()])
            psi, g, h = (values[0] for values in kernel.points(TANGENT, x[None], parameters))
            P, T, D, A, B = g[:4], g[4:], h[:4, :4], h[4:, :4], h[4:, 4:]
            energy[c] += w * psi
            residual[c] += w * (B1.T @ P + B2.T @ T).reshape(-1, 2)
            K = B1.T @ D @ B1 + B2.T @ A @ B1 + B1.T @ A.T @ B2 + B2.T @ B @ B2
            tangent[c] += w * K.reshape(batch.n_basis, 2, batch.n_basis, 2)
            min_j[c] = min(min_j[c], (1 + x[0]) * (1 + x[3]) - x[1] * x[2])
    return energy, min_j, residual, tangent


@pytest.mark.parametrize("name", ["solid", "medium_angle_damped", "medium_tangent"])
@pytest.mark.parametrize(("n_basis", "n_points"), [(3, 1), (7, 5), (9, 8), (13, 19), (25, 16), (30, 9)])
def test_cells_are_the_sums_over_their_points(name, n_basis, n_points):
    rng = np.random.default_rng(n_basis)
    kernel, batch = kernel_of(name), batch_of(4, n_basis, n_points, 3, rng)
    u = rng.normal(scale=0.05 / np.sqrt(n_basis), size=(4, n_basis, 2))
    energy, min_j, residual, tangent = by_sums(kernel, batch, u)
    found = kernel.cells(TANGENT, batch, u, kernel.parameter_array(PARAMETERS))
    np.testing.assert_allclose(found.energy_c, energy, rtol=1e-12)
    np.testing.assert_allclose(found.min_j_c, min_j, rtol=1e-12)
    np.testing.assert_allclose(found.residual_cai, residual, rtol=0, atol=1e-12 * np.abs(residual).max())
    np.testing.assert_allclose(found.tangent_caibj, tangent, rtol=0, atol=1e-12 * np.abs(tangent).max())
    assert found.inadmissible is None


def test_levels_skip_what_is_not_asked_for():
    rng = np.random.default_rng(1)
    kernel, batch = kernel_of("medium_huhu_lulu_damped"), batch_of(3, 8, 6, 1, rng)
    u, parameters = rng.normal(scale=0.02, size=(3, 8, 2)), None
    parameters = kernel.parameter_array(PARAMETERS)
    full = kernel.cells(TANGENT, batch, u, parameters)
    gradient = kernel.cells(GRADIENT, batch, u, parameters)
    energy = kernel.cells(ENERGY, batch, u, parameters)
    assert gradient.tangent_caibj is None
    assert energy.tangent_caibj is None
    assert energy.residual_cai is None
    np.testing.assert_allclose(gradient.residual_cai, full.residual_cai, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(energy.energy_c, full.energy_c, rtol=1e-14)
    out = np.empty((3, 16, 16))
    assert kernel.cells(TANGENT, batch, u, parameters, out).tangent_caibj.base is out
    np.testing.assert_array_equal(out.reshape(full.tangent_caibj.shape), full.tangent_caibj)


def affine(n_cells: int, n_points: int, H_cij: np.ndarray) -> tuple[CellBatch, np.ndarray]:
    """Cells whose two basis functions are X1 and X2: the dofs are the displacement gradient itself."""
    B = np.zeros((1, n_points, 6, 4))
    B[:, :, 0, 0] = B[:, :, 1, 1] = 1.0
    batch = CellBatch(np.zeros(n_cells, np.int32), B, np.full((1, n_points), 1.0 / n_points), 2)
    return batch, np.ascontiguousarray(H_cij.transpose(0, 2, 1))


def test_the_first_inadmissible_cell_is_named_and_nan_stays_visible():
    H = np.zeros((4, 2, 2))
    H[2, 0, 0] = -1.5  # J = -0.5
    H[3, 0, 0] = np.nan
    kernel = kernel_of("solid")
    batch, u = affine(4, 9, H)
    values = kernel.cells(TANGENT, batch, u, kernel.parameter_array(PARAMETERS))
    assert values.inadmissible == 2
    assert values.min_j_c[:3] == pytest.approx([1.0, 1.0, -0.5])
    assert np.isnan(values.min_j_c[3])
    assert np.isnan(values.energy_c[2:]).all()
    batch, u = affine(1, 9, H[3:])
    assert kernel.cells(ENERGY, batch, u, kernel.parameter_array(PARAMETERS)).inadmissible == 0


def test_a_nan_at_one_point_is_not_forgotten_at_the_next():
    batch, u = affine(1, 5, np.zeros((1, 2, 2)))
    batch.B_sqra[0, 1, 0, 0] = np.nan
    kernel = kernel_of("solid")
    values = kernel.cells(ENERGY, batch, u, kernel.parameter_array(PARAMETERS))
    assert np.isnan(values.min_j_c[0])
    assert values.inadmissible == 0


def test_j_of_zero_is_inadmissible():
    H = np.array([[[-1.0, 0.0], [0.0, 0.0]]])
    kernel = kernel_of("medium_huhu")
    batch, u = affine(1, 1, H)
    assert kernel.cells(ENERGY, batch, u, kernel.parameter_array(PARAMETERS)).inadmissible == 0


def test_largest_step_is_the_first_root_of_the_quadratic():
    rng = np.random.default_rng(8)
    n = 400
    H, dH = rng.normal(scale=0.2, size=(n, 2, 2)), rng.normal(scale=3.0, size=(n, 2, 2))
    dH[: n // 4, :, 1] = dH[: n // 4, :, :1].sum(axis=2) * rng.normal(size=(n // 4, 1))  # det dH = 0 or nearly
    dH[: n // 8, :, 1] = 0.0
    batch, u = affine(n, 1, H)
    _, du = affine(n, 1, dH)
    step = kernel_of("solid").max_step(batch, u, du)
    F = np.eye(2) + H
    for c in range(n):
        c0, c2 = np.linalg.det(F[c]), np.linalg.det(dH[c])
        c1 = F[c, 0, 0] * dH[c, 1, 1] + F[c, 1, 1] * dH[c, 0, 0] - F[c, 0, 1] * dH[c, 1, 0] - F[c, 1, 0] * dH[c, 0, 1]
        roots = np.roots([c2, c1, c0]) if abs(c2) > 1e-13 else np.roots([c1, c0])
        positive = roots.real[(abs(roots.imag) < 1e-12) & (roots.real > 0)]
        found = step[c] if step[c] < 1e12 else np.inf  # rounding of det dH = 0 puts a root far away
        assert found == pytest.approx(positive.min() if len(positive) else np.inf, rel=1e-8)
    assert np.isinf(step).any()
    assert np.isfinite(step).any()


def test_largest_step_is_the_smallest_over_the_points():
    B = np.zeros((1, 3, 6, 4))
    B[0, :, 0, 0] = [0.5, 2.0, 1.0]
    batch = CellBatch(np.zeros(1, np.int32), B, np.ones((1, 3)), 2)
    du = np.array([[[-1.0, 0.0], [0.0, 0.0]]])
    assert kernel_of("solid").max_step(batch, np.zeros((1, 2, 2)), du)[0] == pytest.approx(0.5)


def test_arrays_of_the_wrong_shape_are_refused():
    kernel = kernel_of("solid")
    batch, u = affine(2, 1, np.zeros((2, 2, 2)))
    parameters = kernel.parameter_array(PARAMETERS)
    with pytest.raises(ValueError, match=r"u_cai has shape \(1, 2, 2\), expected \(2, 2, 2\)"):
        kernel.cells(ENERGY, batch, u[:1], parameters)
    with pytest.raises(ValueError, match=r"du_cai has shape \(1, 2, 2\), expected \(2, 2, 2\)"):
        kernel.max_step(batch, u, u[:1])
    with pytest.raises(ValueError, match="kernels take C-contiguous arrays only"):
        kernel.cells(TANGENT, batch, u, parameters, np.empty((4, 4, 2)).transpose(2, 0, 1))
    with pytest.raises(ValueError, match=r"2 parameters expected \(K, mu\), got 1"):
        kernel.cells(ENERGY, batch, u, parameters[:1])
    with pytest.raises(ValueError, match=r"2 parameters expected \(K, mu\), got 3"):
        kernel.points(ENERGY, np.zeros((1, 12)), np.ones(3))
    with pytest.raises(ValueError, match="kernels take C-contiguous arrays only"):
        kernel.cells(ENERGY, CellBatch(batch.shape_c, batch.B_sqra[..., ::-1], batch.w_sq, 2), u, parameters)


# ---- ABI ------------------------------------------------------------------------------------------------------------


def test_signatures_are_those_of_the_header():
    code = re.sub(r"/\*.*?\*/", "", abi_header(), flags=re.DOTALL)
    declared = {}
    for result, name, arguments in re.findall(r"(\w+) (tmc_\w+)\(([^)]*)\)", code):
        types = ["pointer" if "*" in argument else argument.split()[0] for argument in arguments.split(",")]
        declared[name] = (result, types)
    names = {abi._INT: "int", abi._INT64: "int64_t", abi._ARRAY: "pointer", None: "void"}
    expected = {
        name: (names[result], [names[argument] for argument in arguments])
        for name, (result, arguments) in abi.SIGNATURES.items()
    }
    assert declared == expected


def test_a_library_that_is_no_kernel_is_refused(tmp_path):
    with pytest.raises(CodegenError, match=r"no-kernel\.so cannot be loaded"):
        abi.load_library(tmp_path / "no-kernel.so")
