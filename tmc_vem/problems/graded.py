"""Materials that vary from cell to cell: formulas of the place, of cell data of a mesh file, of the number given.

``Material(E=100, nu=0.3)`` with ``{"E": "E * (1 + x / 2)"}`` has in every cell the modulus that the formula gives at
its centroid. The number in the region stays what media, checks and messages go by.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.geometry import centroids
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems.materials import Medium
from tmc_vem.problems.solids import Material
from tmc_vem.support.errors import InputError
from tmc_vem.support.formulas import Formula
from tmc_vem.support.validation import require_known, require_positive
from tmc_vem.system.enclosed import shown_place
from tmc_vem.system.graded import Graded

Float = NDArray[np.float64]

PLACE = ("x", "y")


class Given(Protocol):
    """What the user gives of a region as numbers, and what parameters of its energy follow."""

    @property
    def numbers(self) -> Mapping[str, float]:
        """What may vary, by its name in problem files."""

    def values(self, numbers: Mapping[str, float]) -> Mapping[str, float]:
        """Parameters of the energy.

        Raises:
            InputError: a number is out of its range.
        """

    def values_of_cells(self, numbers: Mapping[str, Any]) -> Mapping[str, Any]:
        """The same for numbers that may be arrays (n_cells,); nothing is checked."""


@dataclass(frozen=True)
class OfSolid:
    """Numbers of a hyperelastic solid: two moduli, or constants of its model."""

    material: Material

    @property
    def numbers(self) -> Mapping[str, float]:
        """Those that were given."""
        return self.material.numbers

    def values(self, numbers: Mapping[str, float]) -> Mapping[str, float]:
        """Parameters of the energy."""
        return self.material.with_numbers(numbers).values

    def values_of_cells(self, numbers: Mapping[str, Any]) -> Mapping[str, Any]:
        """Parameters of the energy in cells."""
        return self.material.values_of_cells(numbers)


@dataclass(frozen=True)
class OfMedium:
    """Numbers of a third medium, its shear modulus ``mu`` among them.

    Attributes:
        medium: what it is.
        mu: shear modulus that gamma multiplies.
        h: initial width of the gap, if it is known.
    """

    medium: Medium
    mu: float
    h: float | None = None

    @property
    def numbers(self) -> Mapping[str, float]:
        """mu, gamma, alpha_r or alpha, beta, log_j, and the parameters of the regulariser."""
        medium = self.medium
        weight = {"alpha_r": medium.alpha_r} if medium.alpha is None else {"alpha": medium.alpha}
        own = medium.resolve()[1]
        return {"mu": self.mu, "gamma": medium.gamma, **weight, "beta": medium.beta, "log_j": medium.log_j, **own}  # type: ignore[dict-item]

    def values(self, numbers: Mapping[str, float]) -> Mapping[str, float]:
        """Parameters of the energy."""
        require_positive("mu", numbers["mu"], "the shear modulus that gamma multiplies")
        own = {name: numbers[name] for name in self.medium.resolve()[1]}
        known = {name: numbers.get(name) for name in ("gamma", "alpha_r", "alpha", "beta", "log_j")}
        return replace(self.medium, **known, parameters=own).values(numbers["mu"], self.h)  # type: ignore[arg-type]

    def values_of_cells(self, numbers: Mapping[str, Any]) -> Mapping[str, Any]:
        """Parameters of the energy in cells."""
        values = {name: value for name, value in numbers.items() if name not in ("alpha", "log_j")}
        if "alpha" in numbers:
            assert self.h is not None
            values["alpha_r"] = numbers["alpha"] * numbers["mu"] * self.h**2
        return {**values, "log_j": numbers["log_j"]} if self.medium.log_j > 0.0 else values


@dataclass(frozen=True)
class OfParameters:
    """Parameters of an energy of one's own, whose ranges only its author knows."""

    numbers: Mapping[str, float]

    def values(self, numbers: Mapping[str, float]) -> Mapping[str, float]:
        """The numbers themselves."""
        return numbers

    def values_of_cells(self, numbers: Mapping[str, Any]) -> Mapping[str, Any]:
        """The numbers themselves."""
        return numbers


@dataclass(frozen=True)
class ByFormulas:
    """Implements :class:`tmc_vem.system.graded.Graded`.

    Attributes:
        given: the numbers of the region.
        formulas: by the names of numbers.

    Raises:
        InputError: a formula is none, or is for something that is no number of the region, or is 0.
    """

    given: Given
    formulas: Mapping[str, str]

    def __post_init__(self) -> None:
        numbers = self.given.numbers
        require_known(self.formulas, numbers, "graded")
        for name in self.made:
            if numbers[name] == 0.0:
                raise InputError(f"graded: {name} is 0 in the region: give the number there that its formula is about")

    @cached_property
    def made(self) -> Mapping[str, Formula]:
        """The formulas, read."""
        found = {}
        for name, text in self.formulas.items():
            try:
                found[name] = Formula(text)
            except InputError as error:
                raise InputError(f"graded: {name}: {error}") from None
        return found

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Parameters of the energy that change where the numbers change."""
        numbers = self.given.numbers
        nearby = {name: (0.999 if name in self.made else 1.0) * value for name, value in numbers.items()}
        level, changed = (self.given.values_of_cells(of) for of in (numbers, nearby))
        return tuple(name for name, value in level.items() if value != changed[name])

    def factors(self, centroid_cx: Float, data: Mapping[str, Float]) -> Float:
        """Factors (n_cells, n_names).

        Raises:
            InputError: a formula has no value somewhere, or one that is out of its range; the message says where.
        """
        n_cells, given = len(centroid_cx), self.given.numbers
        place = dict(zip(PLACE, centroid_cx.T, strict=True))
        numbers: dict[str, Any] = dict(given)
        for name, formula in self.made.items():
            try:
                value = formula({**data, **place, name: given[name]})
            except InputError as error:
                raise InputError(f"graded: {name}: {error}") from None
            numbers[name] = np.broadcast_to(np.asarray(value, dtype=np.float64), (n_cells,))
        with np.errstate(all="ignore"):
            values = self.given.values_of_cells(numbers)
        if n_cells:
            self._check(numbers, values, centroid_cx)
        level = self.given.values_of_cells(given)
        columns = [np.broadcast_to(values[name] / level[name], (n_cells,)) for name in self.names]
        return np.stack(columns, axis=1)

    def _check(self, numbers: Mapping[str, Any], values: Mapping[str, Any], centroid_cx: Float) -> None:
        """Check the cells where a number or a parameter is smallest or largest: ranges are intervals.

        Raises:
            InputError: one of them is no material.
        """
        for name in self.made:
            bad = np.flatnonzero(~np.isfinite(numbers[name]))
            if len(bad):
                at = _at(centroid_cx[bad[0]])
                raise InputError(f"graded: {name}: {self.formulas[name]} is {numbers[name][bad[0]]:g} in the cell {at}")
        varying = [*(numbers[name] for name in self.made), *(values[name] for name in self.names)]
        for cell in sorted({int(extreme(value)) for value in varying for extreme in (np.argmin, np.argmax)}):
            one = {name: float(numbers[name][cell]) if name in self.made else numbers[name] for name in numbers}
            try:
                self.given.values(one)
            except InputError as error:
                raise InputError(f"graded: in the cell {_at(centroid_cx[cell])}: {error}") from None


def check_cells(mesh: PolygonMesh, graded: Mapping[str, Graded | None]) -> None:
    """Check on the whole mesh that what varies has good values in every cell of its region.

    Raises:
        InputError: it has not; the message names region and place.
    """
    for region, by in graded.items():
        if by is None or region not in mesh.region_names:
            continue
        number = mesh.region_names.index(region)
        for _, cells, vertices_cv in mesh.cells_by_size():
            here = mesh.region_c[cells] == number
            data = {name: values[cells[here]] for name, values in mesh.cell_data.items()}
            try:
                by.factors(centroids(mesh.points_vx[vertices_cv[here]]), data)
            except InputError as error:
                raise InputError(f"regions: {region}: {error}") from None


def _at(point_x: Float) -> str:
    return f"around {shown_place(point_x)}"
