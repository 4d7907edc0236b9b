"""Two solids with medium between them on any mesh, states of them that are no equilibria, and Taylor remainders."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from helpers_forces import interpolated
from helpers_mesh import grid, hanging, voronoi
from mpi4py import MPI
from numpy.typing import NDArray

from tmc_vem.mesh import PolygonMesh
from tmc_vem.mesh.parts import with_names
from tmc_vem.problems import Material, Medium
from tmc_vem.problems.base import RegionEnergy, medium_region, solid_region
from tmc_vem.problems.probes import Probe
from tmc_vem.sensitivity.functionals_nodes import Nodes
from tmc_vem.sensitivity.functionals_record import Derivative, Functional, FunctionalState
from tmc_vem.simulation.discretised import discretise
from tmc_vem.simulation.options import RunOptions
from tmc_vem.support.units import Units
from tmc_vem.system.constraints import Condition, Prescribed, PrescribedAcross
from tmc_vem.system.control import Control
from tmc_vem.system.forces import Force, Spring, Traction

Float = NDArray[np.float64]

SLOPE = 0.2
MESHES: Mapping[str, Callable[[], PolygonMesh]] = {
    "voronoi": lambda: voronoi(40),
    "hanging": lambda: hanging(3, distort=0.02),
    "squares": lambda: grid(4, 6),
}
AT = Control(0.7)
STEPS = np.array([4e-3, 2e-3, 1e-3])


def layered(mesh: PolygonMesh, slope: float = 0.0) -> PolygonMesh:
    """The unit square with a solid below, medium in the middle and another solid on top; its sides go up by a slope."""
    centre = np.array([mesh.points_vx[mesh.cell(c)].mean(axis=0) for c in range(mesh.n_cells)])
    region_c = np.where(centre[:, 1] < 0.36, 0, np.where(centre[:, 1] < 0.64, 1, 2))
    moved = mesh.points_vx + slope * np.column_stack([np.zeros(mesh.n_vertices), mesh.points_vx[:, 0]])
    flat = replace(mesh, points_vx=moved, region_c=region_c, region_names=("foot", "medium", "block"), named_edges={})
    lines = {
        "left": ((0.0, 0.0), (0.0, 1.0)),
        "right": ((1.0, slope), (1.0, 1.0 + slope)),
        "bottom": ((0.0, 0.0), (1.0, slope)),
        "top": ((0.0, 1.0), (1.0, 1.0 + slope)),
    }
    return with_names(flat, {"corner": (1.0, 1.0 + slope), "base": (0.0, 0.0)}, lines)


@dataclass(frozen=True)
class Layers:
    """The problem; ``slope`` makes the loaded side an incline, across which the load is prescribed."""

    mesh: str = "voronoi"
    slope: float = 0.0
    measured: Mapping[str, Probe] = field(default_factory=dict)
    pushed: Condition | Force | None = None

    name = "layers"

    def make_mesh(self) -> PolygonMesh:
        return layered(MESHES[self.mesh](), self.slope)

    def regions(self) -> Mapping[str, RegionEnergy]:
        medium = Medium(gamma=0.05, alpha_r=0.02, beta=2.0)
        return {
            "foot": solid_region(Material(K=3.0, mu=1.5)),
            "medium": medium_region(medium, 1.5),
            "block": solid_region(Material(K=2.0, mu=1.0)),
        }

    def prescribed(self) -> Sequence[Condition]:
        load = self.load()
        held = [Prescribed("bottom", 0), Prescribed("bottom", 1), Prescribed("left", 0)]  # the last at the medium too
        return [*held, *([load] if isinstance(load, Condition) else [])]

    def forces(self) -> Sequence[Force]:
        load = self.load()
        springs = Spring("held", "left", (0.3, 0.2))
        return [Traction("pull", "right", (0.02, 0.01)), springs, *([] if isinstance(load, Condition) else [load])]

    def probes(self) -> Mapping[str, Probe]:
        return self.measured

    def units(self) -> Units:
        return Units()

    def load(self) -> Condition | Force:
        if self.pushed is not None:
            return self.pushed
        return PrescribedAcross("top", "normal", -0.1) if self.slope else Prescribed("top", 1, -0.1)

    def inputs(self) -> dict[str, Any]:
        return {"problem": self.name, "order": 2}


def wavy(x: Float) -> Float:
    return 0.06 * np.column_stack([np.sin(2.0 * x[:, 0] + x[:, 1]), np.cos(x[:, 0] - 2.5 * x[:, 1]) - 2.0 * x[:, 1]])


def shaking(x: Float) -> Float:
    return 0.5 * np.column_stack([np.cos(7.0 * x[:, 0] * x[:, 1]), np.sin(5.0 * x[:, 1])])


@dataclass
class Case:
    """A problem, its discretisation and a state that is no equilibrium, with a change that respects no support."""

    problem: Any
    system: Any
    nodes: Nodes
    u: Any
    du: Any

    def residual(self, u: Any) -> Any:
        """Residual at a state, zero where an equilibrium has none: at what is free."""
        out = self.system.create_vector()
        self.system.residual(u, out)
        array, held = out.getArray(), self.system.constrained()
        kept = array[held].copy()
        array[:] = 0.0
        array[held] = kept
        return out

    def state(self, u: Any) -> FunctionalState:
        return FunctionalState(u, self.residual(u), AT)

    def moved(self, step: float) -> Any:
        u = self.u.copy()
        u.axpy(step, self.du)
        return u


def case_of(problem: Any, method: str = "vem", comm: Any = MPI.COMM_WORLD) -> Case:
    """A state of a problem."""
    system: Any = discretise(problem, RunOptions(method), comm)
    system.set_position(AT)
    inner, nodes = system, Nodes(system)
    while hasattr(inner, "_system"):
        inner = inner._system

    def vector(field: Callable[[Float], Float]) -> Any:
        return nodes.vector(interpolated(inner, field).getArray().reshape(-1, 2))

    return Case(problem, system, nodes, vector(wavy), vector(shaking))


def by_state(case: Case, functional: Functional) -> tuple[float, Float]:
    """Slope of a result along du, and how much central differences differ from it, for steps of ``STEPS``."""
    system, derivative = case.system, functional.derivative(case.state(case.u))
    slope = derivative.by_u.dot(case.du)
    if derivative.on_residual is not None:
        product = system.create_vector()
        system.jacobian(case.u, system.create_matrix())
        system.tangent_action(case.du, product)
        slope += derivative.on_residual.dot(product)

    def value(step: float) -> float:
        return functional.derivative(case.state(case.moved(step))).value

    return slope, np.array([(value(e) - value(-e)) / (2.0 * e) - slope for e in STEPS])


def explicit(system: Any, u: Any, derivative: Derivative) -> dict[tuple[str, str], float]:
    """Derivatives at a fixed state by region and parameter, each multiplied with its own value in the cells."""
    parts, total = derivative.by_cells, {}
    n_cells = len(system.cell_numbers())
    weight_c, chosen_c = np.zeros(n_cells), np.zeros(n_cells, dtype=bool)
    if parts is not None:
        weight_c = weight_c if parts.energy_weight_c is None else parts.energy_weight_c
        chosen_c = chosen_c if parts.chosen_c is None else parts.chosen_c
    fields = [(derivative.on_residual, np.ones(n_cells)), (parts and parts.field, chosen_c)]
    for field_, of_c in fields:
        for each in system.parameter_derivatives(u, field_) if field_ is not None else ():
            for k, name in enumerate(each.names):
                total.setdefault((each.region, name), 0.0)
                total[each.region, name] += float((of_c[each.cells] * each.residual_ck[:, k]).sum())
    for each in system.parameter_derivatives(u):
        for k, name in enumerate(each.names):
            total.setdefault((each.region, name), 0.0)
            total[each.region, name] += float((weight_c[each.cells] * each.energy_ck[:, k]).sum())
    for direct in parts.direct if parts is not None else ():
        for k, name in enumerate(direct.names):
            total[direct.region, name] += float(direct.values_ck[:, k].sum())
    return total


def by_parameters(case: Case, functional: Functional, regions: Sequence[str] = ()) -> tuple[float, Float]:
    """The same along a change of all parameters of some regions, all by default, each by another part of itself."""
    rng = np.random.default_rng(3)
    values = {
        (region, name): value
        for region, of in case.problem.regions().items()
        for name, value in of.values.items()
        if not regions or region in regions
    }
    change = {key: rng.uniform(-1.0, 1.0) * value for key, value in values.items()}
    found = explicit(case.system, case.u, functional.derivative(case.state(case.u)))
    slope = sum(found[key] * change[key] for key in change)

    def value(step: float) -> float:
        case.system.set_parameters({f"{r}.{n}": values[r, n] + step * change[r, n] for r, n in change})
        return functional.derivative(case.state(case.u)).value

    differences = np.array([(value(e) - value(-e)) / (2.0 * e) - slope for e in 10.0 * STEPS])
    case.system.set_parameters({f"{r}.{n}": values[r, n] for r, n in change})
    return slope, differences


def is_second_order(slope: float, away: Float, *, exact: bool = False) -> bool:
    """Whether differences go to a slope with the square of the step; or agree to rounding, where there is no term of
    third order."""
    away = np.abs(away)
    if exact:
        return bool(away.max() <= 1e-9 * max(abs(slope), 1e-3))
    rates = np.diff(np.log(away)) / np.diff(np.log(STEPS))
    return bool(np.abs(rates - 2.0).max() < 0.1 and away[-1] < 1e-2 * abs(slope))
