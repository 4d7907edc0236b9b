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
from codegen.integrand import DEFORMATION_GRADIENT, LAYOUT, SECOND_GRADIENT, Integrand
from codegen.record import Record, components, in_parts, namespaces, part_of, record_of, traced
from codegen.tape import Node, Tape, TracedScalar
from codegen.trace import trace

Float = NDArray[np.float64]
Value = Any  # a number, or an array of the points

_ALONG = "along "  # before the names of the direction's components
_ACROSS = f"{_ALONG}F33"


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
        rate: what the rate computes; None where the energy does not depend on F.
        uses_second_gradient: whether the stress depends on G.
    """

    name: str
    parameters: tuple[str, ...]
    rate: Record | None
    uses_second_gradient: bool = False

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
        if self.rate is None:
            return Rates(by_F, by_G, by_parameter)
        moved = self.rate.depending(_is_no_direction)
        for some in in_parts(leading):
            read = components(DEFORMATION_GRADIENT, F[some]) | components(DEFORMATION_GRADIENT, A[some], _ALONG)
            read[_ACROSS] = np.zeros(()) if across is None else across[some]
            if self.uses_second_gradient and G is not None:
                read |= components(SECOND_GRADIENT, G[some])
            with np.errstate(all="ignore"):  # what is no number shows in the values
                slopes = self.rate.backwards(self.rate.forwards(read, part_of(parameters, some)), moved)
            for entry, found in zip(LAYOUT.inputs, (by_F, by_G), strict=True):
                if found is not None:
                    for index, name in zip(entry.indices, entry.names, strict=True):
                        found[some][(..., *index)] = slopes.get(name, 0.0)
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
    p, m = namespaces(tape, integrand)
    across = tape.add("variable", value=_ACROSS)
    along = _nested(tape, DEFORMATION_GRADIENT.shape)
    values = [
        rated(of, traced(tape, of), *((along, across) if of == DEFORMATION_GRADIENT else ())) for of in integrand.inputs
    ]
    psi = integrand.function(*values, RatedParameters(p), RatedMath(m))
    if not (isinstance(psi, Rated) and isinstance(psi.rate, TracedScalar)):
        return StressRates(integrand.name, integrand.parameter_names, None)
    rate = record_of(tape, psi.rate)
    uses_second_gradient = any(name.startswith("G") for name in rate.variables)
    return StressRates(integrand.name, integrand.parameter_names, rate, uses_second_gradient)


def _nested(tape: Tape, shape: tuple[int, ...], name: str = f"{_ALONG}F") -> Any:
    """Components of the direction as variables of a tape."""
    if not shape:
        return tape.add("variable", value=name)
    return [_nested(tape, shape[1:], f"{name}{i + 1}") for i in range(shape[0])]


def _is_no_direction(node: Node) -> bool:
    return node.op == "parameter" or (node.op == "variable" and not str(node.value).startswith(_ALONG))
