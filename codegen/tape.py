"""Recording scalars: what a function does with them is written on a tape, as a directed acyclic graph.

The tape is deliberately small and independent of sympy: it costs a millisecond, so the cache key of a kernel can be
made from what a function really computes instead of from its source text, and errors can name the energy and say what
to write instead.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

from codegen.errors import CodegenError
from codegen.integrand import Integrand
from codegen.layout import Rows

UNARY_FUNCTIONS = ("exp", "log", "sqrt", "sin", "cos", "atan")
BINARY_FUNCTIONS = ("atan2",)

_UFUNC_OPERATORS = {"add": "+", "subtract": "-", "multiply": "*", "divide": "/"}


@dataclass(frozen=True)
class Node:
    """One operation: ``op`` is an operator, a function name, 'const', 'variable' or 'parameter'."""

    op: str
    args: tuple[int, ...] = ()
    value: float | str | None = None


class Tape:
    """Collects nodes; equal operations on equal arguments are recorded once."""

    def __init__(self, integrand: Integrand) -> None:
        self.name = integrand.name
        self.inputs = integrand.inputs
        self.nodes: list[Node] = []
        self._index: dict[Node, int] = {}

    def add(self, op: str, args: tuple[int, ...] = (), value: float | str | None = None) -> TracedScalar:
        node = Node(op, args, value)
        if node not in self._index:
            self._index[node] = len(self.nodes)
            self.nodes.append(node)
        return TracedScalar(self, self._index[node])

    def scalar(self, value: Any) -> TracedScalar:
        """The recorded form of a number or of a scalar that this tape made."""
        if isinstance(value, TracedScalar):
            return value
        if isinstance(value, (int, float)):  # True and False too: (i == j) is a Kronecker delta
            return self.add("const", value=float(value))
        if not isinstance(value, (str, bytes)):
            with contextlib.suppress(TypeError, ValueError):
                return self.add("const", value=float(value))  # numpy scalars and the like
        self.fail(
            f"cannot compute with a {type(value).__name__}; use numbers, {self.names(', ')}, p and the functions of m"
        )

    def names(self, between: str) -> str:
        """Names of the inputs for messages."""
        return between.join(entry.name for entry in self.inputs)

    def written(self) -> str:
        """How components of the inputs are written: ``F[i][j] and G[i][j][k]``."""
        return " and ".join(entry.written for entry in self.inputs)

    def fail(self, message: str) -> NoReturn:
        raise CodegenError(f"energy '{self.name}': {message}")


class TracedScalar:
    """A scalar whose arithmetic is recorded."""

    __slots__ = ("index", "tape")

    def __init__(self, tape: Tape, index: int) -> None:
        self.tape = tape
        self.index = index

    def _binary(self, op: str, left: Any, right: Any) -> TracedScalar:
        return self.tape.add(op, (self.tape.scalar(left).index, self.tape.scalar(right).index))

    def __add__(self, other: Any) -> TracedScalar:
        return self._binary("+", self, other)

    def __radd__(self, other: Any) -> TracedScalar:
        return self._binary("+", other, self)

    def __sub__(self, other: Any) -> TracedScalar:
        return self._binary("-", self, other)

    def __rsub__(self, other: Any) -> TracedScalar:
        return self._binary("-", other, self)

    def __mul__(self, other: Any) -> TracedScalar:
        return self._binary("*", self, other)

    def __rmul__(self, other: Any) -> TracedScalar:
        return self._binary("*", other, self)

    def __truediv__(self, other: Any) -> TracedScalar:
        if isinstance(other, (int, float)) and other == 0:
            self.tape.fail("it divides by zero; is a parameter or a constant missing?")
        return self._binary("/", self, other)

    def __rtruediv__(self, other: Any) -> TracedScalar:
        return self._binary("/", other, self)

    def __pow__(self, exponent: Any) -> TracedScalar:
        if isinstance(exponent, TracedScalar) and self.tape.nodes[exponent.index].op != "const":
            self.tape.fail("the exponent of ** must be a number; write m.exp(b * m.log(a)) for a**b")
        return self._binary("**", self, exponent)

    def __rpow__(self, base: Any) -> TracedScalar:
        self.tape.fail("the exponent of ** must be a number; write m.exp(b * m.log(a)) for a**b")

    def __neg__(self) -> TracedScalar:
        return self.tape.add("neg", (self.index,))

    def __pos__(self) -> TracedScalar:
        return self

    def _no_branch(self, *_: Any) -> NoReturn:
        self.tape.fail(
            "'if', 'abs', 'min', 'max' or a comparison on a value that is only known at run time; "
            "write a smooth expression instead, for example m.sqrt(x * x + eps) for abs(x)"
        )

    __bool__ = __lt__ = __le__ = __gt__ = __ge__ = __eq__ = __ne__ = __abs__ = _no_branch
    __hash__ = object.__hash__

    def _no_number(self) -> NoReturn:
        self.tape.fail("math and numpy functions need numbers; use those of m: m.exp, m.log, m.sqrt, ...")

    __float__ = __int__ = __index__ = __complex__ = _no_number

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **_: Any) -> Any:
        """Arithmetic with numpy scalars on the left is recorded; np.exp and the like are refused."""
        operator = _UFUNC_OPERATORS.get(ufunc.__name__) if method == "__call__" else None
        if operator is None:
            self._no_number()
        return self._binary(operator, *inputs)


class TracedTensor(Rows):
    """An input of a function while it is being traced, or a row of one."""

    def __init__(self, tape: Tape, rows: Sequence[Any], third: Any = None) -> None:
        super().__init__(rows, third)
        self._tape = tape

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, tuple):
            refused = " and ".join(entry.refused for entry in self._tape.inputs)
            self._tape.fail(f"write {self._tape.written()}, not {refused}")
        try:
            return super().__getitem__(index)
        except (IndexError, TypeError):
            third = "".join(f", and {entry.name} has 2" for entry in self._tape.inputs if entry.third)
            self._tape.fail(f"{self._tape.written()} have the indices 0 and 1{third}, not {index!r}")


class MathNamespace:
    """The ``m`` of a density while it is being traced."""

    def __init__(self, tape: Tape) -> None:
        self._tape = tape

    def __getattr__(self, name: str) -> Callable[..., TracedScalar]:
        if name.startswith("__"):
            raise AttributeError(name)
        tape = self._tape
        arity = 1 if name in UNARY_FUNCTIONS else 2 if name in BINARY_FUNCTIONS else 0
        if not arity:
            known = ", ".join(f"m.{f}" for f in (*UNARY_FUNCTIONS, *BINARY_FUNCTIONS))
            tape.fail(f"unknown function m.{name}; known are {known}")

        def record(*args: Any) -> TracedScalar:
            if len(args) != arity:
                tape.fail(f"m.{name} takes {arity} argument{'s' if arity > 1 else ''}, got {len(args)}")
            return tape.add(name, tuple(tape.scalar(a).index for a in args))

        return record


class ParameterNamespace:
    """The ``p`` of a density while it is being traced: only declared names exist."""

    def __init__(self, tape: Tape, names: Sequence[str]) -> None:
        self._tape = tape
        self._names = tuple(names)

    def __getattr__(self, name: str) -> TracedScalar:
        if name.startswith("__"):
            raise AttributeError(name)
        if name not in self._names:
            declared = ", ".join(self._names) or "none"
            self._tape.fail(
                f"parameter p.{name} is not declared (declared: {declared}); "
                f"write @energy(parameters={{'{name}': 1.0}}) above it or give --param {name}=VALUE"
            )
        return self._tape.add("parameter", value=name)
