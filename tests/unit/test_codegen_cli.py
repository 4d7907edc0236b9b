"""``tmc-vem codegen`` and ``python -m codegen`` as a user sees them."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import sys
from pathlib import Path

import click
import pytest
from click.testing import CliRunner, Result

from codegen.backends import cuda
from codegen.build import compiler
from codegen.cli import make_command
from tmc_vem.cli.codegen import main
from tmc_vem.energy import PAPER_DENSITIES

MY_ENERGIES = """
from codegen import energy

@energy(parameters={"kappa": 0.1})
def bending(F, G, p, m):
    return p.kappa / 2 * sum((G[i][0][0] + G[i][1][1])**2 for i in (0, 1))

def plain(F, G, p, m):
    return p.kappa * G[0][0][0] ** 2 + p.kappa * G[1][0][0] ** 2

def resists_rotation(F, G, p, m):
    return (F[0][1] - F[1][0]) ** 2

def wrong_gradient(F, G, p, m):
    return [[0, 0], [0, 0]], [[[p.kappa * G[i][j][k] for k in (0, 1)] for j in (0, 1)] for i in (0, 1)]

@energy(parameters={"kappa": 2.0}, gradient=wrong_gradient)
def with_gradient(F, G, p, m):
    return p.kappa * sum(G[i][j][k] ** 2 for i in (0, 1) for j in (0, 1) for k in (0, 1))
"""

needs_cpp = pytest.mark.skipif(not (shutil.which("g++") or shutil.which("clang++")), reason="there is no C++ compiler")
POINTS = make_command()  # without the cell driver, which takes most of the time to compile and is no part of the check


@pytest.fixture(autouse=True)
def _directory(tmp_path, monkeypatch):
    (tmp_path / "mine.py").write_text(MY_ENERGIES)
    monkeypatch.chdir(tmp_path)


def runner() -> CliRunner:
    try:
        return CliRunner(mix_stderr=False)
    except TypeError:  # since click 8.2 the two are always apart
        return CliRunner()


def run(*arguments: str, command: click.Command = main) -> Result:
    result = runner().invoke(command, arguments)
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def test_writes_a_kernel_with_its_provenance(tmp_path):
    result = run("mine.py:bending", "-o", "out", "--param", "kappa=0.5")
    assert result.exit_code == 0
    assert result.stdout == "wrote out/bending.c\nwrote out/bending.h\n"
    for name in ("bending.c", "bending.h"):
        text = (tmp_path / "out" / name).read_text()
        assert text.startswith("/* Energy: bending\n * Parameters, in the order of the array: kappa\n")
        assert "Operations at a point after (before) sharing subexpressions: energy 7 (" in text
        assert "sympy" in text
        assert "Python" in text


def test_the_written_files_work_in_a_c_program(tmp_path):
    assert run("mine.py:plain", "-o", ".", "--param", "kappa=1").exit_code == 0
    (tmp_path / "use.c").write_text(
        '#include "plain.h"\n'
        "double energy(double kappa) {\n"
        "  double x[12] = {0}, psi;\n  x[4] = 3.0;\n"
        "  tmc_points(TMC_ENERGY, 1, x, &kappa, &psi, 0, 0);\n  return psi;\n}\n"
    )
    flags = ["-std=gnu99", "-Wall", "-Wextra", "-Werror", "-O1", "-fPIC", "-shared", "-o", "use.so"]
    subprocess.run([*compiler(), *flags, "plain.c", "use.c", "-lm"], check=True)
    library = ctypes.CDLL(str(tmp_path / "use.so"))
    library.energy.restype, library.energy.argtypes = ctypes.c_double, [ctypes.c_double]
    assert library.energy(2.0) == 18.0


def test_writes_device_source_complete_in_one_file(tmp_path):
    result = run("mine.py:bending", "--target", "cuda", "-o", "out")
    assert (result.exit_code, result.stdout) == (0, "wrote out/bending.cu\n")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["bending.cu"]
    text = (tmp_path / "out" / "bending.cu").read_text()
    assert text.startswith("/* Energy: bending\n * Parameters, in the order of the array: kappa\n")
    assert " * Kernels: tmc_bending_energy, tmc_bending_gradient, tmc_bending_tangent, tmc_bending_jacobian\n" in text


@needs_cpp
def test_device_source_is_checked_as_plain_cpp():
    result = run("mine.py:bending", "--target", "cuda", "--check")
    assert result.exit_code == 0, result.stdout + result.stderr
    assert "bending: verified\n" in result.stdout
    assert result.stdout.endswith("run on this machine's processor, not on a GPU.\n")
    assert run("mine.py:resists_rotation", "--target", "cuda", "--check").exit_code == 1


@needs_cpp
def test_faults_of_device_source_are_found(monkeypatch):
    """The check is of the source that is written, not of the C kernel."""
    original = cuda.CudaBackend.output
    wrong = lambda self, target, value: original(self, target, f"1.001 * ({value})" if target == "g[4]" else value)  # noqa: E731
    monkeypatch.setattr(cuda.CudaBackend, "output", wrong)
    result = run("mine.py:bending", "--target", "cuda", "--check")
    assert result.exit_code == 1
    assert "FAIL: The gradient is not that of the energy." in result.stdout


def test_without_a_cpp_compiler_device_source_is_written_but_not_checked(tmp_path, monkeypatch):
    monkeypatch.setenv("CXX", "no-such-program")
    result = run("mine.py:bending", "--target", "cuda", "-o", "out", "--check")
    assert result.exit_code == 2
    assert result.stderr.startswith("Error: no C++ compiler found (tried CXX=no-such-program): install g++")
    assert (tmp_path / "out" / "bending.cu").exists()


def test_help_says_what_a_target_is_for():
    text = " ".join(run("--help").stdout.split())
    assert "[c|cuda]" in text
    assert "cuda is a source to build into programs of your own: tmc-vem itself does not run on GPUs yet." in text


def test_the_cell_driver_is_part_of_kernels_of_this_package_only(tmp_path):
    for directory, command in (("cells", main), ("points", POINTS)):
        assert run("mine.py:bending", "-o", directory, command=command).exit_code == 0
        text = (tmp_path / directory / "bending.c").read_text()
        header = (tmp_path / directory / "bending.h").read_text()
        assert ("tmc_cells" in text, "tmc_cells" in header) == (directory == "cells",) * 2
        assert "tmc_points" in text
        assert "tmc_points" in header
        run("mine.py:bending", "--target", "cuda", "-o", directory, command=command)
        device = (tmp_path / directory / "bending.cu").read_text()
        assert ("tmc_bending_stiffness(" in device) == (directory == "cells")
        assert "tmc_bending_tangent(" in device
    assert run("mine.py:bending", "--check", command=POINTS).exit_code == 0


@pytest.mark.parametrize(
    ("name", "command"),
    [(name, main) for name in PAPER_DENSITIES] + [(name, POINTS) for name in ("huhu", "huhu_lulu", "angle", "tangent")],
)
def test_every_built_in_energy_passes_its_check(name, command):
    result = run(f"tmc_vem.energy:{name}", "--check", command=command)
    assert result.exit_code == 0, result.stdout + result.stderr
    assert result.stdout.rstrip().endswith(f"{name}: verified")
    assert "FAIL" not in result.stdout


def test_the_medium_alone_and_a_file_path(request):
    path = request.config.rootpath / "tmc_vem" / "energy" / "densities.py"
    result = run(f"{path}:medium", "--check", "--param", "mu=5", command=POINTS)
    assert result.exit_code == 0
    assert "medium: mu = 5" in result.stdout
    assert "stress by mu, Taylor rate" in result.stdout


def test_values_that_were_not_given_are_pointed_out():
    assert "gamma = 1 (no value given)" in " ".join(run("tmc_vem.energy:medium_huhu", "--check").stdout.split())
    given = run("mine.py:bending", "--check", command=POINTS).stdout
    assert "bending: kappa = 0.1\n" in given.replace(" \n", "\n").replace("  ", "")


def test_an_energy_that_is_not_objective_fails_in_words():
    result = run("mine.py:resists_rotation", "--check", command=POINTS)
    assert result.exit_code == 1
    assert "FAIL: The energy is not objective (frame indifferent): a superposed rotation of" in result.stdout
    assert result.stdout.rstrip().endswith("resists_rotation: 1 of 12 checks failed")


def test_a_wrong_hand_written_gradient_fails_in_words():
    result = run("mine.py:with_gradient", "--check", command=POINTS)
    assert result.exit_code == 1
    assert "FAIL: The hand-written gradient is wrong: its components T111, T211" in result.stdout


def test_tangent_states_what_it_is_not():
    result = run("tmc_vem.energy:tangent", "--check", command=POINTS)
    assert "note: Declared for rotations below 90 degrees only; nothing was checked beyond." in result.stdout
    assert "note: The energy is not objective" in result.stdout


def test_show_prints_the_derivation_and_the_operation_counts():
    lines = run("mine.py:plain", "--show", "--param", "kappa=1").stdout.splitlines()
    assert lines[0] == "plain(kappa), with J = det F:"
    assert lines[1] == "  psi = kappa*(G111**2 + G211**2)"
    assert lines[2:6] == [f"  P{ij} = 0" for ij in ("11", "21", "12", "22")]
    assert lines[6] == "  T111 = 2*G111*kappa"
    assert "2 of the 78 second derivatives are not identically zero" in lines[14]
    assert [line.split()[0] for line in lines[16:]] == ["energy", "gradient", "tangent"]
    before, after = map(int, run("tmc_vem.energy:angle", "--show").stdout.splitlines()[-1].split()[1:])
    assert before > 4 * after


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["mine.py:bending"], "nothing to do: give -o DIR to write the kernel, --check or --show"),
        (["mine.py:nothing", "--show"], "mine.py has no 'nothing'; it has"),
        (["none.py:bending", "--show"], "there is no file none.py"),
        (["mine.py:plain", "--show"], "parameter p.kappa is not declared (declared: none); write"),
        (["mine.py:bending", "--show", "--param", "x=1"], "energy 'bending' has no parameter 'x'"),
        (["mine.py:bending", "--show", "--param", "kappa"], "'kappa' is not name=value, for example kappa=0.1"),
        (["mine.py:bending", "--show", "--param", "kappa=abc"], "'kappa=abc' is not name=value"),
        (
            ["mine.py:bending", "--show", "--target", "metal"],
            "Invalid value for '--target': 'metal' is not one of 'c', 'cuda'",
        ),
        (["mine.py:bending", "-o", "mine.py"], "cannot write to mine.py: File exists"),
    ],
)
def test_errors_are_one_line_with_exit_code_2(arguments, message):
    result = run(*arguments)
    assert result.exit_code == 2
    assert result.stdout == ""
    assert message in result.stderr.splitlines()[-1]
    assert result.stderr.splitlines()[-1].startswith("Error: ")
    assert "Traceback" not in result.stderr


def test_as_a_module():
    command = [sys.executable, "-m", "codegen"]
    done = subprocess.run([*command, "mine.py:bending", "--show"], capture_output=True, text=True, check=False)
    assert done.returncode == 0
    assert "psi = kappa*((G111 + G122)**2 + (G211 + G222)**2)/2" in done.stdout
    failed = subprocess.run([*command, "none.py:bending", "--show"], capture_output=True, text=True, check=False)
    assert failed.returncode == 2
    assert failed.stderr == f"Error: there is no file none.py in {Path.cwd()}\n"
