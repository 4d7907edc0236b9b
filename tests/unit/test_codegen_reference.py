"""Energies that have no derivatives at F = I, or none of second order at all: said in words, by every command."""

from __future__ import annotations

import math
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
import test_codegen_cli as codegen_cli
from test_codegen_compilers import WARNINGS

from codegen import build, oracle
from codegen.compiler import generate
from codegen.integrand import second_gradient_energy
from codegen.kernel import TANGENT, compile_energy
from codegen.reference import fault_at_reference
from codegen.trace import trace
from codegen.verify import verify
from tmc_vem import Box, Medium, RunOptions, run
from tmc_vem.support.errors import InputError

ROOT_OF_ZERO = "a square root is zero at F = I, its derivative is infinite: write m.sqrt(x + eps)"
ALL = [(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)]


def det(F):
    return F[0][0] * F[1][1] - F[0][1] * F[1][0]


def shear_stress(F, G, p, m):
    return p.s * (F[0][1] + F[1][0])


def only_g(F, G, p, m):
    return p.s * G[0][0][0]


def length_of_g(F, G, p, m):
    return m.sqrt(sum(G[i][j][k] ** 2 for i, j, k in ALL))


def stretches(F, G, p, m):
    c11, c22 = F[0][0] ** 2 + F[1][0] ** 2, F[0][1] ** 2 + F[1][1] ** 2
    c12 = F[0][0] * F[0][1] + F[1][0] * F[1][1]
    d = m.sqrt((c11 - c22) ** 2 + 4 * c12**2)
    return (m.sqrt((c11 + c22 + d) / 2) + m.sqrt((c11 + c22 - d) / 2) - 2) ** 2


def with_numpy(F, G, p, m):
    C = np.array(F).T @ np.array(F)
    return np.trace(C) - 2 - 2 * m.log(det(F))


def numpy_det(F, G, p, m):
    return (np.linalg.det(np.array(F)) - 1) ** 2


def root_of_negative(F, G, p, m):
    return (det(F) - 1.5) ** (1 / 3)


def named(function):
    return function.__name__


@pytest.mark.parametrize("density", [shear_stress, only_g], ids=named)
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_kernels_without_a_hessian_compile_without_a_warning(density, compiler, monkeypatch, tmp_path):
    monkeypatch.setenv("CC", compiler)
    if not any(Path(directory, compiler).exists() for directory in ("/usr/bin", "/usr/local/bin")):
        pytest.skip(f"there is no {compiler}")
    source = tmp_path / "kernel.c"
    source.write_text(generate(trace(second_gradient_energy(density, "mine", ("s",)))).c_source)
    command = [*build.compile_commands(source, tmp_path / "kernel.so")[0], *WARNINGS]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert not done.stderr
    assert done.returncode == 0


@pytest.mark.parametrize("density", [shear_stress, only_g], ids=named)
@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_linear_energy_has_no_stiffness_and_its_check_is_finite(density):
    kernel = compile_energy(density, "mine", ("s",))
    psi_n, g_nx, h_nxy = kernel.points(TANGENT, np.full((1, 12), 0.1), np.array([2.0]))
    assert np.count_nonzero(g_nx) == len({float(psi_n[0])}) * (2 if density is shear_stress else 1)
    assert not h_nxy.any()
    findings = {finding.what: finding for finding in verify(kernel, density, {"s": 2.0})}
    assert findings["Hessian symmetric, against differences"].passed
    assert findings["stress at F = I"].measured == "1.0e+00"
    assert not any("nan" in finding.measured or "e+3" in finding.measured for finding in findings.values())


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (length_of_g, re.escape(ROOT_OF_ZERO)),
        (stretches, re.escape(ROOT_OF_ZERO)),
        (lambda F, G, p, m: m.sqrt(det(F) - 2), "a square root is taken of -1 at F = I"),
        (lambda F, G, p, m: m.log(det(F) - 1), "a logarithm is taken of 0 at F = I"),
        (lambda F, G, p, m: G[0][0][0] / (F[0][0] - 1), "it divides by zero at F = I: add a small number"),
        (lambda F, G, p, m: 1 / (F[0][0] - F[1][1]), "it divides by zero at F = I"),
        (lambda F, G, p, m: (F[0][0] - 1) ** -2, "a power -2 is taken of zero at F = I"),
        (
            lambda F, G, p, m: (G[0][0][0] ** 2) ** 0.75,
            r"a power 0.75 is taken of zero at F = I, .*: write \(x",
        ),
        (lambda F, G, p, m: m.atan2(F[1][0], F[0][1]), r"m.atan2\(0, 0\) is taken at F = I"),
        (lambda F, G, p, m: m.exp(1e6 * F[0][0]), "exp of 1e.06 is too large a number at F = I"),
        (root_of_negative, "a power 0.333333 is taken of -0.5 at F = I: of negative numbers"),
        (lambda F, G, p, m: (G[0][0][0] ** 2) ** 2.5 + m.sqrt(det(F)) + m.log(F[0][0]), "^$"),
    ],
)
def test_the_operation_without_derivatives_is_named(function, words):
    found = fault_at_reference(trace(second_gradient_energy(function, "mine", ())), {})
    assert re.search(words, found), found


@pytest.fixture
def file(tmp_path, monkeypatch):
    """Energies in a file of their own in the current directory."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(
        "import numpy as np\n"
        "def length(F, G, p, m):\n"
        "    return m.sqrt(sum(G[i][j][k] ** 2 for i in (0, 1) for j in (0, 1) for k in (0, 1)))\n"
        "def trace(F, G, p, m):\n"
        "    return np.trace(np.array(F).T @ np.array(F)) - 2 - 2 * m.log(F[0][0] * F[1][1] - F[0][1] * F[1][0])\n"
        "def det(F, G, p, m):\n"
        "    return (np.linalg.det(np.array(F)) - 1) ** 2\n"
    )


def test_check_and_show_say_what_is_wrong_at_the_reference(file):
    checked = codegen_cli.run("mine.py:length", "--check")
    assert checked.exit_code == 1
    assert f"FAIL: A derivative of the energy is infinite or not a number at F = I: {ROOT_OF_ZERO}.\n" in checked.stdout
    assert "subtract it" not in checked.stdout
    shown = codegen_cli.run("mine.py:length", "--show")
    assert shown.exit_code == 0
    assert shown.stdout.endswith(f"note: {ROOT_OF_ZERO}\n")


@pytest.mark.parametrize("method", ["vem", "fem"])
def test_a_run_says_it_too(method, file):
    medium = Medium(regulariser="mine.py:length")
    with pytest.raises(InputError, match=r"in the undeformed state: region 'medium': a square root is zero at F = I"):
        run(Box((20, 10), medium, uy=-0.05), None, RunOptions(method=method, steps=1))


@pytest.mark.parametrize("method", ["vem", "fem"])
def test_numpy_inside_runs_or_is_refused_in_words(method, file):
    problem = Box((20, 10), Medium(regulariser="mine.py:trace"), uy=-0.02)
    options = RunOptions(method=method, steps=1)
    if method == "vem":
        assert run(problem, None, options).complete
    else:
        with pytest.raises(InputError, match=r"energy 'medium_trace_damped' uses numpy, .* or use --method vem"):
            run(problem, None, options)


def test_numpy_inside_is_checked_state_by_state_or_refused_in_words(file):
    checked = codegen_cli.run("mine.py:trace", "--check")
    assert checked.exit_code == 0, checked.stdout
    assert checked.stdout.rstrip().endswith("trace: verified")
    refused = codegen_cli.run("mine.py:det", "--check")
    assert refused.exit_code == 2
    assert "energy 'det': numpy cannot compute with F and G (" in refused.stderr
    assert "write it with F[i][j], arithmetic and m" in refused.stderr


def test_a_third_power_of_a_negative_number_is_no_number_anywhere():
    """Neither in the kernel's energy, which C's cbrt would give a value, nor in its derivatives, nor in numpy."""
    kernel = compile_energy(root_of_negative, "mine", ())
    x_nx = np.zeros((2, 12))
    x_nx[1, 0] = 1.0  # J = 2
    psi_n, g_nx, h_nxy = kernel.points(TANGENT, x_nx, np.zeros(0))
    with np.errstate(invalid="ignore"):
        expected = oracle.energy_density(root_of_negative, x_nx, {})
    assert np.isnan(expected[0])
    assert np.isnan(psi_n[0])
    assert np.isnan(g_nx[0, 0])
    assert np.isnan(h_nxy[0, 0, 0])
    assert psi_n[1] == pytest.approx(expected[1]) == pytest.approx(math.cbrt(0.5))


@pytest.mark.parametrize("method", ["vem", "fem"])
def test_a_run_from_a_negative_base_is_refused_in_words(method):
    medium = Medium(regulariser=root_of_negative)
    with pytest.raises(InputError, match=r"region 'medium': a power 0\.333333 is taken of -0\.5 at F = I"):
        run(Box((20, 10), medium, uy=-0.05), None, RunOptions(method=method, steps=1))
