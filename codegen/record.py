"""A record of what a function computes, run forwards on arrays of points and backwards for its derivatives.

Values go forwards along the record and derivatives backwards (the adjoint of the record), on all points at once: all
derivatives together cost a few evaluations, whatever the function, and nothing is compiled.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codegen.integrand import Integrand
from codegen.layout import Input
from codegen.tape import MathNamespace, Node, ParameterNamespace, Tape, TracedScalar, TracedTensor
from codegen.trace import compact, reachable

Float = NDArray[np.floating[Any]]
Value = Any  # a number, or an array of the points

AT_ONCE = 4096  # points whose values are in the processor's cache together

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


@dataclass(frozen=True)
class Record:
    """What a function of a point computes.

    Attributes:
        nodes: in order of evaluation; the last one is the value.
    """

    nodes: tuple[Node, ...]

    @property
    def variables(self) -> frozenset[str]:
        """Names of the variables that the value depends on."""
        return frozenset(str(node.value) for node in self.nodes if node.op == "variable")

    def depending(self, leaf: Callable[[Node], bool]) -> tuple[bool, ...]:
        """(n_nodes,) which of the nodes depend on some variables or parameters, or are one of them."""
        moved: list[bool] = []
        for node in self.nodes:
            moved.append(leaf(node) or any(moved[arg] for arg in node.args))
        return tuple(moved)

    def forwards(self, variables: Mapping[str, Value], parameters: Mapping[str, Value]) -> list[Value]:
        """Values of all nodes, from those of variables and parameters by name."""
        read = {"variable": variables, "parameter": parameters}
        values: list[Value] = []
        for node in self.nodes:
            if node.op == "const":
                values.append(node.value)
            elif node.op in read:
                values.append(read[node.op][str(node.value)])
            else:
                values.append(_FUNCTIONS[node.op](*(values[n] for n in node.args)))
        return values

    def backwards(self, values: Sequence[Value], moved: Sequence[bool]) -> dict[str, Value]:
        """Derivatives of the last value by name of the variable or parameter.

        Args:
            values: of all nodes.
            moved: which nodes depend on those asked for, of :meth:`depending`.
        """
        slopes: list[Value] = [None] * len(self.nodes)
        slopes[-1] = 1.0
        found = {}
        for n in range(len(self.nodes) - 1, -1, -1):
            node, slope = self.nodes[n], slopes[n]
            slopes[n] = None  # not needed any more
            if slope is None or not moved[n]:
                continue
            if not node.args:
                found[str(node.value)] = slope
            arguments = [values[arg] for arg in node.args]
            for arg, derivative in zip(node.args, _SLOPES.get(node.op, ()), strict=False):
                if moved[arg]:
                    part = slope * derivative(values[n], *arguments)
                    slopes[arg] = part if slopes[arg] is None else slopes[arg] + part
        return found


def record_of(tape: Tape, result: TracedScalar) -> Record:
    """What a tape has of a result, and nothing else."""
    return Record(compact(tape.nodes, reachable(tape.nodes, result.index))[0])


def traced(tape: Tape, entry: Input, out_of_plane: str = "") -> Any:
    """An input as a function reads it, whose components are variables of a tape, and F[2][2] too if it has a name."""
    return entry.nested(
        lambda index: tape.add("variable", value=entry.names[entry.indices.index(index)]),
        lambda *rows: TracedTensor(tape, *rows),
        tape.add("variable", value=out_of_plane) if entry.third and out_of_plane else None,
    )


def namespaces(tape: Tape, integrand: Integrand) -> tuple[ParameterNamespace, MathNamespace]:
    """The ``p`` and ``m`` of a function that is recorded on a tape."""
    return ParameterNamespace(tape, integrand.parameter_names), MathNamespace(tape)


def in_parts(leading: tuple[int, ...]) -> Iterator[Any]:
    """Indices of the first axis of points (...), so that few enough are taken at a time; all of a single point."""
    if not leading:
        yield ()
        return
    step = max(1, AT_ONCE // max(1, int(np.prod(leading[1:]))))
    for first in range(0, leading[0], step):
        yield slice(first, first + step)


def part_of(parameters: Mapping[str, Value], some: Any) -> dict[str, Value]:
    """Parameters of some points, as numpy's: numbers are the same everywhere, the first axis of arrays is the points'.

    Python's numbers would raise an error where numpy says that the result is no number.
    """
    return {
        name: np.asarray(value)[some] if np.ndim(value) else np.float64(value) for name, value in parameters.items()
    }


def components(of: Input, tensor: NDArray[Any], before: str = "") -> dict[str, NDArray[Any]]:
    """Components (...) of a tensor (..., shape of the input) by name, ``F11``, with something written before it."""
    last = tensor.ndim - len(of.shape)
    leading = np.ascontiguousarray(np.moveaxis(tensor, range(last), range(len(of.shape), tensor.ndim)))
    return {before + name: leading[index] for index, name in zip(of.indices, of.names, strict=True)}
