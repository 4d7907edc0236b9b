"""What a problem consists of on its mesh: sizes, gaps, what holds each part, sharp corners; geometry only."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.cells import centroids_and_areas
from tmc_vem.mesh.interface import Interface, body_numbers, interface, solid_angles
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.mesh.rigid import part_numbers, without_rounding
from tmc_vem.problems.base import RegionEnergy
from tmc_vem.problems.conditions import vertices_at
from tmc_vem.problems.design_region import design_regions
from tmc_vem.problems.hints import SHARP
from tmc_vem.system.constraints import COMPONENTS, Condition, Prescribed, PrescribedAcross, PrescribedRotation
from tmc_vem.system.forces import BodyForce, CavityPressure, FollowerPressure, Force, PointForce, Spring, Traction

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Value = float | tuple[float, float]
Bool = NDArray[np.bool_]
Point = tuple[float, float]

# Cosine of the largest angle between the line across a gap and the normals of its two surfaces, 18 degrees.
ACROSS = 0.95
# Crossings of a line with edges are one, and belong to its ends, up to this fraction of its length.
SAME = 1e-6


@dataclass(frozen=True)
class RegionCount:
    """Size of a region.

    Attributes:
        name: of the region.
        n_cells: cells.
        n_nodes: nodes of its cells; those on interfaces count in every region that has them.
        area: its area.
        smallest, largest: size of its cells, the square root of their area.
    """

    name: str
    n_cells: int
    n_nodes: int
    area: float
    smallest: float
    largest: float


@dataclass(frozen=True)
class Width:
    """The narrowest place of a gap, straight across, in the undeformed state.

    Attributes:
        medium: region in it.
        solids: regions on its two sides.
        width: how wide it is.
        place: the middle.
        n_cells: cells that a straight line across it goes through.
    """

    medium: str
    solids: tuple[str, str]
    width: float
    place: Point
    n_cells: int


@dataclass(frozen=True)
class Part:
    """Solids that hang together.

    Attributes:
        regions: whose cells it has.
        n_cells: how many.
        middle: centre of its bounding box.
        conditions: supports, loads and springs on it, as (what, place, value where the amplitude is 1).
    """

    regions: tuple[str, ...]
    n_cells: int
    middle: Point
    conditions: tuple[tuple[str, str, Value], ...]


@dataclass(frozen=True)
class Corner:
    """Sharp corner of a solid with medium on both sides.

    Attributes:
        region: the solid.
        place: where.
        angle: inside the solid, in degrees.
    """

    region: str
    place: Point
    angle: float


def count_regions(mesh: PolygonMesh, order: int, inside: int) -> list[RegionCount]:
    """Sizes of the regions.

    Args:
        mesh: the whole mesh.
        order: of the elements, which have ``order - 1`` nodes on an edge.
        inside: nodes of each cell that no other has.
    """
    area_c = centroids_and_areas(mesh)[1]
    found = []
    for number, name in enumerate(mesh.region_names):
        chosen = mesh.region_c == number
        n_vertices, n_edges = _skeleton(mesh, chosen)
        n_cells = int(chosen.sum())
        size = np.sqrt(area_c[chosen])
        n_nodes = n_vertices + (order - 1) * n_edges + inside * n_cells
        found.append(
            RegionCount(name, n_cells, n_nodes, float(area_c[chosen].sum()), float(size.min()), float(size.max()))
        )
    return found


def count_nodes(mesh: PolygonMesh, order: int, inside: int) -> int:
    """Nodes of a mesh, each once; arguments as in :func:`count_regions`."""
    n_vertices, n_edges = _skeleton(mesh, np.ones(mesh.n_cells, dtype=np.bool_))
    return n_vertices + (order - 1) * n_edges + inside * mesh.n_cells


def narrowest(mesh: PolygonMesh, regions: Mapping[str, RegionEnergy]) -> list[Width]:
    """The narrowest gap between any two bodies, and of any with itself, in each medium; the narrowest first."""
    is_medium = _media(mesh, regions)
    sides = interface(mesh, is_medium)
    if not len(sides):
        return []
    body_s = body_numbers(mesh, ~is_medium)[sides.solid_s]
    middle = sides.start_sx + 0.5 * sides.arm_sx
    across = sides.nearest(middle, sides.normal_sx[:, None], ACROSS, ACROSS)
    found: dict[tuple[int, ...], int] = {}
    for s in np.argsort(across.distance_n, kind="stable").tolist():
        if across.side_n[s] >= 0:
            bodies = sorted((int(body_s[s]), int(body_s[across.side_n[s]])))
            found.setdefault((int(mesh.region_c[sides.medium_s[s]]), *bodies), s)
    return [
        _width(mesh, sides, s, int(across.side_n[s]), middle[s], across.point_nx[s]) for s in found.values()
    ]  # fmt: skip


def said_of(acting: Condition | Force) -> tuple[str, str, Value]:
    """What it is as problem files call it, the place or regions, and the value where its amplitude is 1."""
    match acting:
        case Prescribed(where=where, component=component, value=value):
            return tuple(COMPONENTS)[component], where, value
        case PrescribedAcross(where=where, direction=direction, value=value):
            return direction, where, value
        case PrescribedRotation(where=where, degrees=degrees):
            return "rotation", where, degrees
        case PointForce(where=where, force=force):
            return "force", where, force
        case Traction(where=where, traction=traction):
            return "traction", where, traction
        case BodyForce(regions=regions, force=force):
            return "body_force", ", ".join(regions), force
        case CavityPressure(where=where, pressure=pressure):
            return "cavity_pressure", where, pressure
        case FollowerPressure(where=where, pressure=pressure):
            return "pressure", where, pressure
        case Spring(where=where, stiffness=stiffness):
            return "stiffness", where, stiffness


def parts(
    mesh: PolygonMesh,
    regions: Mapping[str, RegionEnergy],
    prescribed: Sequence[Condition],
    forces: Sequence[Force] = (),
) -> list[Part]:
    """The solids and designs that hang together, and what holds and loads them."""
    part_c = part_numbers(mesh, ~_media(mesh, regions))
    of = [(each, vertices_loaded(mesh, each)) for each in (*prescribed, *forces)]
    found = []
    for part in range(int(part_c.max(initial=-1)) + 1):
        cells = np.flatnonzero(part_c == part)
        mine = np.unique(np.concatenate([mesh.cell(c) for c in cells.tolist()]))
        on = tuple(said_of(each) for each, at in of if np.isin(at, mine).any())
        low, high = mesh.points_vx[mine].min(axis=0), mesh.points_vx[mine].max(axis=0)
        middle = without_rounding(0.5 * (low + high), float((high - low).max()))
        whose = tuple(mesh.region_names[n] for n in np.unique(mesh.region_c[cells]))
        found.append(Part(whose, len(cells), middle, on))
    return found


def vertices_loaded(mesh: PolygonMesh, acting: Condition | Force) -> Int:
    """Vertices that something holds or loads.

    Raises:
        InputError: the mesh has nothing of its name.
    """
    if not isinstance(acting, BodyForce):
        return vertices_at(mesh, acting.where)
    of_cells = [mesh.region_names[region] in acting.regions for region in mesh.region_c.tolist()]
    found: Int = np.unique(np.concatenate([mesh.cell(c) for c in np.flatnonzero(of_cells).tolist()]))
    return found


def sharp_corners(mesh: PolygonMesh, regions: Mapping[str, RegionEnergy]) -> list[Corner]:
    """Convex corners of solids between two sides that face medium, the sharpest first."""
    is_medium = _media(mesh, regions)
    sides, angle_v = interface(mesh, is_medium), solid_angles(mesh, ~is_medium)
    leaving = dict(zip(sides.ends_sv[:, 0].tolist(), sides.solid_s.tolist(), strict=True))
    extent = float(np.ptp(mesh.points_vx, axis=0).max())
    found = [
        Corner(
            mesh.region_names[mesh.region_c[leaving[v]]],
            without_rounding(mesh.points_vx[v], extent),
            float(np.rad2deg(angle_v[v])),
        )
        for v in np.intersect1d(sides.ends_sv[:, 0], sides.ends_sv[:, 1]).tolist()
        if angle_v[v] < SHARP
    ]
    return sorted(found, key=lambda corner: (round(corner.angle, 6), corner.place))


def _media(mesh: PolygonMesh, regions: Mapping[str, RegionEnergy]) -> Bool:
    """(n_cells,) which cells are medium and nothing else: those of a design are a body that can be anywhere in it."""
    media = {name for name, of in regions.items() if of.is_medium} - set(design_regions(regions))
    of_cells: Bool = np.array([name in media for name in mesh.region_names])[mesh.region_c]
    return of_cells


def _skeleton(mesh: PolygonMesh, chosen_c: Bool) -> tuple[int, int]:
    """How many vertices and edges some cells have."""
    left, right = mesh.cells_of_edges
    chosen = np.append(chosen_c, False)  # the last for where there is no cell
    vertices = mesh.cell_vertices[np.repeat(chosen_c, mesh.n_sides_c)]
    return len(np.unique(vertices)), int((chosen[left] | chosen[right]).sum())


def _width(mesh: PolygonMesh, sides: Interface, a: int, b: int, start: Float, end: Float) -> Width:
    extent = float(np.ptp(mesh.points_vx, axis=0).max())
    medium, first, second = (
        mesh.region_names[mesh.region_c[cell]] for cell in (sides.medium_s[a], sides.solid_s[a], sides.solid_s[b])
    )
    place = without_rounding(0.5 * (start + end), extent)
    return Width(medium, (first, second), float(np.hypot(*(end - start))), place, 1 + _crossed(mesh, start, end))


def _crossed(mesh: PolygonMesh, start: Float, end: Float) -> int:
    """How many times edges cross a line between its ends; those that meet in a vertex on it cross once."""
    ends = mesh.points_vx[mesh.edges.vertices_ev]
    d, arm, to = end - start, ends[:, 1] - ends[:, 0], ends[:, 0] - start
    turn = d[0] * arm[:, 1] - d[1] * arm[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (to[:, 0] * arm[:, 1] - to[:, 1] * arm[:, 0]) / turn
        on_edge = (to[:, 0] * d[1] - to[:, 1] * d[0]) / turn
    inside = (along > SAME) & (along < 1.0 - SAME) & (on_edge >= -SAME) & (on_edge <= 1.0 + SAME)
    crossings = np.sort(along[inside])
    return int((np.diff(crossings, prepend=-1.0) > SAME).sum())
