"""Every compiler: kernels compile without a warning, and what cannot compile them says so in one line."""

from __future__ import annotations

import platform
import re
import shlex
import shutil
import subprocess
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from codegen import build
from codegen.by_parameters import parameter_source
from codegen.compiler import generate
from codegen.driver import Driver
from codegen.errors import CodegenError
from codegen.integrand import second_gradient_energy
from codegen.kernel import TANGENT, compile_energy
from codegen.trace import trace
from tmc_vem.energy import PAPER_DENSITIES
from tmc_vem.vem.facets.compiled import SIDE_DRIVER
from tmc_vem.vem.facets.energy import facet_integrand
from tmc_vem.vem.kernel.cells import compile_cells
from tmc_vem.vem.kernel.driver import CELL_DRIVER, PARAMETER_DRIVER

WARNINGS = ("-Wall", "-Wextra", "-Wshadow", "-Wstrict-prototypes", "-Wvla", "-Werror")
NAMES = ("gcc", "clang", "cc", *(f"gcc-{n}" for n in range(9, 17)), *(f"clang-{n}" for n in range(11, 22)))
# What -march=native may come to; the driver has other tiles and other products for each.
MACHINES = ("x86-64", "x86-64-v3", "x86-64-v4") if platform.machine() == "x86_64" else ("native",)
TWO_KINDS = ("solid", "medium_angle_damped")  # kernels with and without the second gradient


def compilers() -> list[str]:
    """Every gcc and clang of this machine, each once."""
    found = {str(Path(path).resolve()): name for name in reversed(NAMES) if (path := shutil.which(name))}
    return sorted(found.values())


@cache
def c_source(name: str, driver: Driver | None) -> str:
    energy = PAPER_DENSITIES[name]
    traced = trace(second_gradient_energy(energy.density, energy.name, energy.parameters))
    return generate(traced, energy.description, driver=driver).c_source


def assert_silent(monkeypatch, directory: Path, compiler: str, name: str, driver: Driver | None = CELL_DRIVER) -> None:
    assert_source_is_silent(monkeypatch, directory, compiler, name, c_source(name, driver))


def assert_source_is_silent(monkeypatch, directory: Path, compiler: str, name: str, text: str) -> None:
    monkeypatch.setenv("CC", compiler)
    source = directory / f"{name}.c"
    source.write_text(text)
    command = [*build.compile_commands(source, directory / f"{name}.so")[0], *WARNINGS]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (run.returncode, run.stderr) == (0, ""), shlex.join(command)


@pytest.mark.parametrize("compiler", compilers())
@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize("name", TWO_KINDS)
def test_no_compiler_warns_about_a_kernel(monkeypatch, tmp_path, compiler, machine, name):
    """All that the driver knows of an energy is whether it has a second gradient."""
    monkeypatch.setattr(build, "FLAGS", tuple(re.sub("=native$", f"={machine}", flag) for flag in build.FLAGS))
    assert_silent(monkeypatch, tmp_path, compiler, name)


@pytest.mark.parametrize("compiler", compilers())
@pytest.mark.parametrize("full", [False, True])
def test_nor_about_one_of_sides(monkeypatch, tmp_path, compiler, full):
    energy = PAPER_DENSITIES["medium_angle_damped"]
    medium = second_gradient_energy(energy.density, energy.name, energy.parameters)
    source = generate(trace(facet_integrand(medium, full)), driver=SIDE_DRIVER).c_source
    assert_source_is_silent(monkeypatch, tmp_path, compiler, "sides", source)


@pytest.mark.parametrize("compiler", compilers())
@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize("name", TWO_KINDS)
def test_nor_about_derivatives_by_parameters(monkeypatch, tmp_path, compiler, machine, name):
    monkeypatch.setattr(build, "FLAGS", tuple(re.sub("=native$", f"={machine}", flag) for flag in build.FLAGS))
    energy = PAPER_DENSITIES[name]
    traced = trace(second_gradient_energy(energy.density, energy.name, energy.parameters))
    for driver in (PARAMETER_DRIVER, None):
        assert_source_is_silent(monkeypatch, tmp_path, compiler, name, parameter_source(traced, driver))


@pytest.mark.parametrize("compiler", compilers())
def test_nor_about_those_of_an_energy_without_parameters(monkeypatch, tmp_path, compiler):
    text = parameter_source(trace(second_gradient_energy(square, "square")), PARAMETER_DRIVER)
    assert_source_is_silent(monkeypatch, tmp_path, compiler, "square", text)


@pytest.mark.parametrize("compiler", compilers())
@pytest.mark.parametrize("name", PAPER_DENSITIES)
def test_nor_about_one_without_a_driver(monkeypatch, tmp_path, compiler, name):
    assert_silent(monkeypatch, tmp_path, compiler, name, None)


@pytest.mark.parametrize("compiler", compilers())
def test_kernels_of_all_compilers_agree(monkeypatch, compiler):
    energy, x_nx = PAPER_DENSITIES["medium_angle_damped"], np.random.default_rng(1).uniform(-0.1, 0.1, (16, 12))
    values = {"mu": 2.0, "gamma": 1e-3, "alpha_r": 0.5, "beta": 5.0}
    results = []
    for command in ("gcc", compiler):
        monkeypatch.setenv("CC", command)
        kernel = compile_energy(energy.density, energy.name, energy.parameters)
        results.append(kernel.points(TANGENT, x_nx, kernel.parameter_array(values)))
    for expected, found in zip(*results, strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-13)


@pytest.fixture
def cache_directory(tmp_path, monkeypatch) -> Path:
    monkeypatch.setenv(build.CACHE_VARIABLE, str(tmp_path / "cache"))
    return tmp_path / "cache"


def square(F, G, p, m):
    return F[0][0] * F[0][0]


def test_a_warning_does_not_stop_a_run(cache_directory):
    cache_directory.mkdir()
    build.compile_library("void f(void) { int unused; }\n", cache_directory / "mine.so")
    assert (cache_directory / "mine.so").exists()


def without_vectors(directory: Path, said: str) -> str:
    """A compiler that takes vector types for doubles, as tcc does, and says little about assertions."""
    path = directory / "no-vectors"
    path.write_text(
        "#!/bin/sh\n"
        'for last in "$@"; do case "$last" in *.c) sed -i "s/vector_size([^)]*), *//" "$last";; esac; done\n'
        f'gcc "$@" >"{directory}/said" 2>&1 && exit 0\n'
        f"line=$(sed -n 's/.*\\.c:\\([0-9]*\\):.*error:.*/\\1/p' {directory}/said | head -n 1)\n"
        f'echo "kernel.c:$line: {said}" >&2\nexit 1\n'
    )
    path.chmod(0o755)
    return str(path)


def test_a_compiler_without_vector_types_is_refused_in_words(cache_directory, monkeypatch, tmp_path):
    monkeypatch.setenv("CC", without_vectors(tmp_path, "error: negative width in bit-field '__error_if_negative'"))
    with pytest.raises(
        CodegenError, match=r"/no-vectors failed: it ignores vector types, .*; set CC to gcc or clang$"
    ) as caught:
        compile_cells(second_gradient_energy(square, "square"))
    assert "\n" not in str(caught.value)


@pytest.mark.skipif(shutil.which("tcc") is None, reason="there is no tcc")
def test_tcc_is_refused_in_words(cache_directory, monkeypatch):
    monkeypatch.setenv("CC", "tcc")
    with pytest.raises(CodegenError, match=r"/tcc failed: it ignores vector types, which kernels are made of; set CC"):
        compile_cells(second_gradient_energy(square, "square"))


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("true", "/true failed: it made no library and said nothing"),
        ("false", "/false failed: it made no library and said nothing"),
        ("sh -c 'echo out of licences; exit 1' --", "failed: out of licences"),
        ('gcc "', r'CC=gcc " is no command \(No closing quotation\); set CC to gcc or clang'),
        ("  ", r"no C compiler found \(tried CC=  \)"),
        ("/", "no C compiler found"),
        ("gcc -no-such-option", "error: unrecognized command-line option"),
    ],
)
def test_what_is_no_c_compiler_is_named_in_one_line(cache_directory, monkeypatch, command, message):
    monkeypatch.setenv("CC", command)
    monkeypatch.setenv("LC_ALL", "C")
    with pytest.raises(CodegenError, match=message) as caught:
        compile_energy(square, "square", ())
    assert "\n" not in str(caught.value)
    assert not list(cache_directory.glob("*.so"))


def test_a_compiler_behind_another_program_is_part_of_the_key(cache_directory, monkeypatch, tmp_path):
    program = tmp_path / "my-gcc"
    program.write_text('#!/bin/sh\nexec gcc "$@"\n')
    program.chmod(0o755)
    monkeypatch.setenv("CC", f"env {program}")
    first = build.library_path("square", "1")
    program.write_text('#!/bin/sh\nexec gcc -DOTHER "$@"\n')
    build._toolchain_key.cache_clear()
    assert build.library_path("square", "1") != first
