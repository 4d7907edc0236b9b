"""The first Piola-Kirchhoff stress of an energy at many points: derivatives with respect to F, F[2][2] included.

The energy is recorded once, with F[2][2] as one more variable, and the record is run forwards and backwards on arrays
of points (:mod:`codegen.record`): nothing is compiled, and parameters may vary from point to point.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codegen.errors import CodegenError
from codegen.integrand import DEFORMATION_GRADIENT, SECOND_GRADIENT, Integrand
from codegen.out_of_plane import no_stress_across
from codegen.record import AT_ONCE, Record, components, in_parts, namespaces, part_of, record_of, traced
from codegen.tape import Tape, TracedScalar
from codegen.trace import trace

__all__ = ["ACROSS", "AT_ONCE", "Stress", "stress_of"]

Float = NDArray[np.float64]
Value = Any  # a number, or an array of the points

ACROSS = "F33"


@dataclass(frozen=True)
class Stress:
    """The stress of an energy.

    Attributes:
        name: of the energy.
        record: what it computes.
        moved: (n_nodes,) which nodes of the record depend on F.
        uses_second_gradient: whether G is needed.
        reason: why there is no stress across the plane; empty if there is one.
    """

    name: str
    record: Record
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
        P, across = np.zeros(F.shape), np.zeros(F.shape[:-2])
        for some in in_parts(F.shape[:-2]):
            variables = components(DEFORMATION_GRADIENT, F[some]) | {ACROSS: 1.0}
            if self.uses_second_gradient and G is not None:
                variables |= components(SECOND_GRADIENT, G[some])
            with np.errstate(all="ignore"):  # what is no number shows in the values
                values = self.record.forwards(variables, part_of(parameters, some))
                slopes = self.record.backwards(values, self.moved)
            for index, name in zip(DEFORMATION_GRADIENT.indices, DEFORMATION_GRADIENT.names, strict=True):
                P[some][(..., *index)] = slopes.get(name, 0.0)
            across[some] = slopes.get(ACROSS, 0.0)
        return P, None if self.reason else across


def stress_of(integrand: Integrand) -> Stress:
    """The stress of an energy of F and G.

    Raises:
        CodegenError: it cannot be traced, or reads no deformation gradient.
    """
    if integrand.inputs[0] != DEFORMATION_GRADIENT:
        raise CodegenError(f"energy '{integrand.name}' reads no deformation gradient, so it has no stress")
    trace(integrand)  # says what is wrong with it
    tape = Tape(integrand)
    tensors = (traced(tape, entry, ACROSS) for entry in integrand.inputs)
    result = integrand.function(*tensors, *namespaces(tape, integrand))
    assert isinstance(result, TracedScalar)
    record = record_of(tape, result)
    return Stress(
        name=integrand.name,
        record=record,
        moved=record.depending(lambda node: node.op == "variable" and str(node.value).startswith("F")),
        uses_second_gradient=any(name.startswith("G") for name in record.variables),
        reason="" if ACROSS in record.variables else no_stress_across(integrand.name),
    )
