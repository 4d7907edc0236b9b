"""Checks of what users give, in one place for the command line, Python and problem files.

Every message is one line that names the object, its value, what is allowed, and what to do.
"""

from __future__ import annotations

import dataclasses
import difflib
import functools
import math
import numbers
import types
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeVar

from tmc_vem.support.errors import InputError
from tmc_vem.support.settings import about_of

T = TypeVar("T")

LONGEST = 60  # characters of a value that are shown in a message


def printable(text: str) -> str:
    """A text in one line; line breaks and what is no printable character as Python writes them."""
    return "".join(ch if ch.isprintable() else repr(ch)[1:-1] for ch in text)


def shown(value: Any) -> str:
    """A value as messages show it: short, and in one line."""
    text = printable(f"{value:g}" if isinstance(value, float) else repr(value))
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."


def require_positive(name: str, value: float, hint: str) -> None:
    """Check that a parameter is a positive finite number.

    Raises:
        InputError: it is not; the message has the name, the value and the hint.
    """
    if not (_is_real(value) and math.isfinite(value) and value > 0.0):
        raise InputError(f"{name} = {shown(value)} must be a positive number: {hint}")


def require_finite(name: str, value: float, hint: str = "") -> None:
    """Check that a parameter is a finite number.

    Raises:
        InputError: it is not.
    """
    if not (_is_real(value) and math.isfinite(value)):
        raise InputError(f"{name} = {shown(value)} must be a finite number{f': {hint}' if hint else ''}")


def require_within(name: str, value: float, low: float, high: float, hint: str = "") -> None:
    """Check that low <= value <= high.

    Raises:
        InputError: it is not.
    """
    if not (_is_real(value) and low <= value <= high):
        raise InputError(f"{name} = {shown(value)}: use {low:g} to {high:g}{f', {hint}' if hint else ''}")


def require_choice(name: str, value: str, choices: Iterable[str], hint: str = "") -> None:
    """Check that a word is one of several.

    Raises:
        InputError: it is not; the message lists them, the most similar one first, and then has the hint.
    """
    known = list(choices)
    if value not in known:
        more = f"; {hint}" if hint else ""
        raise InputError(f"unknown {name} {shown(value)}{_meant(value, known)}: choose one of {', '.join(known)}{more}")


def require_known(given: Iterable[Any], known: Iterable[str], where: str) -> None:
    """Check the keys of a table.

    Raises:
        InputError: one is unknown; the message suggests a similar one and lists all.
    """
    names = list(known)
    for key in given:
        if key not in names:
            raise InputError(
                f"{where} has no '{_word(key)}'{_meant(key, names)}: it has {', '.join(names) or 'nothing'}"
            )


def build(cls: type[T], data: Any, where: str, given: Mapping[str, Any] | None = None) -> T:
    """A dataclass from a plain table, such as one read from a problem file.

    Values are converted to the types of the fields, tables to nested dataclasses and lists to tuples.

    Args:
        cls: the dataclass.
        data: its fields by name; fields with a default may be missing.
        where: what the table is called in messages, for example ``box.toml: medium``.
        given: fields that do not come from the table and cannot stand in it.

    Raises:
        InputError: a key is unknown or missing, or a value is of the wrong type or out of range.
    """
    if not isinstance(data, Mapping):
        raise InputError(f"{where} = {shown(data)} must be a table of names and values")
    given = dict(given or {})
    fields = {field.name: field for field in dataclasses.fields(cls) if field.init}  # type: ignore[arg-type]
    keys = {key_of(name): name for name in fields if name not in given}
    require_known(data, keys, where)
    hints = _hints(cls)
    values = {keys[key]: conform(value, hints[keys[key]], f"{where}: {key}") for key, value in data.items()} | given
    for name, field in fields.items():
        has_default = field.default is not dataclasses.MISSING or field.default_factory is not dataclasses.MISSING
        if name not in values and not has_default:
            raise InputError(f"{where} lacks '{name}'")
    try:
        return cls(**values)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def key_of(name: str) -> str:
    """What a field is called in a table: without the underscore at the end of words that Python keeps to itself."""
    return name.removesuffix("_")


def check_fields(instance: Any) -> None:
    """Check the types of a dataclass' fields and make numbers and sequences of others what they are declared as.

    To be called first in ``__post_init__``: what follows may then rely on the types.

    Raises:
        InputError: a field has a value of another type, or one that is not among the choices of a setting.
    """
    hints = _hints(type(instance))
    for field in dataclasses.fields(instance):
        value = getattr(instance, field.name)
        conformed = conform(value, hints[field.name], key_of(field.name))
        if conformed is not value:
            object.__setattr__(instance, field.name, conformed)
        said = about_of(field)
        if said is not None and said.choices:
            require_choice(field.name.replace("_", " "), conformed, said.choices)


def conform(value: Any, hint: Any, name: str) -> Any:
    """The value as the type that an annotation asks for.

    Integers become floats where floats are declared; lists become tuples; tables become dataclasses. Nothing is
    rounded, and text is never taken for a number.

    Raises:
        InputError: the value is of another type.
    """
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if hint is Any:
        return value
    if origin in (typing.Union, types.UnionType):
        return _one_of(value, arguments, name)
    if hint is type(None):
        if value is not None:
            raise _wrong(name, value, "nothing")
        return None
    if hint is bool:
        if not isinstance(value, bool):
            raise _wrong(name, value, "true or false")
        return value
    if hint is int:
        if isinstance(value, bool) or not isinstance(value, numbers.Integral):
            raise _wrong(name, value, "a whole number")
        return int(value)
    if hint is float:
        if not _is_real(value):
            raise _wrong(name, value, "a number")
        return value if type(value) is float else _as_float(name, value)
    if hint is str:
        if not isinstance(value, str):
            raise _wrong(name, value, "text")
        return value
    if origin is tuple:
        return _as_tuple(value, arguments, name)
    if origin in (Mapping, dict) or (isinstance(origin, type) and issubclass(origin, Mapping)):
        if not isinstance(value, Mapping):
            raise _wrong(name, value, "a table of names and values")
        return {
            conform(key, arguments[0], f"a name in {name}"): conform(entry, arguments[1], f"{name}: {_word(key)}")
            for key, entry in value.items()
        }
    if origin is Sequence or origin is list:
        if isinstance(value, str) or not isinstance(value, Sequence):
            raise _wrong(name, value, "a list")
        return tuple(conform(entry, arguments[0], f"{name}, entry {n + 1}") for n, entry in enumerate(value))
    if dataclasses.is_dataclass(hint) and isinstance(hint, type):
        if isinstance(value, Mapping):
            return build(hint, value, name)
        if not isinstance(value, hint):
            raise _wrong(name, value, f"a table of names and values or a {hint.__name__}")
        return value
    if origin is Callable or hint is Callable:
        if not callable(value):
            raise _wrong(name, value, "a function")
        return value
    if isinstance(hint, type) and not isinstance(value, hint):
        raise _wrong(name, value, f"a {hint.__name__}")
    return value


def _one_of(value: Any, alternatives: Sequence[Any], name: str) -> Any:
    """The first alternative that fits; if none does, the error of the last that is not None. A table is for the first
    dataclass among them, and a list for a tuple, if there is one: what is wrong with it is said of that."""
    if isinstance(value, Mapping):
        alternatives = [each for each in alternatives if dataclasses.is_dataclass(each)][:1] or alternatives
    elif isinstance(value, list):
        alternatives = [each for each in alternatives if typing.get_origin(each) is tuple] or alternatives
    error: InputError | None = None
    for alternative in alternatives:
        try:
            return conform(value, alternative, name)
        except InputError as raised:
            if error is None or alternative is not type(None):
                error = raised
    assert error is not None
    raise error


def _as_tuple(value: Any, arguments: Sequence[Any], name: str) -> Any:
    if isinstance(value, str | Mapping) or not hasattr(value, "__iter__"):
        raise _wrong(name, value, "a list")
    entries = list(value)
    if len(arguments) == 2 and arguments[1] is Ellipsis:
        expected: Sequence[Any] = [arguments[0]] * len(entries)
    else:
        expected = arguments
        if len(entries) != len(expected):
            raise _wrong(name, value, f"a list of {len(expected)}")
    made = tuple(
        conform(entry, hint, f"{name}, entry {n + 1}")
        for n, (entry, hint) in enumerate(zip(entries, expected, strict=True))
    )
    return value if isinstance(value, tuple) and all(a is b for a, b in zip(value, made, strict=True)) else made


def _as_float(name: str, value: Any) -> float:
    try:
        return float(value)
    except OverflowError:
        raise InputError(f"{name} = {shown(value)} is too large for a number") from None


def _is_real(value: Any) -> bool:
    return isinstance(value, numbers.Real) and not isinstance(value, bool)


def _wrong(name: str, value: Any, wanted: str) -> InputError:
    return InputError(f"{name} = {shown(value)} must be {wanted}")


def _word(key: Any) -> str:
    return shown(str(key))[1:-1]


def _meant(word: Any, known: Sequence[str]) -> str:
    similar = difflib.get_close_matches(str(word), known, n=1)
    return f" (did you mean '{similar[0]}'?)" if similar else ""


def _hints(cls: Any) -> dict[str, Any]:
    return _resolved(cls)


@functools.cache
def _resolved(cls: Any) -> dict[str, Any]:
    return typing.get_type_hints(cls)
