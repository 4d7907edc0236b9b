"""Statements about a density that the code generator's check reads."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])


def declare(**facts: Any) -> Callable[[Function], Function]:
    """Decorator that states facts about a density, such as ``objective=False`` or ``max_rotation=90.0`` (degrees).

    They are kept in the function's attribute ``declared``; `codegen.declare` lists what can be stated. This package
    does not import the generator, which is why it has its own decorator.
    """

    def mark(density: Function) -> Function:
        vars(density)["declared"] = {**declared(density), **facts}
        return density

    return mark


def declared(density: Callable[..., Any]) -> dict[str, Any]:
    """What was stated about a density."""
    return dict(getattr(density, "declared", {}))
