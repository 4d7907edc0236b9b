"""What is recorded of a run, part by part: refused states, steps, probes, fields."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from helpers_ranks import Ranks
from mpi4py import MPI

from tmc_vem.problems import Box
from tmc_vem.problems.probes import Displacement, Gap, MeanJ, Position, Reaction
from tmc_vem.results.contact.contact import Overlap
from tmc_vem.results.output import SnapshotWriter
from tmc_vem.results.records import StepRecord
from tmc_vem.results.subtriangles import SubTriangles
from tmc_vem.simulation import simulation
from tmc_vem.simulation.gauge import Gauge
from tmc_vem.simulation.measured import Reading
from tmc_vem.simulation.overlap import OverlapWatch, Refusal, _normal, _Outline
from tmc_vem.simulation.recorder import Recorder
from tmc_vem.simulation.words import title_of
from tmc_vem.solve.newton import Iteration, NewtonResult
from tmc_vem.solve.stepping import Step, StepperState
from tmc_vem.support.errors import InputError
from tmc_vem.support.petsc import PETSc
from tmc_vem.support.units import FORCE, Units
from tmc_vem.system.constraints import Prescribed, PrescribedRotation
from tmc_vem.system.control import Control
from tmc_vem.system.discretisation import Evaluation, RegionValues
from tmc_vem.system.fields import Polygons
from tmc_vem.system.forces import BodyForce, CavityPressure

BOX = Box(cells=(20, 5))


# -- refusals and recorders ------------------------------------------------------------------------------------------


def test_refusals_in_words() -> None:
    assert Refusal(Overlap()).sentence() == "solids would overlap"
    assert Refusal(Overlap(), passed=True).sentence() == "solids would have passed through each other"
    part = Overlap(0.25, 0.5, 0.0, (1.0, 2.0), (3.0, 4.0), (0, 1))
    assert Refusal(part).sentence() == "solids would overlap: depth 5.00e-01 at (1, 2), area 2.50e-01"
    assert Refusal(part, (7, 9), ("a", "b")).sentence() == (
        "solids would overlap: depth 5.00e-01 at (1, 2), area 2.50e-01, where cell 7 of 'a', undeformed near (3, 4), "
        "is inside cell 9 of 'b'"
    )
    assert Refusal(replace(part, origin=None), (7, 9), ("a", "b")).sentence().endswith("area 2.50e-01")
    asked: list[Any] = []
    known = Refusal(part, cause=lambda place: asked.append(place) or "the cause")
    assert (known.advice(), asked) == ("Known cause: the cause", [(3.0, 4.0)])
    assert Refusal(part).advice().startswith("Try smaller cells and more medium")


def test_what_a_watch_accepts() -> None:
    system: Any = SimpleNamespace(size=2.0)
    cause = str
    watch = OverlapWatch(system, ["m"], 2, cause=cause)  # type: ignore[arg-type]
    assert watch._verdict(None) is None
    assert (watch._verdict(Refusal(Overlap(depth=1.9e-6))), watch.crossed) == (None, True)
    watch.crossed = False
    found = watch._verdict(Refusal(Overlap(depth=2.1e-6)))
    assert found is not None
    assert (found.cause, watch.crossed) == (cause, False)
    assert watch._verdict(Refusal(Overlap(), passed=True)) is not None
    tolerant = OverlapWatch(system, ["m"], 2, tolerated=True)
    assert (tolerant._verdict(Refusal(Overlap(), passed=True)), tolerant.crossed) == (None, True)
    assert OverlapWatch(system, [], 2).refusal_of_jump(None, None) is None  # type: ignore[arg-type]


def test_which_point_is_behind_the_other() -> None:
    """A square's upper side at y = 1, solid below; the second point comes from above it."""
    outline: Any = _Outline.__new__(_Outline)
    side = np.array([[(2.0, 1.0), (1.0, 1.0), (0.0, 1.0)], [(0.0, 1.0), (0.0, 0.5), (0.0, 0.0)]])
    outline._before, outline._system = side, SimpleNamespace(size=2.0, comm=MPI.COMM_SELF)
    outline._sides = lambda u: side
    assert _normal(side[:1]).tolist() == [0.0, 1.0]
    assert _normal(side).tolist() == [-1.0, 1.0]
    places = ((0.5, 1.0), (0.0, 1.0), (0.0, 0.25), (0.5, 0.9), (2.5, 1.0))
    assert [outline._at(np.array(place)).tolist() for place in places] == [[0], [0, 1], [1], [], []]
    on, above, below, far = (np.array(place) for place in ((1.0, 1.0), (1.0, 1.5), (1.0, 0.9), (1.0, 3.0)))
    assert outline.behind(None, (on, above), (on, below))
    assert not outline.behind(None, (on, above), (on, far))
    assert not outline.behind(None, (on, below), (on, below)), "it was behind from the start"
    assert outline.behind(None, (above, on), (below, on)), "the second one's side, where the first is on none"
    assert not outline.behind(None, (above, far), (below, far))
    right = np.array((3.0, 1.5))
    assert outline.behind(None, (on, right), (on, np.array((3.0, 0.5))))


def recorder(**parts: Any) -> Recorder:
    made: Any = Recorder.__new__(Recorder)
    vars(made).update(parts)
    return made  # type: ignore[no-any-return]


def test_what_is_recorded_of_a_step() -> None:
    """Every value from where it belongs; fields and checkpoints are offered with number and coordinate."""
    said: list[Any] = []
    residual, u, position = object(), object(), object()
    reading = Reading(-0.25, -7.0, {"a": {"work": 3.0}}, (np.zeros(1), np.zeros(1)), 2.5)
    loads = SimpleNamespace(read=lambda *given: said.append(("loads", *given)) or reading)
    newton: Any = NewtonResult(
        True, "", Evaluation(1.0, {"s": RegionValues(3.0, 0.5), "m": RegionValues(4.0, 0.25)}),
        (Iteration(1.0, 1.0, 1.0),) * 3, 2, residual,  # type: ignore[arg-type]
    )  # fmt: skip
    gauge = SimpleNamespace(
        read=lambda *given: said.append(("read", *given[:2], given[2](1, 2), given[3])) or {"gap": 0.125}
    )
    watch = SimpleNamespace(behind=lambda *given: given)
    traction, found = object(), {"s": {"force": 4.0}}
    contact = SimpleNamespace(
        traction=lambda *given: said.append(("traction", *given)) or traction, measured={traction: found}.__getitem__
    )
    snapshots = SimpleNamespace(directory=Path("a"), offer=lambda *given: said.append(("offer", *given)))
    timer: Any = lambda phase: _Nothing()  # noqa: E731
    timer.report = lambda: {"total": 1.5}
    made = recorder(
        loads=loads, _read=None, gauge=gauge, watch=watch, contact=contact,
        timer=timer, directory=None, history=[], _plain_history=[], _snapshots=snapshots, _every=2,
        _seconds_before=10.0, monitor=SimpleNamespace(stepped=lambda record: said.append("stepped")),
        _write_checkpoint=lambda *given: said.append(("checkpoint", *given)), _load_force=lambda *given: 16.0,
    )  # fmt: skip
    states: Any = SimpleNamespace(vectors=[object(), u])
    for number in (5, 6):
        control = Control(0.5, {"gamma": 1e-3})
        made.record(Step(number, 0.75, control, newton, 1, 9, True), states, position)  # type: ignore[arg-type]
    assert made.history[0] == StepRecord(
        step=5, load=0.5, displacement=-0.25, probes={"gap": 0.125}, reaction=-7.0, iterations=3, cut_backs=1,
        wasted_iterations=9, min_j={"s": 0.5, "m": 0.25}, energy={"s": 3.0, "m": 4.0}, negative_pivots=2, jumped=True,
        seconds=11.5, time=0.75, parameters={"gamma": 1e-3}, load_force=16.0,
        load_work=2.5, forces={"a": {"work": 3.0}}, contact=found,
    )  # fmt: skip
    assert made._plain_history[1]["step"] == 6
    assert made.main == (states, position)
    probes, acting = ("read", u, residual, (u, 1, 2), found), ("traction", u, residual)
    first, second = (("loads", u, residual, Control(0.5, {"gamma": 1e-3}), before) for before in (None, reading))
    assert said == [
        acting, first, probes, ("offer", 5, 0.75, u), "stepped", acting, second, probes, ("offer", 6, 0.75, u),
        ("checkpoint",), "stepped",
    ]  # fmt: skip


def test_why_a_run_ended_early_stands_in_its_directory() -> None:
    said: list[str] = []
    directory = SimpleNamespace(interrupted=said.append)
    for rank, error in ((0, InputError("full")), (0, KeyboardInterrupt()), (1, InputError("on another rank"))):
        run: Any = SimpleNamespace(directory=directory, comm=SimpleNamespace(rank=rank))
        simulation.Simulation._end_early(run, error)
    nowhere: Any = SimpleNamespace(directory=None, comm=SimpleNamespace(rank=0))
    simulation.Simulation._end_early(nowhere, InputError("kept in memory"))
    assert said == ["full", "KeyboardInterrupt"]


def test_units_and_title_of_a_record() -> None:
    problem: Any = SimpleNamespace(
        units=lambda: Units("mm", "N"), regions=lambda: {"s": 1, "m": 2}, name="mine",
        load=lambda: Prescribed("top", 1, -1.0),
        prescribed=lambda: [PrescribedRotation("a", (0.0, 0.0), 9.0, name="t")],
    )  # fmt: skip
    probes = {"gap": Gap("a", "b"), "push": Reaction("ux", "a"), "j": MeanJ("m")}
    contact = SimpleNamespace(kinds=lambda contact: {"contact.s.force": FORCE} if contact else {})
    made = recorder(problem=problem, gauge=SimpleNamespace(probes=probes), history=[], contact=contact)
    assert made._units() == {
        "displacement": "mm", "gap": "mm", "push": "N/mm", "j": "1", "reaction": "N/mm", "min_j_s": "1", "min_j_m": "1",
        "energy_s": "N", "energy_m": "N", "t.angle": "degrees", "t.moment": "N", "t.work": "N",
    }  # fmt: skip
    row: Any = SimpleNamespace(as_row=lambda: {"load": 1, "gap": 2, "load_force": 3, "contact.s.force": 4}, contact="s")
    assert made._units(row) == made._headings(row) == {"gap": "mm", "load_force": "N", "contact.s.force": "N/mm"}
    problem.units = Units
    assert made._headings(row) == {}
    assert title_of(made.problem, made.history) == "mine, undeformed"
    made.history = [SimpleNamespace(gap=None, displacement=-0.25)]
    assert title_of(made.problem, made.history) == "mine at top displacement -0.25"
    made.history = [SimpleNamespace(gap=0.123456, displacement=-0.25)]
    assert title_of(made.problem, made.history) == "mine at top displacement -0.25, gap 0.1235"
    problem.load = lambda: BodyForce("g", ("s",), (0.0, -1.0))
    assert title_of(made.problem, made.history) == "mine at displacement -0.25, gap 0.1235"
    problem.load = lambda: CavityPressure("p", "hole", 2.0)
    assert title_of(made.problem, made.history) == "mine at hole area -0.25, gap 0.1235"
    problem.units = lambda: Units("mm", "N")
    assert [made._units()[name] for name in ("displacement", "reaction")] == ["mm^2", "N/mm^2"]


def test_cells_that_are_inverted_are_counted_once_by_region() -> None:
    polygons = SimpleNamespace(region_c=np.array([0, 1, 1, 2, 2]), region_names=("a", "b", "c"))
    dense = np.array([1.0, 0.0, -1.0, np.nan, 1.0])
    system = SimpleNamespace(
        output_polygons=lambda: polygons,
        dense_jacobians=lambda u: dense,
        comm=Ranks(0, other=np.array([(0, 0.5), (4, 0.25), (0, 0.125)])),
    )
    made = recorder(system=system, timer=lambda _: Ranks.__new__(Ranks) and _Nothing(), _inverted={}, history=[])
    found = made._between_the_points(None)  # type: ignore[arg-type]
    assert found["inverted_cells"] == {"b": 6, "c": 1}
    assert [found["dense_min_j"][name] for name in "ab"] == [0.5, -1.0]
    made.history = [SimpleNamespace(load=0.25)]  # type: ignore[list-item]
    made.step_failed(None)  # type: ignore[arg-type]
    assert made._inverted == {"inverted_from": 0.25}
    made.history = []
    made.step_failed(None)  # type: ignore[arg-type]
    assert made._inverted == {"inverted_from": 0.25}, "seen first there"


class _Nothing:
    def __enter__(self) -> None:
        pass

    def __exit__(self, *_: object) -> None:
        pass


def test_work_of_the_prescribed_displacements() -> None:
    system = SimpleNamespace(
        constrained=lambda: np.array([1, 2]), prescribed_per_load=lambda _: np.array([2.0, -3.0]), comm=MPI.COMM_SELF
    )
    residual = PETSc.Vec().createWithArray(np.array([100.0, 5.0, 7.0, 100.0]))
    assert recorder(system=system)._load_force(residual, Control(1.0)) == -11.0


# -- probes ----------------------------------------------------------------------------------------------------------


def test_probes_are_read_off_a_state() -> None:
    """Of a system with two named points; rank 1 has cells of its own."""
    places = {"a": np.array([1.0, 2.0]), "b": np.array([4.0, 6.0])}
    moved = {"a": np.array([0.25, -0.5]), "b": np.array([0.25, -4.5])}
    polygons = SimpleNamespace(region_names=("s", "m"), region_c=np.array([0, 1, 1]))
    system: Any = SimpleNamespace(
        point_coordinates=lambda names: np.array([places[name] for name in names]),
        point_displacements=lambda u, names: np.array([moved[name] for name in names]),
        reaction=lambda residual, where, component: (residual, where, component).__hash__() and 10.0 * component + 7.0,
        output_polygons=lambda: polygons, cell_areas=lambda: np.array([1.0, 2.0, 4.0]),
        cell_jacobians=lambda u: (np.array([9.0, 0.5, 0.25]), None),
        comm=Ranks(0, other=np.array([[3.0, 2.0]])),
    )  # fmt: skip
    probes = {"ux": Displacement("ux", "a"), "uy": Displacement("uy", "b"), "x": Position("x", "b"),
              "y": Position("y", "a"), "gap": Gap("a", "b"), "r": Reaction("uy", "top"), "j": MeanJ("m")}  # fmt: skip
    problem: Any = SimpleNamespace(
        probes=lambda: probes, regions=lambda: {"s": 1, "m": 2},
        prescribed=lambda: [SimpleNamespace(where="top", component=1)],
    )  # fmt: skip
    gauge = Gauge(problem, system)
    seen: list[Any] = []

    def behind(origins: Any, now: Any) -> bool:
        seen.append((np.array(origins).tolist(), np.array(now).tolist()))
        return True

    expected = {"ux": 0.25, "uy": -4.5, "x": 4.25, "y": 1.5, "gap": 3.0, "r": 17.0, "j": (2.0 + 3.0) / (6.0 + 2.0)}
    assert gauge.read(None, 5) == pytest.approx(expected)  # type: ignore[arg-type]
    assert gauge.read(None, 5, behind)["gap"] == pytest.approx(-3.0)  # type: ignore[arg-type]
    assert gauge.read(None, 5, lambda *_: False)["gap"] == pytest.approx(3.0)  # type: ignore[arg-type]
    assert seen == [([[1.0, 2.0], [4.0, 6.0]], [[1.25, 1.5], [4.25, 1.5]])]


# -- fields that are written -----------------------------------------------------------------------------------------

POINTS = np.array([(0, 0), (0.5, 0), (1, 0), (1, 0.5), (1, 1), (0.5, 1), (0, 1), (0, 0.5)], dtype=float)


def one_cell() -> Any:
    polygons = Polygons(POINTS, np.array([0, 8]), np.arange(8), np.array([0]), ("m",))
    return SimpleNamespace(
        output_polygons=lambda: polygons, comm=MPI.COMM_SELF,
        cell_jacobians=lambda u: (np.array([2.0]), np.array([1.0])),
        cell_energies=lambda u: np.array([6.0]), cell_areas=lambda: np.array([2.0]),
        output_displacements=lambda u: np.full((8, 2), u),
    )  # fmt: skip


def writer(path: Path, loads: tuple[float, ...], **more: Any) -> SnapshotWriter:
    (path / "fields").mkdir(exist_ok=True)
    return SnapshotWriter(one_cell(), path, loads, ("m",), **more)


def listed(path: Path, name: str = "fields.pvd") -> list[str]:
    return [line.strip() for line in (path / name).read_text().splitlines() if "DataSet" in line]


def test_steps_at_and_past_the_wanted_loads_are_written(tmp_path: Path) -> None:
    made = writer(tmp_path, (1.0, 0.25, 0.5), triangulated=True)
    for step, load in enumerate((0.2, 0.25 - 1e-10, 0.3, 0.6, 1.0), start=1):
        made.offer(step, load, 0.5)  # type: ignore[arg-type]
    assert [load for load, _ in made.entries] == [0.25 - 1e-10, 0.6, 1.0]
    made.write(5, 1.0, 0.5)  # type: ignore[arg-type]
    assert [names for _, names in made.entries] == [[f"fields/step_{n:05d}.vtu"] for n in (2, 4, 5)]
    assert listed(tmp_path) == [
        f'<DataSet timestep="{load}" part="0" file="fields/step_{n:05d}.vtu"/>'
        for load, n in (("0.2499999999", 2), ("0.6", 4), ("1", 5))
    ]
    assert listed(tmp_path, "triangulated.pvd") == [
        line.replace("/step_", "/triangulated_") for line in listed(tmp_path)
    ]
    assert sorted(entry.name for entry in (tmp_path / "fields").iterdir()) == [
        f"{name}_{n:05d}.vtu" for name in ("step", "triangulated") for n in (2, 4, 5)
    ]


def test_a_collection_goes_on_with_the_files_that_are_there(tmp_path: Path) -> None:
    made = writer(tmp_path, (0.25, 0.5, 0.75, 1.0))
    for name, text in (
        ("a.vtu", "x"),
        ("b.vtu", ""),
        ("d.pvtu", "x"),
        ("d_0.vtu", "x"),
        ("e.pvtu", "x"),
        ("e_1.vtu", ""),
    ):
        (tmp_path / "fields" / name).write_text(text)
    names = ("a.vtu", "b.vtu", "c.vtu", "d.pvtu", "e.pvtu")
    made.restore([(0.1 * (n + 1), [f"fields/{name}"]) for n, name in enumerate(names)])
    assert made.entries == [(0.1, ["fields/a.vtu"]), (pytest.approx(0.4), ["fields/d.pvtu"])]
    assert len(listed(tmp_path)) == 2
    made.offer(6, 0.6, 0.5)  # type: ignore[arg-type]
    assert len(made.entries) == 2, "0.5 was reached before"
    made.offer(7, 0.75, 0.5)  # type: ignore[arg-type]
    assert len(made.entries) == 3
    fresh = writer(tmp_path, (0.5,))
    fresh.restore([])
    fresh.offer(1, 0.5, 0.5)  # type: ignore[arg-type]
    assert len(fresh.entries) == 1


def test_cells_without_new_points_are_not_looked_for() -> None:
    """A plain quadrilateral stays; the points of a pentagon's triangles are evaluated in it."""
    system = one_cell()
    plain = SubTriangles(system, system.output_polygons(), 2)
    assert plain._inner.shape == (0, 2)
    assert plain.polygons.points_nx.tolist() == POINTS.tolist()
    assert plain.displacements(0.5).tolist() == [[0.5, 0.5]] * 8  # type: ignore[arg-type]
    angle = 2 * np.pi * np.arange(5) / 5
    corners = np.column_stack([np.cos(angle), np.sin(angle)])
    ring = np.stack([corners, 0.5 * (corners + np.roll(corners, -1, axis=0))], axis=1).reshape(-1, 2)
    polygons = Polygons(ring, np.array([0, 10]), np.arange(10), np.array([0]), ("m",))
    looked: list[Any] = []

    def locate(points: Any) -> Any:
        looked.append(points)
        return SimpleNamespace(weights=np.ones((len(points), 1)))

    system.locate, system.nodal_values = locate, lambda u: np.array([[3.0, 4.0]])
    system.output_displacements = lambda u: np.zeros((10, 2))
    cut = SubTriangles(system, polygons, 2)
    n = len(looked[0])
    assert len(cut.polygons.points_nx) == 10 + n
    assert cut.polygons.offsets.tolist() == [6 * k for k in range(len(cut.cell_t) + 1)]
    assert cut.polygons.connectivity.max() == 9 + n
    assert cut.displacements(None)[:10].tolist() == [[0.0, 0.0]] * 10  # type: ignore[arg-type]
    assert cut.displacements(None)[10:].tolist() == [[3.0, 4.0]] * n  # type: ignore[arg-type]
    area = 0.0
    for c in range(len(cut.cell_t)):
        (ax, ay), (bx, by), (cx, cy) = cut.polygons.points_nx[cut.polygons.cell(c)][::2]
        area += 0.5 * ((bx - ax) * (cy - ay) - (cx - ax) * (by - ay))
    assert area == pytest.approx(2.5 * math.sin(2 * np.pi / 5))
    assert StepperState().stiffer == ()
