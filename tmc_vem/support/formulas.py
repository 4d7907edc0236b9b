"""Formulas of users, such as ``E * (1 + x / 2)``: read by Python's own parser, and nothing but arithmetic is done."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import key_of, require_known, shown

Float = NDArray[np.float64]

CONSTANTS = {"pi": np.pi}
FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    "abs": np.abs, "sqrt": np.sqrt, "exp": np.exp, "log": np.log, "log10": np.log10, "sin": np.sin, "cos": np.cos,
    "tan": np.tan, "tanh": np.tanh, "atan2": np.arctan2, "hypot": np.hypot, "min": np.minimum, "max": np.maximum,
    "where": np.where,
}  # fmt: skip
_BINARY: Mapping[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide, ast.Pow: np.power,
}  # fmt: skip
_COMPARED: Mapping[type[ast.cmpop], Callable[[Any, Any], Any]] = {
    ast.Lt: np.less, ast.LtE: np.less_equal, ast.Gt: np.greater, ast.GtE: np.greater_equal,
}  # fmt: skip
_ARGUMENTS = {"atan2": 2, "hypot": 2, "min": 2, "max": 2, "where": 3}  # of the others 1
LONGEST = 500  # characters; far fewer levels than Python's stack has
LARGEST = 1e300
WHAT = f"numbers, names, + - * / **, < <= > >=, pi, and {', '.join(FUNCTIONS)}"


@dataclass(frozen=True)
class Formula:
    """A formula of named numbers.

    Attributes:
        text: as users write it.

    Raises:
        InputError: it is none, or has something in it that formulas do not know.
    """

    text: str

    def __post_init__(self) -> None:
        _ = self.names

    @cached_property
    def _read(self) -> str:
        """The text as Python takes it, in which lambda is no name."""
        return re.sub(r"\blambda\b", "lambda_", self.text.strip())

    @cached_property
    def _tree(self) -> ast.expr:
        if len(self.text) > LONGEST:
            raise InputError(f"a formula of {len(self.text)} characters: {LONGEST} is the most")
        try:
            return ast.parse(self._read, mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise InputError(f"{shown(self.text)} is no formula: {WHAT}") from None

    @cached_property
    def names(self) -> frozenset[str]:
        """Names of the numbers that it depends on."""
        found: set[str] = set()
        try:
            self._check(self._tree, found)
        except RecursionError:
            raise InputError(f"{shown(self.text)} is nested too deeply for a formula") from None
        return frozenset(found)

    def __call__(self, values: Mapping[str, Any]) -> Any:
        """Its value, of numbers or of arrays; not a number where there is none.

        Args:
            values: of all its names, perhaps of more.

        Raises:
            InputError: a name has no value.
        """
        require_known(sorted(self.names), sorted(values), f"formula {shown(self.text)}")
        with np.errstate(all="ignore"):
            return self._value(self._tree, values)

    def _check(self, node: ast.expr, names: set[str]) -> None:
        match node:
            case ast.Constant(value=bool()):
                pass
            case ast.Constant(value=int() | float() as number):
                if not abs(number) <= LARGEST:
                    raise InputError(f"{shown(self.text)}: numbers beyond {LARGEST:g} are none")
                return
            case ast.Name(id=name):
                if name not in CONSTANTS:
                    names.add(key_of(name))
                return
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
                self._check(left, names)
                self._check(right, names)
                return
            case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
                self._check(operand, names)
                return
            case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in _COMPARED:
                self._check(left, names)
                self._check(right, names)
                return
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                require_known([name], sorted(FUNCTIONS), f"functions of {shown(self.text)}")
                wanted = _ARGUMENTS.get(name, 1)
                if len(arguments) != wanted:
                    raise InputError(f"{shown(self.text)}: {name} takes {wanted} values, not {len(arguments)}")
                for argument in arguments:
                    self._check(argument, names)
                return
        part = ast.get_source_segment(self._read, node) or self.text
        raise InputError(f"{shown(part)} is nothing that a formula may have: {WHAT}")

    def _value(self, node: ast.expr, values: Mapping[str, Any]) -> Any:
        match node:
            case ast.Constant(value=number):
                return np.float64(number)  # type: ignore[arg-type]
            case ast.Name(id=name):
                return CONSTANTS[name] if name in CONSTANTS else values[key_of(name)]
            case ast.BinOp(left=left, op=op, right=right):
                return _BINARY[type(op)](self._value(left, values), self._value(right, values))
            case ast.UnaryOp(op=op, operand=operand):
                value = self._value(operand, values)
                return -value if isinstance(op, ast.USub) else value
            case ast.Compare(left=left, ops=[compared], comparators=[right]):
                return _COMPARED[type(compared)](self._value(left, values), self._value(right, values))
            case ast.Call(func=ast.Name(id=name), args=arguments):
                return FUNCTIONS[name](*(self._value(argument, values) for argument in arguments))
        raise AssertionError(node)  # what _check lets through is handled above
