"""Kernels against 50-digit arithmetic: full relative accuracy near F = I and where J is tiny."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from types import SimpleNamespace

import mpmath
import numpy as np
import pytest

from codegen.build import compiler
from codegen.by_parameters import compile_by_parameters
from codegen.ctext import point_arithmetic_source
from codegen.integrand import second_gradient_energy
from codegen.kernel import TANGENT, compile_energy
from codegen.sampling import Regime, directions, sample
from tmc_vem.energy import DENSITIES, PAPER_DENSITIES

PARAMETERS = {"K": 20.0, "mu": 10.0, "gamma": 1e-3, "alpha_r": 0.7, "beta": 5.0}
LIMIT = 1e-12
DIGITS = 50
H = mpmath.mpf(10) ** -22  # of the central differences below; their own error is of the order of its square

MP = SimpleNamespace(exp=mpmath.exp, log=mpmath.log, sqrt=mpmath.sqrt, atan2=mpmath.atan2)


@pytest.fixture(autouse=True)
def _many_digits():
    with mpmath.workdps(DIGITS + 2 * 22):  # second differences by H lose 44 digits
        yield


def near_identity(size: float, n: int) -> np.ndarray:
    rng = np.random.default_rng(31)
    x = rng.normal(size=(n, 12))
    return size * x / np.linalg.norm(x[:, :4], axis=1, keepdims=True)


def extreme(j: float, rotation: float, n: int, stretch_ratio: float = 3.0) -> np.ndarray:
    regime = Regime("", j, j, rotation, stretch_ratio)
    return sample(regime, n, np.random.default_rng(37), 90.0 if rotation < 90.0 else 180.0)


def nearly_singular(j: float, n: int) -> np.ndarray:
    """H with det(I + H) of about j, although 1 + H is rounded and all components are of order one."""
    h11, h22, h12 = np.random.default_rng(41).uniform([[-0.5], [-0.5], [0.5]], [[3.0], [3.0], [2.0]], (3, n))
    return np.stack([h11, ((1 + h11) * (1 + h22) - j) / h12, h12, h22], axis=1)


STATES = {
    "H=1e-8": near_identity(1e-8, 3),
    "H=1e-6": near_identity(1e-6, 2),
    "H=1e-4": near_identity(1e-4, 3),
    "H=1e-2": near_identity(1e-2, 2),
    "H=0.06": near_identity(0.06, 3),  # the series of the remainders end at |J - 1| = 1/16 and |log J| = 3/16
    "H=0.2": near_identity(0.2, 3),
    "J=1e-6": extreme(1e-6, 60.0, 3),
    "J=1e-6, flat": extreme(1e-6, 60.0, 3, stretch_ratio=1e6),  # F is not small, its determinant cancels
    "J=1e-3": extreme(1e-3, 60.0, 2),
    "J=3": extreme(3.0, 60.0, 2),
}


def reference(density, x):
    """psi, gradient and Hessian of a state in many digits by central differences of the density."""
    parameters = SimpleNamespace(**{name: mpmath.mpf(value) for name, value in PARAMETERS.items()})
    base = [mpmath.mpf(float(v)) for v in x]

    def psi(*shifts):
        v = list(base)
        for a, sign in shifts:
            v[a] += sign * H
        F = [[1 + v[0], v[2]], [v[1], 1 + v[3]]]
        G = [[[v[4 + i + 2 * j + 4 * k] for k in (0, 1)] for j in (0, 1)] for i in (0, 1)]
        return density(F, G, parameters, MP)

    ahead, behind = [psi((a, 1)) for a in range(12)], [psi((a, -1)) for a in range(12)]
    gradient = [(p - m) / (2 * H) for p, m in zip(ahead, behind, strict=True)]
    hessian = [[mpmath.mpf(0)] * 12 for _ in range(12)]
    for a in range(12):
        hessian[a][a] = (ahead[a] - 2 * psi() + behind[a]) / H**2
        for b in range(a):
            mixed = psi((a, 1), (b, 1)) - psi((a, 1), (b, -1)) - psi((a, -1), (b, 1)) + psi((a, -1), (b, -1))
            hessian[a][b] = hessian[b][a] = mixed / (4 * H**2)
    return psi(), gradient, [entry for row in hessian for entry in row]


def relative_error(found, exact) -> float:
    difference = mpmath.sqrt(sum((mpmath.mpf(float(f)) - e) ** 2 for f, e in zip(found, exact, strict=True)))
    return float(difference / mpmath.sqrt(sum(e**2 for e in exact)))


@pytest.mark.parametrize("states", STATES)
@pytest.mark.parametrize("name", [*PAPER_DENSITIES, "medium_balanced_angle_log_damped", "medium_huhu_log"])
def test_relative_error_of_energy_gradient_and_hessian(name, states):
    energy = DENSITIES[name]
    kernel = compile_energy(energy.density, energy.name, energy.parameters, energy.description)
    x_nx = STATES[states]
    psi, g, h = kernel.points(TANGENT, x_nx, kernel.parameter_array(PARAMETERS))
    for n, x in enumerate(x_nx):
        exact_psi, exact_g, exact_h = reference(energy.density, x)
        assert relative_error([psi[n]], [exact_psi]) < LIMIT
        assert relative_error(g[n], exact_g) < LIMIT
        assert relative_error(h[n].ravel(), exact_h) < LIMIT


def by_parameter(energy, x, y, name):
    """Derivatives by a parameter of psi and of its rate along y, in many digits by central differences."""
    values = {key: mpmath.mpf(value) for key, value in PARAMETERS.items()}

    def psi(parameter, along):
        v = [mpmath.mpf(float(a)) + along * H * mpmath.mpf(float(b)) for a, b in zip(x, y, strict=True)]
        F = [[1 + v[0], v[2]], [v[1], 1 + v[3]]]
        G = [[[v[4 + i + 2 * j + 4 * k] for k in (0, 1)] for j in (0, 1)] for i in (0, 1)]
        p = SimpleNamespace(**{**values, name: values[name] + parameter * H})
        return energy.density(F, G, p, MP)

    mixed = psi(1, 1) - psi(1, -1) - psi(-1, 1) + psi(-1, -1)
    return (psi(1, 0) - psi(-1, 0)) / (2 * H), mixed / (4 * H**2)


@pytest.mark.parametrize("states", STATES)
@pytest.mark.parametrize("name", ["solid", "medium_angle_damped", "medium_huhu_lulu"])
def test_relative_error_of_derivatives_by_parameters(name, states):
    """All of a state together, as one may vanish, such as that by mu of a pure change of area."""
    energy, x_nx = DENSITIES[name], STATES[states]
    derivatives = compile_by_parameters(second_gradient_energy(energy.density, energy.name, energy.parameters))
    y_nx = directions(x_nx, np.random.default_rng(43))
    found = derivatives.by_parameters(x_nx, y_nx, derivatives.parameter_array(PARAMETERS))
    for n, (x, y) in enumerate(zip(x_nx, y_nx, strict=True)):
        exact = [by_parameter(energy, x, y, parameter) for parameter in energy.parameters]
        for part in (0, 1):
            assert relative_error(found[part][n], [pair[part] for pair in exact]) < LIMIT


def test_angle_at_large_rotations():
    energy = DENSITIES["medium_angle_damped"]
    kernel = compile_energy(energy.density, energy.name, energy.parameters, energy.description)
    x_nx = extreme(1e-6, 170.0, 4)
    psi, g, h = kernel.points(TANGENT, x_nx, kernel.parameter_array(PARAMETERS))
    for n, x in enumerate(x_nx):
        exact_psi, exact_g, exact_h = reference(energy.density, x)
        assert relative_error([psi[n]], [exact_psi]) < LIMIT
        assert relative_error(g[n], exact_g) < LIMIT
        assert relative_error(h[n].ravel(), exact_h) < LIMIT


# ---- The functions they are built from, with and without fused multiply-add -----------------------------------------


@pytest.fixture(scope="module", params=["-march=native", "-mno-fma"])
def arithmetic(request, tmp_path_factory):
    if request.param == "-mno-fma" and shutil.which("uname") and subprocess.getoutput("uname -m") != "x86_64":
        pytest.skip("the flag exists on x86_64 only")
    directory = tmp_path_factory.mktemp("arithmetic")
    text = "#include <math.h>\n" + point_arithmetic_source().replace("static inline double", "double")
    (directory / "a.c").write_text(text)
    command = [*compiler(), "-std=gnu99", "-O3", request.param, "-fPIC", "-shared", "-o", "a.so", "a.c", "-lm"]
    subprocess.run(command, cwd=directory, check=True)
    library = ctypes.CDLL(str(directory / "a.so"))
    for name, n in {"jacobian": 4, "jacobian_minus_1": 5, "log_remainder": 2, "exp_remainder": 2}.items():
        getattr(library, name).restype = ctypes.c_double
        getattr(library, name).argtypes = [ctypes.c_double] * n
    return library


def test_jacobian_where_its_products_cancel(arithmetic):
    small = [extreme(j, 170.0, 40)[:, :4] for j in (1e-3, 1e-6, 1e-9)]
    for x in np.concatenate(small + [nearly_singular(j, 40) for j in (1e-3, 1e-6, 1e-9)]):
        h11, h21, h12, h22 = (mpmath.mpf(float(v)) for v in x)
        exact = (1 + h11) * (1 + h22) - h12 * h21
        found = arithmetic.jacobian(*x)
        assert abs(found - exact) < 1e-14 * abs(exact)


def test_jacobian_minus_1_near_the_identity_and_far_from_it(arithmetic):
    for x in np.concatenate([near_identity(size, 20) for size in (1e-8, 1e-3, 0.3)]):
        h11, h21, h12, h22 = (mpmath.mpf(float(v)) for v in x[:4])
        exact = h11 + h22 + h11 * h22 - h12 * h21
        found = arithmetic.jacobian_minus_1(*x[:4], arithmetic.jacobian(*x[:4]))
        assert abs(found - exact) < 1e-15 * float(np.abs(x[:4]).sum())
    for x in extreme(1e-9, 170.0, 20):
        j = arithmetic.jacobian(*x[:4])
        assert arithmetic.jacobian_minus_1(*x[:4], j) == j - 1.0


@pytest.mark.parametrize("sign", [-1, 1])
def test_remainders_keep_full_accuracy_on_both_sides_of_their_switch(arithmetic, sign):
    for size in (1e-300, 1e-12, 1e-6, 1e-3, 0.03, 0.0624, 0.0626, 0.12, 0.126, 0.5, 0.9):
        d = sign * size
        log_1d, exp_d = float(np.log(1.0 + d)), float(np.exp(d))
        with mpmath.workdps(700):
            exact_log = mpmath.log1p(mpmath.mpf(d)) - mpmath.mpf(d)
            exact_exp = mpmath.expm1(mpmath.mpf(d)) - mpmath.mpf(d)
        tiny = 1e-320  # the square of the smallest d underflows
        assert abs(arithmetic.log_remainder(d, log_1d) - exact_log) <= 3e-13 * abs(exact_log) + tiny
        assert abs(arithmetic.exp_remainder(d, exp_d) - exact_exp) <= 3e-13 * abs(exact_exp) + tiny
