"""Typed records that the stages after tracing hand to each other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

from codegen.layout import Layout

SymExpr = Any  # a sympy expression; sympy itself is imported only where expressions are worked on

LEVELS = ("energy", "gradient", "tangent")


class HasParameters(Protocol):
    """What reads inputs of a point and parameters, of which the last ones vary from cell to cell."""

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names in the kernel's order."""

    @property
    def layout(self) -> Layout:
        """Where what it reads stands."""

    @property
    def n_varying(self) -> int:
        """How many parameters vary."""

    @property
    def n_uniform(self) -> int:
        """How many parameters, the first ones, are the same in all cells."""


@dataclass(frozen=True)
class DerivedEnergy:
    """Energy, gradient and upper triangle of the Hessian as sympy expressions in F, G, J and the parameters.

    ``gradient[a]`` is ``d psi / d x_a`` and ``hessian[n]`` belongs to the pair ``layout.upper_triangle[n]``.
    ``n_rows`` is the number of derivative rows up to the last that the energy depends on.
    ``energy`` and ``gradient`` are in the form that is accurate near F = I, ``plain_energy`` and ``plain_gradient`` in
    the form that people read. The last ``n_varying`` parameters vary from cell to cell.
    """

    name: str
    parameters: tuple[str, ...]
    layout: Layout
    n_rows: int
    energy: SymExpr
    gradient: tuple[SymExpr, ...]
    hessian: tuple[SymExpr, ...]
    plain_energy: SymExpr
    plain_gradient: tuple[SymExpr, ...]
    n_varying: int = 0

    @property
    def n_uniform(self) -> int:
        """How many parameters, the first ones, are the same in all cells."""
        return len(self.parameters) - self.n_varying

    @property
    def varying(self) -> tuple[str, ...]:
        """The parameters that vary from cell to cell."""
        return self.parameters[self.n_uniform :]


@dataclass(frozen=True)
class DerivedByParameters:
    """Derivatives with respect to the parameters as sympy expressions.

    ``energy[k]`` is ``d psi / d p_k``, and ``residual[k]`` the derivative of ``sum_a y_a d psi / d x_a`` with respect
    to ``p_k`` for a direction ``y``. ``n_rows`` is the number of derivative rows up to the last that the energy
    depends on.
    """

    name: str
    parameters: tuple[str, ...]
    layout: Layout
    n_rows: int
    energy: tuple[SymExpr, ...]
    residual: tuple[SymExpr, ...]
    n_varying: int = 0

    @property
    def n_uniform(self) -> int:
        """How many parameters, the first ones, are the same in all cells."""
        return len(self.parameters) - self.n_varying


@dataclass(frozen=True)
class Assignment:
    """``const double <target> = <value>;`` in the generated code."""

    target: str
    value: SymExpr


@dataclass(frozen=True)
class Schedule:
    """Straight-line program of one level: temporaries first, then the outputs that are not identically zero."""

    level: str
    temporaries: tuple[Assignment, ...]
    outputs: tuple[Assignment, ...]
    operations_before: int
    operations: int


@dataclass(frozen=True)
class KernelSource:
    """The generated text of an energy and what is worth knowing about it.

    Attributes:
        files: texts by the suffix of their files.
        n_rows: derivative rows of the basis that it uses.
        operations: of a point by level, after sharing subexpressions; ``operations_before`` before that.
    """

    name: str
    parameters: tuple[str, ...]
    files: dict[str, str]
    n_rows: int
    operations: dict[str, int]
    operations_before: dict[str, int]

    @property
    def c_source(self) -> str:
        """The kernel in C, complete in itself."""
        return self.files[".c"]

    @property
    def header(self) -> str:
        """Its declarations, for programs in C and C++ that call it."""
        return self.files[".h"]
