"""From what a user says ('angle', 'my_reg.py:bending', a function) to a regulariser with its parameter values."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from tmc_vem.energy import Regulariser, get_regulariser
from tmc_vem.support.errors import InputError

RegulariserLike = str | Regulariser | Callable[[Any, Any, Any, Any], Any]


def resolve_regulariser(wanted: RegulariserLike, values: Mapping[str, float]) -> tuple[Regulariser, dict[str, float]]:
    """A regulariser and the values of all its own parameters, defaults included.

    Args:
        wanted: a name of Table 1, ``FILE.py:FUNCTION`` or ``package.module:FUNCTION``, a function
            ``density(F, G, p, m)``, or a :class:`Regulariser`.
        values: values of its parameters. A function that declares none takes the names from here.

    Raises:
        InputError: there is no such regulariser, its parameters do not match, or calling it fails.
    """
    if isinstance(wanted, Regulariser):
        require_traceable(wanted.density, wanted.name, wanted.parameters)
        return wanted, _match(wanted, values)
    if isinstance(wanted, str) and ":" not in wanted:
        regulariser = get_regulariser(wanted)
        return regulariser, _match(regulariser, values)

    from codegen.errors import CodegenError
    from codegen.userfile import as_density, load_density

    try:
        loaded = load_density(wanted) if isinstance(wanted, str) else as_density(wanted)
        loaded = loaded.with_values(values)
    except CodegenError as error:
        raise InputError(str(error)) from None
    missing = [name for name, value in loaded.parameters.items() if value is None]
    if missing:
        raise InputError(
            f"regulariser '{loaded.name}' needs a value for {', '.join(missing)}: --param {missing[0]}=..."
        )
    require_traceable(loaded.function, loaded.name, tuple(loaded.parameters))
    regulariser = Regulariser(loaded.name, loaded.function, loaded.description, tuple(loaded.parameters))
    return regulariser, {name: float(value) for name, value in loaded.parameters.items() if value is not None}


def require_traceable(density: Callable[[Any, Any, Any, Any], Any], name: str, parameters: Sequence[str]) -> None:
    """Call a user's density with symbols, so that its faults are said in words before a mesh is made, for any method.

    Raises:
        InputError: it branches on a value, uses an unknown function or an undeclared parameter, or fails.
    """
    from codegen.errors import CodegenError
    from codegen.integrand import second_gradient_energy
    from codegen.trace import trace

    try:
        trace(second_gradient_energy(density, name, parameters))
    except CodegenError as error:
        raise InputError(str(error)) from None


def _match(regulariser: Regulariser, values: Mapping[str, float]) -> dict[str, float]:
    unknown = set(values) - set(regulariser.parameters)
    missing = set(regulariser.parameters) - set(values)
    if unknown or missing:
        takes = ", ".join(regulariser.parameters) or "no parameters"
        raise InputError(f"regulariser '{regulariser.name}' takes {takes}; given: {', '.join(values) or 'none'}")
    return {name: float(values[name]) for name in regulariser.parameters}
