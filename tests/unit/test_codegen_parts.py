"""Parts of the code generator by themselves: what the check computes, what printers write, what compilers say."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy as sp

from codegen import build, verify
from codegen.centre import H11, J_MINUS_1, Centred, J, LogRemainder, constant, invert, multiply, power, variable
from codegen.cprinter import c_expression
from codegen.declare import Declaration, declaration, energy
from codegen.derive import exact_constant, to_sympy, with_det_as_variable
from codegen.errors import CodegenError
from codegen.finding import EXACT, Finding, rate_finding, relative
from codegen.integrand import second_gradient_energy
from codegen.reference import fault_at_reference
from codegen.sampling import REGIMES, Regime
from codegen.schedule import INVERSE_J, LOG_J, LOG_J_REMAINDER, _reduce, reciprocal
from codegen.trace import trace
from codegen.userfile import LoadedDensity, as_density

N = 12
RNG = np.random.default_rng(5)
CUBIC = RNG.normal(size=(N, N, N))
SQUARE = RNG.normal(size=(N, N))
SLOPE = RNG.normal(size=N)


class Polynomial:
    """A kernel of a cubic polynomial, without a compiler."""

    name, parameters = "mine", ("a",)

    def __init__(self, at_rest: float = 0.0, slope: Any = SLOPE, square: Any = SQUARE, cubic: Any = CUBIC) -> None:
        self.at_rest, self.slope, self.square, self.cubic = at_rest, slope, square, cubic

    def parameter_array(self, values: Any) -> Any:
        return np.array([values["a"]])

    def points(self, level: int, x_nx: Any, array: Any) -> Any:
        half = self.square + self.square.T
        whole = sum(np.transpose(self.cubic, order) for order in
                    ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)))  # fmt: skip
        psi = self.at_rest + x_nx @ self.slope + np.einsum("nx,xy,ny->n", x_nx, self.square, x_nx)
        psi = psi + np.einsum("nx,ny,nz,xyz->n", x_nx, x_nx, x_nx, self.cubic)
        g = self.slope + x_nx @ half + 0.5 * np.einsum("nx,ny,xyz->nz", x_nx, x_nx, whole)
        return psi, g, half + np.einsum("nx,xyz->nyz", x_nx, whole)


def test_remainders_of_taylor_s_formula_are_relative_to_the_sizes_of_its_terms(monkeypatch: pytest.MonkeyPatch) -> None:
    kernel: Any = Polynomial()
    x, d = RNG.normal(size=(3, N)), RNG.normal(size=(3, N))
    seen: list[Any] = []
    monkeypatch.setattr(verify, "directions", lambda *_: d)
    monkeypatch.setattr(verify, "rate_finding", lambda *given: seen.append(given))
    list(verify._taylor(kernel, np.zeros(1), Regime("some", 0.5, 2.0, 10.0, 1.1), x, np.random.default_rng(0)))
    psi, g, h = kernel.points(2, x, None)
    (what, steps, first, order, words), (what2, steps2, second, order2, words2) = seen
    assert (what, steps, order) == ("gradient, Taylor rate, some", verify.GRADIENT_STEPS, 2)
    assert (what2, steps2, order2) == ("Hessian, Taylor rate, some", verify.HESSIAN_STEPS, 3)
    assert (words, words2) == ("The gradient is not that of the energy.", "The Hessian is not that of the energy.")
    for n in range(3):
        slope, curvature = g[n] @ d[n], d[n] @ h[n] @ d[n]
        third = np.einsum("x,y,z,xyz->", d[n], d[n], d[n], CUBIC)
        scale = abs(psi[n]) + abs(slope) + abs(curvature)
        for i, s in enumerate(steps):
            assert first[i, n] == pytest.approx((0.5 * s**2 * curvature + s**3 * third) / scale, rel=1e-4)
        for i, s in enumerate(steps2):
            assert second[i, n] == pytest.approx(s**3 * third / scale, rel=1e-4)


@pytest.mark.parametrize(
    ("sizes", "order", "finding"),
    [
        ((1.6, 0.4, 0.1), 2, Finding("w", "2.00", "> 1.9", True)),
        ((1.6, 0.8, 0.4), 2, Finding("w", "1.00", "> 1.9", False, "bad")),
        ((6.4, 0.8, 0.1), 3, Finding("w", "3.00", "> 2.9", True)),
        ((0.9e-13, 1.0, 1.0), 3, Finding("w", "exact", "> 2.9", True)),
        ((1.1e-13, 1.0, 1.0), 3, None),
        ((np.inf, 1.0, 1.0), 2, Finding("w", "nan", "> 1.9", False, "bad")),
    ],
)
def test_rates_of_decay(sizes: tuple[float, ...], order: int, finding: Finding | None) -> None:
    remainders = np.array(sizes)[:, None] * np.array([1.0, -1.0])
    found = rate_finding("w", (4.0, 2.0, 1.0), remainders, order, "bad")
    assert found == finding if finding else not found.passed


def test_sizes_that_differences_are_relative_to() -> None:
    assert relative(np.array([1.1, 2.0, 1e-9]), np.array([1.0, 2.0, 0.0])).tolist() == pytest.approx(
        [0.1, 0.0, 1e-9 / 1e-6]
    )
    h = np.zeros((3, 2, 2))
    h[0, 1, 0] = -3.0
    assert verify._size(h, np.array([(9.0, 9.0), (1.0, -2.0), (0.0, 0.0)])).tolist() == [3.0, 2.0, 1.0]


def reference(kernel: Any, declared: Declaration | None = None) -> list[Finding]:
    def density(F: Any, G: Any, p: Any, m: Any) -> Any:
        return p.a * m.sqrt(F[0][0] - 1)

    return list(verify._reference_state(kernel, np.zeros(1), density, {"a": 1.0}, declared or Declaration()))


def test_the_state_at_rest_in_figures() -> None:
    slope = np.zeros(N)
    slope[[2, 7]] = 0.25, -0.5
    square = np.zeros((N, N))
    square[3, 3] = 1.0  # the largest second derivative is 2
    fine, stressed = reference(Polynomial(0.5, slope, square))
    assert (fine.what, fine.measured, fine.required, fine.passed) == ("energy at F = I", "2.5e-01", "< 1e-12", False)
    assert fine.words == "The energy at F = I is 0.5, not 0: subtract it."
    assert (stressed.what, stressed.measured, stressed.passed) == ("stress at F = I", "2.5e-01", False)
    assert stressed.words == ("F = I is not free of stress: T221 = -0.5 (in plane strain tr C = F:F + 1, as F33 = 1).")
    fine, stressed = reference(Polynomial(0.5, slope, square), Declaration(stress_free=False))
    assert [f.required for f in (fine, stressed)] == [verify.DECLARED_OTHERWISE] * 2
    assert [f.passed for f in (fine, stressed)] == [True, True]
    assert fine.words.endswith("subtract it. As declared.")
    assert [f.passed for f in reference(Polynomial(1.9e-12, 0 * slope, square))] == [True, True]
    assert [f.passed for f in reference(Polynomial(2.1e-12, 0 * slope, square))] == [False, True]


def test_an_energy_without_a_value_at_rest_is_said_with_its_operation() -> None:
    (found,) = reference(Polynomial(np.inf))
    assert found == Finding(
        "finite at F = I", "no", "yes", False,
        "The energy is infinite or not a number at F = I: a square root is zero at F = I, its derivative is infinite: "
        "write m.sqrt(x + eps).",
    )  # fmt: skip
    (found,) = reference(Polynomial(0.0, np.full(N, np.nan)))
    assert found.words.startswith("A derivative of the energy is infinite") or found.words.startswith("The energy is")


def test_a_gradient_that_was_written_by_hand_is_compared_component_by_component() -> None:
    kernel: Any = Polynomial(slope=np.ones(N), square=np.zeros((N, N)), cubic=np.zeros((N, N, N)))

    def hook(F: Any, G: Any, p: Any, m: Any) -> Any:
        one = np.ones(len(F[0][0]))
        return [[one, 1.5 * one], [one, one]], [[[one, one], [one, one]], [[one, 3 * one], [one, one]]]

    found = verify._hand_written(kernel, np.zeros(1), hook, {"a": 1.0}, RNG.normal(size=(4, N)))
    assert (found.measured, found.passed) == ("2.0e+00", False)
    assert found.words == "The hand-written gradient is wrong: its components P12, T212 are not the energy's."


def test_finite_values_and_what_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    kernel: Any = Polynomial()
    x = np.arange(2.0 * N).reshape(2, N)
    good = verify._finite(kernel, np.zeros(1), x, Declaration())
    assert (good.what, good.measured, good.passed, good.words) == (
        "finite, J 1e-4 to 3, rotation to 170 deg", "2 of 2", True, "",
    )  # fmt: skip
    limited = verify._finite(kernel, np.zeros(1), x, Declaration(max_rotation=90.0))
    assert limited.what == "finite, J 1e-4 to 3, rotation to 80 deg"
    assert limited.words == "Declared for rotations below 90 degrees only; nothing was checked beyond."
    x[1, 0] = np.inf
    bad = verify._finite(kernel, np.zeros(1), x, Declaration(max_rotation=90.0))
    assert (bad.measured, bad.passed) == ("1 of 2", False)
    assert bad.words.endswith("at [F - I, G] = [inf, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23].")


def test_the_regimes_of_the_check() -> None:
    assert [(r.name, r.j_min, r.j_max, r.rotation, r.stretch_ratio) for r in REGIMES] == [
        ("mild", 0.8, 1.25, 20.0, 1.2), ("large", 0.2, 2.0, 90.0, 2.0), ("extreme", 1e-4, 3.0, 170.0, 4.0),
    ]  # fmt: skip
    assert (verify.VALUE_LIMIT, verify.DIFFERENCE_LIMIT, verify.REFERENCE_LIMIT, EXACT) == (
        1e-9, 1e-5, 1e-12, 1e-13,
    )  # fmt: skip


# -- printing and sharing --------------------------------------------------------------------------------------------

X, Y = sp.symbols("x y", real=True)


@pytest.mark.parametrize(
    ("expression", "text"),
    [
        (X**2, "(x*x)"), (X**3, "(x*(x*x))"), (X**4, "((x*x)*(x*x))"), (X**17, "pow(x, 17.0)"),
        ((X + Y) ** 2, "((x + y)*(x + y))"), (sp.sqrt(X), "sqrt(x)"), (X ** sp.Rational(3, 2), "pow(x, 1.5)"),
        (X ** sp.Rational(1, 3), f"pow(x, {1 / 3!r})"), (X ** sp.Rational(-2, 3), f"pow(x, {-2 / 3!r})"),
        (X**-1, "1.0/x"), (X**Y, "pow(x, y)"), (sp.Rational(2, 3) * X, f"{2 / 3!r}*x"), (sp.Integer(7), "7.0"),
        (sp.Float("0.1"), "0.1"), (reciprocal(X + 1), "(1.0/(x + 1.0))"), (sp.exp(X), "exp(x)"),
    ],
)  # fmt: skip
def test_expressions_as_c(expression: Any, text: str) -> None:
    assert c_expression(expression) == text
    assert c_expression(X**16).count("x") == 16


@pytest.mark.parametrize(
    ("expression", "reduced"),
    [
        (J ** sp.Rational(-5, 3), INVERSE_J * sp.exp(-sp.Rational(2, 3) * LOG_J)),
        (J ** sp.Rational(5, 3), J * sp.exp(sp.Rational(2, 3) * LOG_J)), (J**-2, INVERSE_J**2), (J**3, J**3),
        (J ** sp.Rational(1, 3), sp.exp(LOG_J / 3)), (X**-3, reciprocal(X) ** 3), (X**2, X**2), (sp.log(J), LOG_J),
        (LogRemainder(J_MINUS_1), LOG_J_REMAINDER), (2 * X * J - 2 * X, 2 * X * J - 2 * X), (J - 1, J_MINUS_1),
        (3 * J + X - 3, 3 * J_MINUS_1 + X), (J + 1, J + 1), (2 * J - 1, 2 * J - 1),
    ],
)  # fmt: skip
def test_powers_and_logarithms_of_j_are_reduced(expression: Any, reduced: Any) -> None:
    assert sp.simplify(_reduce(expression, {}) - reduced) == 0


# -- centred forms ---------------------------------------------------------------------------------------------------


def centred(density: Any) -> Any:
    return to_sympy(trace(second_gradient_energy(density, "mine", ("a",))))


A = sp.Symbol("p_a", real=True)


def test_functions_of_parameters_are_constants() -> None:
    """Whether or not they have a centred form themselves."""
    value = centred(lambda F, G, p, m: m.sin(p.a) * F[0][0] + m.atan2(p.a, 2))
    assert isinstance(value, Centred)
    assert value.constant == sp.sin(A) + sp.atan2(A, 2)
    assert value.linear == {H11: sp.sin(A)}
    assert not isinstance(centred(lambda F, G, p, m: m.sin(F[0][0])), Centred)


@pytest.mark.parametrize("make", [lambda v: invert(1 / v.plain, v), lambda v: power(v.plain**-2, v, sp.Integer(-2)),
                                  lambda v: power(sp.sqrt(v.plain) ** 3, v, sp.Rational(3, 2))])  # fmt: skip
def test_parts_of_a_value_add_up_to_it(make: Any) -> None:
    """Of a value 1 + H11 and of 3 times that; nothing is split where the constant is 0."""
    one = variable("F11")
    for value in (one, multiply(3 * one.plain, constant(sp.Integer(3)), one)):
        found = make(value)
        assert isinstance(found, Centred)
        linear = sum(c * x for x, c in found.linear.items())
        at = {H11: 0.25, sp.Symbol("F11", real=True): 1.25}
        forms = (found.plain, found.constant + linear + found.rest, found.constant + found.delta)
        numbers = [
            float(form.subs(at).doit().replace(lambda e: e.func.__name__.endswith("Remainder"), remainder))
            for form in forms
        ]
        assert numbers[1:] == pytest.approx([numbers[0]] * 2, rel=1e-12)
    small = variable("F12")
    assert not isinstance(invert(1 / small.plain, small), Centred)


def remainder(expression: Any) -> Any:
    d = expression.args[0]
    return sp.log(1 + d) - d if expression.func.__name__ == "LogRemainder" else sp.exp(d) - 1 - d


def test_numbers_that_python_had_to_round_are_fractions() -> None:
    assert [exact_constant(value) for value in (2 / 3, 0.1, -1.5, 1 / 999)] == [
        sp.Rational(2, 3), sp.Rational(1, 10), sp.Rational(-3, 2), sp.Rational(1, 999),
    ]  # fmt: skip
    assert exact_constant(0.12345) == sp.Float(0.12345, 17)
    f11, f22, f12, f21 = (sp.Symbol(name, real=True) for name in ("F11", "F22", "F12", "F21"))
    assert with_det_as_variable(A * f11 * f22 - A * f12 * f21 + X) == A * J + X
    assert (
        with_det_as_variable(A * f11 * f22 + X * f11 * f22 - A * f12 * f21 - X * f12 * f21 + f11) == (A + X) * J + f11
    )
    for other in (f11 * f22 + f12 * f21, f11 * f22 - 2 * f12 * f21, f11 * f22, X):
        assert with_det_as_variable(other) == other


# -- what is said ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("said", "first"),
    [
        ("a.c:2: warning: odd\na.c:3:5: error: bad\nmore", "a.c:3:5: error: bad"),
        ("odd\nmore", "odd"),
        ("", "it made no library and said nothing"),
        ("k.c:2:1: error: static assertion failed", "lanes are eight"),
        ("k.c:1:1: error: static assertion failed", "k.c:1:1: error: static assertion failed"),
        ("k.c:99:1: error: gone", "k.c:99:1: error: gone"),
    ],
)
def test_the_first_error_of_a_compiler(said: str, first: str) -> None:
    source = 'int a;\n_Static_assert(N == 8, "lanes are eight");\nint b;\n'
    assert build._first_error(said, source) == first


@pytest.mark.parametrize(
    ("density", "words"),
    [
        (lambda F, G, p, m: 1 / F[0][1], "it divides by zero at F = I: add a small number to what it divides by"),
        (lambda F, G, p, m: m.sqrt(F[0][0] - 3), "a square root is taken of -2 at F = I"),
        (lambda F, G, p, m: m.log(F[0][0] - 3), "a logarithm is taken of -2 at F = I"),
        (lambda F, G, p, m: m.log(F[0][1]), "a logarithm is taken of 0 at F = I"),
        (lambda F, G, p, m: F[0][1] ** -2, "a power -2 is taken of zero at F = I"),
        (lambda F, G, p, m: F[0][1] ** 2 + (F[0][0] - 3) ** -2, ""),
        (lambda F, G, p, m: (F[0][0] - 3) ** 0.5, "a power 0.5 is taken of -2 at F = I: of negative numbers there are "
         "integer powers only"),
        (lambda F, G, p, m: F[0][1] ** 1.5,
         "a power 1.5 is taken of zero at F = I, its derivatives are infinite: write (x + eps)**1.5"),
        (lambda F, G, p, m: F[0][1] ** 2.5, ""),
        (lambda F, G, p, m: m.atan2(F[0][1], F[1][0]), "m.atan2(0, 0) is taken at F = I, which is no angle"),
        (lambda F, G, p, m: m.atan2(F[0][1], F[0][0]) + m.atan2(F[0][0], F[0][1]), ""),
        (lambda F, G, p, m: m.exp(800 * F[0][0]), "exp of 800 is too large a number at F = I"),
        (lambda F, G, p, m: 1 / (p.a - 2 * F[0][0]),
         "it divides by zero at F = I: add a small number to what it divides by"),
        (lambda F, G, p, m: 1 / (m.sin(p.a) - m.cos(p.a) + m.atan(F[0][1]) - (-F[0][0])), ""),
    ],
)  # fmt: skip
def test_what_has_no_value_at_rest(density: Any, words: str) -> None:
    assert fault_at_reference(trace(second_gradient_energy(density, "mine", ("a",))), {"a": 2.0}) == words


def test_statements_about_an_energy() -> None:
    @energy(parameters={"k": 1.0}, objective=False, stress_free=False, max_rotation=90.0)
    def density(F: Any, G: Any, p: Any, m: Any) -> Any:
        """An energy.

        More about it.
        """

    assert declaration(density) == Declaration({"k": 1.0}, False, False, 90.0)
    assert as_density(density) == LoadedDensity(density, "density", {"k": 1.0}, declaration(density), "An energy.")
    assert as_density(density).with_values({"k": 3}) == LoadedDensity(
        density, "density", {"k": 3.0}, declaration(density), "An energy."
    )
    assert Declaration() == Declaration({}, True, True, 180.0, None)
    for angle, fine in ((10.0, False), (10.1, True), (180.0, True), (180.1, False)):
        vars(density)["declared"] = {"max_rotation": angle}
        if fine:
            assert declaration(density).max_rotation == angle
        else:
            with pytest.raises(CodegenError, match=rf"max_rotation is {angle}; give degrees in \(10, 180\]"):
                declaration(density)
    vars(density)["declared"] = {"odd": 1}
    with pytest.raises(CodegenError, match="energy 'density': unknown declaration 'odd'; known are parameters, obj"):
        declaration(density)
    integrand = second_gradient_energy(density, "mine", {"a": 2.0, "b": None}, "a line")
    assert (integrand.name, integrand.description, integrand.parameter_names) == ("mine", "a line", ("a", "b"))
    assert [parameter.default for parameter in integrand.parameters] == [2.0, None]
