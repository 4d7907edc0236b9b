"""Device source of energies, compiled as plain C++ and run on the host: against the C kernels and the oracles."""

from __future__ import annotations

import re
import shutil
import subprocess
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import mpmath
import numpy as np
import pytest
from test_codegen_accuracy import (
    LIMIT,
    PARAMETERS,
    extreme,
    near_identity,
    nearly_singular,
    reference,
    relative_error,
)
from test_codegen_layout import FLUX, ONLY_F

from codegen import oracle
from codegen.backends import TARGETS, backend, host
from codegen.backends.cuda import device_arithmetic
from codegen.backends.host import FLAGS, HostKernel, compile_on_host, cxx_compiler, host_text
from codegen.compiler import generate
from codegen.declare import declaration
from codegen.errors import CodegenError
from codegen.integrand import Integrand, second_gradient_energy
from codegen.ir import KernelSource
from codegen.kernel import ENERGY, GRADIENT, TANGENT, Kernel, compiled
from codegen.sampling import REGIMES, from_vector, sample
from codegen.trace import trace
from codegen.userfile import load_density
from codegen.verify import verify
from tmc_vem.energy import DENSITIES, SOLIDS, Energy

WARNINGS = ("-Wall", "-Wextra", "-Wshadow", "-Werror")
EPS = np.finfo(float).eps
ENERGIES = {**DENSITIES, **SOLIDS}
TWO_KINDS = ("solid", "medium_angle_damped")  # without the second gradient and with it
OF_SOLIDS = {"c01": 2.0, "J_m": 30.0, "c10": 3.0, "c1": 5.0, "c2": 0.3, "c3": 0.02, "lambda_m": 3.0}
COMPILERS = [name for name in ("g++", "clang++") if shutil.which(name)]
pytestmark = pytest.mark.skipif(not COMPILERS, reason="there is no C++ compiler")


def integrand_of(energy: Energy) -> Integrand:
    return second_gradient_energy(energy.density, energy.name, energy.parameters, energy.description)


@cache
def device_source(integrand: Integrand) -> KernelSource:
    return generate(trace(integrand), integrand.description, target="cuda")


@cache
def on_host(integrand: Integrand, *flags: str) -> HostKernel:
    """Its library stays loaded when the file is gone."""
    with TemporaryDirectory() as directory:
        kernel = HostKernel(
            compile_on_host(device_source(integrand), Path(directory), (*FLAGS, *WARNINGS, *flags)), integrand
        )
    return kernel


def values_of(integrand: Integrand) -> np.ndarray:
    return np.array([{**OF_SOLIDS, **PARAMETERS}[name] for name in integrand.parameter_names])


def states(density: object) -> np.ndarray:
    """Admissible states from mild to extreme, J = 1e-4 and 3 among them, some near F = I, and that itself."""
    rng = np.random.default_rng(7)
    declared = declaration(density)
    drawn = [sample(regime, 30, rng, declared.max_rotation) for regime in REGIMES]
    return np.concatenate([*drawn, *(near_identity(size, 10) for size in (1e-9, 1e-5, 1e-2)), np.zeros((1, 12))])


def assert_same(found, expected, x_nx: np.ndarray) -> None:
    """Equal to 12 digits, as kernels are asked to be, and but for a few roundings of x and of the terms of a sum.

    A relative change ``e`` of x changes g by up to ``e |h| |x|``; an energy has terms as large as ``|h| |x|^2``.
    """
    there, good = (np.isfinite(of[0]) & np.isfinite(of[2]).all(axis=(1, 2)) for of in (found, expected))
    np.testing.assert_array_equal(there, good)
    assert good.sum() > 0.7 * len(good)  # Gent's solid has no energy beyond its J_m
    error_psi, error_g, error_h = (sizes(a - b)[good] for a, b in zip(found, expected, strict=True))
    size_psi, size_g, size_h, size_x = (sizes(of)[good] for of in (*expected, x_nx))
    assert np.all(error_psi <= LIMIT * size_psi)
    assert np.all(error_g <= LIMIT * size_g)
    assert np.all(error_psi <= 4 * EPS * (size_psi + size_g * size_x + size_h * size_x**2))
    assert np.all(error_g <= 16 * EPS * (size_g + size_h * size_x))
    assert np.all(error_h <= 128 * EPS * size_h)


def sizes(values: np.ndarray) -> np.ndarray:
    """(n,) norms of what (n, ...) is at states."""
    return np.linalg.norm(values.reshape(len(values), -1), axis=1)


# ---- What it computes ----


@pytest.mark.parametrize("name", ENERGIES)
def test_every_energy_is_what_its_c_kernel_computes(name):
    integrand = integrand_of(ENERGIES[name])
    device, kernel, x_nx = on_host(integrand), Kernel(compiled(integrand), integrand), states(integrand.function)
    parameters = values_of(integrand)
    expected = kernel.points(TANGENT, x_nx, parameters)
    found = device.points(TANGENT, x_nx, parameters)
    assert device.uses_second_gradient == kernel.uses_second_gradient
    assert_same(found, expected, x_nx)
    near = np.linalg.norm(x_nx[:, :4], axis=1) < 2e-5
    assert near.sum() == 21
    for ours, theirs in zip(found, expected, strict=True):  # energy and stress are tiny there, and exact all the same
        assert np.all(sizes(ours - theirs)[near] <= 16 * EPS * sizes(theirs)[near])


@pytest.mark.parametrize("name", ENERGIES)
def test_every_energy_passes_the_check_of_kernels(name):
    """Against numpy, Taylor expansions and differences, none of which knows a derivative."""
    integrand = integrand_of(ENERGIES[name])
    values = dict(zip(integrand.parameter_names, values_of(integrand), strict=True))
    findings = verify(on_host(integrand), integrand.function, values, declaration(integrand.function))
    assert [finding.words for finding in findings if not finding.passed] == []
    assert len(findings) > 10


FEW = {
    "H=1e-9": near_identity(1e-9, 2),
    "H=0.06": near_identity(0.06, 2),
    "J=1e-4": extreme(1e-4, 60.0, 2),
    "J=1e-6, F of order one": np.concatenate([nearly_singular(1e-6, 3), np.full((3, 8), 0.3)], axis=1),
}


@pytest.mark.parametrize("name", TWO_KINDS)
@pytest.mark.parametrize("x_nx", FEW.values(), ids=FEW)
def test_relative_error_against_many_digits(name, x_nx):
    integrand = integrand_of(ENERGIES[name])
    psi, g, h = on_host(integrand).points(TANGENT, x_nx, values_of(integrand))
    with mpmath.workdps(94):
        for n, x in enumerate(x_nx):
            exact = reference(integrand.function, x)
            assert relative_error([psi[n]], [exact[0]]) < LIMIT
            assert relative_error(g[n], exact[1]) < LIMIT
            assert relative_error(h[n].ravel(), exact[2]) < LIMIT


MINE = """
from codegen import energy

@energy(parameters={"kappa": 0.1, "new": 2.0}, stress_free=False, objective=False)
def everything(F, G, p, m):
    a, b = F[0][0] * F[1][1], F[0][1] * F[1][0]
    smooth = m.sqrt(a * a + b * b + 1) + m.sin(b) * m.cos(a) + m.atan(a + b) + m.atan2(b, a + 3)
    numbers = m.exp(1) * a + m.log(2) * b + m.atan(1) * a * b + m.sqrt(2) * b ** 2 + b / m.sqrt(m.atan(1))
    powers = (a * a + 1) ** 1.5 + (a - b) ** (1 / 3) + (a + 4) ** -2 + m.log(a - b) ** 5
    return p.kappa * (smooth + numbers + powers) + p.new * m.exp(-b) * sum(G[i][0][1] ** 2 for i in (0, 1)) / 3

@energy(parameters={"double": 2.0})
def auto(F, G, p, m):
    return p.double * sum(G[i][j][k] ** 2 for i in (0, 1) for j in (0, 1) for k in (0, 1))

def bare(F, G, p, m):
    return (F[0][0] - 1) ** 2
"""


@pytest.mark.parametrize("function", ["everything", "auto", "bare"])
def test_energies_of_a_file(tmp_path, function):
    """Every function and kind of number, names that are words of C++, and an energy without parameters."""
    (tmp_path / "mine.py").write_text(MINE)
    loaded = load_density(f"{tmp_path / 'mine.py'}:{function}")
    device, x_nx = on_host(loaded.integrand), sample(REGIMES[0], 30, np.random.default_rng(3))
    psi, g, _ = device.points(GRADIENT, x_nx, device.parameter_array(loaded.parameters))
    np.testing.assert_allclose(psi, oracle.energy_density(loaded.function, x_nx, loaded.parameters), rtol=1e-13)
    exact = oracle.gradient(loaded.function, x_nx, loaded.parameters)
    assert np.all(np.abs(g - exact) <= 1e-13 * np.abs(exact).max(axis=1)[:, None])
    kernel = Kernel(compiled(loaded.integrand), loaded.integrand)
    parameters = kernel.parameter_array(loaded.parameters)
    assert_same(device.points(TANGENT, x_nx, parameters), kernel.points(TANGENT, x_nx, parameters), x_nx)


@pytest.mark.parametrize("name", TWO_KINDS)
@pytest.mark.parametrize("by_cell", [False, True])
def test_parameters_that_vary(name, by_cell):
    """Where every point has factors of its own, or those of its cell: as if its parameters had been given so."""
    uniform = integrand_of(ENERGIES[name])
    varying = uniform.varying(("mu", uniform.parameter_names[-1]) if name != "solid" else ("mu", "K"))
    assert varying.n_varying == 2
    x_nx, rng = states(uniform.function), np.random.default_rng(11)
    cell_n = rng.integers(0, 5, len(x_nx)).astype(np.int32) if by_cell else None
    factor_ck = rng.uniform(0.2, 3.0, (5 if by_cell else len(x_nx), 2))
    parameters = values_of(varying)
    found = on_host(varying).launch(TANGENT, x_nx, parameters, factor_ck=factor_ck, cell_n=cell_n)
    kernel = Kernel(compiled(varying), varying)
    each = []
    for n, x_x in enumerate(x_nx):
        own = parameters.copy()
        own[-2:] *= factor_ck[cell_n[n] if by_cell else n]
        each.append(kernel.points(TANGENT, x_x[None], own))
    assert_same(found, tuple(np.concatenate(part) for part in zip(*each, strict=True)), x_nx)


@pytest.mark.parametrize("integrand", [ONLY_F, FLUX], ids=lambda of: of.name)
def test_other_inputs_than_f_and_g(integrand):
    device, kernel = on_host(integrand), Kernel(compiled(integrand), integrand)
    x_nx = np.random.default_rng(1).uniform(-0.2, 0.2, (41, integrand.layout.n_inputs))
    found, expected = (k.points(TANGENT, x_nx, np.array([2.0])) for k in (device, kernel))
    assert_same(found, expected, x_nx)
    if integrand is FLUX:
        with pytest.raises(CodegenError, match="device_jacobian"):
            device.jacobian(x_nx)


def test_j_where_its_products_cancel():
    flat = np.concatenate([nearly_singular(j, 20) for j in (1e-3, 1e-6, 1e-9)])
    x_nx = np.concatenate([extreme(1e-4, 170.0, 20), np.concatenate([flat, np.zeros((60, 8))], axis=1)])
    found = on_host(integrand_of(ENERGIES["solid"])).jacobian(x_nx)
    with mpmath.workdps(60):
        for J, (h11, h21, h12, h22) in zip(found, x_nx[:, :4], strict=True):
            exact = (1 + mpmath.mpf(h11)) * (1 + mpmath.mpf(h22)) - mpmath.mpf(h12) * mpmath.mpf(h21)
            assert abs(J - exact) < 1e-14 * abs(exact)
    np.testing.assert_allclose(found[:20], np.linalg.det(from_vector(x_nx)[0])[:20], rtol=1e-4)


# ---- How it is started ----


@pytest.mark.parametrize("level", [ENERGY, GRADIENT, TANGENT])
def test_blocks_and_threads_change_no_bit(level):
    integrand = integrand_of(ENERGIES["medium_angle_damped"])
    device, x_nx, parameters = on_host(integrand), states(integrand.function), values_of(integrand)
    first = device.launch(level, x_nx, parameters)
    assert [part is None for part in first] == [False, level < GRADIENT, level < TANGENT]
    for blocks, threads in ((3, 32), (1, 1), (1, 7), (5, 3), (2, 1024), (65, 64)):
        again = device.launch(level, x_nx, parameters, blocks=blocks, threads=threads)
        for part, same in zip(first, again, strict=True):
            np.testing.assert_array_equal(part, same)


def test_levels_agree_and_an_energy_of_no_points_does_nothing():
    integrand = integrand_of(ENERGIES["medium_angle_damped"])
    device, x_nx, parameters = on_host(integrand), states(integrand.function), values_of(integrand)
    energy, gradient, tangent = (device.points(level, x_nx, parameters) for level in (ENERGY, GRADIENT, TANGENT))
    for psi, *_ in (energy, gradient):
        np.testing.assert_allclose(psi, tangent[0], rtol=1e-13)
    np.testing.assert_allclose(gradient[1], tangent[1], rtol=0, atol=1e-13 * np.abs(tangent[1]).max())
    assert device.points(TANGENT, x_nx[:0], parameters)[2].shape == (0, 12, 12)


def test_arrays_that_do_not_fit_are_refused():
    solid = integrand_of(ENERGIES["solid"])
    varying = on_host(solid.varying(("mu",)))
    x_nx, parameters = np.zeros((3, 12)), np.array([20.0, 10.0])
    with pytest.raises(ValueError, match="2 parameters expected"):
        varying.points(ENERGY, x_nx, parameters[:1])
    for factor_ck, cell_n in (
        (np.ones((2, 1)), None),
        (np.ones((3, 2)), None),
        (np.ones((2, 1)), np.zeros(2, np.int32)),
    ):
        with pytest.raises(ValueError, match="3 states and 1 parameters"):
            varying.launch(ENERGY, x_nx, parameters, factor_ck=factor_ck, cell_n=cell_n)


# ---- Its text ----


@pytest.mark.parametrize("name", TWO_KINDS)
def test_one_schedule_for_all_languages(name):
    """Lines of points in C and in CUDA differ in how entries of arrays are written, and in nothing else."""
    integrand = integrand_of(ENERGIES[name])
    in_c, in_cuda = generate(trace(integrand)).c_source, device_source(integrand).files[".cu"]
    for level in ("energy", "gradient", "tangent"):
        bodies = [re.search(rf" void point_{level}\(.*?\n}}\n", text, re.DOTALL)[0] for text in (in_c, in_cuda)]
        lines = [[line.strip().replace("[v]", "") for line in body.splitlines() if " = " in line] for body in bodies]
        loop, *rest = (line for line in lines[0] if line.startswith("for "))
        lines[0].remove(loop)
        assert not rest
        assert lines[0] == lines[1]
        assert len(lines[1]) > 10


def assert_plain(text: str) -> None:
    words = r"#|__builtin|__attribute__|\brestrict\b|\bstatic\b|\bM_[A-Z0-9_]+|NAME|UNUSED|LANES|malloc|atomic"
    assert not re.findall(words, text)
    assert set(re.findall(r"__\w+__|__\w+", text)) == {"__device__", "__global__", "__forceinline__", "__restrict__"}


@pytest.mark.parametrize("integrand", [*map(integrand_of, map(ENERGIES.get, TWO_KINDS)), FLUX], ids=lambda of: of.name)
def test_it_includes_nothing_and_has_no_words_of_c_or_of_one_compiler(integrand):
    assert_plain(device_source(integrand).files[".cu"])


def test_numbers_are_digits(tmp_path):
    """NVRTC has no constants of math.h."""
    (tmp_path / "mine.py").write_text(MINE)
    integrand = load_density(f"{tmp_path / 'mine.py'}:everything").integrand
    assert "M_E" in generate(trace(integrand)).c_source
    text = device_source(integrand).files[".cu"]
    assert_plain(text)
    assert "2.718281828459045" in text


def test_its_arithmetic_is_that_of_c():
    """The same functions in the same order, whatever is added to pointmath.c."""
    from codegen.ctext import point_arithmetic_source

    names = re.findall(r"static inline double (\w+)\(", point_arithmetic_source())
    assert re.findall(r"__device__ __forceinline__ double (\w+)\(", device_arithmetic()) == names
    assert "fma(-c, d, cd)" in device_arithmetic()
    assert "split" not in device_arithmetic()


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("flags", [("-O0", "-ffp-contract=off"), ("-O3", "-march=native", "-ffp-contract=fast")])
@pytest.mark.parametrize("name", TWO_KINDS)
def test_compilers_and_contractions_agree(monkeypatch, compiler, flags, name):
    """A GPU contracts products and sums as its compiler likes: none of it may matter."""
    monkeypatch.setenv("CXX", compiler)
    integrand = integrand_of(ENERGIES[name])
    x_nx, parameters = states(integrand.function), values_of(integrand)
    device = on_host.__wrapped__(integrand, *flags)
    assert_same(device.points(TANGENT, x_nx, parameters), on_host(integrand).points(TANGENT, x_nx, parameters), x_nx)


def test_several_energies_in_one_program(tmp_path):
    """In one file, and in two that are linked."""
    texts = [device_source(integrand_of(ENERGIES[name])).files[".cu"] for name in TWO_KINDS]
    head = Path(host.__file__).with_name("host.hpp").read_text()
    (tmp_path / "both.cpp").write_text(head + texts[0] + texts[1])
    for name, text in zip(TWO_KINDS, texts, strict=True):
        (tmp_path / f"{name}.cpp").write_text(head + text)
    (tmp_path / "main.cpp").write_text("int main() { return 0; }\n")
    for files in (["both.cpp"], [f"{name}.cpp" for name in TWO_KINDS]):
        command = [*cxx_compiler(), "-std=c++17", *WARNINGS, *files, "main.cpp", "-o", "program"]
        subprocess.run(command, cwd=tmp_path, check=True)


def test_unknown_targets_are_refused():
    assert TARGETS == ("c", "cuda")
    for target in ("metal", "__init__", "host"):
        with pytest.raises(CodegenError, match=f"there is no target '{target}'; choose one of c, cuda"):
            backend(target)


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("no-such-program", r"no C\+\+ compiler found \(tried CXX=no-such-program\): install g\+\+"),
        ("'", r"CXX=' is no command \(No closing quotation\)"),
        ("false", r"compiling solid\.cpp with .*false failed: it made no library and said nothing"),
        ("true", r"compiling solid\.cpp with .*true failed: it made no library and said nothing"),
        (f"{next(iter(COMPILERS), '')} -Werror=nothing-like-that", r"compiling solid\.cpp with .* failed: .*error: "),
    ],
)
def test_what_is_no_compiler_is_named_in_one_line(monkeypatch, tmp_path, command, message):
    monkeypatch.setenv("CXX", command)
    with pytest.raises(CodegenError, match=message) as caught:
        compile_on_host(device_source(integrand_of(ENERGIES["solid"])), tmp_path)
    assert "\n" not in str(caught.value)


def test_the_text_of_the_host_is_around_that_of_the_device():
    source = device_source(integrand_of(ENERGIES["solid"]))
    before, after = host_text(source).split(source.files[".cu"])
    assert "#define __device__\n" in before
    assert "tmc_solid::tmc_solid_tangent(" in after
