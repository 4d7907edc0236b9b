"""What operators and names are taken for each other."""

from __future__ import annotations

import ast

ARITHMETIC: dict[type[ast.operator], tuple[str, tuple[str, ...]]] = {
    ast.Add: ("+", ("-",)),
    ast.Sub: ("-", ("+",)),
    ast.Mult: ("*", ("/",)),
    ast.Div: ("/", ("*",)),
    ast.FloorDiv: ("//", ("*",)),
    ast.Mod: ("%", ("//",)),
    ast.Pow: ("**", ("*",)),
    ast.BitAnd: ("&", ("|",)),
    ast.BitOr: ("|", ("&",)),
}
COMPARISONS: dict[type[ast.cmpop], tuple[str, tuple[str, ...]]] = {
    ast.Lt: ("<", ("<=", ">=")),
    ast.LtE: ("<=", ("<", ">")),
    ast.Gt: (">", (">=", "<=")),
    ast.GtE: (">=", (">", "<")),
    ast.Eq: ("==", ("!=",)),
    ast.NotEq: ("!=", ("==",)),
    ast.Is: ("is", ("is not",)),
    ast.IsNot: ("is not", ("is",)),
    ast.In: ("in", ("not in",)),
    ast.NotIn: ("not in", ("in",)),
}
_PAIRS = (
    ("min", "max"), ("minimum", "maximum"), ("nanmin", "nanmax"), ("argmin", "argmax"), ("fmin", "fmax"),
    ("any", "all"), ("floor", "ceil"), ("sin", "cos"), ("arcsin", "arccos"), ("sinh", "cosh"), ("vstack", "hstack"),
    ("zeros", "ones"), ("log1p", "log"), ("expm1", "exp"), ("startswith", "endswith"), ("triu", "tril"),
    ("isnan", "isfinite"), ("MIN", "MAX"), ("SUM", "MAX"), ("sum", "max"), ("union", "intersection"),
    ("keys", "values"),
)  # fmt: skip
# The first pair with a name counts: max is taken for min.
NAMES: dict[str, str] = {}
for _first, _second in _PAIRS:
    NAMES.setdefault(_first, _second)
    NAMES.setdefault(_second, _first)
BUILTINS = {"min", "max", "any", "all", "sum"}  # of the names above, those that stand alone
C_OPERATORS = {
    "+": ("-",), "-": ("+",), "*": ("/",), "/": ("*",), "%": ("/",), "+=": ("-=",), "-=": ("+=",), "*=": ("/=",),
    "<": ("<=", ">="), "<=": ("<",), ">": (">=", "<="), ">=": (">",), "==": ("!=",), "!=": ("==",),
    "&&": ("||",), "||": ("&&",),
}  # fmt: skip
COMMUTATIVE = {
    "hypot", "min", "max", "minimum", "maximum", "gcd", "array_equal", "allclose", "union1d", "intersect1d",
    "logical_or", "logical_and", "add", "multiply",
}  # fmt: skip
