"""The two problems as numbers, for programs that know nothing of each other; nothing but Python is needed."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise


@dataclass(frozen=True)
class CBox:
    """FElupe's C: its left side is held, its upper right corner pressed down by a prescribed u_y, u_x free.

    A C of arms and back of one width, with third medium in its cavity and in a column to its right, over the whole
    height. Energies per area, plane strain, the solid's and the medium's alike but for the factor gamma:
    ``mu/2 (F:F + 1 - 3) - mu ln J + lambda/2 (ln J)^2``; the medium has ``alpha_r/2 (G :. G - 1/2 Lu . Lu)`` besides.

    Attributes:
        length, height, wall: of the C.
        column: width of the medium to its right.
        mu, lmbda: Lame's constants of the solid.
        gamma: of the medium, relative to them.
        alpha_r: weight of the second gradients, a force; FElupe's example has 5e-6 K length^2 with K = lambda.
        uy: at full load.
        steps: equal load steps.
    """

    length: float = 1.0
    height: float = 0.5
    wall: float = 0.1
    column: float = 0.1
    mu: float = 5.0 / 14.0
    lmbda: float = 5.0 / 3.0
    gamma: float = 5e-6
    alpha_r: float = 5e-6 * 5.0 / 3.0
    uy: float = -0.62
    steps: int = 20

    def counts(self, cells: tuple[int, int]) -> tuple[int, int, int]:
        """Cells across the wall (and the column), along the cavity and across it, of a mesh of cells in all.

        Raises:
            SystemExit: the numbers are no multiples of 12 and 6.
        """
        fine = cells[0] // 12
        if fine < 1 or tuple(cells) != (12 * fine, 6 * fine):
            raise SystemExit(f"cells {cells[0]} x {cells[1]}: use a multiple of 12 x 6")
        return fine, 10 * fine, 4 * fine

    def lines(self, cells: tuple[int, int]) -> tuple[list[float], list[float]]:
        """Mesh lines in x and in y."""
        across, along, inside = self.counts(cells)
        right = self.length + self.column
        x = joined([0.0, self.wall, self.length, right], [across, along, across])
        y = joined([0.0, self.wall, self.height - self.wall, self.height], [across, inside, across])
        return x, y


@dataclass(frozen=True)
class Box:
    """The box of section 5.1 of Xu & Wriggers (2026), ``tmc-vem run box``, with regulariser (9), damped.

    Energies: solid ``K/2 (ln J)^2 + mu/2 (J^(-2/3) (F:F + 1) - 3)``; medium ``gamma (mu/2 (J^(-2/3) (F:F + 1) - 3) +
    alpha_r exp(-beta J) 1/2 (G :. G - 1/2 Lu . Lu))``.
    """

    length: float = 2.0
    height: float = 0.5
    wall: float = 0.1
    K: float = 20.0
    mu: float = 10.0
    gamma: float = 1e-5
    alpha_r: float = 1.0
    beta: float = 5.0
    uy: float = -1.0

    def lines(self, cells: tuple[int, int]) -> tuple[list[float], list[float]]:
        """Mesh lines in x and in y, equally spaced."""
        return joined([0.0, self.length], [cells[0]]), joined([0.0, self.height], [cells[1]])


def joined(ends: list[float], counts: list[int]) -> list[float]:
    """Lines with so many equal parts between each end and the next."""
    lines = [ends[0]]
    for (begin, end), count in zip(pairwise(ends), counts, strict=True):
        lines += [begin + (end - begin) * n / count for n in range(1, count)] + [end]
    return lines
