"""A block that is pressed on a rigid base and pushed: finite and virtual elements find the same forces."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers_fem import FemSettings, FemSystem
from helpers_rub import rub
from helpers_system import make_system as make_vem
from mpi4py import MPI
from numpy.typing import NDArray

from tmc_vem import run
from tmc_vem.mesh import PolygonMesh
from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
from tmc_vem.problems import Material, Medium
from tmc_vem.problems.base import medium_region, solid_region
from tmc_vem.simulation.discretised import _kernels
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.solve.newton import NewtonSolver
from tmc_vem.system.constraints import Prescribed
from tmc_vem.system.control import Control
from tmc_vem.system.discretisation import Discretisation
from tmc_vem.system.histories import History
from tmc_vem.vem.spaces.element_settings import ElementSettings

Float = NDArray[np.float64]

GAP, HEIGHT = 0.05, 0.25
REGIONS = {
    "solid": solid_region(Material(K=20.0, mu=10.0)),
    "medium": medium_region(Medium(gamma=1e-4, alpha_r=0.1, beta=5.0, regulariser="huhu_lulu", friction=0.3), 10.0),
}
SUPPORTS = (
    Prescribed("base", 0),
    Prescribed("base", 1),
    Prescribed("top", 0, 0.004, History(((0.0, 0.0), (1.0, 0.0), (2.0, 1.0), (3.0, 0.0)))),
    Prescribed("top", 1, -0.0495, History(((0.0, 0.0), (1.0, 1.0), (4.0, 1.0)))),
)
LOADS = (0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 1.0, 1.05, 1.2, 1.4, 1.7, 2.0, 2.05, 2.2, 2.5, 2.8, 3.0)


def block() -> PolygonMesh:
    """Three columns of cells over a layer of two rows."""
    heights = np.array([0.0, 0.5 * GAP, GAP, 0.5 * (GAP + HEIGHT), HEIGHT])
    rectangles = [Rectangle("medium", 0.0, 0.6, 0.0, GAP), Rectangle("solid", 0.0, 0.6, GAP, HEIGHT)]
    mesh = structured_quadrilaterals(np.linspace(0.0, 0.6, 4), heights, rectangles)
    border = mesh.edges.vertices_ev[mesh.edges.n_cells_e == 1]
    y = mesh.points_vx[border][..., 1]
    edges = {name: border[(np.abs(y - at) < 1e-9).all(axis=1)] for name, at in (("base", 0.0), ("top", HEIGHT))}
    return replace(mesh, named_edges=edges)


def forces(system: Discretisation) -> tuple[Float, Float]:
    """Forces (n_loads, 2) that hold the top, and the shear of all points at the end, in an order of the points."""
    solver, found = NewtonSolver(system), []
    start, u = system.create_vector(), system.create_vector()
    for load in LOADS:
        assert solver.predict(start, Control(load), u), load
        result = solver.solve(u)
        assert result.converged, (load, result.reason)
        assert result.residual is not None
        found.append([system.reaction(result.residual, "top", i) for i in (0, 1)])
        X, tau = system.shear(u)
        system.advance(u)
        u.copy(start)
    return np.array(found), tau[np.lexsort(np.round(X, 9).T)]


def test_both_methods_find_the_same_forces() -> None:
    element = ElementSettings(rule="auto")
    kernels = {name: _kernels(name, region, element) for name, region in REGIONS.items()}
    vem, vem_shear = forces(make_vem(block(), kernels, SUPPORTS, element))
    fem, fem_shear = forces(FemSystem(MPI.COMM_WORLD, block, REGIONS, SUPPORTS, FemSettings(quadrature=6)))
    np.testing.assert_allclose(fem, vem, rtol=0, atol=1e-8 * np.abs(vem).max())
    np.testing.assert_allclose(fem_shear, vem_shear, rtol=0, atol=1e-7 * np.abs(vem_shear).max())
    ratio = vem[:, 0] / -vem[:, 1]
    at = dict(zip(LOADS, ratio.tolist(), strict=True))
    assert at[1.0] == pytest.approx(0.0, abs=1e-8)
    assert 0.0 < at[1.05] < at[1.2] < at[2.0]  # sticks first, then slides
    assert 0.27 < at[2.0] < 0.33
    assert at[2.0] > at[2.05] > at[2.2] > at[2.5]  # sticks again, then slides back
    assert -0.33 < at[3.0] < -0.27


def test_runs_on_triangles_go_on_with_the_same_bits(tmp_path: Path) -> None:
    """From a file, stopped in the middle of the slide."""
    medium = 'regulariser = "huhu_lulu", alpha_r = 0.1, beta = 5, mu = 10, gamma = 1e-4, friction = 0.3'
    path = rub(tmp_path, "steps = 3\nsnapshots = 0", medium, "[[1, 0], [2, 1]]")
    path.write_text(path.read_text().replace('"quadrilaterals"', '"triangles"'))
    given, options = read_problem(path)
    options = replace(options, method="fem")
    whole = run(given, None, options)
    assert whole.complete
    assert 0.0 < whole.history[-1].forces["slide"]["reaction"] < 0.031
    assert whole.checks["friction_error"]["largest"] > 0.0
    half = replace(options, max_iterations=sum(record.iterations for record in whole.history) - 5)
    stopped = run(given, tmp_path / "rub", half)
    assert stopped.cut_short
    assert 3 < len(stopped.history) < len(whole.history)
    done = run(given, tmp_path / "rub", options, resume=True)
    assert [replace(r, seconds=0.0) for r in done.history] == [replace(r, seconds=0.0) for r in whole.history]
