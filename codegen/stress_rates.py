"""Derivatives of the stress: of ``dpsi/dF : A + dpsi/dF[2][2] a`` with A and a held, by F, by G and by all parameters.

That number is the rate of the energy along A and a: the density is run on values with rates, as in
:mod:`codegen.directional`, and recorded once. Its derivatives come backwards along the record, exactly and all
together, whatever the form of the energy (reverse over forward). With A the derivative of a function of the stress by
the stress, they are the derivatives of that function.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codegen.directional import Rated, RatedMath, RatedParameters, rated
from codegen.errors import CodegenError
from codegen.integrand import DEFORMATION_GRADIENT, SECOND_GRADIENT, Integrand
from codegen.record import Record, Value, components, in_parts, namespaces, part_of, record_of
from codegen.tape import Tape, TracedScalar
from codegen.trace import trace

Float = NDArray[np.float64]

_ALONG = "along "  # what the names of the direction's components begin with
_ACROSS = "along F33"


@dataclass(frozen=True)
class Rates:
    """Derivatives at points.

    Attributes:
        by_F: (..., 2, 2) by the deformation gradient.
        by_G: (..., 2, 2, 2) by the second gradient; None if the stress does not depend on it.
        by_parameter: (..., n_parameters) by every parameter of the energy, in its order.
    """

    by_F: Float
    by_G: Float | None
    by_parameter: Float


@dataclass(frozen=True)
class StressRates:
    """Derivatives of the stress of an energy.

    Attributes:
        name: of the energy.
        parameters: names of its parameters, in order.
        record: what the rate takes; None if the energy has no stress.
        moved: (n_nodes,) which nodes of the record depend on F, G or a parameter.
        uses_second_gradient: whether the stress depends on G.
    """

    name: str
    parameters: tuple[str, ...]
    record: Record | None
    moved: tuple[bool, ...]
    uses_second_gradient: bool

    def at(
        self, F: Float, G: Float | None, parameters: Mapping[str, Value], A: Float, across: Float | None = None
    ) -> Rates:
        """Derivatives of ``P : A + P33 a`` at points.

        Args:
            F: (..., 2, 2) deformation gradients.
            G: (..., 2, 2, 2) second gradients, if the stress depends on them.
            parameters: numbers, or arrays whose first axis is that of F, and whose others go with it.
            A: (..., 2, 2) what the stress is multiplied with.
            across: (...) what the stress across the plane is multiplied with; 0 by default.

        Raises:
            ValueError: the second gradients are missing.
        """
        if self.uses_second_gradient and G is None:
            raise ValueError(f"the stress of energy '{self.name}' needs second gradients")
        leading = F.shape[:-2]
        by_F, by_parameter = np.zeros(F.shape), np.zeros((*leading, len(self.parameters)))
        by_G = np.zeros((*leading, 2, 2, 2)) if self.uses_second_gradient else None
        for some in in_parts(leading) if self.record is not None else ():
            assert self.record is not None
            read: dict[str, Value] = components(DEFORMATION_GRADIENT, F[some]) | components(
                DEFORMATION_GRADIENT, A[some], _ALONG
            )
            if by_G is not None and G is not None:
                read |= components(SECOND_GRADIENT, G[some])
            read[_ACROSS] = 0.0 if across is None else across[some]
            with np.errstate(all="ignore"):  # what is no number shows in the values
                slopes = self.record.backwards(self.record.forwards(read, part_of(parameters, some)), self.moved)
            for tensor, entry in ((by_F, DEFORMATION_GRADIENT), (by_G, SECOND_GRADIENT)):
                for index, name in zip(entry.indices, entry.names, strict=True) if tensor is not None else ():
                    assert tensor is not None
                    tensor[some][(..., *index)] = slopes.get(name, 0.0)
            for n, name in enumerate(self.parameters):
                by_parameter[some][..., n] = slopes.get(name, 0.0)
        return Rates(by_F, by_G, by_parameter)


def stress_rates_of(integrand: Integrand) -> StressRates:
    """Derivatives of the stress of an energy of F and G.

    Raises:
        CodegenError: it cannot be traced, or reads no deformation gradient.
    """
    if integrand.inputs[0] != DEFORMATION_GRADIENT:
        raise CodegenError(f"energy '{integrand.name}' reads no deformation gradient, so it has no stress")
    trace(integrand)  # says what is wrong with it
    tape = Tape(integrand)
    inputs: list[Any] = []
    for of in integrand.inputs:

        def part(head: tuple[int, ...], before: str, shape: tuple[int, ...]) -> Any:
            if len(head) == len(shape):
                return tape.add("variable", value=before + "".join(str(i + 1) for i in head))
            return [part((*head, i), before, shape) for i in range(shape[len(head)])]

        is_first = of == DEFORMATION_GRADIENT
        inputs.append(
            rated(
                of, part((), of.name, of.shape), part((), _ALONG + of.name, of.shape) if is_first else None,
                tape.add("variable", value=_ACROSS) if is_first else None,
            )
        )  # fmt: skip
    p, m = namespaces(tape, integrand)
    psi = integrand.function(*inputs, RatedParameters(p), RatedMath(m))
    rate = psi.rate if isinstance(psi, Rated) else 0
    if not isinstance(rate, TracedScalar):
        return StressRates(integrand.name, integrand.parameter_names, None, (), uses_second_gradient=False)
    record = record_of(tape, rate)
    return StressRates(
        integrand.name,
        integrand.parameter_names,
        record,
        record.depending(
            lambda node: node.op == "parameter" or (node.op == "variable" and not str(node.value).startswith(_ALONG))
        ),
        uses_second_gradient=any(name.startswith("G") for name in record.variables),
    )
