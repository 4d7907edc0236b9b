"""Triangle meshes by gmsh: of regions given by their outlines, and of any gmsh model with physical groups."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.cell_count import QUADRILATERALS, TRIANGLES
from tmc_vem.mesh.files.geo import write_model
from tmc_vem.mesh.files.io import read_mesh
from tmc_vem.mesh.make.estimate import check_size
from tmc_vem.mesh.make.far import meshed_near_origin
from tmc_vem.mesh.make.outline import Point, Region, Size, Skeleton, evaluate_size, make_skeleton
from tmc_vem.mesh.parts import with_names
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.c_stdout import c_stdout_on_stderr
from tmc_vem.support.environment import cells_allowed
from tmc_vem.support.errors import InputError
from tmc_vem.support.notes import say
from tmc_vem.support.optional import load

Int = NDArray[np.int64]

FRONTAL_DELAUNAY = 6


@meshed_near_origin
def triangle_mesh(
    regions: Sequence[Region], size: Size, points: Mapping[str, Point] | None = None, *, quadrilaterals: bool = False,
    most_cells: float | None = None,
) -> PolygonMesh:  # fmt: skip
    """Triangles, or quadrilaterals where triangles recombine well, that have all interfaces as edges.

    Args:
        regions: outlines; shared curves become interfaces.
        size: length of edges, a number or a function of points (n, 2).
        points: names for places on the outlines; each becomes a vertex.
        quadrilaterals: recombine triangles to quadrilaterals; few triangles may remain.
        most_cells: how many there may be; None for what the environment says, or a million.

    Raises:
        InputError: gmsh is missing, outlines do not close, the size is not positive or makes too many cells, or gmsh
            refuses the geometry.
    """
    density = QUADRILATERALS if quadrilaterals else TRIANGLES
    check_size(regions, size, density, cells_allowed(most_cells))
    skeleton = make_skeleton(regions, size, points)
    gmsh = load("gmsh", "triangles need")
    started = _start(gmsh)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.add("regions")
    try:
        _build(gmsh, regions, skeleton, size)
        gmsh.option.setNumber("Mesh.Algorithm", FRONTAL_DELAUNAY)
        gmsh.option.setNumber("Mesh.RecombineAll", 1.0 if quadrilaterals else 0.0)
        gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
        with c_stdout_on_stderr():  # quadrilaterals make gmsh print there, whatever it is told
            gmsh.model.mesh.generate(2)
        mesh = from_gmsh_model()
    except InputError:
        raise
    except Exception as error:  # gmsh raises plain exceptions
        raise InputError(f"gmsh cannot mesh these outlines: {error}") from None
    finally:
        gmsh.model.remove()
        gmsh.option.setNumber("Mesh.RecombineAll", 0.0)
        if started:
            gmsh.finalize()
    named = {name: tuple(skeleton.nodes_nx[node].tolist()) for name, node in skeleton.names.items()}
    return with_names(mesh, named)


def from_gmsh_model(**reading: Any) -> PolygonMesh:
    """The current gmsh model's mesh: physical surfaces are regions, physical curves and points named edges and points.

    Args:
        reading: more arguments of :func:`tmc_vem.mesh.files.io.read_mesh`, such as ``names``.

    Raises:
        InputError: the model has no mesh of plane cells.
    """
    gmsh = load("gmsh", "the mesh of a gmsh model needs")
    called = reading.pop("called", "the mesh of gmsh")
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "model.msh"
        for note in write_model(gmsh, path):
            say(f"{called}: {note}")
        return read_mesh(path, called=called, **reading)


def mesh_geometry(path: str | Path, **reading: Any) -> PolygonMesh:
    """Mesh of a gmsh geometry (.geo): :func:`tmc_vem.mesh.files.io.read_mesh` of it."""
    return read_mesh(path, **reading)


def _start(gmsh: Any) -> bool:
    """Start gmsh if it is not running (then it has a model; 4.8 has no other way to ask); True if it was started."""
    try:
        if gmsh.model.list():
            return False
    except Exception:  # after it was stopped
        pass
    gmsh.initialize([])
    return True


def _build(gmsh: Any, regions: Sequence[Region], skeleton: Skeleton, size: Size) -> None:
    """Geometry of straight segments between the skeleton's nodes, one edge each."""
    h = evaluate_size(size, skeleton.nodes_nx)
    geo = gmsh.model.geo
    points = [geo.addPoint(x, y, 0.0, s) for (x, y), s in zip(skeleton.nodes_nx.tolist(), h.tolist(), strict=True)]
    lines = {}
    for a, b in skeleton.segments_sn.tolist():
        lines[a, b] = geo.addLine(points[a], points[b])
        lines[b, a] = -lines[a, b]
        geo.mesh.setTransfiniteCurve(lines[a, b], 2)
    surfaces: dict[str, list[int]] = {}
    for region in regions:
        loops = [geo.addCurveLoop([lines[pair] for pair in loop]) for loop in _loops(region, skeleton)]
        surfaces.setdefault(region.name, []).append(geo.addPlaneSurface(loops))
    geo.synchronize()
    for name, tags in surfaces.items():
        gmsh.model.setPhysicalName(2, gmsh.model.addPhysicalGroup(2, tags), name)

    def callback(dimension: int, tag: int, x: float, y: float, z: float, lc: float = 0.0) -> float:
        return float(evaluate_size(size, np.array([[x, y]]))[0])

    gmsh.model.mesh.setSizeCallback(callback)


def _loops(region: Region, skeleton: Skeleton) -> list[list[tuple[int, int]]]:
    """The region's outline and holes as chains of segments, the outline first."""
    chains = []
    tolerance = 1e-9 * float(np.ptp(skeleton.nodes_nx, axis=0).max())
    middle = skeleton.nodes_nx[skeleton.segments_sn]
    for loop in (region.outline, *region.holes):
        curves = region._loop(loop)
        pairs: list[tuple[int, int]] = []
        for curve in curves:
            on = [
                s
                for s in range(len(middle))
                if all(curve.parameter_of(tuple(end))[1] <= tolerance for end in middle[s].tolist())
                and not _bypasses(curve, middle[s])
            ]
            ordered = []
            for s in on:
                t = [curve.parameter_of(tuple(end))[0] for end in middle[s].tolist()]
                a, b = skeleton.segments_sn[s].tolist()
                ordered.append((min(t), (a, b) if t[0] < t[1] else (b, a)))
            pairs += [pair for _, pair in sorted(ordered)]
        chains.append(pairs)
    return chains


def _bypasses(curve: Any, ends: NDArray[np.float64]) -> bool:
    """Whether a segment joins two places on the curve without following it, as a chord across an arc does."""
    t = [curve.parameter_of(tuple(end))[0] for end in ends.tolist()]
    along = abs(t[1] - t[0]) * curve.length
    return bool(along > 1.3 * np.hypot(*(ends[1] - ends[0])))
