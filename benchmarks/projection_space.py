"""What gradients are projected on: the measurements behind docs/projection.md.

    python benchmarks/projection_space.py                  # all but the slow box runs, about two minutes
    python benchmarks/projection_space.py box --r 1 2 4 8   # gaps, minutes to an hour

Studies: zoo (rank and conditioning), rates (four cells against
one along an interface, kept under refinement), beam (one and two cells through the thickness), cost, box.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests" / "unit"))

from helpers_mesh import SHAPES, regular, subdivide, voronoi, with_boundary
from helpers_system import CLAMPED, errors, interpolate, make_system, region

from tmc_vem.constraints import Prescribed
from tmc_vem.errors import TmcError
from tmc_vem.mesh import PolygonMesh
from tmc_vem.mesh.structured import Rectangle, structured_quadrilaterals
from tmc_vem.mesh.weld import weld
from tmc_vem.problems import Box
from tmc_vem.problems.base import Medium
from tmc_vem.simulation import RunOptions, run
from tmc_vem.solve.newton import NewtonSolver
from tmc_vem.vem.element import PROJECTIONS, ElementSettings, build_elements
from tmc_vem.vem.stability import elastic_tangent
from tmc_vem.vem.tables import points_and_values

Float = NDArray[np.float64]

SQUARE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
# Gaps of the box at alpha_r = 1 on 80 x 20 equal squares with [P_3]^2 (gamma = 1e-6 still moves by 1 %).
CONVERGED = {1e-4: 8.04e-3, 1e-5: 2.01e-3, 1e-6: 5.05e-4}


def zoo() -> dict[str, Float]:
    """Polygons with edges longer than 5 % of their diameter."""
    shapes = {f"regular {n}-gon": regular(n) for n in range(3, 13)}
    shapes |= {name: SHAPES[name] for name in ("L", "U", "arrow")}
    for sides in (1, 2, 4):
        for n in (1, 3, 7):
            shapes[f"square, {n} hanging on {sides}"] = subdivide(SQUARE, [n + 1] * sides + [1] * (4 - sides))
    shapes["sliver 1 : 10"] = subdivide(SQUARE, [1, 1, 1, 1]) * [1.0, 0.1]
    mesh = voronoi(40)
    for n in (5, 6, 7):
        cells = np.flatnonzero(mesh.n_sides_c == n)
        shapes[f"Voronoi, {n} sides"] = mesh.points_vx[mesh.cell(int(cells[0]))]
    return shapes


def study_zoo() -> None:
    """Smallest nonzero eigenvalue of the elastic tangent relative to the largest; '-' if refused."""
    print("polygon".ljust(26), *(p.rjust(14) for p in PROJECTIONS))
    for name, polygon in zoo().items():
        cells = []
        for projection in PROJECTIONS:
            mesh = PolygonMesh.from_cells(polygon, [list(range(len(polygon)))])
            try:
                (group,) = build_elements(mesh, ElementSettings(projection=projection))
            except TmcError:
                cells.append("-")
                continue
            rows = np.moveaxis(group.tables.rows(2), 2, 0)
            eigenvalues = np.linalg.eigvalsh(elastic_tangent(rows, rows * group.tables.w_sq[..., None]))[0]
            space = {"composite": "c", "macro": "m"}.get(group.projection, group.projection.removeprefix("harmonic "))
            cells.append(f"{eigenvalues[3] / eigenvalues[-1]:.0e} {space}")
        print(name.ljust(26), *(c.rjust(14) for c in cells))


def interface_mesh(n: int, r: int) -> PolygonMesh:
    """Unit square: n / 2 x n squares on the left, r times finer ones on the right."""
    y, fine = np.linspace(0, 1, n + 1), np.linspace(0, 1, n * r + 1)
    left, right = np.linspace(0, 0.5, n // 2 + 1), np.linspace(0.5, 1, n * r // 2 + 1)
    halves = [
        structured_quadrilaterals(left, y, [Rectangle("solid", 0, 0.5, 0, 1)]),
        structured_quadrilaterals(right, fine, [Rectangle("solid", 0.5, 1, 0, 1)]),
    ]
    mesh = weld(halves)
    return with_boundary(mesh.points_vx, [loop.tolist() for loop in mesh.cells()])


def study_rates(r: int = 4) -> None:
    """Errors of a manufactured solution of the nonlinear solid; the second gradient in the cells with hanging nodes."""
    from test_vem_convergence import SOLID, manufactured

    displacement, gradient, force = manufactured()
    print("projection   n  displacement  rate   gradient  rate   second gradient, hanging  rate")
    for projection in PROJECTIONS:
        last = None
        for n in (4, 8, 16):
            try:
                system = make_system(interface_mesh(n, r), SOLID, CLAMPED, ElementSettings(projection=projection))
            except TmcError as error:
                print(f"{projection:10s} {n:3d}  {error}")
                break
            system.set_body_force(force)
            u = interpolate(system, displacement)
            if not NewtonSolver(system).solve(u).converged:
                print(f"{projection:10s} {n:3d}  not converged")
                break
            found = np.array([*errors(system, u, displacement, lambda p: gradient(p).reshape(-1, 2, 2))])
            found = np.append(found, second_gradient_error(system, u, gradient))
            rates = ["    "] * 3 if last is None else [f"{x:4.2f}" for x in np.log2(last / found)]
            print(f"{projection:10s} {n:3d}", *(f"   {e:.3e}  {q}" for e, q in zip(found, rates, strict=True)))
            last = found


def second_gradient_error(system, u, gradient, step: float = 1e-5) -> float:  # type: ignore[no-untyped-def]
    """Root mean square error of G over the cells with more than four vertices."""
    nodes, mesh = system.nodal_values(u), system.distributed.mesh
    total = area = 0.0
    for block in system.blocks:
        if block.n_sides == 4:
            continue
        points_cqx, _ = points_and_values(block.polygons(mesh), system.settings.order, block.scaled_points())
        points, w = points_cqx.reshape(-1, 2), block.weights()
        rows = block.rows(6)[:, :, 2:]
        G = np.einsum("cqra,cai->cqri", rows, nodes[block.batch.nodes_ca])
        for k in (0, 1):
            e = step * np.eye(2)[k]
            exact = (gradient(points + e) - gradient(points - e)).reshape(-1, 2, 2) / (2 * step)
            difference = G[:, :, 2 * k : 2 * k + 2] - np.swapaxes(exact, 1, 2).reshape(*w.shape, 2, 2)
            total += (w[..., None, None] * difference**2).sum()
        area += w.sum()
    return float(np.sqrt(total / area))


def beam_mesh(cells: int, layers: int, r: int) -> PolygonMesh:
    """Beam 10 x 1 whose upper cells have r - 1 hanging nodes on the upper side."""
    x, y = np.linspace(0, 10, cells + 1), np.linspace(0, 1, layers + 1)
    points: dict[tuple[float, float], int] = {}
    loops = []
    for i in range(cells):
        for j in range(layers):
            top = r if j == layers - 1 else 1
            polygon = subdivide(
                [(x[i], y[j]), (x[i + 1], y[j]), (x[i + 1], y[j + 1]), (x[i], y[j + 1])], [1, 1, top, 1]
            )
            loops.append([points.setdefault((round(a, 9), round(b, 9)), len(points)) for a, b in polygon.tolist()])
    mesh = with_boundary(np.array(list(points)), loops)
    ends = mesh.named_edges["boundary"]
    at = mesh.points_vx[ends].mean(axis=1)[:, 0]
    named = {"clamped": ends[at < 1e-9], "end": ends[at > 10 - 1e-9]}
    return PolygonMesh.from_cells(mesh.points_vx, loops, named_edges=named)


def study_beam() -> None:
    """Force at the end of a clamped beam, relative to that on 80 x 8 squares; end displacement 0.1."""
    conditions = (Prescribed("clamped", 0), Prescribed("clamped", 1), Prescribed("end", 1, 0.1))

    def force(mesh: PolygonMesh, projection: str) -> float:
        system = make_system(mesh, region("solid", K=20.0, mu=10.0), conditions, ElementSettings(projection=projection))
        start = interpolate(system, lambda p: np.stack([0.0 * p[:, 0], 0.1 * (p[:, 0] / 10.0) ** 2], axis=1))
        solver = NewtonSolver(system)
        if not solver.solve(start).converged:
            return float("nan")
        return float(system.reaction(solver.residual, "end", 1))

    exact = force(beam_mesh(80, 8, 1), "full")
    print("cells    hanging nodes", *(p.rjust(11) for p in PROJECTIONS))
    for cells, layers in ((10, 1), (20, 2)):
        for r in (1, 2, 4, 8):
            row = []
            for projection in PROJECTIONS:
                try:
                    row.append(f"{100 * (force(beam_mesh(cells, layers, r), projection) / exact - 1):+10.2f}%")
                except TmcError:
                    row.append("-".rjust(11))
            print(f"{cells} x {layers}   {r - 1}".ljust(22), *row, flush=True)


def study_cost() -> None:
    """Seconds for the element tangents of 4000 cells."""
    from codegen.batch import Tangents

    print("cell            projection   points  dofs  microseconds a tangent")
    for name, polygon in (
        ("square", subdivide(SQUARE, [1, 1, 1, 1])),
        ("3 hanging nodes", subdivide(SQUARE, [4, 1, 1, 1])),
    ):
        for projection in PROJECTIONS:
            mesh = PolygonMesh.from_cells(polygon, [list(range(len(polygon)))])
            try:
                system = make_system(mesh, region("solid", K=1.0, mu=1.0), (), ElementSettings(projection=projection))
            except TmcError:
                continue
            (block,) = system.blocks
            n = 4000
            n_basis = block.batch.n_basis
            nodes_ca = np.tile(block.batch.nodes_ca, (n, 1))
            batch = replace(block.batch, shape_c=np.zeros(n, dtype=np.int32), nodes_ca=nodes_ca)
            u, tangents = np.zeros((n_basis, 2)), Tangents(np.empty((n, 2 * n_basis, 2 * n_basis)))
            seconds = []
            for _ in range(5):
                start = time.perf_counter()
                block.kernel.cells(batch, u, block.parameters, None, tangents)
                seconds.append(time.perf_counter() - start)
            label = f"{projection} ({block.projection})"
            size = f"{block.batch.n_points:4d} {2 * n_basis:5d}"
            print(f"{name:15s} {label:24s} {size} {1e6 * min(seconds) / n:8.2f}")


def study_box(refinements: list[int], gammas: list[float], projections: list[str], cells: tuple[int, int]) -> None:
    """Gap at alpha_r = 1, medium refined r times."""
    print("r  gamma   projection   load   gap        error    steps  iterations")
    for r in refinements:
        for gamma in gammas:
            for projection in projections:
                problem = Box(cells=cells, medium=Medium(gamma=gamma, alpha_r=1.0), medium_refinement=r)
                try:
                    result = run(problem, None, RunOptions(element=ElementSettings(projection=projection)))
                except TmcError as error:
                    print(f"{r}  {gamma:.0e}  {projection:10s}  {error}")
                    continue
                gap = result.history[-1].gap
                error = 100 * (gap / CONVERGED[gamma] - 1) if gamma in CONVERGED else float("nan")
                print(
                    f"{r}  {gamma:.0e}  {projection:10s}  {result.load:5.3f}  {gap:.3e}  {error:+6.2f}%  "
                    f"{result.steps:4d}  {result.newton_iterations:5d}",
                    flush=True,
                )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    quick = {"zoo": study_zoo, "rates": study_rates, "beam": study_beam, "cost": study_cost}
    parser.add_argument("study", nargs="*", default=list(quick), choices=[*quick, "box"])
    parser.add_argument("--r", type=int, nargs="+", default=[1, 2, 4, 8])
    parser.add_argument("--gamma", type=float, nargs="+", default=list(CONVERGED))
    parser.add_argument("--projection", nargs="+", default=["auto"], choices=PROJECTIONS)
    parser.add_argument("--cells", type=int, nargs=2, default=(20, 5))
    arguments = parser.parse_args()
    for name in arguments.study:
        print(f"\n== {name}")
        if name == "box":
            study_box(arguments.r, arguments.gamma, arguments.projection, tuple(arguments.cells))
        else:
            quick[name]()


if __name__ == "__main__":
    main()
