"""Probes of fields and recovered stresses of a graded block: the same on any ranks, and nearly so with both methods."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from helpers_process import tmc
from test_mpi_graded import PROBLEM, folder

from tmc_vem import RunResult
from tmc_vem.results.export import fields_at

PROBES = """[probes]
point = { value = "von_mises", at = [0.55, 0.35] }
edge = { value = "cauchy_stress_yy", at = [0.2, 0.6], region = "gap" }
peak = { largest = "von_mises", region = "block" }
least = { smallest = "principal_stress_3", region = "block" }
mean = { mean = "hydrostatic_stress", region = "block" }
line = { integral = "first_piola_stress_yY", line = [[0.0, 0.3], [1.0, 0.3]] }
side = { integral = "first_piola_stress_yY", edges = "bottom" }
moved = { mean = "uy", line = [[0.0, 0.0], [1.0, 1.0]] }
shift = { integral = "uy", region = "gap" }
stored = { energy = "stored", region = "block" }
through = { cut_force = "y", line = [[-0.1, 0.4], [1.1, 0.4]] }
turning = { cut_force = "moment", line = [[0.0, 0.4], [1.0, 0.4]] }
held = { reaction = "uy", at = "bottom" }
"""
__all__ = ["folder"]


@pytest.fixture(scope="module")
def runs(folder: Path) -> dict[str, RunResult]:
    problem = folder / "probed.toml"
    problem.write_text(PROBLEM + PROBES)
    found = {}
    for name, ranks, more in (("one", 1, ()), ("three", 3, ()), ("fem", 1, ("--method", "fem"))):
        out = folder / f"stress-{name}"
        done = tmc("run", str(problem), "--out", str(out), "--quiet", *more, ranks=ranks)
        assert done.returncode == 0, done.stderr
        found[name] = RunResult.read(out)
    return found


def test_probes_are_those_of_one_rank(runs: dict[str, RunResult]) -> None:
    one, three = (dict(runs[name].probes) for name in ("one", "three"))
    assert three == pytest.approx(one, rel=1e-7, abs=1e-9)
    assert one["through"] == pytest.approx(one["held"], rel=1e-7)  # of the lower part, on the right, on the upper one
    assert one["line"] == pytest.approx(-one["through"], rel=0.03)
    assert one["moved"] < 0.0


def test_files_of_ranks_have_the_same_stresses(runs: dict[str, RunResult]) -> None:
    one, three = (fields_at(runs[name], 1.0) for name in ("one", "three"))
    at = {(*point, region): value for fields in (one,) for point, region, value in zip(*_by_point(fields), strict=True)}
    assert len(three.polygons.points_nx) > len(one.polygons.points_nx)
    for point, region, value in zip(*_by_point(three), strict=True):
        assert value == pytest.approx(at[*point, region], rel=1e-7, abs=1e-9)
    assert np.sort(three.cell_fields["von_mises"]) == pytest.approx(np.sort(one.cell_fields["von_mises"]), rel=1e-7)


def test_finite_elements_on_the_same_mesh_agree(runs: dict[str, RunResult]) -> None:
    vem, fem = (runs[name].probes for name in ("one", "fem"))
    for name in ("point", "mean", "line", "through", "stored", "moved"):
        assert fem[name] == pytest.approx(vem[name], rel=0.05), name


def _by_point(fields):
    polygons = fields.polygons
    region = np.empty(len(polygons.points_nx), dtype=int)
    region[polygons.connectivity] = np.repeat(polygons.region_c, np.diff(polygons.offsets))
    rounded = [tuple(point) for point in np.round(polygons.points_nx, 9).tolist()]
    return rounded, region.tolist(), fields.point_fields["von_mises"].tolist()
