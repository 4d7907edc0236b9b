"""Parts of a run by themselves: options, inputs, path, ranks, checkpoints."""

from __future__ import annotations

import json
import pickle
import signal
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from helpers_ranks import Ranks
from mpi4py import MPI

from tmc_vem.problems import Bodies, Box, Medium
from tmc_vem.problems.base import medium_region
from tmc_vem.simulation import checkpoint as checkpoints
from tmc_vem.simulation import simulation
from tmc_vem.simulation.balance import balance
from tmc_vem.simulation.checkpoint import Checkpoint, require_same_inputs
from tmc_vem.simulation.interrupt import Interrupted, StopRequest, stop_requests, stopping_at_once
from tmc_vem.simulation.options import RunOptions
from tmc_vem.simulation.plan import control_path, order_of, run_inputs, snapshot_times
from tmc_vem.simulation.problem_file import _line
from tmc_vem.simulation.provenance import versions
from tmc_vem.simulation.triangulated import Triangulated
from tmc_vem.simulation.words import reported
from tmc_vem.solve.path import load_path
from tmc_vem.solve.stepping import SteppingOptions
from tmc_vem.support.errors import InputError, TmcError
from tmc_vem.support.units import Units
from tmc_vem.system.control import Control
from tmc_vem.system.fem_settings import FemSettings
from tmc_vem.vem.spaces.element_settings import ElementSettings

BOX = Box(cells=(20, 5))


# -- options, inputs, path -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"snapshots": -1}, "snapshots = -1: use 0 to 10000"),
        ({"snapshots": 10_001}, "snapshots = 10001: use 0 to 10000"),
        ({"snapshots": 10_000}, None), ({"snapshots": 0}, None),
        ({"checkpoint_every": -1}, "checkpoint every -1 steps: use 1 or more, or 0 for none"),
        ({"checkpoint_every": 0}, None),
        ({"largest_step": 1.1}, "largest step = 1.1: use a fraction of the load, above 0 and up to 1"),
        ({"largest_step": 0.0}, "largest step = 0: use a fraction of the load, above 0 and up to 1"),
        ({"largest_step": 1.0}, None),
        ({"path": (0.5, 1.0)}, "load path 0.5 1 must begin with 0"), ({"path": ()}, "load path  must begin with 0"),
        ({"output_loads": (1.5,)}, None),  # there may be a history: the problem knows
        ({"output_loads": (-0.5,)}, "output load -0.5 is not on the load path, which goes from 0 to 1"),
        ({"output_loads": (2.5,), "path": (0.0, 2.0)},
         "output load 2.5 is not on the load path, which goes from 0 to 2"),
        ({"output_loads": (-0.1,), "path": (0.0, 2.0)},
         "output load -0.1 is not on the load path, which goes from 0 to 2"),
        ({"output_loads": (0.0, 1.0)}, None),
        ({"continuation": {"beta": 1.0}}, "continuation has no 'beta' (did you mean 'gamma'?): it has gamma, alpha_r"),
        ({"continuation": {"gamma": 0.0}},
         "continuation from gamma = 0 must be a positive number: it is where the parameter starts from"),
        ({"follow": True, "steps": 3}, "follow does not go with steps: the load is not prescribed along the branch"),
        ({"follow": True, "output_loads": (0.5,)},
         "follow does not go with output_loads: the load is not prescribed along the branch"),
        ({"follow": True, "continuation": {"gamma": 1.0}},
         "follow does not go with continuation: the load is not prescribed along the branch"),
        ({"follow": True}, None),
        ({"max_seconds": 0.0}, "max_seconds = 0 must be a positive number: or leave it out for no limit"),
        ({"max_iterations": -1}, "max_iterations = -1 must be a positive number: or leave it out for no limit"),
    ],
)  # fmt: skip
def test_options_of_a_run(given: dict[str, Any], said: str | None) -> None:
    if said is None:
        RunOptions(**given)
    elif given == {"continuation": {"beta": 1.0}}:
        with pytest.raises(InputError, match=r"continuation has no 'beta'.*: it has gamma, alpha_r"):
            RunOptions(**given)
    else:
        with pytest.raises(InputError) as caught:
            RunOptions(**given)
        assert str(caught.value) == said


@pytest.mark.parametrize(
    ("given", "said"),
    [({"order": 1}, "finite element order 1: use 2 or 3, the energy has second derivatives"), ({"order": 3}, None),
     ({"quadrature": 1}, "quadrature degree 1: use 2 to 20"), ({"quadrature": 21}, "quadrature degree 21: use 2 to 20"),
     ({"quadrature": 2}, None), ({"quadrature": 20}, None),
     ({"eta": 0.0}, "eta = 0 must be a positive number: 10 is a sane value")],
)  # fmt: skip
def test_settings_of_finite_elements(given: dict[str, Any], said: str | None) -> None:
    assert FemSettings() == FemSettings(2, 4, "none", 10.0, False)
    if said is None:
        FemSettings(**given)
        return
    with pytest.raises(InputError) as caught:
        FemSettings(**given)
    assert str(caught.value) == said


def test_the_defaults_of_a_run() -> None:
    assert RunOptions() == RunOptions(
        method="vem", steps=None, largest_step=0.1, solver="direct", path=(0.0, 1.0), output_loads=(), continuation={},
        follow=False, allow_overlap=False, max_iterations=None, max_seconds=None, snapshots=10, triangulated=False,
        fields="cauchy_stress,von_mises", checkpoint_every=1, overwrite=False, extrapolate_gamma=False, gamma_decades=2,
        friction_error=0.01,
    )  # fmt: skip
    assert simulation.stepping_of(RunOptions(steps=7), friction=True) == SteppingOptions(
        steps=7, largest=0.1, first=0.01, smallest=1e-5, target_iterations=40, order=1
    )
    assert simulation.stepping_of(RunOptions(steps=7)) == SteppingOptions(
        steps=7, largest=0.1, first=0.01, smallest=1e-5
    )
    assert simulation.stepping_of(RunOptions(largest_step=0.005)) == SteppingOptions(largest=0.005, first=0.005)
    assert simulation.stepping_of(RunOptions(largest_step=1e-6)) == SteppingOptions(None, 1e-6, 1e-6, 1e-6)


METHOD = {"method": "vem", "order": 2, "projection": "auto", "projection_degree": "spectral test", "quadrature": 4,
          "rule": "auto", "load_steps": "automatic", "largest_step": 0.1}  # fmt: skip


def test_inputs_that_a_run_records() -> None:
    problem = BOX.inputs()
    assert run_inputs(BOX, RunOptions()) == {**problem, **METHOD}
    element = ElementSettings(order=3, degree=2, quadrature=7, rule="triangles", interior_penalty="full", eta=4.0)
    options = RunOptions(
        element=element, steps=5, path=(0.0, 2.0), output_loads=(0.5,), continuation={"gamma": 1e-3},
        allow_overlap=True, largest_step=0.2,
    )  # fmt: skip
    assert run_inputs(BOX, options) == {
        **problem, "method": "vem", "order": 3, "projection": "auto", "projection_degree": 2, "quadrature": 7,
        "rule": "triangles", "interior_penalty": "full", "eta": 4.0, "load_steps": 5, "largest_step": 0.2,
        "load_path": [0.0, 2.0], "output_loads": [0.5], "continuation": {"gamma": 1e-3}, "allow_overlap": True,
    }  # fmt: skip
    limit = RunOptions(extrapolate_gamma="path", gamma_decades=3)
    assert run_inputs(BOX, limit) == {**problem, **METHOD, "extrapolate_gamma": "path", "gamma_decades": 3}
    assert run_inputs(BOX, RunOptions(extrapolate_gamma=True))["extrapolate_gamma"] is True
    fem = RunOptions("fem", fem=FemSettings(3, 5, "penalty", 2.0, True), follow=True)
    assert run_inputs(BOX, fem) == {
        **problem, "method": "fem", "order": 3, "quadrature": 5, "interior_penalty": "penalty", "eta": 2.0,
        "triangles": True, "load_steps": "automatic", "largest_step": 0.1, "follow": True,
    }  # fmt: skip
    assert (order_of(fem), order_of(options), order_of(RunOptions())) == (3, 3, 2)
    units: Any = SimpleNamespace(inputs=BOX.inputs, units=lambda: Units("mm", "N"), regions=dict)
    assert run_inputs(units, RunOptions())["units"] == {"length": "mm", "force": "N"}
    assert Triangulated(Bodies(), 0.3).inputs() == {**Bodies().inputs(), "triangle_size": 0.3}


def test_the_path_of_a_run() -> None:
    path = control_path(BOX, RunOptions(path=(0.0, 1.0, 0.5), output_loads=(0.75,)))
    assert path.corners == (Control(0.0), Control(1.0), Control(0.5))
    assert path.stops == pytest.approx([0.75, 1.0, 1.25, 1.5])
    soft = {"gamma": 1e-3, "alpha_r": 5.0}
    path = control_path(BOX, RunOptions(path=(0.0, 1.0, 0.5), continuation=soft))
    end = {"gamma": 1e-5, "alpha_r": 1.0}
    assert path.corners == (Control(0.0, soft), Control(1.0, soft), Control(1.0, end), Control(0.5, end))
    with pytest.raises(InputError, match=r"output load 1\.5 is not on the load path, which goes from 0 to 1"):
        control_path(BOX, RunOptions(output_loads=(1.5,)))
    two: Any = SimpleNamespace(regions=lambda: {
        "a": medium_region(Medium(gamma=1e-4), 1.0), "b": medium_region(Medium(gamma=1e-5), 1.0), **BOX.regions(),
    }, prescribed=list)  # fmt: skip
    with pytest.raises(InputError, match="continuation in gamma needs one value of it in the medium, got 2"):
        control_path(two, RunOptions(continuation={"gamma": 1e-3}))
    assert simulation.gamma_of(two) == {}
    assert simulation.gamma_of(BOX) == {"gamma": 1e-5}


def test_where_fields_are_written() -> None:
    path = load_path((0.0, 2.0), stops=(0.3,))
    assert snapshot_times(path, RunOptions(snapshots=0)) == []
    assert snapshot_times(path, RunOptions(snapshots=4)) == pytest.approx([0.3, 0.5, 1.0, 1.5, 2.0])
    along = snapshot_times(load_path(), RunOptions(snapshots=2, follow=True))
    assert along == pytest.approx(np.arange(1, 21) / 2)


@pytest.mark.parametrize(
    ("message", "line"),
    [
        ("a.toml: mesh: other-size = 3: use less", " (line 3)"),  # the last key that is named
        ("a.toml: mesh: size = 3: use less", " (line 1)"),  # which stands there twice: the one before
        ("a.toml: solve: steps = 0: use 1", " (line 7)"),
        ("a.toml: mesh: 'left' has no energy", " (line 8)"),  # a quoted word comes before
        ("a.toml: 'size' and 'left' meet", ""),  # the first one only
        ("a.toml: mesh lacks 'nowhere'", " (line 1)"),
        ("a.toml: nothing", ""),
    ],
)
def test_the_line_that_a_message_is_about(message: str, line: str) -> None:
    text = "[mesh] # steps\nsize = 1\nother-size = 2\nsize = 3\n[regions.left]\n[regions.right]\nsteps = 0\nleft = 1\n"
    assert _line(text, message) == line


def test_versions_of_a_run() -> None:
    found = versions(3)
    assert list(found) == ["tmc-vem", "revision", "sources", "python", "petsc", "numpy", "sympy", "fenics-dolfinx",
                           "machine", "processor", "ranks", "threads", "command"]  # fmt: skip
    assert (found["ranks"], found["numpy"]) == (3, np.__version__)


# -- ranks and signals -----------------------------------------------------------------------------------------------


def test_how_even_the_work_of_ranks_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tmc_vem.simulation.balance.resource.getrusage", lambda _: SimpleNamespace(ru_maxrss=2048))
    found = balance(Ranks(0, other=({"cells": 3.0, "none": 0.0}, 6.0)), {"cells": 1.0, "none": 0.0})  # type: ignore[arg-type]
    assert found == {
        "ranks": 2,
        "imbalance": {"cells": 1.5, "none": 1.0},
        "peak_memory_mib": {"largest": 6.0, "all": 8.0},
    }


def test_a_signal_stops_all_ranks_together() -> None:
    error = Interrupted(signal.SIGTERM, "resume")
    assert (str(error), error.exit_code, error.number) == ("stopped by SIGTERM; resume", 143, 15)
    assert str(Interrupted(2)) == "stopped by SIGINT"
    travelled = pickle.loads(pickle.dumps(error))  # to other ranks
    assert (str(travelled), travelled.exit_code, travelled.number) == (str(error), 143, 15)
    request = StopRequest(Ranks(0, other=0))  # type: ignore[arg-type]
    request.check()
    request._remember(15, None)
    with pytest.raises(Interrupted, match="SIGTERM"):
        request.check()
    with pytest.raises(KeyboardInterrupt):
        request._remember(15, None)
    with pytest.raises(Interrupted, match="SIGINT"):
        StopRequest(Ranks(0, other=2)).check()  # type: ignore[arg-type]
    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    with stop_requests(MPI.COMM_SELF) as stop:
        assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == [stop._remember] * 2
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_stops_a_single_rank_at_once(number: signal.Signals) -> None:
    before = signal.getsignal(number)
    with pytest.raises(Interrupted, match=f"stopped by {number.name}"), stopping_at_once():
        signal.raise_signal(number)
    assert signal.getsignal(number) is before


# -- checkpoints -----------------------------------------------------------------------------------------------------

LABELS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 0.5, 1.0]])


def made(number: float) -> Checkpoint:
    return Checkpoint({"number": number}, LABELS, number * np.arange(12.0).reshape(2, 3, 2))


def test_the_content_of_a_checkpoint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    waited: list[bool] = []
    real = checkpoints.whole_file

    def noting(path: Path, keep: Path | None = None, *, durable: bool = True) -> Any:
        waited.append(durable)
        return real(path, keep, durable=durable)

    monkeypatch.setattr(checkpoints, "whole_file", noting)
    made(1.0).write(tmp_path)
    with np.load(tmp_path / "checkpoint.npz") as file:
        assert sorted(file) == ["facts", "labels_nz", "parts", "schema", "sha256", "states_sni"]
        assert (int(file["schema"]), json.loads(str(file["facts"])), str(file["parts"])) == (4, {"number": 1.0}, "{}")
        assert file["states_sni"].tolist() == made(1.0).states_sni.tolist()
        assert file["labels_nz"].tolist() == LABELS.tolist()
    made(2.0).write(tmp_path, durable=False)
    assert [Checkpoint.read(tmp_path).facts, checkpoints._read(tmp_path / "checkpoint-before.npz").facts] == [
        {"number": 2.0}, {"number": 1.0},
    ]  # fmt: skip
    made(3.0).write(tmp_path, keep=False)
    assert checkpoints._read(tmp_path / "checkpoint-before.npz").facts == {"number": 1.0}
    assert waited == [True, False, True]
    (tmp_path / "checkpoint.npz").write_text("torn")
    assert Checkpoint.read(tmp_path).facts == {"number": 1.0}
    (tmp_path / "checkpoint-before.npz").unlink()
    with pytest.raises(
        InputError, match=r"no checkpoint to go on from: checkpoint\.npz is damaged \(.*\); no checkpoi"
    ):
        Checkpoint.read(tmp_path)


def test_parts_that_no_checkpoint_needs_go(tmp_path: Path) -> None:
    for n in (1, 2, 3):
        name = f"checkpoint-part-{n:06d}-1.npz"
        digest = made(n).write_part(tmp_path, name)
        made(n).write(tmp_path, {name: digest})
    assert sorted(path.name for path in tmp_path.glob(checkpoints.PARTS)) == [
        "checkpoint-part-000002-1.npz", "checkpoint-part-000003-1.npz",
    ]  # fmt: skip
    found = Checkpoint.read(tmp_path)
    assert found.states_sni.shape == (2, 6, 2)
    assert found.labels_nz.tolist() == [*LABELS.tolist(), *LABELS.tolist()]
    made(9).write_part(tmp_path, "checkpoint-part-000003-1.npz")
    with pytest.raises(ValueError, match=r"its part checkpoint-part-000003-1\.npz is another one"):
        checkpoints._read(tmp_path / "checkpoint.npz")


def test_checkpoints_of_other_versions_and_changed_ones(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made(1.0).write(tmp_path)
    monkeypatch.setattr(checkpoints, "SCHEMA", 5)
    with pytest.raises(ValueError, match="it was written by another version: schema 4, here 5"):
        checkpoints._read(tmp_path / "checkpoint.npz")
    monkeypatch.undo()
    with np.load(tmp_path / "checkpoint.npz") as file:
        content = dict(file)
    for changed in ({"facts": json.dumps({"number": 1.5})}, {"states_sni": content["states_sni"] + 1.0},
                    {"labels_nz": content["labels_nz"] + 1.0}):  # fmt: skip
        np.savez(tmp_path / "checkpoint.npz", **{**content, **changed})
        with pytest.raises(ValueError, match="its checksum is wrong"):
            checkpoints._read(tmp_path / "checkpoint.npz")


def test_states_at_nodes_of_a_checkpoint() -> None:
    found = made(1.0).values_at(LABELS[[2, 0]] + 0.9e-9 * np.array([1.0, 0.0, 0.0]))
    assert found.tolist() == made(1.0).states_sni[:, [2, 0]].tolist()
    assert made(1.0).values_at(np.empty((0, 3))).shape == (2, 0, 2)
    with pytest.raises(InputError, match=r"^the checkpoint has no node at \(1, 2\.5\): it belongs to another mesh$"):
        made(1.0).values_at(np.array([[0.0, 0.0, 0.0], [1.0, 2.5, 0.0]]))
    with pytest.raises(InputError, match="no node at"):
        made(1.0).values_at(LABELS + 1.1e-9 * np.array([1.0, 0.0, 0.0]))
    twice = replace(made(1.0), labels_nz=LABELS * 0.0)
    with pytest.raises(InputError, match=r"the mesh has cracks|no node"):
        twice.values_at(LABELS[:2] * 0.0)


def test_a_disk_that_is_full_is_said_with_what_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: Any, **__: Any) -> Any:
        raise OSError(28, "No space left on device")

    (tmp_path / "checkpoint.npz").write_text("")
    monkeypatch.setattr(checkpoints, "whole_file", full)
    with pytest.raises(TmcError) as caught:
        made(1.0).write(tmp_path)
    assert str(caught.value) == (
        f"the checkpoint in {tmp_path} could not be written (No space left on device); the last one is intact: with "
        "more room, run(..., resume=True) goes on"
    )
    with pytest.raises(TmcError) as caught, reported(tmp_path):
        full()
    assert str(caught.value) == (
        f"{tmp_path} cannot be written (No space left on device); with more room, run(..., resume=True) goes on from "
        "the last checkpoint"
    )


def test_other_inputs_than_those_of_the_checkpoint_are_named() -> None:
    require_same_inputs({"a": [1, 2], "b": None}, {"a": (1, 2)})
    with pytest.raises(InputError, match=r"^the checkpoint was made with b = 2, not None: start anew$"):
        require_same_inputs({"a": 1, "b": 2, "c": 3}, {"a": 1, "c": 4})
    with pytest.raises(InputError, match=r"made with d\.e = 1, not 2: start anew$"):
        require_same_inputs({"d": {"e": 1, "f": [1]}}, {"d": {"f": (1,), "e": 2}})
