"""C99 with the point kernels of all levels, what calls them, and a header.

The functions of a point go through LANES states at once, in a loop that compilers vectorise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from codegen.backends.backend import Backend
from codegen.cprinter import c_expression
from codegen.ctext import parameters_source, point_arithmetic_source, points_header, points_source
from codegen.driver import Driver
from codegen.functions import PointFunction, point_function
from codegen.ir import LEVELS, DerivedEnergy, HasParameters, Schedule, SymExpr

_DERIVATIVES = {"energy": "", "gradient": "g", "tangent": "gh"}  # what a level writes besides psi

_PREAMBLE = """\
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#if defined(__GNUC__) && !defined(__clang__)
#define LANES_ARE_INDEPENDENT _Pragma("GCC ivdep")
#else
#define LANES_ARE_INDEPENDENT
#endif

/* glibc's libmvec has vector forms of these; declaring them lets the compiler vectorise the point kernels without
 * -ffast-math, so that NaN and infinity stay visible. */
#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__) && defined(TMC_USE_LIBMVEC)
__attribute__((simd("notinbranch"))) double exp(double);
__attribute__((simd("notinbranch"))) double log1p(double);
__attribute__((simd("notinbranch"))) double log(double);
#endif
"""

_HEADER = """\
{provenance}
#ifndef TMC_KERNEL_H
#define TMC_KERNEL_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {{
#endif

{declarations}
#ifdef __cplusplus
}}
#endif

#endif
"""


class CBackend:
    """C99, with states in lanes: ``x[3][v]``."""

    def expression(self, value: SymExpr) -> str:
        """Text of an expression."""
        return c_expression(value)

    def constant(self, name: str, value: str) -> str:
        """Statement that gives a name to a value."""
        return f"const double {name} = {value};"

    def parameter(self, number: int, n_uniform: int) -> str:
        """A parameter by its number; behind those that are the same in all cells stand the others, in lanes."""
        return f"p[{number}]" if number < n_uniform else f"p[N_UNIFORM + {number - n_uniform} * LANES + v]"

    def entry(self, array: str, number: int) -> str:
        """An entry of an array that is read at a point."""
        return f"{array}[{number}][v]"

    def output(self, target: str, value: str) -> str:
        """Statement that writes a value."""
        return f"{target}[v] = {value};"

    def files(
        self, derived: DerivedEnergy, schedules: Mapping[str, Schedule], about: Sequence[str], driver: Driver | None
    ) -> dict[str, str]:
        """The kernel, complete in itself, and its declarations for programs in C and C++ that call it."""
        provenance = comment(about)
        header = points_header() + (f"\n{driver.declarations}" if driver else "")
        parts = [
            *preamble(provenance, derived, derived.n_rows, header),
            *(_point_kernel(derived, schedules[level]) for level in LEVELS),
            points_source(),
            *([driver.source] if driver else []),
        ]
        return {".c": "\n".join(parts), ".h": _HEADER.format(provenance=provenance, declarations=header)}


BACKEND: Backend = CBackend()


def comment(lines: Sequence[str]) -> str:
    """A comment that nothing in its lines ends."""
    return "/* " + "\n * ".join(line.replace("*/", "* /") for line in lines) + "\n */\n"


def preamble(provenance: str, of: HasParameters, n_rows: int, header: str) -> list[str]:
    """What stands before the functions of a point: includes, constants, declarations, arithmetic, parameters."""
    return [
        provenance,
        _PREAMBLE,
        of.layout.c_constants(n_rows),
        f"enum {{ N_UNIFORM = {of.n_uniform}, N_VARYING = {of.n_varying} }};\n",
        header,
        "const int tmc_n_rows = N_ROWS;\n",
        point_arithmetic_source(),
        parameters_source(),
    ]


def _point_kernel(derived: DerivedEnergy, schedule: Schedule) -> str:
    written = _DERIVATIVES[schedule.level]
    arguments = ["const double (*restrict x)[LANES]", "const double *restrict p", "double *restrict psi"]
    arguments += [f"double (*restrict {name})[LANES]" for name in written]
    return function_text(point_function(derived, schedule, BACKEND), arguments, written)


def function_text(function: PointFunction, arguments: Sequence[str], written: Sequence[str]) -> str:
    """C text of a function that does the same at LANES points.

    Args:
        function: what it does; it is called ``point_`` and its level.
        arguments: of the C function, ``x`` and ``p`` among them.
        written: names of arrays that outputs go to, of which not all need be.
    """
    head = [f"static void point_{function.level}({', '.join(arguments)}) {{"]
    head += [f"  {line}" for line in function.uniform]
    if not function.reads_parameters:
        head.append("  (void)p;")
    head += [f"  (void){name};" for name in written if name not in function.writes]
    head += ["  LANES_ARE_INDEPENDENT", "  for (int v = 0; v < LANES; ++v) {"]
    return "\n".join([*head, *(f"    {line}" for line in function.statements), "  }", "}", ""])
