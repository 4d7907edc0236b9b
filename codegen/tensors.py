"""Stresses and moduli of an energy in the matrix layout of the paper's Appendix C."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from codegen.kernel import TANGENT, Kernel
from codegen.sampling import to_vector

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StressAndModuli:
    """First and second derivatives of an energy density at n states.

    Rows and columns run over ``[11 21 12 22]`` for F and ``[111 211 121 221 112 212 122 222]`` for G, first index
    fastest. ``P`` and ``D`` are force per area, ``T`` and ``A`` that times length, ``B`` that times length squared.

    Attributes:
        psi_n: (n,) energy density.
        P_n4: (n, 4) first Piola-Kirchhoff stress dpsi/dF, equation (53).
        T_n8: (n, 8) double stress dpsi/dG, equation (54).
        D_n44: (n, 4, 4) d2psi/dFdF, equation (C.1).
        A_n84: (n, 8, 4) d2psi/dGdF, equation (C.2).
        B_n88: (n, 8, 8) d2psi/dGdG, equation (C.3).
    """

    psi_n: Array
    P_n4: Array
    T_n8: Array
    D_n44: Array
    A_n84: Array
    B_n88: Array


def stress_and_moduli(
    kernel: Kernel, F_nij: ArrayLike, G_nijk: ArrayLike | None = None, parameters: Mapping[str, float] | None = None
) -> StressAndModuli:
    """Derivatives of a kernel's energy at one or many states.

    Args:
        kernel: from :func:`codegen.kernel.compile_energy`.
        F_nij: (n, 2, 2) or (2, 2) deformation gradients, ``F[i, j] = delta_ij + du_i/dX_j``.
        G_nijk: (n, 2, 2, 2) or (2, 2, 2) second gradients ``d2u_i/(dX_j dX_k)`` (1/length); None for zero.
        parameters: values by name.

    Raises:
        CodegenError: a parameter value is missing.
        ValueError: the shapes do not fit.
    """
    F = np.asarray(F_nij, dtype=np.float64)
    if F.shape[-2:] != (2, 2) or F.ndim not in (2, 3):
        raise ValueError(f"F_nij has shape {F.shape}, expected (n, 2, 2) or (2, 2)")
    F = F.reshape(-1, 2, 2)
    G = np.zeros((len(F), 2, 2, 2)) if G_nijk is None else np.asarray(G_nijk, dtype=np.float64)
    if G.size != F.size * 2 or G.shape[-3:] != (2, 2, 2):
        raise ValueError(f"G_nijk has shape {G.shape}, expected {(len(F), 2, 2, 2)}")
    G = G.reshape(-1, 2, 2, 2)

    psi_n, g_nx, h_nxy = kernel.points(TANGENT, to_vector(F, G), kernel.parameter_array(parameters or {}))
    assert g_nx is not None
    assert h_nxy is not None
    f, g = kernel.layout.part("F"), kernel.layout.part("G")
    return StressAndModuli(psi_n, g_nx[:, f], g_nx[:, g], h_nxy[:, f, f], h_nxy[:, g, f], h_nxy[:, g, g])
