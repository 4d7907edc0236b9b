"""The C-box of FElupe's example 'Third Medium Contact' in FElupe.

    runs/peers-env/bin/python benchmarks/peers/with_felupe.py [--cells 24 12] [--solver pardiso] [--states FILE.npz]

Its biquadratic cells, its rule of 3 x 3 points, Newton's method as it comes, without line search or prediction.
Solvers: ``scipy`` (SuperLU, FElupe's default), ``pardiso`` (``pypardiso.spsolve``, which FElupe's documentation
recommends) and ``pardiso-symmetric`` (the same for upper triangles, which takes some lines of one's own).
``--states`` solves nothing: energies and forces of some states, and energies and stresses of some F, go into the file.
``--keep`` writes the last state of a run. Steps that fail are halved (``CutbackPlugin``), which happens on fine meshes.
"""

from __future__ import annotations

import argparse
import importlib.metadata
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from clock import Clock, say

CLOCK = Clock()

import felupe  # noqa: E402
import numpy as np  # noqa: E402
import scipy.sparse  # noqa: E402
from peer_problems import CBox  # noqa: E402

STATES = 4  # of which energies and forces are compared
Solve = Callable[[Any, Any], Any]


def scipy_solver() -> Solve:
    """What FElupe takes by default."""
    from scipy.sparse.linalg import spsolve

    return lambda matrix, rhs: spsolve(matrix, rhs)


def pardiso_solver() -> Solve:
    """MKL's Pardiso as pypardiso has it, for matrices without symmetry."""
    from pypardiso import spsolve

    return lambda matrix, rhs: spsolve(matrix, rhs)


def symmetric_pardiso_solver() -> Solve:
    """MKL's Pardiso for the upper triangle of a symmetric indefinite matrix."""
    from pypardiso import PyPardisoSolver

    solver = PyPardisoSolver(mtype=-2)

    def solve(matrix: Any, rhs: Any) -> Any:
        upper = scipy.sparse.triu(matrix, format="csr")
        solver.factorize(upper)
        return solver.solve(upper, rhs)

    return solve


SOLVERS = {"scipy": scipy_solver, "pardiso": pardiso_solver, "pardiso-symmetric": symmetric_pardiso_solver}


@dataclass
class Model:
    """FElupe's objects for the problem: items of the potential, the field of all unknowns, and what is prescribed."""

    items: list[Any]
    field: Any
    bounds: dict[str, Any]
    materials: list[Any]


def rectangle(x: list[float], y: list[float]) -> Any:
    """Bilinear cells between the first and the last of equidistant lines."""
    return felupe.Rectangle(a=(x[0], y[0]), b=(x[-1], y[-1]), n=(len(x), len(y)))


def biquadratic(parts: list[Any]) -> Any:
    """One mesh of several, with nodes in the middle of sides and cells."""
    return felupe.MeshContainer(parts, merge=True).stack().add_midpoints_edges().add_midpoints_faces()


def model(problem: CBox, cells: tuple[int, int]) -> Model:
    """Meshes, materials and forms."""
    x, y = problem.lines(cells)
    across, along, inside = problem.counts(cells)
    x0, x1, x2 = x[: across + 1], x[across : across + along + 1], x[across + along :]
    y0, y1, y2 = y[: across + 1], y[across : across + inside + 1], y[across + inside :]
    body = biquadratic([rectangle(*pair) for pair in ((x0, y0), (x0, y1), (x0, y2), (x1, y0), (x1, y2))])
    medium = biquadratic([rectangle(*pair) for pair in ((x1, y1), (x2, y0), (x2, y1), (x2, y2))])
    container = felupe.MeshContainer([body, medium], merge=True, decimals=8)
    regions = [felupe.RegionBiQuadraticQuad(mesh, hess=True) for mesh in container.meshes]
    fields = [felupe.FieldPlaneStrain(region, dim=2).as_container() for region in regions]
    materials = [
        felupe.NeoHookeCompressible(mu=factor * problem.mu, lmbda=factor * problem.lmbda)
        for factor in (1.0, problem.gamma)
    ]
    solids = [felupe.SolidBody(material, of) for material, of in zip(materials, fields, strict=True)]
    field = felupe.FieldPlaneStrain(felupe.RegionBiQuadraticQuad(container.stack()), dim=2).as_container()
    bounds = felupe.BoundaryDict(
        fixed=felupe.Boundary(field[0], fx=0.0),
        move=felupe.Boundary(field[0], fx=problem.length, fy=problem.height, mode="and", skip=(1, 0)),
    )
    return Model([*solids, regulariser(fields[1], problem.alpha_r)], field, bounds, materials)


def regulariser(field: Any, weight: float) -> Any:
    """Second gradients of the medium: ``weight/2 (G :. G - 1/2 Lu . Lu)`` as a pair of forms."""
    from felupe.math import dddot, dot, hess

    def product(first: Any, second: Any) -> Any:
        traces = (np.einsum("ijj...->i...", each) for each in (first, second))
        return weight * (dddot(first, second) - dot(*traces, mode=(1, 1)) / 2)

    @felupe.Form(v=field, u=field)
    def tangent() -> Any:
        return [lambda v, u: product(hess(u), hess(v))]

    @felupe.Form(v=field)
    def residual() -> Any:
        return [lambda v: product(hess(field[0])[:2, :2, :2], hess(v))]

    return felupe.FormItem(bilinearform=tangent, linearform=residual)


class Count(felupe.Plugin):  # type: ignore[misc]
    """Counts iterations, those of failed attempts included, and keeps the last result."""

    def __init__(self) -> None:
        self.iterations, self.attempts = 0, 0
        self.last: Any = None

    def before_newton(self, context: Any, state: Any) -> None:
        """An attempt begins."""
        self.attempts += 1

    def after_linear_solve(self, context: Any, state: Any) -> None:
        """An iteration has its correction."""
        self.iterations += 1

    def after_newton(self, context: Any, state: Any) -> None:
        """An attempt has converged."""
        self.last = state


def solve(problem: CBox, cells: tuple[int, int], solver: str, keep: Path | None = None) -> dict[str, Any]:
    """Load the C and tell how it went."""
    count, cutback = Count(), felupe.CutbackPlugin()
    with CLOCK("set-up"):
        made = model(problem, cells)
        backend = SOLVERS[solver]()
        loads = felupe.math.linsteps([0.0, 1.0], num=problem.steps)
        step = felupe.Step(made.items, ramp={made.bounds["move"]: problem.uy * loads}, boundaries=made.bounds)

        def timed(matrix: Any, rhs: Any) -> Any:
            with CLOCK("linear solve"):
                return backend(matrix, rhs)

    with CLOCK("run"):
        felupe.Job([step], plugins=[count, cutback]).evaluate(x0=made.field, solver=timed, verbose=False)
    forces = np.asarray(count.last.fun).reshape(-1, 2)
    node, points = made.bounds["move"].points, made.field.region.mesh.points
    free = forces.copy()
    free[points[:, 0] == 0.0] = 0.0
    free[node, 1] = 0.0
    if keep:
        np.savez(keep, points=points, u=count.last.x[0].values, reaction=forces[node, 1].sum())
    return {
        "unknowns": int(made.field[0].values.size),
        "steps": sum(map(len, cutback.load_factors)),
        "attempts": count.attempts,
        "iterations": count.iterations,
        "residual": float(np.linalg.norm(free) / np.linalg.norm(forces)),
        "reaction": float(forces[node, 1].sum()),
    }


def states(problem: CBox, cells: tuple[int, int], path: Path) -> None:
    """Write what FElupe makes of some states: smooth displacements of all nodes, and some F with J > 0."""
    made = model(problem, cells)
    points, generator = made.field.region.mesh.points, np.random.default_rng(1)
    u_sni, energy_s, forces_sni = [], [], []
    for _ in range(STATES):
        wave, phase, size = generator.normal(size=(2, 2, 3)), generator.uniform(0, 6, (2, 3)), 0.02
        u = size * np.sin(np.einsum("nk,ikm->nim", points, 2 * wave) + phase).sum(axis=-1)
        made.field[0].values[:] = u
        forces = total_forces(made)
        solids, form = made.items[:2], made.items[2]
        stored = sum(
            float((material.function([solid.field.extract()[0]])[0] * solid.field.region.dV).sum())
            for material, solid in zip(made.materials, solids, strict=True)
        )
        areas = [float(solid.field.region.dV.sum()) for solid in solids]
        # at F = I, FElupe's solids have 3/2 mu; the regulariser is quadratic
        stored -= 1.5 * sum(material.mu * area for material, area in zip(made.materials, areas, strict=True))
        linear = form.assemble.vector().toarray()[:, 0]
        stored += 0.5 * float(linear @ made.field[0].values.ravel())
        u_sni.append(u)
        energy_s.append(stored)
        forces_sni.append(forces)
    F = np.zeros((3, 3, 200, 1))
    F[:2, :2] = np.eye(2)[:, :, None, None] + 0.3 * generator.uniform(-1, 1, (2, 2, 200, 1))
    F[2, 2] = 1.0
    solid = made.materials[0]
    W = solid.function([F])[0][:, 0] - 1.5 * solid.mu
    F_nij, P_nij = (of[:2, :2, :, 0].transpose(2, 0, 1) for of in (F, solid.gradient([F, None])[0]))
    np.savez(path, points=points, u=u_sni, energy=energy_s, forces=forces_sni, F=F_nij, W=W, P=P_nij)


def total_forces(made: Model) -> Any:
    """Gradient of the potential at the field's values, (n, 2)."""
    from felupe.tools._newton import fun_items

    return fun_items(made.items, made.field).reshape(-1, 2)


def main() -> None:
    """Solve, or compute energies of states."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--cells", type=int, nargs=2, default=(12, 6))
    parser.add_argument("--solver", choices=SOLVERS, default="scipy")
    parser.add_argument("--states", type=Path)
    parser.add_argument("--keep", type=Path)
    arguments = parser.parse_args()
    cells = tuple(arguments.cells)
    if arguments.states:
        states(CBox(), cells, arguments.states)
        return
    solve(CBox(uy=-0.01, steps=1), (12, 6), arguments.solver)  # loads the rest
    CLOCK.started_up()
    found = solve(CBox(), cells, arguments.solver, arguments.keep)
    names = ("felupe", "numpy", "scipy", "pypardiso", "mkl")
    found["versions"] = {name: importlib.metadata.version(name) for name in names}
    say({**found, "seconds": CLOCK.parts})


if __name__ == "__main__":
    main()
