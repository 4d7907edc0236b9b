"""From the densities of a design to a body-fitted problem: solid parts with real void between them as third medium.

Optimisation knows a design as densities, which are neither solid nor void where it matters: in slits that close, at
surfaces that touch. The extracted problem has the outlines of the design as edges of its mesh, the same loads, supports
and probes, and nothing in between; what it gives is the number to trust.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.design.extract_mesh import fitted_mesh
from tmc_vem.design.extract_options import ExtractOptions
from tmc_vem.design.outline import density_field, polygons_of
from tmc_vem.design.outline_clean import cleaned
from tmc_vem.design.outline_domain import Domain, vertex_places
from tmc_vem.design.outline_faces import faces_by_name, regions_of
from tmc_vem.design.outline_smooth import Smoother
from tmc_vem.mesh.cells import centroids_and_areas
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems.description import MediumTable, ProblemTable, RegionTable
from tmc_vem.problems.materials import Material
from tmc_vem.problems.mesh_tables import MeshTable
from tmc_vem.problems.own import OwnProblem
from tmc_vem.problems.probe_table import ProbeTable
from tmc_vem.problems.probes import Displacement, Gap, Position
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]

SOLID, MEDIUM = "solid", "medium"
# Loads that hold what they act on.
HOLDING = ("ux", "uy", "normal", "tangential", "rotation")


@dataclass(frozen=True)
class DesignMaterials:
    """What a design region is made of where its density is 1, and where it is 0.

    Attributes:
        solid: the solid.
        medium: the third medium in void.
        hold: as of a region: ``"medium"`` if the solid may have no supports of its own.
    """

    solid: Material
    medium: MediumTable
    hold: str | None = None


@dataclass(frozen=True)
class Outlines:
    """The solid of a design by its outlines.

    Attributes:
        faces: shapely MultiPolygons of all regions of the new mesh, by name, which share the vertices of their borders.
        solid: those of the design's solids together.
        level: density from which on a place is solid.
        cell: size of the design's cells, a length.
        volume_densities: sum of density times area over the design cells.
        volume_level: area within the level line.
        volume_cleaned: area without specks, narrow gaps and loose parts.
        volume: area after smoothing.
        parts: number of connected parts of the solid, passive solids that it hangs on not counted apart.
        holes: number of holes in it.
        notes: a sentence for each kind of change.
    """

    faces: Mapping[str, Any]
    solid: Any
    level: float
    cell: float
    volume_densities: float
    volume_level: float
    volume_cleaned: float
    volume: float
    parts: int
    holes: int
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Extracted:
    """A body-fitted problem, to be written.

    Attributes:
        table: its description; the mesh is a file beside it.
        mesh: its mesh.
        outlines: where it is solid, and how that came.
        volume_mesh: area of the design's solids in the mesh, whose edges are chords of the outlines.
        notes: a sentence for everything that is not as the densities are.
        directory: what other files in the description are relative to: that of the design problem.
    """

    table: ProblemTable
    mesh: PolygonMesh
    outlines: Outlines
    volume_mesh: float
    notes: tuple[str, ...]
    directory: Path


def contour(
    domain: Domain, density_c: Float, names: Mapping[str, tuple[str, str]], options: ExtractOptions
) -> Outlines:
    """Outlines of a design.

    Args:
        domain: its mesh, with what is around and what is held.
        density_c: (n_cells,) densities from 0 to 1; those of passive cells are not read.
        names: of each design region, what its solid and its void are called.
        options: what is removed, smoothed and kept.

    Raises:
        InputError: nothing is solid, it is not connected to a support, a load acts on nothing, or smoothing changes the
            volume by too much.
    """
    mesh = domain.mesh
    design_c = np.isin(mesh.region_c, [mesh.region_names.index(name) for name in domain.design])
    field = density_field(mesh, density_c, design_c)
    level = field.level_of_volume() if options.level is None else options.level
    raw, cell = field.solids(level), field.cell_size
    clean = cleaned(raw, domain, cell, options)
    places = vertex_places(mesh, [*domain.held, *domain.loaded])
    places += [place for name in (*domain.held, *domain.loaded) for place in domain.ends_of_edges(name)]
    smoother = Smoother(clean.solid, domain, cell, options, places)
    lines = smoother.smooth()
    faces = faces_by_name(smoother, lines, names)
    solid = polygons_of_all([faces[solid] for solid, _ in names.values() if solid in faces])
    domain.require_touched([*solid.geoms, *domain.solids.geoms])
    return Outlines(
        faces, solid, level, cell, field.volume, float(raw.area), float(clean.solid.area), float(solid.area),
        len(solid.geoms), sum(len(part.interiors) for part in solid.geoms), clean.notes,
    )  # fmt: skip


def polygons_of_all(parts: Sequence[Any]) -> Any:
    """Union of shapely geometries as a MultiPolygon."""
    import shapely

    return polygons_of(shapely.union_all(list(parts)))


def extracted_problem(
    problem: OwnProblem,
    mesh: PolygonMesh,
    density_c: Float,
    materials: Mapping[str, DesignMaterials],
    options: ExtractOptions | None = None,
) -> Extracted:
    """The body-fitted problem of a design.

    Args:
        problem: the design problem.
        mesh: its mesh, with the names of the description.
        density_c: (n_cells,) densities from 0 to 1; those of passive cells are not read.
        materials: of every design region, by its name.
        options: of outlines and mesh.

    Raises:
        InputError: the design has no outlines that can be meshed, see :func:`contour`, or a passive region varies with
            cell data of the design's mesh.
    """
    return extracted_problems({"": problem}, mesh, density_c, materials, options)[""]


def extracted_problems(
    problems: Mapping[str, OwnProblem],
    mesh: PolygonMesh,
    density_c: Float,
    materials: Mapping[str, DesignMaterials],
    options: ExtractOptions | None = None,
) -> dict[str, Extracted]:
    """The body-fitted problems of a design with several load cases, which have one mesh.

    Args:
        problems: the design problem with the loads of each case, by its name; their regions are the same.
        mesh, density_c, materials, options: as in :func:`extracted_problem`.

    Raises:
        InputError: as there.
    """
    options, first = options or ExtractOptions(), next(iter(problems.values()))
    passive = {name: region for name, region in first.table.regions.items() if name not in materials}
    for name, region in passive.items():
        data = {each for number in region.graded for each in region.cell_data(number)}
        if data:
            raise InputError(
                f"regions: {name}: graded by '{min(data)}' of the design's mesh, which the new mesh does not have: use "
                "a formula of x and y"
            )
    energies = {name: region.is_medium for name, region in first.regions().items()}
    solids = tuple(name for name in passive if not energies[name])
    places = [_places(problem.table) for problem in problems.values()]
    held, loaded = (tuple(dict.fromkeys(name for of in places for name in of[n])) for n in (0, 1))
    unnamed: set[str] = set()
    for problem in problems.values():
        mesh, more = _with_probed(problem, mesh)
        unnamed |= more
    domain = Domain(mesh, tuple(name for name in mesh.region_names if name in materials), solids, held, loaded)
    names = _names(materials, passive)
    outlines = contour(domain, np.asarray(density_c, dtype=float), names, options)
    corners = [(x, y) for x, y in mesh.points_vx[sorted(domain.corners)].tolist()]
    fitted, note = fitted_mesh(regions_of(outlines.faces, corners), domain, outlines.cell, options)
    points = {name: vertex for name, vertex in fitted.named_points.items() if name not in unnamed}
    fitted = replace(fitted, named_points=points, validate=False)
    volume = _area(fitted, [solid for solid, _ in names.values()])
    notes = (*outlines.notes, note) if note else outlines.notes
    found = {}
    for case, problem in problems.items():
        table = problem.table
        made = _renamed(table, names, _regions(table, materials, names, fitted))
        found[case] = Extracted(made, fitted, outlines, volume, notes, problem.directory)
    return found


def _names(materials: Mapping[str, DesignMaterials], passive: Mapping[str, RegionTable]) -> dict[str, tuple[str, str]]:
    """What solid and void of every design region are called: as short as passive regions and each other leave it."""
    found = {}
    for design, made in materials.items():
        short = len(materials) == 1
        solid = SOLID if short and SOLID not in passive else f"{design}_{SOLID}"
        same = MEDIUM in passive and passive[MEDIUM].medium == made.medium and not passive[MEDIUM].graded
        medium = MEDIUM if short and (same or MEDIUM not in passive) else f"{design}_{MEDIUM}"
        for name in (solid, medium):
            if name in passive and name != MEDIUM:
                raise InputError(
                    f"regions: '{name}' is the name of a part of '{design}': call the passive region otherwise"
                )
        found[design] = (solid, medium)
    return found


def _places(table: ProblemTable) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of points and edges where something is held, and of those where a force acts."""
    holding = [load.at for load in table.loads if load.at is not None and load.kind in HOLDING]
    loading = [load.at for load in table.loads if load.at is not None and load.kind not in HOLDING]
    held = [*(support.at for support in table.support), *(spring.at for spring in table.spring), *holding]
    return tuple(dict.fromkeys(held)), tuple(dict.fromkeys(loading))


def _with_probed(problem: OwnProblem, mesh: PolygonMesh) -> tuple[PolygonMesh, set[str]]:
    """The mesh with names for the points that probes need as vertices and give by coordinates, and these names."""
    moved = [probe for probe in problem.probes().values() if isinstance(probe, Displacement | Position | Gap)]
    places = [place for probe in moved for place in probe.places if not isinstance(place, str)]
    added = {f"probed at ({x!r}, {y!r})": mesh.find_vertex(x, y) for x, y in places}
    return replace(mesh, named_points={**added, **mesh.named_points}, validate=False), set(added) - {*mesh.named_points}


def _regions(
    table: ProblemTable,
    materials: Mapping[str, DesignMaterials],
    names: Mapping[str, tuple[str, str]],
    mesh: PolygonMesh,
) -> dict[str, RegionTable]:
    """Tables of all regions of the new mesh."""
    found = {}
    for name, region in table.regions.items():
        if name in materials:
            made, (solid, medium) = materials[name], names[name]
            found[solid] = RegionTable(solid=made.solid, hold=made.hold)
            found[medium] = RegionTable(medium=made.medium)
        else:
            found[name] = replace(region, shape=None)
    return {name: region for name, region in found.items() if name in mesh.region_names}


def _renamed(
    table: ProblemTable, names: Mapping[str, tuple[str, str]], regions: Mapping[str, RegionTable]
) -> ProblemTable:
    """The description with a mesh file, and with design regions called as their solids where they are named."""
    called = {design: solid for design, (solid, _) in names.items()}

    def bodies(of: str) -> str:
        for design, solid in called.items():
            of = re.sub(rf"(?<!\w){re.escape(design)}(?!\w)", solid, of)
        return of

    def probe(each: ProbeTable) -> ProbeTable:
        region = None if each.region is None else called.get(each.region, each.region)
        return replace(each, region=region, of=None if each.of is None else bodies(each.of))

    loads = tuple(
        load if load.regions is None else replace(load, regions=tuple(called.get(r, r) for r in load.regions))
        for load in table.loads
    )
    load = table.load if not isinstance(table.load, tuple) and loads[0] == table.loads[0] else loads
    return replace(
        table,
        name=f"{table.name}, extracted",
        regions=regions,
        load=load if not isinstance(load, tuple) or isinstance(table.load, tuple) else load[0],
        mesh=MeshTable(file="extracted.vtu"),
        shapes={},
        points={},
        edges={},
        probes={name: probe(each) for name, each in table.probes.items()},
    )


def _area(mesh: PolygonMesh, names: Sequence[str]) -> float:
    chosen = np.isin(mesh.region_c, [mesh.region_names.index(name) for name in names if name in mesh.region_names])
    return float(centroids_and_areas(mesh)[1][chosen].sum())
