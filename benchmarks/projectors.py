"""Microseconds a distinct polygon of the steps that give an element its projectors.

    python benchmarks/projectors.py

Relaxed Voronoi cells, none congruent to another, in pieces that stay in the cache, as in set-up.
"""

from __future__ import annotations

import numpy as np
from harness import interleaved, report
from meshes import square
from numpy.typing import NDArray

from tmc_vem.vem.spaces.candidates import cell_rule
from tmc_vem.vem.spaces.composite import CompositeSpace
from tmc_vem.vem.spaces.element import CHUNK
from tmc_vem.vem.spaces.element_settings import ElementSettings
from tmc_vem.vem.spaces.quadrature import sub_triangles
from tmc_vem.vem.spaces.spaces import FullSpace, Shapes
from tmc_vem.vem.spaces.stability import StabilityTest, stabilised_tangent
from tmc_vem.vem.spaces.tabulated import tabulate


def measure(polygons: NDArray[np.float64]) -> dict[str, float]:
    """Seconds a polygon of every step."""
    ((_, triangles),) = sub_triangles(polygons)
    full, composite, settings = FullSpace(3), CompositeSpace(2), ElementSettings()
    shapes = Shapes.of(polygons, triangles, 2, 3)
    rule = cell_rule(settings, full, polygons, triangles)
    tables, test, every = tabulate(shapes, full, rule), StabilityTest(shapes), np.arange(len(polygons))

    def geometry() -> Shapes:
        return Shapes.of(polygons, triangles, 2, 3)

    work = {
        "geometry and Pi_nabla_2": geometry,
        "the same and coefficients for l = 3": lambda: full.gradients(geometry()),
        "the same and six derivative rows at all points": lambda: tabulate(geometry(), full, rule).rows(),
        "coefficients, composite": lambda: composite.gradients(shapes),
        "quadrature rule": lambda: cell_rule(settings, full, polygons, triangles),
        "stabilised reference": lambda: stabilised_tangent(shapes.geometry, shapes.elliptic_cad, shapes.order),
        "stability test": lambda: test.passes(tables, every, 0.1),
    }
    return {label: sample.best / len(polygons) for label, sample in interleaved(work, 9).items()}


def main() -> None:
    """Print times and write them."""
    mesh = square("voronoi", 8000)
    results = {}
    for n in (5, 6):
        cells = np.flatnonzero(mesh.n_sides_c == n)[:CHUNK]
        polygons = mesh.points_vx[np.stack([mesh.cell(c) for c in cells.tolist()])]
        results |= {f"{n} sides: {label}": seconds for label, seconds in measure(polygons).items()}
    rows = [(label, f"{1e6 * seconds:.1f}") for label, seconds in results.items()]
    report("projectors", "Microseconds a distinct polygon", ("step", "us"), rows, {"results": results})


if __name__ == "__main__":
    main()
