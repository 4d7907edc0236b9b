"""The one vector order of the generator: Appendix C of Xu & Wriggers, first index fastest.

The independent variables of an energy are ``x = (f, g)`` with ``f = [F11 F21 F12 F22]`` and
``g = [G111 G211 G121 G221 G112 G212 G122 G222]``. Component ``i`` of the displacement runs fastest, so
``x[i + 2 r]`` is component ``i`` of derivative row ``r``, with the six rows
``(d/dX1, d/dX2, d1 d1, d2 d1, d1 d2, d2 d2)`` shared by both components.
"""

from __future__ import annotations

N_F = 4
N_G = 8
N_X = N_F + N_G

F_INDICES: tuple[tuple[int, int], ...] = tuple((i, j) for j in (0, 1) for i in (0, 1))
G_INDICES: tuple[tuple[int, int, int], ...] = tuple((i, j, k) for k in (0, 1) for j in (0, 1) for i in (0, 1))

F_NAMES = tuple(f"F{i + 1}{j + 1}" for i, j in F_INDICES)
G_NAMES = tuple(f"G{i + 1}{j + 1}{k + 1}" for i, j, k in G_INDICES)
X_NAMES = F_NAMES + G_NAMES

UPPER_TRIANGLE: tuple[tuple[int, int], ...] = tuple((a, b) for a in range(N_X) for b in range(a, N_X))
N_HESSIAN = len(UPPER_TRIANGLE)  # 78
