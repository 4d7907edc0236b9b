"""Displacements along and across edges, rotations and histories, from problem files to results, with both methods."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers_plate import LEFT_AND_BOTTOM, problem_of, result_of, turned

from tmc_vem import RunOptions, run
from tmc_vem.results.run_result import RunResult
from tmc_vem.support.errors import InputError

METHODS = ("vem", "fem")
ANGLE = 30.0


@pytest.fixture(scope="module")
def straight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("straight")


@pytest.fixture(scope="module")
def inclined(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("inclined")


# -- rotation --------------------------------------------------------------------------------------------------------

TURN = """[edges.all]
between = ["block", "outside"]
[[load]]
name = "turn"
at = "all"
rotation = 90
about = [0.3, -0.2]
[probes]
ux = { displacement = "ux", at = "c" }
uy = { displacement = "uy", at = "c" }
inside = { displacement = "uy", at = [1.0, 0.5] }
"""


def test_a_body_is_turned_by_a_right_angle_without_stress(straight: Path, method: str) -> None:
    """(x, y) goes to (0.3 - (y + 0.2), -0.2 + (x - 0.3)): the corner (2, 1) to (-0.9, 1.5)."""
    result = result_of(straight, TURN, method=method, steps=3)
    assert result.complete
    assert result.probes == pytest.approx({"ux": -2.9, "uy": 0.5, "inside": 0.0}, abs=1e-8)
    assert sum(result.last.energy.values()) == pytest.approx(0.0, abs=1e-12)
    assert result.min_j["block"] == pytest.approx(1.0, abs=1e-8)
    assert [record.forces["turn"]["angle"] for record in result.history][-2:] == pytest.approx([60.0, 90.0])
    assert result.loads["turn"]["moment"] == pytest.approx(0.0, abs=1e-7)
    assert (result.last.displacement, result.units["displacement"]) == (90.0, "degrees")


BEND = """[[support]]
at = "left"
ux = 0
uy = 0
[[load]]
name = "turn"
at = "right"
rotation = {angle}
about = [2, 0.5]
"""


def test_the_moment_does_the_work(straight: Path, method: str) -> None:
    """A plate that is bent by turning its end: energy is the moment over the angle in radians, to second order."""
    errors = []
    for steps in (2, 4):
        result = result_of(straight, BEND.format(angle=20), method=method, steps=steps)
        turn, stored = result.loads["turn"], sum(result.last.energy.values())
        assert turn["moment"] > 0.0
        assert turn["work"] == pytest.approx(result.last.load_work, rel=5e-3)
        errors.append(abs(turn["work"] - stored) / stored)
    assert errors[1] < 0.3 * errors[0] < 0.01
    other = result_of(straight, BEND.format(angle=-20), method=method, steps=2)
    assert other.loads["turn"]["moment"] < 0.0


# -- along and across edges ------------------------------------------------------------------------------------------

PRESSED = """[[support]]
at = "left"
{left} = 0
[[support]]
at = "bottom"
{bottom} = 0
[[load]]
name = "press"
at = "top"
{top} = {press}
[[load]]
name = "pull"
at = "right"
traction = {pull}
[[spring]]
at = "c"
stiffness = [1, 1]
[probes]
ux = {{ displacement = "ux", at = "b" }}
uy = {{ displacement = "uy", at = "b" }}
"""


def pressed(directory: Path, method: str, degrees: float, **options: Any) -> RunResult:
    pull = [*turned(degrees, (1.0, 0.5))[0]] if degrees else [1.0, 0.5]
    names = {"left": "normal", "bottom": "normal", "top": "normal"} if degrees else {"left": "ux", "bottom": "uy",
                                                                                     "top": "uy"}  # fmt: skip
    text = PRESSED.format(**names, press=-0.2, pull=pull)
    return result_of(directory, text, degrees, method=method, steps=2, **options)


def test_rollers_on_an_incline_are_rollers(straight: Path, inclined: Path, method: str) -> None:
    """A plate on rollers, pressed, pulled and held by a spring, is the same where all of it is turned."""
    plain, found = pressed(straight, method, 0.0), pressed(inclined, method, ANGLE)
    assert found.complete
    assert turned(-ANGLE, (found.probes["ux"], found.probes["uy"]))[0] == pytest.approx(
        (plain.probes["ux"], plain.probes["uy"]), abs=1e-10
    )
    for name in ("press", "pull"):
        for quantity in {"displacement", "reaction", "force", "work"} & set(plain.loads[name]):
            assert found.loads[name][quantity] == pytest.approx(plain.loads[name][quantity], rel=1e-10), quantity
    assert plain.loads["press"]["reaction"] < -10.0
    assert sum(found.last.energy.values()) == pytest.approx(sum(plain.last.energy.values()), rel=1e-10)
    assert found.checks["energy_balance"]["work"] == pytest.approx(plain.checks["energy_balance"]["work"], rel=1e-10)
    assert found.checks["imbalance"] < 1e-12
    assert [r.iterations for r in found.history] == [r.iterations for r in plain.history]


def test_both_methods_agree_on_rectangles(straight: Path) -> None:
    pytest.importorskip("dolfinx")
    vem, fem = (pressed(straight, method, 0.0) for method in METHODS)
    assert fem.loads["press"]["reaction"] == pytest.approx(vem.loads["press"]["reaction"], rel=1e-4)
    assert fem.probes == pytest.approx(vem.probes, rel=1e-4)


SHEARED = """[[support]]
at = "bottom"
{hold}
[[load]]
name = "shear"
at = "top"
{along} = {value}
[[load]]
name = "lift"
at = "top"
{across} = 0.05
"""


def test_tangential_has_the_body_on_its_left(straight: Path, inclined: Path, method: str) -> None:
    """Along the top of a body that is to the left; normal is out of it."""
    hold = "normal = 0\ntangential = 0"
    plain = result_of(straight, SHEARED.format(hold="ux = 0\nuy = 0", along="ux", value=-0.1, across="uy"), steps=1,
                      method=method)  # fmt: skip
    found = result_of(inclined, SHEARED.format(hold=hold, along="tangential", value=0.1, across="normal"), ANGLE,
                      steps=1, method=method)  # fmt: skip
    assert found.loads["shear"]["reaction"] == pytest.approx(-plain.loads["shear"]["reaction"], rel=1e-10)
    assert found.loads["lift"]["reaction"] == pytest.approx(plain.loads["lift"]["reaction"], rel=1e-10)
    assert found.loads["shear"]["work"] == pytest.approx(plain.loads["shear"]["work"], rel=1e-10)


# -- histories -------------------------------------------------------------------------------------------------------

CYCLE = (
    LEFT_AND_BOTTOM
    + """[[load]]
name = "pull"
at = "right"
ux = 0.2
history = [[0, 0], [0.37, 1], [1, 0]]
[[load]]
name = "push"
at = "top"
traction = [0, -0.5]
history = [[0.5, 0], [0.75, 1], [1, 0]]
"""
)
OPTIONS = RunOptions(largest_step=0.2, checkpoint_every=1)


@pytest.fixture(scope="module")
def cycle(tmp_path_factory: pytest.TempPathFactory) -> RunResult:
    where = tmp_path_factory.mktemp("cycle")
    return run(problem_of(where, CYCLE), where / "out", OPTIONS)


def test_times_of_histories_are_hit_exactly(cycle: RunResult) -> None:
    times = [record.load for record in cycle.history]
    assert cycle.complete
    assert (cycle.load, times[-1]) == (1.0, 1.0)
    assert {0.37, 0.5, 0.75} <= set(times)
    at = {record.load: record.forces for record in cycle.history}
    assert at[0.37]["pull"]["displacement"] == 0.2
    assert (at[0.5]["push"]["force"], at[0.75]["push"]["force"]) == (0.0, pytest.approx(1.0, rel=1e-12))
    assert at[0.75]["push"]["force_y"] == pytest.approx(-1.0, rel=1e-12)
    assert at[1.0]["pull"]["displacement"] == 0.0


def test_a_cycle_ends_where_it_began(cycle: RunResult) -> None:
    last = cycle.last
    assert last is not None
    assert abs(sum(last.energy.values())) < 1e-12
    assert abs(last.reaction) < 1e-10
    work = cycle.loads["pull"]["work"] + cycle.loads["push"]["work"]
    largest = max(record.forces["pull"]["work"] for record in cycle.history)
    assert abs(work) < 0.02 * largest
    balance = cycle.checks["energy_balance"]
    assert balance["work"] == pytest.approx(work, abs=1e-12)
    assert cycle.checks["imbalance"] < 1e-3


def test_a_run_goes_on_between_kinks_bit_for_bit(cycle: RunResult, tmp_path: Path) -> None:
    problem = problem_of(tmp_path, CYCLE)
    done = 0
    for stop in (8, 5, None):  # iterations, of each part
        part = run(problem, tmp_path / "out", RunOptions(largest_step=0.2, max_iterations=stop), resume=done > 0)
        assert (part.cut_short, part.steps > done) == (stop is not None, True)
        done = part.steps
    plain = [{**vars(record), "seconds": 0.0} for record in cycle.history]
    assert [{**vars(record), "seconds": 0.0} for record in part.history] == plain
    assert RunResult.read(tmp_path / "out").history[-1].forces == cycle.loads


def test_what_is_written_of_loads(cycle: RunResult) -> None:
    """history.csv and result.json have what the result has, and the summary shows the pairs and the work."""
    from tmc_vem.cli.progress import summary_rows

    assert cycle.directory is not None
    read = RunResult.read(cycle.directory)
    assert read.history[3].forces == cycle.history[3].forces
    assert read.history[3].load_work == cycle.history[3].load_work
    assert cycle.as_dict()["loads"]["pull"] == cycle.loads["pull"]
    shown = [name for name, _ in summary_rows(cycle)]
    columns = [f"pull.{name}" for name in ("displacement", "reaction", "work")]
    columns += [f"push.{name}" for name in ("displacement", "force", "work")]
    assert [name for name in shown if "." in name] == columns
    assert (cycle.units["push.force"], cycle.units["pull.work"]) == ("force/length", "force")


def test_a_time_beyond_the_histories_is_no_output_load(straight: Path) -> None:
    problem = problem_of(straight, CYCLE)
    with pytest.raises(InputError, match=r"output load 1\.5 is not on the load path, which goes from 0 to 1"):
        run(problem, options=RunOptions(output_loads=(1.5,)))
    with pytest.raises(InputError, match="follow does not go with a history"):
        run(problem, options=RunOptions(follow=True))


ONE = LEFT_AND_BOTTOM + '[load]\nat = "right"\nux = 0.1\n'


def test_one_load_keeps_its_columns(straight: Path) -> None:
    """Whether it stands in [load] or [[load]], and says its history or not."""
    plain = result_of(straight, ONE, steps=2)
    assert (plain.last.forces, plain.last.load_work, plain.units["reaction"]) == ({}, None, "force/length")
    assert plain.last.displacement == 0.1
    named = result_of(straight, ONE.replace("[load]", '[[load]]\nname = "pull"'), steps=2)
    assert named.last.as_row().keys() == plain.last.as_row().keys()
    told = result_of(straight, ONE + "history = [[0, 0], [1, 1]]\n", steps=2)
    for result in (named, told):
        assert [record.reaction for record in result.history] == [record.reaction for record in plain.history]
    assert told.last.load_work == pytest.approx(0.5 * (0.05 * plain.history[0].reaction + 0.05 * (
        plain.history[0].reaction + plain.history[1].reaction)), rel=1e-12)  # fmt: skip


def test_without_a_history_a_load_grows_up_to_time_1(straight: Path) -> None:
    text = CYCLE.replace("history = [[0.5, 0], [0.75, 1], [1, 0]]\n", "").replace("[1, 0]]", "[2, 0]]")
    result = result_of(straight, text, steps=2)
    forces = {record.load: record.forces["push"]["force"] for record in result.history}
    assert (forces[1.0], forces[2.0]) == (pytest.approx(1.0), pytest.approx(1.0))
    assert forces[0.37] == pytest.approx(0.37)
    assert math.isclose(result.load, 2.0)
    assert np.isfinite(result.checks["imbalance"])


# -- forces of files -------------------------------------------------------------------------------------------------

BETWEEN_WALLS = LEFT_AND_BOTTOM + '[[support]]\nat = "right"\nux = 0\n'
PRESSURE = (
    BETWEEN_WALLS
    + '[[load]]\nname = "press"\nat = "top"\npressure = 2\n[probes]\ntop = { displacement = "uy", at = "c" }\n'
)
WEIGHT = BETWEEN_WALLS + '[[load]]\nname = "weight"\nregions = ["block"]\n{what}\n'


def test_pressure_on_a_plate_between_walls(straight: Path, method: str) -> None:
    """The area that the top sweeps is its length, 2, times how far it comes down; the stress is the pressure."""
    result = result_of(straight, PRESSURE, method=method, steps=4)
    press, stored = result.loads["press"], sum(result.last.energy.values())
    assert press["swept"] == pytest.approx(-2.0 * result.probes["top"], rel=1e-9)
    assert 0.05 < -result.probes["top"] < 0.1
    assert press["pressure"] == 2.0
    assert (result.last.displacement, result.last.reaction) == (press["swept"], press["pressure"])
    assert press["force_y"] == pytest.approx(-4.0, rel=1e-9)
    assert press["work"] == pytest.approx(stored, rel=2e-3)
    assert (result.units["displacement"], result.units["reaction"]) == ("length^2", "force/length^2")
    assert (result.units["press.swept"], result.units["press.moment"]) == ("length^2", "force")


def test_a_force_per_mass_is_one_per_area_times_the_density(straight: Path) -> None:
    found = [
        result_of(straight, WEIGHT.format(what=what), steps=1).loads["weight"]
        for what in ("body_force = [0, -3]", "acceleration = [0, -30]\ndensity = 0.1")
    ]
    assert found[1] == pytest.approx(found[0], rel=1e-12)
    assert found[0]["force"] == pytest.approx(6.0, rel=1e-12)
    assert found[0]["displacement"] == pytest.approx(found[0]["potential"] / 6.0, rel=1e-12)
    assert found[0]["work"] == pytest.approx(0.5 * 6.0 * found[0]["displacement"], rel=1e-12)


def test_the_page_of_a_run_has_its_loads(cycle: RunResult) -> None:
    """Curves of each over the time, and a table of the last values."""
    from matplotlib.figure import Figure

    from tmc_vem.report import tables
    from tmc_vem.report.plots import against_load, has_several_loads

    runs = {"run": cycle}
    assert has_several_loads(runs)
    (table,) = tables.measured(runs)
    assert (table.caption, table.head[0]) == ("Probes and loads at the last converged step.", "quantity")
    assert [row[0] for row in table.rows][:2] == ["pull.displacement", "pull.reaction"]
    axes = Figure().subplots()
    against_load(axes, runs, lambda record, _: record.reported["push.force"], "push.force")
    (line,) = axes.lines
    assert line.get_xdata().tolist() == [record.load for record in cycle.history]
    assert max(line.get_ydata()) == pytest.approx(1.0)
    assert axes.get_xlabel() == "time"
    plain = {"run": replace(cycle, history=[replace(record, load_work=None) for record in cycle.history])}
    against_load(axes, plain, lambda record, _: record.reaction, "reaction")
    assert max(axes.lines[1].get_xdata()) == pytest.approx(0.2)
    assert axes.get_xlabel().startswith("prescribed displacement")
