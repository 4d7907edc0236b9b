"""Stage 1: run a density on recording scalars and keep what it did as a directed acyclic graph.

The recorder is deliberately small and independent of sympy: it costs a millisecond, so the cache key of a kernel can
be made from what the density really computes instead of from its source text, and errors can name the density and say
what to write instead.

Input: a Python function ``density(F, G, p, m)``. Output: :class:`TracedEnergy`.
"""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

from codegen.errors import CodegenError
from codegen.ordering import F_INDICES, F_NAMES, G_INDICES, G_NAMES

UNARY_FUNCTIONS = ("exp", "log", "sqrt", "sin", "cos", "atan")
BINARY_FUNCTIONS = ("atan2",)

_UFUNC_OPERATORS = {"add": "+", "subtract": "-", "multiply": "*", "divide": "/"}

Density = Callable[[Any, Any, Any, Any], Any]


@dataclass(frozen=True)
class Node:
    """One operation: ``op`` is an operator, a function name, 'const', 'variable' or 'parameter'."""

    op: str
    args: tuple[int, ...] = ()
    value: float | str | None = None


@dataclass(frozen=True)
class TracedEnergy:
    """What a density computes: nodes in order of evaluation, the last step being node ``result``."""

    name: str
    parameters: tuple[str, ...]
    nodes: tuple[Node, ...]
    result: int
    uses_second_gradient: bool

    def fingerprint(self) -> str:
        """SHA-256 of everything that the generated code depends on."""
        text = repr((self.name, self.parameters, self.nodes, self.result))
        return hashlib.sha256(text.encode()).hexdigest()


class Recorder:
    """Collects nodes; equal operations on equal arguments are recorded once."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.nodes: list[Node] = []
        self._index: dict[Node, int] = {}

    def add(self, op: str, args: tuple[int, ...] = (), value: float | str | None = None) -> TracedScalar:
        node = Node(op, args, value)
        if node not in self._index:
            self._index[node] = len(self.nodes)
            self.nodes.append(node)
        return TracedScalar(self, self._index[node])

    def scalar(self, value: Any) -> TracedScalar:
        """The recorded form of a number or of a scalar that this recorder made."""
        if isinstance(value, TracedScalar):
            return value
        if isinstance(value, (int, float)):  # True and False too: (i == j) is a Kronecker delta
            return self.add("const", value=float(value))
        if not isinstance(value, (str, bytes)):
            with contextlib.suppress(TypeError, ValueError):
                return self.add("const", value=float(value))  # numpy scalars and the like
        self.fail(f"cannot compute with a {type(value).__name__}; use numbers, F, G, p and the functions of m")

    def fail(self, message: str) -> NoReturn:
        raise CodegenError(f"energy '{self.name}': {message}")


class TracedScalar:
    """A scalar whose arithmetic is recorded."""

    __slots__ = ("index", "recorder")

    def __init__(self, recorder: Recorder, index: int) -> None:
        self.recorder = recorder
        self.index = index

    def _binary(self, op: str, left: Any, right: Any) -> TracedScalar:
        return self.recorder.add(op, (self.recorder.scalar(left).index, self.recorder.scalar(right).index))

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
            self.recorder.fail("it divides by zero; is a parameter or a constant missing?")
        return self._binary("/", self, other)

    def __rtruediv__(self, other: Any) -> TracedScalar:
        return self._binary("/", other, self)

    def __pow__(self, exponent: Any) -> TracedScalar:
        if isinstance(exponent, TracedScalar) and self.recorder.nodes[exponent.index].op != "const":
            self.recorder.fail("the exponent of ** must be a number; write m.exp(b * m.log(a)) for a**b")
        return self._binary("**", self, exponent)

    def __rpow__(self, base: Any) -> TracedScalar:
        self.recorder.fail("the exponent of ** must be a number; write m.exp(b * m.log(a)) for a**b")

    def __neg__(self) -> TracedScalar:
        return self.recorder.add("neg", (self.index,))

    def __pos__(self) -> TracedScalar:
        return self

    def _no_branch(self, *_: Any) -> NoReturn:
        self.recorder.fail(
            "'if', 'abs', 'min', 'max' or a comparison on a value that is only known at run time; "
            "write a smooth expression instead, for example m.sqrt(x * x + eps) for abs(x)"
        )

    __bool__ = __lt__ = __le__ = __gt__ = __ge__ = __eq__ = __ne__ = __abs__ = _no_branch
    __hash__ = object.__hash__

    def _no_number(self) -> NoReturn:
        self.recorder.fail("math and numpy functions need numbers; use those of m: m.exp, m.log, m.sqrt, ...")

    __float__ = __int__ = __index__ = __complex__ = _no_number

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **_: Any) -> Any:
        """Arithmetic with numpy scalars on the left is recorded; np.exp and the like are refused."""
        operator = _UFUNC_OPERATORS.get(ufunc.__name__) if method == "__call__" else None
        if operator is None:
            self._no_number()
        return self._binary(operator, *inputs)


class TracedTensor(list[Any]):
    """``F`` or ``G`` of a density while it is being traced, or a row of one."""

    def __init__(self, recorder: Recorder, rows: Sequence[Any]) -> None:
        super().__init__(rows)
        self._recorder = recorder

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, tuple):
            self._recorder.fail("write F[i][j] and G[i][j][k], not F[i, j] and G[i, j, k]")
        try:
            return super().__getitem__(index)
        except (IndexError, TypeError):
            self._recorder.fail(f"F[i][j] and G[i][j][k] have the indices 0 and 1, not {index!r}")


class MathNamespace:
    """The ``m`` of a density while it is being traced."""

    def __init__(self, recorder: Recorder) -> None:
        self._recorder = recorder

    def __getattr__(self, name: str) -> Callable[..., TracedScalar]:
        if name.startswith("__"):
            raise AttributeError(name)
        recorder = self._recorder
        arity = 1 if name in UNARY_FUNCTIONS else 2 if name in BINARY_FUNCTIONS else 0
        if not arity:
            known = ", ".join(f"m.{f}" for f in (*UNARY_FUNCTIONS, *BINARY_FUNCTIONS))
            recorder.fail(f"unknown function m.{name}; known are {known}")

        def record(*args: Any) -> TracedScalar:
            if len(args) != arity:
                recorder.fail(f"m.{name} takes {arity} argument{'s' if arity > 1 else ''}, got {len(args)}")
            return recorder.add(name, tuple(recorder.scalar(a).index for a in args))

        return record


class ParameterNamespace:
    """The ``p`` of a density while it is being traced: only declared names exist."""

    def __init__(self, recorder: Recorder, names: Sequence[str]) -> None:
        self._recorder = recorder
        self._names = tuple(names)

    def __getattr__(self, name: str) -> TracedScalar:
        if name.startswith("__"):
            raise AttributeError(name)
        if name not in self._names:
            declared = ", ".join(self._names) or "none"
            self._recorder.fail(
                f"parameter p.{name} is not declared (declared: {declared}); "
                f"write @energy(parameters={{'{name}': 1.0}}) above it or give --param {name}=VALUE"
            )
        return self._recorder.add("parameter", value=name)


def trace(density: Density, name: str, parameters: Sequence[str]) -> TracedEnergy:
    """Record what ``density`` computes.

    Args:
        density: ``density(F, G, p, m) -> scalar``; ``F[i][j]`` and ``G[i][j][k]`` are indexed from 0.
        name: name of the energy, used in messages and in the generated code.
        parameters: names that may be read from ``p``, in the order in which the kernel takes their values.

    Raises:
        CodegenError: the density branches on a value, uses an unknown function or an undeclared parameter, does not
            depend on F or G, or does not return one scalar.
    """
    recorder = Recorder(name)
    _check_names(recorder, parameters)
    F = _tensor(recorder, 2, F_INDICES, F_NAMES)
    G = _tensor(recorder, 3, G_INDICES, G_NAMES)

    try:
        result = density(F, G, ParameterNamespace(recorder, parameters), MathNamespace(recorder))
    except CodegenError:
        raise
    except Exception as error:  # whatever a user's function raises is reported in its name
        if type(error).__module__.startswith("numpy"):
            recorder.fail(f"numpy cannot compute with F and G ({error}); write it with F[i][j], arithmetic and m")
        raise CodegenError(f"energy '{name}': calling it failed with {type(error).__name__}: {error}") from error
    if not isinstance(result, TracedScalar):
        recorder.fail(
            f"it returned {_describe(result)}; return one scalar that depends on F or G"
            if result is not None
            else "it returned nothing; end it with 'return psi'"
        )

    used = _reachable(recorder.nodes, result.index)
    variables = {str(recorder.nodes[n].value) for n in used if recorder.nodes[n].op == "variable"}
    if not variables:
        recorder.fail("it depends on neither F nor G, so it has no stress; return an energy of the deformation")
    nodes, index = _compact(recorder.nodes, used)
    return TracedEnergy(
        name=name,
        parameters=tuple(parameters),
        nodes=nodes,
        result=index[result.index],
        uses_second_gradient=any(variable.startswith("G") for variable in variables),
    )


def _tensor(
    recorder: Recorder, order: int, indices: Sequence[tuple[int, ...]], names: Sequence[str], head: tuple[int, ...] = ()
) -> Any:
    if len(head) == order:
        return recorder.add("variable", value=names[list(indices).index(head)])
    return TracedTensor(recorder, [_tensor(recorder, order, indices, names, (*head, i)) for i in (0, 1)])


def _check_names(recorder: Recorder, parameters: Sequence[str]) -> None:
    for parameter in parameters:
        if not (parameter.isidentifier() and parameter.isascii()):
            recorder.fail(f"parameter '{parameter}' is no name; use ASCII letters, digits and _ only")
        if list(parameters).count(parameter) > 1:
            recorder.fail(f"parameter '{parameter}' is declared twice; rename one of the two")


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
