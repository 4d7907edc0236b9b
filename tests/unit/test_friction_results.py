"""What a run with friction leaves behind: forces, coefficients, slip, energies, tables, lines, pictures, warnings."""

from __future__ import annotations

import csv
import dataclasses
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import pyvista
from helpers_traction import Solved, solved

from tmc_vem import RunResult, run
from tmc_vem.cli.progress import summary_rows
from tmc_vem.problems.contact_probe import Contact
from tmc_vem.problems.contact_quantities import OF_FRICTION
from tmc_vem.report import plots, tables
from tmc_vem.report.contact_figure import contact_of, contact_pictures
from tmc_vem.report.contact_tables import contact_tables
from tmc_vem.report.friction_figure import rubbing_sides
from tmc_vem.results.contact.curves import FRICTION_COLUMNS
from tmc_vem.results.contact_table import read_table
from tmc_vem.results.energy_balance import energy_balance
from tmc_vem.results.output import gather_fields
from tmc_vem.results.records import OF_REGION
from tmc_vem.simulation.contact_probe import contact_reader
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.support.units import Units

# A block is pressed on another one, pushed to the right until it slips, and back; sides of medium are free.
SLIDING = """\
name = "sliding"
units = { length = "mm", force = "N" }
gap = [[0.5, 0.4], [0.5, 0.6]]
[shapes]
low = { rectangle = [0, 0, 1, 0.4] }
mid = { rectangle = [0, 0.4, 1, 0.6] }
up = { rectangle = [0.25, 0.6, 0.75, 1] }
[regions]
low = { shape = "low", solid = { E = 20, nu = 0 } }
up = { shape = "up", solid = { E = 20, nu = 0 } }
medium = { shape = "mid", medium = { energy = "balanced", gamma = 1e-3, alpha_r = 0.5, friction = 0.3 } }
[mesh]
cells = "triangles"
size = 0.25
[edges]
bottom = { line = [[0, 0], [1, 0]] }
top = { line = [[0.25, 1], [0.75, 1]] }
[probes]
rub = { contact = "friction_x", of = "low-up" }
[[support]]
at = "bottom"
ux = 0
uy = 0
[[load]]
name = "press"
at = "top"
uy = -0.22
history = [[0, 0], [1, 1], [3, 1]]
[[load]]
name = "slide"
at = "top"
ux = 0.12
history = [[0, 0], [1, 0], [2, 1], [3, 0.5]]
[solve]
steps = 12
snapshots = 3
"""


@pytest.fixture(scope="module")
def sliding(tmp_path_factory: pytest.TempPathFactory) -> Solved:
    folder = tmp_path_factory.mktemp("sliding")
    return solved(folder, SLIDING, folder / "run")


def at(result: RunResult, load: float) -> Any:
    """The step that ends at a load."""
    return next(record for record in result.history if record.load == pytest.approx(load))


def test_friction_is_against_the_motion_and_below_the_coefficient(sliding: Solved) -> None:
    result = sliding.result
    assert result.complete
    pushed, back = (at(result, load).contact for load in (2.0, 3.0))
    first, up, low = (pushed[name] for name in ("low-up", "up", "low"))
    assert first["friction_x"] > 0.1, "the upper block drags the lower one along"
    assert up["friction_x"] == pytest.approx(-low["friction_x"], rel=0.08)
    assert back["low-up"]["friction_x"] < -0.05
    assert 0.24 < first["friction_coefficient"] < 0.3 < first["apparent_coefficient"] < 0.34
    assert first["sticking"] < 0.1 < 0.9 < back["low-up"]["sticking"] <= 1.0
    assert 0.06 < first["slip_max"] < 0.12
    assert first["friction"] == pytest.approx(np.hypot(first["friction_x"], first["friction_y"]))
    assert "apparent_coefficient" not in at(result, 1.0 / 12.0).contact["low-up"], "nothing is squeezed yet"
    assert result.probes["rub"] == result.contact["low-up"]["friction_x"]
    assert result.unit("rub") == "N/mm"


def test_shear_is_at_its_bound_where_it_slips(sliding: Solved) -> None:
    curves = RunResult.read(sliding.result.directory).traction(2.0)  # type: ignore[arg-type]
    friction = curves.friction
    assert friction is not None
    touches = friction.bound_n > 0.0
    slips = touches & (friction.sticking_n < 1e-12)
    assert slips.sum() > 5
    assert np.abs(friction.shear_n[slips]) == pytest.approx(friction.bound_n[slips], rel=0.06)
    assert (np.abs(friction.shear_n) <= 1.06 * friction.bound_n).all()
    assert np.isnan(friction.sticking_n[~touches]).all()
    facing = touches & (curves.faces_n >= 0) & slips
    assert friction.slip_n[facing] == pytest.approx(0.08, rel=0.15), (
        "both lines run so that the other one's slip is forwards"
    )
    # the shear of the medium besides is its own and the regulariser's
    middle = curves.between("up", "low") & (np.abs(curves.point_nx[:, 0] - 0.62) < 0.15)
    assert np.abs(curves.shear_n[middle]) == pytest.approx(np.abs(friction.shear_n[middle]), rel=0.35)
    assert np.sign(curves.shear_n[middle]).tolist() == np.sign(friction.shear_n[middle]).tolist()


def test_slip_goes_back_and_its_path_goes_on(sliding: Solved) -> None:
    one, two = (RunResult.read(sliding.result.directory).traction(load).friction for load in (2.0, 3.0))  # type: ignore[arg-type]
    assert one is not None
    assert two is not None
    most = one.slip_n.argmax()
    assert two.slip_n[most] < one.slip_n[most] == pytest.approx(one.path_n[most], rel=0.02)
    assert two.path_n[most] - one.path_n[most] == pytest.approx(one.slip_n[most] - two.slip_n[most])


def test_the_last_state_is_that_of_its_step(sliding: Solved) -> None:
    """What is written when the run is finished is what was recorded; states beside the path leave the slip alone."""
    result = sliding.result
    gauge = sliding.simulation.recorder.contact
    slip = gauge.friction.plain_slip()
    beside = gauge.read(sliding.u, sliding.residual, along_path=False)
    elsewhere = sliding.u.copy()
    elsewhere.scale(0.5)
    gauge.read(elsewhere, sliding.residual, along_path=False)
    assert gauge.friction.plain_slip() == slip
    expected = {name: {q: v for q, v in values.items() if q != "slip_max"} for name, values in result.contact.items()}
    assert beside == {name: pytest.approx(values) for name, values in expected.items()}
    assert result.checks["imbalance"] < 1e-9
    assert result.directory is not None
    written = read_table(result.directory / "contact" / f"step_{result.steps:05d}.csv")
    last = result.traction()
    assert written.friction is not None
    assert last.friction is not None
    for column in FRICTION_COLUMNS:
        assert np.array_equal(
            getattr(written.friction, column.field), getattr(last.friction, column.field), equal_nan=True
        )
    assert written.shear_n == pytest.approx(last.shear_n, rel=1e-9, abs=1e-12)


def test_where_the_work_went(sliding: Solved) -> None:
    history = sliding.result.history
    balance = energy_balance(history)
    assert balance is not None
    assert balance.as_dict() == sliding.result.checks["energy_balance"]
    assert balance.dissipated is not None
    assert balance.slip is not None
    assert balance.released is not None
    assert balance.dissipated > 0.3 * balance.work
    assert abs(balance.integration_error) < 0.02 * balance.work
    assert 0.0 < balance.released < 0.01 * balance.dissipated
    regions = sum(history[-1].energy.values())
    assert balance.stored == pytest.approx(regions + balance.slip)
    assert balance.stored == pytest.approx(
        balance.work + balance.integration_error - balance.dissipated - balance.released
    )
    dissipated = [record.friction["medium"]["dissipated"] for record in history]
    assert (np.diff(dissipated) > -1e-18).all()
    assert 0.05 < history[-1].friction["medium"]["contact_j"] < 0.1
    # about the friction force times the way that the block slipped
    way = at(sliding.result, 2.0).contact["low-up"]["slip_max"]
    assert dissipated[-1] == pytest.approx(0.141 * way, rel=0.05)


def test_energies_of_cells_are_those_of_their_regions(sliding: Solved) -> None:
    """In fields and probes, without friction, as in the history."""
    system, result = sliding.simulation.system, sliding.result
    energy_c = system.cell_energies(sliding.u)
    assert energy_c.sum() == pytest.approx(sum(result.history[-1].energy.values()), rel=1e-9)
    density_c = gather_fields(system, sliding.u, ["medium"]).energy_density_c  # type: ignore[union-attr]
    assert density_c == pytest.approx(energy_c / system.cell_areas())


def test_what_is_written(sliding: Solved) -> None:
    result = sliding.result
    assert result.directory is not None
    again = RunResult.read(result.directory)
    assert again.history == result.history
    assert again.friction == result.friction == result.as_dict()["friction"]
    with (result.directory / "history.csv").open() as file:
        row = list(csv.DictReader(file))[-1]
    for quantity, kind in OF_REGION.items():
        heading = f"friction.medium.{quantity}" + (" [N]" if kind == "line energy" else "")
        assert float(row[heading]) == result.friction["medium"][quantity]
    assert float(row["contact.up.friction [N/mm]"]) == result.contact["up"]["friction"]
    assert float(row["contact.low-up.slip_max [mm]"]) == result.contact["low-up"]["slip_max"]
    assert result.unit("friction.medium.dissipated") == "N"
    assert {"contact.low-up.friction", "contact.low-up.apparent_coefficient"} <= result.reported.keys()
    assert "contact.up.friction" not in result.reported, "the pair has it"
    lines = pyvista.read(result.directory / "contact" / f"step_{result.steps:05d}.vtu")
    curves = result.traction()
    assert curves.friction is not None
    for column in FRICTION_COLUMNS:
        values = getattr(curves.friction, column.field)
        assert np.array_equal(lines.point_data[column.name], values, equal_nan=True)
    table = (result.directory / "contact.csv").read_text().splitlines()[0]
    assert table.endswith("friction_shear [N/mm^2],friction_bound [N/mm^2],sticking,slip [mm],slip_path [mm]")


def test_what_is_said(sliding: Solved) -> None:
    result = sliding.result
    said = [text for text in result.warnings if "a friction of its own" in text]
    assert len(said) == 1
    assert "30% of friction = 0.3 (more than 5% counts): use a smaller gamma, or cite friction_coefficient" in said[0]
    lost = result.checks["energy_balance"]
    row = dict(summary_rows(result))["energy dissipated"]
    assert row.startswith(
        f"{lost['dissipated']:.4e} N of {lost['work']:.4e} done, {lost['slip']:.4e} N in elastic slip, "
    )
    bodies, pairs, rubbing = contact_tables(result)
    assert list(rubbing.head) == [
        "body or pair", "friction [N/mm]", "friction x [N/mm]", "friction y [N/mm]", "apparent coefficient",
        "friction coefficient", "sticking", "slip max [mm]",
    ]  # fmt: skip
    assert [row[0] for row in rubbing.rows] == ["low", "up", "low-up"]
    assert rubbing.rows[2][4] == f"{result.contact['low-up']['apparent_coefficient']:.3e}"
    assert "friction [N/mm]" not in (*bodies.head, *pairs.head)
    (table,) = tables.energy_in_friction({"a": result})
    assert (table.head[1], table.head[4]) == ("work (N)", "dissipated (N)")
    assert table.rows[0][4] == f"{lost['dissipated']:.3e}"
    plain = dataclasses.replace(result, history=[dataclasses.replace(record, friction={}) for record in result.history])
    assert tables.energy_in_friction({"a": plain}) == []


def test_pictures_of_friction(sliding: Solved, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Any] = []
    keep = lambda figure, name, caption: made.append(figure) or SimpleNamespace(name=name, caption=caption)  # noqa: E731
    monkeypatch.setattr("tmc_vem.report.contact_figure.picture", keep)
    found = contact_of(sliding.result, 2.0)
    names = ["contact-tractions", "contact-pressure", "contact-zones", "contact-friction"]
    assert [each.name for each in found] == names
    (zones,), (shear, slip) = made[0].axes, made[1].axes
    assert [text.get_text() for text in zones.get_legend().get_texts()] == ["sticks", "slips"]
    sticks, slips = zones.collections[-2:]
    assert len(slips.get_segments()) > len(sticks.get_segments())
    assert (shear.get_ylabel(), slip.get_ylabel()) == ("shear of friction [N/mm^2]", "slip [mm]")
    assert [text.get_text() for text in shear.get_legend().get_texts()] == ["on low, from up", "on up, from low"]
    curves = sliding.result.traction(2.0)
    assert curves.friction is not None
    for each in (*sticks.get_segments(), *slips.get_segments()):
        away = each[0] - curves.point_nx
        nearest = np.hypot(*away.T).argmin()
        assert away[nearest] @ curves.normal_nx[nearest] < 0.0, "in the solid"
    marks = {style: [line for line in shear.lines if line.get_marker() == "o" and line.get_fillstyle() == style]
             for style in ("full", "none")}  # fmt: skip
    low = curves.friction.sticking_n[rubbing_sides(curves)[0].stations]
    assert len(marks["full"][0].get_xdata()) < len(marks["none"][0].get_xdata())
    assert len(marks["none"][0].get_xdata()) >= (low <= 0.5).sum() > 3
    assert shear.lines[0].get_xdata().min() < -0.1 < 0.1 < shear.lines[0].get_xdata().max()
    assert slip.lines[0].get_ydata().max() == curves.friction.slip_n[curves.between("low", "up")].max()
    bounds = [line for line in shear.lines if line.get_linestyle() == ":"]
    assert (bounds[0].get_ydata() == -bounds[1].get_ydata()).all()
    assert bounds[0].get_ydata().max() > np.abs(shear.lines[0].get_ydata()).max() * 0.95
    alone = dataclasses.replace(curves, faces_n=np.full(len(curves), -1))
    assert [side.name for side in rubbing_sides(alone)] == ["on low, from the ground", "on up, from the ground"]
    pulled = dataclasses.replace(alone, pressure_n=-np.abs(curves.pressure_n))
    assert [each.name for each in contact_pictures(pulled, None, Units(), "now")] == names[2:]


def test_curves_of_a_run_with_friction(sliding: Solved, monkeypatch: pytest.MonkeyPatch) -> None:
    """Loops of the loads, and what is dissipated beside the energies of bodies and medium."""
    made: list[Any] = []
    keep = lambda figure, name, caption: made.append(figure) or SimpleNamespace(name=name)  # noqa: E731
    monkeypatch.setattr("tmc_vem.report.plots.picture", keep)
    result = sliding.result
    (found,) = plots.loops({"a": result})
    assert found.name == "loops"
    press, slide = made[0].axes
    assert (slide.get_xlabel(), slide.get_ylabel()) == ("slide.displacement (mm)", "slide.reaction (N/mm)")
    assert press.get_ylabel() == "press.reaction (N/mm)"
    last = [record.forces["slide"] for record in result.history]
    assert slide.lines[0].get_xdata().tolist() == [0.0, *(values["displacement"] for values in last)]
    assert slide.lines[0].get_ydata().tolist() == [0.0, *(values["reaction"] for values in last)]
    plain = dataclasses.replace(result, history=[dataclasses.replace(record, friction={}) for record in result.history])
    assert plots.loops({"a": plain}) == []
    alone = [dataclasses.replace(record, forces={}) for record in result.history]
    plots.loops({"a": dataclasses.replace(result, history=alone), "b": result, "c": plain})
    assert len(made[1].axes) == 2, "of the loads with names"
    plots.loops({"a": dataclasses.replace(result, history=alone)})
    (one,) = made[2].axes
    assert one.lines[0].get_ydata()[-1] == result.reaction
    assert one.get_xlabel() == "displacement (mm)"
    figure = plots.energy_split({"a": result})
    gone = figure.axes[2]
    assert gone.get_ylabel() == "energy dissipated by friction (N)"
    assert gone.lines[0].get_ydata()[-1] == result.friction["medium"]["dissipated"]
    assert len(plots.energy_split({"a": plain}).axes) == 2


def test_probes_of_friction_without_any(tmp_path: Path) -> None:
    """Of coefficients from 0 on, the first has no force of friction, and what is not known of it is not a number."""
    text = SLIDING.replace("friction = 0.3", "friction = 0")
    assert text != SLIDING
    problem, _ = read_problem(_written(tmp_path / "plain.toml", text))
    problem.probes()["rub"].examine(problem.make_mesh(), problem.regions())
    state = SimpleNamespace(contact={"low-up": {"force": 2.0}})
    wanted = {name: Contact(name, "low-up") for name in OF_FRICTION}
    found = contact_reader(wanted, problem, None)(state)  # type: ignore[arg-type]
    zero = {name for name, value in found.items() if value == 0.0}
    assert zero == {"friction", "friction_x", "friction_y"}
    assert all(np.isnan(found[name]) for name in set(found) - zero)
    problem, _ = read_problem(_written(tmp_path / "body.toml", SLIDING.replace('of = "low-up"', 'of = "up"')))
    problem.probes()["rub"].examine(problem.make_mesh(), problem.regions())
    assert Contact("slip_max", "up").kind == OF_FRICTION["slip_max"] == "length"


def _written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def test_a_block_on_ground(tmp_path: Path) -> None:
    """Without a lower body: friction is that of the block alone, and so is its slip."""
    text = SLIDING
    for old, new in (
        ("low = { rectangle = [0, 0, 1, 0.4] }\n", ""), ('low = { shape = "low", solid = { E = 20, nu = 0 } }\n', ""),
        ("gap = [[0.5, 0.4], [0.5, 0.6]]\n", ""), ("[[0, 0], [1, 0]]", "[[0, 0.4], [1, 0.4]]"),
        ('of = "low-up"', 'of = "up"'), ("[3, 1]]", "[2, 1]]"),
        ("[2, 1], [3, 0.5]]", "[2, 1]]"), ("steps = 12", "steps = 8"),
        ("ux = 0.12", "ux = 0.06"), ("uy = -0.22", "uy = -0.2"), ("snapshots = 3", "snapshots = 0"),
    ):  # fmt: skip
        assert old in text
        text = text.replace(old, new)
    result = solved(tmp_path, text, tmp_path / "run").result
    assert result.complete
    assert result.contact.keys() == {"up"}
    up, slide = result.contact["up"], result.loads["slide"]
    assert up["friction_x"] == pytest.approx(-slide["reaction"], rel=0.1)
    assert result.reported.keys() >= {"contact.up.friction", "contact.up.apparent_coefficient"}
    assert result.curves is not None
    assert result.curves.friction is not None
    assert 0.03 < up["slip_max"] < 0.06
    assert up["slip_max"] == result.curves.friction.slip_n.max()
    assert (result.curves.friction.slip_n[result.curves.friction.bound_n > 0.0] >= 0.0).all()
    # stopped on the way it goes on with the same bits, slip included
    problem, options = read_problem(tmp_path / "problem.toml")
    short = run(problem, tmp_path / "cut", dataclasses.replace(options, max_iterations=result.newton_iterations - 8))
    assert short.cut_short
    assert 0.0 < short.contact["up"]["slip_max"] < up["slip_max"]
    again = run(problem, tmp_path / "cut", options, resume=True)
    same = [dataclasses.replace(record, seconds=0.0) for record in result.history]
    assert [dataclasses.replace(record, seconds=0.0) for record in again.history] == same
    assert (tmp_path / "cut" / "contact.csv").read_text() == (tmp_path / "run" / "contact.csv").read_text()
    assert again.checks == result.checks
