"""Print the derivations of an energy for reading: psi, P, T and what sharing subexpressions saves."""

from __future__ import annotations

from collections.abc import Iterator

from codegen.integrand import stress_names
from codegen.ir import LEVELS, DerivedEnergy, KernelSource


def derivation(derived: DerivedEnergy, source: KernelSource, fault: str = "") -> Iterator[str]:
    """Lines with the symbolic energy, its first derivatives and the operation counts.

    Args:
        derived: the energy and its derivatives.
        source: its kernel.
        fault: what is wrong with the energy at F = I, if anything is.
    """
    import sympy as sp

    def text(expression: object) -> str:
        names = {symbol: sp.Symbol(str(symbol).removeprefix("p_")) for symbol in expression.free_symbols}  # type: ignore[attr-defined]
        return str(sp.sstr(sp.factor_terms(expression).xreplace(names)))

    yield f"{derived.name}({', '.join(derived.parameters)}), with J = det F:"
    yield f"  psi = {text(derived.plain_energy)}"
    for name, value in zip(stress_names(derived.layout), derived.plain_gradient, strict=True):
        yield f"  {name} = {text(value)}"
    zeros = sum(entry == 0 for entry in derived.hessian)
    yield f"  {len(derived.hessian) - zeros} of the {len(derived.hessian)} second derivatives are not identically zero"
    yield "operations at a point, before and after sharing subexpressions:"
    for level in LEVELS:
        yield f"  {level:8} {source.operations_before[level]:6} {source.operations[level]:6}"
    if fault:
        yield f"note: {fault}"
