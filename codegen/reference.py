"""What is wrong with an energy at F = I, G = 0: found in its trace, operation by operation, and said in words."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from codegen.trace import TracedEnergy


def fault_at_reference(traced: TracedEnergy, parameters: Mapping[str, float]) -> str:
    """The first operation that has no value or no derivatives at F = I, G = 0, with the remedy; empty if all have.

    Args:
        traced: the energy.
        parameters: values of its parameters.
    """
    at_rest = dict(zip(traced.layout.names, map(float, traced.layout.at_rest), strict=True))
    values: list[float] = []
    for node in traced.nodes:
        arguments = [values[a] for a in node.args]
        if node.op == "variable":
            values.append(at_rest[str(node.value)])
        elif node.op == "parameter":
            values.append(float(parameters[str(node.value)]))
        elif node.op == "const":
            values.append(float(node.value or 0.0))
        else:
            fault = _FAULTS[node.op](*arguments) if node.op in _FAULTS else ""
            if fault:
                return fault
            try:
                values.append(_VALUES[node.op](*arguments))
            except OverflowError:
                return f"{node.op} of {arguments[0]:g} is too large a number at F = I"
    return ""


def _division(_: float, b: float) -> str:
    return "" if b else "it divides by zero at F = I: add a small number to what it divides by"


def _square_root(x: float) -> str:
    if x < 0.0:
        return f"a square root is taken of {x:g} at F = I"
    return "" if x else "a square root is zero at F = I, its derivative is infinite: write m.sqrt(x + eps)"


def _logarithm(x: float) -> str:
    return "" if x > 0.0 else f"a logarithm is taken of {x:g} at F = I"


def _power(base: float, exponent: float) -> str:
    if exponent.is_integer():
        return "" if base or exponent >= 0.0 else f"a power {exponent:g} is taken of zero at F = I"
    if base < 0.0:
        return f"a power {exponent:g} is taken of {base:g} at F = I: of negative numbers there are integer powers only"
    if base == 0.0 and exponent < 2.0:
        remedy = f"write (x + eps)**{exponent:g}"
        return f"a power {exponent:g} is taken of zero at F = I, its derivatives are infinite: {remedy}"
    return ""


def _angle(y: float, x: float) -> str:
    return "" if x or y else "m.atan2(0, 0) is taken at F = I, which is no angle"


_FAULTS: dict[str, Callable[..., str]] = {
    "/": _division, "sqrt": _square_root, "log": _logarithm, "**": _power, "atan2": _angle,
}  # fmt: skip
_VALUES: dict[str, Callable[..., float]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: a / b,
    "**": lambda a, b: float(a**b),
    "neg": lambda a: -a,
    "exp": math.exp,
    "log": math.log,
    "sqrt": math.sqrt,
    "sin": math.sin,
    "cos": math.cos,
    "atan": math.atan,
    "atan2": math.atan2,
}
