"""A compiled energy as a Python object on numpy arrays: its density and derivatives at single states."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from codegen.build import build
from codegen.compiler import generate
from codegen.driver import Driver
from codegen.errors import CodegenError
from codegen.integrand import Density, Integrand, second_gradient_energy
from codegen.layout import Layout
from codegen.library import POINTS, Signatures, address, derivative_rows, load_library
from codegen.trace import trace

Array = NDArray[np.float64]

ENERGY, GRADIENT, TANGENT = 0, 1, 2


class Kernel:
    """Compiled energy.

    Args:
        library: path of the shared object.
        integrand: what it was made of.

    Attributes:
        uses_second_gradient: whether the energy depends on G.
        n_varying: how many of its parameters, the last ones, vary from cell to cell; single states read them as given.
    """

    signatures: ClassVar[Signatures] = POINTS

    def __init__(self, library: Path, integrand: Integrand) -> None:
        self.integrand = integrand
        self.name = integrand.name
        self.parameters = integrand.parameter_names
        self.n_varying = integrand.n_varying
        self.layout = integrand.layout
        self.library = library
        self._lib = load_library(library, self.signatures)
        self.uses_second_gradient = derivative_rows(self._lib) > self.layout.n_first_rows

    def parameter_array(self, values: Mapping[str, float]) -> Array:
        """Values in the kernel's order.

        Raises:
            CodegenError: a value is missing.
        """
        missing = [name for name in self.parameters if name not in values]
        if missing:
            raise CodegenError(f"energy '{self.name}' needs a value for {', '.join(missing)}")
        return np.array([float(values[name]) for name in self.parameters], dtype=np.float64)

    def points(self, level: int, x_nx: Array, parameters: Array) -> tuple[Array, Array | None, Array | None]:
        """Energy density, gradient and Hessian at single states.

        Args:
            level: ENERGY, GRADIENT or TANGENT.
            x_nx: (n_states, 12) displacement gradient F - I and second gradient G in the order of Appendix C.
            parameters: from :meth:`parameter_array`.

        Returns:
            ``psi_n`` (n_states,), ``g_nx`` (n_states, 12) and ``h_nxy`` (n_states, 12, 12), None beyond the level.

        Raises:
            ValueError: an array has a wrong shape.
        """
        x_nx = np.ascontiguousarray(x_nx, dtype=np.float64).reshape(-1, self.layout.n_inputs)
        self.check_parameters(parameters)
        n = len(x_nx)
        psi_n = np.empty(n)
        g_nx = np.empty_like(x_nx) if level >= GRADIENT else None
        h_nk = np.empty((n, self.layout.n_hessian)) if level >= TANGENT else None
        self._lib.tmc_points(
            level, n, address(x_nx), address(parameters), address(psi_n), address(g_nx),
            address(h_nk),
        )  # fmt: skip
        return psi_n, g_nx, None if h_nk is None else unpacked(h_nk, self.layout)

    def check_parameters(self, parameters: Array) -> None:
        """Check an array of parameter values.

        Raises:
            ValueError: it has another shape or type than that of :meth:`parameter_array`.
        """
        if parameters.shape != (len(self.parameters),) or parameters.dtype != np.float64:
            names = ", ".join(self.parameters)
            raise ValueError(f"{len(self.parameters)} parameters expected ({names}), got {parameters.size}")


def unpacked(h_nk: Array, layout: Layout) -> Array:
    """Whole Hessians (n, 12, 12) of the entries (n, 78) that are kept of them."""
    rows, columns = np.array(layout.upper_triangle).T
    h_nxy = np.empty((len(h_nk), layout.n_inputs, layout.n_inputs))
    h_nxy[:, rows, columns] = h_nk
    h_nxy[:, columns, rows] = h_nk
    return h_nxy


def compile_energy(
    density: Density, name: str, parameters: Mapping[str, float | None] | Iterable[str], description: str = ""
) -> Kernel:
    """Kernel of a density, from the cache if it is there.

    Raises:
        CodegenError: the density cannot be traced, or its kernel not generated, compiled or loaded.
    """
    integrand = second_gradient_energy(density, name, parameters, description)
    return Kernel(compiled(integrand), integrand)


def compiled(integrand: Integrand, driver: Driver | None = None) -> Path:
    """Path of the shared object of an integrand, with a driver or without; compiled if the cache does not have it.

    Raises:
        CodegenError: the integrand cannot be traced, or its kernel not generated or compiled.
    """
    traced = trace(integrand)
    fingerprint = traced.fingerprint() + (driver.key if driver else "")
    return build(traced.name, fingerprint, lambda: generate(traced, integrand.description, driver=driver).c_source)
