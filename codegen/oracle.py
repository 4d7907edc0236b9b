"""Evaluate a density with numpy: the slow, independent answer that kernels are compared with."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codegen.integrand import LAYOUT

Array = NDArray[np.float64]

STEP = 1e-30  # of the complex step: no difference is taken, so it can be far below rounding


def _atan2(y: Any, x: Any) -> Any:
    """atan2 of real numbers, and its first-order extension to complex ones with small imaginary parts."""
    if not (np.iscomplexobj(y) or np.iscomplexobj(x)):
        return np.arctan2(y, x)
    a, b = np.real(y), np.real(x)
    return np.arctan2(a, b) + 1j * (b * np.imag(y) - a * np.imag(x)) / (a * a + b * b)


def numpy_namespace() -> Any:
    """The ``m`` of a density for numpy arrays, real or complex."""
    return SimpleNamespace(
        exp=np.exp, log=np.log, sqrt=np.sqrt, sin=np.sin, cos=np.cos, atan=np.arctan, atan2=_atan2
    )  # fmt: skip


def components(x_nx: NDArray[Any]) -> tuple[Any, Any]:
    """``F[i][j]`` and ``G[i][j][k]`` as arrays over states.

    Args:
        x_nx: (n_states, 12) displacement gradient F - I and G in the order of Appendix C.
    """
    F, G = LAYOUT.tensors(lambda a: x_nx[:, a] + LAYOUT.at_rest[a])
    return F, G


def one_state(x_x: NDArray[Any]) -> tuple[Any, Any]:
    """``F[i][j]`` and ``G[i][j][k]`` of a single state (12,) as numbers."""
    F, G = LAYOUT.tensors(lambda a: x_x[a] + LAYOUT.at_rest[a])
    return F, G


def energy_density(density: Callable[..., Any], x_nx: NDArray[Any], parameters: Mapping[str, float]) -> NDArray[Any]:
    """psi_n, (n_states,), of a density at the states ``x_nx`` (n_states, 12), real or complex."""
    p, m = SimpleNamespace(**parameters), numpy_namespace()

    def at(states_nx: NDArray[Any]) -> NDArray[Any]:
        return np.asarray(density(*components(states_nx), p, m))

    try:
        psi = at(x_nx)
    except (TypeError, ValueError):  # numpy inside takes the states for rows and columns: one at a time
        psi = np.empty(0)
    if psi.shape not in ((), (len(x_nx),)):
        psi = np.stack([np.asarray(density(*one_state(x_x), p, m)) for x_x in x_nx])
    return np.broadcast_to(psi, (len(x_nx),))


def gradient(density: Callable[..., Any], x_nx: Array, parameters: Mapping[str, float]) -> Array:
    """dpsi/dx, (n_states, 12), by the complex step: accurate to rounding and independent of any symbolic derivative."""
    g_nx = np.empty_like(x_nx)
    for a in range(LAYOUT.n_inputs):
        shifted = x_nx.astype(np.complex128)
        shifted[:, a] += 1j * STEP
        g_nx[:, a] = np.imag(energy_density(density, shifted, parameters)) / STEP
    return g_nx


def hand_written_gradient(hook: Callable[..., Any], x_nx: Array, parameters: Mapping[str, float]) -> Array:
    """dpsi/dx, (n_states, 12), from a function ``hook(F, G, p, m) -> (P, T)``."""
    F, G = components(x_nx)
    duals = hook(F, G, SimpleNamespace(**parameters), numpy_namespace())
    entries = [entry for of, dual in zip(LAYOUT.inputs, duals, strict=True) for entry in of.components(dual)]
    return np.stack([np.broadcast_to(np.asarray(entry, dtype=float), (len(x_nx),)) for entry in entries], axis=1)
