"""Stage 2a: rewrite an energy about F = I, G = 0, so that what cancels there cancels on paper and not in rounding.

Next to its plain expression ``v``, every intermediate value gets ``v = v0 + v1 + v2``: the constant ``v0``, the part
``v1`` linear in ``x = (F - I, G)``, and the exact remainder ``v2``, which is of second order. Sums, products,
quotients, powers, logarithms and exponentials map such triples to triples without ever subtracting numbers that are
close, as long as ``log(1 + d) - d`` and ``exp(d) - 1 - d`` are available (:class:`LogRemainder`,
:class:`ExpRemainder`). An energy that vanishes and is free of stress at F = I has ``v0 = v1 = 0`` exactly, whatever its
parameters, and ``v2`` evaluates to full relative accuracy for the smallest deformations. This is forward
differentiation with an exact remainder; it multiplies the number of operations by a constant at most.

Example: ``J^(-2/3) trC - 3`` becomes ``H:H - 2 (det H + r) + 3 e + (J^(-2/3) - 1) (trC - 3)`` with ``H = F - I``,
``r = log(J) - (J - 1)`` and ``e = exp(d) - 1 - d`` for ``d = -2/3 log(J)``.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import sympy as sp

from codegen.integrand import DEFORMATION_GRADIENT
from codegen.ir import SymExpr
from codegen.layout import Layout

H11, H22 = sp.Symbol("H11", real=True), sp.Symbol("H22", real=True)  # F - I; its other components are those of F
F11, F21, F12, F22 = (sp.Symbol(name, real=True) for name in DEFORMATION_GRADIENT.names)
SHIFTED = {F11: H11, F22: H22}  # the same unknown, counted from F = I
J = sp.Symbol("J", positive=True)
J_MINUS_1 = sp.Symbol("Jm1", real=True)


class LogRemainder(sp.Function):  # type: ignore[misc]
    """``log(1 + d) - d``, evaluated without cancellation near d = 0."""

    def fdiff(self, argindex: int = 1) -> SymExpr:
        (d,) = self.args
        return -J_MINUS_1 / J if d == J_MINUS_1 else -d / (1 + d)


class ExpRemainder(sp.Function):  # type: ignore[misc]
    """``exp(d) - 1 - d``, evaluated without cancellation near d = 0."""

    def fdiff(self, argindex: int = 1) -> SymExpr:
        (d,) = self.args
        return d + ExpRemainder(d)


@dataclass(frozen=True)
class Centred:
    """A value split about F = I, G = 0.

    Attributes:
        plain: the value as the density wrote it.
        constant: ``v0``, free of F and G.
        linear: ``v1`` as coefficients of the symbols of F - I and G.
        rest: ``v2``.
        delta: ``v - v0`` in its cheapest accurate form.
    """

    plain: SymExpr
    constant: SymExpr
    linear: dict[SymExpr, SymExpr] = field(default_factory=dict)
    rest: SymExpr = sp.S.Zero
    delta: SymExpr = sp.S.Zero

    @property
    def is_second_order(self) -> bool:
        """Whether the value and its first derivatives vanish at F = I, G = 0."""
        return self.constant == 0 and not self.linear


Value = Centred | SymExpr  # a bare expression is a value without a centred form, such as log(J - 1)


def plain(value: Value) -> SymExpr:
    """The value as the density wrote it."""
    return value.plain if isinstance(value, Centred) else value


def constant(expression: SymExpr) -> Centred:
    """A number or a parameter."""
    return Centred(expression, expression)


def symbols(layout: Layout) -> tuple[SymExpr, ...]:
    """Symbols of everything that is read, in the order of the vector."""
    return tuple(sp.Symbol(name, real=True) for name in layout.names)


def variable(name: str) -> Centred:
    """A component of an input."""
    symbol = sp.Symbol(name, real=True)
    small = SHIFTED.get(symbol, symbol)
    return Centred(symbol, sp.Integer(small != symbol), {small: sp.S.One}, sp.S.Zero, small)


def add(expression: SymExpr, a: Value, b: Value) -> Value:
    """Centred form of ``expression = a + b``."""
    if not (isinstance(a, Centred) and isinstance(b, Centred)):
        return expression
    linear = _combine((sp.S.One, a.linear), (sp.S.One, b.linear))
    rest = a.rest + b.rest
    delta = J_MINUS_1 if expression == J else a.delta + b.delta if linear else rest
    return Centred(expression, sp.expand(a.constant + b.constant), linear, rest, delta)


def multiply(expression: SymExpr, a: Value, b: Value) -> Value:
    """Centred form of ``expression = a b``."""
    for one, other in ((a, b), (b, a)):
        if isinstance(one, Centred) and one.is_second_order:  # so is the product: nothing to split
            product = one.rest * plain(other)
            return Centred(expression, sp.S.Zero, {}, product, product)
    if not (isinstance(a, Centred) and isinstance(b, Centred)):
        return expression
    linear = _combine((b.constant, a.linear), (a.constant, b.linear))
    rest = a.constant * b.rest + b.constant * a.rest + a.delta * b.delta
    if a.constant == 0:
        delta = a.delta * b.plain
    elif b.constant == 0:
        delta = a.plain * b.delta
    else:
        delta = a.constant * b.delta + b.constant * a.delta + a.delta * b.delta
    return Centred(expression, sp.expand(a.constant * b.constant), linear, rest, delta)


def scale(factor: SymExpr, a: Value) -> Value:
    """Centred form of ``factor a`` for a number ``factor``."""
    return multiply(factor * plain(a), constant(factor), a)


def invert(expression: SymExpr, a: Value) -> Value:
    """Centred form of ``expression = 1 / a``."""
    if not isinstance(a, Centred) or a.constant == 0:
        return expression
    inverse = 1 / a.constant
    linear = _combine((-(inverse**2), a.linear))
    rest = -(inverse**2) * a.rest + inverse**2 * a.delta**2 / a.plain
    return Centred(expression, inverse, linear, rest, -inverse * a.delta / a.plain)


def square_root(expression: SymExpr, a: Value) -> Value:
    """Centred form of ``expression = sqrt(a)``."""
    if not isinstance(a, Centred) or a.constant == 0:
        return expression
    root = sp.sqrt(a.constant)
    delta = a.delta / (expression + root)
    return Centred(
        expression, root, _combine((1 / (2 * root), a.linear)), a.rest / (2 * root) - delta**2 / (2 * root), delta
    )


def logarithm(expression: SymExpr, a: Value) -> Value:
    """Centred form of ``expression = log(a)``."""
    if not isinstance(a, Centred) or a.constant == 0:
        return expression
    d = a.delta / a.constant
    remainder = LogRemainder(d)
    delta = expression if a.plain == J else d + remainder
    return Centred(
        expression, sp.log(a.constant), _combine((1 / a.constant, a.linear)), a.rest / a.constant + remainder, delta
    )


def exponential(expression: SymExpr, a: Value) -> Value:
    """Centred form of ``expression = exp(a)``."""
    if not isinstance(a, Centred):
        return expression
    factor, remainder = sp.exp(a.constant), ExpRemainder(a.delta)
    return Centred(
        expression, factor, _combine((factor, a.linear)), factor * (a.rest + remainder), factor * (a.delta + remainder)
    )


def power(expression: SymExpr, a: Value, exponent: SymExpr) -> Value:
    """Centred form of ``expression = a ** exponent`` for a number ``exponent``."""
    if exponent == 0 or exponent == 1:
        return a if exponent == 1 else constant(sp.S.One)
    if exponent.is_Integer and 1 < exponent <= 8:
        lower = power(plain(a) ** (exponent - 1), a, exponent - 1)
        return multiply(expression, a, lower)
    if exponent.is_Integer and -8 <= exponent < 0:
        return invert(expression, power(plain(a) ** (-exponent), a, -exponent))
    if not isinstance(a, Centred) or a.constant == 0:
        return expression
    ratio = scale(1 / a.constant, a)
    log_ratio = logarithm(sp.log(plain(ratio)), ratio)
    bare = exponential(plain(ratio) ** exponent, scale(exponent, log_ratio))
    result = scale(a.constant**exponent, bare)
    return replace(result, plain=expression) if isinstance(result, Centred) else expression


def _combine(*terms: tuple[SymExpr, dict[SymExpr, SymExpr]]) -> dict[SymExpr, SymExpr]:
    """Linear combination of linear parts; coefficients that vanish are dropped."""
    total: dict[SymExpr, SymExpr] = {}
    for factor, linear in terms:
        for symbol, coefficient in linear.items() if factor != 0 else ():
            total[symbol] = sp.expand(total.get(symbol, 0) + factor * coefficient)
    return {symbol: coefficient for symbol, coefficient in total.items() if coefficient != 0}
