"""CUDA C++ with the functions of a point and kernels that go through many points, one to a thread.

The text is complete in itself and includes nothing, so that nvcc and NVRTC take it as it is. There is a namespace for
each energy, as a program may have several.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import ClassVar

from codegen.backends.backend import Backend
from codegen.backends.c import comment
from codegen.cprinter import KernelPrinter, c_expression
from codegen.ctext import point_arithmetic_source
from codegen.driver import Driver
from codegen.functions import PointFunction, point_function
from codegen.integrand import DEFORMATION_GRADIENT
from codegen.ir import LEVELS, DerivedEnergy, Schedule, SymExpr

HERE = Path(__file__).parent
_WRITTEN = {
    "energy": ("double &psi",),
    "gradient": ("double &psi", "writable g"),
    "tangent": ("double &psi", "writable g", "writable h"),
}
_READ = ("readable x", "const parameters &p", "readable f")


class DevicePrinter(KernelPrinter):
    """Printer without the constants of math.h, which NVRTC does not have."""

    math_macros: ClassVar[dict[SymExpr, str]] = {}

    def _print_NumberSymbol(self, expr: SymExpr) -> str:
        return repr(float(expr))

    _print_Exp1 = _print_Pi = _print_NumberSymbol


class CudaBackend:
    """CUDA C++, with a point in each thread: ``x[3]``."""

    def expression(self, value: SymExpr) -> str:
        """Text of an expression."""
        return c_expression(value, DevicePrinter())

    def constant(self, name: str, value: str) -> str:
        """Statement that gives a name to a value."""
        return f"const double {name} = {value};"

    def parameter(self, number: int, n_uniform: int) -> str:
        """A parameter by its number, times the factor of the point if it varies."""
        return f"p[{number}]" if number < n_uniform else f"p[{number}] * f[{number - n_uniform}]"

    def entry(self, array: str, number: int) -> str:
        """An entry of an array that is read at a point."""
        return f"{array}[{number}]"

    def output(self, target: str, value: str) -> str:
        """Statement that writes a value."""
        return f"{target} = {value};"

    def files(
        self, derived: DerivedEnergy, schedules: Mapping[str, Schedule], about: Sequence[str], driver: Driver | None
    ) -> dict[str, str]:
        """One file with everything in the energy's namespace; its kernels have names that begin like it."""
        name = device_name(derived.name)
        has_j = DEFORMATION_GRADIENT in derived.layout.inputs
        kernels = (*LEVELS, "jacobian") if has_j else LEVELS
        parts = [
            comment([*about, f"Kernels: {', '.join(f'{name}_{what}' for what in kernels)}"]),
            f"namespace {name} {{\n",
            f"enum {{ {', '.join(f'{key} = {value}' for key, value in _constants(derived).items())} }};\n",
            *([driver.declarations] if driver else []),
            HERE.joinpath("entries.cuh").read_text(),
            device_arithmetic(),
            *(_point_function(point_function(derived, schedules[level], BACKEND)) for level in LEVELS),
            HERE.joinpath("points.cuh").read_text(),
            *([HERE.joinpath("jacobian.cuh").read_text()] if has_j else []),
            *([driver.source] if driver else []),
            f"}}  // namespace {name}\n",
        ]
        return {".cu": re.sub(r"\bNAME_", f"{name}_", "\n".join(parts))}


BACKEND: Backend = CudaBackend()


def device_name(name: str) -> str:
    """Name of the namespace of an energy, with which those of its kernels begin."""
    return "tmc_" + re.sub(r"[^A-Za-z0-9]+", "_", name)


def device_arithmetic() -> str:
    """The arithmetic of a point, as it is in C, in words of the device: a fused multiply-add is always there."""
    text = point_arithmetic_source()
    text = re.sub(r"/\* No energy needs all.*?\n#define UNUSED_IN_SOME[^\n]*\n\n", "", text, flags=re.DOTALL)
    text = re.sub(r"#ifdef __FMA__\n(.*?)#else.*?#endif\n", r"\1", text, flags=re.DOTALL)
    text = text.replace("UNUSED_IN_SOME static inline", "__device__ __forceinline__")
    text = text.replace("the loops over points that use it vectorise", "threads side by side go the same way")
    return text.replace("__builtin_fma(", "fma(")


def _constants(derived: DerivedEnergy) -> dict[str, int]:
    layout = derived.layout
    return {
        "DIMENSION": layout.dimension,
        "N_COMPONENTS": layout.n_components,
        "N_FIRST_ROWS": layout.n_first_rows,
        "N_ROWS": derived.n_rows,
        "N_X": layout.n_inputs,
        "N_H": layout.n_hessian,
        "N_UNIFORM": derived.n_uniform,
        "N_VARYING": derived.n_varying,
    }


def _point_function(function: PointFunction) -> str:
    arguments = (*_READ, *_WRITTEN[function.level])
    unused = {"p": not function.reads_parameters, "f": not function.reads_varying}
    unused |= {name: name not in function.writes for name in "gh" if f"writable {name}" in arguments}
    lines = [f"(void){name};" for name, is_unused in unused.items() if is_unused]
    lines += [*function.uniform, *function.statements]
    head = f"__device__ __forceinline__ void point_{function.level}({', '.join(arguments)}) {{"
    return "\n".join([head, *(f"  {line}" for line in lines), "}", ""])
