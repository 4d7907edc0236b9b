"""Contact of small problems: the last state of a run with what acts on every body in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem import RunOptions
from tmc_vem.mesh.bodies import named_bodies
from tmc_vem.problems import Problem
from tmc_vem.problems.base import media_of
from tmc_vem.results.contact.solids import same_points
from tmc_vem.results.contact.traction import Traction
from tmc_vem.results.output import polygons_of
from tmc_vem.results.run_result import RunResult
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.simulation.simulation import Simulation, prepare
from tmc_vem.system.layout import DISPLACEMENT

Float = NDArray[np.float64]

# Two blocks with a layer of medium from wall to wall; sides cannot move in x, so that everything is homogeneous.
LAYERS = """\
name = "layers"
gap = [[0.5, 0.4], [0.5, 0.8]]
[shapes]
low = { rectangle = [0, 0, 1, 0.4] }
mid = { rectangle = [0, 0.4, 1, 0.8] }
up = { rectangle = [0, 0.8, 1, 1.2] }
[regions]
low = { shape = "low", solid = { E = 20, nu = 0 } }
up = { shape = "up", solid = { E = 20, nu = 0 } }
medium = { shape = "mid", medium = { energy = "isochoric", mu = 10, gamma = 1e-2, alpha_r = 0.1 } }
[mesh]
cells = "triangles"
size = 0.2
[edges]
bottom = { line = [[0, 0], [1, 0]] }
top = { line = [[0, 1.2], [1, 1.2]] }
left = { line = [[0, 0], [0, 1.2]] }
right = { line = [[1, 0], [1, 1.2]] }
[[support]]
at = "left"
ux = 0
[[support]]
at = "right"
ux = 0
[[support]]
at = "bottom"
uy = 0
[load]
at = "top"
uy = -0.5
[solve]
steps = 5
snapshots = 0
"""


@dataclass(frozen=True)
class Solved:
    """A run, and its last converged state."""

    simulation: Simulation
    result: RunResult
    u: Any
    residual: Any

    @property
    def traction(self) -> Traction:
        found = self.simulation.recorder.contact.traction(self.u, self.residual)
        assert found is not None
        return found

    def resultant(self, where: str) -> Float:
        """Force and moment about the origin of what holds a place."""
        found: Float = self.simulation.system.resultant(self.u, self.residual, where, (0.0, 0.0))
        return found

    def contact(self, name: str) -> Float:
        """Force and moment of the medium on a body."""
        found = self.result.contact[name]
        return np.array([found["force_x"], found["force_y"], found["moment"]])

    def load(self, name: str) -> Float:
        """Force and moment of a load or springs."""
        found = self.result.loads[name]
        return np.array([found["force_x"], found["force_y"], found["moment"]])

    def imbalance(self) -> dict[str, float]:
        """Largest component of loads + supports + contact of each body, with its moment, over the largest force; loads
        and supports are taken from all nodes of a body."""
        system, traction = self.simulation.system, self.traction
        polygons = polygons_of(system, media_of(self.simulation.problem))
        labels = system.node_labels()
        place = same_points(np.concatenate([polygons.points_nx, labels[:, :2]]))
        of_point, of_node = place[: len(polygons.points_nx)], place[len(polygons.points_nx) :]
        body_c, names = named_bodies(
            polygons.offsets, of_point[polygons.connectivity], polygons.region_c, polygons.region_names,
            polygons.is_solid_c, system.cell_numbers(),
        )  # fmt: skip
        axes = system.turned().of(np.arange(len(labels)))
        u_ni, held_ni = (
            np.einsum("nij,nj->ni", axes, DISPLACEMENT.nodal(values))
            for values in (self.u.getArray(), system.holding_forces(self.residual))
        )
        acting_ni = system.external_forces(self.u) + held_ni
        largest = max(np.abs(held_ni).max(), np.abs(acting_ni).max(), np.abs(traction.force_ni).max())
        cell_n = _cells_of_moments(polygons, labels)
        found = {}
        for body, name in enumerate(names):
            points = np.unique(np.concatenate([of_point[polygons.cell(c)] for c in np.flatnonzero(body_c == body)]))
            mine = np.where(labels[:, 2] == 0, np.isin(of_node, points), body_c[cell_n] == body)
            (x, y), (fx, fy) = (labels[mine, :2] + u_ni[mine]).T, acting_ni[mine].T
            total = np.array([fx.sum(), fy.sum(), (x @ fy - y @ fx) / system.size])
            if name in traction.surface.bodies:
                total += self.contact(name) / (1.0, 1.0, system.size)
            found[name] = float(np.abs(total).max() / largest)
        return found


def _cells_of_moments(polygons: Any, labels: Float) -> NDArray[np.int64]:
    """(n,) the cell of each node that is a moment, 0 for others: the one whose points' box has its centroid, and whose
    middle is nearest."""
    middle = np.array([polygons.points_nx[polygons.cell(c)].mean(axis=0) for c in range(polygons.n_cells)])
    nearest = np.hypot(*np.moveaxis(labels[:, None, :2] - middle, -1, 0)).argmin(axis=1)
    return np.where(labels[:, 2] > 0, nearest, 0)


def solve(problem: Problem, options: RunOptions, out: Path | None = None) -> Solved:
    """Run a problem."""
    simulation = prepare(problem, out, options)
    last: dict[str, Any] = {}
    record = simulation.recorder.record

    def keep(step: Any, states: Any, position: Any) -> None:
        last.update(u=states.vectors[-1].copy(), residual=step.newton.residual.copy())
        record(step, states, position)

    simulation.recorder.record = keep  # type: ignore[method-assign]
    result = simulation.go()
    return Solved(simulation, result, **last)


def solved(directory: Path, text: str, out: Path | None = None, **options: Any) -> Solved:
    """Run a problem file."""
    path = directory / "problem.toml"
    path.write_text(text)
    problem, given = read_problem(path)
    values = {name: getattr(given, name) for name in given.__dataclass_fields__}
    return solve(problem, RunOptions(**values | options), out)


def changed(text: str, *changes: Sequence[str]) -> str:
    """A text with some words replaced by others."""
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    return text


# A plug over a base whose left end is on an incline: loads, springs and a support act on nodes of the surface.
LOADED = """\
name = "loaded"
gap = [[0.6, 0.5], [0.6, 0.3]]
[shapes]
frame = { rectangle = [0, 0, 1, 1] }
base = { polygon = [[0, 0], [1, 0], [1, 0.3], [0.2, 0.3]] }
plug = { rectangle = [0.45, 0.5, 0.8, 1.0] }
[regions]
base = { shape = "base", solid = { K = 20, mu = 10 } }
plug = { shape = "plug", solid = { E = 25, nu = 0.3 } }
medium = { shape = "frame - base - plug", medium = { mu = 10, gamma = 1e-3, alpha_r = 1, regulariser = "huhu_lulu" } }
[mesh]
cells = "triangles"
size = 0.25
[edges]
bottom = { line = [[0, 0], [1, 0]] }
slant = { line = [[0, 0], [0.2, 0.3]] }
tread = { line = [[0.2, 0.3], [1, 0.3]] }
top = { between = ["plug", "outside"] }
side = { line = [[0.8, 0.5], [0.8, 1.0]] }
[points]
corner = [0.45, 0.5]
[[support]]
at = "slant"
normal = 0
[[support]]
at = "bottom"
uy = 0
[[support]]
at = "top"
ux = 0
[[load]]
name = "press"
at = "top"
uy = -0.12
[[load]]
name = "wind"
at = "side"
traction = [-0.03, 0.01]
[[load]]
name = "weight"
regions = ["plug"]
body_force = [0.02, -0.05]
[[load]]
name = "pull"
at = "corner"
force = [0.01, 0.02]
[[spring]]
name = "rest"
at = "tread"
stiffness = [0.3, 0.2]
[solve]
steps = 2
snapshots = 0
"""
