"""Options of the command line from the fields of settings: default, type, choices and text are those of the field."""

from __future__ import annotations

import functools
import types
import typing
from collections.abc import Callable, Iterable
from dataclasses import MISSING
from typing import Any

import click

from tmc_vem.support.settings import about_of, field_of

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


def setting(
    cls: Any, name: str, *flags: str, before: str = "", after: str = "", optional: bool = False, **given: Any
) -> click.Option:
    """The option for a field of a settings class.

    Args:
        cls: the dataclass.
        name: its field.
        flags: what the option is called; by default as the field, with dashes.
        before, after: what the command line says besides the text of the field.
        optional: None unless it is given, as something else decides then; no default is shown.
        given: further arguments of :class:`click.Option`, instead of what follows from the field.
    """
    field = field_of(cls, name)
    said = about_of(field)
    assert said is not None, f"{cls.__name__}.{name} is no setting"
    default = given.pop("default", field.default)
    made: dict[str, Any] = {}
    kind = _kind(_hints(cls)[name])
    if kind is bool:
        made["is_flag"] = True
    elif said.choices:
        made["type"] = click.Choice(list(said.choices))
    elif kind in (int, float, str):
        made["type"] = kind
    if optional:
        made["default"] = None
    elif default not in (None, MISSING):
        made |= {"default": default, "show_default": kind is not bool}
    if given.get("multiple"):
        after = f"{after} May be given several times.".lstrip()
    none = f"Default: {said.none}." if said.none and default is None and not optional else ""
    text = said.text[0].lower() + said.text[1:] if before else said.text
    made["help"] = " ".join(part for part in (before, text, after, none) if part)
    return click.Option(list(flags) or [f"--{name.replace('_', '-')}"], **made | given)


@functools.cache
def _hints(cls: Any) -> dict[str, Any]:
    """Annotations of a class; they are strings, which take time to resolve."""
    return typing.get_type_hints(cls)


def _kind(hint: Any) -> Any:
    """The type of an annotation, without None."""
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        kinds = [kind for kind in typing.get_args(hint) if kind is not type(None)]
        return kinds[0] if len(kinds) == 1 else None
    return hint


def with_options(options: Iterable[click.Option]) -> Decorator:
    """Decorator that gives a command options, which stand in this order in its help."""
    made = list(options)

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        for option in reversed(made):
            # what click.option does: commands take their parameters from there, the last decorator's first
            vars(command).setdefault("__click_params__", []).append(option)
        return command

    return decorate
