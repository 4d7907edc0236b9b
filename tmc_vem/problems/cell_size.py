"""The size of cells as users give it: a number, a formula of x and y, or a function of points."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.make.outline import Field, Point
from tmc_vem.problems.graded import PLACE
from tmc_vem.support.errors import InputError
from tmc_vem.support.formulas import Formula
from tmc_vem.support.validation import require_known, require_positive, shown

Float = NDArray[np.float64]
CellSize = Callable[[Float], Float] | str | float

# A function is recorded by its values at so many places along each side of a box around the shapes, in so many digits.
RECORDED, DIGITS = 33, 12


@dataclass(frozen=True)
class Scaled:
    """A size of cells that is a multiple of a function."""

    size: Field
    factor: float

    def __call__(self, points: Float) -> Float:
        """Size (n,) at points (n, 2)."""
        return self.factor * np.asarray(self.size(points), dtype=np.float64)


def is_field(size: CellSize) -> TypeGuard[Field | str]:
    """Whether it may vary from place to place."""
    return callable(size) or isinstance(size, str)


def check_size(size: CellSize) -> None:
    """Check what can be without shapes: values of formulas and functions are known with them only.

    Raises:
        InputError: it is no positive number, or no formula of x and y.
    """
    if isinstance(size, str):
        try:
            names = Formula(size).names
        except InputError as error:
            raise InputError(f"size: {error}") from None
        require_known(sorted(names), PLACE, f"size = {shown(size)}: a formula")
    elif not callable(size):
        require_positive("size", size, "of the cells, a length")


def size_text(size: CellSize) -> str:
    """As messages say it; a function by its name."""
    return shown(size) if not callable(size) else _name(size)


def scaled_size(size: CellSize, factor: float) -> CellSize:
    """A multiple of a size."""
    if isinstance(size, str):
        return f"{factor!r} * ({size})"
    return Scaled(size, factor) if callable(size) else size * factor


def field_of(size: Field | str, origin: Point | None = None) -> Field:
    """A function of points (n, 2) counted from an origin on, that gives their sizes (n,)."""
    there = np.zeros(2) if origin is None else np.asarray(origin)
    if callable(size):
        function = size
        return function if origin is None else lambda points: function(points + there)
    formula = Formula(size)
    return lambda points: formula(dict(zip(PLACE, (points + there).T, strict=True)))


def recorded(size: CellSize, places: list[Point]) -> Any:
    """A size as records of a run have it: a function by its name and a digest of its values.

    Args:
        size: of cells.
        places: about which all shapes lie.
    """
    if not callable(size):
        return size
    low, high = np.min(places, axis=0), np.max(places, axis=0)
    x, y = (np.linspace(low[axis], high[axis], RECORDED) for axis in (0, 1))
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    values = np.broadcast_to(np.asarray(size(points), dtype=np.float64), len(points))
    text = " ".join(f"{value:.{DIGITS}g}" for value in values.tolist())
    return {"function": _name(size), "values": hashlib.sha256(text.encode()).hexdigest()[:16]}


def _name(function: object) -> str:
    if isinstance(function, Scaled):
        return f"{function.factor!r} * {_name(function.size)}"
    of = function if hasattr(function, "__qualname__") else type(function)
    return f"{of.__module__}:{of.__qualname__}"
