"""Mixed second derivatives of an energy at many points: along a direction, and with respect to parameters or F and G.

The rate of the energy along (dF, dG) is ``dpsi/dF : dF + dpsi/dG :. dG``: of a virtual displacement, its work. The
density is run on values with rates (:mod:`codegen.directional`), the rate is recorded, and the record is run
backwards (:mod:`codegen.record`): to the parameters, what a residual changes by with each of them; to F and G, what
stresses change by. One pass gives all of either, nothing is compiled, and parameters may vary from point to point.
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
Floats = NDArray[np.floating[Any]]
Value = Any  # a number, or an array of the points
Tensors = tuple[Floats, Floats | None]  # F (..., 2, 2) and G (..., 2, 2, 2), or their rates

RATE = "d"  # before the name of a component: its rate


@dataclass(frozen=True)
class MixedDerivatives:
    """Derivatives of an energy of F and G, and of its rate along a direction.

    Attributes:
        name: of the energy.
        parameters: names of its parameters in the kernel's order.
        energy: what it computes.
        rate: what its rate along (dF, dG) computes.
        uses_second_gradient: whether G is needed.
    """

    name: str
    parameters: tuple[str, ...]
    energy: Record
    rate: Record
    uses_second_gradient: bool

    def energy_by_parameters(self, at: Tensors, parameters: Mapping[str, Value]) -> Floats:
        """``dpsi/dp`` (..., n_parameters), energy per reference area and unit of p, in the precision of F.

        Args:
            at: F (..., 2, 2) and G (..., 2, 2, 2) at points; G may be None if the energy does not need it.
            parameters: numbers, or arrays whose first axis is that of F, and whose others go with it.

        Raises:
            ValueError: the second gradients are missing.
        """
        return self._by_parameters(self.energy, at, None, parameters)

    def rate_by_parameters(self, at: Tensors, along: Tensors, parameters: Mapping[str, Value]) -> Floats:
        """``d/dp (dpsi/dF : dF + dpsi/dG :. dG)`` (..., n_parameters), in the precision of F.

        Args:
            at, parameters: as above.
            along: dF (..., 2, 2) and dG (..., 2, 2, 2).

        Raises:
            ValueError: second gradients are missing.
        """
        return self._by_parameters(self.rate, at, along, parameters)

    def rate_of_stress(
        self, at: Tensors, along: Tensors, parameters: Mapping[str, Value]
    ) -> tuple[Float, Float | None]:
        """Rates of the stresses along a direction, the second derivative of the energy times it.

        Args:
            at, along, parameters: as above.

        Returns:
            Rates of ``P = dpsi/dF`` (..., 2, 2) and of ``T = dpsi/dG`` (..., 2, 2, 2), None without G in the energy.

        Raises:
            ValueError: second gradients are missing.
        """
        moved = self.rate.depending(lambda node: node.op == "variable" and not str(node.value).startswith(RATE))
        leading = at[0].shape[:-2]
        rates = [np.zeros((*leading, *entry.shape)) for entry in LAYOUT.inputs]
        for some in in_parts(leading):
            slopes = self._slopes(self.rate, moved, at, along, parameters, some)
            for entry, rate in zip(LAYOUT.inputs, rates, strict=True):
                for index, name in zip(entry.indices, entry.names, strict=True):
                    rate[some][(..., *index)] = slopes.get(name, 0.0)
        P, T = rates
        return P, T if self.uses_second_gradient else None

    def _by_parameters(
        self, record: Record, at: Tensors, along: Tensors | None, parameters: Mapping[str, Value]
    ) -> Floats:
        moved = record.depending(_is_parameter)
        leading = at[0].shape[:-2]
        found = np.zeros((*leading, len(self.parameters)), dtype=at[0].dtype)
        for some in in_parts(leading):
            slopes = self._slopes(record, moved, at, along, parameters, some)
            for n, name in enumerate(self.parameters):
                found[some][..., n] = slopes.get(name, 0.0)
        return found

    def _slopes(
        self,
        record: Record,
        moved: tuple[bool, ...],
        at: Tensors,
        along: Tensors | None,
        parameters: Mapping[str, Value],
        some: Any,
    ) -> dict[str, Value]:
        variables = self._variables(at, "", some)
        if along is not None:
            variables |= self._variables(along, RATE, some)
        with np.errstate(all="ignore"):  # what is no number shows in the values
            return record.backwards(record.forwards(variables, part_of(parameters, some)), moved)

    def _variables(self, tensors: Tensors, before: str, some: Any) -> dict[str, Floats]:
        F, G = tensors
        found = components(DEFORMATION_GRADIENT, F[some], before)
        if self.uses_second_gradient:
            if G is None:
                raise ValueError(f"energy '{self.name}' needs second gradients")
            found |= components(SECOND_GRADIENT, G[some], before)
        return found


def mixed_of(integrand: Integrand) -> MixedDerivatives:
    """Mixed derivatives of an energy of F and G.

    Raises:
        CodegenError: it cannot be traced, or reads something else.
    """
    if integrand.inputs != LAYOUT.inputs:
        raise CodegenError(f"energy '{integrand.name}' is not one of F and G: it has no mixed derivatives here")
    trace(integrand)  # says what is wrong with it
    tape = Tape(integrand)
    p, m = namespaces(tape, integrand)
    values = [
        rated(entry, traced(tape, entry), _Rates(tape, f"{RATE}{entry.name}", len(entry.shape)))
        for entry in integrand.inputs
    ]
    psi = integrand.function(*values, RatedParameters(p), RatedMath(m))
    assert isinstance(psi, Rated)
    assert isinstance(psi.value, TracedScalar)
    assert isinstance(psi.rate, TracedScalar)
    energy = record_of(tape, psi.value)
    return MixedDerivatives(
        name=integrand.name,
        parameters=integrand.parameter_names,
        energy=energy,
        rate=record_of(tape, psi.rate),
        uses_second_gradient=any(name.startswith("G") for name in energy.variables),
    )


class _Rates:
    """Rates of a tensor's components as variables of a tape, index by index."""

    def __init__(self, tape: Tape, name: str, left: int) -> None:
        self._tape, self._name, self._left = tape, name, left

    def __getitem__(self, index: int) -> Any:
        name = f"{self._name}{index + 1}"
        if self._left == 1:
            return self._tape.add("variable", value=name)
        return _Rates(self._tape, name, self._left - 1)


def _is_parameter(node: Node) -> bool:
    return node.op == "parameter"
