"""A record of a function on arrays of points: its values forwards, and its derivatives backwards (the adjoint)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from codegen.tape import Node

Value = Any  # a number, or an array of the points

_FUNCTIONS: Mapping[str, Callable[..., Value]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: a / b,
    "**": lambda a, b: a**b,
    "neg": lambda a: -a,
    "exp": np.exp,
    "log": np.log,
    "sqrt": np.sqrt,
    "sin": np.sin,
    "cos": np.cos,
    "atan": np.arctan,
    "atan2": np.arctan2,
}
# Derivatives with respect to each argument, of the value itself and the arguments.
_SLOPES: Mapping[str, Sequence[Callable[..., Value]]] = {
    "+": (lambda v, a, b: 1.0, lambda v, a, b: 1.0),
    "-": (lambda v, a, b: 1.0, lambda v, a, b: -1.0),
    "*": (lambda v, a, b: b, lambda v, a, b: a),
    "/": (lambda v, a, b: 1.0 / b, lambda v, a, b: -v / b),
    "**": (lambda v, a, b: b * a ** (b - 1.0),),
    "neg": (lambda v, a: -1.0,),
    "exp": (lambda v, a: v,),
    "log": (lambda v, a: 1.0 / a,),
    "sqrt": (lambda v, a: 0.5 / v,),
    "sin": (lambda v, a: np.cos(a),),
    "cos": (lambda v, a: -np.sin(a),),
    "atan": (lambda v, a: 1.0 / (1.0 + a * a),),
    "atan2": (lambda v, y, x: x / (x * x + y * y), lambda v, y, x: -y / (x * x + y * y)),
}


def forwards(nodes: Sequence[Node], read: Mapping[str, Mapping[str, Value]]) -> list[Value]:
    """Values of all nodes of a record.

    Args:
        nodes: in order.
        read: values by name, of what each kind of node reads: ``variable`` and ``parameter``.
    """
    values: list[Value] = []
    for node in nodes:
        if node.op == "const":
            values.append(node.value)
        elif node.op in read:
            values.append(read[node.op][str(node.value)])
        else:
            values.append(_FUNCTIONS[node.op](*(values[n] for n in node.args)))
    return values


def backwards(nodes: Sequence[Node], moved: Sequence[bool], values: Sequence[Value]) -> dict[tuple[str, str], Value]:
    """Derivatives of the last node with respect to what is read, by its kind and its name.

    Args:
        nodes: in order.
        moved: (n_nodes,) which of them depend on what derivatives are wanted by, that itself included.
        values: of all nodes.
    """
    slopes: list[Value] = [None] * len(nodes)
    slopes[-1] = 1.0
    found: dict[tuple[str, str], Value] = {}
    for n in range(len(nodes) - 1, -1, -1):
        node, slope = nodes[n], slopes[n]
        slopes[n] = None  # not needed any more
        if slope is None or not moved[n]:
            continue
        if node.op in ("variable", "parameter"):
            found[node.op, str(node.value)] = slope
        arguments = [values[arg] for arg in node.args]
        for arg, derivative in zip(node.args, _SLOPES.get(node.op, ()), strict=False):
            if moved[arg]:
                part = slope * derivative(values[n], *arguments)
                slopes[arg] = part if slopes[arg] is None else slopes[arg] + part
    return found
