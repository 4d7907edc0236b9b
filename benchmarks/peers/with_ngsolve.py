"""The paper's box in NGSolve: symbolic energies, biquadratic quadrilaterals, second gradients by its operator "hesse".

    runs/peers-env/bin/python benchmarks/peers/with_ngsolve.py [--cells 40 10] [--compiled] [--loads 0.1 0.3 1.0]

The loop is that of tmc-vem, written once more: extrapolation through the last four states, a line search on the
potential that never leaves J > 0, and the same tolerances. Loads are those at which tmc-vem has had its steps. With
``--compiled`` NGSolve makes C++ of the energies, interpreted expressions else.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import math
from itertools import pairwise
from typing import Any

from clock import Clock, say

CLOCK = Clock()

import netgen.meshing as netgen  # noqa: E402
import ngsolve as ng  # noqa: E402
import numpy as np  # noqa: E402
from numpy.typing import NDArray  # noqa: E402
from peer_problems import Box  # noqa: E402

Float = NDArray[np.float64]

# Those of tmc_vem.solve.newton: residual relative to that with the reactions, correction relative to the box's length.
RESIDUAL, CORRECTION, MOST_ITERATIONS, ARMIJO, SHORTEST = 1e-8, 1e-7, 20, 1e-4, 1e-4
ROUNDING = 1e-12
POINTS = 4  # degree of the rule: 3 x 3 points, as tmc-vem has with finite elements
MOST_STATES = 4


def mesh_of(problem: Box, cells: tuple[int, int]) -> tuple[Any, dict[str, int]]:
    """Equal quadrilaterals, with the vertices that are held and loaded by name."""
    x, y = problem.lines(cells)
    t = problem.wall
    made = netgen.Mesh(dim=2)
    nodes = [[made.Add(netgen.MeshPoint(netgen.Pnt(a, b, 0.0))) for b in y] for a in x]
    for number, name in ((1, "solid"), (2, "medium")):
        made.Add(netgen.FaceDescriptor(surfnr=number, domin=number, bc=1))
        made.SetMaterial(number, name)
    for i in range(len(x) - 1):
        for j in range(len(y) - 1):
            inside = t < (x[i] + x[i + 1]) / 2 < problem.length - t and t < (y[j] + y[j + 1]) / 2 < problem.height - t
            corners = [nodes[i][j], nodes[i + 1][j], nodes[i + 1][j + 1], nodes[i][j + 1]]
            cell = netgen.Element2D(2 if inside else 1, corners)
            cell.curved = False  # true unless told otherwise: slower, and second derivatives would be off by 1e-8
            made.Add(cell)
    bottom, top = [column[0] for column in nodes], [column[-1] for column in nodes]
    ring = bottom + nodes[-1][1:] + top[::-1][1:] + nodes[0][::-1][1:]
    for pair in pairwise(ring):
        made.Add(netgen.Element1D(list(pair), index=1))
    per_column, middle = len(y), cells[0] // 2
    names = {"left": 0, "right": cells[0] * per_column, "load": middle * per_column + cells[1]}
    flange = round(t / problem.height * cells[1])
    names |= {"below": middle * per_column + flange, "above": middle * per_column + cells[1] - flange}
    return ng.Mesh(made), names


def energies(problem: Box, u: Any) -> tuple[Any, Any]:
    """Densities of the solid and of the medium."""
    F = ng.Id(2) + ng.Grad(u)
    log_j, trace = ng.log(ng.Det(F)), ng.InnerProduct(F, F) + 1
    G = u.Operator("hesse")
    laplacian = [G[i, 0] + G[i, 3] for i in (0, 1)]
    squares = ng.InnerProduct(G, G) - (laplacian[0] ** 2 + laplacian[1] ** 2) / 2
    isochoric = problem.mu / 2 * (ng.exp(-2 / 3 * log_j) * trace - 3)
    regulariser = ng.exp(-problem.beta * ng.Det(F)) * squares / 2
    return (
        problem.K / 2 * log_j**2 + isochoric,
        problem.gamma * (isochoric + problem.alpha_r * regulariser),
    )


class System:
    """Potential, residual and tangent, with what is prescribed."""

    def __init__(self, problem: Box, cells: tuple[int, int], *, compiled: bool, inverse: str) -> None:
        self.problem, self.inverse = problem, inverse
        mesh, self.names = mesh_of(problem, cells)
        self.space = ng.VectorH1(mesh, order=2)
        self.state = ng.GridFunction(self.space)
        rule = {ng.QUAD: ng.IntegrationRule(ng.QUAD, POINTS)}
        self.form = ng.BilinearForm(self.space, symmetric=True)
        for name, density in zip(("solid", "medium"), energies(problem, self.space.TrialFunction()), strict=True):
            if compiled:
                with CLOCK("compilation"):
                    density = density.Compile(realcompile=True, wait=True)
            else:
                density = density.Compile()
            self.form += ng.Variation(density * ng.dx(definedon=mesh.Materials(name), intrules=rule))
        first, second = (self.space.Range(component).start for component in (0, 1))
        at = self.names
        self.constrained = [first + at["left"], second + at["left"], second + at["right"], second + at["load"]]
        self.loaded = second + at["load"]
        self.free = ng.BitArray(self.space.FreeDofs())
        for dof in self.constrained:
            self.free.Clear(dof)
        self.factor: Any = None
        self.vectors = {name: self.state.vec.CreateVector() for name in ("u", "residual", "rhs", "out")}
        self.n = self.space.ndof

    def potential(self, u: Float) -> float:
        """Energy; not a number where J is not positive."""
        self.vectors["u"].FV().NumPy()[:] = u
        with CLOCK("assembly"):
            return float(self.form.Energy(self.vectors["u"]))

    def residual(self, u: Float) -> Float:
        """Gradient of the potential with the reactions."""
        self.vectors["u"].FV().NumPy()[:] = u
        with CLOCK("assembly"):
            self.form.Apply(self.vectors["u"], self.vectors["residual"])
        return np.array(self.vectors["residual"].FV().NumPy())

    def tangent(self, u: Float) -> None:
        """Assemble and factorise."""
        self.vectors["u"].FV().NumPy()[:] = u
        with CLOCK("assembly"):
            self.form.AssembleLinearization(self.vectors["u"])
        with CLOCK("linear solve"):
            if self.factor is None:
                self.factor = self.form.mat.Inverse(self.free, inverse=self.inverse)
            else:
                self.factor.Update()

    def product(self, x: Float) -> Float:
        """Tangent times a vector."""
        self.vectors["rhs"].FV().NumPy()[:] = x
        self.vectors["out"].data = self.form.mat * self.vectors["rhs"]
        return np.array(self.vectors["out"].FV().NumPy())

    def solve(self, rhs: Float) -> Float:
        """Solution at free degrees of freedom, 0 at the others."""
        self.vectors["rhs"].FV().NumPy()[:] = rhs
        with CLOCK("linear solve"):
            self.vectors["out"].data = self.factor * self.vectors["rhs"]
        return np.array(self.vectors["out"].FV().NumPy())


class Newton:
    """Newton's method with a line search; counts iterations, those of failed attempts included."""

    def __init__(self, system: System) -> None:
        self.system, self.iterations, self.relative = system, 0, 0.0

    def solve(self, u: Float) -> Float | None:
        """Equilibrium from a state whose prescribed entries stay; None if there is no convergence."""
        system, correction, step = self.system, math.inf, 0.0
        energy = system.potential(u)
        if not math.isfinite(energy):
            return None
        for _ in range(MOST_ITERATIONS + 1):
            residual = system.residual(u)
            free = residual.copy()
            free[system.constrained] = 0.0
            self.relative = float(np.linalg.norm(free) / np.linalg.norm(residual))
            if self.relative <= RESIDUAL and step == 1.0 and correction <= CORRECTION:
                return u
            system.tangent(u)
            direction = system.solve(-free)
            correction = float(np.abs(direction).max()) / system.problem.length
            slope, step = float(free @ direction), 1.0
            while True:
                trial = system.potential(u + step * direction)
                if math.isfinite(trial) and (
                    slope >= 0.0 or trial <= energy + ARMIJO * step * slope + ROUNDING * abs(energy)
                ):
                    break
                step /= 2
                if step < SHORTEST:
                    return None
            u, energy = u + step * direction, trial
            self.iterations += 1
        return None


def predicted(system: System, states: list[tuple[float, Float]], load: float) -> Float:
    """Extrapolated state at a load; by the tangent where there is none, or it is not admissible."""
    times = [time for time, _ in states[-MOST_STATES:]]
    if len(times) > 1:
        weights = [math.prod((load - other) / (time - other) for other in times if other != time) for time in times]
        guess = sum(weight * u for weight, (_, u) in zip(weights, states[-MOST_STATES:], strict=True))
        if math.isfinite(system.potential(guess)):
            return np.asarray(guess)
    time, u = states[-1]
    increment = np.zeros(system.n)
    increment[system.loaded] = (load - time) * system.problem.uy
    system.tangent(u)
    rhs = -system.product(increment) - system.residual(u)
    rhs[system.constrained] = 0.0
    return u + increment + system.solve(rhs)


def load_up(system: System, loads: list[float], newton: Newton) -> tuple[list[tuple[float, Float]], int]:
    """States at the loads, and where steps had to be halved between them; and how many attempts failed."""
    states, failed = [(0.0, np.zeros(system.n))], 0
    for end in loads:
        size = end - states[-1][0]
        while states[-1][0] < end:
            load = end if states[-1][0] + size > end - 1e-9 else states[-1][0] + size
            u = newton.solve(predicted(system, states, load))
            if u is not None:
                states.append((load, u))
                continue
            failed, size = failed + 1, size / 2
            if size < 1e-5:
                raise SystemExit(f"no equilibrium beyond {states[-1][0]:g} of the load")
    return states, failed


def main() -> None:
    """Solve the box."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--cells", type=int, nargs=2, default=(20, 10))
    parser.add_argument("--compiled", action="store_true")
    parser.add_argument("--inverse", default="sparsecholesky")
    parser.add_argument("--loads", type=float, nargs="+", default=[n / 20 for n in range(1, 21)])
    arguments = parser.parse_args()
    ng.SetNumThreads(1)
    small = System(Box(), (20, 10), compiled=False, inverse=arguments.inverse)
    load_up(small, [0.01], Newton(small))  # loads the rest
    CLOCK.started_up()
    problem, cells = Box(), tuple(arguments.cells)
    with CLOCK("set-up"):
        system = System(problem, cells, compiled=arguments.compiled, inverse=arguments.inverse)
    newton = Newton(system)
    with CLOCK("run"):
        states, failed = load_up(system, arguments.loads, newton)
    u, at = states[-1][1], system.names
    points = {name: np.array([u[start + at[name]] for start in (0, system.loaded - at["load"])]) for name in at}
    gap = points["above"] - points["below"] + [0.0, problem.height - 2 * problem.wall]
    say({
        "unknowns": system.n,
        "steps": len(states) - 1,
        "attempts": len(states) - 1 + failed,
        "iterations": newton.iterations,
        "residual": newton.relative,
        "reaction": float(system.residual(u)[system.loaded]),
        "gap": float(np.hypot(*gap)),
        "versions": {name: importlib.metadata.version(name) for name in ("ngsolve", "netgen-mesher", "numpy")},
        "seconds": CLOCK.parts,
    })  # fmt: skip


if __name__ == "__main__":
    main()
