"""Stage 3: turn expressions into straight-line programs with shared subexpressions.

Powers and logarithms of J are reduced to one logarithm and one reciprocal: ``J^(-5/3) = exp(-2/3 L) / J`` with
``L = log(J)``. Entries of the Hessian that vanish identically are left out.

Input: :class:`~codegen.ir.DerivedEnergy`. Output: one :class:`~codegen.ir.Schedule` a level.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import sympy as sp
from sympy.codegen.cfunctions import log1p

from codegen.centre import J_MINUS_1, ExpRemainder, J, LogRemainder
from codegen.ir import LEVELS, Assignment, DerivedEnergy, Schedule, SymExpr

LOG_J = sp.Symbol("logJ", real=True)
LOG_J_REMAINDER = sp.Symbol("logJr", real=True)  # log(J) - (J - 1)
INVERSE_J = sp.Symbol("invJ", positive=True)


class reciprocal(sp.Function):  # type: ignore[misc]
    """Opaque 1/x, so that equal denominators are shared and negative powers become products."""


class log_remainder(sp.Function):  # type: ignore[misc]
    """The C function of that name: takes d and log(1 + d)."""


class exp_remainder(sp.Function):  # type: ignore[misc]
    """The C function of that name: takes d and exp(d)."""


def schedule(derived: DerivedEnergy) -> dict[str, Schedule]:
    """Straight-line programs for energy alone, energy and gradient, and all three, by the names in ``LEVELS``."""
    energy = [("psi", derived.energy)]
    gradient = [(f"g[{a}]", value) for a, value in enumerate(derived.gradient) if value != 0]
    hessian = [(f"h[{n}]", value) for n, value in enumerate(derived.hessian) if value != 0]
    named = {"energy": energy, "gradient": energy + gradient, "tangent": energy + gradient + hessian}
    return {level: program(level, named[level]) for level in LEVELS}


def program(level: str, outputs: Sequence[tuple[str, SymExpr]]) -> Schedule:
    """Straight-line program of expressions by the names of their targets, with what they share computed once."""
    memo: dict[SymExpr, SymExpr] = {}
    reduced = [_reduce(value, memo) for _, value in outputs]
    before = int(sp.count_ops([value for _, value in outputs]))
    replacements, results = sp.cse(reduced, symbols=_temporaries(), order="none")
    temporaries = tuple(Assignment(str(symbol), value) for symbol, value in replacements)
    assigned = tuple(Assignment(name, value) for (name, _), value in zip(outputs, results, strict=True))
    after = int(sp.count_ops([a.value for a in (*temporaries, *assigned)]))
    return Schedule(level, temporaries, assigned, before, after)


def _temporaries() -> Iterator[SymExpr]:
    n = 0
    while True:
        yield sp.Symbol(f"t{n}", real=True)
        n += 1


def _reduce(expression: SymExpr, memo: dict[SymExpr, SymExpr]) -> SymExpr:
    if expression.is_Atom:
        return expression
    if expression not in memo:
        memo[expression] = _reduce_node(expression.func(*(_reduce(a, memo) for a in expression.args)))
    return memo[expression]


def _reduce_node(expression: SymExpr) -> SymExpr:
    if isinstance(expression, sp.Pow):
        return _power(*expression.args)
    if isinstance(expression, sp.log) and expression.args[0] == J:
        return LOG_J
    if isinstance(expression, LogRemainder):
        (d,) = expression.args
        return LOG_J_REMAINDER if d == J_MINUS_1 else log_remainder(d, log1p(d))
    if isinstance(expression, ExpRemainder):
        return exp_remainder(expression.args[0], sp.exp(expression.args[0]))
    if isinstance(expression, sp.Add):
        return _with_j_minus_1(expression)
    return expression


def _power(base: SymExpr, exponent: SymExpr) -> SymExpr:
    if base == J and exponent.is_Rational:
        whole = -((-exponent) // 1) if exponent < 0 else exponent // 1  # towards zero
        fraction = exponent - whole
        factor = J**whole if whole > 0 else INVERSE_J ** (-whole)
        return factor * (sp.exp(fraction * LOG_J) if fraction != 0 else 1)
    if exponent.is_Integer and exponent < 0:
        return reciprocal(base) ** (-exponent)
    return base**exponent


def _with_j_minus_1(expression: SymExpr) -> SymExpr:
    constant, rest = expression.as_coeff_Add()
    coefficient = rest.coeff(J) if rest.has(J) else 0
    if constant != 0 and coefficient == -constant:
        return rest - coefficient * J + coefficient * J_MINUS_1
    return expression
