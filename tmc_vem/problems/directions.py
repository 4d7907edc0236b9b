"""What is normal and tangential to named edges, which only a mesh tells."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError
from tmc_vem.system.constraints import Condition, Pair, PrescribedAcross

Float = NDArray[np.float64]
Int = NDArray[np.int64]

# Edges are straight if their ends deviate from a line by less than this fraction of its length.
STRAIGHT = 1e-6
# Components of a direction below this are rounding: the edges are along x or y.
ALONG_AXIS = 1e-12


def on_mesh(conditions: Sequence[Condition], mesh: PolygonMesh, media: Collection[str]) -> tuple[Condition, ...]:
    """The conditions, with the axes of those that are normal or tangential to edges.

    Args:
        conditions: of a problem.
        mesh: its whole mesh.
        media: names of the regions that are third medium.

    Raises:
        InputError: such edges are not there, not straight, or have no outside although one is meant.
    """
    return tuple(
        replace(each, axis=_axis(each, mesh, media)) if isinstance(each, PrescribedAcross) else each
        for each in conditions
    )


def _axis(condition: PrescribedAcross, mesh: PolygonMesh, media: Collection[str]) -> Pair:
    where = condition.where
    pairs = mesh.named_edges.get(where)
    if pairs is None or not len(pairs):
        raise InputError(f"{condition}: '{where}' are no edges, and a point has no {condition.direction} direction")
    x, y = _direction(mesh.points_vx[np.unique(pairs)], condition)
    side = _side_of_body(mesh, pairs, np.array([x, y]), media)
    if side == 0 and condition.value:
        raise InputError(
            f"{condition}: the edges have bodies on both sides, so that it is not clear which way is meant: give ux "
            "and uy, or other edges"
        )
    if side < 0:
        x, y = -x, -y  # now the body lies on the left
    return (x, y) if condition.direction == "tangential" else (y, -x)


def _direction(points: Float, condition: PrescribedAcross) -> tuple[float, float]:
    """Unit vector along points that lie on a straight line.

    Raises:
        InputError: they do not.
    """
    start = points[np.argmax(np.hypot(*(points - points[0]).T))]
    arm = points - start
    end = arm[np.argmax(np.hypot(*arm.T))]
    length = float(np.hypot(*end))
    off = float(np.abs(arm[:, 0] * end[1] - arm[:, 1] * end[0]).max()) / length
    if off > STRAIGHT * length:
        raise InputError(
            f"{condition}: the edges are curved, {off:.3g} off the line between their ends, and have no one "
            f"{condition.direction} direction: use straight edges, each with a condition of its own"
        )
    x, y = (0.0 if abs(value) < ALONG_AXIS else value for value in (end / length).tolist())
    return (x or 0.0, y or 0.0) if x and y else (float(np.sign(x)), float(np.sign(y)))


def normals_of(mesh: PolygonMesh, pairs: Int, media: Collection[str]) -> Float:
    """(n, 2) unit normals of edges with ends (n, 2), out of the body; of those between two bodies, either way."""
    arm = mesh.points_vx[pairs[:, 1]] - mesh.points_vx[pairs[:, 0]]
    side = np.where(_sides_of_body(mesh, pairs, arm, media) < 0.0, -1.0, 1.0)
    normal: Float = (side / np.hypot(*arm.T))[:, None] * np.column_stack([arm[:, 1], -arm[:, 0]])
    return normal


def _side_of_body(mesh: PolygonMesh, pairs: Int, direction: Float, media: Collection[str]) -> int:
    """On which side of a direction the body is that edges bound: 1 left, -1 right, 0 if that is not clear."""
    sides = np.unique(_sides_of_body(mesh, pairs, np.broadcast_to(direction, pairs.shape), media))
    return int(sides[0]) if len(sides) == 1 else 0


def _sides_of_body(mesh: PolygonMesh, pairs: Int, direction_nx: Float, media: Collection[str]) -> Float:
    """(n,) the same for each edge and a direction of its own."""
    is_body = np.array([name not in media for name in mesh.region_names], dtype=bool)[mesh.region_c]
    rank_c = np.append(1 + is_body.astype(int), 0)  # nothing, medium, body
    number = {tuple(sorted(pair)): n for n, pair in enumerate(mesh.edges.vertices_ev.tolist())}
    edges = np.array([number[tuple(sorted(pair))] for pair in pairs.tolist()])
    left, right = (rank_c[cells[edges]] for cells in mesh.cells_of_edges)
    start, end = (mesh.points_vx[mesh.edges.vertices_ev[edges, n]] for n in (0, 1))
    forward = np.sign(((end - start) * direction_nx).sum(axis=1))
    sides: Float = np.sign(left - right) * forward
    return sides
