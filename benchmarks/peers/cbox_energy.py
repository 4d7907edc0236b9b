"""FElupe's energies as densities of our own, for ``density = "cbox_energy.py:solid"`` in a problem file.

``NeoHookeCompressible`` of FElupe less its value at F = I, which is 3/2 mu and does no work; and the regulariser of its
example, HuHu-LuLu, which is (9) of Xu & Wriggers (2026) with the weight ``alpha_r``, not damped and without gamma.
"""

from __future__ import annotations

from typing import Any

from codegen import energy


@energy(parameters={"mu": None, "lmbda": None})
def solid(F: Any, G: Any, p: Any, m: Any) -> Any:
    """Compressible neo-Hookean solid, mu/2 (tr C - 3) - mu ln J + lambda/2 (ln J)^2."""
    return neo_hooke(F, p, m)


@energy(parameters={"mu": None, "lmbda": None, "gamma": None, "alpha_r": None})
def medium(F: Any, G: Any, p: Any, m: Any) -> Any:
    """The same times gamma, with alpha_r/2 (G :. G - 1/2 Lu . Lu)."""
    squares = sum(G[i][j][k] ** 2 for i in (0, 1) for j in (0, 1) for k in (0, 1))
    laplacian = [G[i][0][0] + G[i][1][1] for i in (0, 1)]
    return p.gamma * neo_hooke(F, p, m) + p.alpha_r / 2 * (squares - (laplacian[0] ** 2 + laplacian[1] ** 2) / 2)


def neo_hooke(F: Any, p: Any, m: Any) -> Any:
    """Energy per area of F with ``F[2][2]``, the stretch across the plane."""
    trace_c = F[0][0] ** 2 + F[0][1] ** 2 + F[1][0] ** 2 + F[1][1] ** 2 + F[2][2] ** 2
    log_j = m.log(F[2][2] * (F[0][0] * F[1][1] - F[0][1] * F[1][0]))
    return p.mu / 2 * (trace_c - 3) - p.mu * log_j + p.lmbda / 2 * log_j**2
