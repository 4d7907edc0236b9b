"""A third medium in a plain dolfinx script: the energies as a library.

The arms of a C are pressed together in dolfinx, by Newton's method on PETSc matrices and nothing else of tmc-vem than
the energies. The same potential in tmc-vem's own finite elements has the same value at the state that is found.

    python demos/demo_fenicsx_medium.py            # the numbers, and a picture
    python demos/demo_fenicsx_medium.py --quick    # the numbers, on a coarse mesh
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
import ufl
from mpi4py import MPI

from tmc_vem.energy import get_regulariser, hyperelastic_solid, third_medium
from tmc_vem.fem import energy_density, form, interior_penalty, measures, polygon_mesh, vector_space
from tmc_vem.support.petsc import PETSc

from dolfinx import fem, mesh  # isort: skip  (after MPI and PETSc)
from dolfinx.fem import petsc  # isort: skip

SOLID = {"K": 20.0, "mu": 10.0}
MEDIUM = {"mu": 10.0, "gamma": 1e-5, "alpha_r": 1.0, "beta": 5.0}

# %% The potential
# The medium fills the opening of the C. Its energy is (4) of the paper,
# $\gamma\,(\psi_m(F) + \alpha_r\, e^{-\beta J} \psi_r(F, G))$ with $G = \nabla\nabla u$, and gradients that
# jump between elements are penalised on the facets within it.


def potential(domain: Any, u: Any) -> Any:
    """Solid in the C, third medium in its opening."""
    n_cells = domain.topology.index_map(2).size_local + domain.topology.index_map(2).num_ghosts
    x, y, _ = mesh.compute_midpoints(domain, 2, np.arange(n_cells, dtype=np.int32)).T
    opening = (x > 0.2) & (abs(y - 0.5) < 0.2)
    solid, medium = hyperelastic_solid(), third_medium(get_regulariser("huhu_lulu"), damped=True)
    dx, dS = measures(domain, opening)
    in_cells = energy_density(u, solid, SOLID) * dx(0) + energy_density(u, medium, MEDIUM) * dx(1)
    return in_cells + interior_penalty(u, medium, MEDIUM) * dS(1)


# %% Newton's method
# The held degrees of freedom get their displacement with the first correction of a load step: PETSc eliminates them
# from the tangent and corrects the right-hand side. A correction beyond $J = 0$, where the energy is no number,
# is halved.


def solve(u: Any, energy: Any, held: Any, step: Any, n_steps: int) -> int:
    """Add ``step`` to the held degrees of freedom, ``n_steps`` times; the number of iterations."""
    space = u.function_space
    residual = ufl.derivative(energy, u, ufl.TestFunction(space))
    tangent = form(ufl.derivative(residual, u, ufl.TrialFunction(space)))
    residual, energy = form(residual), form(energy)
    solver = PETSc.KSP().create(PETSc.COMM_SELF)
    solver.setType("preonly")
    solver.getPC().setType("lu")
    solver.getPC().setFactorSolverType("mumps")
    matrix, iterations = petsc.create_matrix(tangent), 0
    for _ in range(n_steps):
        increment, size = step.copy(), np.inf
        while size > 1e-10:
            matrix.zeroEntries()
            petsc.assemble_matrix(matrix, tangent)
            matrix.assemble()
            rhs, correction = matrix.createVecLeft(), matrix.createVecRight()
            fem.assemble_vector(rhs.getArray(), residual)
            rhs.scale(-1.0)
            correction.getArray()[held] = increment
            matrix.zeroRowsColumns(held, diag=1.0, x=correction, b=rhs)
            solver.setOperators(matrix)
            solver.solve(rhs, correction)
            before, part = u.x.array.copy(), 1.0
            u.x.array[:] += correction.getArray()
            while not np.isfinite(fem.assemble_scalar(energy)):
                part /= 2
                u.x.array[:] = before + part * correction.getArray()
            increment, size = (1 - part) * increment, float(abs(correction.getArray()).max())
            iterations += 1
            assert iterations < 20 * n_steps, "no convergence"
    return iterations


def main() -> None:
    """Press, compare, draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("runs/demo-fenicsx-medium"))
    parser.add_argument("--quick", action="store_true", help="a coarse mesh, no picture")
    arguments = parser.parse_args()

    n = 10 if arguments.quick else 20
    corners = [np.array([0.0, 0.0]), np.array([1.0, 1.0])]
    domain = mesh.create_rectangle(MPI.COMM_SELF, corners, [n, n], mesh.CellType.quadrilateral)
    u = fem.Function(vector_space(domain, 2))
    energy = potential(domain, u)

    # the bottom is held, and the end of the upper arm goes down
    x, y, _ = u.function_space.tabulate_dof_coordinates().T
    bottom, end = np.flatnonzero(y < 1e-9), np.flatnonzero((y > 1 - 1e-9) & (x > 0.8 - 1e-9))
    held = np.concatenate([2 * bottom, 2 * bottom + 1, 2 * end + 1]).astype(PETSc.IntType)
    n_steps, depth = 30, -0.3
    step = np.concatenate([np.zeros(2 * len(bottom)), np.full(len(end), depth / n_steps)])
    iterations = solve(u, energy, held, step, n_steps)
    found = fem.assemble_scalar(form(energy))

    # %% The same in tmc-vem
    # The dolfinx mesh becomes a polygon mesh, on which tmc-vem's own finite elements have the same potential. The
    # solution goes there by its values at the nodes.
    from tmc_vem.fem.system import FemSystem
    from tmc_vem.problems.base import RegionEnergy
    from tmc_vem.simulation.sample import function_at
    from tmc_vem.system.fem_settings import FemSettings

    n_cells = domain.topology.index_map(2).size_local
    midpoints = mesh.compute_midpoints(domain, 2, np.arange(n_cells, dtype=np.int32))
    opening = (midpoints[:, 0] > 0.2) & (abs(midpoints[:, 1] - 0.5) < 0.2)
    tags = mesh.meshtags(domain, 2, np.arange(n_cells, dtype=np.int32), opening.astype(np.int32))
    polygons = polygon_mesh(domain, tags, regions={0: "solid", 1: "medium"})
    medium = third_medium(get_regulariser("huhu_lulu"), damped=True)
    regions = {
        "solid": RegionEnergy(hyperelastic_solid(), SOLID),
        "medium": RegionEnergy(medium, MEDIUM, is_medium=True),
    }
    system = FemSystem(MPI.COMM_SELF, lambda: polygons, regions, settings=FemSettings(interior_penalty="full"))
    state = system.create_vector()
    state.getArray()[:] = function_at(u, system.nodes.points_nx).ravel()
    expected = system.energy(state).energy
    lips = function_at(u, np.array([[1.0, 0.3], [1.0, 0.7]]))
    opening_left = 0.4 + lips[1, 1] - lips[0, 1]
    print(f"{iterations} iterations; the opening is {opening_left:.4f} of 0.4 wide")
    print(f"energy {found:.12e} in dolfinx, {expected:.12e} in tmc-vem")
    assert abs(found - expected) < 1e-10 * expected
    assert 0.05 < opening_left < 0.1

    if arguments.quick:
        return
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.collections import PolyCollection

    moved = polygons.points_vx + function_at(u, polygons.points_vx)
    cells = polygons.cell_vertices.reshape(-1, 4)
    figure, axes = plt.subplots(figsize=(4, 4))
    colours = np.where(polygons.region_c == polygons.region_names.index("solid"), "steelblue", "white")
    axes.add_collection(PolyCollection(moved[cells], facecolors=colours, edgecolors="gray", linewidths=0.4))
    axes.autoscale_view()
    axes.set_aspect("equal")
    axes.axis("off")
    arguments.out.mkdir(parents=True, exist_ok=True)
    figure.savefig(arguments.out / "fenicsx_medium.png", dpi=150)


if __name__ == "__main__":
    main()
