"""The stress across the plane: ``dpsi/dF[2][2]`` of an energy that uses it, at ``F[2][2] = 1``.

The component is no part of the vector that kernels read. Its derivative is the rate along it: the function is run on
values with rates (:mod:`codegen.directional`), so that nothing is written twice, and the result is an integrand with
the same inputs and parameters, for kernels, numpy and UFL alike.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from codegen.directional import Rated, RatedMath, RatedParameters, is_zero, rated
from codegen.errors import CodegenError
from codegen.integrand import DEFORMATION_GRADIENT, Integrand
from codegen.trace import recorded, trace


@dataclass(frozen=True)
class OutOfPlane:
    """The stress of an energy across the plane, or why there is none.

    Attributes:
        stress: first Piola-Kirchhoff stress ``P33 = dpsi/dF[2][2]`` at ``F[2][2] = 1``, force per area; None if the
            energy does not say it. The Cauchy stress is ``P33 / J``.
        reason: why there is none; empty if there is one.
    """

    stress: Integrand | None
    reason: str = ""


def out_of_plane_stress(integrand: Integrand) -> OutOfPlane:
    """The stress of an energy across the plane.

    An energy has one if it uses ``F[2][2]``; it must do so in all its parts, as :mod:`tmc_vem.energy.kinematics` does.

    Args:
        integrand: of F, and of whatever else; F is its first input.

    Raises:
        CodegenError: the energy cannot be traced.
    """
    trace(integrand)
    stress = _stress(integrand)
    _, rate = recorded(stress)
    if is_zero(rate):
        return OutOfPlane(None, no_stress_across(integrand.name))
    return OutOfPlane(stress)


def no_stress_across(name: str) -> str:
    """Why an energy has no stress across the plane."""
    return f"energy '{name}' does not use F[2][2], 1 in plane strain, so it has no out-of-plane stress"


def _stress(energy: Integrand) -> Integrand:
    if energy.inputs[0] != DEFORMATION_GRADIENT:
        raise CodegenError(f"energy '{energy.name}' reads no deformation gradient, so it has no out-of-plane stress")

    def rate(*arguments: Any) -> Any:
        *tensors, p, m = arguments
        values = [
            rated(of, tensor, out_of_plane=1 if n == 0 else None)
            for n, (of, tensor) in enumerate(zip(energy.inputs, tensors, strict=True))
        ]
        psi = energy.function(*values, RatedParameters(p), RatedMath(m))
        return psi.rate if isinstance(psi, Rated) else 0

    name, description = f"{energy.name}_P33", f"out-of-plane stress of {energy.name}"
    return Integrand(name, energy.inputs, energy.parameters, rate, description)
