"""Stage 4: a function of a point as statements of a language, in the order of a schedule.

What is read, which functions of J are made of it and how values follow from each other is the same in every language;
the words are those of a :class:`~codegen.backends.backend.Backend`.
"""

from __future__ import annotations

from dataclasses import dataclass

from codegen.backends.backend import Backend
from codegen.derive import direction_symbols, parameter_symbol, symbol_names
from codegen.integrand import DEFORMATION_GRADIENT
from codegen.ir import HasParameters, Schedule
from codegen.layout import Layout

J_NAMES = {"J", "Jm1", "logJ", "logJr", "invJ"}


@dataclass(frozen=True)
class PointFunction:
    """A function of a point in the words of a language.

    Attributes:
        level: of its schedule.
        uniform: statements that are the same for all points: they read parameters that do not vary.
        statements: all others, in their order.
        reads_parameters: whether it reads any parameter.
        reads_varying: whether it reads one that varies from cell to cell.
        writes: names of what it writes; arrays whose entries all vanish identically are not among them.
    """

    level: str
    uniform: tuple[str, ...]
    statements: tuple[str, ...]
    reads_parameters: bool
    reads_varying: bool
    writes: frozenset[str]


def point_function(of: HasParameters, schedule: Schedule, backend: Backend, directions: str = "") -> PointFunction:
    """Go through a schedule.

    Args:
        of: what has been derived.
        schedule: its program.
        backend: the language.
        directions: name of an argument like ``x`` with a direction at every point; empty if there is none.
    """
    used = _used(schedule)
    parameters = [(n, str(parameter_symbol(name))) for n, name in enumerate(of.parameters)]
    uniform, varying = (
        tuple(backend.constant(symbol, backend.parameter(n, of.n_uniform)) for n, symbol in part if symbol in used)
        for part in (parameters[: of.n_uniform], parameters[of.n_uniform :])
    )
    statements = [
        *_inputs(of.layout, used, backend),
        *(backend.constant(name, value) for name, value in _jacobian_functions(used)),
        *(
            backend.constant(str(symbol), backend.entry(directions, n))
            for n, symbol in enumerate(direction_symbols(of.layout) if directions else ())
            if str(symbol) in used
        ),
        *(backend.constant(a.target, backend.expression(a.value)) for a in schedule.temporaries),
        *(backend.output(a.target, backend.expression(a.value)) for a in schedule.outputs),
    ]
    return PointFunction(
        level=schedule.level,
        uniform=uniform,
        statements=(*varying, *statements),
        reads_parameters=bool(uniform or varying),
        reads_varying=bool(varying),
        writes=frozenset(a.target.partition("[")[0] for a in schedule.outputs),
    )


def _used(schedule: Schedule) -> set[str]:
    """Names of all symbols in a schedule."""
    return set().union(*(symbol_names(a.value) for a in (*schedule.temporaries, *schedule.outputs)))


def _inputs(layout: Layout, used: set[str], backend: Backend) -> list[str]:
    """Local names of the components of F - I, F and G that a function needs."""
    lines = []
    for n, (name, at_rest) in enumerate(zip(layout.names, layout.at_rest, strict=True)):
        wanted = {name, *(J_NAMES if name in DEFORMATION_GRADIENT.names else ())}
        if at_rest:
            h = f"H{name[1:]}"
            if used & {h, *wanted}:
                lines.append(backend.constant(h, backend.entry("x", n)))
            if name in used:
                lines.append(backend.constant(name, f"1.0 + {h}"))
        elif used & wanted:
            lines.append(backend.constant(name, backend.entry("x", n)))
    return lines


def _jacobian_functions(used: set[str]) -> list[tuple[str, str]]:
    """J and the functions of J that a function needs, by name; each is computed once."""
    logarithm = bool(used & {"logJ", "logJr"})
    lines = []
    if used & J_NAMES:
        lines.append(("J", "jacobian(H11, F21, F12, H22)"))
    if logarithm or "Jm1" in used:
        lines.append(("Jm1", "jacobian_minus_1(H11, F21, F12, H22, J)"))
    if logarithm:
        lines.append(("lnJ", "log(J)"))
        lines.append(("logJr", "log_remainder(Jm1, lnJ)"))
    if "logJ" in used:
        lines.append(("logJ", "log_from_remainder(Jm1, logJr, lnJ)"))
    if "invJ" in used:
        lines.append(("invJ", "1.0/J"))
    return lines
