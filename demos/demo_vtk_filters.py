"""What VTK's filters make of the fields of a run: strains from its Gradient filter, as written and in triangles.

Voronoi cells are true polygons in VTU files, in which VTK interpolates with inverse squared distances: its gradients
are near zero at their vertices. In the triangles that ``--triangulated`` writes they are those of the solution.

    python demos/demo_vtk_filters.py            # the numbers, and a picture
    python demos/demo_vtk_filters.py --quick    # the numbers
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyvista

from tmc_vem import Box, RunOptions, run


def strain(grid: pyvista.UnstructuredGrid) -> pyvista.UnstructuredGrid:
    """The grid with the derivative of u_y in y from VTK."""
    gradient = grid.compute_derivative(scalars="displacement")["gradient"]
    grid["du_y/dy"] = gradient.reshape(-1, 3, 3)[:, 1, 1]
    return grid


@dataclass(frozen=True)
class Strains:
    """The fields with VTK's strains, and the mean of du_y/dy by the outline, in triangles and in polygons."""

    whole: pyvista.UnstructuredGrid
    cut: pyvista.UnstructuredGrid
    means: tuple[float, float, float]


def mean_strains(out: Path) -> Strains:
    """Solve, and compare with the mean strain of the solution."""
    problem = Box(cells=(20, 10), uy=-0.1, cell_kind="voronoi")
    result = run(problem, out / "run", RunOptions(steps=2, snapshots=1, triangulated=True, overwrite=True))
    whole, cut = strain(result.to_pyvista()), strain(result.to_pyvista(triangulated=True))

    # the mean over the domain is what the displacements of its outline say, by Gauss' theorem
    means = []
    for grid in (cut, whole):
        sizes = grid.compute_cell_sizes()["Area"]
        means.append(float((grid.point_data_to_cell_data()["du_y/dy"] * sizes).sum() / sizes.sum()))
    top = np.isclose(whole.points[:, 1], 0.5)
    x, u_y = whole.points[top, 0], whole["displacement"][top, 1]
    order = np.argsort(x)
    exact = float((0.5 * (u_y[order][1:] + u_y[order][:-1]) * np.diff(x[order])).sum()) / (2.0 * 0.5)
    return Strains(whole, cut, (exact, means[0], means[1]))


def main() -> None:
    """Print the means, and draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("runs/demo-vtk-filters"))
    parser.add_argument("--quick", action="store_true", help="no picture")
    arguments = parser.parse_args()
    out = arguments.out

    found = mean_strains(out)
    whole, cut = found.whole, found.cut
    exact, triangles, polygons = found.means
    print(f"mean of du_y/dy: {exact:.4f} by the outline, {triangles:.4f} in triangles, {polygons:.4f} in polygons")
    assert abs(triangles - exact) < 0.1 * abs(exact)
    assert abs(polygons - exact) > 0.5 * abs(exact)

    if arguments.quick:
        return
    plotter = pyvista.Plotter(off_screen=True, shape=(2, 1), window_size=(1100, 600), border=False)
    for row, (grid, title) in enumerate(((whole, "polygons, as written"), (cut, "--triangulated"))):
        plotter.subplot(row, 0)
        bar = {
            "title": "du_y/dy",
            "vertical": True,
            "position_x": 0.88,
            "height": 0.7,
            "position_y": 0.12,
            "fmt": "%.1f",
        }
        plotter.add_mesh(
            grid.copy(), scalars="du_y/dy", cmap="viridis", clim=(-0.4, 0.0), lighting=False, scalar_bar_args=bar
        )
        plotter.add_mesh(whole.extract_all_edges(), color="black", line_width=0.6)
        plotter.add_text(title, font_size=9, position="upper_left", color="black")
        plotter.view_xy()
        plotter.camera.zoom(2.1)
    plotter.set_background("white")
    plotter.screenshot(out / "filters.png")


if __name__ == "__main__":
    main()
