"""What a design is worth: load cases solved, objective, volume and limits with derivatives by the variables."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tmc_vem.design.evaluation import Evaluation
from tmc_vem.design.filters import Filter, Within, density_filter
from tmc_vem.design.interpolation import Interpolation, Ramp, Simp
from tmc_vem.design.load_case import SAME, LoadCase, Solved
from tmc_vem.design.masks import in_box, in_circle, in_regions
from tmc_vem.design.projection import Projection
from tmc_vem.design.symmetry import Mirror
from tmc_vem.design.variables import Parametrisation, parametrise
from tmc_vem.mesh.cells import centroids_and_areas
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems.description import ProblemTable
from tmc_vem.problems.design_region import design_regions
from tmc_vem.problems.design_table import VOLUME, DesignTable, FilterTable, LimitTable, PassiveTable
from tmc_vem.problems.own import OwnProblem
from tmc_vem.simulation.options import RunOptions
from tmc_vem.simulation.problem_file import with_changes
from tmc_vem.support import notes
from tmc_vem.support.distributed import Comm
from tmc_vem.support.errors import InputError
from tmc_vem.support.parallel import from_root

Float = NDArray[np.float64]
Bool = NDArray[np.bool_]
Int = NDArray[np.int64]

CELLS_OF_FILTER = 3.0  # its default radius in sizes of cells
# Evaluations after which the load is applied from the beginning too, so that the branch is known to be that of loading.
LOOKED_AT = (10, 20, 40, 80, 160, 320, 640)


@dataclass(frozen=True)
class Worth:
    """What was found for a design.

    Attributes:
        values: results of load cases: objective and limits by name, ``CASE.NAME`` where there are several cases.
        volume: fraction of the design regions.
        iterations: of Newton's method.
        seconds: wall time.
        notes: sentences about it.
    """

    values: Mapping[str, float]
    volume: float
    iterations: int
    seconds: float
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Limit:
    name: str
    case: str
    of: str
    table: LimitTable


class Evaluator:
    """Evaluates designs of a problem; all ranks make and use it together, each with all variables.

    Args:
        problem: with a table ``[design]``.
        options: how its load cases are solved.
        comm: ranks.

    Raises:
        InputError: there is no such table, a load case is wrong or has another mesh, or the design has no cells.

    Attributes:
        table: what is wanted.
        mesh: the whole mesh, on every rank.
        parametrisation: from variables to densities.
        cases: load cases by name.
        wanted: results of each: objective and limits.
        worth: of the last design that was evaluated.
    """

    def __init__(self, problem: OwnProblem, options: RunOptions, comm: Comm) -> None:
        table = problem.table.design
        if table is None:
            raise InputError(
                f"'{problem.name}' has no [design]: say what is to be minimised, for example its compliance"
            )
        self.table, self.problem = table, problem
        self.mesh: PolygonMesh = from_root(comm, problem.make_mesh)
        self.parametrisation = _parametrisation(problem, table, self.mesh)
        limits = {name: limit.of or name for name, limit in table.limits.items()}
        self.wanted = tuple(dict.fromkeys((*(() if table.by_volume else (table.objective,)), *limits.values())))
        self.weights = {case.name: case.weight for case in table.cases} or {"": 1.0}
        self.cases: dict[str, LoadCase] = {}
        for name, changed in _problems(problem, table).items():
            self.cases[name] = LoadCase(name or problem.name, changed, options, self.wanted, comm)
        _require_same_nodes(self.cases)
        self._limits = [_Limit(name, case, limits[name], table.limits[name]) for name in limits for case in self.cases]
        self.worth: Worth | None = None
        self.evaluations = 0

    @property
    def constraints(self) -> tuple[str, ...]:
        """Names of the constraints."""
        several = len(self.cases) > 1
        named = tuple(f"{each.case}.{each.name}" if several else each.name for each in self._limits)
        return ((VOLUME,) if self.table.volume is not None else ()) + named

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the results in :attr:`Worth.values`."""
        several = len(self.cases) > 1
        return tuple(f"{case}.{of}" if several else of for case in self.cases for of in self.wanted)

    def project(self, projection: Projection | None) -> None:
        """From now on, densities are projected so."""
        self.parametrisation = self.parametrisation.with_projection(projection)

    def start(self) -> Float:
        """Variables (n_variables,) to begin with."""
        table, of = self.table, self.parametrisation
        if table.start is not None:
            z = np.full(of.n_variables, table.start)
        else:
            assert table.volume is not None
            z = of.uniform(min(table.volume, of.volume(np.ones(of.n_variables))))  # of a design that may be all solid
        if table.noise:
            z = z + table.noise * np.random.default_rng(table.seed).uniform(-1.0, 1.0, len(z))
        return np.clip(z, 0.0, 1.0)

    def stiffness(self, z: Float) -> Float:
        """(n_cells of the mesh,) of a design; 0 outside of design regions."""
        stiffness_c = np.zeros(self.mesh.n_cells)
        stiffness_c[self.parametrisation.cells] = self.parametrisation.factors(z)
        return stiffness_c

    def densities(self, z: Float) -> Float:
        """(n_cells of the mesh,) physical densities of a design; not a number outside of design regions."""
        density_c = np.full(self.mesh.n_cells, np.nan)
        density_c[self.parametrisation.cells] = self.parametrisation.physical(z)
        return density_c

    def __call__(self, z: Float) -> Evaluation:
        """Objective and constraints of a design; infinite if a load case has no equilibrium that could be found."""
        began = time.perf_counter()
        self.evaluations += 1
        stiffness_c = self.stiffness(z)
        solved: dict[str, Solved] = {}
        said: list[str] = []
        n_constraints = len(self.constraints)
        for name, case in self.cases.items():
            found = case.solve(stiffness_c)
            if found is not None and not found.from_start and self.evaluations in LOOKED_AT:
                found, note = _looked_at(case, stiffness_c, found)
                said += [note] if note else []
            if found is None:
                volume = self.parametrisation.volume(z)
                why = f": {case.why_not}" if case.why_not else ""
                said.append(f"{case.name}: no equilibrium was found at full load{why}")
                self.worth = Worth({}, volume, 0, time.perf_counter() - began, tuple(said))
                return Evaluation.failed(len(z), n_constraints)
            said += [found.note] if found.note else []
            solved[name] = found
        evaluation = self._evaluation(z, solved)
        several = len(solved) > 1
        values = {
            f"{name}.{of}" if several else of: value
            for name, found in solved.items()
            for of, value in found.values.items()
        }
        iterations = sum(found.iterations for found in solved.values())
        volume = self.parametrisation.volume(z)
        self.worth = Worth(values, volume, iterations, time.perf_counter() - began, tuple(said))
        return evaluation

    # -- parts -----------------------------------------------------------------------------------------------------

    def _evaluation(self, z: Float, solved: Mapping[str, Solved]) -> Evaluation:
        table, of = self.table, self.parametrisation
        objective, slope_c = 0.0, np.zeros(self.mesh.n_cells)
        for name, found in solved.items() if not table.by_volume else ():
            weight = table.sign * self.weights[name]
            objective += weight * found.values[table.objective]
            slope_c += weight * found.by_stiffness[table.objective]
        gradient = of.backward(z, by_factor_c=slope_c[of.cells])
        if table.by_volume:
            objective, gradient = of.volume(z), of.volume_gradient(z)
        values, rows = [], []
        if table.volume is not None:
            values.append(of.volume(z) / table.volume - 1.0)
            rows.append(of.volume_gradient(z) / table.volume)
        for limit in self._limits:
            found, bound = solved[limit.case], limit.table.bound
            scale = limit.table.sign / (abs(bound) or 1.0)
            values.append(scale * (found.values[limit.of] - bound))
            rows.append(scale * of.backward(z, by_factor_c=found.by_stiffness[limit.of][of.cells]))
        return Evaluation(objective, gradient, np.array(values), np.array(rows).reshape(len(values), len(z)))


def _require_same_nodes(cases: Mapping[str, LoadCase]) -> None:
    """Check that every rank has the same nodes in all load cases.

    Raises:
        InputError: it has not, as the energies of one cost more than those of another.
    """
    first, *others = (case.system for case in cases.values())
    same = all(np.array_equal(first.node_labels(), other.node_labels()) for other in others)
    if not all(first.comm.allgather(same)):
        raise InputError(
            "design: cases: they are spread over the ranks differently, as their materials cost differently: use one "
            "rank, or the same models of materials in all"
        )


def _looked_at(case: LoadCase, stiffness_c: Float, warm: Solved) -> tuple[Solved | None, str]:
    """What loading from the beginning gives, with a note if that is another state; the former if it gives nothing."""
    kept = case.u
    cold = case.solve(stiffness_c, from_start=True)
    if cold is None:
        case.u = kept
        return warm, f"{case.name}: the load cannot be applied from the beginning, only from the design before"
    same = all(abs(cold.values[name] - value) <= SAME * abs(value) for name, value in warm.values.items())
    iterations = warm.iterations + cold.iterations
    if same:
        return replace(cold, iterations=iterations), ""
    names = next(name for name, value in warm.values.items() if abs(cold.values[name] - value) > SAME * abs(value))
    note = (
        f"{case.name}: loading from the beginning gives {names} = {cold.values[names]:.6g}, the state followed from "
        f"design to design {warm.values[names]:.6g}: another branch, which is left"
    )
    return replace(cold, iterations=iterations), note


def _problems(problem: OwnProblem, table: DesignTable) -> dict[str, OwnProblem]:
    """The load cases: the problem itself under no name, or with the changes of each.

    Raises:
        InputError: a change is wrong.
    """
    if not table.cases:
        return {"": problem}
    found = {}
    for case in table.cases:
        try:
            found[case.name] = with_changes(problem, case.set)
        except InputError as error:
            raise InputError(f"design: cases: {case.name}: {error}") from None
        if _cells(found[case.name].table) != _cells(problem.table):
            raise InputError(
                f"design: cases: {case.name}: it has another mesh or other regions, so that its cells are not those of "
                "the design: a load case changes loads, supports, springs and materials"
            )
    return found


def _cells(table: ProblemTable) -> tuple[object, ...]:
    """What the cells of a problem and those of its design follow from."""
    regions = [(name, of.shape, of.solid is not None, of.medium is not None) for name, of in table.regions.items()]
    return table.mesh, table.shapes, table.points, regions


def _parametrisation(problem: OwnProblem, table: DesignTable, mesh: PolygonMesh) -> Parametrisation:
    design_c = in_regions(mesh, design_regions(problem.regions()))
    cells = np.flatnonzero(design_c)
    radius = _radius(table.filter, mesh, cells)
    law: Interpolation = (
        Simp(table.interpolation.p) if table.interpolation.law == "simp" else Ramp(table.interpolation.q)
    )
    passive = {kind: _passive(mesh, [each for each in table.passive if each.is_ == kind]) for kind in ("solid", "void")}
    return parametrise(
        mesh,
        design_c,
        solid_c=passive["solid"],
        void_c=passive["void"],
        mirrors=[Mirror(axis, at) for axis, at in table.symmetry.items()],
        filter_of=None if radius is None else _filter(table.filter.kind, mesh, cells, passive["void"][cells], radius),
        interpolation=law,
    )


def _radius(table: FilterTable, mesh: PolygonMesh, cells: Int) -> float | None:
    """Radius of the filter; None without one.

    Raises:
        InputError: it is larger than the design, in which all densities would be the same.
    """
    if table.kind == "none":
        return None
    center_cx, area_c = centroids_and_areas(mesh)
    size = float(np.sqrt(np.median(area_c[cells])))
    if table.radius is None:
        return CELLS_OF_FILTER * size
    extent = float(np.ptp(center_cx[cells], axis=0).max()) + size
    if table.radius > extent:
        raise InputError(
            f"design: filter: radius = {table.radius:g} is larger than the design, whose extent is {extent:.4g}: all "
            f"densities would be the same; use some sizes of cells, which are {size:.3g} wide"
        )
    if table.radius < size:
        notes.say(
            f"design: filter: radius = {table.radius:g} is smaller than the cells, which are {size:.3g} wide: it "
            "filters nothing"
        )
    return table.radius


def _filter(kind: str, mesh: PolygonMesh, cells: Int, void_c: Bool, radius: float) -> Filter:
    """The filter of the cells of a design, without those that stay void: what ends at them has a sharp edge there, as
    what ends at the border of the design."""
    if not void_c.any():
        return density_filter(kind, mesh, cells, radius)
    return Within(density_filter(kind, mesh, cells[~void_c], radius), ~void_c)


def _passive(mesh: PolygonMesh, tables: list[PassiveTable]) -> Bool:
    chosen = np.zeros(mesh.n_cells, dtype=np.bool_)
    for table in tables:
        here = np.ones(mesh.n_cells, dtype=np.bool_)
        if table.box is not None:
            x0, y0, x1, y1 = table.box
            here &= in_box(mesh, min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1))
        if table.circle is not None:
            try:
                here &= in_circle(mesh, *table.circle)
            except InputError as error:
                raise InputError(f"design: passive: {error}") from None
        if not here.any():
            where, x, y = table.box or table.circle, *mesh.points_vx.T
            raise InputError(
                f"design: passive: no cell has its centroid in {where}: the mesh goes from ({x.min():g}, {y.min():g}) "
                f"to ({x.max():g}, {y.max():g}), its cells may be wider than that"
            )
        chosen |= here
    return chosen
