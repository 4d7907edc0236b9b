"""Generated point kernels: vectorised against scalar, accuracy, and how long it takes to get one.

Run ``python benchmarks/point_kernel.py [NAME ...]``; it takes about half a minute and uses one core. Both variants are
the same generated C, compiled with the flags of the project; the scalar one without vectorisation. What is timed is
the evaluation of batches of points alone, in one run and interleaved, so that the ratio does not depend on what else
the machine does.
"""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import click
import numpy as np
from rich.console import Console
from rich.table import Table

from codegen.build import FLAGS, compiler
from codegen.compiler import generate
from codegen.integrand import second_gradient_energy
from codegen.sampling import REGIMES, sample
from codegen.trace import trace
from tmc_vem.energy import DENSITIES

LEVELS = ("energy", "gradient", "tangent")
PARAMETERS = {"K": 20.0, "mu": 10.0, "gamma": 1e-3, "alpha_r": 0.7, "beta": 5.0}
N_BATCHES, REPEATS, TARGET = 4, 3000, 2.5  # four batches stay in the first-level cache, as in the cell driver

# Appended to the kernel, whose point functions are static.
TIMED_LOOP = """
#include <time.h>
double benchmark(int n_batches, int level, int repeats, const double *x_bkv, const double *parameters) {
  static double psi[N_BATCHES][LANES], g[N_BATCHES][N_X][LANES], h[N_BATCHES][N_H][LANES];
  static double x[N_BATCHES][N_X][LANES];
  memcpy(x, x_bkv, sizeof x);
  struct timespec start, end;
  clock_gettime(CLOCK_MONOTONIC, &start);
  for (int r = 0; r < repeats; ++r)
    for (int b = 0; b < n_batches; ++b) {
      if (level == TMC_ENERGY) point_energy(x[b], parameters, psi[b]);
      if (level == TMC_GRADIENT) point_gradient(x[b], parameters, psi[b], g[b]);
      if (level == TMC_TANGENT) point_tangent(x[b], parameters, psi[b], g[b], h[b]);
    }
  clock_gettime(CLOCK_MONOTONIC, &end);
  return (end.tv_sec - start.tv_sec + 1e-9 * (end.tv_nsec - start.tv_nsec)) / ((double)repeats * n_batches * LANES);
}
"""

SCALAR = ("-fno-tree-vectorize", "-fno-tree-slp-vectorize")
VECTOR = ("-DTMC_USE_LIBMVEC",)


def build(source: str, directory: Path, flags: tuple[str, ...], libraries: tuple[str, ...]) -> ctypes.CDLL:
    """The kernel with the timed loop, compiled with the project's flags and ``flags``."""
    stem = "vector" if flags == VECTOR else "scalar"
    (directory / f"{stem}.c").write_text(source + TIMED_LOOP)
    output = directory / f"{stem}.so"
    subprocess.run(
        [*compiler(), *FLAGS, *flags, f"-DN_BATCHES={N_BATCHES}", "-o", output, directory / f"{stem}.c", *libraries],
        check=True,
    )
    library = ctypes.CDLL(str(output))
    library.benchmark.restype = ctypes.c_double
    return library


def seconds_per_point(library: ctypes.CDLL, level: int, x_bkv: np.ndarray, parameters: np.ndarray) -> float:
    """Mean time of a point in one run."""
    address = ctypes.c_void_p
    return float(
        library.benchmark(len(x_bkv), level, REPEATS, address(x_bkv.ctypes.data), address(parameters.ctypes.data))
    )


def compare(name: str) -> list[tuple[str, float, float]]:
    """Level, seconds a point scalar and vectorised; the best of ten interleaved runs of each."""
    energy = DENSITIES[name]
    integrand = second_gradient_energy(energy.density, name, energy.parameters)
    source = generate(trace(integrand)).c_source
    x_nx = sample(REGIMES[1], N_BATCHES * 8, np.random.default_rng(0), 90.0 if "tangent" in name else 180.0)
    x_bkv = np.ascontiguousarray(x_nx.reshape(N_BATCHES, 8, 12).transpose(0, 2, 1))
    parameters = np.array([PARAMETERS[p] for p in energy.parameters])
    with tempfile.TemporaryDirectory() as scratch:
        scalar = build(source, Path(scratch), SCALAR, ("-lm",))
        vector = build(source, Path(scratch), VECTOR, ("-lmvec", "-lm"))
        rows = []
        for level, label in enumerate(LEVELS):
            best = [np.inf, np.inf]
            for _ in range(10):
                for n, library in enumerate((scalar, vector)):
                    best[n] = min(best[n], seconds_per_point(library, level, x_bkv, parameters))
            rows.append((label, best[0], best[1]))
    return rows


def time_to_first_kernel(name: str) -> tuple[float, float]:
    """Seconds from the import of the generator to a loaded kernel in a fresh process: cold cache, then cached."""
    code = (
        "import time, numpy; t = time.perf_counter(); from tmc_vem.vem.kernel.cells import compile_cells;"
        "from codegen.integrand import second_gradient_energy as energy;"
        f"from tmc_vem.energy import DENSITIES; e = DENSITIES[{name!r}];"
        "compile_cells(energy(e.density, e.name, e.parameters)); print(time.perf_counter() - t)"
    )
    with tempfile.TemporaryDirectory() as cache:
        environment = {**os.environ, "TMC_VEM_CACHE": cache}
        run = [sys.executable, "-c", code]
        times = [
            float(subprocess.run(run, env=environment, capture_output=True, text=True, check=True).stdout)
            for _ in range(4)
        ]
    return times[0], min(times[1:])


@click.command()
@click.argument("names", nargs=-1)
def main(names: tuple[str, ...]) -> None:
    """Print the ratios, and whether the vectorised tangent of the damped angle regulariser misses its target."""
    console = Console(highlight=False)
    table = Table(title="Point kernels, nanoseconds a point on one core", title_justify="left")
    for heading in ("energy", "level", "scalar", "vectorised", "ratio"):
        table.add_column(heading, justify="left" if heading in ("energy", "level") else "right")
    missed = False
    for name in names or ("solid", "medium_huhu_lulu_damped", "medium_angle_damped"):
        for label, scalar, vector in compare(name):
            table.add_row(name, label, f"{scalar * 1e9:.1f}", f"{vector * 1e9:.1f}", f"{scalar / vector:.2f}")
            missed |= name == "medium_angle_damped" and scalar / vector < TARGET
    console.print(table)
    started = time.perf_counter()
    cold, cached = time_to_first_kernel("medium_angle_damped")
    console.print(f"medium_angle_damped usable after {cold:.2f} s with a cold cache, {cached * 1e3:.0f} ms cached")
    console.print(
        f"(measured in {time.perf_counter() - started:.1f} s, each in a fresh process, import of numpy excluded)"
    )
    if missed:
        console.print(f"vectorisation gains less than {TARGET}")


if __name__ == "__main__":
    main()
