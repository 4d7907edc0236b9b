"""The cell driver against sums written out in Python, and the ABI."""

from __future__ import annotations

import ctypes
import re
from dataclasses import replace

import numpy as np
import pytest
from test_codegen_layout import FLUX, ONLY_F

from codegen.ctext import by_parameters_header, points_header
from codegen.errors import CodegenError
from codegen.integrand import second_gradient_energy
from codegen.kernel import ENERGY, TANGENT, Kernel
from codegen.library import ARRAY, INT, INT64, POINTS, load_library
from tmc_vem.energy import DENSITIES
from tmc_vem.vem.facets.batch import SidesStruct
from tmc_vem.vem.facets.compiled import SIDE_DRIVER, SideKernel
from tmc_vem.vem.kernel.abi import SIGNATURES
from tmc_vem.vem.kernel.batch import BatchStruct, CellBatch, Tangents, TangentsStruct
from tmc_vem.vem.kernel.by_parameters import CellParameterKernel
from tmc_vem.vem.kernel.cells import CellKernel, compile_cells
from tmc_vem.vem.kernel.driver import CELL_DRIVER, PARAMETER_DRIVER

PARAMETERS = {"K": 20.0, "mu": 10.0, "gamma": 0.5, "alpha_r": 0.7, "beta": 2.0}


def kernel_of(name: str) -> CellKernel:
    energy = DENSITIES[name]
    return compile_cells(second_gradient_energy(energy.density, energy.name, energy.parameters))


def random_batch(n_cells, n_basis, n_points, n_shapes, rng, *, degrees=(3, 2), n_pieces=1, own_nodes=True):
    """Cells with random coefficients, and the arrays they were packed from."""
    dims = [(d + 1) * (d + 2) // 2 for d in degrees]
    arrays = {
        "w_sq": rng.uniform(0.5, 1.0, (n_shapes, n_points)),
        "xi_sqx": rng.uniform(-0.5, 0.5, (n_shapes, n_points, 2)),
        "h_s": rng.uniform(0.5, 2.0, n_shapes),
        "gradient_stxma": rng.normal(size=(n_shapes, n_pieces, 2, dims[0], n_basis)),
        "second_sxma": rng.normal(size=(n_shapes, 2, dims[1], n_basis)),
        "piece_q": np.sort(rng.integers(0, n_pieces, n_points)),
        "shape_c": rng.integers(0, n_shapes, n_cells),
        "nodes_ca": np.arange(n_cells * n_basis).reshape(n_cells, n_basis),
    }
    if not own_nodes:
        n_nodes = n_cells * n_basis // 2 + n_basis
        arrays["nodes_ca"] = np.stack([rng.permutation(n_nodes)[:n_basis] for _ in range(n_cells)])
    return CellBatch.pack(**arrays), arrays


def rows(arrays):
    """Derivative rows (n_shapes, n_points, 6, n_basis), monomial by monomial."""
    n_shapes, n_points, _ = arrays["xi_sqx"].shape
    B = np.zeros((n_shapes, n_points, 6, arrays["nodes_ca"].shape[1]))
    for s in range(n_shapes):
        for q, (x, y) in enumerate(arrays["xi_sqx"][s]):
            t, inverse_h = arrays["piece_q"][q], 1.0 / arrays["h_s"][s]
            for d in (0, 1):
                for m, (a, b) in enumerate(powers(arrays["gradient_stxma"].shape[3])):
                    B[s, q, d] += x**a * y**b * arrays["gradient_stxma"][s, t, d, m]
                for m, (a, b) in enumerate(powers(arrays["second_sxma"].shape[2])):
                    coefficients = arrays["second_sxma"][s, d, m]
                    B[s, q, 2 + d] += inverse_h * a * x ** max(a - 1, 0) * y**b * coefficients
                    B[s, q, 4 + d] += inverse_h * b * x**a * y ** max(b - 1, 0) * coefficients
    return B


def powers(dimension):
    return [(d - b, b) for d in range(9) for b in range(d + 1)][:dimension]


def by_sums(kernel: Kernel, arrays, u_ni: np.ndarray):
    """Energy, smallest J, residual (52) and tangents (56) from point values with the Kronecker products written out."""
    parameters = kernel.parameter_array(PARAMETERS)
    B_sqra, nodes_ca = rows(arrays), arrays["nodes_ca"]
    n_cells, n_basis = nodes_ca.shape
    energy, residual, tangent = np.zeros(n_cells), np.zeros_like(u_ni), np.zeros((n_cells, 2 * n_basis, 2 * n_basis))
    min_j = np.full(n_cells, np.inf)
    for c, s in enumerate(arrays["shape_c"]):
        u = u_ni[nodes_ca[c]].ravel()
        for q, w in enumerate(arrays["w_sq"][s]):
            B1, B2 = np.kron(B_sqra[s, q, :2], np.eye(2)), np.kron(B_sqra[s, q, 2:], np.eye(2))
            x = np.concatenate([B1 @ u, B2 @ u])
            psi, g, h = (values[0] for values in kernel.points(TANGENT, x[None], parameters))
            P, T, D, A, B = g[:4], g[4:], h[:4, :4], h[4:, :4], h[4:, 4:]
            energy[c] += w * psi
            residual[nodes_ca[c]] += w * (B1.T @ P + B2.T @ T).reshape(-1, 2)
            tangent[c] += w * (B1.T @ D @ B1 + B2.T @ A @ B1 + B1.T @ A.T @ B2 + B2.T @ B @ B2)
            min_j[c] = min(min_j[c], (1 + x[0]) * (1 + x[3]) - x[1] * x[2])
    return energy, min_j, residual, tangent


def run(kernel, batch, u):
    """Values, residual and dense tangents of a batch."""
    residual, n = np.zeros_like(u), 2 * batch.n_basis
    dense = np.full((batch.n_cells, n, n), np.nan)
    values = kernel.cells(batch, u, kernel.parameter_array(PARAMETERS), residual, Tangents(dense))
    return values, residual, dense


@pytest.mark.parametrize("name", ["solid", "medium_angle_damped", "medium_tangent"])
@pytest.mark.parametrize(
    ("n_cells", "n_basis", "n_points", "n_pieces", "degrees"),
    [(1, 3, 1, 1, (2, 2)), (9, 7, 5, 1, (3, 1)), (8, 9, 8, 2, (1, 2)), (5, 13, 19, 4, (1, 4)), (17, 25, 3, 1, (0, 0))],
)
def test_cells_are_the_sums_over_their_points(name, n_cells, n_basis, n_points, n_pieces, degrees):
    rng = np.random.default_rng(n_basis)
    kernel = kernel_of(name)
    batch, arrays = random_batch(
        n_cells, n_basis, n_points, 3, rng, degrees=degrees, n_pieces=n_pieces, own_nodes=n_basis != 9
    )
    u = rng.normal(scale=0.02 / n_basis, size=(n_cells * n_basis, 2))
    energy, min_j, residual, tangent = by_sums(kernel, arrays, u)
    found, found_residual, found_tangent = run(kernel, batch, u)
    np.testing.assert_allclose(found.energy_c, energy, rtol=1e-12)
    np.testing.assert_allclose(found.min_j_c, min_j, rtol=1e-12)
    np.testing.assert_allclose(found_residual, residual, rtol=0, atol=1e-12 * np.abs(residual).max())
    np.testing.assert_allclose(found_tangent, tangent, rtol=0, atol=1e-12 * np.abs(tangent).max())
    assert found.inadmissible is None


def test_an_integrand_of_f_alone_has_the_same_cells():
    rng = np.random.default_rng(3)
    batch, _ = random_batch(9, 7, 5, 3, rng)
    u = rng.normal(scale=0.003, size=(63, 2))
    whole = second_gradient_energy(lambda F, G, p, m: ONLY_F.function(F, p, m), "stretch", ("mu",))
    found, expected = (run(compile_cells(integrand), batch, u) for integrand in (ONLY_F, whole))
    np.testing.assert_array_equal(found[0].energy_c, expected[0].energy_c)
    np.testing.assert_array_equal(found[1], expected[1])
    np.testing.assert_array_equal(found[2], expected[2])


def test_a_field_that_the_driver_is_not_made_for_is_refused():
    with pytest.raises(CodegenError, match=r"failed: the cell driver is for fields of two components in the plane$"):
        compile_cells(FLUX)


@pytest.mark.parametrize("name", ["medium_angle_damped", "medium_huhu_lulu_damped"])
@pytest.mark.parametrize("degree", [1, 2, 3])
def test_the_second_gradient_may_be_that_of_the_first_ones_polynomials(name, degree):
    """One array of coefficients for both, which the residual then uses once."""
    rng = np.random.default_rng(degree)
    kernel = kernel_of(name)
    _, arrays = random_batch(11, 9, 20, 5, rng, degrees=(degree, degree))
    apart = CellBatch.pack(**{**arrays, "second_sxma": arrays["gradient_stxma"][:, 0].copy()})
    arrays["second_sxma"] = arrays["gradient_stxma"][:, 0]
    batch = CellBatch.pack(**arrays)
    assert batch.second_sp is batch.gradient_sp
    u, parameters = rng.normal(scale=0.002, size=(99, 2)), kernel.parameter_array(PARAMETERS)
    energy, _, expected, _ = by_sums(kernel, arrays, u)
    for cells in (batch, apart):
        residual = np.zeros_like(u)
        values = kernel.cells(cells, u, parameters, residual)
        np.testing.assert_allclose(values.energy_c, energy, rtol=1e-12)
        np.testing.assert_allclose(residual, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("n_shapes", [1, 16, 19])
def test_shapes_are_found_in_their_packs(n_shapes):
    """Cells of one shape, of consecutive shapes that are read in place, and of shapes in any order."""
    rng = np.random.default_rng(n_shapes)
    kernel = kernel_of("medium_huhu_damped")
    _, arrays = random_batch(n_shapes, 6, 4, n_shapes, rng)
    u = rng.normal(scale=0.01, size=(6 * n_shapes, 2))
    for order in (np.arange(n_shapes), rng.permutation(n_shapes), np.zeros(n_shapes, dtype=int)):
        arrays["shape_c"] = order
        energy, _, residual, _ = by_sums(kernel, arrays, u)
        found, found_residual, _ = run(kernel, CellBatch.pack(**arrays), u)
        np.testing.assert_allclose(found.energy_c, energy, rtol=1e-12)
        np.testing.assert_allclose(found_residual, residual, rtol=0, atol=1e-12 * np.abs(residual).max())


def test_tangents_go_to_their_places_in_a_sparse_matrix():
    """Two nodes in three are in the matrix of each of the cells; the dense matrices are the oracle."""
    rng = np.random.default_rng(5)
    kernel = kernel_of("medium_angle_damped")
    batch, arrays = random_batch(11, 9, 5, 4, rng, own_nodes=False)
    n_nodes = int(arrays["nodes_ca"].max()) + 1
    u = rng.normal(scale=0.002, size=(n_nodes, 2))
    _, _, dense = run(kernel, batch, u)
    dofs_cn = (2 * arrays["nodes_ca"][:, :, None] + np.arange(2)).reshape(11, -1)
    expected, pattern = np.zeros((2 * n_nodes, 2 * n_nodes)), np.zeros((2 * n_nodes, 2 * n_nodes), dtype=bool)
    for dofs, K in zip(dofs_cn, dense, strict=True):
        expected[np.ix_(dofs, dofs)] += K
        pattern[np.ix_(dofs, dofs)] = True
    columns = np.concatenate([np.flatnonzero(row) for row in pattern]).astype(np.int32)
    lengths = pattern.sum(axis=1)
    starts = np.concatenate([[0], np.cumsum(lengths)])
    arguments = (starts[:-1:2].copy(), lengths[::2].astype(np.int32), np.arange(0, 2 * n_nodes, 2, dtype=np.int32))
    values = np.full(len(columns), 0.5)  # what is there is added to
    tangents = Tangents(None, values, kernel.positions(batch.nodes_ca, *arguments, columns), arguments[1])
    kernel.cells(batch, u, kernel.parameter_array(PARAMETERS), None, tangents)
    found = np.zeros_like(expected)
    found[pattern] = values - 0.5
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    columns[columns == arrays["nodes_ca"][7, 3] * 2] += 1
    with pytest.raises(ValueError, match="the matrix has no room for the tangent of cell"):
        kernel.positions(batch.nodes_ca, *arguments, columns)


def test_levels_skip_what_is_not_asked_for():
    rng = np.random.default_rng(1)
    kernel = kernel_of("medium_huhu_lulu_damped")
    batch, _ = random_batch(3, 8, 6, 1, rng)
    u, parameters = rng.normal(scale=0.01, size=(24, 2)), kernel.parameter_array(PARAMETERS)
    full, residual, dense = run(kernel, batch, u)
    alone, only_tangents = np.zeros_like(u), np.empty_like(dense)
    gradient = kernel.cells(batch, u, parameters, alone)
    energy = kernel.cells(batch, u, parameters)
    kernel.cells(batch, u, parameters, None, Tangents(only_tangents))
    np.testing.assert_allclose(alone, residual, rtol=1e-12, atol=1e-15)
    np.testing.assert_array_equal(only_tangents, dense)
    for values in (gradient, energy):
        np.testing.assert_allclose(values.energy_c, full.energy_c, rtol=1e-13)
    kernel.cells(batch, u, parameters, alone)  # residuals are added up
    np.testing.assert_allclose(alone, 2.0 * residual, rtol=1e-12, atol=1e-15)


def affine(n_cells: int, n_points: int, H_cij: np.ndarray, values_q=None) -> tuple[CellBatch, np.ndarray]:
    """Cells whose two basis functions are X1 and X2: the dofs are the displacement gradient itself."""
    gradient = np.zeros((n_points, 2, 1, 2))
    gradient[:, 0, 0, 0] = gradient[:, 1, 0, 1] = 1.0
    if values_q is not None:
        gradient[:, 0, 0, 0] = values_q
    batch = CellBatch.pack(
        np.zeros(n_cells), np.arange(2 * n_cells).reshape(-1, 2), np.arange(n_points),
        np.full((1, n_points), 1 / n_points), np.zeros((1, n_points, 2)), np.ones(1), gradient[None], gradient[None, 0],
    )  # fmt: skip
    return batch, np.ascontiguousarray(H_cij.transpose(0, 2, 1)).reshape(-1, 2)


def test_the_first_inadmissible_cell_is_named_and_nan_stays_visible():
    H = np.zeros((4, 2, 2))
    H[2, 0, 0] = -1.5  # J = -0.5
    H[3, 0, 0] = np.nan
    kernel = kernel_of("solid")
    batch, u = affine(4, 9, H)
    values, _, _ = run(kernel, batch, u)
    assert values.inadmissible == 2
    assert values.min_j_c[:3] == pytest.approx([1.0, 1.0, -0.5])
    assert np.isnan(values.min_j_c[3])
    assert np.isnan(values.energy_c[2:]).all()
    batch, u = affine(1, 9, H[3:])
    assert kernel.cells(batch, u, kernel.parameter_array(PARAMETERS)).inadmissible == 0


def test_a_nan_at_one_point_is_not_forgotten_at_the_next():
    batch, u = affine(1, 5, np.zeros((1, 2, 2)), [1.0, np.nan, 1.0, 1.0, 1.0])
    kernel = kernel_of("solid")
    values = kernel.cells(batch, u, kernel.parameter_array(PARAMETERS))
    assert np.isnan(values.min_j_c[0])
    assert values.inadmissible == 0


def test_j_of_zero_is_inadmissible():
    H = np.array([[[-1.0, 0.0], [0.0, 0.0]]])
    kernel = kernel_of("medium_huhu")
    batch, u = affine(1, 1, H)
    assert kernel.cells(batch, u, kernel.parameter_array(PARAMETERS)).inadmissible == 0


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


@pytest.mark.parametrize(("n_pieces", "degree"), [(1, 3), (4, 2)])
def test_largest_step_of_curved_displacements(n_pieces, degree):
    """Against the roots of J along the line at every point, from the derivative rows of the basis."""
    rng = np.random.default_rng(n_pieces)
    batch, arrays = random_batch(21, 9, 18, 21, rng, degrees=(degree, 1), n_pieces=n_pieces)
    u, du = rng.normal(scale=0.02, size=(2, 189, 2))
    step = kernel_of("solid").max_step(batch, u, du)
    B_sqra = rows(arrays)[:, :, :2]
    for c, s in enumerate(arrays["shape_c"]):
        F, dF = (np.swapaxes(B_sqra[s] @ v[arrays["nodes_ca"][c]], 1, 2) for v in (u, du))
        F = F + np.eye(2)
        c0, c2 = np.linalg.det(F), np.linalg.det(dF)
        c1 = np.linalg.det(F + dF) - c0 - c2
        roots = np.concatenate([np.roots(c) for c in np.column_stack([c2, c1, c0])])
        assert (c0 > 0.0).all()
        positive = roots.real[(abs(roots.imag) < 1e-12) & (roots.real > 0.0)]
        assert step[c] == pytest.approx(positive.min(initial=np.inf), rel=1e-9)


def test_largest_step_is_the_smallest_over_the_points():
    batch, du = affine(1, 3, np.array([[[-1.0, 0.0], [0.0, 0.0]]]), [0.5, 2.0, 1.0])
    assert kernel_of("solid").max_step(batch, np.zeros((2, 2)), du)[0] == pytest.approx(0.5)


def test_arrays_of_the_wrong_shape_are_refused():
    kernel, medium = kernel_of("solid"), kernel_of("medium_huhu")
    batch, u = affine(2, 1, np.zeros((2, 2, 2)))
    parameters = kernel.parameter_array(PARAMETERS)
    with pytest.raises(ValueError, match=r"u_ni has shape \(3, 2\), expected \(4 or more, 2\)"):
        kernel.cells(batch, u[:3], parameters)
    with pytest.raises(ValueError, match=r"du_ni has shape \(1, 2\), expected \(4 or more, 2\)"):
        kernel.max_step(batch, u, u[:1])
    with pytest.raises(ValueError, match="residual_ni must be a C-contiguous array"):
        kernel.cells(batch, u, parameters, np.zeros((2, 4)).T)
    with pytest.raises(ValueError, match="kernels take C-contiguous arrays only"):
        kernel.cells(batch, u, parameters, None, Tangents(np.empty((4, 4, 2)).transpose(2, 0, 1)))
    with pytest.raises(ValueError, match=r"dense_caibj has shape \(1, 4, 4\), expected \(2, 2, 2, 2, 2\)"):
        kernel.cells(batch, u, parameters, None, Tangents(np.empty((1, 4, 4))))
    with pytest.raises(ValueError, match="position_cab does not belong to the batch"):
        kernel.cells(batch, u, parameters, None, Tangents(None, np.zeros(3), np.zeros((1, 2, 2), dtype=np.int32)))
    with pytest.raises(ValueError, match=r"2 parameters expected \(K, mu\), got 1"):
        kernel.cells(batch, u, parameters[:1])
    with pytest.raises(ValueError, match=r"2 parameters expected \(K, mu\), got 3"):
        kernel.points(ENERGY, np.zeros((1, 12)), np.ones(3))
    with pytest.raises(ValueError, match="'medium_huhu' needs second derivatives"):
        medium.cells(replace(batch, second_sp=None), u, medium.parameter_array(PARAMETERS))


# ---- ABI ------------------------------------------------------------------------------------------------------------


def without_comments(code):
    return re.sub(r"/\*.*?\*/", "", code, flags=re.DOTALL)


@pytest.mark.parametrize(
    ("exported", "driver", "signatures"),
    [
        (points_header, CELL_DRIVER, SIGNATURES),
        (points_header, SIDE_DRIVER, SideKernel.signatures),
        (by_parameters_header, PARAMETER_DRIVER, CellParameterKernel.signatures),
    ],
)
def test_signatures_are_those_of_the_header(exported, driver, signatures):
    code = without_comments(exported() + driver.declarations)
    of_others = "".join(path.read_text() for path in driver.shared_headers)  # structures only are shared
    code = code.replace(without_comments(of_others), "")
    declared = {}
    for result, name, arguments in re.findall(r"(\w+) (tmc_\w+)\(([^)]*)\);", code):
        types = ["pointer" if "*" in argument else argument.split()[0] for argument in arguments.split(",")]
        declared[name] = (result, types)
    names = {INT: "int", INT64: "int64_t", ARRAY: "pointer", None: "void"}
    expected = {
        name: (names[result], [names[argument] for argument in arguments])
        for name, (result, arguments) in signatures.items()
    }
    assert declared == expected


def test_structures_are_those_of_the_header():
    names = {ctypes.c_int64: "int64_t", ctypes.c_int32: "int32_t", ctypes.c_void_p: "pointer"}
    for driver, name, struct in (
        (CELL_DRIVER, "tmc_batch", BatchStruct), (CELL_DRIVER, "tmc_tangents", TangentsStruct),
        (SIDE_DRIVER, "tmc_sides", SidesStruct),
    ):  # fmt: skip
        code = without_comments(driver.declarations)
        (body,) = re.findall(rf"typedef struct {{([^}}]*)}} {name};", code)
        declared = []
        for statement in filter(str.strip, body.split(";")):
            kind = "pointer" if "*" in statement else statement.split()[0]
            first = statement.strip().rsplit(" ", statement.count(",") + 1)[1:]
            declared += [(word.strip("*, "), kind) for word in first]
        expected = [
            (f"{field}[{kind._length_}]", names[kind._type_]) if hasattr(kind, "_length_") else (field, names[kind])
            for field, kind in struct._fields_
        ]
        assert declared == expected, name


def test_a_library_that_is_no_kernel_is_refused(tmp_path):
    with pytest.raises(CodegenError, match=r"no-kernel\.so cannot be loaded"):
        load_library(tmp_path / "no-kernel.so", POINTS)
