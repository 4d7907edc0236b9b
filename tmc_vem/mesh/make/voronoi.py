"""Voronoi meshes of several regions whose interfaces are respected exactly, relaxed by Lloyd's method.

Clipping Voronoi cells at an interface leaves slivers, hanging nodes and Python loops; the dual of a triangulation puts
a needless vertex on every straight side. Here the sites are placed so that the plain Voronoi diagram has the interface
in it, the idea of VoroCrust (Abdelkader et al., ACM Trans. Graph. 39 (2020) 23) in two dimensions: around every node of
the interface lies a circle, and where the circles of two neighbouring nodes intersect, on both sides of the segment,
there is a site. All sites around a node are equally far from it, so the node is a Voronoi vertex; the two of a segment
are each other's mirror image, so the segment is a Voronoi edge. Sites inside the regions keep out of the circles and
are relaxed; the outside is one more region, whose cells are dropped.

Everything is vectorised: 100 000 cells take seconds for each Voronoi diagram (Qhull) and nothing is clipped.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.cell_count import POLYGONS
from tmc_vem.mesh.make.estimate import check_size
from tmc_vem.mesh.make.far import meshed_near_origin
from tmc_vem.mesh.make.narrow import narrow_place
from tmc_vem.mesh.make.outline import Point, Region, Size, Skeleton, evaluate_size, make_skeleton
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.environment import cells_allowed
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Sector = tuple[int, int, int, float]  # node, segment, next segment counter-clockwise, angle between them

# Radius of a node's circle over the length of its segments: neighbouring sites then are one length apart, as in a row
# of squares, and in a right angle the sites of both sides coincide.
RADIUS = np.sqrt(0.5)
# Corners up to the first angle have one site for both segments; below the second, neighbouring circles get in each
# other's way.
JOINED, SHARPEST = np.radians(110.0), np.radians(50.0)
# Sites inside a region keep this fraction of the local size away from those along interfaces.
CLEARANCE = 0.75
# Sites inside a region keep out of this multiple of the circles' radii.
OUTSIDE = 1.05
# Where no site is within this fraction of the local size, there is room for one more.
SPARSE = 0.95
# Sites and vertices closer than this fraction of the shortest segment are one.
COINCIDE = 1e-6


class UnresolvedError(InputError):
    """The cells do not fit into a place: it is narrow, or their size changes quickly there.

    Attributes:
        place: where.
    """

    def __init__(self, message: str, place: Sequence[float] | Float = (np.nan, np.nan)) -> None:
        super().__init__(message)
        self.place = place


@meshed_near_origin
def voronoi_mesh(
    regions: Sequence[Region],
    size: Size,
    points: Mapping[str, Point] | None = None,
    *,
    relaxation: int = 10,
    shortest: float = 0.15,
    seed: int = 0,
    most_cells: float | None = None,
) -> PolygonMesh:
    """Voronoi mesh of regions that may touch along straight or curved interfaces.

    Args:
        regions: outlines; shared curves become interfaces.
        size: distance of sites (length), a number or a function of points (n, 2).
        points: names for places on the outlines; each becomes a vertex.
        relaxation: steps of Lloyd's method, which moves sites to the centroids of their cells.
        shortest: edges shorter than this fraction of the local size are collapsed; interfaces keep their nodes.
        seed: of the random numbers that place the first sites; equal seeds give equal meshes.
        most_cells: how many there may be; None for what the environment says, or a million.

    Returns:
        The mesh, with the regions' names in the order of their first use.

    Raises:
        UnresolvedError: the size is too large for a narrow place, or changes too quickly; the message says where.
        InputError: a parameter is out of range, there would be too many cells, a corner is too acute, regions overlap
            or a named point is on no outline.
    """
    if not 0.0 <= shortest <= 0.4:
        raise InputError(f"shortest = {shortest:g}: use a fraction of the local size from 0 to 0.4")
    if not 0 <= relaxation <= 1000:
        raise InputError(f"relaxation = {relaxation}: use 0 to 1000 steps of Lloyd's method")
    _check_overlap(regions)
    check_size(regions, size, POLYGONS, cells_allowed(most_cells))
    skeleton = make_skeleton(regions, size, points)
    try:
        return _meshed(regions, size, skeleton, relaxation, shortest, seed)
    except UnresolvedError as error:
        raise UnresolvedError(narrow_place(regions, skeleton, size) or str(error), error.place) from None


def _meshed(
    regions: Sequence[Region], size: Size, skeleton: Skeleton, relaxation: int, shortest: float, seed: int
) -> PolygonMesh:
    fixed, radius_n = interface_sites(skeleton)
    inside = _interior_sites(regions, size, fixed, skeleton, radius_n, np.random.default_rng(seed))
    for _ in range(relaxation):
        inside = _relaxed(inside, fixed, size)
        inside = _pushed_out(inside, skeleton.nodes_nx, radius_n)
    sites = np.concatenate([fixed, inside])
    region_s, names = _region_of(regions, sites)
    kept = region_s >= 0
    vertices, cells, offsets = _cells(sites, kept)
    vertices, label = _collapse(vertices, cells, offsets, skeleton.nodes_nx, size, shortest)
    return _assemble(vertices, label[cells], offsets, region_s[kept], names, skeleton)


def interface_sites(skeleton: Skeleton) -> tuple[Float, Float]:
    """Sites (n, 2) along all interfaces, on both sides of each, and the radius (n_nodes,) of every node's circle.

    Raises:
        UnresolvedError: circles of neighbouring nodes do not meet, because the size changes too quickly.
        InputError: a corner is too acute.
    """
    nodes, segments = skeleton.nodes_nx, skeleton.segments_sn
    a, b = segments.T
    length_s = np.hypot(*(nodes[b] - nodes[a]).T)
    ends, lengths = segments.ravel(), np.repeat(length_s, 2)
    radius_n = RADIUS * np.bincount(ends, lengths, len(nodes)) / np.bincount(ends, minlength=len(nodes))
    sectors = _sectors(skeleton)
    _fit_radii(radius_n, skeleton, length_s, sectors)

    along = (length_s**2 + radius_n[a] ** 2 - radius_n[b] ** 2) / (2.0 * length_s)
    squared = radius_n[a] ** 2 - along**2
    bad = np.flatnonzero(squared <= (0.05 * length_s) ** 2)
    if len(bad):
        x, y = place = nodes[segments[bad[0]]].mean(axis=0)
        raise UnresolvedError(
            f"the size of cells changes too quickly near ({x:.4g}, {y:.4g}): make it vary more slowly", place
        )
    tangent = (nodes[b] - nodes[a]) / length_s[:, None]
    foot = nodes[a] + along[:, None] * tangent
    arm = np.sqrt(squared)[:, None] * np.column_stack([-tangent[:, 1], tangent[:, 0]])
    sites = [foot + arm, foot - arm]

    cos_at = {(int(n), s): c for s, (p, q) in enumerate(segments.tolist()) for n, c in (
        (p, along[s] / radius_n[p]), (q, (length_s[s] - along[s]) / radius_n[q]))}  # fmt: skip
    for node, first, second, angle in sectors:
        delta = [float(np.arccos(cos_at[node, s])) for s in (first, second)]
        room = angle - sum(delta)
        extra = round(room / (np.pi / 2)) - 1
        if extra > 0:
            other = segments[first][segments[first] != node][0]
            start = np.arctan2(*(nodes[other] - nodes[node])[::-1])
            turn = start + delta[0] + room * np.arange(1, extra + 1) / (extra + 1)
            sites.append(nodes[node] + radius_n[node] * np.column_stack([np.cos(turn), np.sin(turn)]))
    return _distinct(np.concatenate(sites), COINCIDE * length_s.min()), radius_n


def _sectors(skeleton: Skeleton) -> list[Sector]:
    """Sectors between segments at the nodes where the interface turns or branches."""
    nodes, segments = skeleton.nodes_nx, skeleton.segments_sn
    here, there = segments.ravel(), segments[:, ::-1].ravel()
    angle = np.arctan2(*(nodes[there] - nodes[here]).T[::-1])
    order = np.lexsort([angle, here])
    here, angle, segment = here[order], angle[order], (np.arange(len(here)) // 2)[order]
    starts = np.flatnonzero(np.r_[True, here[1:] != here[:-1]])
    counts = np.diff(np.r_[starts, len(here)])
    sectors = []
    for start, count in zip(starts.tolist(), counts.tolist(), strict=True):
        for n in range(count):
            one, two = start + n, start + (n + 1) % count
            opening = float((angle[two] - angle[one]) % (2.0 * np.pi)) or 2.0 * np.pi
            if count != 2 or abs(opening - np.pi) > 0.5:
                sectors.append((int(here[one]), int(segment[one]), int(segment[two]), opening))
    return sectors


def _fit_radii(radius_n: Float, skeleton: Skeleton, length_s: Float, sectors: list[Sector]) -> None:
    """Choose the circles at sharp corners so that the sites of both segments coincide on one side of the corner.

    With two separate sites in a corner of little more than a right angle, the cell there is cut along its diagonal;
    in a corner of less, each site would be beyond the other's segment.
    """
    segments, nodes = skeleton.segments_sn, skeleton.nodes_nx
    at_node: dict[int, list[Sector]] = {}
    for sector in sectors:
        if sector[3] <= JOINED:
            at_node.setdefault(sector[0], []).append(sector)
    done: set[int] = set()
    for node, sharp in at_node.items():
        sharp.sort(key=lambda sector: sector[3])
        if sharp[0][3] < SHARPEST:
            x, y = nodes[node]
            raise InputError(
                f"the outlines meet at {np.degrees(sharp[0][3]):.1f} degrees at ({x:.4g}, {y:.4g}); Voronoi cells that "
                f"respect them need at least {np.degrees(SHARPEST):.0f}: blunt the corner, or use triangles"
            )
        delta: dict[int, float] = {}
        for _, first, second, angle in sharp:
            if first not in delta and second not in delta:
                delta[first] = delta[second] = 0.5 * angle
            else:
                known, other = (first, second) if first in delta else (second, first)
                delta.setdefault(other, angle - delta[known])
        radius_n[node] = 0.5 * min(length_s[s] for s in delta) / np.cos(0.5 * sharp[0][3])
        for s, angle in delta.items():
            far = int(segments[s][segments[s] != node][0])
            if far not in at_node:
                d, r = length_s[s], radius_n[node]
                fitting = np.sqrt(d**2 + r**2 - 2.0 * d * r * np.cos(angle))
                # between two corners the smaller circle: the other corner then keeps two sites, in the right order
                radius_n[far] = min(fitting, radius_n[far]) if far in done else fitting
                done.add(far)


def _distinct(points: Float, tolerance: float) -> Float:
    from scipy.spatial import cKDTree

    pairs = cKDTree(points).query_pairs(tolerance, output_type="ndarray")
    kept: Float = np.delete(points, np.unique(pairs[:, 1]), axis=0)
    return kept


def _interior_sites(
    regions: Sequence[Region], size: Size, fixed: Float, skeleton: Skeleton, radius_n: Float, rng: np.random.Generator
) -> Float:
    """Sites of a hexagonal lattice, shaken, thinned by the size field, away from the interfaces' own sites."""
    from scipy.spatial import cKDTree

    low, high = skeleton.nodes_nx.min(axis=0), skeleton.nodes_nx.max(axis=0)
    sample = low + rng.random((2000, 2)) * (high - low)
    smallest = float(evaluate_size(size, np.concatenate([sample, skeleton.nodes_nx])).min())
    pitch = smallest * np.sqrt(2.0 / np.sqrt(3.0))  # one site in smallest^2
    n = np.ceil((high - low) / [pitch, pitch * np.sqrt(0.75)]).astype(int) + 2
    if n.prod() > 2e7:
        raise InputError(
            f"the smallest cells, of size {smallest:.3g}, are too small for a domain of {high[0] - low[0]:.4g} x "
            f"{high[1] - low[1]:.4g}: Voronoi cells are chosen from at most 20 million places of that size. Use larger "
            "ones there, or triangles"
        )
    i, j = np.meshgrid(np.arange(n[0]), np.arange(n[1]))
    lattice = np.column_stack([(i + 0.5 * (j % 2)).ravel() * pitch, j.ravel() * pitch * np.sqrt(0.75)]) + low
    lattice += rng.uniform(-0.15, 0.15, lattice.shape) * pitch
    lattice = lattice[((lattice > low) & (lattice < high)).all(axis=1)]
    h = evaluate_size(size, lattice)
    chosen = rng.random(len(lattice)) < (smallest / h) ** 2 * (1.0 + 1e-12)
    lattice, h = lattice[chosen], h[chosen]
    inside = _contained(regions, lattice)
    lattice, h = lattice[inside], h[inside]
    distance, _ = cKDTree(fixed).query(lattice)
    near, node = cKDTree(skeleton.nodes_nx).query(lattice, k=min(4, len(skeleton.nodes_nx)))
    sites: Float = lattice[(distance > CLEARANCE * h) & (near > OUTSIDE * radius_n[node]).all(axis=1)]
    return _pushed_out(_filled(sites, regions, size, fixed), skeleton.nodes_nx, radius_n)


def _filled(inside: Float, regions: Sequence[Region], size: Size, fixed: Float) -> Float:
    """Sites with more where none is within about the local size: a lattice misses the middle of narrow places."""
    from scipy.spatial import Delaunay, cKDTree

    for _ in range(4):
        sites = np.concatenate([fixed, inside])
        triangles = sites[Delaunay(sites).simplices]
        a, b = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
        twice_area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        ok = np.abs(twice_area) > 1e-9 * ((a**2).sum(axis=1) + (b**2).sum(axis=1))
        a, b, twice_area = a[ok], b[ok], twice_area[ok]
        aa, bb = (a**2).sum(axis=1), (b**2).sum(axis=1)
        arm = np.column_stack([b[:, 1] * aa - a[:, 1] * bb, a[:, 0] * bb - b[:, 0] * aa]) / (2.0 * twice_area[:, None])
        center, radius = triangles[ok, 0] + arm, np.hypot(*arm.T)
        center, radius = center[_contained(regions, center)], radius[_contained(regions, center)]
        if not len(center):
            return inside
        excess = radius / evaluate_size(size, center)
        center, excess = center[excess > SPARSE], excess[excess > SPARSE]
        if not len(center):
            return inside
        center = center[np.argsort(-excess)]
        h = evaluate_size(size, center)
        neighbours = cKDTree(center).query_ball_point(center, CLEARANCE * h)
        taken = np.zeros(len(center), dtype=bool)
        for n, near in enumerate(neighbours):
            taken[n] = not taken[near].any()
        inside = np.concatenate([inside, center[taken]])
    return inside


def _contained(regions: Sequence[Region], points: Float) -> NDArray[np.bool_]:
    import shapely

    inside = np.zeros(len(points), dtype=bool)
    for region in regions:
        polygon = region.polygon()
        shapely.prepare(polygon)
        inside |= shapely.contains_xy(polygon, points)
    return inside


def _relaxed(inside: Float, fixed: Float, size: Size) -> Float:
    """One step of Lloyd's method: the sites inside at their cells' centroids, weighted with 1 / size^4."""
    from scipy.spatial import Voronoi

    if not len(inside):
        return inside
    sites = np.concatenate([fixed, inside])
    diagram = Voronoi(sites)
    ends = np.asarray(diagram.ridge_vertices)
    finite = (ends >= 0).all(axis=1)
    pairs, ends = diagram.ridge_points[finite], ends[finite]
    v, w = diagram.vertices[ends[:, 0]], diagram.vertices[ends[:, 1]]
    mass, moment = np.zeros(len(sites)), np.zeros((len(sites), 2))
    for side in (0, 1):
        site = pairs[:, side]
        use = site >= len(fixed)
        s, p, q = site[use], v[use], w[use]
        arm, other = p - sites[s], q - sites[s]
        center = (sites[s] + p + q) / 3.0
        weight = np.abs(arm[:, 0] * other[:, 1] - arm[:, 1] * other[:, 0])
        if not isinstance(size, (int, float)):
            weight = weight / evaluate_size(size, center) ** 4
        mass += np.bincount(s, weight, len(sites))
        moment += np.column_stack([np.bincount(s, weight * center[:, x], len(sites)) for x in (0, 1)])
    moved: Float = moment[len(fixed) :] / mass[len(fixed) :, None]
    return moved


def _pushed_out(inside: Float, nodes: Float, radius_n: Float) -> Float:
    """Sites that came into a node's circle, back to just outside it."""
    from scipy.spatial import cKDTree

    if not len(inside):
        return inside
    moved = inside.copy()
    for _ in range(3):  # out of one circle may be into the next
        distance, node = cKDTree(nodes).query(moved, k=min(4, len(nodes)))
        depth = OUTSIDE * radius_n[node] - distance
        worst = depth.argmax(axis=1)
        caught = np.flatnonzero(depth.max(axis=1) > 0.0)
        if not len(caught):
            break
        center = nodes[node[caught, worst[caught]]]
        factor = OUTSIDE * radius_n[node[caught, worst[caught]]] / np.maximum(distance[caught, worst[caught]], 1e-300)
        moved[caught] = center + factor[:, None] * (moved[caught] - center)
    return moved


def _region_of(regions: Sequence[Region], sites: Float) -> tuple[Int, tuple[str, ...]]:
    """Number (n,) of the region of every site, -1 outside, and the names."""
    import shapely

    names = tuple(dict.fromkeys(region.name for region in regions))
    region_s = np.full(len(sites), -1, dtype=np.int64)
    for region in regions:
        polygon = region.polygon()
        shapely.prepare(polygon)
        region_s[shapely.contains_xy(polygon, sites)] = names.index(region.name)
    return region_s, names


def _cells(sites: Float, kept: NDArray[np.bool_]) -> tuple[Float, Int, Int]:
    """Voronoi vertices, and the vertices of the kept sites' cells, counter-clockwise, with offsets."""
    from scipy.spatial import Voronoi

    diagram = Voronoi(sites)
    ends = np.asarray(diagram.ridge_vertices, dtype=np.int64)
    pairs = diagram.ridge_points.astype(np.int64)  # 32 bits overflow below
    cell = np.repeat(np.concatenate([pairs[:, 0], pairs[:, 1]]), 2)
    vertex = np.concatenate([ends, ends]).ravel()
    use = kept[cell]
    cell, vertex = cell[use], vertex[use]
    if (vertex < 0).any():
        x, y = place = sites[cell[np.argmin(vertex)]]
        raise UnresolvedError(f"the cell at ({x:.4g}, {y:.4g}) is not closed: use a smaller size of cells", place)
    key = np.unique(cell * np.int64(len(diagram.vertices)) + vertex)
    cell, vertex = key // len(diagram.vertices), key % len(diagram.vertices)
    arm = diagram.vertices[vertex] - sites[cell]
    order = np.lexsort([np.arctan2(arm[:, 1], arm[:, 0]), cell])
    offsets = np.concatenate([[0], np.cumsum(np.bincount(cell, minlength=len(sites))[kept])])
    return diagram.vertices, vertex[order], offsets


def _collapse(
    vertices: Float, cells: Int, offsets: Int, nodes: Float, size: Size, shortest: float
) -> tuple[Float, Int]:
    """Points, the interfaces' nodes first, and the new number of every vertex: short edges are contracted."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    n_nodes = len(nodes)
    tree = cKDTree(nodes)
    gap = float(tree.query(nodes, k=2)[0][:, 1].min())
    distance, node = tree.query(vertices)
    label = np.where(distance < COINCIDE * gap, node, n_nodes + np.arange(len(vertices)))
    points = np.concatenate([nodes, vertices])
    start = label[cells]
    end = np.roll(start, -1)
    end[offsets[1:] - 1] = start[offsets[:-1]]
    length = np.hypot(*(points[end] - points[start]).T)
    h = evaluate_size(size, 0.5 * (points[start] + points[end]))
    short = (length < np.maximum(shortest * h, COINCIDE * gap)) & ((start >= n_nodes) | (end >= n_nodes))
    graph = coo_array((np.ones(short.sum()), (start[short], end[short])), shape=(len(points),) * 2)
    _, component = connected_components(graph, directed=False)
    # an interface's node stays where it is and takes the vertices near it along; others meet in the middle
    used = np.unique(start)
    weight = np.zeros(len(points))
    weight[used] = 1.0
    count = np.bincount(component, weight)
    middle = (
        np.column_stack([np.bincount(component, weight * points[:, x]) for x in (0, 1)]) / np.maximum(count, 1)[:, None]
    )
    middle[component[:n_nodes]] = nodes
    owner = np.full(component.max() + 1, -1)
    owner[component[used]] = component[used]
    final = np.full(len(owner), -1)
    _, first = np.unique(component[:n_nodes], return_index=True)
    if len(first) != n_nodes:
        lost = np.setdiff1d(np.arange(n_nodes), first)[0]
        x, y = nodes[lost]
        raise UnresolvedError(
            f"the interface near ({x:.4g}, {y:.4g}) is not resolved: use a smaller size of cells there", nodes[lost]
        )
    final[component[:n_nodes]] = np.arange(n_nodes)
    rest = np.flatnonzero((final < 0) & (owner >= 0))
    final[rest] = n_nodes + np.arange(len(rest))
    return np.concatenate([nodes, middle[rest]]), final[component[label]]


def _assemble(
    points: Float, loops: Int, offsets: Int, region_c: Int, names: tuple[str, ...], skeleton: Skeleton
) -> PolygonMesh:
    """The mesh without repeated vertices; every segment of the skeleton must be an edge."""
    n_cells = len(offsets) - 1
    cell = np.repeat(np.arange(n_cells), np.diff(offsets))
    before = np.roll(loops, 1)
    before[offsets[:-1]] = loops[offsets[1:] - 1]
    keep = loops != before
    loops, cell = loops[keep], cell[keep]
    sizes = np.bincount(cell, minlength=n_cells)
    thin = sizes < 3  # a cell that the collapse has closed
    loops, sizes, region_c = loops[~thin[cell]], sizes[~thin], region_c[~thin]
    used, local = np.unique(loops, return_inverse=True)
    number = np.full(len(points), -1, dtype=np.int64)
    number[used] = np.arange(len(used))
    lost = np.flatnonzero((number[skeleton.segments_sn] < 0).any(axis=1))
    if len(lost):
        raise _unresolved(skeleton, lost)
    mesh = PolygonMesh(
        points_vx=points[used],
        cell_offsets=np.concatenate([[0], np.cumsum(sizes)]),
        cell_vertices=local,
        region_c=region_c,
        region_names=names,
        named_points={name: int(number[node]) for name, node in skeleton.names.items()},
    )
    wanted = np.sort(number[skeleton.segments_sn], axis=1) @ np.array([mesh.n_vertices, 1])
    missing = np.flatnonzero(~np.isin(wanted, mesh.edges.vertices_ev @ np.array([mesh.n_vertices, 1])))
    if len(missing):
        raise _unresolved(skeleton, missing)
    return mesh


def _unresolved(skeleton: Skeleton, segments: Int) -> UnresolvedError:
    x, y = place = skeleton.nodes_nx[skeleton.segments_sn[segments[0]]].mean(axis=0)
    return UnresolvedError(
        f"the interface near ({x:.4g}, {y:.4g}) is not resolved ({len(segments)} such places): two outlines are "
        "closer than the size of cells there, or it changes too quickly; use a smaller size",
        place,
    )


def _check_overlap(regions: Sequence[Region]) -> None:
    import shapely

    if not regions:
        raise InputError("a Voronoi mesh needs at least one region")
    polygons = np.array([region.polygon() for region in regions])
    first, second = shapely.STRtree(polygons).query(polygons)
    for i, j in zip(first.tolist(), second.tolist(), strict=True):
        if i < j:
            common = shapely.area(shapely.intersection(polygons[i], polygons[j]))
            smaller = min(polygons[i].area, polygons[j].area)
            if common > 1e-3 * smaller:
                raise InputError(
                    f"regions {i} ('{regions[i].name}') and {j} ('{regions[j].name}') overlap in an area of "
                    f"{common:.3g}: cut one out of the other"
                )
