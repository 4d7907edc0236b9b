"""Stage 1: run a function on recording scalars and keep what it did.

Input: :class:`~codegen.integrand.Integrand`. Output: :class:`TracedEnergy`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from codegen.errors import CodegenError
from codegen.integrand import Integrand
from codegen.layout import Layout
from codegen.tape import MathNamespace, Node, ParameterNamespace, Tape, TracedScalar, TracedTensor


@dataclass(frozen=True)
class TracedEnergy:
    """What an integrand computes: nodes in order of evaluation, the last step being node ``result``.

    Attributes:
        used: names of the inputs that it depends on.
        n_varying: how many parameters, the last ones, vary from cell to cell.
    """

    name: str
    parameters: tuple[str, ...]
    layout: Layout
    nodes: tuple[Node, ...]
    result: int
    used: tuple[str, ...]
    n_varying: int = 0

    @property
    def n_rows(self) -> int:
        """Derivative rows up to the last that it depends on."""
        return self.layout.rows_of(self.used)

    def fingerprint(self) -> str:
        """SHA-256 of everything that the generated code depends on."""
        text = repr((self.name, self.parameters, self.n_varying, self.layout, self.nodes, self.result))
        return hashlib.sha256(text.encode()).hexdigest()


def recorded(integrand: Integrand) -> tuple[Tape, Any]:
    """What an integrand did, and what it returned: a recorded scalar, unless it does not depend on what it was given.

    Raises:
        CodegenError: it branches on a value, or uses an unknown function or an undeclared parameter, or fails.
    """
    name, parameters, layout = integrand.name, integrand.parameter_names, integrand.layout
    tape = Tape(integrand)
    _check_names(tape, parameters)
    inputs = layout.tensors(
        lambda n: tape.add("variable", value=layout.names[n]), lambda *rows: TracedTensor(tape, *rows)
    )
    try:
        return tape, integrand.function(*inputs, ParameterNamespace(tape, parameters), MathNamespace(tape))
    except CodegenError:
        raise
    except Exception as error:  # whatever a user's function raises is reported in its name
        if type(error).__module__.startswith("numpy"):
            arrays, first = tape.names(" and "), integrand.inputs[0].written
            tape.fail(f"numpy cannot compute with {arrays} ({error}); write it with {first}, arithmetic and m")
        raise CodegenError(f"energy '{name}': calling it failed with {type(error).__name__}: {error}") from error


def trace(integrand: Integrand) -> TracedEnergy:
    """Record what an integrand computes.

    Raises:
        CodegenError: it branches on a value, uses an unknown function or an undeclared parameter, does not depend on
            any input, or does not return one scalar.
    """
    tape, result = recorded(integrand)
    if not isinstance(result, TracedScalar):
        tape.fail(
            f"it returned {_describe(result)}; return one scalar that depends on {tape.names(' or ')}"
            if result is not None
            else "it returned nothing; end it with 'return psi'"
        )

    used = reachable(tape.nodes, result.index)
    variables = {str(tape.nodes[n].value) for n in used if tape.nodes[n].op == "variable"}
    if not variables:
        none = "depends on neither" if tape.inputs[1:] else "does not depend on"
        tape.fail(f"it {none} {tape.names(' nor ')}, so it has no stress; return an energy of the deformation")
    nodes, index = compact(tape.nodes, used)
    return TracedEnergy(
        name=integrand.name,
        parameters=integrand.parameter_names,
        layout=integrand.layout,
        nodes=nodes,
        result=index[result.index],
        used=tuple(entry.name for entry in integrand.inputs if variables & set(entry.names)),
        n_varying=integrand.n_varying,
    )


def _check_names(tape: Tape, parameters: Sequence[str]) -> None:
    for parameter in parameters:
        if not (parameter.isidentifier() and parameter.isascii()):
            tape.fail(f"parameter '{parameter}' is no name; use ASCII letters, digits and _ only")
        if list(parameters).count(parameter) > 1:
            tape.fail(f"parameter '{parameter}' is declared twice; rename one of the two")


def _describe(value: Any) -> str:
    return f"a {type(value).__name__}" if not isinstance(value, (int, float)) else f"the constant {value}"


def reachable(nodes: Sequence[Node], result: int) -> list[int]:
    """Numbers of the nodes that a result depends on, itself included, in order."""
    seen: set[int] = set()
    stack = [result]
    while stack:
        n = stack.pop()
        if n not in seen:
            seen.add(n)
            stack.extend(nodes[n].args)
    return sorted(seen)


def compact(nodes: Sequence[Node], used: Sequence[int]) -> tuple[tuple[Node, ...], dict[int, int]]:
    """Those of the nodes that are used, numbered anew, and the new number of each."""
    index = {old: new for new, old in enumerate(used)}
    return tuple(Node(nodes[n].op, tuple(index[a] for a in nodes[n].args), nodes[n].value) for n in used), index
