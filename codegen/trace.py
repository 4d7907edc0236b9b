"""Stage 1: run a density on recording scalars and keep what it did as a directed acyclic graph.

The tape is deliberately small and independent of sympy: it costs a millisecond, so the cache key of a kernel can
be made from what the density really computes instead of from its source text, and errors can name the density and say
what to write instead.

Input: :class:`~codegen.integrand.Integrand`. Output: :class:`TracedEnergy`.
"""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

from codegen.errors import CodegenError
from codegen.integrand import Integrand
from codegen.layout import Layout

UNARY_FUNCTIONS = ("exp", "log", "sqrt", "sin", "cos", "atan")
BINARY_FUNCTIONS = ("atan2",)

_UFUNC_OPERATORS = {"add": "+", "subtract": "-", "multiply": "*", "divide": "/"}


@dataclass(frozen=True)
class Node:
    """One operation: ``op`` is an operator, a function name, 'const', 'variable' or 'parameter'."""

    op: str
    args: tuple[int, ...] = ()
    value: float | str | None = None


@dataclass(frozen=True)
class TracedEnergy:
    """What an integrand computes: nodes in order of evaluation, the last step being node ``result``.

    Attributes:
        used: names of the inputs that it depends on.
    """

    name: str
    parameters: tuple[str, ...]
    layout: Layout
    nodes: tuple[Node, ...]
    result: int
    used: tuple[str, ...]

    @property
    def n_rows(self) -> int:
        """Derivative rows up to the last that it depends on."""
        return self.layout.rows_of(self.used)

    def fingerprint(self) -> str:
        """SHA-256 of everything that the generated code depends on."""
        text = repr((self.name, self.parameters, self.layout, self.nodes, self.result))
        return hashlib.sha256(text.encode()).hexdigest()


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


class TracedTensor(list[Any]):
    """An input of a function while it is being traced, or a row of one."""

    def __init__(self, tape: Tape, rows: Sequence[Any]) -> None:
        super().__init__(rows)
        self._tape = tape

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, tuple):
            refused = " and ".join(entry.refused for entry in self._tape.inputs)
            self._tape.fail(f"write {self._tape.written()}, not {refused}")
        try:
            return super().__getitem__(index)
        except (IndexError, TypeError):
            self._tape.fail(f"{self._tape.written()} have the indices 0 and 1, not {index!r}")


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


def trace(integrand: Integrand) -> TracedEnergy:
    """Record what an integrand computes.

    Raises:
        CodegenError: it branches on a value, uses an unknown function or an undeclared parameter, does not depend on
            any input, or does not return one scalar.
    """
    name, parameters, layout = integrand.name, integrand.parameter_names, integrand.layout
    tape = Tape(integrand)
    _check_names(tape, parameters)
    inputs = layout.tensors(
        lambda n: tape.add("variable", value=layout.names[n]), lambda rows: TracedTensor(tape, rows)
    )
    try:
        result = integrand.function(*inputs, ParameterNamespace(tape, parameters), MathNamespace(tape))
    except CodegenError:
        raise
    except Exception as error:  # whatever a user's function raises is reported in its name
        if type(error).__module__.startswith("numpy"):
            arrays, first = tape.names(" and "), integrand.inputs[0].written
            tape.fail(f"numpy cannot compute with {arrays} ({error}); write it with {first}, arithmetic and m")
        raise CodegenError(f"energy '{name}': calling it failed with {type(error).__name__}: {error}") from error
    if not isinstance(result, TracedScalar):
        tape.fail(
            f"it returned {_describe(result)}; return one scalar that depends on {tape.names(' or ')}"
            if result is not None
            else "it returned nothing; end it with 'return psi'"
        )

    used = _reachable(tape.nodes, result.index)
    variables = {str(tape.nodes[n].value) for n in used if tape.nodes[n].op == "variable"}
    if not variables:
        none = "depends on neither" if tape.inputs[1:] else "does not depend on"
        tape.fail(f"it {none} {tape.names(' nor ')}, so it has no stress; return an energy of the deformation")
    nodes, index = _compact(tape.nodes, used)
    return TracedEnergy(
        name=name,
        parameters=parameters,
        layout=layout,
        nodes=nodes,
        result=index[result.index],
        used=tuple(entry.name for entry in integrand.inputs if variables & set(entry.names)),
    )


def _check_names(tape: Tape, parameters: Sequence[str]) -> None:
    for parameter in parameters:
        if not (parameter.isidentifier() and parameter.isascii()):
            tape.fail(f"parameter '{parameter}' is no name; use ASCII letters, digits and _ only")
        if list(parameters).count(parameter) > 1:
            tape.fail(f"parameter '{parameter}' is declared twice; rename one of the two")


def _describe(value: Any) -> str:
    return f"a {type(value).__name__}" if not isinstance(value, (int, float)) else f"the constant {value}"


def _reachable(nodes: Sequence[Node], result: int) -> list[int]:
    seen: set[int] = set()
    stack = [result]
    while stack:
        n = stack.pop()
        if n not in seen:
            seen.add(n)
            stack.extend(nodes[n].args)
    return sorted(seen)


def _compact(nodes: Sequence[Node], used: Sequence[int]) -> tuple[tuple[Node, ...], dict[int, int]]:
    index = {old: new for new, old in enumerate(used)}
    return tuple(Node(nodes[n].op, tuple(index[a] for a in nodes[n].args), nodes[n].value) for n in used), index
