"""Stage 2: differentiate a traced energy with sympy.

``J = det F`` is recognised in the energy wherever it stands and kept as a variable of its own; derivatives with respect
to F go through it by the chain rule (``dJ/dF = cof F``). So every derivative is expressed through the same few
functions of J, and ``J - 1`` is never formed by subtraction from J.

Input: :class:`~codegen.trace.TracedEnergy`. Output: :class:`~codegen.ir.DerivedEnergy`.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import sympy as sp

from codegen.ir import DerivedEnergy, SymExpr
from codegen.ordering import F_NAMES, UPPER_TRIANGLE, X_NAMES
from codegen.trace import Node, TracedEnergy

X_SYMBOLS = tuple(sp.Symbol(name, real=True) for name in X_NAMES)
F11, F21, F12, F22 = X_SYMBOLS[: len(F_NAMES)]
J = sp.Symbol("J", positive=True)
J_MINUS_1 = sp.Symbol("Jm1", real=True)
COFACTORS = {F11: F22, F21: -F12, F12: -F21, F22: F11}

_FUNCTIONS: dict[str, Callable[..., SymExpr]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: a / b,
    "**": lambda a, b: a**b,
    "neg": lambda a: -a,
    "exp": sp.exp,
    "log": sp.log,
    "sqrt": sp.sqrt,
    "sin": sp.sin,
    "cos": sp.cos,
    "atan": sp.atan,
    "atan2": sp.atan2,
}


def to_sympy(traced: TracedEnergy) -> SymExpr:
    """The energy as a sympy expression in F, G, J and the parameters."""
    values: list[SymExpr] = []
    for node in traced.nodes:
        values.append(_leaf(node) if not node.args else _FUNCTIONS[node.op](*(values[a] for a in node.args)))
        values[-1] = with_det_as_variable(values[-1])
    return values[traced.result]


def _leaf(node: Node) -> SymExpr:
    if node.op == "const":
        return exact_constant(float(node.value or 0.0))
    if node.op == "variable":
        return X_SYMBOLS[X_NAMES.index(str(node.value))]
    return parameter_symbol(str(node.value))


def parameter_symbol(name: str) -> SymExpr:
    """Symbol of a parameter; the prefix keeps it apart from J, F and G in the generated code."""
    return sp.Symbol(f"p_{name}", real=True)


def exact_constant(value: float) -> SymExpr:
    """A rational for a number such as 2/3 that Python had to round, else the number itself."""
    fraction = Fraction(value).limit_denominator(1000)
    if float(fraction) == value:
        return sp.Rational(fraction.numerator, fraction.denominator)
    return sp.Float(value, 17)


def with_det_as_variable(expression: SymExpr) -> SymExpr:
    """Replace ``c F11 F22 - c F12 F21`` in a sum by ``c J``."""
    if not isinstance(expression, sp.Add):
        return expression
    coefficients: dict[SymExpr, SymExpr] = {}
    for term in expression.args:
        coefficient, rest = term.as_independent(F11, F22, F12, F21, as_Add=False)
        coefficients[rest] = coefficients.get(rest, 0) + coefficient
    c = coefficients.get(F11 * F22)
    if c is None or coefficients.get(F12 * F21) != -c:
        return expression
    return expression - c * (F11 * F22 - F12 * F21) + c * J


def differentiate(traced: TracedEnergy) -> DerivedEnergy:
    """Gradient and Hessian of a traced energy in the order of Appendix C."""
    energy = to_sympy(traced)

    def derivative(expression: SymExpr, x: SymExpr) -> SymExpr:
        direct = sp.diff(expression, x)
        return direct + sp.diff(expression, J) * COFACTORS[x] if x in COFACTORS else direct

    gradient = tuple(derivative(energy, x) for x in X_SYMBOLS)
    hessian = tuple(derivative(gradient[a], X_SYMBOLS[b]) for a, b in UPPER_TRIANGLE)
    return DerivedEnergy(traced.name, traced.parameters, energy, gradient, hessian, traced.uses_second_gradient)


def symbol_names(expression: Any) -> set[str]:
    """Names of the symbols in an expression."""
    return {str(symbol) for symbol in expression.free_symbols}
