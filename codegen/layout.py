"""What a function of a point reads, and where it stands: every constant of the generated source comes from here.

Vectors are ordered as in Appendix C of Xu & Wriggers, first index fastest: ``x = (f, g)`` with
``f = [F11 F21 F12 F22]`` and ``g = [G111 G211 G121 G221 G112 G212 G122 G222]``. Component ``i`` of the field runs
fastest, so that ``x[i + c r]`` is component ``i`` of c in derivative row ``r``; in the plane there are six rows
``(d1, d2, d1 d1, d2 d1, d1 d2, d2 d2)``, which all components share.
"""

from __future__ import annotations

import functools
import itertools
import math
import operator
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

Index = tuple[int, ...]


class Take(StrEnum):
    """What of a field is read."""

    GRADIENT = "gradient"
    SECOND_GRADIENT = "second gradient"
    JUMP = "jump"  # of the gradient, across a side


class Rows(list[Any]):
    """A tensor as nested lists, or a row of one, that may have a third direction besides those of the plane.

    Its length and what a loop sees are those of the plane, so that a function which knows the plane only computes what
    it did; the index 2 is there for those who ask for it.

    Args:
        entries: of the plane.
        third: what the index 2 gives; None if there is nothing.
    """

    def __init__(self, entries: Iterable[Any], third: Any = None) -> None:
        super().__init__(entries)
        self.third = third

    def __getitem__(self, index: Any) -> Any:
        if self.third is not None and not isinstance(index, slice) and index == len(self):
            return self.third
        return super().__getitem__(index)


@dataclass(frozen=True)
class Input:
    """A tensor that a function of a point reads.

    Attributes:
        name: as the function's author writes it; its components are called ``F11``, ``F21``, ...
        field: that it is taken of.
        take: what of the field it is.
        shape: of the tensor, the field's component first.
        identity: whether the identity is added to what is taken, as in ``F = I + grad u``. Kernels read it without, and
            call the components on the diagonal ``H11``, ``H22``.
        third: whether a matrix has a third direction, which is no part of the vector: ``F[2][2] = 1`` in plane strain,
            and ``F[i][2] = F[2][i] = 0``.
    """

    name: str
    field: str
    take: Take
    shape: tuple[int, ...]
    identity: bool = False
    third: bool = False

    @functools.cached_property
    def indices(self) -> tuple[Index, ...]:
        """Indices of all components in the order of the vector."""
        return tuple(index[::-1] for index in itertools.product(*map(range, reversed(self.shape))))

    @functools.cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all components in the order of the vector."""
        return tuple(self.name + "".join(str(i + 1) for i in index) for index in self.indices)

    @property
    def written(self) -> str:
        """How a component is written: ``F[i][j]``."""
        return self.name + "".join(f"[{letter}]" for letter in "ijklmn"[: len(self.shape)])

    @property
    def refused(self) -> str:
        """How it is not written: ``F[i, j]``."""
        return f"{self.name}[{', '.join('ijklmn'[: len(self.shape)])}]"

    def at_rest(self, index: Index) -> int:
        """Value of a component where the field vanishes."""
        return int(self.identity and len(set(index)) == 1)

    def nested(
        self, component: Callable[[Index], Any], row: Callable[..., Any] = Rows, out_of_plane: Any = None
    ) -> Any:
        """The tensor as a function reads it, ``[i][j]...``, made of its components.

        Args:
            component: component of an index.
            row: what to make of the entries of a row, and of what the index 2 gives if there is a third direction.
            out_of_plane: the component with the indices 2 and 2, if there is; by default 1 with the identity, else 0.
        """

        def part(head: Index) -> Any:
            if len(head) == len(self.shape):
                return component(head)
            return row([part((*head, i)) for i in range(self.shape[len(head)])])

        if not self.third:
            return part(())
        rows, columns = self.shape
        one = int(self.identity) if out_of_plane is None else out_of_plane
        in_plane = [row([component((i, j)) for j in range(columns)], 0) for i in range(rows)]
        return row(in_plane, row([0] * columns, one))

    def components(self, tensor: Any) -> list[Any]:
        """Components of nested lists in the order of the vector."""
        return [functools.reduce(operator.getitem, index, tensor) for index in self.indices]

    def of_field(self, component: Callable[[Index], Any]) -> Any:
        """The same from the components of what is taken of the field, to which the identity is added."""
        return self.nested(lambda index: component(index) + 1 if self.at_rest(index) else component(index))


@dataclass(frozen=True)
class Layout:
    """Vectors and matrices that functions of a point read and return.

    Attributes:
        inputs: what is read, gradients first; all are derivatives of one field.
        lanes: points that are evaluated at once: one AVX-512 register of doubles.
    """

    inputs: tuple[Input, ...]
    lanes: int = 8

    @property
    def n_components(self) -> int:
        """Components of the field."""
        return self.inputs[0].shape[0]

    @property
    def dimension(self) -> int:
        """Directions of derivatives."""
        return self.inputs[0].shape[-1]

    @functools.cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the entries of the vector that is read."""
        return tuple(name for entry in self.inputs for name in entry.names)

    @functools.cached_property
    def at_rest(self) -> tuple[int, ...]:
        """Their values where the field vanishes, identities added."""
        return tuple(entry.at_rest(index) for entry in self.inputs for index in entry.indices)

    @property
    def n_inputs(self) -> int:
        """Entries of the vector that is read, and of the gradient."""
        return len(self.names)

    def part(self, name: str) -> slice:
        """Where an input stands in the vector."""
        first = 0
        for entry in self.inputs:
            size = math.prod(entry.shape)
            if entry.name == name:
                return slice(first, first + size)
            first += size
        raise KeyError(name)

    @functools.cached_property
    def upper_triangle(self) -> tuple[tuple[int, int], ...]:
        """Rows and columns of the entries of the Hessian that are kept, row by row."""
        return tuple((a, b) for a in range(self.n_inputs) for b in range(a, self.n_inputs))

    @property
    def n_hessian(self) -> int:
        """Entries of the Hessian that are kept."""
        return len(self.upper_triangle)

    @property
    def n_rows(self) -> int:
        """Derivative rows of all inputs."""
        return self.rows_of(entry.name for entry in self.inputs)

    @property
    def n_first_rows(self) -> int:
        """Derivative rows of first derivatives."""
        return self.rows_of(entry.name for entry in self.inputs if entry.take is Take.GRADIENT)

    def rows_of(self, names: Iterable[str]) -> int:
        """How many rows there are up to the last of some inputs."""
        last: int = max(self.part(name).stop for name in names)
        return last // self.n_components

    def tensors(self, entry: Callable[[int], Any], row: Callable[..., Any] = Rows) -> tuple[Any, ...]:
        """All inputs as a function reads them, from the entries of the vector by their number."""
        return tuple(self._tensor(of, entry, row) for of in self.inputs)

    def _tensor(self, of: Input, entry: Callable[[int], Any], row: Callable[..., Any]) -> Any:
        first = self.part(of.name).start
        return of.nested(lambda index: entry(first + of.indices.index(index)), row)

    def c_constants(self, n_rows: int) -> str:
        """The constants of a kernel that uses the first ``n_rows`` rows, as C text."""
        values = {
            "LANES": self.lanes,
            "DIMENSION": self.dimension,
            "N_COMPONENTS": self.n_components,
            "N_FIRST_ROWS": self.n_first_rows,
            "N_ROWS": n_rows,
            "N_X": self.n_inputs,
            "N_H": self.n_hessian,
        }
        return f"enum {{ {', '.join(f'{name} = {value}' for name, value in values.items())} }};\n"
