"""Virtual elements on the dual of a dolfinx mesh, and the solution back in dolfinx.

A script in dolfinx has a mesh of triangles and tags of its cells. Polygons around its vertices carry the virtual
elements; a problem file names the materials; the solution becomes a dolfinx function, which UFL's forms take.

    python demos/demo_fenicsx_polygons.py            # the numbers, and a picture
    python demos/demo_fenicsx_polygons.py --quick    # the numbers, on a coarse mesh
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import ufl
from mpi4py import MPI

from tmc_vem import RunOptions, run
from tmc_vem.fem import form, polygon_mesh, vector_space
from tmc_vem.mesh.files.io import write_mesh
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.simulation.sample import displacement_at, function_at, last_state, onto_function

from dolfinx import fem, mesh  # isort: skip  (after MPI and PETSc)

PROBLEM = """
name = "layers"
gap = ["upper", "lower"]
[mesh]
file = "dual.vtu"
[regions.solid]
solid = { K = 20, mu = 10 }
[regions.medium]
medium = { gamma = 1e-4, alpha_r = 0.1, mu = 10 }
[points]
lower = [1.0, 0.4]
upper = [1.0, 0.6]
[edges]
bottom = { line = [[0, 0], [1, 0]] }
top = { line = [[0, 1], [1, 1]] }
[[support]]
at = "bottom"
ux = 0
uy = 0
[[support]]
at = "top"
ux = 0
[load]
at = "top"
uy = -0.15
"""


def main() -> None:
    """Mesh in dolfinx, solution by virtual elements, and back."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("runs/demo-fenicsx-polygons"))
    parser.add_argument("--quick", action="store_true", help="a coarse mesh, no picture")
    arguments = parser.parse_args()
    out = arguments.out
    out.mkdir(parents=True, exist_ok=True)

    # %% A mesh with tags, as any script in dolfinx has it
    n = 10 if arguments.quick else 20
    corners = [np.array([0.0, 0.0]), np.array([1.0, 1.0])]
    domain = mesh.create_rectangle(MPI.COMM_SELF, corners, [n, n], mesh.CellType.triangle)
    cells = np.arange(domain.topology.index_map(2).size_local, dtype=np.int32)
    heights = mesh.compute_midpoints(domain, 2, cells)[:, 1]
    tags = mesh.meshtags(domain, 2, cells, (abs(heights - 0.5) < 0.1).astype(np.int32))

    # %% Polygons around its vertices
    # Outlines and the interface between the regions stay where they are.
    polygons = polygon_mesh(domain, tags, regions={0: "solid", 1: "medium"}, dual=True)
    write_mesh(polygons, out / "dual.vtu")
    (out / "layers.toml").write_text(PROBLEM)
    sides, numbers = np.unique(polygons.n_sides_c, return_counts=True)
    print(
        f"{polygons.n_cells} polygons; sides: " + ", ".join(f"{s} ({k})" for s, k in zip(sides, numbers, strict=True))
    )

    # %% A run, as from the command line
    problem, _ = read_problem(out / "layers.toml")
    result = run(problem, out / "run", RunOptions(steps=5, overwrite=True))
    print(f"gap {result.gap:.4f}, reaction {result.reaction:.4f}, {result.newton_iterations} iterations")

    # %% The solution as a dolfinx function, and back
    system, state = last_state(problem, out / "run", RunOptions(steps=5))
    u = fem.Function(vector_space(domain, 2))
    onto_function(system, state, u)
    x = ufl.SpatialCoordinate(domain)
    middle = ufl.conditional(ufl.lt(abs(x[1] - 0.5), 0.1), 1.0, 0.0)
    deformed = ufl.det(ufl.Identity(2) + ufl.grad(u))
    volume = fem.assemble_scalar(form(middle * deformed * ufl.dx))
    points = np.array([[0.5, 0.3], [0.33, 0.5], [1.0, 0.6]])
    here, there = function_at(u, points), displacement_at(system, state, points)
    print(f"area of the medium: {volume:.5f} of {0.2:.5f}; displacements agree to {abs(here - there).max():.1e}")
    top = np.linspace(0.0, 1.0, 21)
    assert abs(function_at(u, np.column_stack([top, np.ones(21)]))[:, 1] + 0.15).max() < 1e-12
    assert abs(here - there).max() < 2e-3
    # all but the lateral bulging of the medium is closed: the solid is 1e4 times as stiff
    assert 0.0 < result.gap < 0.1
    assert 0.0 < volume < 0.2

    if arguments.quick:
        return
    (out / "run" / "deformed.png").replace(out / "fenicsx_polygons.png")


if __name__ == "__main__":
    main()
