"""``NAME=VALUE`` for any entry of a file's tables: how names and values are written, and what they change.

A name is the way to an entry, ``regions.block.solid.mu``; an entry of a list goes by its number, from 1 on as messages
count, or by its ``name`` or ``at``: ``support.top.ux``. A value is one of TOML; text needs quotes only where it could
be something else, or has a comma in it.
"""

from __future__ import annotations

import copy
import re
import tomllib
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import require_known, shown

OPTION = "--set"
EXAMPLE = "regions.block.solid.mu=20"
_KEY = re.compile(r"""\s*(?:"([^"\\]+)"|'([^']+)'|([\w-]+))\s*(\.|$)""")
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_OPENING, _CLOSING = "[{", "]}"
# what names an entry of a list
_NAMES = ("name", "at")


def parse_changes(texts: Sequence[str]) -> dict[str, Any]:
    """Entries and their values from texts ``NAME=VALUE``.

    Raises:
        InputError: one is not of that form, has several values, or is the second for an entry.
    """
    changes = {}
    for name, values in parse_choices(texts).items():
        if len(values) > 1:
            text = next(text for text in texts if _divided(text)[0] == name)
            raise InputError(
                f"{OPTION} {shown(text)[1:-1]}: '{name}' takes one value here, not {len(values)}: 'tmc-vem sweep' goes "
                "through several, a list is [1, 2], and text with a comma stands in quotes"
            )
        changes[name] = values[0]
    return changes


def parse_choices(texts: Sequence[str]) -> dict[str, list[Any]]:
    """Entries and one or more values for each from texts ``NAME=VALUE,VALUE``.

    Raises:
        InputError: one is not of that form, or is the second for an entry.
    """
    choices: dict[str, list[Any]] = {}
    ways: dict[tuple[str, ...], str] = {}
    for text in texts:
        name, values = _divided(text)
        way = keys(name)
        if way in ways:
            raise InputError(f"{OPTION} {name}: '{ways[way]}' is set twice: give it once")
        ways[way] = name
        choices[name] = [_value(value, name) for value in _split(values, name)]
    return choices


def keys(name: str) -> tuple[str, ...]:
    """The keys of a name with dots; a key with other characters than letters, digits, _ and - is quoted.

    Raises:
        InputError: it is none.
    """
    found, at = [], 0
    while match := _KEY.match(name, at):
        found.append(next(key for key in match.groups()[:3] if key is not None))
        at = match.end()
        if match[4] == "":
            return tuple(found)
    raise InputError(f"{OPTION} {shown(name)} is no name of an entry: write {EXAMPLE}, with dots between the names")


def changed(table: Mapping[str, Any], changes: Mapping[str, Any], named: Collection[str] = ()) -> dict[str, Any]:
    """A copy of a table with other values.

    Args:
        table: as it was read.
        changes: values by name of the entry.
        named: keys of tables at the top whose entries have names of their own: none is added to them, as that would
            be a slip of the pen.

    Raises:
        InputError: there is nothing of a name, or something that has no entries.
    """
    copied = copy.deepcopy(dict(table))
    for name, value in changes.items():
        _assign(copied, keys(name), copy.deepcopy(value), named)
    return copied


def said(name: str, value: Any) -> str:
    """A change as the command line says it."""
    return f"{OPTION} {name}={shown(value)}"


def _divided(text: str) -> tuple[str, str]:
    """Name and value of ``NAME=VALUE``."""
    name, equals, value = text.partition("=")
    if not equals or not name.strip():
        raise InputError(f"{OPTION} {shown(text)} is not NAME=VALUE, for example {EXAMPLE}")
    return name.strip(), value.strip()


def _split(text: str, name: str) -> list[str]:
    """The parts between commas that are in no brackets and no quotes."""
    parts, depth, quote = [""], 0, ""
    for n, letter in enumerate(text):
        if quote:
            quote = "" if letter == quote and not (quote == '"' and text[n - 1] == "\\") else quote
        elif letter in "\"'":
            quote = letter
        elif letter in _OPENING:
            depth += 1
        elif letter in _CLOSING:
            depth -= 1
        elif letter == "," and depth == 0:
            parts.append("")
            continue
        parts[-1] += letter
    stripped = [part.strip() for part in parts]
    if not all(stripped):
        raise InputError(f'{OPTION} {name}={shown(text)[1:-1]}: a value is missing; an empty text is ""')
    return stripped


def _value(text: str, name: str) -> Any:
    """A value of TOML, or text without quotes."""
    if _NUMBER.fullmatch(text):
        return int(text) if re.fullmatch(r"[+-]?\d+", text) else float(text)
    try:
        read = tomllib.loads(f"value = {text}")
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        if text[0] in "\"'" + _OPENING:
            reason = re.sub(r" \(at .*", "", str(error)) or "nested too deeply"
            raise InputError(f"{OPTION} {name}={shown(text)[1:-1]} is no value of TOML: {reason}") from None
        return text
    if list(read) != ["value"] or not isinstance(read["value"], bool | int | float | str | list | dict):
        return text  # a date, or more than one line: nothing in a table is either
    return read["value"]


def _assign(table: dict[str, Any], way: tuple[str, ...], value: Any, named: Collection[str]) -> None:
    place: Any = table
    for n, key in enumerate(way):
        where, last = ".".join(way[:n]), n == len(way) - 1
        if isinstance(place, list):
            at = _number(place, key, where)
        elif isinstance(place, dict):
            if n == 1 and way[0] in named:
                require_known([key], place, where)
            at = key  # type: ignore[assignment]
            if not last:
                place.setdefault(key, {})
        else:
            raise InputError(f"{where} = {shown(place)} has no entry '{key}': it is no table and no list")
        if last:
            place[at] = value
        else:
            place = place[at]


def _number(entries: list[Any], key: str, where: str) -> int:
    """Index of an entry of a list, by its number from 1 on or by what names it."""
    of_name = [
        n for n, entry in enumerate(entries) if isinstance(entry, dict) and key in [entry.get(word) for word in _NAMES]
    ]
    if len(of_name) == 1:
        return of_name[0]
    if len(of_name) > 1:
        numbers = " and ".join(str(n + 1) for n in of_name)
        raise InputError(f"{where} has {len(of_name)} entries '{key}': say which by number, {numbers}")
    if key.isdecimal() and 1 <= int(key) <= len(entries):
        return int(key) - 1
    names = [str(entry[word]) for entry in entries if isinstance(entry, dict) for word in _NAMES if word in entry]
    if key.isdecimal():
        raise InputError(f"{where} has no entry {key}: its {len(entries)} entries are counted from 1")
    require_known([key], names or [str(n + 1) for n in range(len(entries))], where)
    raise AssertionError
