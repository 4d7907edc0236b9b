"""Recovered stresses of plates and rings against closed forms of linear elasticity, in small strain."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tmc_vem import RunOptions, RunResult, run
from tmc_vem.mesh.files.io import write_mesh
from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.support.errors import InputError

K, MU = 20.0, 10.0
INNER, OUTER, PRESSURE = 1.0, 2.0, 1e-3
HEAD = f'mesh = {{ file = "body.vtu" }}\nregions = {{ block = {{ solid = {{ K = {K}, mu = {MU} }} }} }}\n'
RING = f"""name = "ring"
{HEAD}
[edges]
inner = {{ circle = [0.0, 0.0, {INNER}] }}
left = {{ line = [[0.0, {INNER}], [0.0, {OUTER}]] }}
bottom = {{ line = [[{INNER}, 0.0], [{OUTER}, 0.0]] }}
[[support]]
at = "left"
ux = 0
[[support]]
at = "bottom"
uy = 0
[[load]]
at = "inner"
pressure = {PRESSURE}
"""
LONG = 10.0
BEAM = f"""name = "beam"
{HEAD}
[edges]
left = {{ line = [[0.0, 0.0], [0.0, 1.0]] }}
right = {{ line = [[{LONG}, 0.0], [{LONG}, 1.0]] }}
[[support]]
at = "left"
ux = 0
uy = 0
[[load]]
at = "right"
uy = -1e-3
[probes]
moment = {{ cut_force = "moment", line = [[5.0, 0.0], [5.0, 1.0]] }}
shear = {{ cut_force = "y", line = [[5.0, 0.0], [5.0, 1.0]] }}
top = {{ value = "cauchy_stress_xx", at = [5.0, 1.0] }}
bottom = {{ value = "cauchy_stress_xx", at = [5.0, 0.0] }}
between = {{ value = "cauchy_stress_xx", at = [4.3, 0.8] }}
middle = {{ value = "cauchy_stress_xy", at = [5.25, 0.5] }}
largest = {{ largest = "cauchy_stress_xx", line = [[4.0, 1.0], [6.0, 1.0]] }}
section = {{ integral = "cauchy_stress_xy", line = [[6.25, 0.0], [6.25, 1.0]] }}
"""


def solved(where: Path, mesh: PolygonMesh, text: str) -> RunResult:
    write_mesh(mesh, where / "body.vtu")
    (where / "body.toml").write_text(text)
    return run(read_problem(where / "body.toml")[0], None, RunOptions(steps=1, snapshots=0))


def quarter_ring(around: int, across: int) -> PolygonMesh:
    """Rectangles of radius and angle, bent to a quarter of the ring."""
    angles = np.linspace(0.0, np.pi / 2.0, around + 1)
    mesh = structured_quadrilaterals(
        np.linspace(INNER, OUTER, across + 1), angles, [Rectangle("block", INNER, OUTER, 0.0, float(angles[-1]))]
    )
    r, angle = mesh.points_vx.T
    points = np.column_stack([r * np.cos(angle), r * np.sin(angle)])
    points[np.abs(points) < 1e-12] = 0.0
    return PolygonMesh(points, mesh.cell_offsets, mesh.cell_vertices, mesh.region_c, mesh.region_names, {}, {})


def test_a_ring_under_pressure_has_the_stress_of_lame(tmp_path: Path) -> None:
    """Hoop and radial stress A +- B / r^2, 2 nu A across the plane; at nodes of both rims and within cells."""
    A = PRESSURE * INNER**2 / (OUTER**2 - INNER**2)
    B, nu = A * OUTER**2, (3.0 * K - 2.0 * MU) / (2.0 * (3.0 * K + MU))
    places = {
        name: (r * np.cos(angle), r * np.sin(angle))
        for name, r, angle in (("inside", INNER, np.pi / 4), ("within", 1.37, 0.2), ("outside", OUTER, np.pi / 4))
    }
    fields = ("in_plane_stress_1", "in_plane_stress_2", "cauchy_stress_zz", "von_mises", "principal_stress_2")
    probes = "".join(
        f'{place}_{field} = {{ value = "{field}", at = [{x!r}, {y!r}] }}\n'
        for place, (x, y) in ((place, map(float, at)) for place, at in places.items())
        for field in fields
    )
    values = solved(tmp_path, quarter_ring(24, 12), f"{RING}[probes]\n{probes}").probes
    for place, at in places.items():
        r = float(np.hypot(*at))
        hoop, radial, zz = A + B / r**2, A - B / r**2, 2.0 * nu * A
        mises = np.sqrt(0.5 * ((hoop - radial) ** 2 + (radial - zz) ** 2 + (zz - hoop) ** 2))
        found = [values[f"{place}_{field}"] for field in fields]
        assert found == pytest.approx([hoop, radial, zz, mises, zz], abs=0.01 * PRESSURE), place


def test_a_cut_that_ends_in_a_body_is_refused_and_one_beyond_its_outline_is_in_equilibrium(tmp_path: Path) -> None:
    """The sides nearest to an oblique cut end beyond it at the outline: a line that ends there would lose them."""
    out = np.array([np.cos(0.62), np.sin(0.62)])
    cut = "[probes]\np = {{ cut_force = 'normal', line = [{}, {}] }}\n"
    for low, high in ((INNER, OUTER + 0.1), (INNER - 0.1, 1.8), (1.2, 1.8)):
        with pytest.raises(InputError, match=r"p: the cut from .* ends in block, whose cells it parts up to .*outside"):
            solved(tmp_path, quarter_ring(12, 4), RING + cut.format((low * out).tolist(), (high * out).tolist()))
    text = RING + cut.format((0.8 * out).tolist(), (2.2 * out).tolist())
    assert solved(tmp_path, quarter_ring(12, 4), text).probes["p"] == pytest.approx(PRESSURE * INNER, rel=0.01)


def test_a_cantilever_has_the_stress_of_beam_theory(tmp_path: Path) -> None:
    """sigma = M y / I, tension where it is stretched, and a parabola of shear, 3/2 of its mean in the middle."""
    block = [Rectangle("block", 0.0, LONG, 0.0, 1.0)]
    mesh = structured_quadrilaterals(np.linspace(0.0, LONG, 21), np.linspace(0.0, 1.0, 3), block)
    result = solved(tmp_path, mesh, BEAM)
    values, load = result.probes, -result.reaction
    inertia = 1.0 / 12.0
    assert load > 0.0
    assert values["shear"] == pytest.approx(-load, rel=1e-9)
    assert values["moment"] == pytest.approx(-5.0 * load, rel=1e-3)  # clockwise, of what is on the right
    assert values["top"] == pytest.approx(5.0 * load * 0.5 / inertia, rel=0.01)
    assert values["bottom"] == pytest.approx(-5.0 * load * 0.5 / inertia, rel=0.01)
    assert values["between"] == pytest.approx(5.7 * load * 0.3 / inertia, rel=0.02)
    assert values["largest"] == pytest.approx(6.0 * load * 0.5 / inertia, rel=0.01)
    assert values["middle"] == pytest.approx(-1.5 * load, rel=0.02)
    assert values["section"] == pytest.approx(-load, rel=0.02)
