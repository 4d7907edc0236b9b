"""Stress and strain of runs: in files, PyVista, meshio and pandas, in pictures, and where they are withheld."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from helpers_plate import LEFT_AND_BOTTOM, file_of

from tmc_vem import Box, Medium, RunOptions, RunResult, run
from tmc_vem.cli.plot import plot
from tmc_vem.report.field_figure import Shown, component_of_load, field_figure, points_or_cells
from tmc_vem.results.export import fields_at
from tmc_vem.results.output import by_region
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.support.errors import InputError
from tmc_vem.system.tensors import values_of

BOX = Box(cells=(20, 5), uy=-0.05, medium=Medium(gamma=1e-4))
FIELDS = "cauchy_stress, von_mises,principal_stretch_1"
ENERGY = """from codegen import energy

@energy(parameters={"mu": 10.0})
def flat(F, G, p, m):
    J = F[0][0] * F[1][1] - F[0][1] * F[1][0]
    return p.mu / 2 * (F[0][0]**2 + F[0][1]**2 + F[1][0]**2 + F[1][1]**2 - 2 - 2 * m.log(J))
"""


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> RunResult:
    where = tmp_path_factory.mktemp("written") / "box"
    return run(BOX, where, RunOptions(steps=1, snapshots=1, fields=FIELDS, triangulated=True))


def test_files_have_means_of_cells_and_values_at_points_of_each_region(written: RunResult) -> None:
    fields = fields_at(written, 1.0)
    assert set(fields.cell_fields) == set(fields.point_fields) == {
        "cauchy_stress", "von_mises", "principal_stretch_1",
    }  # fmt: skip
    polygons = fields.polygons
    assert fields.cell_fields["cauchy_stress"].shape == (polygons.n_cells, 4)
    for of in (fields.cell_fields, fields.point_fields):
        assert of["von_mises"] == pytest.approx(values_of("von_mises", of))
    # a point on an interface is there once for each region, and the stress jumps
    regions = [set(polygons.connectivity[np.repeat(polygons.region_c == n, np.diff(polygons.offsets))]) for n in (0, 1)]
    assert not regions[0] & regions[1]
    places = [{tuple(point) for point in polygons.points_nx[list(region)].tolist()} for region in regions]
    assert len(places[0] & places[1]) > 20
    solid, medium = (fields.point_fields["von_mises"][list(region)] for region in regions)
    assert solid.max() > 100.0 * medium.max() > 0.0
    # pulled and pressed as beams are
    xx = values_of("cauchy_stress_xx", fields.point_fields)
    middle = [
        xx[n] for n in np.flatnonzero(np.abs(polygons.points_nx - [1.0, 0.4]).max(axis=1) < 1e-9) if n in regions[0]
    ]
    assert middle[0] > 0.05


def test_points_of_several_regions_are_told_apart(written: RunResult) -> None:
    polygons = fields_at(written, 1.0).polygons
    again, origin = by_region(polygons)
    assert len(origin) == len(polygons.points_nx)  # they are already
    joined = replace(polygons, region_c=np.arange(polygons.n_cells) % 2)
    apart, origin = by_region(joined)
    assert (apart.points_nx == polygons.points_nx[origin]).all()
    assert (apart.points_nx[apart.connectivity] == polygons.points_nx[polygons.connectivity]).all()
    numbers = np.repeat(joined.region_c, np.diff(apart.offsets))
    assert not set(apart.connectivity[numbers == 0]) & set(apart.connectivity[numbers == 1])
    assert again.n_cells == apart.n_cells


def test_pyvista_meshio_and_pandas_have_names_and_units(written: RunResult) -> None:
    mesh, fields = written.to_pyvista(), fields_at(written, 1.0)
    for data in (mesh.point_data, mesh.cell_data):
        array = data.GetArray("cauchy_stress")
        assert [array.GetComponentName(n) for n in range(4)] == ["xx", "yy", "zz", "xy"]
        assert array.GetInformation().Get(array.UNITS_LABEL()) == "force/length^2"
    assert "principal_stretch_1: 1" in list(mesh.field_data["units"])
    assert mesh.point_data["von_mises"] == pytest.approx(fields.point_fields["von_mises"])
    cut = written.to_pyvista(triangulated=True)
    assert "von_mises" in cut.cell_data
    assert written.to_meshio().point_data["cauchy_stress"].shape[1] == 4
    frame = written.cells_to_pandas()
    assert list(frame.columns)[:4] == ["region", "x", "y", "area"]
    assert frame["cauchy_stress_xy"].to_numpy() == pytest.approx(fields.cell_fields["cauchy_stress"][:, 3])
    assert (frame["area"].sum(), (frame["x"] * frame["area"]).sum()) == pytest.approx((1.0, 1.0))
    assert (frame["y"] * frame["area"]).sum() == pytest.approx(0.25)
    assert frame[frame["region"] == "solid"]["area"].sum() == pytest.approx(0.46)
    assert [frame.attrs["units"][name] for name in ("x", "area", "J", "von_mises", "cauchy_stress_xy")] == [
        "length", "length^2", "1", "force/length^2", "force/length^2",
    ]  # fmt: skip
    text = next(iter((Path(written.directory or "") / "fields").glob("step*.vtu"))).read_text(errors="replace")
    assert re.search(r'Name="cauchy_stress" NumberOfComponents="4" ComponentName0="xx" ComponentName1="yy"', text)


def test_pictures_say_what_they_show(written: RunResult) -> None:
    figure, name = field_figure(written, Shown("von_mises", span=(0.0, 0.1)))
    axes, bar = figure.axes
    assert name == "von_mises"
    assert axes.get_title() == "Von Mises stress, load factor 1, displacement -0.05"
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x, deformed [length]", "y, deformed [length]")
    assert bar.get_ylabel() == "von Mises stress [force/length^2]"
    assert axes.collections[1].norm.vmax == 0.1
    assert field_figure(written, Shown())[1] == "uy"
    with_medium = field_figure(written, Shown("J", medium=True))[0]
    without = field_figure(written, Shown("J"))[0]
    assert with_medium.axes[1].get_ylabel() == "J, mean of the cell"
    assert with_medium.axes[0].collections[1].norm.vmin < without.axes[0].collections[1].norm.vmin
    figure.clear()


def test_the_component_of_the_load_is_shown() -> None:
    made = {"load": {"at": "right", "ux": 0.4, "uy": None}}
    assert component_of_load(type("R", (), {"inputs": made})()) == "ux"  # type: ignore[arg-type]
    assert component_of_load(type("R", (), {"inputs": {"uy": -0.3}})()) == "uy"  # type: ignore[arg-type]


def test_plot_draws_a_field_or_says_what_there_is(written: RunResult, tmp_path: Path) -> None:
    directory = str(written.directory)
    done = CliRunner().invoke(plot, [directory, "--field", "in_plane_stress_2", "--out", str(tmp_path)])
    assert done.exit_code == 0, done.output
    assert (tmp_path / "figures" / "field-in_plane_stress_2.png").exists()
    for arguments, words in (
        (
            ["--field", "log_strain_xx"],
            "the files hold no log_strain_xx: they have ux, uy, J, .*run again with --fields",
        ),
        (["--field", "mises"], "unknown field 'mises': the files hold ux, uy"),
        (["--range", "1", "0"], "range = 1 0: give the smaller number first"),
        (["--range", "0", "inf"], "range = inf must be a finite number"),
        (["--at", "nan"], "at = nan must be a finite number"),
    ):
        refused = CliRunner().invoke(plot, [directory, *arguments, "--out", str(tmp_path)])
        assert refused.exit_code != 0
        assert re.search(words, str(refused.exception or refused.output))


def test_names_of_fields_are_checked_and_none_are_written(tmp_path: Path) -> None:
    assert RunOptions(fields="none").field_names == ()
    assert RunOptions().field_names == ("cauchy_stress", "von_mises")
    with pytest.raises(InputError, match="fields: unknown field 'mises': choose from"):
        RunOptions(fields="mises")
    result = run(BOX, tmp_path / "box", RunOptions(steps=1, snapshots=1, fields="none"))
    fields = fields_at(result, 1.0)
    assert fields.cell_fields == fields.point_fields == {}
    with pytest.raises(InputError, match="the files hold no von_mises"):
        points_or_cells(fields, "von_mises")


def test_what_an_energy_does_not_say_is_withheld(tmp_path: Path) -> None:
    """An energy of the plane has stresses in it, none across it, and no von Mises stress."""
    (tmp_path / "flat.py").write_text(ENERGY)
    text = LEFT_AND_BOTTOM + '[[load]]\nat = "right"\nux = 0.2\n'
    path = file_of(tmp_path, text)
    path.write_text(path.read_text().replace("{ solid = { K = 20, mu = 10 } }", '{ density = "flat.py:flat" }'))
    result = run(read_problem(path)[0], tmp_path / "out", RunOptions(steps=1, snapshots=1))
    fields = fields_at(result, 1.0)
    for of in (fields.cell_fields, fields.point_fields):
        assert np.isnan(of["von_mises"]).all()
        assert np.isfinite(of["cauchy_stress"][:, [0, 1, 3]]).all()
        assert np.isnan(of["cauchy_stress"][:, 2]).all()
    # mu (b - I) / J, free on top: lambda_2 = 1
    assert fields.point_fields["cauchy_stress"][:, 0] == pytest.approx(10.0 * (1.21 - 1.0) / 1.1, rel=1e-6)
    shown = field_figure(result, Shown("von_mises"))[0].axes[0].texts
    assert [text.get_text() for text in shown] == ["no value: the energy does not use F[2][2]"]
    text = path.read_text()
    for probe in (
        'largest = "von_mises", region = "block"',
        'largest = "von_mises", line = [[0.0, 0.5], [2.0, 0.5]]',
        'mean = "von_mises", edges = "top"',
        'value = "von_mises", at = [0.5, 0.5]',
    ):
        path.write_text(f"{text}[probes]\nv = {{ {probe} }}\n")
        with pytest.raises(InputError, match=r"v: von_mises needs the stress across the plane, which region 'block' l"):
            run(read_problem(path)[0], None, RunOptions(steps=1))


TWO = """name = "two"
mesh = { cells = "quadrilaterals", size = 0.5 }
edges = { bottom = { line = [[0.0, 0.0], [1.0, 0.0]] }, top = { line = [[0.0, 1.0], [1.0, 1.0]] } }
support = [{ at = "bottom", ux = 0, uy = 0 }, { at = "top", ux = 0 }]
load = { at = "top", uy = -0.02 }
[shapes]
low = { rectangle = [0.0, 0.0, 1.0, 0.5] }
high = { rectangle = [0.0, 0.5, 1.0, 1.0] }
[regions]
low = { shape = "low", solid = { K = 20, mu = 10 } }
high = { shape = "high", density = "flat.py:flat" }
"""


def test_probes_are_refused_where_the_stress_across_is_not_known_and_nowhere_else(tmp_path: Path) -> None:
    """The third medium counts as well, and a line in the region that has it does not ask for the other one."""
    (tmp_path / "flat.py").write_text(ENERGY)
    path = tmp_path / "two.toml"
    line = "p = {{ largest = 'von_mises', line = [[0.2, {}], [0.8, {}]] }}\n"
    below = "[probes]\nq = { value = 'von_mises', at = [0.3, 0.3] }\n" + line.format(0.1, 0.4)
    path.write_text(TWO + below)
    assert run(read_problem(path)[0], None, RunOptions(steps=1)).probes["p"] > 0.0
    for extra in ("", ", is_medium = true"):
        across = "[probes]\n" + line.format(0.1, 0.9)
        path.write_text(TWO.replace('"flat.py:flat"', f'"flat.py:flat"{extra}') + across)
        with pytest.raises(InputError, match=r"p: von_mises needs .*, which region 'high' lacks"):
            run(read_problem(path)[0], None, RunOptions(steps=1))
