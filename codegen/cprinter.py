"""Stage 4: print sympy expressions as C99: integer powers as products, constants with 17 digits."""

from __future__ import annotations

from typing import Any

from sympy.printing.c import C99CodePrinter
from sympy.printing.precedence import PRECEDENCE

from codegen.ir import SymExpr


class KernelPrinter(C99CodePrinter):  # type: ignore[misc]
    """C99 printer of the point kernels. Division only in ``reciprocal``; no call of ``pow`` for integer powers."""

    def _print_Pow(self, expr: SymExpr) -> str:
        base, exponent = expr.args
        if exponent.is_Integer and 2 <= exponent <= 16:
            return self._product(self.parenthesize(base, PRECEDENCE["Atom"], strict=True), int(exponent))
        if exponent.is_Rational and exponent.q == 2 and exponent.p == 1:
            return f"sqrt({self._print(base)})"
        if exponent.is_Rational and exponent.q == 3:  # not cbrt, which has a value where its derivatives have none
            return f"pow({self._print(base)}, {self._print(exponent)})"
        return str(super()._print_Pow(expr))

    def parenthesize(self, item: SymExpr, level: int, strict: bool = False) -> str:
        if item.is_Rational and item > 0:  # printed as one decimal number, which needs no parentheses
            return str(self._print(item))
        return str(super().parenthesize(item, level, strict))

    def _product(self, base: str, exponent: int) -> str:
        """Balanced product, so that the compiler sees the squares it can share."""
        if exponent == 1:
            return base
        half = self._product(base, exponent // 2)
        other = self._product(base, exponent - exponent // 2)
        return f"({half}*{other})"

    def _print_Rational(self, expr: SymExpr) -> str:
        return repr(int(expr.p) / int(expr.q))

    def _print_Integer(self, expr: SymExpr) -> str:
        return f"{int(expr)}.0"

    def _print_Float(self, expr: SymExpr) -> str:
        return repr(float(expr))

    def _print_reciprocal(self, expr: SymExpr) -> str:
        return f"(1.0/({self._print(expr.args[0])}))"

    def _print_log_remainder(self, expr: SymExpr) -> str:
        return f"log_remainder({', '.join(map(self._print, expr.args))})"

    def _print_exp_remainder(self, expr: SymExpr) -> str:
        return f"exp_remainder({', '.join(map(self._print, expr.args))})"


def c_expression(expression: SymExpr, printer: Any = KernelPrinter()) -> str:  # noqa: B008  (stateless)
    """C99 text of an expression."""
    return str(printer.doprint(expression))
