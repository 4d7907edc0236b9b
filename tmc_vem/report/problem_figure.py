"""A problem drawn with its regions, supports, load and gap, and meshes side by side."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems.directions import normals_of, on_mesh
from tmc_vem.problems.probes import Gap, Place, Probe
from tmc_vem.report.figures import border_lines
from tmc_vem.report.labels import label
from tmc_vem.report.panels import WIDE
from tmc_vem.system.constraints import Condition, Prescribed, PrescribedRotation
from tmc_vem.system.forces import BodyForce, CavityPressure, FollowerPressure, Force, Spring, Traction

SOLIDS = ("#c9d3dc", "#aebccb", "#dcd2c4")
MEDIUM_COLOUR = "#eaf3fb"
ACROSS = 2  # in place of a component: held in a direction that is neither x nor y
SUPPORT, LOAD, CORNER = "#1c2024", "#c0392b", "#e67e22"
PROBES = ("#0b5394", "#2e7d32", "#7b1fa2", "#00838f", "#5d4037")


def draw_problem(
    mesh: PolygonMesh,
    media: Collection[str],
    prescribed: Sequence[Condition],
    load: Condition | Force,
    probes: Mapping[str, Probe],
    forces: Sequence[Force] = (),
    *,
    cells: bool = False,
    corners: Sequence[tuple[float, float]] = (),
) -> Any:
    """Figure of a problem: supports as squares, or triangles where one component is free, loads as arrows, springs as
    hollow squares, gaps as lines, and other points that are measured as dots.

    Args:
        mesh: its mesh.
        media: regions that are third medium.
        prescribed: supports and loads.
        load: the one that is the load.
        probes: what is measured, by name.
        forces: that act, and springs.
        cells: draw the edges of the cells, and tell the regions by name.
        corners: sharp corners, marked by crosses.
    """
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    points = np.asarray(mesh.points_vx)
    extent = np.ptp(points, axis=0)
    figure, (axes,) = _panels(1, extent, width=9.0, height=(1.5, 5.5), margin=0.9)
    _fill(axes, mesh, media, edges=cells)
    unit = 0.05 * float(extent.max())
    named = region_colours(mesh.region_names, media) if cells else {"solid": SOLIDS[0], "third medium": MEDIUM_COLOUR}
    edge = {MEDIUM_COLOUR: "0.6"}
    handles: list[Any] = [
        Patch(facecolor=colour, edgecolor=edge.get(colour, "black"), label=label(name))
        for name, colour in named.items()
    ]
    prescribed = on_mesh(prescribed, mesh, media)
    for held, (marker, offset, where) in _supports(mesh, prescribed).items():
        axes.plot(*(where + unit * np.array(offset)).T, marker, color=SUPPORT, markersize=6, clip_on=False)
        handles.append(Line2D([], [], marker=marker, linestyle="", color=SUPPORT, markersize=6, label=held))
    for arrows in (_moved(mesh, prescribed), _loaded(mesh, media, forces)):
        for head, direction in arrows:
            tail = head - 1.6 * unit * direction
            axes.annotate("", head, tail, arrowprops={"arrowstyle": "-|>", "color": LOAD, "linewidth": 1.6})
    first = [load] if isinstance(load, Condition) else []
    sizes = dict.fromkeys(_size(each) for each in (*first, *prescribed) if each.value)
    sizes |= dict.fromkeys(label(force.name) for force in forces if not isinstance(force, Spring))
    handles.append(Line2D([], [], marker="v", linestyle="-", color=LOAD, label=", ".join(sizes)))
    springs = [_some(mesh, force.where, 7) for force in forces if isinstance(force, Spring)]
    if springs:
        style = {"marker": "s", "linestyle": "", "color": SUPPORT, "markersize": 6, "fillstyle": "none"}
        axes.plot(*np.concatenate(springs).T, clip_on=False, **style)
        handles.append(Line2D([], [], label="spring", **style))
    for n, (name, probe) in enumerate((name, probe) for name, probe in probes.items() if probe.places):
        style = {"marker": "o", "linestyle": "-" if isinstance(probe, Gap) else "", "color": PROBES[n % len(PROBES)]}
        axes.plot(*np.array([_place(mesh, at) for at in probe.places]).T, markersize=4, linewidth=1.2, **style)
        handles.append(Line2D([], [], label=label(name), **style))
    if len(corners):
        cross = {"marker": "x", "linestyle": "", "color": CORNER, "markersize": 7}
        axes.plot(*np.transpose(corners), **cross)
        handles.append(Line2D([], [], label="sharp corner", **cross))
    axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.02), ncols=6, fontsize=9, frameon=False)
    axes.set_ylim(points[:, 1].min() - 2 * unit, points[:, 1].max() + 2 * unit)
    axes.set_xlim(points[:, 0].min() - 2 * unit, points[:, 0].max() + 2 * unit)
    return figure


def _place(mesh: PolygonMesh, at: Place) -> NDArray[np.float64]:
    return np.asarray(mesh.points_vx[mesh.named_points[at]] if isinstance(at, str) else at)


Arrows = list[tuple[NDArray[np.float64], NDArray[np.float64]]]


def _size(condition: Condition) -> str:
    """A displacement that is prescribed, for the legend."""
    if isinstance(condition, PrescribedRotation):
        return f"rotation by {condition.degrees:g}\N{DEGREE SIGN}"
    axis = "xy"[condition.component] if isinstance(condition, Prescribed) else condition.direction[0]
    return f"$u_{axis}$ = {condition.value:g}"


def _moved(mesh: PolygonMesh, prescribed: Sequence[Condition]) -> Arrows:
    """Heads and directions of arrows for displacements other than 0."""
    found: Arrows = []
    for condition in prescribed:
        for x in _some(mesh, condition.where, 7) if condition.value else ():
            if isinstance(condition, PrescribedRotation):
                arm = x - np.asarray(condition.about)
                direction = np.array([-arm[1], arm[0]])
            else:
                direction = np.array(condition.axes[0])
            length = np.hypot(*direction)
            if length > 0.0:
                found.append((x, direction / length * math.copysign(1.0, condition.value)))
    return found


def _loaded(mesh: PolygonMesh, media: Collection[str], forces: Sequence[Force]) -> Arrows:
    """Heads and directions of arrows for forces; a body force has one, in the middle of each of its regions."""
    found: Arrows = []
    for force in forces:
        if isinstance(force, Spring):
            continue
        if isinstance(force, CavityPressure | FollowerPressure):
            found += _pressed(mesh, media, force)
            continue
        vector = np.array(force.traction if isinstance(force, Traction) else force.force)
        if isinstance(force, BodyForce):
            numbers = [mesh.region_names.index(name) for name in force.regions]
            cells = [mesh.cell(c) for c in np.flatnonzero(np.isin(mesh.region_c, numbers)).tolist()]
            places = [np.mean([mesh.points_vx[cell].mean(axis=0) for cell in cells], axis=0)]
        else:
            places = list(_some(mesh, force.where, 7))
        length = np.hypot(*vector)
        found += [(x, vector / length) for x in places if length > 0.0]
    return found


def _pressed(mesh: PolygonMesh, media: Collection[str], force: CavityPressure | FollowerPressure) -> Arrows:
    """Arrows in the middle of some edges, against the body that they bound."""
    pairs = np.asarray(mesh.named_edges[force.where])
    some = pairs[np.unique(np.linspace(0, len(pairs) - 1, 9).astype(int))]
    found: Arrows = []
    for pair in some:
        (normal,) = normals_of(mesh, pair[None], media)
        found.append((mesh.points_vx[pair].mean(axis=0), -math.copysign(1.0, force.pressure) * normal))
    return found


def _supports(mesh: PolygonMesh, prescribed: Sequence[Condition]) -> dict[str, tuple[str, tuple[float, float], Any]]:
    """Marker, its offset and places by what is fixed there; of many places, some."""
    held: dict[str, set[int]] = {}
    for condition in prescribed:
        for axis in () if condition.value else condition.axes:
            held.setdefault(condition.where, set()).add(int(axis[0] == 0.0) if 0.0 in axis else ACROSS)
    found: dict[str, tuple[str, tuple[float, float], Any]] = {}
    for components, what, marker, offset in (
        ({0, 1}, "fixed", "s", (0.0, 0.0)),
        ({0}, "fixed in x", ">", (-0.35, 0.0)),
        ({1}, "fixed in y", "^", (0.0, -0.35)),
        ({ACROSS}, "fixed across or along", "o", (0.0, 0.0)),
    ):
        places = [_some(mesh, where, 12) for where, fixed in held.items() if fixed == components]
        if places:
            found[what] = (marker, offset, np.concatenate(places))
    return found


def draw_meshes(meshes: Sequence[tuple[str, PolygonMesh]], media: Collection[str]) -> Any:
    """Figure with a panel for each mesh, whose regions ``media`` are third medium."""
    extent = np.ptp(np.asarray(meshes[0][1].points_vx), axis=0)
    figure, panels = _panels(len(meshes), extent, width=10.0, height=(0.8, 4.0), margin=0.3)
    for axes, (title, mesh) in zip(panels, meshes, strict=True):
        _fill(axes, mesh, media, edges=True)
        axes.autoscale_view()
        axes.set_title(label(title), fontsize=9)
    return figure


def _panels(n: int, extent: NDArray[np.float64], width: float, height: tuple[float, float], margin: float) -> Any:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    columns = 1 if extent[0] > WIDE * extent[1] else min(n, 3)
    rows = math.ceil(n / columns)
    panel = float(np.clip(width / columns * extent[1] / extent[0], *height)) + margin
    figure = Figure(figsize=(width, rows * panel), layout="constrained")
    FigureCanvasAgg(figure)
    panels = list(figure.subplots(rows, columns, squeeze=False).flat)
    for axes in panels:
        axes.set_axis_off()
        axes.set_aspect("equal")
    return figure, panels[:n]


def _fill(axes: Any, mesh: PolygonMesh, media: Collection[str], *, edges: bool) -> None:
    from matplotlib.collections import LineCollection, PolyCollection

    points = np.asarray(mesh.points_vx)
    cells = [np.asarray(cell) for cell in mesh.cells()]
    for number, colour in enumerate(region_colours(mesh.region_names, media).values()):
        chosen = np.flatnonzero(np.asarray(mesh.region_c) == number)
        collection = PolyCollection(
            [points[cells[c]] for c in chosen],
            facecolors=colour,
            edgecolors="0.55" if edges else colour,
            linewidths=float(np.clip(8.0 / math.sqrt(len(cells)), 0.05, 0.4)) if edges else 0.8,
            rasterized=True,
        )
        axes.add_collection(collection)
    inside = np.array([name not in media for name in mesh.region_names])[np.asarray(mesh.region_c)]
    lines = border_lines(np.asarray(mesh.cell_offsets), np.asarray(mesh.cell_vertices), inside, points)
    axes.add_collection(LineCollection(lines, colors="black", linewidths=0.9, capstyle="round"))


def region_colours(names: Sequence[str], media: Collection[str]) -> dict[str, str]:
    """Colour of each region, in their order."""
    solids = [name for name in names if name not in media]
    return {name: MEDIUM_COLOUR if name in media else SOLIDS[solids.index(name) % len(SOLIDS)] for name in names}


def _some(mesh: PolygonMesh, where: str, n: int) -> NDArray[np.float64]:
    """(m, 2) n places along named edges, or one for each piece if there are several; or a named point."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    if where in mesh.named_points:
        return np.asarray(mesh.points_vx)[[mesh.named_points[where]]]
    vertices, edges = np.unique(np.asarray(mesh.named_edges[where]), return_inverse=True)
    start, end = edges.reshape(-1, 2).T
    graph = coo_array((np.ones(len(start)), (start, end)), shape=(len(vertices), len(vertices)))
    count, piece = connected_components(graph, directed=False)
    chosen = []
    for number in range(count):
        points = np.asarray(mesh.points_vx)[vertices[piece == number]]
        points = points[np.argsort(points[:, np.argmax(np.ptp(points, axis=0))])]
        length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
        at = length[-1] * (np.linspace(0.0, 1.0, n) if count == 1 else np.array([0.5]))
        chosen.append(np.column_stack([np.interp(at, length, points[:, x]) for x in (0, 1)]))
    return np.concatenate(chosen)
