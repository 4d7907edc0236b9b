"""Formulas of users: values, names, and all that is none."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tmc_vem.support.errors import InputError
from tmc_vem.support.formulas import FUNCTIONS, LONGEST, Formula

X = np.array([0.3, 0.7])
VALUES = {"x": X, "a": 2.0, "lambda": 5.0}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("3", 3.0), ("-x", -X), ("+x", X), ("x + a", X + 2), ("x - a", X - 2), ("a * x", 2 * X), ("a / x", 2 / X),
        ("x ** a", X**2), ("2 * x + 1", 2 * X + 1), ("2 * (x + 1)", 2 * (X + 1)), ("-a ** 2", -4.0), ("1e-3", 1e-3),
        (" pi ", math.pi), ("x < 0.5", X < 0.5), ("x <= 0.3", X <= 0.3), ("x > 0.5", X > 0.5), ("x >= 0.7", X >= 0.7),
        ("abs(-x)", X), ("sqrt(x)", np.sqrt(X)), ("exp(x)", np.exp(X)), ("log(x)", np.log(X)),
        ("log10(x)", np.log10(X)), ("sin(x)", np.sin(X)), ("cos(x)", np.cos(X)), ("tan(x)", np.tan(X)),
        ("tanh(x)", np.tanh(X)), ("atan2(x, a)", np.arctan2(X, 2.0)), ("hypot(x, a)", np.hypot(X, 2.0)),
        ("min(x, 0.5)", [0.3, 0.5]), ("max(x, 0.5)", [0.5, 0.7]), ("where(x < 0.5, 1, a)", [1.0, 2.0]),
        ("lambda * x", 5 * X),
    ],
)  # fmt: skip
def test_values(text: str, value: object) -> None:
    assert np.array_equal(Formula(text)(VALUES), value)


def test_every_function_has_a_value_above() -> None:
    (marks,) = [mark for mark in test_values.pytestmark if mark.name == "parametrize"]  # type: ignore[attr-defined]
    assert all(any(text.startswith(f"{name}(") for text, _ in marks.args[1]) for name in FUNCTIONS)


def test_what_has_no_value_is_no_number_and_says_nothing() -> None:
    with np.errstate(all="raise"):
        assert np.isnan(Formula("log(-1)")({}))
        assert np.isinf(Formula("1 / 0")({}))
        assert np.isinf(Formula("9 ** 9 ** 9")({}))


def test_names() -> None:
    assert Formula("a * sin(b + c ** d) + where(e < f, pi, g) - (-h)").names == set("abcdefgh")
    assert Formula("3 * pi").names == set()


def test_a_name_without_a_value() -> None:
    with pytest.raises(InputError) as refused:
        Formula("modulus * x")({"modules": X, "x": X})
    assert str(refused.value) == ("formula 'modulus * x' has no 'modulus' (did you mean 'modules'?): it has modules, x")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "'' is no formula: numbers, names, + - * / **, < <= > >=, pi, and abs, sqrt"),
        ("x +", "'x +' is no formula"), ("x = 1", "'x = 1' is no formula"), ("(" * 300 + "x", "is no formula"),
        ("x y", "'x y' is no formula"), ("\0", "is no formula"),
        ("x.real", "'x.real' is nothing that a formula may have: numbers, names"),
        ("x[0]", "'x[0]' is nothing"), ("lambda: 1", "is no formula"), ("[x]", "is nothing"), ("'a'", "is nothing"),
        ("True", "'True' is nothing"), ("1j", "'1j' is nothing"), ("x if y else z", "is nothing"),
        ("x and y", "is nothing"), ("not x", "'not x' is nothing"), ("~x", "is nothing"), ("x % 2", "is nothing"),
        ("x // 2", "is nothing"), ("x @ y", "is nothing"), ("x < y < z", "is nothing"), ("x == y", "is nothing"),
        ("x != y", "is nothing"), ("(y := x)", "is nothing"),
        ("sin(x, out=y)", "is nothing"), ("sin(*x)", "is nothing"),
        ("x.sum()", "is nothing"), ("a + open(x)", "functions of 'a + open(x)' has no 'open': it has abs, "),
        ("sine(x)", "has no 'sine' (did you mean 'sin'?)"), ("sin(x, y)", "'sin(x, y)': sin takes 1 values, not 2"),
        ("where(x, y)", "where takes 3 values, not 2"), ("hypot(x)", "hypot takes 2 values, not 1"),
        ("1e301", "'1e301': numbers beyond 1e+300 are none"), ("1e999", "numbers beyond"),
        ("1" + "0" * 400, "numbers beyond"),
        ("x" * (LONGEST + 1), f"a formula of {LONGEST + 1} characters: {LONGEST} is the most"),
    ],
)  # fmt: skip
def test_what_is_refused(text: str, message: str) -> None:
    with pytest.raises(InputError) as refused:
        Formula(text)
    assert message in str(refused.value)
    assert len(str(refused.value)) < 400


def test_the_longest_and_the_deepest_have_a_value() -> None:
    assert Formula("-" * (LONGEST - 1) + "x")({"x": 2.0}) == -2.0
    assert Formula("+".join("x" * (LONGEST // 2)))({"x": 1.0}) == LONGEST // 2
    assert Formula("1e300")({}) == 1e300
