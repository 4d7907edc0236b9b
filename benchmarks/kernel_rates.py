"""Flop rates of the element kernel's parts against this core's dgemm, and the roofline.

    python benchmarks/kernel_rates.py

The parts are those of the generated C of an energy, compiled with the project's flags and timed on their own: the
product w D B, the contraction B' (w D B) and the point kernel. Rates count what is needed, not what is computed beyond
it: half of a symmetric block, one multiplication and one addition a term. Operations of the point kernel come from the
generator.
"""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from harness import interleaved, report
from meshes import DOFS_PER_CELL, ENERGIES, VALUES, bend, region, square
from mpi4py import MPI

from codegen.build import FLAGS, compiler
from codegen.compiler import generate
from codegen.integrand import LAYOUT, second_gradient_energy
from codegen.ir import KernelSource
from codegen.trace import trace
from tmc_vem.energy import DENSITIES
from tmc_vem.mesh.spread.distribute import distribute
from tmc_vem.support.memory import reuse_freed
from tmc_vem.vem.kernel.batch import Tangents
from tmc_vem.vem.kernel.driver import CELL_DRIVER
from tmc_vem.vem.spaces.spaces import N_FIRST_ROWS
from tmc_vem.vem.system import VemSystem

LANES = LAYOUT.lanes
CELLS = {"quadrilateral": (9, 16), "pentagon": (11, 30), "hexagon": (13, 36), "heptagon": (15, 42)}  # functions, points
# Composite functions: rows at points are those of the first gradient alone, and second gradients are summed apart.
COMPOSITE = ("hexagon", "heptagon")

# Appended to the kernel, whose functions are static. Seconds for eight cells, once a repetition.
TIMED = """
#include <time.h>
static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return t.tv_sec + 1e-9 * t.tv_nsec;
}
ALWAYS_INLINE void timed(const int n_rows, int n, int n_q, int repeats, const double *x, const double *parameters,
                         double *seconds) {
  workspace work;
  int32_t piece[128] = {0};
  const tmc_batch batch = {.n_basis = n, .n_points = n_q, .n_pieces = 1, .piece_q = piece};
  if (!allocate(&work, &batch, 1)) return;
  const size_t rows = (size_t)n_q * n_rows * n, block = (size_t)POINTS_AT_ONCE * n_rows * n;
  for (size_t i = 0; i < rows; ++i) work.B_qra[i] = (vec){0.0} + 1e-3 * (double)(i % 17);
  static state at;
  static vec h[N_H];
  memcpy(at.x, x, sizeof at.x);
  const vec w = (vec){0.0} + 1.0;
  for (int part = 0; part < 3; ++part) {
    const double start = now();
    for (int repeat = 0; repeat < repeats; ++repeat)
      for (int q0 = 0; q0 < n_q; q0 += POINTS_AT_ONCE) {
        const int end = q0 + POINTS_AT_ONCE < n_q ? q0 + POINTS_AT_ONCE : n_q;
        for (int q = q0; part < 2 && q < end; ++q) {
          if (part == 0)
            point_tangent((const_lanes)at.x, parameters, (double *)&at.psi, (lanes)at.g, (lanes)h);
          if (part == 1)
            material_rows(n_rows, n, &w, h, work.B_qra + (size_t)q * n_rows * n,
                          work.D_kqra + (size_t)(q - q0) * n_rows * n, block);
        }
        if (part == 2)
          contract(n, (end - q0) * n_rows, work.B_qra + (size_t)q0 * n_rows * n, work.D_kqra, block, work.K_kab);
      }
    seconds[part] = (now() - start) / repeats;
  }
  free(work.allocated);
}
void benchmark(int first, int n, int n_q, int repeats, const double *x, const double *parameters, double *seconds) {
  if (first)
    timed(N_FIRST_ROWS, n, n_q, repeats, x, parameters, seconds);
  else
    timed(N_ROWS, n, n_q, repeats, x, parameters, seconds);
}
"""


def generated(name: str) -> KernelSource:
    """The generated C of an energy."""
    energy = DENSITIES[ENERGIES[name]]
    integrand = second_gradient_energy(energy.density, energy.name, energy.parameters)
    return generate(trace(integrand), energy.description, driver=CELL_DRIVER)


def build(source: KernelSource, directory: Path) -> ctypes.CDLL:
    """The kernel with the timed loop, compiled with the project's flags."""
    file, output = directory / "timed.c", directory / "timed.so"
    file.write_text(source.c_source + TIMED)
    flags = [*FLAGS, "-DTMC_USE_LIBMVEC", "-o", str(output), str(file), "-lmvec", "-lm"]
    subprocess.run([*compiler(), *flags], check=True)
    return ctypes.CDLL(str(output))


def parts(library: ctypes.CDLL, source: KernelSource, cell: str) -> dict[str, dict[str, float]]:
    """Operations and seconds a cell of the point kernel, the product w D B and the contraction; best of ten."""
    n, n_q = CELLS[cell]
    rows = N_FIRST_ROWS if cell in COMPOSITE else source.n_rows
    x = np.ascontiguousarray(np.random.default_rng(0).normal(scale=0.05, size=(LAYOUT.n_inputs, LANES)))
    parameters = np.array([VALUES[name] for name in source.parameters])
    best = np.full(3, np.inf)
    for _ in range(10):
        seconds = np.zeros(3)
        pointer = (ctypes.c_void_p(a.ctypes.data) for a in (x, parameters, seconds))
        library.benchmark(cell in COMPOSITE, n, n_q, 40, *pointer)
        best = np.minimum(best, seconds / LANES)
    operations = (
        n_q * source.operations["tangent"],
        n_q * 3 * 2 * rows * rows * n,
        n_q * 2 * rows * (n * (n + 1) + n * n),
    )
    labels = ("point kernel", "w D B", "contraction")
    return {
        label: {"flops": float(flops), "seconds": float(time), "gflops": flops / time / 1e9}
        for label, flops, time in zip(labels, operations, best, strict=True)
    }


def products(rows: int, n: int, n_q: int, composite: bool) -> int:
    """Multiplications and additions, in pairs, of a cell's tangent beside the point kernel; see smooth.c for composite
    functions with second gradients."""
    apart = composite and rows > N_FIRST_ROWS
    at_points, half_and_whole = N_FIRST_ROWS if apart else rows, n * (n + 1) + n * n
    total = n_q * (at_points * half_and_whole + 3 * at_points**2 * n)
    if not apart:
        return total
    n_moments, n_entries, n_pairs = 3 * (rows - N_FIRST_ROWS), 36, 6
    total += n_q * (4 * n_moments * N_FIRST_ROWS * n + n_entries * n_pairs)
    return total + 3 * n_moments**2 * n + 2 * n_moments * half_and_whole


def dgemm() -> float:
    """Gflop/s of numpy's matrix product."""
    a = np.random.default_rng(0).normal(size=(1200, 1200))
    return 2e-9 * 1200**3 / interleaved({"": lambda: a @ a})[""].best


def bandwidth() -> float:
    """GB/s of a copy that does not fit into a cache, read and written bytes counted."""
    a = np.ones(2**24)
    b = np.empty_like(a)
    return 2e-9 * a.nbytes / interleaved({"": lambda: np.copyto(b, a)})[""].best


def whole_tangent(kind: str, name: str) -> dict[str, float]:
    """The kernel with insertion on a mesh of 64k dofs: operations, seconds, bytes that come from memory, a cell."""
    reuse_freed()  # as every run does
    system = VemSystem(distribute(MPI.COMM_WORLD, lambda: square(kind, 64e3)), {"body": region(name)})
    matrix, u = system.create_matrix(), system.create_vector()
    u.getArray()[:] = bend(system.node_labels()[:, :2]).ravel()
    seconds = interleaved({"": lambda: system.jacobian(u, matrix)})[""].best
    source, flops, n_bytes = generated(name), 0.0, 0.0
    rows = source.n_rows
    for block in system.blocks:
        n, n_q, cells = block.batch.n_basis, block.batch.n_points, len(block.cells)
        flops += cells * (
            2.0 * products(rows, n, n_q, block.batch.pieces is not None) + n_q * source.operations["tangent"]
        )
        positions = Tangents(None, None, np.empty((cells, n, n), dtype=np.int32))
        assert positions.position_cab is not None
        n_bytes += block.batch.nbytes + positions.position_cab.nbytes
    values = matrix.getInfo()["nz_used"] * 8.0
    n_cells = system.n_cells_global
    return {
        "flops": flops / n_cells,
        "seconds": seconds / n_cells,
        "bytes": (n_bytes + 2.0 * values) / n_cells,
        "gflops": flops / seconds / 1e9,
        "intensity": flops / (n_bytes + 2.0 * values),
    }


def main() -> None:
    """Print rates and write them."""
    peak, memory = dgemm(), bandwidth()
    results: dict[str, Any] = {"dgemm_gflops": peak, "copy_gbytes": memory, "parts": {}, "whole": {}}
    rows = []
    for name in ("huhu_lulu", "angle", "solid"):
        source = generated(name)
        with tempfile.TemporaryDirectory() as scratch:
            library = build(source, Path(scratch))
            for cell, (n, n_q) in CELLS.items():
                found = parts(library, source, cell)
                results["parts"][f"{name}, {cell}"] = found
                cells = [f"{p['gflops']:.1f} ({100 * p['gflops'] / peak:.0f} %)" for p in found.values()]
                rows.append((f"{name}, {cell}, {n} functions, {n_q} points", *cells))
    for name in ("huhu_lulu", "angle"):
        for kind in DOFS_PER_CELL:
            whole = results["whole"][f"{name}, {kind}"] = whole_tangent(kind, name)
            rate = f"{whole['gflops']:.1f} ({100 * whole['gflops'] / peak:.0f} %)"
            rows.append((f"{name}, {kind}: tangent into the matrix", "", "", rate))
    title = f"Gflop/s (fraction of dgemm's {peak:.1f}; memory copies {memory:.1f} GB/s)"
    report("kernel_rates", title, ("energy, cell", "point kernel", "w D B", "contraction"), rows, results)


if __name__ == "__main__":
    main()
