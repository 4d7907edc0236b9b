"""Dataclasses as plain tables, and tables as TOML: the way back from :func:`tmc_vem.support.validation.build`."""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

from tmc_vem.support.validation import key_of

_BARE = re.compile(r"[A-Za-z0-9_-]+")
INDENT = "  "
LONG = 100  # characters of a line, above which a list has a line for each entry


def as_table(instance: Any) -> dict[str, Any]:
    """Those fields of a dataclass that differ from their defaults, as a table from which the same can be built."""
    table = {}
    for field in dataclasses.fields(instance):
        value = getattr(instance, field.name)
        factory = field.default_factory
        default = field.default if factory is dataclasses.MISSING else factory()
        if field.init and value != default:
            table[key_of(field.name)] = _plain(value)
    return table


def toml_text(table: Mapping[str, Any]) -> str:
    """A table as TOML. Entries that are None are left out, as TOML has no word for them."""
    return "\n".join(_lines(table, ())) + "\n"


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value):
        return as_table(value)
    if isinstance(value, Mapping):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [_plain(entry) for entry in value]
    return value


def _lines(table: Mapping[str, Any], way: tuple[str, ...]) -> list[str]:
    """Values first, then tables: what stands below a heading belongs to it."""
    entries = [(key, value) for key, value in table.items() if value is not None]
    simple = [f"{_key(key)} = {_value(value, 0)}" for key, value in entries if not _is_table(value, way)]
    lines = list(simple)
    for key, value in entries:
        if _is_table(value, way):
            inner = (*way, key)
            several = isinstance(value, list)
            name = ".".join(map(_key, inner))
            for entry in value if several else [value]:
                inside = _lines(entry, inner)
                heading = f"[[{name}]]" if several else f"[{name}]"
                lines += inside if inside[:1] == [""] else ["", heading, *inside]
    return lines


def _is_table(value: Any, way: tuple[str, ...]) -> bool:
    """Whether a value gets a heading: tables at the top, and tables in these that have some in turn."""
    if isinstance(value, Mapping):
        return not way or (len(way) == 1 and any(isinstance(entry, Mapping) for entry in value.values()))
    return not way and isinstance(value, list) and bool(value) and all(isinstance(e, Mapping) for e in value)


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else _text(key)


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007F")


def _value(value: Any, depth: int) -> str:
    """A value; floats have all their digits."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, Mapping):
        inside = ", ".join(f"{_key(key)} = {_value(entry, depth + 1)}" for key, entry in value.items())
        return f"{{ {inside} }}" if inside else "{}"
    if isinstance(value, list):
        entries = [_value(entry, depth + 1) for entry in value]
        one = f"[{', '.join(entries)}]"
        if len(one) <= LONG or depth:
            return one
        return "\n".join(["[", *(f"{INDENT}{entry}," for entry in entries), "]"])
    return repr(value)
