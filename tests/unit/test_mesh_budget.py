"""Estimates of the number of cells against meshes, and what is refused before it is meshed."""

from __future__ import annotations

import resource
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_problem_file import SMALL, small

from tmc_vem import Box
from tmc_vem.cli.main import _run
from tmc_vem.mesh.cell_count import POLYGONS, QUADRILATERALS, TRIANGLES
from tmc_vem.mesh.make.estimate import check_size, estimate
from tmc_vem.mesh.make.outline import Arc, Region
from tmc_vem.mesh.make.triangles import triangle_mesh
from tmc_vem.mesh.make.voronoi import voronoi_mesh
from tmc_vem.problems import Bodies, CBox, Punch
from tmc_vem.simulation.triangulated import Triangulated
from tmc_vem.support.environment import MOST_CELLS, VARIABLE, cells_allowed
from tmc_vem.support.errors import InputError

SQUARE = [Region("domain", [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])]
HALF_DISC = [Region("domain", [Arc((0.0, 0.0), 1.0, 0.0, 180.0)])]


def near_a_line(smallest: float) -> Callable[[Any], Any]:
    return lambda points: np.minimum(0.1, smallest + 0.3 * np.abs(points[:, 0] - 0.5))


@pytest.mark.parametrize("regions", [SQUARE, HALF_DISC], ids=["square", "half disc"])
@pytest.mark.parametrize("size", [0.03, near_a_line(0.01)], ids=["uniform", "refined"])
def test_estimates_are_near_what_is_made(regions: list[Region], size: Any) -> None:
    assert estimate(regions, size, POLYGONS, MOST_CELLS).n_cells == pytest.approx(
        voronoi_mesh(regions, size).n_cells, rel=0.1
    )
    pytest.importorskip("gmsh")
    triangles = triangle_mesh(regions, size)
    assert estimate(regions, size, TRIANGLES, MOST_CELLS).n_cells == pytest.approx(triangles.n_cells, rel=0.2)
    quadrilaterals = triangle_mesh(regions, size, quadrilaterals=True)
    assert estimate(regions, size, QUADRILATERALS, MOST_CELLS).n_cells == pytest.approx(
        quadrilaterals.n_cells, rel=0.35
    )


@pytest.mark.parametrize("h", [0.05, 0.02, 0.01])
def test_an_estimate_is_the_area_of_the_domain_alone(h: float) -> None:
    """In boxes as they begin, in quarters of them, and in quarters of those."""
    size = lambda points: np.full(len(points), h)  # noqa: E731
    assert estimate(HALF_DISC, size, 1.0, MOST_CELLS).n_cells == pytest.approx(0.5 * np.pi / h**2, rel=2e-3)


def test_small_cells_beside_the_domain_do_not_count() -> None:
    """At a corner of the box around the half disc, 0.41 from it."""
    size = lambda points: 1e-3 + np.hypot(points[:, 0] - 1.0, points[:, 1] - 1.0)  # noqa: E731
    assert estimate(HALF_DISC, size, 1.0, MOST_CELLS).smallest == pytest.approx(np.sqrt(2.0) - 1.0, rel=0.1)


def test_estimate_near_a_line_is_the_integral() -> None:
    """2 int_0 dr / (s + g r)^2 up to the largest size, and the rest of the square."""
    for s in (1e-2, 1e-3, 1e-4):
        reach = (0.1 - s) / 0.3
        exact = 2.0 * (1.0 / s - 1.0 / 0.1) / 0.3 + (1.0 - 2.0 * reach) / 0.1**2
        assert estimate(SQUARE, near_a_line(s), POLYGONS, MOST_CELLS).n_cells == pytest.approx(exact, rel=0.06)


def test_an_estimate_without_end_is_cut_and_says_so() -> None:
    found = estimate(SQUARE, near_a_line(1e-12), POLYGONS, MOST_CELLS)
    assert found.at_least
    assert found.n_cells > MOST_CELLS
    with pytest.raises(InputError, match=r"at least .* cells, more than 1e.06: cells down to size .*use larger sizes"):
        check_size(SQUARE, near_a_line(1e-12), POLYGONS, MOST_CELLS)


def strip() -> list[Region]:
    return [Region("domain", [(0.0, 0.0), (1e9, 0.0), (1e9, 10.0), (0.0, 10.0)])]


ATTEMPTS: dict[str, Callable[[], Any]] = {
    "tiny polygons": lambda: voronoi_mesh(SQUARE, 1e-4),
    "tiny triangles": lambda: triangle_mesh(SQUARE, 5e-4),
    "tiny quadrilaterals": lambda: triangle_mesh(SQUARE, 1e-9, quadrilaterals=True),
    "refined polygons": lambda: voronoi_mesh(SQUARE, near_a_line(1e-7)),
    "refined triangles": lambda: triangle_mesh(SQUARE, near_a_line(1e-7)),
    "a long strip": lambda: triangle_mesh(strip(), 0.5),
    "a long refined strip": lambda: voronoi_mesh(strip(), lambda points: np.full(len(points), 0.5)),
    "punch": lambda: Punch(size=1e-4).make_mesh(),
    "bodies": lambda: Bodies(size=1e-4).make_mesh(),
    "box": lambda: Box(cells=(4000, 1000)),
    "box, hanging nodes": lambda: Box(cells=(400, 100), medium_refinement=16),
    "cbox, hanging nodes": lambda: CBox(cells=(400, 200), medium_refinement=16),
    "triangles of a benchmark": lambda: Triangulated(Box(cells=(20, 5)), 1e-5).make_mesh(),
}


@pytest.mark.parametrize("name", ATTEMPTS)
def test_too_many_cells_are_refused_at_once_in_little_memory(name: str) -> None:
    if "triangles" in name or "strip" in name or "quadrilaterals" in name:
        pytest.importorskip("gmsh")
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(InputError, match=rf"would have (about|at least) .* cells, more than 1e\+06.*{VARIABLE}"):
        ATTEMPTS[name]()
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 1e6  # kB


GEO = """
Point(1) = {0, 0, 0, H}; Point(2) = {1, 0, 0, H}; Point(3) = {1, 1, 0, H}; Point(4) = {0, 1, 0, H};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4}; Plane Surface(1) = {1}; Physical Surface("block") = {1};
"""


def test_the_command_line_refuses_them_in_one_line(tmp_path: Path, capsys: Any) -> None:
    pytest.importorskip("gmsh")
    for name, size in (("fine", "0.0005"), ("finest", "1e-9")):
        (tmp_path / f"{name}.geo").write_text(GEO.replace("H", size))
    file = 'name = "a"\n[mesh]\nfile = "fine.geo"\n[regions.block]\nsolid = { K = 2, mu = 1 }\n[[support]]\n'
    file += 'at = "b"\nux = 0\n[load]\nat = "b"\nuy = 1\n'
    (tmp_path / "geo.toml").write_text(file)
    (tmp_path / "finest.toml").write_text(file.replace("fine.geo", "finest.geo"))
    plug, out = small(tmp_path, SMALL.replace("size = 0.1", "size = 0.0001")), tmp_path / "out.vtu"
    voronoi = tmp_path / "voronoi.toml"
    refined = "size = 0.1\nrefine = [{ near = [[0, 0.4], [1, 0.4]], size = 1e-8 }]"
    voronoi.write_text(SMALL.replace("size = 0.1", refined).replace("triangles", "voronoi"))
    rectangle = ["mesh", "generate", "rectangle", "--out", str(out), "--kind"]
    for arguments in (
        ["run", str(plug)],
        ["run", str(voronoi)],
        ["run", str(tmp_path / "geo.toml")],
        ["run", str(tmp_path / "finest.toml")],
        ["run", "punch", "--size", "1e-5"],
        [
            "run",
            "box",
            "--cells",
            "40",
            "10",
            "--refine-medium",
            "64",
            "--mesh",
            "quadrilaterals",
            "--cells",
            "1000",
            "250",
        ],
        [*rectangle, "quadrilaterals", "--size", "1e-7"],
        [*rectangle, "voronoi", "--size", "1e-7"],
        [*rectangle, "triangles", "--size", "1e-7"],
        ["mesh", "generate", "bodies", "--size", "1e-6", "--out", str(out)],
        ["mesh", "generate", "box", "--cells", "20000", "5000", "--out", str(out)],
    ):
        assert _run(arguments) == 2, arguments
        message = capsys.readouterr().err.strip()
        assert len(message.splitlines()) == 1, message
        assert "cells, more than 1e+06" in message, message
        assert not out.exists()


def test_the_limit_can_be_changed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "300")
    with pytest.raises(InputError, match=r"about 4e.02 cells, more than 300"):
        voronoi_mesh(SQUARE, 0.05)
    assert voronoi_mesh(SQUARE, 0.05, most_cells=1000).n_cells > 300  # what is given goes before the environment
    with pytest.raises(InputError, match=r"cells, more than 200"):
        voronoi_mesh(SQUARE, 0.05, most_cells=200)
    monkeypatch.setenv(VARIABLE, "3e7")
    assert Box(cells=(4000, 1000)).cells == (4000, 1000)
    for wrong in ("many", "-1", "nan"):
        monkeypatch.setenv(VARIABLE, wrong)
        with pytest.raises(InputError, match=f"{VARIABLE} = '{wrong}'"):
            cells_allowed()
