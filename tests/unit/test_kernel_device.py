"""Device kernels of cells, compiled as plain C++ and run on the host, against the C driver."""

from __future__ import annotations

import ctypes
import re
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from helpers_mesh import SHAPES, mesh_of, voronoi
from helpers_system import make_system, region
from test_codegen_device import COMPILERS, WARNINGS
from test_kernel_cells import PARAMETERS, random_batch

from codegen.backends.host import FLAGS, compile_on_host
from codegen.compiler import generate
from codegen.integrand import Integrand, second_gradient_energy
from codegen.library import address
from codegen.trace import trace
from tmc_vem.energy import DENSITIES
from tmc_vem.vem.kernel.batch import CellBatch, Tangents
from tmc_vem.vem.kernel.cells import CellKernel, compile_cells
from tmc_vem.vem.kernel.device import DeviceCells
from tmc_vem.vem.kernel.driver import DEVICE_CELLS

pytestmark = pytest.mark.skipif(not COMPILERS, reason="there is no C++ compiler")

# without the second gradient; with it, whatever its last index; and with its trace, which tells the last two apart
NAMES = ("solid", "medium_angle_damped", "medium_huhu_lulu")
POLYGONS = {"square": 1, "pentagon": 1, "regular pentagon": 1, "hexagon": 6, "square, hanging node on every edge": 8}

CALLS = """
extern "C" void on_device(unsigned blocks, unsigned threads, NAME::cells of, const double *p_k, const double *factor_kc,
                          const double *u_ni, double *B_sqra, double *x_kn, int *cell_n, double *J_n, double *psi_n,
                          double *g_kn, double *h_kn, double *energy_c, double *min_j_c, double *R_cai,
                          double *K_caibj) {
  const long long n = of.n_cells * of.n_points;
  NAME::parameters p = {};
  for (int k = 0; k < NAME::N_UNIFORM + NAME::N_VARYING; ++k) p.value[k] = p_k[k];
  launch_on_host(blocks, threads, [=] { NAME::NAME_rows(of, B_sqra); });
  launch_on_host(blocks, threads, [=] { NAME::NAME_states(of, B_sqra, u_ni, x_kn, cell_n); });
  launch_on_host(blocks, threads, [=] { NAME::NAME_jacobian(n, x_kn, J_n); });
  launch_on_host(blocks, threads, [=] {
    NAME::NAME_tangent(n, x_kn, p, factor_kc, of.n_cells, cell_n, psi_n, g_kn, h_kn);
  });
  launch_on_host(blocks, threads, [=] {
    NAME::NAME_forces(of, B_sqra, psi_n, J_n, g_kn, energy_c, min_j_c, R_cai);
  });
  launch_on_host(blocks, threads, [=] { NAME::NAME_stiffness(of, B_sqra, h_kn, K_caibj); });
}
"""


class CellsStruct(ctypes.Structure):
    _fields_ = (
        ("n_cells", ctypes.c_int64),
        *((name, ctypes.c_int32) for name in ("n_shapes", "n_basis", "n_points", "n_pieces")),
        *((name, ctypes.c_int32) for name in ("n_first", "n_lower", "n_translated")),
        *((name, ctypes.c_void_p) for name in ("shape_c", "nodes_ca", "piece_q")),
        *((name, ctypes.c_void_p) for name in ("w_sq", "first_sqm", "second_sqm", "first_strma", "second_srma")),
    )


def struct_of(cells: DeviceCells) -> CellsStruct:
    n_shapes, n_pieces, _, n_first, n_basis = cells.first_strma.shape
    return CellsStruct(
        len(cells.shape_c), n_shapes, n_basis, len(cells.piece_q), n_pieces,
        n_first, cells.second_srma.shape[2], cells.n_translated,
        address(cells.shape_c), address(cells.nodes_ca), address(cells.piece_q),
        address(cells.w_sq), address(cells.first_sqm), address(cells.second_sqm), address(cells.first_strma),
        address(cells.second_srma),
    )  # fmt: skip


def integrand_of(name: str) -> Integrand:
    energy = DENSITIES[name]
    return second_gradient_energy(energy.density, energy.name, energy.parameters)


@cache
def device_library(integrand: Integrand) -> ctypes.CDLL:
    source = generate(trace(integrand), driver=DEVICE_CELLS, target="cuda")
    with TemporaryDirectory() as directory:
        library = ctypes.CDLL(str(compile_on_host(source, Path(directory), (*FLAGS, *WARNINGS), CALLS)))
    library.on_device.argtypes = [ctypes.c_int, ctypes.c_int, CellsStruct, *[ctypes.c_void_p] * 14]
    library.on_device.restype = None
    return library


def on_device(
    integrand: Integrand, batch: CellBatch, u_ni: np.ndarray, blocks: int = 2, threads: int = 8
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Energies, smallest J, residuals (n_cells, n_basis, 2) and tangents of cells."""
    cells, layout = DeviceCells.of_batch(batch), integrand.layout
    of, n = struct_of(cells), batch.n_cells * batch.n_points
    parameters = np.array([PARAMETERS[name] for name in integrand.parameter_names])
    factor_kc = None if batch.factor_ck is None else np.ascontiguousarray(batch.factor_ck.T)
    B_sqra = np.full(of.n_shapes * batch.n_points * layout.n_rows * batch.n_basis, np.nan)
    x_kn, cell_n = np.full((layout.n_inputs, n), np.nan), np.full(n, -1, dtype=np.int32)
    J_n, psi_n, g_kn, h_kn = np.empty(n), np.empty(n), np.zeros((layout.n_inputs, n)), np.zeros((layout.n_hessian, n))
    energy_c, min_j_c = np.full((2, batch.n_cells), np.nan)
    R_cai = np.full((batch.n_cells, batch.n_basis, 2), np.nan)
    K_caibj = np.full((batch.n_cells, 2 * batch.n_basis, 2 * batch.n_basis), np.nan)
    u_ni = np.ascontiguousarray(u_ni)
    arrays = (
        parameters,
        factor_kc,
        u_ni,
        B_sqra,
        x_kn,
        cell_n,
        J_n,
        psi_n,
        g_kn,
        h_kn,
        energy_c,
        min_j_c,
        R_cai,
        K_caibj,
    )
    device_library(integrand).on_device(blocks, threads, of, *map(address, arrays))
    return energy_c, min_j_c, R_cai, K_caibj


def assert_cells_agree(integrand: Integrand, kernel: CellKernel, batch: CellBatch, u_ni: np.ndarray) -> None:
    energy_c, min_j_c, R_cai, K_caibj = on_device(integrand, batch, u_ni)
    residual_ni, tangents = np.zeros_like(u_ni), Tangents(np.full_like(K_caibj, np.nan))
    parameters = np.array([PARAMETERS[name] for name in integrand.parameter_names])
    values = kernel.cells(batch, u_ni, parameters, residual_ni, tangents)
    assert values.min_j_c.min() > 0.0
    np.testing.assert_allclose(min_j_c, values.min_j_c, rtol=1e-13)
    np.testing.assert_allclose(energy_c, values.energy_c, rtol=1e-12)
    np.testing.assert_allclose(K_caibj, tangents.dense_caibj, rtol=0, atol=1e-13 * np.abs(K_caibj).max())
    total_ni = np.zeros_like(u_ni)
    np.add.at(total_ni, batch.nodes_ca, R_cai)
    np.testing.assert_allclose(total_ni, residual_ni, rtol=0, atol=1e-12 * np.abs(R_cai).max())


def deformed(system: Any, size: float, move: float = 0.0) -> np.ndarray:
    """Random displacements of nodes (n_nodes, 2), to which a translation is added."""
    n_nodes = max(block.batch.n_nodes for block in system.blocks)
    return np.random.default_rng(5).normal(scale=size, size=(n_nodes, 2)) + move


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("polygon", POLYGONS)
def test_cells_of_every_kind(name, polygon):
    """Projectors on the whole cell and on pieces of it, with and without second derivatives."""
    system = make_system(
        mesh_of(SHAPES[polygon]), region(name, **{k: PARAMETERS[k] for k in DENSITIES[name].parameters})
    )
    (block,) = system.blocks
    assert block.batch.n_pieces == POLYGONS[polygon]
    assert_cells_agree(integrand_of(name), block.kernel, block.batch, deformed(system, 0.02))


@pytest.mark.parametrize("name", NAMES[:2])
def test_a_mesh_of_many_shapes_that_has_moved_far(name):
    """Cells that move as a whole have no forces, with the digits of C: translations are taken out in both."""
    system = make_system(voronoi(30), region(name, **{k: PARAMETERS[k] for k in DENSITIES[name].parameters}))
    u_ni = deformed(system, 0.002, move=1e3)
    assert len(system.blocks) > 1
    for block in system.blocks:
        assert block.batch.n_translated > 0
        assert_cells_agree(integrand_of(name), block.kernel, block.batch, u_ni)
    still = np.full_like(u_ni, 1e5)
    for block in system.blocks:
        assert np.abs(on_device(integrand_of(name), block.batch, still)[2]).max() < 1e-12


@pytest.mark.parametrize(("n_pieces", "degrees"), [(1, (3, 1)), (2, (1, 2)), (4, (1, 4)), (1, (0, 0))])
def test_random_coefficients_and_shapes_that_cells_share(n_pieces, degrees):
    rng, integrand = np.random.default_rng(n_pieces), integrand_of("medium_angle_damped")
    batch, arrays = random_batch(9, 7, 5, 3, rng, degrees=degrees, n_pieces=n_pieces)
    u_ni = rng.normal(scale=0.02 / 7, size=(arrays["nodes_ca"].max() + 1, 2))
    assert_cells_agree(integrand, compile_cells(integrand), batch, u_ni)


def test_parameters_that_vary_from_cell_to_cell():
    rng, integrand = np.random.default_rng(3), integrand_of("medium_angle_damped").varying(("mu", "beta"))
    batch, _ = random_batch(9, 7, 5, 3, rng)
    batch = replace(batch, factor_ck=rng.uniform(0.5, 2.0, (9, 2)))
    u_ni = rng.normal(scale=0.02 / 7, size=(63, 2))
    assert_cells_agree(integrand, compile_cells(integrand), batch, u_ni)
    uniform = on_device(integrand, replace(batch, factor_ck=np.ones((9, 2))), u_ni)
    assert not np.allclose(uniform[0], on_device(integrand, batch, u_ni)[0], rtol=0.1)


def test_blocks_and_threads_change_no_bit():
    rng, integrand = np.random.default_rng(4), integrand_of("medium_angle_damped")
    batch, _ = random_batch(9, 7, 5, 3, rng)
    u_ni = rng.normal(scale=0.02 / 7, size=(63, 2))
    first = on_device(integrand, batch, u_ni)
    for blocks, threads in ((1, 1), (3, 5), (9, 128), (40, 3)):
        for part, same in zip(first, on_device(integrand, batch, u_ni, blocks, threads), strict=True):
            np.testing.assert_array_equal(part, same)


def test_a_cell_that_is_turned_inside_out_says_so():
    rng, integrand = np.random.default_rng(6), integrand_of("solid")
    _, arrays = random_batch(4, 7, 5, 4, rng)
    arrays["shape_c"] = np.arange(4)
    arrays["xi_sqx"][3, 2] = np.nan  # a number at the other points
    batch = CellBatch.pack(**arrays)
    u_ni = rng.normal(scale=0.02 / 7, size=(28, 2))
    u_ni[batch.nodes_ca[2]] *= 1e4
    _, min_j_c, _, _ = on_device(integrand, batch, u_ni)
    expected = compile_cells(integrand).cells(batch, u_ni, np.array([20.0, 10.0])).min_j_c
    np.testing.assert_allclose(min_j_c, expected, rtol=1e-12)
    assert (min_j_c[:2] > 0.0).all()
    assert min_j_c[2] < 0.0
    assert np.isnan(min_j_c[3])


def test_fields_of_the_structure_are_those_of_the_header():
    text = re.sub(r"/\*.*?\*/", "", DEVICE_CELLS.header.read_text(), flags=re.DOTALL)
    lines = re.findall(r"^  (const double \*|const int \*|long long |int )(.*);", text, re.MULTILINE)
    kinds = {
        "long long ": ctypes.c_int64,
        "int ": ctypes.c_int32,
        "const int *": ctypes.c_void_p,
        "const double *": ctypes.c_void_p,
    }
    found = [(name, kinds[kind]) for kind, names in lines for name in names.split(", ")]
    assert found == list(CellsStruct._fields_)
