"""gcc vectorises the point kernels, exponential and logarithm included, without -ffast-math."""

from __future__ import annotations

import re
import subprocess
from functools import cache
from pathlib import Path

import pytest

from codegen.build import FLAGS, compiler
from codegen.compiler import generate
from codegen.integrand import second_gradient_energy
from codegen.trace import trace
from tmc_vem.energy import DENSITIES
from tmc_vem.vem.kernel.driver import CELL_DRIVER

LEVELS = ("energy", "gradient", "tangent")


@cache
def has_libmvec() -> bool:
    run = subprocess.run(
        [*compiler(), "-shared", "-o", "/dev/null", "-x", "c", "/dev/null", "-lmvec"], capture_output=True, check=False
    )
    return run.returncode == 0


@pytest.fixture(scope="module", params=["solid", "medium_angle_damped"])
def assembled(request, tmp_path_factory) -> tuple[str, str, str]:
    """C source, assembly and the compiler's vectorisation report."""
    if not has_libmvec():
        pytest.skip("this system has no libmvec")
    energy = DENSITIES[request.param]
    source = generate(
        trace(second_gradient_energy(energy.density, energy.name, energy.parameters)), driver=CELL_DRIVER
    ).c_source
    path: Path = tmp_path_factory.mktemp("vectorised") / "kernel.c"
    path.write_text(source)
    flags = [flag for flag in FLAGS if flag != "-shared"]
    command = [*compiler(), *flags, "-DTMC_USE_LIBMVEC", "-S", "-fopt-info-vec-optimized", "-o", "-", str(path)]
    run = subprocess.run(command, capture_output=True, text=True, check=True)
    return source, run.stdout, run.stderr


def test_calls_of_vector_functions_and_no_scalar_ones(assembled):
    _, assembly, _ = assembled
    called = set(re.findall(r"(?:call|jmp)\s+(?:\*)?\"?(\w+)", assembly))
    assert {name for name in called if re.fullmatch(r"_ZGV\w+v_exp", name)}
    assert {name for name in called if re.fullmatch(r"_ZGV\w+v_log", name)}
    assert not called & {"exp", "log", "log1p", "expm1", "pow", "fma"}


@pytest.mark.parametrize("level", LEVELS)
def test_the_loop_over_points_is_in_the_compilers_report(assembled, level):
    source, _, report = assembled
    lines = source.splitlines()
    start = next(n for n, line in enumerate(lines) if line.startswith(f"static void point_{level}("))
    loop = next(n for n, line in enumerate(lines[start:], start + 1) if "for (int v = 0; v < LANES; ++v)" in line)
    assert re.search(rf":{loop}:\d+: optimized: loop vectorized using (16|32|64) byte vectors", report)


def test_nan_and_infinity_stay_visible():
    assert not {"-ffast-math", "-Ofast", "-ffinite-math-only", "-funsafe-math-optimizations"} & set(FLAGS)
