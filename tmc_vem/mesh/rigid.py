"""Which parts of a mesh can move rigidly under the displacements that are prescribed; geometry only.

Cells that share an edge are one body, bodies that share a vertex hang together like at a hinge. A body moves with
u_x = a - w (y - y0) / L, u_y = b + w (x - x0) / L, with its middle (x0, y0) and half its extent L; every prescribed
component is one equation for (a, b, w), every hinge two. What the equations leave free is a rigid motion. All entries
are of order one, whatever the unit of length and the distance from the origin.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.interface import body_numbers
from tmc_vem.mesh.polygon import PolygonMesh

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]

# Singular values of the equations, relative to the root of their number, that count as zero. Coordinates differ by
# rounding, and edges belong to a line up to a millionth of the mesh's extent.
ZERO = 2e-6
ALONG = "moving along"  # how a motion begins that is neither along x nor along y
# Hinged bodies that are looked at together; of more, each is taken for held where it is hinged.
MOST_HINGED = 200


@dataclass(frozen=True)
class FreePart:
    """Cells that hang together and can move.

    Attributes:
        number: of the part among all, from 1 on.
        n_parts: how many parts there are.
        cells: its cells.
        middle: centre of its bounding box.
        motion: ``moving in x``, for example.
        components: those that are missing, ``ux`` and ``uy``; empty if it only turns.
    """

    number: int
    n_parts: int
    cells: Int
    middle: tuple[float, float]
    motion: str
    components: tuple[str, ...]


@dataclass(frozen=True)
class _Held:
    """What is prescribed at which vertices; arguments are those of :func:`free_parts`."""

    held_vi: Bool
    across_m: Int | None
    axis_mi: Float | None

    def rows(self, points_vx: Float, vertices: Int, middle: Float, extent: float) -> Float:
        """Equations (n, 3) of the displacements that are prescribed at some vertices."""
        at_x, at_y = (vertices[self.held_vi[vertices, axis]] for axis in (0, 1))
        rows = [_moves(points_vx[at], middle, extent)[:, axis] for axis, at in enumerate((at_x, at_y))]
        if self.across_m is not None and self.axis_mi is not None:
            here = np.isin(self.across_m, vertices)
            moves = _moves(points_vx[self.across_m[here]], middle, extent)
            rows.append(np.einsum("mi,mij->mj", self.axis_mi[here], moves))
        return np.concatenate(rows)


def part_numbers(mesh: PolygonMesh, chosen_c: Bool) -> Int:
    """(n_cells,) number of the part of each chosen cell, -1 for the others; cells that share a vertex are in one."""
    body_c = body_numbers(mesh, chosen_c)
    part_b = _parts(*_bodies_and_vertices(mesh, body_c), int(body_c.max(initial=-1)) + 1)
    part: Int = np.append(part_b, -1)[body_c]
    return part


def free_parts(
    mesh: PolygonMesh, chosen_c: Bool, held_vi: Bool, across_m: Int | None = None, axis_mi: Float | None = None
) -> list[FreePart]:
    """Parts of the mesh, of chosen cells, whose rigid motions the prescribed components do not remove.

    Args:
        mesh: the whole mesh.
        chosen_c: (n_cells,) which cells.
        held_vi: (n_vertices, 2) which components are prescribed at which vertices.
        across_m, axis_mi: (m,) vertices at which the displacement along another axis is, and (m, 2) these axes.
    """
    held = _Held(held_vi, across_m, axis_mi)
    body_c = body_numbers(mesh, chosen_c)
    n_bodies = int(body_c.max(initial=-1)) + 1
    body_p, vertex_p = _bodies_and_vertices(mesh, body_c)
    part_b = _parts(body_p, vertex_p, n_bodies)
    n_parts = int(part_b.max(initial=-1)) + 1
    first = np.searchsorted(body_p, np.arange(n_bodies + 1))
    found = []
    for part in range(n_parts):
        members = np.flatnonzero(part_b == part)
        points = [vertex_p[first[b] : first[b + 1]] for b in members.tolist()]
        said = _motion(mesh.points_vx, points, held)
        if said:
            middle, extent = _frame(mesh.points_vx[np.concatenate(points)])
            cells = np.flatnonzero(np.isin(body_c, members))
            found.append(FreePart(part + 1, n_parts, cells, without_rounding(middle, extent), *said))
    return found


def without_rounding(point: Float, extent: float) -> tuple[float, float]:
    """A point as messages show it: what is zero up to a billionth of the extent is zero."""
    x, y = np.where(np.abs(point) < 1e-9 * extent, 0.0, point).tolist()
    return x, y


def _bodies_and_vertices(mesh: PolygonMesh, body_c: Int) -> tuple[Int, Int]:
    """All pairs (n_pairs,) of a body and one of its vertices, sorted."""
    body_s = np.repeat(body_c, mesh.n_sides_c)
    used = body_s >= 0
    pairs = np.unique(body_s[used] * mesh.n_vertices + mesh.cell_vertices[used])
    return pairs // mesh.n_vertices, pairs % mesh.n_vertices


def _parts(body_p: Int, vertex_p: Int, n_bodies: int) -> Int:
    """(n_bodies,) part of each body: bodies that share a vertex are in one part; numbered by their first body."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    order = np.argsort(vertex_p, kind="stable")
    same = np.flatnonzero(np.diff(vertex_p[order]) == 0)
    if not len(same):
        return np.arange(n_bodies)
    a, b = body_p[order[same]], body_p[order[same + 1]]
    graph = coo_array((np.ones(len(a)), (a, b)), shape=(n_bodies, n_bodies))
    part: Int = connected_components(graph, directed=False)[1]
    return part.astype(np.int64)


def _motion(points_vx: Float, bodies_v: list[Int], held: _Held) -> tuple[str, tuple[str, ...]] | None:
    """What a part of some bodies can do, and which components are missing; None if it is held."""
    if len(bodies_v) > MOST_HINGED:
        bodies_v = [np.unique(np.concatenate(bodies_v))]
    frames = [_frame(points_vx[vertices]) for vertices in bodies_v]
    width = 3 * len(bodies_v)
    equations = [held.rows(points_vx, vertices, *frame) for vertices, frame in zip(bodies_v, frames, strict=True)]
    rows = [np.zeros((0, width))]
    for n, own in enumerate(equations):
        block = np.zeros((len(own), width))
        block[:, 3 * n : 3 * n + 3] = own
        rows.append(block)
    rows.append(_hinges(points_vx, bodies_v, frames))
    system = np.concatenate(rows)
    limit = ZERO * np.sqrt(max(1, len(system)))
    missing = np.zeros((max(0, width - len(system)), width))
    _, values, modes = np.linalg.svd(np.concatenate([system, missing]), full_matrices=False)
    null = modes[int((values > limit).sum()) :]
    if not len(null):
        return None
    shifts = [np.tile(shift, len(bodies_v)) for shift in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))]
    free = [axis for axis, shift in enumerate(shifts) if np.abs(system @ shift).max(initial=0.0) <= limit]
    said = " and ".join("xy"[axis] for axis in free)
    said = f"moving in {said}" if free else ""
    along = [mode for mode in null[:1] if not free and len(bodies_v) == 1 and abs(mode[2]) <= limit]
    if along and len(null) == 1:
        x, y = (along[0][:2] / np.hypot(*along[0][:2]) * (np.sign(along[0][0]) or 1.0)).tolist()
        return f"{ALONG} ({x:.4g}, {y:.4g})", ()
    if len(null) > len(free):
        said += f"{' and ' if said else ''}turning"
        if not free and len(bodies_v) == 1:
            (x, y), extent = frames[0]
            a, b, w = null[0]
            x0, y0 = without_rounding(np.array([x - b * extent / w, y + a * extent / w]), extent)
            said += f" about ({x0:.4g}, {y0:.4g})"
    return said, tuple(("ux", "uy")[axis] for axis in free)


def _frame(points: Float) -> tuple[Float, float]:
    """Middle and half extent of points."""
    low, high = points.min(axis=0), points.max(axis=0)
    return 0.5 * (low + high), 0.5 * float((high - low).max())


def _moves(points: Float, middle: Float, extent: float) -> Float:
    """(n, 2, 3) displacements of points for a unit of a, b and w."""
    arm = (points - middle) / extent
    moves = np.zeros((len(points), 2, 3))
    moves[:, 0, 0] = moves[:, 1, 1] = 1.0
    moves[:, 0, 2], moves[:, 1, 2] = -arm[:, 1], arm[:, 0]
    return moves


def _hinges(points_vx: Float, bodies_v: list[Int], frames: list[tuple[Float, float]]) -> Float:
    """Equations of the vertices that bodies share: they move alike."""
    owner = np.repeat(np.arange(len(bodies_v)), [len(vertices) for vertices in bodies_v])
    vertex = np.concatenate(bodies_v)
    order = np.argsort(vertex, kind="stable")
    shared = np.flatnonzero(np.diff(vertex[order]) == 0)
    rows = np.zeros((len(shared), 2, 3 * len(bodies_v)))
    for n, p in enumerate(shared.tolist()):
        a, b = owner[order[p]], owner[order[p + 1]]
        x = points_vx[vertex[order[[p]]]]
        rows[n, :, 3 * a : 3 * a + 3] = _moves(x, *frames[a])[0]
        rows[n, :, 3 * b : 3 * b + 3] -= _moves(x, *frames[b])[0]
    return rows.reshape(-1, 3 * len(bodies_v))
