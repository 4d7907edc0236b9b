"""Maths namespaces that turn a density into a UFL expression or into numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codegen.integrand import Integrand
from codegen.layout import Take
from tmc_vem.fem import compat
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]
Components = Callable[[tuple[int, ...]], NDArray[Any]]


def ufl_namespace() -> Any:
    """The ``m`` of a density for UFL expressions."""
    import ufl

    return SimpleNamespace(
        exp=ufl.exp, log=ufl.ln, sqrt=ufl.sqrt, sin=ufl.sin, cos=ufl.cos, atan=ufl.atan, atan2=compat.atan2
    )  # fmt: skip


def numpy_namespace() -> Any:
    """The ``m`` of a density for numpy arrays."""
    return SimpleNamespace(
        exp=np.exp, log=np.log, sqrt=np.sqrt, sin=np.sin, cos=np.cos, atan=np.arctan, atan2=np.arctan2
    )  # fmt: skip


def density_at_points(
    integrand: Integrand, gradient_cqij: Float, second_cqijk: Float, parameters: Mapping[str, Any]
) -> NDArray[Any]:
    """Energy density (n_cells, n_points), or one number, at points of a region; no number where J <= 0.

    Near F = I the densities subtract numbers that are almost equal; numpy's extended precision, where the machine has
    it, keeps the energy's digits that the line search compares.

    Args:
        integrand: of the region.
        gradient_cqij: (n_cells, n_points, 2, 2) displacement gradients.
        second_cqijk: (n_cells, n_points, 2, 2, 2) second gradients.
        parameters: by name.

    Raises:
        InputError: numpy inside the density takes the points for rows and columns.
    """
    taken = {
        Take.GRADIENT: _components(gradient_cqij, np.longdouble),
        Take.SECOND_GRADIENT: _components(second_cqijk, np.float64),
    }
    try:
        with np.errstate(all="ignore"):
            found = integrand.of_fields(taken.__getitem__, SimpleNamespace(**parameters), numpy_namespace())
        psi: NDArray[Any] = np.asarray(found)
        fits = psi.shape in ((), gradient_cqij.shape[:2])
    except (TypeError, ValueError):
        fits = False
    if not fits:
        raise InputError(
            f"energy '{integrand.name}' uses numpy, which cannot compute with F and G of many points at once: write it "
            "with F[i][j], arithmetic and m, or use --method vem"
        )
    return psi


def _components(tensor_cqx: Float, precision: type[np.floating[Any]]) -> Components:
    """Components (n_cells, n_points) of a tensor at points, by index."""
    leading = np.moveaxis(tensor_cqx, (0, 1), (-2, -1))
    return lambda index: leading[index].astype(precision)
