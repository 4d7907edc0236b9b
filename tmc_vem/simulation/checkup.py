"""What there is to say about a problem before it is run: all that a run checks, and what it consists of.

Nothing is compiled or solved, and PETSc is not loaded: it takes a second or two. Energies of the user's own are
compiled, as only that shows all that can be wrong with them; the run finds their kernels in the cache.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, is_dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.energy import MEDIA, REGULARISERS, energy_name
from tmc_vem.energy.mixed import STIFFNESS
from tmc_vem.mesh.locate import TOLERANCE, find_cells
from tmc_vem.mesh.make.split import split_quadrilaterals
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems.base import Problem, forces_of, media_of
from tmc_vem.problems.design_region import UniformStiffness, design_regions
from tmc_vem.problems.examine import examine
from tmc_vem.problems.hints import THIN, hints
from tmc_vem.problems.inventory import (
    Corner,
    Part,
    RegionCount,
    Width,
    count_nodes,
    count_regions,
    narrowest,
    parts,
    said_of,
    sharp_corners,
    vertices_loaded,
)
from tmc_vem.problems.probes import Gap, check_probes
from tmc_vem.simulation.adapt_settings import AdaptSettings
from tmc_vem.simulation.adaptable import fitted, require_adaptable
from tmc_vem.simulation.discretised import fault_at_start
from tmc_vem.simulation.options import RunOptions
from tmc_vem.simulation.plan import control_path, loads_of, order_of
from tmc_vem.simulation.simulation import arc_of, prepare, stepping_of
from tmc_vem.support.errors import InputError
from tmc_vem.system.forces import Spring
from tmc_vem.system.places import outside

Float = NDArray[np.float64]

# Names of the media that the program has; solids have a material.
KNOWN = {
    energy_name(regulariser, damped, medium)
    for regulariser in REGULARISERS.values()
    for damped in (False, True)
    for medium in MEDIA
}
# Cells that a gap needs across; with one, no node of the medium is inside it.
ENOUGH = 2


@dataclass(frozen=True)
class Load:
    """Something that moves or loads the body.

    Attributes:
        name: that it is reported by; empty for one displacement alone.
        what: its kind, as problem files call it: ``ux``, ``force``, ``cavity_pressure``, ...
        at: name of the point or edges, or of regions.
        value: where its amplitude is 1, a number or both components.
        n_vertices: vertices of the mesh that it is at.
    """

    name: str
    what: str
    at: str
    value: float | tuple[float, float]
    n_vertices: int


@dataclass(frozen=True)
class Checkup:
    """A problem that passes all checks of a run, and what it consists of.

    Attributes:
        name: of the problem.
        method, order: of the elements.
        n_cells, n_nodes, n_dofs: sizes; degrees of freedom include constrained ones.
        regions: their sizes; nodes on interfaces count in every region that has them.
        gaps: narrowest gap between any two bodies.
        parts: solids that hang together, with the conditions on them.
        corners: sharp ones of solids that face medium.
        materials: what regions are made of, by region: name of the energy, moduli at small strains, parameters.
        loads: what moves and loads it, the one that is reported first at the beginning.
        path: load factors, or times, that are gone through.
        steps: equal ones, or None for automatic steps.
        probes: what is measured, by name, in words; of distances also what they are before loading.
        cautions: what may go wrong, each with its remedy.
        problem, mesh: what was looked at.
    """

    name: str
    method: str
    order: int
    n_cells: int
    n_nodes: int
    n_dofs: int
    regions: tuple[RegionCount, ...]
    gaps: tuple[Width, ...]
    parts: tuple[Part, ...]
    corners: tuple[Corner, ...]
    materials: dict[str, dict[str, Any]]
    loads: tuple[Load, ...]
    path: tuple[float, ...]
    steps: int | None
    probes: dict[str, dict[str, Any]]
    cautions: tuple[str, ...]
    problem: Problem = field(repr=False)
    mesh: PolygonMesh = field(repr=False)

    def as_dict(self) -> dict[str, Any]:
        """Everything but problem and mesh, as plain values."""
        return {key: _plain(getattr(self, key)) for key in self.__dataclass_fields__ if key not in ("problem", "mesh")}

    def figure(self) -> Any:
        """Picture of mesh, regions, supports, load, probes and sharp corners, a matplotlib figure."""
        from tmc_vem.report.problem_figure import draw_problem

        problem = self.problem
        corners = [corner.place for corner in self.corners]
        return draw_problem(
            self.mesh, media_of(problem), problem.prescribed(), problem.load(), problem.probes(), forces_of(problem),
            cells=True, corners=corners,
        )  # fmt: skip


def check(problem: Problem, options: RunOptions | None = None) -> Checkup:
    """Check a problem as a run would before its first load step, and say what it consists of.

    Args:
        problem: what would be solved.
        options: how.

    Raises:
        InputError: a run would not begin.
        CodegenError: an energy is no function that kernels could be made of.
    """
    options = options or RunOptions()
    is_adapted = bool(options.adapt.names)
    if is_adapted:
        require_adaptable(problem, options)
        options = replace(options, adapt=AdaptSettings())
    control_path(problem, options)
    _require_steps(options)
    problem, mesh = fitted(problem) if is_adapted else (problem, problem.make_mesh())
    loads = loads_of(problem, options)
    cautions = examine(problem, mesh, (*loads, *options.output_loads))
    check_probes(problem.probes(), problem.prescribed(), tuple(problem.regions()))
    initial = _distances(problem, mesh)
    solved, inside = _elements(mesh, options)
    if _has_own_energy(problem) or fault_at_start(problem):
        prepare(problem, None, options)
    order = order_of(options)
    gaps = narrowest(mesh, problem.regions())
    known = hints(mesh, problem.regions(), problem.prescribed(), loads)
    said = {hint.regions[0] for hint in known if hint.kind == THIN}  # by the examination
    cautions += [_too_few(gap) for gap in gaps if gap.n_cells < ENOUGH and gap.medium not in said]
    n_nodes = count_nodes(solved, order, inside)
    return Checkup(
        name=problem.name,
        method=options.method,
        order=order,
        n_cells=solved.n_cells,
        n_nodes=n_nodes,
        n_dofs=2 * n_nodes,
        regions=tuple(count_regions(solved, order, inside)),
        gaps=tuple(gaps),
        parts=tuple(parts(mesh, problem.regions(), problem.prescribed(), forces_of(problem))),
        corners=tuple(sharp_corners(mesh, problem.regions())),
        materials=_materials(problem),
        loads=_loads(problem, mesh),
        path=loads,
        steps=options.steps,
        probes={
            name: {"what": str(probe), **({"initially": initial[name]} if name in initial else {})}
            for name, probe in problem.probes().items()
        },
        cautions=tuple(cautions),
        problem=problem,
        mesh=mesh,
    )


def _require_steps(options: RunOptions) -> None:
    """Check what only a solver knows, which takes a moment to load: no more than is not as usual.

    Raises:
        InputError: steps or solver are not there to be had.
    """
    if options.steps is not None:
        stepping_of(options)
    if options.follow:
        arc_of(options)
    if options.solver != RunOptions.solver:
        from tmc_vem.solve.linear import read_options

        read_options(options.solver)


def _elements(mesh: PolygonMesh, options: RunOptions) -> tuple[PolygonMesh, int]:
    """The cells that are solved on, and how many nodes each has inside.

    Raises:
        InputError: the elements that are asked for do not work on these cells.
    """
    order = order_of(options)
    if options.method == "fem":
        from tmc_vem.fem.mesh import as_elements

        as_elements(mesh, options.fem.triangles)
        solved = split_quadrilaterals(mesh)[0] if options.fem.triangles else mesh
        return solved, (order - 1) * (order - 2) // 2 if solved.n_sides_c[0] == 3 else (order - 1) ** 2
    if options.element.degree is not None or options.element.projection != "auto":
        from tmc_vem.vem.spaces.element import build_elements

        build_elements(mesh, options.element)
    return mesh, order * (order - 1) // 2


def _distances(problem: Problem, mesh: PolygonMesh) -> dict[str, float]:
    """Initial distances of the points of gaps, by name of the probe.

    Raises:
        InputError: a point of a probe is not there.
    """
    found = {}
    loops = [mesh.points_vx[loop] for loop in mesh.cells()]
    extent = float(np.ptp(mesh.points_vx, axis=0).max())
    for name, probe in problem.probes().items():
        places = []
        for place in probe.places:
            if isinstance(place, str):
                places.append(mesh.points_vx[_vertex(mesh, place, name)])
                continue
            places.append(np.array(place))
            cells = find_cells(loops, np.arange(mesh.n_cells), places[-1][None], TOLERANCE * extent)
            if cells.distance_n[0] > TOLERANCE * extent:
                away = float(cells.distance_n[0])
                raise outside(f"probes: {name}: point", places[-1], away, cells.nearest_nx[0])
        if isinstance(probe, Gap):
            found[name] = float(np.hypot(*(places[0] - places[1])))
    return found


def _vertex(mesh: PolygonMesh, place: str, name: str) -> int:
    try:
        return mesh.named_vertex(place)
    except InputError as error:
        raise InputError(f"probes: {name}: {error}") from None


def _too_few(gap: Width) -> str:
    x, y = gap.place
    between = f"between {gap.solids[0]} and {gap.solids[1]}" if len(set(gap.solids)) > 1 else f"within {gap.solids[0]}"
    return (
        f"region '{gap.medium}' has a single cell across the gap of {gap.width:.3g} {between} at ({x:.4g}, {y:.4g}): "
        f"use cells of size {gap.width / ENOUGH:.3g} or less there, refine = [{{ near = [{x:.4g}, {y:.4g}], size = "
        f"{gap.width / ENOUGH:.3g} }}], or fit = true"
    )


def _materials(problem: Problem) -> dict[str, dict[str, Any]]:
    found: dict[str, dict[str, Any]] = {}
    designs = design_regions(problem.regions())
    for name, region in problem.regions().items():
        is_design = name in designs
        found[name] = {"energy": region.energy.name, "medium": region.is_medium and not is_design}
        if is_design:
            found[name]["design"] = True
        if region.moduli is not None:
            K, mu, nu = region.moduli.K, region.moduli.mu, region.moduli.nu
            found[name] |= {"K": K, "mu": mu, "E": 2.0 * mu * (1.0 + nu), "nu": nu}
        found[name]["parameters"] = dict(region.values)
        if isinstance(region.graded, UniformStiffness):
            found[name]["parameters"][STIFFNESS] = region.graded.value
        if (friction := region.friction) is not None:
            found[name]["friction"] = {"friction": friction.coefficient, "elastic_slip": friction.elastic_slip}
    return found


def _loads(problem: Problem, mesh: PolygonMesh) -> tuple[Load, ...]:
    """The load that is reported first, others that have names, and forces; springs hold."""
    first, found = problem.load(), []
    named = [each for each in problem.prescribed() if each.name]
    acting = [each for each in forces_of(problem) if not isinstance(each, Spring)]
    for each in (first, *(other for other in (*named, *acting) if other != first)):
        what, at, value = said_of(each)
        found.append(Load(each.name, what, at, value, len(vertices_loaded(mesh, each))))
    return tuple(found)


def _has_own_energy(problem: Problem) -> bool:
    """Whether a region has an energy that is none of the program's."""
    return any(
        region.material is None and region.energy.name.removesuffix("_log_j") not in KNOWN
        for name, region in problem.regions().items()
        if name not in design_regions(problem.regions())
    )


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_plain(entry) for entry in value]
    if is_dataclass(value) and not isinstance(value, type):
        return {key: _plain(entry) for key, entry in asdict(value).items()}
    return value
