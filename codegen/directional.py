"""Derivatives along a direction: a function of a point is run on pairs of a value and its rate.

The rate is what the value changes by per unit step in the direction. So a density, written once, gives ``dpsi/dG : B``
for any B without a symbolic derivative, and what comes out can be traced and differentiated again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from codegen.layout import Input


@dataclass(frozen=True, eq=False)
class Rated:
    """A value and its rate; the rate 0 is the number, so that what does not change leaves no trace of it."""

    value: Any
    rate: Any = 0

    __array_ufunc__ = None  # numpy's scalars leave arithmetic to this class

    def __add__(self, other: Any) -> Rated:
        other = _rated(other)
        return Rated(self.value + other.value, _plus(self.rate, other.rate))

    def __sub__(self, other: Any) -> Rated:
        return self + -_rated(other)

    def __rsub__(self, other: Any) -> Rated:
        return _rated(other) + -self

    def __mul__(self, other: Any) -> Rated:
        other = _rated(other)
        rate = _plus(_times(self.rate, other.value), _times(other.rate, self.value))
        return Rated(self.value * other.value, rate)

    def __truediv__(self, other: Any) -> Rated:
        other = _rated(other)
        value = self.value / other.value
        return Rated(value, _over(_plus(self.rate, _times(_negative(other.rate), value)), other.value))

    def __rtruediv__(self, other: Any) -> Rated:
        return _rated(other) / self

    def __pow__(self, exponent: Any) -> Rated:
        power = exponent.value if isinstance(exponent, Rated) else exponent
        value = self.value**power
        return Rated(value, 0 if is_zero(self.rate) else self.rate * (power * self.value ** (power - 1)))

    def __neg__(self) -> Rated:
        return Rated(-self.value, _negative(self.rate))

    def __pos__(self) -> Rated:
        return self

    __radd__, __rmul__ = __add__, __mul__


class RatedMath:
    """The ``m`` of a function that is run on values with rates.

    Args:
        m: functions of the values.
    """

    def __init__(self, m: Any) -> None:
        self._m = m

    def exp(self, x: Any) -> Rated:
        value = self._m.exp(_rated(x).value)
        return Rated(value, _times(_rated(x).rate, value))

    def log(self, x: Any) -> Rated:
        return self._unary(x, self._m.log, lambda value: 1 / value)

    def sqrt(self, x: Any) -> Rated:
        value = self._m.sqrt(_rated(x).value)
        return Rated(value, _over(_rated(x).rate, 2 * value))

    def sin(self, x: Any) -> Rated:
        return self._unary(x, self._m.sin, self._m.cos)

    def cos(self, x: Any) -> Rated:
        return self._unary(x, self._m.cos, lambda value: -self._m.sin(value))

    def atan(self, x: Any) -> Rated:
        return self._unary(x, self._m.atan, lambda value: 1 / (1 + value * value))

    def atan2(self, y: Any, x: Any) -> Rated:
        y, x = _rated(y), _rated(x)
        turned = _plus(_times(y.rate, x.value), _negative(_times(x.rate, y.value)))
        value = self._m.atan2(y.value, x.value)
        return Rated(value, 0 if is_zero(turned) else turned / (x.value * x.value + y.value * y.value))

    def _unary(self, x: Any, function: Callable[[Any], Any], slope: Callable[[Any], Any]) -> Rated:
        x = _rated(x)
        return Rated(function(x.value), 0 if is_zero(x.rate) else x.rate * slope(x.value))


class RatedParameters:
    """The ``p`` of such a function: what a direction does not change.

    Args:
        p: parameters as attributes.
    """

    def __init__(self, p: Any) -> None:
        self._p = p

    def __getattr__(self, name: str) -> Rated:
        return Rated(getattr(self._p, name))


def rated(of: Input, tensor: Any, direction: Any = None, out_of_plane: Any = None) -> Any:
    """An input as a function reads it, each component with its rate, which is 0 without a direction.

    Args:
        of: the input.
        tensor: its value, of which the plane is read.
        direction: rate of the plane.
        out_of_plane: rate of the component with the indices 2 and 2, of an input with a third direction.
    """

    def component(index: tuple[int, ...]) -> Rated:
        value, rate = tensor, direction
        for i in index:
            value = value[i]
            rate = None if rate is None else rate[i]
        return Rated(value, 0 if rate is None else rate)

    return of.nested(component, out_of_plane=None if out_of_plane is None else Rated(int(of.identity), out_of_plane))


def _rated(x: Any) -> Rated:
    return x if isinstance(x, Rated) else Rated(x)


def is_zero(rate: Any) -> bool:
    """Whether a rate is the number 0: of what does not depend on what changes."""
    return isinstance(rate, int) and rate == 0


def _plus(a: Any, b: Any) -> Any:
    return b if is_zero(a) else a if is_zero(b) else a + b


def _times(rate: Any, factor: Any) -> Any:
    return 0 if is_zero(rate) else rate * factor


def _over(rate: Any, divisor: Any) -> Any:
    return 0 if is_zero(rate) else rate / divisor


def _negative(rate: Any) -> Any:
    return 0 if is_zero(rate) else -rate
