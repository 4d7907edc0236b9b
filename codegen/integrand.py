"""The record that every stage works on: a function of a point with the names of what it reads.

A user's ``density(F, G, p, m)`` becomes one with two inputs, the deformation gradient and the second gradient of the
displacement, and the parameters that were declared.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from codegen.layout import Input, Layout, Take

Density = Callable[[Any, Any, Any, Any], Any]

DEFORMATION_GRADIENT = Input("F", "u", Take.GRADIENT, (2, 2), identity=True, third=True)
SECOND_GRADIENT = Input("G", "u", Take.SECOND_GRADIENT, (2, 2, 2))
LAYOUT = Layout((DEFORMATION_GRADIENT, SECOND_GRADIENT))

_DUALS = {DEFORMATION_GRADIENT.name: "P", SECOND_GRADIENT.name: "T"}


@dataclass(frozen=True)
class Parameter:
    """A number that is the same at all points of a region, or of a cell.

    Attributes:
        name: of the number.
        default: its value where none is given.
        varies: whether every cell multiplies it with a factor of its own.
    """

    name: str
    default: float | None = None
    varies: bool = False


@dataclass(frozen=True)
class Integrand:
    """A potential per reference area as a function of what fields are at a point.

    Attributes:
        name: for messages and generated code.
        inputs: what it reads of fields, in the order of the function's arguments.
        parameters: what else it reads, in the order of the kernel's array; those that vary come last.
        function: takes the inputs as nested lists, ``p`` with the parameters as attributes and ``m`` with functions.
        description: a line about it.
    """

    name: str
    inputs: tuple[Input, ...]
    parameters: tuple[Parameter, ...]
    function: Callable[..., Any]
    description: str = ""

    @cached_property
    def layout(self) -> Layout:
        """Where what it reads stands."""
        return Layout(self.inputs)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the parameters in the kernel's order."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def n_varying(self) -> int:
        """How many parameters vary from cell to cell."""
        return sum(parameter.varies for parameter in self.parameters)

    def varying(self, names: Iterable[str]) -> Integrand:
        """The same with some parameters that vary from cell to cell, which come last in the order of ``names``."""
        last = {name: number for number, name in enumerate(names)}
        parameters = [replace(parameter, varies=parameter.name in last) for parameter in self.parameters]
        return replace(self, parameters=tuple(sorted(parameters, key=lambda of: last.get(of.name, -1))))

    def of_fields(self, taken: Callable[[Take], Callable[[tuple[int, ...]], Any]], p: Any, m: Any) -> Any:
        """Value of the function.

        Args:
            taken: of what is taken of the field, component by index.
            p: parameters as attributes.
            m: namespace of functions.
        """
        return self.function(*(entry.of_field(taken(entry.take)) for entry in self.inputs), p, m)


def second_gradient_energy(
    density: Density, name: str, parameters: Mapping[str, float | None] | Iterable[str] = (), description: str = ""
) -> Integrand:
    """The integrand of a ``density(F, G, p, m)``.

    Args:
        density: the function.
        name: of the energy.
        parameters: names of its parameters in order, with default values or without.
        description: a line about it.
    """
    declared = parameters.items() if isinstance(parameters, Mapping) else ((key, None) for key in parameters)
    return Integrand(name, LAYOUT.inputs, tuple(Parameter(*pair) for pair in declared), density, description)


def stress_names(layout: Layout) -> tuple[str, ...]:
    """Names of the first derivatives: ``P11`` for F, ``T111`` for G, ..."""
    return tuple(_DUALS[entry.name] + name.removeprefix(entry.name) for entry in layout.inputs for name in entry.names)
