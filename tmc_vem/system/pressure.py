"""The potential of pressure on the sides of cells, wherever they go: areas.

A side with the cell on its left, from x(0) to x(1) = (x, y), has the normal (y', -x') out of the cell, so that
pressure 1 against the cell does the work ``int (x' dy - y' dx) ds`` in a displacement (dx, dy). By parts that is minus
the change of the area V = int (x y' - y x') ds / 2 on the left of a closed loop. Of an open chain it is that, and
(x dy - y dx) / 2 at its end less the same at its beginning, which is the differential of a function only where the
point moves along one line. Where a support keeps x = X, the gradient of E = (x y) / 2 - X y is (y, -x) / 2, both
components included; where it keeps y = Y, that of E = -(x y) / 2 + x Y is. So the work of pressure 1 is -(V + sum of E
at ends - sum at beginnings).

Coordinates count from a point near the edges: what that changes is constant.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.errors import InputError
from tmc_vem.system.enclosed import shown_place
from tmc_vem.system.layout import DISPLACEMENT
from tmc_vem.system.sides import Sides
from tmc_vem.system.turned import Turned
from tmc_vem.system.work_form import WorkTerms

Float = NDArray[np.float64]
Int = NDArray[np.int64]


def swept(sides: Sides, sign_s: Int, origin: Float) -> tuple[WorkTerms, float]:
    """The change of the sum of ``sign V`` with the displacements, and V in the reference state.

    Args:
        sides: sides of this rank.
        sign_s: (n,) 1 or -1 for each.
        origin: (2,) where coordinates count from.
    """
    turn_sab = 0.5 * sign_s[:, None, None] * sides.trace.turn_ab
    X_sa, Y_sa = np.moveaxis(sides.points_sax - origin, -1, 0)
    # V = sum x_a turn_ab y_b
    linear = np.stack([np.einsum("sab,sb->sa", turn_sab, Y_sa), -np.einsum("sab,sb->sa", turn_sab, X_sa)], axis=-1)
    hessian = np.zeros((*turn_sab.shape, 2, 2))
    hessian[..., 0, 1], hessian[..., 1, 0] = turn_sab, -turn_sab
    dofs = sides.dofs_sm
    hessian = np.moveaxis(hessian, 3, 2).reshape(*dofs.shape, dofs.shape[1])
    terms = WorkTerms(dofs, linear.reshape(dofs.shape), hessian)
    return terms, float(np.einsum("sa,sab,sb->", X_sa, turn_sab, Y_sa))


def end_terms(
    name: str, where: str, ends_se: Int, nodes_se: Int, corners_sex: Float, fixed: Int, turned: Turned,
    origin: Float,
) -> Iterator[WorkTerms]:  # fmt: skip
    """What the ends of chains add to the work of pressure 1.

    Args:
        name, where: of pressure and edges, for messages.
        ends_se, nodes_se, corners_sex: vertices, nodes and reference coordinates of both ends of all sides, which have
            their cells on the left.
        fixed: degrees of freedom that supports hold at 0.
        turned: nodes with axes of their own, along which these are; areas do not depend on the axes.
        origin: (2,) where coordinates count from.

    Raises:
        InputError: at an end, neither component is held.
    """
    vertices, first, place = np.unique(ends_se, return_index=True, return_inverse=True)
    begins, ends = (np.bincount(part, minlength=len(vertices)) for part in place.reshape(-1, 2).T)
    for n in np.flatnonzero(begins != ends).tolist():
        node, point = nodes_se.ravel()[first[n]], corners_sex.reshape(-1, 2)[first[n]]
        dofs = DISPLACEMENT.dofs(node)
        held = np.isin(dofs, fixed)
        if not held.any():
            raise InputError(
                f"{name}: the edges '{where}' end at {shown_place(point)}, where no support holds ux or uy "
                "at 0: a pressure that follows has no potential there, and the solver needs one. Hold one of them "
                "there, or close the edges to a cavity"
            )
        axes = turned.of(node)
        X, Y = (point - origin) @ axes
        coupling = 0.5 if held[0] else -0.5
        factor = float(begins[n] - ends[n])
        linear, hessian = factor * np.array([[0.5 * Y, -0.5 * X]]), np.array([[[0.0, coupling], [coupling, 0.0]]])
        yield WorkTerms(dofs[None], linear @ axes.T, factor * axes @ hessian @ axes.T)
