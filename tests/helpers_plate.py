"""Problem files of a plate, 2 x 1, straight or turned, with whatever loads."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tmc_vem import RunOptions, run
from tmc_vem.mesh.files.io import write_mesh
from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
from tmc_vem.mesh.parts import with_names
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems.own import OwnProblem
from tmc_vem.results.run_result import RunResult
from tmc_vem.simulation.problem_file import read_problem

CORNERS = ((0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0))
SIDES = ("bottom", "right", "top", "left")
HEAD = """name = "plate"
mesh = { file = "plate.vtu" }
regions = { block = { solid = { K = 20, mu = 10 } } }
"""
LEFT_AND_BOTTOM = """[[support]]
at = "left"
ux = 0
[[support]]
at = "bottom"
uy = 0
"""


def turned(degrees: float, *points: Sequence[float]) -> list[tuple[float, float]]:
    """Points, or vectors, turned about the origin."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return [(c * x - s * y, s * x + c * y) for x, y in points]


def plate(degrees: float = 0.0, cells: tuple[int, int] = (4, 2)) -> PolygonMesh:
    """The plate in rectangles, turned about the origin; corners are a, b, c, d, sides have names."""
    x, y = (np.linspace(0.0, size, count + 1) for size, count in zip((2.0, 1.0), cells, strict=True))
    ends = {side: (CORNERS[n], CORNERS[(n + 1) % 4]) for n, side in enumerate(SIDES)}
    block = [Rectangle("block", 0.0, 2.0, 0.0, 1.0)]
    mesh = with_names(structured_quadrilaterals(x, y, block), dict(zip("abcd", CORNERS, strict=True)), ends)
    points = np.array(turned(degrees, *mesh.points_vx)) if degrees else mesh.points_vx
    return PolygonMesh(
        points, mesh.cell_offsets, mesh.cell_vertices, mesh.region_c, mesh.region_names, mesh.named_points,
        mesh.named_edges,
    )  # fmt: skip


def file_of(directory: Path, text: str, degrees: float = 0.0) -> Path:
    """A problem file about the plate."""
    mesh = directory / "plate.vtu"
    if not mesh.exists():
        write_mesh(plate(degrees), mesh)
    corners = turned(degrees, *CORNERS) if degrees else CORNERS
    edges = [f"{side} = {{ line = [{[*corners[n]]}, {[*corners[(n + 1) % 4]]}] }}\n" for n, side in enumerate(SIDES)]
    points = [f"{name} = {[*corner]}\n" for name, corner in zip("abcd", corners, strict=True)]
    path = directory / "plate.toml"
    path.write_text(HEAD + "[points]\n" + "".join(points) + "[edges]\n" + "".join(edges) + text)
    return path


def problem_of(directory: Path, text: str, degrees: float = 0.0) -> OwnProblem:
    """The problem in such a file."""
    return read_problem(file_of(directory, text, degrees))[0]


def result_of(directory: Path, text: str, degrees: float = 0.0, **options: object) -> RunResult:
    """The result of such a file."""
    method = options.pop("method", "vem")
    return run(problem_of(directory, text, degrees), options=RunOptions(method, **options))  # type: ignore[arg-type]
