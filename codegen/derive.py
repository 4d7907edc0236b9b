"""Stage 2: differentiate a traced energy with sympy.

``J = det F`` is recognised in the energy wherever it stands and kept as a variable of its own; derivatives with respect
to F go through it by the chain rule (``dJ/dF = cof F``). So every derivative is expressed through the same few
functions of J, and ``J - 1`` is never formed by subtraction from J.

Input: :class:`~codegen.trace.TracedEnergy`. Output: :class:`~codegen.ir.DerivedEnergy`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

import sympy as sp

from codegen import centre
from codegen.centre import F11, F12, F21, F22, J_MINUS_1, SHIFTED, J, Value
from codegen.errors import CodegenError
from codegen.ir import DerivedByParameters, DerivedEnergy, SymExpr
from codegen.layout import Layout
from codegen.tape import Node
from codegen.trace import TracedEnergy

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

_CENTRED: dict[str, Callable[..., Value]] = {
    "+": centre.add,
    "-": lambda v, a, b: centre.add(v, a, centre.scale(sp.S.NegativeOne, b)),
    "*": centre.multiply,
    "/": lambda v, a, b: centre.multiply(v, a, centre.invert(1 / centre.plain(b), b)),
    "**": lambda v, a, b: centre.power(v, a, centre.plain(b)),
    "neg": lambda v, a: centre.scale(sp.S.NegativeOne, a),
    "exp": centre.exponential,
    "log": centre.logarithm,
    "sqrt": centre.square_root,
}


def to_sympy(traced: TracedEnergy) -> Value:
    """The energy in F, G, J and the parameters, with its form centred at F = I where there is one."""
    values: list[Value] = []
    for node in traced.nodes:
        arguments = [values[a] for a in node.args]
        values.append(_operation(node, arguments) if arguments else _leaf(node))
    return values[traced.result]


def _operation(node: Node, arguments: Sequence[Value]) -> Value:
    expression = with_det_as_variable(_FUNCTIONS[node.op](*map(centre.plain, arguments)))
    if all(isinstance(a, centre.Centred) and a.delta == 0 for a in arguments):
        return centre.constant(expression)
    return _CENTRED[node.op](expression, *arguments) if node.op in _CENTRED else expression


def _leaf(node: Node) -> Value:
    if node.op == "variable":
        return centre.variable(str(node.value))
    is_number = node.op == "const"
    return centre.constant(exact_constant(float(node.value or 0.0)) if is_number else parameter_symbol(str(node.value)))


def parameter_symbol(name: str) -> SymExpr:
    """Symbol of a parameter; the prefix keeps it apart from J, F and G in the generated code."""
    return sp.Symbol(f"p_{name}", real=True)


def direction_symbols(layout: Layout) -> tuple[SymExpr, ...]:
    """Symbols of the components of a direction, in the order of the vector."""
    return tuple(sp.Symbol(f"y_{name}", real=True) for name in layout.names)


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
    others: list[SymExpr] = []
    for term in expression.args:
        coefficient, rest = term.as_independent(F11, F22, F12, F21, as_Add=False)
        coefficients[rest] = coefficients.get(rest, 0) + coefficient
        if rest not in (F11 * F22, F12 * F21):
            others.append(term)
    c = coefficients.get(F11 * F22)
    if c is None or coefficients.get(F12 * F21) != -c:
        return expression
    return sp.Add(*others, c * J)


def differentiate(traced: TracedEnergy) -> DerivedEnergy:
    """Gradient and Hessian of a traced energy in the order of Appendix C.

    Energy and gradient come from the centred form wherever they vanish at F = I. The Hessian does not vanish there; it
    comes from the plain form, which is shorter.

    Raises:
        CodegenError: the energy divides by zero, or has no second derivatives everywhere.
    """
    energy, gradient_source, plain_energy = forms(traced)
    variables = centre.symbols(traced.layout)
    gradient = tuple(derivatives(gradient_source, variables))
    plain_gradient = gradient if gradient_source is plain_energy else tuple(derivatives(plain_energy, variables))
    rows = [derivatives(plain_gradient[a], variables[a:]) for a in range(len(variables))]
    hessian = tuple(entry for row in rows for entry in row)
    require_smooth(traced.name, (energy, *gradient, *hessian))
    return DerivedEnergy(
        name=traced.name,
        parameters=traced.parameters,
        layout=traced.layout,
        n_rows=traced.n_rows,
        energy=energy,
        gradient=gradient,
        hessian=hessian,
        plain_energy=plain_energy,
        plain_gradient=plain_gradient,
        n_varying=traced.n_varying,
    )


def differentiate_by_parameters(traced: TracedEnergy) -> DerivedByParameters:
    """Derivatives of a traced energy, and of its first derivative along a direction, with respect to its parameters.

    Both come from the forms that are accurate near F = I.

    Raises:
        CodegenError: the energy divides by zero, or has a kink.
    """
    energy, gradient_source, _ = forms(traced)
    gradient = derivatives(gradient_source, centre.symbols(traced.layout))
    along = sp.Add(*(y * g for y, g in zip(direction_symbols(traced.layout), gradient, strict=True)))
    parameters = [parameter_symbol(name) for name in traced.parameters]
    energy_k = tuple(sp.diff(energy, p) for p in parameters)
    residual_k = tuple(sp.diff(along, p) for p in parameters)
    require_smooth(traced.name, (*energy_k, *residual_k))
    return DerivedByParameters(
        traced.name, traced.parameters, traced.layout, traced.n_rows, energy_k, residual_k, traced.n_varying
    )


def forms(traced: TracedEnergy) -> tuple[SymExpr, SymExpr, SymExpr]:
    """The energy in the form that is accurate near F = I, in that of which the gradient is, and in the plain one."""
    value = to_sympy(traced)
    energy = gradient_source = plain_energy = centre.plain(value)
    if isinstance(value, centre.Centred) and value.constant == 0:
        energy = sp.Add(*(coefficient * x for x, coefficient in value.linear.items())) + value.rest
        gradient_source = energy if not value.linear else plain_energy
    return energy, gradient_source, plain_energy


def require_smooth(name: str, expressions: Sequence[SymExpr]) -> None:
    """Check that expressions have values everywhere.

    Raises:
        CodegenError: one divides by zero, or has a kink.
    """
    if any(expression.has(sp.zoo, sp.nan, sp.oo, -sp.oo) for expression in expressions):
        raise CodegenError(
            f"energy '{name}': it or a derivative divides by zero everywhere; look for a term that cancels"
        )
    kinks = sorted(
        {str(kink.func) for e in expressions for kink in e.atoms(sp.DiracDelta, sp.Heaviside, sp.Derivative)}
    )
    if kinks:
        raise CodegenError(
            f"energy '{name}': its derivatives contain {', '.join(kinks)}, so it has a kink; write m.sqrt(x * x + eps) "
            "for the square root of a square"
        )


def derivatives(expression: SymExpr, variables: Sequence[SymExpr]) -> list[SymExpr]:
    """Total derivatives, J = det F included."""
    by_j = sp.diff(expression, J) + sp.diff(expression, J_MINUS_1)
    found = []
    for x in variables:
        derivative = sp.diff(expression, x)
        if x in SHIFTED:
            derivative += sp.diff(expression, SHIFTED[x])
        if x in COFACTORS:
            derivative += by_j * COFACTORS[x]
        found.append(derivative)
    return found


def symbol_names(expression: Any) -> set[str]:
    """Names of the symbols in an expression."""
    return {str(symbol) for symbol in expression.free_symbols}
