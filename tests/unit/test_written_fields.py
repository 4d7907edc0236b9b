"""Fields from a writer back through readers, and as meshes of other programs, value by value."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from tmc_vem.results import export
from tmc_vem.results.records import StepRecord
from tmc_vem.results.snapshots import Snapshot, _pieces, nearest, read_fields, record_of, snapshots
from tmc_vem.results.vtu import VtuWriter
from tmc_vem.simulation.lowered import Lowered
from tmc_vem.simulation.recorder import Recorder
from tmc_vem.solve.stepping import StepperState
from tmc_vem.support.errors import InputError
from tmc_vem.support.units import Units
from tmc_vem.system.fields import Fields, Polygons, write_pvd, write_pvtu


def ring(corners: Any) -> Any:
    """Corners with the middles of the sides between them."""
    x = np.array(corners, dtype=float)
    return np.stack([x, 0.5 * (x + np.roll(x, -1, axis=0))], axis=1).reshape(-1, 2)


def state(shift: float = 0.0) -> Fields:
    """A pentagon, a triangle and a square, apart from each other; only the middle one is medium."""
    cells = [ring([(0, 0), (2, 0), (3, 1), (1, 2), (0, 1)]), ring([(5, 0), (6, 0), (5, 1)]),
             ring([(7, 0), (8, 0), (8, 1), (7, 1)])]  # fmt: skip
    offsets = np.concatenate([[0], np.cumsum([len(cell) for cell in cells])])
    points = np.concatenate(cells)
    polygons = Polygons(points, offsets, np.arange(len(points)), np.array([0, 1, 0]), ("s", "m"), ("m",))
    return Fields(polygons, points[:, ::-1] * 0.5 + shift, *(np.array([1.0, 2.0, 4.0]) + 10 * n for n in range(3)))


def result(directory: Path | None, **more: Any) -> Any:
    record = {"history": [], "units": {}, "inputs": {}, "media": ["m"], "min_j": {"s": 0.5, "m": 0.25}}
    return SimpleNamespace(directory=directory, **{**record, **more})


@pytest.fixture
def written(tmp_path: Path) -> Path:
    """A run with two states, one of them in two pieces."""
    (tmp_path / "fields").mkdir()
    writer = VtuWriter(state().polygons)
    for name, shift in (("a", 0.0), ("b_0", 1.0), ("b_1", 2.0)):
        writer.write(tmp_path / "fields" / f"{name}.vtu", state(shift))
    write_pvtu(tmp_path / "fields" / "b.pvtu", ["b_0.vtu", "b_1.vtu"])
    write_pvd(tmp_path / "fields.pvd", [(1.0, ["fields/b.pvtu"]), (0.5, ["fields/a.vtu"])])
    return tmp_path


def test_what_was_written_is_read_back(written: Path) -> None:
    """By kinds of cells; two pieces one after the other."""
    run = result(written)
    found = snapshots(run)
    fields = written / "fields"
    assert found == [Snapshot(0.5, (fields / "a.vtu",)), Snapshot(1.0, (fields / "b_0.vtu", fields / "b_1.vtu"))]
    assert [nearest(found, load).load for load in (0.0, 0.74, 0.76, 9.0)] == [0.5, 0.5, 1.0, 1.0]
    one, two = (read_fields(run, snapshot) for snapshot in found)
    wanted = state()
    order = [1, 2, 0]  # fewer points first
    assert one.polygons.offsets.tolist() == [0, 6, 14, 24]
    for new, old in enumerate(order):
        here, there = one.polygons.cell(new), wanted.polygons.cell(old)
        assert one.polygons.points_nx[here].tolist() == wanted.polygons.points_nx[there].tolist()
        assert one.displacement_ni[here].tolist() == wanted.displacement_ni[there].tolist()
    for name in ("jacobian_c", "min_jacobian_c", "energy_density_c"):
        assert getattr(one, name).tolist() == getattr(wanted, name)[order].tolist()
    assert (one.polygons.region_c.tolist(), one.polygons.region_names, one.polygons.media) == (
        [1, 0, 0], ("s", "m"), ("m",),
    )  # fmt: skip
    assert two.polygons.n_cells == 6
    assert two.displacement_ni[two.polygons.cell(5)].tolist() == (state(2.0).displacement_ni[:10]).tolist()


def test_fields_as_a_mesh_of_meshio(written: Path) -> None:
    mesh = export.to_meshio(result(written), 0.5)
    assert [(block.type, block.data.shape) for block in mesh.cells] == [
        ("polygon", (1, 6)), ("polygon", (1, 8)), ("polygon", (1, 10)),
    ]  # fmt: skip
    assert [mesh.points[block.data[0]].tolist() for block in mesh.cells] == [
        [[*point, 0.0] for point in state().polygons.points_nx[state().polygons.cell(c)].tolist()] for c in (1, 2, 0)
    ]
    assert {name: [values.tolist() for values in blocks] for name, blocks in mesh.cell_data.items()} == {
        "J": [[2.0], [4.0], [1.0]], "min_J": [[12.0], [14.0], [11.0]], "energy_density": [[22.0], [24.0], [21.0]],
        "region": [[1], [0], [0]], "medium": [[1], [0], [0]],
    }  # fmt: skip
    assert {name: values.tolist() for name, values in mesh.field_data.items()} == {"s": [0, 2], "m": [1, 2]}
    assert mesh.point_data["displacement"][:, 2].tolist() == [0.0] * 24


def test_fields_as_a_mesh_of_pyvista(written: Path) -> None:
    pytest.importorskip("pyvista")
    grid = export.to_pyvista(result(written, inputs={"units": {"length": "mm", "force": "N"}}), 0.5)
    assert grid.celltypes.tolist() == [22, 23, 7]
    assert grid.cell_data["medium"].tolist() == [1, 0, 0]
    assert grid.cell_data["min_J"].tolist() == [12.0, 14.0, 11.0]
    assert list(grid.field_data["region_names"]) == ["s", "m"]
    units = {name: unit for name, unit in Units("mm", "N").of_fields().items() if name != "Points"}
    assert list(grid.field_data["units"]) == [f"{name}: {unit}" for name, unit in units.items()]
    array = grid.GetCellData().GetArray("energy_density")
    assert array.GetInformation().Get(array.UNITS_LABEL()) == "N/mm^2"
    assert grid.compute_cell_sizes()["Area"].tolist() == pytest.approx([0.5, 1.0, 4.0])


def test_steps_of_snapshots(written: Path) -> None:
    step = StepRecord(1, 0.5, 0.0, {}, 0.0, 1, 0, 0, {}, {}, 0, False, 0.0, 0.5)
    history = [step, replace(step, step=2, time=1.0), replace(step, step=3, time=None, load=1.6)]
    run = result(written, history=history)
    assert [record_of(run, Snapshot(load, ())).step for load in (0.4, 0.9, 1.4)] == [1, 2, 3]


def test_what_is_missing_or_damaged(written: Path) -> None:
    def said(run: Any, **more: Any) -> str:
        with pytest.raises(InputError) as caught:
            read_fields(run, snapshots(run, **more)[0])
        return str(caught.value)

    run = result(written)
    assert said(result(None)) == "the run was kept in memory only: it has no fields"
    assert said(run, triangulated=True) == f"{written} has no triangulated fields: run again with --triangulated"
    with pytest.raises(InputError, match="no load step of the run was written"):
        nearest([], 1.0)
    path = written / "fields" / "a.vtu"
    assert (
        said(result(written, min_j={"s": 0.5})) == f"{path} is not readable: its regions are not the 1 of the history"
    )
    text = path.read_text()
    path.write_text(text.replace('Name="J"', 'Name="K"'))
    assert said(run) == f"{path} is not readable: 'J'"
    path.unlink()
    assert said(run).startswith(f"{path} is not readable: ")
    (written / "fields" / "b.pvtu").write_text("<a><Piece/></a>")
    with pytest.raises(InputError, match=r"b\.pvtu is not readable: 'Source'"):
        _pieces(written / "fields" / "b.pvtu")
    for entry, words in (
        ('timestep="x" file="a"', "could not convert"),
        ('timestep="1"', "'file'"),
        ('file="a"', "'timestep'"),
    ):
        (written / "fields.pvd").write_text(f"<a><DataSet {entry}/></a>")
        assert words in said(run)
    (written / "fields.pvd").write_text("<a>")
    assert f"{written / 'fields.pvd'} is not readable: " in said(run)
    (written / "fields.pvd").unlink()
    assert said(run) == f"{written} has no fields: run again with --snapshots 10"


def test_a_run_goes_on_with_all_that_its_checkpoint_has(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """States in their order, history, times, fields that were written, and where the stepping stood."""
    from helpers_spring import at

    step = StepRecord(1, 0.5, 0.0, {}, 0.0, 1, 0, 0, {"s": 0.5}, {"s": 1.0}, 0, False, 3.5, 0.5)
    history = [step, replace(step, step=2, seconds=7.5)]
    facts = {
        "inputs": {"a": 1}, "controls": [[0.25], [0.5]], "slopes": [None, None],
        "history": [dict(vars(record)) for record in history],
        "snapshots": [[0.5, ["x.vtu"]]], "stage": 1, "slip": [[1.0], [2.0]],
        "position": {"time": 0.5, "size": 0.125, "number": 2, "stiffer": [[0.25, 10.0]], "far_at": 0.75, "rate": 1.5},
    }  # fmt: skip
    labels = np.zeros((1, 3))
    checkpoint = SimpleNamespace(
        facts=facts, values_at=lambda given: np.array([[[1.0, 2.0]], [[3.0, 4.0]], [[5.0, 6.0]]]),
        shear_kp=np.empty((0, 0)), points_px=np.empty((0, 2)),
    )  # fmt: skip
    monkeypatch.setattr("tmc_vem.simulation.recorder.Checkpoint", SimpleNamespace(read=lambda path: checkpoint))
    said: list[Any] = []
    made: Any = Recorder.__new__(Recorder)
    vars(made).update(
        directory=SimpleNamespace(path=tmp_path, rewrite_history=lambda *given: said.append(("history", *given))),
        inputs={"a": 1}, _node_labels=labels, watch=SimpleNamespace(go_on=lambda given: said.append(("watch", given))),
        _snapshots=SimpleNamespace(restore=lambda given: said.append(("snapshots", given))),
        lowered=Lowered(), descending=None, problem=SimpleNamespace(units=lambda: Units("mm", "N")),
        _units_of=lambda rows: {"of": len(rows)}, _on_root=True,
        system=SimpleNamespace(
            comm=MPI.COMM_SELF,
            remember=lambda stage, kept: said.append(("stage", stage, [k.tolist() for k in kept])),
            shear=lambda u: (np.empty((0, 2)), np.empty(0)),
        ),
        _read_again=lambda u: said.append(("read", u.getArray().tolist())),
        contact=SimpleNamespace(is_used=False, go_on=lambda u, s: said.append(("slip", u.getArray().tolist(), s))),
    )  # fmt: skip
    u = at(0.0, 0.0)
    states, position = made.restore(u)
    assert [vector.getArray().tolist() for vector in states.vectors] == [[1.0, 2.0], [3.0, 4.0]]
    assert [control.tolist() for control in states.controls] == [[0.25], [0.5]]
    assert u.getArray().tolist() == [3.0, 4.0]
    assert position == StepperState(0.5, 0.125, 2, ((0.25, 10.0),), 0.75, 1.5)
    assert said == [
        ("stage", 1, [[5.0, 6.0]]), ("watch", history), ("history", history, {"of": 2}),
        ("snapshots", [[0.5, ["x.vtu"]]]), ("read", [3.0, 4.0]), ("slip", [3.0, 4.0], [[1.0], [2.0]]),
    ]  # fmt: skip
    assert (made.history, made._seconds_before, made._plain_history[1]["step"]) == (history, 7.5, 2)
    made.inputs = {"a": 2}
    with pytest.raises(InputError, match="the checkpoint was made with a = 1, not 2: start anew"):
        made.restore(u)
