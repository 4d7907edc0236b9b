"""What the author of an energy may state about it, next to the function itself.

The statements live in a plain dictionary on the function (attribute ``declared``), so that a package with energies
needs nothing from here: ``vars(density)["declared"] = {"parameters": {"kappa": 1.0}}`` says the same.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

from codegen.errors import CodegenError

ATTRIBUTE = "declared"

Function = TypeVar("Function", bound=Callable[..., Any])


@dataclass(frozen=True)
class Declaration:
    """Statements about an energy.

    Attributes:
        parameters: names that the density reads from ``p``, in the kernel's order, with default values or None.
        objective: False if a superposed rotation is known to change the energy; the check then does not ask for it.
        stress_free: False if the energy or its stress is known not to vanish at F = I, G = 0.
        max_rotation: rotations (degrees) that the energy must stay below; states are drawn up to 10 degrees less.
        gradient: hand-written derivatives ``gradient(F, G, p, m) -> (P, T)`` with ``P[i][j] = d psi / d F[i][j]`` and
            ``T[i][j][k] = d psi / d G[i][j][k]``. They are compared with the generated ones, never used.
        domain: a function ``(F, G, p, m)`` that is 1 at F = I, and positive where the energy has a value; the check
            draws states where it is 0.1 or more.
    """

    parameters: Mapping[str, float | None] = field(default_factory=dict)
    objective: bool = True
    stress_free: bool = True
    max_rotation: float = 180.0
    gradient: Callable[..., Any] | None = None
    domain: Callable[..., Any] | None = None


def energy(
    *,
    parameters: Mapping[str, float | None] | None = None,
    objective: bool = True,
    stress_free: bool = True,
    max_rotation: float = 180.0,
    gradient: Callable[..., Any] | None = None,
    domain: Callable[..., Any] | None = None,
) -> Callable[[Function], Function]:
    """Decorator of a density; the arguments are those of :class:`Declaration`.

    Example::

        @energy(parameters={"kappa": 1.0})
        def bending(F, G, p, m):
            return p.kappa / 2 * sum(G[i][j][j] ** 2 for i in (0, 1) for j in (0, 1))
    """

    def mark(density: Function) -> Function:
        facts = {
            "parameters": dict(parameters or {}),
            "objective": objective,
            "stress_free": stress_free,
            "max_rotation": max_rotation,
            "gradient": gradient,
            "domain": domain,
        }
        vars(density)[ATTRIBUTE] = facts
        return density

    return mark


def declaration(density: Callable[..., Any], name: str = "") -> Declaration:
    """What was stated about a density; the defaults where nothing was.

    Raises:
        CodegenError: a statement is unknown or has a wrong type.
    """
    facts = getattr(density, ATTRIBUTE, {})
    name = name or getattr(density, "__name__", "?")
    known = Declaration.__dataclass_fields__
    unknown = [key for key in facts if key not in known]
    if unknown:
        raise CodegenError(f"energy '{name}': unknown declaration '{unknown[0]}'; known are {', '.join(known)}")
    declared = Declaration(**facts)
    if not isinstance(declared.parameters, Mapping):
        raise CodegenError(f"energy '{name}': declare parameters with their values, like {{'kappa': 1.0}}")
    if not 10.0 < declared.max_rotation <= 180.0:
        raise CodegenError(f"energy '{name}': max_rotation is {declared.max_rotation}; give degrees in (10, 180]")
    return declared
