"""What a density may not do: each a one-line error that names the energy and says what to write instead."""

from __future__ import annotations

import math

import numpy as np
import pytest

from codegen.compiler import derive
from codegen.errors import CodegenError
from codegen.integrand import second_gradient_energy
from codegen.trace import TracedEnergy, trace


def traced(density, parameters=()) -> TracedEnergy:
    return trace(second_gradient_energy(density, "mine", parameters))


def branching(F, G, p, m):
    return F[0][0] if F[0][0] > 1 else F[1][1]


def truth(F, G, p, m):
    return F[0][0] if F[0][0] - 1 else F[1][1]


def absolute(F, G, p, m):
    return abs(F[0][0])


def smallest(F, G, p, m):
    return min(F[0][0], F[1][1])


def unknown_function(F, G, p, m):
    return m.tanh(F[0][0])


def wrong_arity(F, G, p, m):
    return m.atan2(F[0][0])


def undeclared(F, G, p, m):
    return p.kappa * F[0][0]


def independent(F, G, p, m):
    return p.mu * p.mu


def number(F, G, p, m):
    return 3.0


def nothing(F, G, p, m):
    F[0][0] * F[0][0]


def not_scalar(F, G, p, m):
    return [F[0][0], F[1][1]]


def matrix(F, G, p, m):
    return np.array([F[0][0], F[1][1]])


def math_function(F, G, p, m):
    return math.exp(F[0][0])


def numpy_function(F, G, p, m):
    return np.exp(F[0][0])


def symbolic_exponent(F, G, p, m):
    return F[0][0] ** p.mu


def symbolic_base(F, G, p, m):
    return 2.0 ** F[0][0]


def text(F, G, p, m):
    return F[0][0] * "2"


def out_of_range(F, G, p, m):
    return F[0][3]


def like_an_array(F, G, p, m):
    return F[0, 0]


def equal(F, G, p, m):
    return F[0][0] if F[0][0] == 1 else F[1][1]


def no_divisor(F, G, p, m):
    return F[0][0] / 0


CASES = [
    (equal, "comparison on a value .* write a smooth expression"),
    (no_divisor, "divides by zero"),
    (branching, "comparison on a value .* write a smooth expression instead, for example m.sqrt"),
    (truth, "'if', 'abs', 'min', 'max' or a comparison on a value .* write a smooth expression"),
    (absolute, "'abs'.* write a smooth expression instead, for example m.sqrt"),
    (smallest, "'min'.* write a smooth expression"),
    (unknown_function, r"unknown function m.tanh; known are m.exp, m.log, m.sqrt, .*m.atan2"),
    (wrong_arity, "m.atan2 takes 2 arguments, got 1"),
    (undeclared, r"parameter p.kappa is not declared \(declared: mu\); write @energy\(parameters={'kappa': 1.0}\)"),
    (independent, "depends on neither F nor G, so it has no stress; return an energy of the deformation"),
    (number, "returned the constant 3.0; return one scalar that depends on F or G"),
    (nothing, "returned nothing; end it with 'return psi'"),
    (not_scalar, "returned a list; return one scalar"),
    (matrix, "returned a ndarray; return one scalar"),
    (math_function, "math and numpy functions need numbers; use those of m"),
    (numpy_function, "math and numpy functions need numbers; use those of m"),
    (symbolic_exponent, r"the exponent of \*\* must be a number; write m.exp\(b \* m.log\(a\)\) for a\*\*b"),
    (symbolic_base, r"the exponent of \*\* must be a number; write m.exp\(b \* m.log\(a\)\)"),
    (text, "cannot compute with a str; use numbers, F, G, p and the functions of m"),
    (out_of_range, r"F\[i\]\[j\] and G\[i\]\[j\]\[k\] have the indices 0 and 1, and F has 2, not 3"),
    (like_an_array, r"write F\[i\]\[j\] and G\[i\]\[j\]\[k\], not F\[i, j\]"),
]


@pytest.mark.parametrize(("density", "message"), CASES, ids=lambda case: getattr(case, "__name__", ""))
def test_what_cannot_be_traced_is_said_in_one_line(density, message):
    with pytest.raises(CodegenError, match=message) as caught:
        traced(density, ("mu",))
    assert str(caught.value).startswith("energy 'mine'")
    assert "\n" not in str(caught.value)


def test_a_comparison_of_indices_is_a_number():
    def kronecker(F, G, p, m):
        return sum((F[i][j] - (i == j)) ** 2 for i in (0, 1) for j in (0, 1))

    def written_out(F, G, p, m):
        return sum((F[i][j] - (1.0 if i == j else 0.0)) ** 2 for i in (0, 1) for j in (0, 1))

    assert traced(kronecker) == traced(written_out)


@pytest.mark.parametrize(
    ("density", "message"),
    [
        (lambda F, G, p, m: m.sqrt(G[0][0][0] ** 2), r"DiracDelta, so it has a kink; write m.sqrt\(x \* x \+ eps\)"),
        (lambda F, G, p, m: F[0][0] / (F[0][1] - F[0][1]), "divides by zero everywhere"),
    ],
)
def test_what_has_no_second_derivatives_is_said_in_one_line(density, message):
    with pytest.raises(CodegenError, match=f"^energy 'mine': .*{message}"):
        derive(traced(density))


def test_errors_of_the_density_itself_are_named():
    def broken(F, G, p, m):
        return F[0][0] + undefined_name  # noqa: F821

    with pytest.raises(CodegenError, match="energy 'mine': calling it failed with NameError: name 'undefined_name'"):
        traced(broken)


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (("a b",), "parameter 'a b' is no name; use ASCII letters, digits and _ only"),
        (("κ",), "parameter 'κ' is no name"),
        (("mu", "mu"), "parameter 'mu' is declared twice; rename one of the two"),
    ],
)
def test_names_of_parameters(names, message):
    with pytest.raises(CodegenError, match=message):
        traced(lambda F, G, p, m: F[0][0], names)


# ---- What is recorded -----------------------------------------------------------------------------------------------


def stretch(F, G, p, m):
    return p.mu * F[0][0] ** 2


def test_fingerprint_is_of_what_is_computed_and_not_of_the_text():
    same = traced(lambda F, G, p, m: p.mu * (F[0][0]) ** 2.0, ("mu",))
    original = traced(stretch, ("mu",))
    assert same.fingerprint() == original.fingerprint()
    other_number = traced(lambda F, G, p, m: p.mu * F[0][0] ** 3, ("mu",))
    other_component = traced(lambda F, G, p, m: p.mu * F[1][1] ** 2, ("mu",))
    other_order = traced(lambda F, G, p, m: F[0][0] ** 2 * p.mu, ("mu",))
    other_parameters = traced(stretch, ("mu", "K"))
    prints = {t.fingerprint() for t in (original, other_number, other_component, other_order, other_parameters)}
    assert len(prints) == 5


def test_values_that_are_not_used_leave_no_trace():
    def wasteful(F, G, p, m):
        m.exp(G[0][0][0] * p.mu)
        return stretch(F, G, p, m)

    assert traced(wasteful, ("mu",)).fingerprint() == traced(stretch, ("mu",)).fingerprint()
    assert traced(wasteful, ("mu",)).used == ("F",)


def test_numpy_numbers_on_either_side():
    two = np.float64(2.0)
    for operation in (lambda a, b: a + b, lambda a, b: a - b, lambda a, b: a * b, lambda a, b: a / b):
        for with_numpy, plain in (
            (lambda F, G, p, m, o=operation: o(two, F[0][0]), lambda F, G, p, m, o=operation: o(2, F[0][0])),
            (lambda F, G, p, m, o=operation: o(F[0][0], two), lambda F, G, p, m, o=operation: o(F[0][0], 2)),
        ):
            assert traced(with_numpy).fingerprint() == traced(plain).fingerprint()
