"""One pass of refinement: some cells are cut, all at once, and their neighbours get hanging nodes.

Everything is decided on the mesh before the pass, by all cells together: where sides are divided, and which edges are
halved for it. So the order of cells does not matter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.geometry import centroids
from tmc_vem.mesh.make.change import CellTree, MeshChange
from tmc_vem.mesh.make.divide import Plan, plan_of
from tmc_vem.mesh.make.follow import follow
from tmc_vem.mesh.make.loops import Loops, joined
from tmc_vem.mesh.make.onto_curves import Followed
from tmc_vem.mesh.polygon import PolygonMesh

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]


def cut(change: MeshChange, chosen_c: Bool, flat: float, curves: Sequence[Followed]) -> MeshChange:
    """Cut the chosen cells of a mesh that was made of another one; the result says what became of that one.

    Raises:
        InputError: a cell cannot be cut; the message names it, by its number in the mesh before.
    """
    mesh, before_vx = change.mesh, change.before_vx
    loops = Loops.of(mesh)
    plan = plan_of(change, loops, chosen_c, flat)
    edges = mesh.edges
    asked = edges.cell_edges[plan.split_s[plan.new_s]]
    halved = asked[np.sort(np.unique(asked, return_index=True)[1])]  # each once, in the order of cells
    ends = edges.vertices_ev[halved]
    middle_e = np.full(len(edges), -1)
    middle_e[halved] = mesh.n_vertices + np.arange(len(ends))

    full, places = _with_middles(loops, middle_e[edges.cell_edges])
    moved_hubs = _shift(before_vx, mesh.points_vx, loops.chosen(plan.fans))
    before = np.concatenate([before_vx, before_vx[ends].mean(axis=1), plan.hubs_nx + moved_hubs])
    points = np.concatenate([mesh.points_vx, mesh.points_vx[ends].mean(axis=1), plan.hubs_nx])
    parts = _parts(full, places, plan)
    if len(curves):
        hub_c = np.full(mesh.n_cells, -1)
        hub_c[plan.fans] = mesh.n_vertices + len(halved) + np.arange(len(plan.fans))
        follow(mesh, points, halved, full, hub_c, parts, curves)

    cells = _children(full, places, plan, parts[0], mesh.n_vertices + len(ends))
    n_parts = np.ones(mesh.n_cells, dtype=np.int64)
    n_parts[plan.fans] = plan.n_sides_n
    n_parts[list(plan.parts)] = [len(lists) for lists in plan.parts.values()]
    origin = np.repeat(np.arange(mesh.n_cells), n_parts)
    new = PolygonMesh(
        points, cells.offsets, cells.vertices, mesh.region_c[origin], mesh.region_names, mesh.named_points,
        {name: _pieces(mesh, pairs, middle_e) for name, pairs in mesh.named_edges.items()},
        {name: values[origin] for name, values in mesh.cell_data.items()}, validate=False,
    )  # fmt: skip
    return MeshChange(new, before, change.parent_c[origin], _grown(change.tree, mesh, chosen_c, n_parts, len(points)))


def _with_middles(loops: Loops, middle: Int) -> tuple[Loops, Int]:
    """Loops with the middles of halved edges, -1 for others, and the new place of every entry."""
    size = 1 + (middle >= 0)
    end = np.cumsum(size)
    places = end - size
    vertices = np.empty(end[-1], dtype=np.int64)
    vertices[places] = loops.vertices
    vertices[places[middle >= 0] + 1] = middle[middle >= 0]
    return Loops(np.concatenate([[0], end])[loops.offsets], vertices), places


def _children(full: Loops, places: Int, plan: Plan, parts: Loops, first_hub: int) -> Loops:
    """Loops of all cells of the new mesh."""
    at = places[plan.split_s] + plan.new_s
    divides = np.zeros(len(full.vertices), dtype=bool)
    divides[at] = True
    last = np.cumsum(plan.n_sides_n) - 1
    entries = full.entries_from(plan.fans, at[last] - full.offsets[plan.fans])  # begins where the last side is divided
    ends = divides[full.following[entries]]
    sizes = 1 + 2 * ends
    places_out = np.cumsum(sizes) - sizes
    fans = np.empty(int(sizes.sum()), dtype=np.int64)
    fans[places_out] = full.vertices[entries]
    fans[places_out[ends] + 1] = full.vertices[full.following[entries[ends]]]
    fans[places_out[ends] + 2] = first_hub + np.repeat(np.arange(len(plan.fans)), plan.n_sides_n)
    child_sizes = np.diff(np.flatnonzero(divides[entries]), append=len(entries)) + 2

    whole = np.ones(len(full), dtype=bool)
    whole[plan.fans] = False
    whole[list(plan.parts)] = False
    rest = np.flatnonzero(whole)
    blocks = [full.chosen(rest), Loops.of_sizes(child_sizes, fans), parts]
    numbers = np.array([len(lists) for lists in plan.parts.values()], dtype=np.int64)
    owners = [
        rest,
        np.repeat(plan.fans, plan.n_sides_n),
        np.repeat(np.array(list(plan.parts), dtype=np.int64), numbers),
    ]
    return joined(blocks).chosen(np.argsort(np.concatenate(owners), kind="stable"))


def _parts(full: Loops, places: Int, plan: Plan) -> tuple[Loops, Int]:
    """Loops of all parts of cells without a hub, with the middles of halved edges, and their cells."""
    loops, owners = [], []
    for c, parts in plan.parts.items():
        start, end = int(full.offsets[c]), int(full.offsets[c + 1])
        first, stop = np.searchsorted(places, [start, end])
        begins = [*places[first:stop].tolist(), end]  # where the vertices of the cell stand, with middles between them
        for part in parts:
            vertices = []
            for k, following in zip(part, [*part[1:], part[0]], strict=True):
                whole = following == (k + 1) % (len(begins) - 1)  # else a diagonal
                vertices.append(full.vertices[begins[k] : begins[k + 1] if whole else begins[k] + 1])
            loops.append(np.concatenate(vertices))
            owners.append(c)
    sizes = np.array([len(loop) for loop in loops], dtype=np.int64)
    together = np.concatenate([np.empty(0, dtype=np.int64), *loops])
    return Loops.of_sizes(sizes, together), np.array(owners, dtype=np.int64)


def _shift(before_vx: Float, points_vx: Float, loops: Loops) -> Float:
    """How far centroids have moved with vertices that were moved onto curves."""
    shift = np.zeros((len(loops), 2))
    if before_vx is not points_vx:
        moved = (before_vx != points_vx).any(axis=1)
        some = np.flatnonzero(loops.any(moved[loops.vertices]))
        for which, vertices in loops.chosen(some).by_size():
            shift[some[which]] = centroids(before_vx[vertices]) - centroids(points_vx[vertices])
    return shift


def _pieces(mesh: PolygonMesh, pairs: Int, middle_e: Int) -> Int:
    """Named edges with halved ones replaced by their halves."""
    if not len(pairs):
        return pairs
    ends = mesh.edges.vertices_ev
    low, high = np.sort(pairs, axis=1).T
    middle = middle_e[np.searchsorted(ends[:, 0] * mesh.n_vertices + ends[:, 1], low * mesh.n_vertices + high)]
    size = 1 + (middle >= 0)
    rows = np.repeat(np.arange(len(pairs)), size)
    second = np.zeros(len(rows), dtype=bool)
    second[(np.cumsum(size) - 1)[middle >= 0]] = True
    pieces: Int = pairs[rows]
    cut_rows = middle[rows] >= 0
    pieces[cut_rows & ~second, 1] = middle[rows][cut_rows & ~second]
    pieces[second, 0] = middle[rows][second]
    return pieces


def _grown(tree: CellTree, mesh: PolygonMesh, chosen_c: Bool, n_parts_c: Int, n_vertices: int) -> CellTree:
    """The tree with one more family for every chosen cell."""
    family = tree.family_c.copy()
    family[chosen_c] = len(tree.size_f) + np.arange(int(chosen_c.sum()))
    born = np.ones(n_vertices, dtype=bool)
    born[: mesh.n_vertices] = tree.born_v
    return replace(
        tree,
        family_c=np.repeat(family, n_parts_c),
        level_c=np.repeat(tree.level_c + chosen_c, n_parts_c),
        born_v=born,
        size_f=np.concatenate([tree.size_f, n_parts_c[chosen_c]]),
        above_f=np.concatenate([tree.above_f, tree.family_c[chosen_c]]),
        first_f=np.concatenate([tree.first_f, mesh.cell_vertices[mesh.cell_offsets[:-1][chosen_c]]]),
    )
