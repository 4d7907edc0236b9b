"""Loads, supports and springs of problem files entry by entry: limits, what is made of them, and what is refused."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from helpers_plate import LEFT_AND_BOTTOM, file_of, plate, problem_of

from tmc_vem import RunOptions
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems.columns import check_names, named_loads, pair_of, quantities_of
from tmc_vem.problems.description import ConditionTable
from tmc_vem.problems.directions import on_mesh
from tmc_vem.problems.examine import examine
from tmc_vem.problems.load_tables import LoadTable, SpringTable
from tmc_vem.simulation.plan import control_path
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.support.errors import InputError
from tmc_vem.system.constraints import PROPORTIONAL, Prescribed, PrescribedAcross, PrescribedRotation
from tmc_vem.system.control import Control
from tmc_vem.system.forces import BodyForce, CavityPressure, FollowerPressure, PointForce, Spring, Traction
from tmc_vem.system.histories import RAMP, History, kinks_of

# -- histories -------------------------------------------------------------------------------------------------------

POINTS = ((0.5, 0.0), (1.0, 2.0), (3.0, -1.0))


def test_amplitudes_of_a_history() -> None:
    history = History(POINTS)
    times = [0.0, 0.5, 0.75, 1.0, 2.0, 3.0, 9.0]
    assert [history.at(Control(time)) for time in times] == [0.0, 0.0, 1.0, 2.0, 0.5, -1.0, -1.0]
    assert [history.per_load(Control(time)) for time in times] == [0.0, 0.0, 4.0, 4.0, -1.5, -1.5, 0.0]
    assert RAMP.per_load(Control(0.0)) == 1.0
    assert kinks_of([history, PROPORTIONAL, RAMP]) == (0.5, 1.0, 3.0)
    assert kinks_of([PROPORTIONAL]) == ()


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([[0, 0]], "history has too few entries: give two or more, such as [[0, 0], [1, 1]]"),
        ([[0, 0], [1, 1], [1, 2]], "history, entry 3: time 1 must be later than 1 before it"),
        ([[0, 0], [2, 1], [1, 2]], "history, entry 3: time 1 must be later than 2 before it"),
        ([[-1, 0], [1, 1]], "history, entry 1: time -1 must be from 0 to 1000"),
        ([[0, 0], [1001, 1]], "history, entry 2: time 1001 must be from 0 to 1000"),
        ([[0, 0], [1000, 1]], None),
        ([[0, 0], [1, math.inf]], "history, entry 2: [1, inf] must be two finite numbers"),
        ([[0, 0], [math.nan, 1]], "history, entry 2: [nan, 1] must be two finite numbers"),
        ([[0, 0], [1, 0]], "history is 0 throughout: leave the load out, or let it act"),
        ([[0.5, 2], [1, 0]],
         "history, entry 1: it begins with 2, but a run begins without loads: begin with [0.5, 0]"),
        ([[0, 0], [1, 1, 1]], "points, entry 2 = [1, 1, 1] must be a list of 2"),
    ],
)  # fmt: skip
def test_histories_that_are_refused(points: Any, message: str | None) -> None:
    if message is None:
        History(points)
        return
    with pytest.raises(InputError) as caught:
        History(points)
    assert str(caught.value) == message


# -- what is made of tables ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("table", "load"),
    [
        ({"at": "a", "ux": 0.5}, Prescribed("a", 0, 0.5, RAMP, "n")),
        ({"at": "a", "uy": -0.5}, Prescribed("a", 1, -0.5, RAMP, "n")),
        ({"at": "a", "normal": 0.5}, PrescribedAcross("a", "normal", 0.5, RAMP, "n")),
        ({"at": "a", "tangential": 0.5}, PrescribedAcross("a", "tangential", 0.5, RAMP, "n")),
        ({"at": "a", "rotation": 30.0, "about": (1.0, 2.0)}, PrescribedRotation("a", (1.0, 2.0), 30.0, RAMP, "n")),
        ({"at": "a", "force": (1.0, 2.0)}, PointForce("n", "a", (1.0, 2.0), RAMP)),
        ({"at": "a", "traction": (1.0, 2.0)}, Traction("n", "a", (1.0, 2.0), RAMP)),
        ({"at": "a", "cavity_pressure": 2.0}, CavityPressure("n", "a", 2.0, RAMP)),
        ({"at": "a", "pressure": 2.0}, FollowerPressure("n", "a", 2.0, RAMP)),
        ({"regions": ("r",), "body_force": (1.0, 2.0)}, BodyForce("n", ("r",), (1.0, 2.0), RAMP)),
        ({"regions": ("r",), "acceleration": (0.0, -10.0), "density": 0.5}, BodyForce("n", ("r",), (0.0, -5.0), RAMP)),
        ({"at": "a", "ux": 0.5, "history": POINTS}, Prescribed("a", 0, 0.5, History(POINTS), "n")),
    ],
)
def test_loads_of_tables(table: dict[str, Any], load: Any) -> None:
    assert LoadTable(**table).load("n", RAMP) == load


def test_springs_and_supports_of_tables() -> None:
    assert SpringTable("a", (0.0, 2.0)).spring("s") == Spring("s", "a", (0.0, 2.0))
    assert ConditionTable("a", normal=0.0, tangential=0.5).conditions(RAMP) == [
        PrescribedAcross("a", "normal", 0.0, RAMP), PrescribedAcross("a", "tangential", 0.5, RAMP),
    ]  # fmt: skip
    assert ConditionTable("a", uy=0.5).conditions() == [Prescribed("a", 1, 0.5)]


TABLES: list[tuple[dict[str, Any], str]] = [
    ({"at": "a"}, "give one of ux, uy, normal, tangential, rotation, force, traction, body_force, acceleration, "
     "cavity_pressure, pressure, not none"),
    ({"at": "a", "ux": 1.0, "force": (1.0, 0.0)}, "give one of ux, uy, normal, tangential, rotation, force, traction, "
     "body_force, acceleration, cavity_pressure, pressure, not ux and force; each is a [[load]] of its own"),
    ({"ux": 1.0}, "ux lacks 'at'"),
    ({"at": "a", "rotation": 9.0}, "rotation lacks 'about'"),
    ({"at": "a", "ux": 9.0, "about": (0.0, 0.0)}, "ux has no use for 'about'"),
    ({"at": "a", "regions": ("r",), "body_force": (1.0, 0.0)}, "body_force has no use for 'at'"),
    ({"body_force": (1.0, 0.0)}, "body_force lacks 'regions'"),
    ({"regions": (), "body_force": (1.0, 0.0)}, "regions: there is none"),
    ({"regions": ("r",), "acceleration": (1.0, 0.0)}, "acceleration lacks 'density'"),
    ({"regions": ("r",), "acceleration": (1.0, 0.0), "density": -1.0},
     "density = -1 must be a positive number: mass per area, for a force per mass"),
    ({"at": "a", "force": (0.0, 0.0)},
     "force = (0.0, 0.0) does nothing: leave the load out; what holds a displacement is a [[support]]"),
    ({"at": "a", "normal": 0.0},
     "normal = 0 does nothing: leave the load out; what holds a displacement is a [[support]]"),
    ({"at": "a", "traction": (math.inf, 0.0)},
     "traction = inf must be a finite number: a component of the force per length"),
    ({"at": "a", "rotation": math.nan, "about": (0.0, 0.0)},
     "rotation = nan must be a finite number: an angle in degrees"),
    ({"at": "a", "pressure": math.inf}, "pressure = inf must be a finite number: a force per length"),
    ({"at": "a", "ux": 1.0, "name": "a.b"}, "name = 'a.b': use letters, digits, _ and - for a name, a letter first"),
    ({"at": "a", "ux": 1.0, "history": ((0.0, 0.0), (0.0, 1.0))},
     "history, entry 2: time 0 must be later than 0 before it"),
]  # fmt: skip


@pytest.mark.parametrize(("table", "message"), TABLES)
def test_loads_that_are_refused(table: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as caught:
        LoadTable(**table)
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: SpringTable("a", (-1.0, 0.0)), "stiffness = -1 along x must be 0 or more"),
        (lambda: SpringTable("a", (0.0, -1.0)), "stiffness = -1 along y must be 0 or more"),
        (lambda: SpringTable("a", (0.0, 0.0)), "stiffness is 0 along x and y: leave the spring out"),
        (lambda: SpringTable("a", (0.0, math.nan)), "stiffness = nan must be a finite number: along y"),
        (lambda: SpringTable("a", (0.0, 1.0), "1"),
         "name = '1': use letters, digits, _ and - for a name, a letter first"),
        (lambda: ConditionTable("a", ux=0.0, normal=0.0),
         "ux and normal do not go together: give what is held along x and y, or across and along the edge"),
        (lambda: ConditionTable("a", normal=math.inf), "normal = inf must be a finite number: a displacement"),
    ],
)  # fmt: skip
def test_springs_and_supports_that_are_refused(make: Any, message: str) -> None:
    with pytest.raises(InputError) as caught:
        make()
    assert str(caught.value) == message


# -- files -----------------------------------------------------------------------------------------------------------

PULL = '[[load]]\nname = "pull"\nat = "right"\nux = 0.1\n'
PUSH = '[[load]]\nname = "push"\nat = "top"\ntraction = [0, -1]\n'


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("files")


FILES: list[tuple[str, str, str]] = [
    (PULL + PUSH.replace("traction", "tracton"),
     "load, entry 2 has no 'tracton' (did you mean 'traction'?)", "tracton"),
    (PULL + PUSH.replace("[0, -1]", "[0]"), "load, entry 2: traction = [0] must be a list of 2", "traction = [0]"),
    (PULL + PULL, "load, entry 2: name = 'pull' is that of load, entry 1, already", "2nd name"),
    (PULL + PULL.replace("pull", "pull2"),
     "load 'pull2' with ux = 0.1 prescribes ux at 'right', as load 'pull' with ux = 0.1 does", "pull2"),
    (PULL + PUSH.replace("top", "tip"), "'tip' is neither a point nor edges", "tip"),
    (PULL + 'history = [[0, 0], [1, "x"]]\n', "history, entry 2, entry 2 = 'x' must be a number", "history"),
    (PULL + "history = [[0, 0], [1, 0]]\n", "load, entry 1: history is 0 throughout", "history"),
    (PULL + PUSH + "history = [[0, 0], [-1, 0]]\n", "load, entry 2: history, entry 2: time -1 must be", "history"),
    (PULL.replace("0.1", "0.0") + PUSH, "load, entry 1: ux = 0 does nothing", "ux = 0.0"),
    (PUSH.replace("traction", "ux = 1\ntraction"), "load, entry 1: give one of ux,", "[[load]]"),
    ("load = []\n", "load: there is none", ""),
    (PULL + '[[load]]\nregions = ["blok"]\nbody_force = [0, -1]\n', "load: there is no region 'blok'", "blok"),
    (PULL + '[[spring]]\nat = "c"\nstifness = [1, 1]\n', "spring, entry 1 has no 'stifness'", "stifness"),
    (PULL + '[[spring]]\nname = "pull"\nat = "c"\nstiffness = [1, 1]\n',
     "spring, entry 1: name = 'pull' is that of load, entry 1, already", "2nd name"),
    (PULL.replace("ux", "normal") + LEFT_AND_BOTTOM.replace("ux", "nrmal"), "has no 'nrmal'", "nrmal"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "message", "where"), FILES)
def test_files_that_are_refused(text: str, message: str, where: str, folder: Path) -> None:
    """In one line, which says the line of the entry that is meant and not of another one like it."""
    whole = text if text.startswith("load =") else LEFT_AND_BOTTOM + text
    path = file_of(folder, "" if whole is text else whole)
    if whole is text:
        path.write_text(text + path.read_text())
    with pytest.raises(InputError) as caught:
        read_problem(path)[0].make_mesh()
    said = str(caught.value)
    assert message in said
    assert "\n" not in said
    lines = path.read_text().splitlines()
    if where == "2nd name":
        expected = [n for n, line in enumerate(lines, start=1) if line == 'name = "pull"'][1]
        assert said.endswith(f"(line {expected})"), said
    elif where and not said.startswith(("'tip'", "load: ")):
        expected = max(n for n, line in enumerate(lines, start=1) if where in line)
        assert said.endswith(f"(line {expected})"), said


def test_names_that_are_not_given(folder: Path) -> None:
    text = LEFT_AND_BOTTOM + PULL + PUSH.replace('name = "push"\n', "") + '[[spring]]\nat = "c"\nstiffness = [1, 1]\n'
    problem = problem_of(folder, text)
    assert [load.name for load in named_loads(problem)] == ["pull", "load_2", "spring_1"]
    check_names(problem)
    assert isinstance(problem.load(), Prescribed)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (PULL.replace('"right"', '"c"').replace("ux", "normal"),
         "normal = 0.1 at 'c': 'c' are no edges, and a point has no normal direction"),
        (PULL.replace('"right"', '"all"').replace("ux", "normal") + '[edges.all]\nbetween = ["block", "outside"]\n',
         "normal = 0.1 at 'all': the edges are curved, 0.894 off the line between their ends, and have no one normal "
         "direction"),
        (PULL.replace("ux = 0.1", "rotation = 10\nabout = [2, 0.5]"),
         "support uy = 0 at 'bottom' and load 'pull' with rotation = 10 degrees about (2, 0.5) at 'right' meet at"),
    ],
)  # fmt: skip
def test_what_only_a_mesh_tells_is_refused_too(text: str, message: str, folder: Path) -> None:
    problem = problem_of(folder, LEFT_AND_BOTTOM + text)
    with pytest.raises(InputError) as caught:
        examine(problem, problem.make_mesh())
    assert message in str(caught.value)


def test_edges_with_bodies_on_both_sides_have_no_outside() -> None:
    mesh = plate()
    left, right = mesh.cells_of_edges
    inner = mesh.edges.vertices_ev[(left >= 0) & (right >= 0)][:1]
    mesh = replace(mesh, named_edges={"inner": inner})
    along = PrescribedAcross("inner", "tangential", 0.1)
    with pytest.raises(InputError, match="bodies on both sides, so that it is not clear which way is meant"):
        on_mesh([along], mesh, [])
    (held,) = on_mesh([replace(along, value=0.0)], mesh, [])  # either way is as good
    assert sorted(map(abs, held.axes[0])) == [0.0, 1.0]


def test_pairs_whose_product_is_work() -> None:
    across, turn = PrescribedAcross("a", "normal", 1.0), PrescribedRotation("a", (0.0, 0.0), 9.0)
    loads = {
        "displacement reaction": [Prescribed("a", 0, 1.0), across],
        "angle moment": [turn],
        "displacement force": [PointForce("f", "a", (1.0, 0.0)), BodyForce("b", ("r",), (1.0, 0.0))],
        "area pressure": [CavityPressure("c", "a", 1.0)],
        "swept pressure": [FollowerPressure("p", "a", 1.0)],
    }
    for pair, members in loads.items():
        for load in members:
            assert " ".join(pair_of(load)) == pair
            assert {*pair.split(), "work"} <= set(quantities_of(load))
    assert quantities_of(Spring("s", "a", (1.0, 0.0)))[-1] == "energy"


# -- fuzz ------------------------------------------------------------------------------------------------------------

EVERYTHING = LEFT_AND_BOTTOM + PULL + "history = [[0, 0], [1, 1], [2, 0.5]]\n" + PUSH + """[[load]]
at = "c"
force = [1, 0]
[[load]]
name = "turn"
at = "d"
rotation = 20
about = [0, 1]
[[load]]
name = "weight"
regions = ["block"]
acceleration = [0, -10]
density = 0.1
[[spring]]
at = "b"
stiffness = [1, 1]
[[stage]]
name = "first"
begins = 0
[[stage]]
name = "second"
begins = 1
[[support]]
at = "top"
uy = 0
stage = "second"
"""  # fmt: skip
WORDS = ("nan", "-1", "[]", "[1, 2]", '"x"', "true", "[[0, 0], [1, nan]]")


def said_of(path: Path, mesh: PolygonMesh) -> str:
    """What is wrong with a file; nothing if nothing is."""
    try:
        problem = read_problem(path)[0]
    except InputError as error:
        return str(error)
    try:
        control_path(problem, RunOptions())
        examine(problem, mesh, (1.0,))
    except InputError as error:
        return f"{path.name}: {error}"
    return ""


def test_any_change_to_an_entry_is_accepted_or_refused_in_one_line(folder: Path) -> None:
    """Every value by every word, every key by another, every line left out: one line that names the file, or none."""
    path, mesh = file_of(folder, EVERYTHING), plate()
    assert said_of(path, mesh) == ""
    lines = path.read_text().splitlines()
    first = next(n for n, line in enumerate(lines) if line.startswith("[["))
    messages = []
    for n in range(first, len(lines)):
        key, mark, _ = lines[n].partition(" = ")
        for change in [f"{key} = {word}" for word in WORDS] + [f"{key}x = 1", ""] if mark else ["[[lod]]"]:
            path.write_text("\n".join([*lines[:n], change, *lines[n + 1 :]]) + "\n")
            messages.append(said_of(path, mesh))
    refused = [message for message in messages if message]
    assert all("plate.toml" in message and len(message.splitlines()) == 1 for message in refused)
    assert len(messages) > len(refused) > 200
