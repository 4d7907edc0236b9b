"""What a setting is, said once: its text and its choices stand beside its default, as metadata of a dataclass' field.

Docstrings (:func:`described`), checks (:func:`tmc_vem.support.validation.check_fields`) and options of the command line
are made from there.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping, Sequence
from dataclasses import Field, dataclass
from typing import Any, TypeVar

T = TypeVar("T")

SETTING = "setting"  # key in the metadata of a field


@dataclass(frozen=True)
class About:
    """What is said about a setting.

    Attributes:
        text: what it is, in a sentence or two that suit Python, problem files and the command line.
        choices: the words that it may be; empty for anything of its type.
        none: what is done if it is None.
        detail: what only those want to know who read about it in the API.
    """

    text: str
    choices: tuple[str, ...] = ()
    none: str = ""
    detail: str = ""

    def whole(self) -> str:
        """All of it."""
        words = f"One of {', '.join(repr(word) for word in self.choices)}." if self.choices else ""
        none = f"None: {self.none}." if self.none else ""
        return " ".join(part for part in (self.text, words, none, self.detail) if part)


def about(text: str, *, choices: Sequence[str] = (), none: str = "", detail: str = "") -> dict[str, About]:
    """Metadata of a field that is a setting, see :class:`About`."""
    return {SETTING: About(text, tuple(choices), none, detail)}


def same_as(cls: Any, name: str) -> Mapping[Any, Any]:
    """Metadata of a field that is the same setting as one of another class."""
    return field_of(cls, name).metadata


def field_of(cls: Any, name: str) -> Field[Any]:
    """The field of a dataclass that has a name."""
    return next(field for field in dataclasses.fields(cls) if field.name == name)


def about_of(field: Field[Any]) -> About | None:
    """What is said about a field, if it is a setting."""
    found = field.metadata.get(SETTING)
    return found if isinstance(found, About) else None


def described(cls: type[T]) -> type[T]:
    """Class decorator of a dataclass: its docstring gets the section ``Attributes`` from its settings."""
    told = [(field.name, about_of(field)) for field in dataclasses.fields(cls)]  # type: ignore[arg-type]
    lines = [f"    {name}: {_literal(said.whole())}" for name, said in told if said is not None]
    cls.__doc__ = "\n".join([(cls.__doc__ or "").rstrip(), "", "Attributes:", *lines, ""])
    return cls


def _literal(text: str) -> str:
    """A text in which words that end with an underscore are no links to reStructuredText."""
    return re.sub(r"\b(\w+_)(?=[\s.,;:)]|$)", r"``\1``", text)
