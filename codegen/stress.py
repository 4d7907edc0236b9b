"""The first Piola-Kirchhoff stress of an energy at many points: derivatives with respect to F, F[2][2] included.

The energy is recorded once, with F[2][2] as one more variable. Values go forwards along the record and derivatives
backwards (the adjoint of the record), on arrays of all points at once: all components together cost a few evaluations
of the energy, whatever its form, nothing is compiled, and parameters may vary from point to point.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codegen.adjoint import backwards, forwards
from codegen.errors import CodegenError
from codegen.integrand import DEFORMATION_GRADIENT, Integrand
from codegen.layout import Input
from codegen.out_of_plane import no_stress_across
from codegen.tape import MathNamespace, Node, ParameterNamespace, Tape, TracedScalar, TracedTensor
from codegen.trace import compact, reachable, trace

Float = NDArray[np.float64]
Value = Any  # a number, or an array of the points

ACROSS = "F33"
AT_ONCE = 4096  # points whose values are in the processor's cache together
_PLANE = ("F11", "F21", "F12", "F22")  # the order of Appendix C


@dataclass(frozen=True)
class Stress:
    """The stress of an energy.

    Attributes:
        name: of the energy.
        nodes: what it computes, in order; the last one is the energy.
        moved: (n_nodes,) which of them depend on F.
        uses_second_gradient: whether G is needed.
        reason: why there is no stress across the plane; empty if there is one.
    """

    name: str
    nodes: tuple[Node, ...]
    moved: tuple[bool, ...]
    uses_second_gradient: bool
    reason: str

    def at(self, F: Float, G: Float | None, parameters: Mapping[str, Value]) -> tuple[Float, Float | None]:
        """``dpsi/dF`` at points, force per reference area, the second gradient held: double stresses are apart.

        Args:
            F: (..., 2, 2) deformation gradients ``F[i][j] = dx_i / dX_j``.
            G: (..., 2, 2, 2) second gradients ``G[i][j][k] = d^2 u_i / dX_j dX_k``, if the energy needs them.
            parameters: numbers, or arrays whose first axis is that of F, and whose others go with it.

        Returns:
            ``P`` (..., 2, 2), and ``P33`` (...) across the plane at ``F[2][2] = 1``; None if the energy does not say.

        Raises:
            ValueError: the second gradients are missing.
        """
        if self.uses_second_gradient and G is None:
            raise ValueError(f"energy '{self.name}' needs second gradients")
        leading = F.shape[:-2]
        P, across = np.zeros(F.shape), np.zeros(leading)
        step = max(1, AT_ONCE // max(1, int(np.prod(leading[1:]))))
        for first in range(0, leading[0] if leading else 1, step):
            some = slice(first, first + step) if leading else ()
            p = {name: value[some] if np.ndim(value) else value for name, value in parameters.items()}
            slopes = self._slopes(F[some], None if G is None else G[some], p)
            for n, name in enumerate(_PLANE):
                P[some][..., n % 2, n // 2] = slopes.get(name, 0.0)
            across[some] = slopes.get(ACROSS, 0.0)
        return P, None if self.reason else across

    def _slopes(self, F: Float, G: Float | None, parameters: Mapping[str, Value]) -> dict[str, Value]:
        """Derivatives with respect to the components of F, by name."""
        read = {"variable": variables_of(F, G if self.uses_second_gradient else None), "parameter": parameters}
        with np.errstate(all="ignore"):  # what is no number shows in the values
            slopes = backwards(self.nodes, self.moved, forwards(self.nodes, read))
        return {name: slope for (_, name), slope in slopes.items()}


def variables_of(F: Float, G: Float | None) -> dict[str, Value]:
    """Components of F, its third direction included, and of G, if there is one, by name."""
    found: dict[str, Value] = {name: np.ascontiguousarray(F[..., n % 2, n // 2]) for n, name in enumerate(_PLANE)}
    found[ACROSS] = 1.0
    if G is not None:
        found |= {f"G{i + 1}{j + 1}{k + 1}": np.ascontiguousarray(G[..., i, j, k]) for i, j, k in np.ndindex(2, 2, 2)}
    return found


def stress_of(integrand: Integrand) -> Stress:
    """The stress of an energy of F and G.

    Raises:
        CodegenError: it cannot be traced, or reads no deformation gradient.
    """
    if integrand.inputs[0] != DEFORMATION_GRADIENT:
        raise CodegenError(f"energy '{integrand.name}' reads no deformation gradient, so it has no stress")
    trace(integrand)  # says what is wrong with it
    tape = Tape(integrand)
    result = integrand.function(
        *(
            entry.nested(
                _variables_of(tape, entry),
                lambda *rows: TracedTensor(tape, *rows),
                tape.add("variable", value=ACROSS) if entry.third else None,
            )
            for entry in integrand.inputs
        ),
        ParameterNamespace(tape, integrand.parameter_names),
        MathNamespace(tape),
    )
    assert isinstance(result, TracedScalar)
    nodes, _ = compact(tape.nodes, reachable(tape.nodes, result.index))
    variables = {str(node.value) for node in nodes if node.op == "variable"}
    moved: list[bool] = []
    for node in nodes:
        own = node.op == "variable" and str(node.value).startswith("F")
        moved.append(own or any(moved[arg] for arg in node.args))
    return Stress(
        name=integrand.name,
        nodes=nodes,
        moved=tuple(moved),
        uses_second_gradient=any(name.startswith("G") for name in variables),
        reason="" if ACROSS in variables else no_stress_across(integrand.name),
    )


def _variables_of(tape: Tape, entry: Input) -> Callable[[tuple[int, ...]], TracedScalar]:
    """What gives the components of an input, by index."""
    return lambda index: tape.add("variable", value=entry.names[entry.indices.index(index)])
