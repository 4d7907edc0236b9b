"""What gradients are projected on: the linear measurements behind docs/projection.md, which this prints.

    python benchmarks/projection_space.py                  # all, a minute
    python benchmarks/projection_space.py zoo beam         # some of them

Studies: zoo (rank and conditioning), extension (energy of modes relative to the best extension of their boundary
values), rates (four cells against one along an interface, kept under refinement), beam (one and two cells through the
thickness). Contact is in projection_contact.py, the cost in projection_cost.py. ``scripts/refresh-numbers
projection-zoo`` measures the same, keeps it, and writes it into the page.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests" / "unit"))

from helpers_mesh import SHAPES, regular, subdivide, voronoi, with_boundary
from helpers_system import CLAMPED, errors, interpolate, make_system, region

from tmc_vem.mesh import PolygonMesh
from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
from tmc_vem.mesh.make.weld import weld
from tmc_vem.solve.newton import NewtonSolver
from tmc_vem.support.errors import TmcError
from tmc_vem.system.constraints import Prescribed
from tmc_vem.vem.spaces.composite import CompositeSpace
from tmc_vem.vem.spaces.element import ElementGroup, build_elements
from tmc_vem.vem.spaces.element_settings import ElementSettings
from tmc_vem.vem.spaces.macro import MacroSpace
from tmc_vem.vem.spaces.quadrature import gauss, sub_triangles
from tmc_vem.vem.spaces.rules import on_sub_triangles
from tmc_vem.vem.spaces.spaces import FullSpace, Shapes
from tmc_vem.vem.spaces.stability import elastic_tangent
from tmc_vem.vem.spaces.tabulated import points_and_values, tabulate
from tmc_vem.vem.system import VemSystem

Float = NDArray[np.float64]

SQUARE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]


@cache
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


def conditioning(polygon: str, projection: str) -> tuple[float, str] | None:
    """Smallest nonzero eigenvalue of the elastic tangent of a polygon of the zoo relative to the largest, and the
    space: l, the degrees of the harmonic space, or the first letter of a name; None if no space has full rank."""
    points = zoo()[polygon]
    mesh = PolygonMesh.from_cells(points, [list(range(len(points)))])
    try:
        (group,) = build_elements(mesh, ElementSettings(projection=projection))
    except TmcError:
        return None
    eigenvalues = np.linalg.eigvalsh(tangent_of(group))
    space = {"composite": "c", "macro": "m"}.get(group.projection, group.projection.removeprefix("harmonic "))
    return float(eigenvalues[3] / eigenvalues[-1]), space


def tangent_of(group: ElementGroup) -> Float:
    """Elastic tangent (2 n, 2 n) of the first shape at F = I, lambda = mu = 1."""
    rows = np.moveaxis(group.tables.rows(2), 2, 0)[:, :1]
    return elastic_tangent(rows, rows * group.tables.w_sq[:1, :, None])[0]


def bound_by_quadratics(name: str) -> float:
    """Bound on the smallest nonzero eigenvalue relative to the largest from displacements in P_2, on which the tangents
    of all spaces agree: the smallest Rayleigh quotient of those orthogonal to the rigid motions."""
    polygon = zoo()[name]
    mesh = PolygonMesh.from_cells(polygon, [list(range(len(polygon)))])
    (group,) = build_elements(mesh, ElementSettings(projection="composite"))
    x, y = np.concatenate([polygon, 0.5 * (polygon + np.roll(polygon, -1, axis=0))]).T
    points_sqx, _ = points_and_values(polygon[None], 2, group.tables.xi_sqx)
    points, weights = points_sqx[0], group.tables.w_sq[0]
    columns = []
    for a, b in ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)):
        mean = weights @ (points[:, 0] ** a * points[:, 1] ** b) / weights.sum()
        columns.append(np.append(x**a * y**b, mean))
    quadratics = np.kron(np.eye(2), np.stack(columns, axis=1))
    rigid = quadratics[:, [0, 6]], quadratics[:, [2]] - quadratics[:, [7]]
    tangent = tangent_of(group)
    basis, _ = np.linalg.qr(np.hstack([*rigid, quadratics]))
    scaled = np.linalg.svd(quadratics - basis[:, :3] @ (basis[:, :3].T @ quadratics))[0][:, :9]
    quotient = np.linalg.eigvalsh(scaled.T @ tangent @ scaled)[0]
    return float(quotient / np.linalg.eigvalsh(tangent)[-1])


SPACES = {"[P_3]^2": FullSpace(3), "[P_4]^2": FullSpace(4), "macro": MacroSpace(2), "composite": CompositeSpace(2)}


def extension(hanging: int, name: str) -> list[float]:
    """Energy of a displacement in a square over that of the best extension of its boundary values into the cell, for
    all boundary values: least, median, three quarters, largest. K = 20, mu = 10.

    Args:
        hanging: nodes on one side.
        name: of ``SPACES``.
    """
    polygon = subdivide(SQUARE, [hanging + 1, 1, 1, 1])
    spectrum, modes = np.linalg.eigh(_best_extension(hanging))
    scaled = modes[:, 3:] / np.sqrt(spectrum[3:])
    ((_, triangles),) = sub_triangles(polygon[None])
    space = SPACES[name]
    shapes = Shapes.of(polygon[None], triangles, 2, space.degree)
    tables = tabulate(shapes, space, on_sub_triangles(triangles, 6))
    n_basis = tables.n_basis
    tangent = _isotropic(tables.rows(2)[0], tables.w_sq[0])
    moment = np.array([n_basis - 1, 2 * n_basis - 1])
    outer = np.delete(np.arange(2 * n_basis), moment)
    coupling = tangent[np.ix_(moment, outer)]
    inner = np.linalg.solve(tangent[np.ix_(moment, moment)], coupling)
    ratios = np.linalg.eigvalsh(scaled.T @ (tangent[np.ix_(outer, outer)] - coupling.T @ inner) @ scaled)
    return [float(q) for q in np.abs(np.quantile(ratios, (0.0, 0.5, 0.75, 1.0)))]


def _isotropic(gradient_qxa: Float, w_q: Float, K: float = 20.0, mu: float = 10.0) -> Float:
    """Tangent (2 n, 2 n) of plane strain elasticity, all x components first."""
    lam = K - 2.0 * mu / 3.0
    d = np.moveaxis(gradient_qxa, 1, 0)
    xx, yy, xy = (d[i].T @ (w_q[:, None] * d[j]) for i, j in ((0, 0), (1, 1), (0, 1)))
    upper, lower, mixed = (lam + 2 * mu) * xx + mu * yy, (lam + 2 * mu) * yy + mu * xx, lam * xy + mu * xy.T
    return np.block([[upper, mixed], [mixed.T, lower]])


@cache
def _best_extension(hanging: int, n: int = 16) -> Float:
    """Energy (4 n_sides, 4 n_sides) of boundary values of degree 2 on the sides of a unit square with hanging nodes on
    one of them, extended with n x n biquadratic elements."""
    polygon = subdivide(SQUARE, [hanging + 1, 1, 1, 1])
    size = 2 * n + 1
    values, slopes = (np.stack(f) for f in (_quadratic(gauss(4)[0]), _quadratic_slopes(gauss(4)[0])))
    rows = np.stack([np.einsum("iq,jp->qpji", slopes, values), np.einsum("iq,jp->qpji", values, slopes)]) * n
    weights = np.outer(gauss(4)[1], gauss(4)[1]).ravel() / n**2
    element = _isotropic(np.moveaxis(rows.reshape(2, 16, 9), 0, 1), weights)
    stiffness = np.zeros((2 * size**2, 2 * size**2))
    for i in range(n):
        for j in range(n):
            nodes = ((2 * j + np.arange(3))[:, None] * size + 2 * i + np.arange(3)).ravel()
            at = np.concatenate([nodes, size**2 + nodes])
            stiffness[np.ix_(at, at)] += element
    points = np.stack(np.meshgrid(np.linspace(0, 1, size), np.linspace(0, 1, size)), axis=-1).reshape(-1, 2)
    sides = len(polygon)
    trace, on_boundary = np.zeros((size**2, 2 * sides)), np.zeros(size**2, dtype=bool)
    for s in range(sides):
        a, along = polygon[s], polygon[(s + 1) % sides] - polygon[s]
        t = (points - a) @ along / (along @ along)
        here = (np.linalg.norm(points - a - t[:, None] * along, axis=1) < 1e-9) & (np.abs(t - 0.5) < 0.5 + 1e-9)
        trace[here] = 0.0
        trace[np.ix_(here, [s, sides + s, (s + 1) % sides])] = np.stack(_quadratic(t[here]), axis=1)
        on_boundary |= here
    both = np.tile(on_boundary, 2)
    inner, coupling = stiffness[np.ix_(~both, ~both)], stiffness[np.ix_(~both, both)]
    schur = stiffness[np.ix_(both, both)] - coupling.T @ np.linalg.solve(inner, coupling)
    boundary = np.kron(np.eye(2), trace[on_boundary])
    return boundary.T @ schur @ boundary


def _quadratic(t: Float) -> tuple[Float, Float, Float]:
    """Values of the quadratic polynomials of the nodes 0, 1/2, 1."""
    return (1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)


def _quadratic_slopes(t: Float) -> tuple[Float, Float, Float]:
    return 4 * t - 3, 4 - 8 * t, 4 * t - 1


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


def interface_errors(projection: str, n: int, r: int = 4) -> list[float] | None:
    """Errors of a manufactured solution of the nonlinear solid on n x n squares, r times finer in one half:
    displacement, gradient, and second gradient in the cells with hanging nodes; None if the space has no full rank."""
    from test_vem_convergence import SOLID, manufactured

    displacement, gradient, force = manufactured()
    settings = ElementSettings(projection=projection)
    try:
        system = make_system(interface_mesh(n, r), SOLID, CLAMPED, settings)
    except TmcError:
        return None
    system.set_body_force(force)
    u = interpolate(system, displacement)
    result = NewtonSolver(system).solve(u)
    assert result.converged, result.reason
    found = errors(system, u, displacement, lambda p: gradient(p).reshape(-1, 2, 2))
    return [*found, second_gradient_error(system, u, gradient)]


def voronoi_errors(n_cells: int, order: int) -> list[float]:
    """Errors of displacement and gradient of the same solution on Voronoi cells, and the number of cells."""
    from test_vem_convergence import solve

    mesh = voronoi(n_cells)
    return [*map(float, solve(mesh, order)), mesh.n_cells]


def second_gradient_error(system: VemSystem, u: Any, gradient: Callable[[Float], Float], step: float = 1e-5) -> float:
    """Root mean square error of G over the cells with more than four vertices. The solid's energy has no G, so its
    kernel's tables have none; those of the same cells and spaces are made anew."""
    nodes, mesh = system.nodal_values(u), system.distributed.mesh
    nodes_of = {
        c: a for block in system.blocks for c, a in zip(block.cells.tolist(), block.batch.nodes_ca, strict=True)
    }
    total = area = 0.0
    for group in build_elements(mesh, system.settings):
        if group.n_sides == 4:
            continue
        tables = group.tables.take(group.shape_c)
        polygons = np.stack([mesh.points_vx[mesh.cell(c)] for c in group.cells.tolist()])
        points_cqx, _ = points_and_values(polygons, system.settings.order, tables.xi_sqx)
        points, w = points_cqx.reshape(-1, 2), tables.w_sq
        local = nodes[np.stack([nodes_of[c] for c in group.cells.tolist()])]
        G = np.einsum("cqra,cai->cqri", tables.rows(6)[:, :, 2:], local)
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


def beam_force(cells: int, layers: int, r: int, projection: str) -> float | None:
    """Force at the end of a clamped beam, end displacement 0.1; None if the space does not have full rank."""
    conditions = (Prescribed("clamped", 0), Prescribed("clamped", 1), Prescribed("end", 1, 0.1))
    mesh, settings = beam_mesh(cells, layers, r), ElementSettings(projection=projection)
    try:
        system = make_system(mesh, region("solid", K=20.0, mu=10.0), conditions, settings)
    except TmcError:
        return None
    start = interpolate(system, lambda p: np.stack([0.0 * p[:, 0], 0.1 * (p[:, 0] / 10.0) ** 2], axis=1))
    result = NewtonSolver(system).solve(start)
    assert result.residual is not None, result.reason
    return float(system.reaction(result.residual, "end", 1))


if __name__ == "__main__":
    from pages.projection import BLOCKS
    from pages.study import main

    main(__doc__, BLOCKS, "projection-")
