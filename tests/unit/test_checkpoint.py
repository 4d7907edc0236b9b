"""Checkpoints: atomic, checked, independent of ranks; a run that was stopped ends like one that was not."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from helpers_process import clean_environment, tmc

from tmc_vem.simulation.checkpoint import BEFORE, CHECKPOINT, PARTS, Checkpoint
from tmc_vem.support.errors import InputError, TmcError

COMMAND = [sys.executable, "-c", "from tmc_vem.cli.main import main; main()"]
BOX = ["run", "box", "--cells", "20", "5", "--uy", "-0.4", "--steps", "16", "--snapshots", "4", "--quiet"]


def checkpoint(value: float = 1.0) -> Checkpoint:
    labels = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 0.5, 1.0]])
    state = np.full((3, 2), value) + labels[:, :2]
    return Checkpoint({"number": value}, labels, np.array([0.5 * state, state]))


@pytest.fixture(scope="module")
def whole_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("whole") / "box"
    assert tmc(*BOX, "--out", str(out)).returncode == 0
    return out


def stopped_run(out: Path, number: int) -> int:
    """Start a run and send it a signal after its fifth step; the exit code."""
    process = subprocess.Popen([*COMMAND, *BOX, "--out", str(out)], stderr=subprocess.DEVNULL, env=clean_environment())
    deadline = time.monotonic() + 60
    history = out / "history.csv"
    while not history.exists() or len(history.read_text().splitlines()) < 6:
        assert time.monotonic() < deadline, "the run made no progress"
        assert process.poll() is None, "the run ended before it was stopped"
        time.sleep(0.002)
    process.send_signal(number)
    return process.wait(timeout=60)


def result(out: Path) -> dict[str, object]:
    data: dict[str, object] = json.loads((out / "result.json").read_text())
    return {key: data[key] for key in ("gap", "reaction", "steps", "newton_iterations", "load", "complete")}


@pytest.mark.parametrize(("number", "code"), [(signal.SIGKILL, -9), (signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_a_stopped_run_goes_on_to_the_same_result(number: int, code: int, tmp_path: Path, whole_run: Path) -> None:
    out = tmp_path / "box"
    assert stopped_run(out, number) == code
    assert not (out / "result.json").exists()
    assert tmc("resume", str(out), "--quiet").returncode == 0
    assert result(out) == result(whole_run)
    assert (out / "fields.pvd").read_text() == (whole_run / "fields.pvd").read_text()
    columns = slice(0, 9)  # all but the time
    for mine, theirs in zip(
        (out / "history.csv").read_text().splitlines(),
        (whole_run / "history.csv").read_text().splitlines(),
        strict=True,
    ):
        assert mine.split(",")[columns] == theirs.split(",")[columns]


def test_another_number_of_ranks_goes_on(tmp_path: Path, whole_run: Path) -> None:
    out = tmp_path / "box"
    stopped_run(out, signal.SIGKILL)
    assert tmc("resume", str(out), "--quiet", ranks=2).returncode == 0
    mine, theirs = result(out), result(whole_run)
    assert mine["gap"] == pytest.approx(theirs["gap"], rel=1e-10)
    assert mine["steps"] == theirs["steps"]


def test_other_inputs_are_refused(tmp_path: Path) -> None:
    out = tmp_path / "box"
    stopped_run(out, signal.SIGKILL)
    asked = json.loads((out / "command.json").read_text())
    asked["options"]["gamma"] = 1e-3
    (out / "command.json").write_text(json.dumps(asked))
    done = tmc("resume", str(out))
    assert done.returncode == 2
    assert "the checkpoint was made with medium" in done.stderr


def test_what_is_not_a_run_cannot_be_resumed(tmp_path: Path) -> None:
    done = tmc("resume", str(tmp_path))
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1


def test_round_trip(tmp_path: Path) -> None:
    checkpoint().write(tmp_path)
    again = Checkpoint.read(tmp_path)
    assert again.facts == {"number": 1.0}
    previous, state = again.values_at(checkpoint().labels_nz[::-1])
    np.testing.assert_array_equal(state, checkpoint().states_sni[1, ::-1])
    np.testing.assert_array_equal(previous, 0.5 * state)


def in_parts(directory: Path, value: float, ranks: int) -> None:
    """Write a checkpoint as that many ranks do, the nodes of rank r moved by 10 r in x."""
    parts = {}
    for rank in range(1, ranks):
        mine = checkpoint(value)
        name = f"checkpoint-part-{int(value):06d}-{rank}.npz"
        moved = Checkpoint({}, mine.labels_nz + np.array([10, 0, 0]) * rank, mine.states_sni)
        parts[name] = moved.write_part(directory, name)
    checkpoint(value).write(directory, parts)


def test_parts_of_ranks_make_one_checkpoint_and_old_ones_go(tmp_path: Path) -> None:
    for value in (1.0, 2.0, 3.0):
        in_parts(tmp_path, value, ranks=3)
    again = Checkpoint.read(tmp_path)
    assert again.facts == {"number": 3.0}
    _, state = again.values_at(np.array([[10.0, 0, 0], [20.0, 0, 0]]))
    np.testing.assert_array_equal(state, [[3.0, 3.0], [3.0, 3.0]])
    assert len(list(tmp_path.glob(PARTS))) == 4  # of the last two
    checkpoint(4.0).write(tmp_path)
    assert len(list(tmp_path.glob(PARTS))) == 2


@pytest.mark.parametrize("damage", ["gone", "flipped", "of another step"])
def test_a_bad_part_spoils_the_checkpoint(damage: str, tmp_path: Path) -> None:
    for value in (1.0, 2.0):
        in_parts(tmp_path, value, ranks=2)
    part = tmp_path / "checkpoint-part-000002-1.npz"
    if damage == "gone":
        part.unlink()
    elif damage == "flipped":
        content = bytearray(part.read_bytes())
        content[content.find(np.float64(2.5).tobytes()) + 6] ^= 1
        part.write_bytes(content)
    else:
        part.write_bytes((tmp_path / "checkpoint-part-000001-1.npz").read_bytes())
    again = Checkpoint.read(tmp_path)
    assert again.facts == {"number": 1.0}
    assert len(again.labels_nz) == 6


def test_nodes_of_another_mesh_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="another mesh"):
        checkpoint().values_at(np.array([[0.25, 0.0, 0.0]]))


@pytest.mark.parametrize("damage", ["cut", "flip", "foreign"])
def test_a_damaged_checkpoint_is_passed_over_for_the_one_before(damage: str, tmp_path: Path) -> None:
    checkpoint(1.0).write(tmp_path)
    checkpoint(2.0).write(tmp_path)
    path = tmp_path / CHECKPOINT
    content = bytearray(path.read_bytes())
    if damage == "cut":
        path.write_bytes(content[: len(content) // 2])
    elif damage == "flip":
        position = content.find(np.float64(2.5).tobytes())  # a value of the state
        assert position > 0
        content[position + 6] ^= 1
        path.write_bytes(content)
    else:
        path.write_text("something else")
    assert Checkpoint.read(tmp_path).facts == {"number": 1.0}


def test_a_power_cut_costs_what_was_not_yet_on_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The checkpoint before is the last one for which the disk was waited for, however many came after it."""
    waited: list[int] = []
    monkeypatch.setattr(os, "fsync", waited.append)
    is_durable = True
    for number, durable in enumerate((True, False, False, True, False, False), start=1):
        checkpoint(float(number)).write(tmp_path, durable=durable, keep=is_durable)
        is_durable = durable
        assert Checkpoint.read(tmp_path).facts == {"number": float(number)}
        if not durable:
            content = (tmp_path / CHECKPOINT).read_bytes()
            (tmp_path / CHECKPOINT).write_bytes(b"")
            assert Checkpoint.read(tmp_path).facts == {"number": 1.0 if number < 4 else 4.0}
            (tmp_path / CHECKPOINT).write_bytes(content)
    assert len(waited) == 2


def test_fields_that_a_power_cut_has_taken_leave_the_collection(tmp_path: Path, whole_run: Path) -> None:
    out = tmp_path / "box"
    shutil.copytree(whole_run, out)
    first, second, *rest = sorted((out / "fields").glob("*.vtu"))
    first.write_bytes(b"")
    second.unlink()
    (out / "fields.pvd").write_bytes(b"")
    assert tmc("resume", str(out), "--quiet").returncode == 0
    files = [part.split('"')[0] for part in (out / "fields.pvd").read_text().split('file="')[1:]]
    assert files == [f"fields/{file.name}" for file in rest]


def test_no_good_checkpoint_is_said(tmp_path: Path) -> None:
    checkpoint().write(tmp_path)
    (tmp_path / CHECKPOINT).write_text("torn")
    with pytest.raises(InputError, match=f"{CHECKPOINT} is damaged.*no {BEFORE}"):
        Checkpoint.read(tmp_path)


def test_full_disk_leaves_the_last_checkpoint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    checkpoint(1.0).write(tmp_path)

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(TmcError, match="No space left on device"):
        checkpoint(2.0).write(tmp_path)
    assert Checkpoint.read(tmp_path).facts == {"number": 1.0}
    assert sorted(p.name for p in tmp_path.iterdir()) == [CHECKPOINT]


def test_a_disk_that_fills_up_is_reported_and_the_run_goes_on_later(tmp_path: Path, whole_run: Path) -> None:
    """Files may not grow beyond a size that later checkpoints exceed."""
    out = tmp_path / "box"
    limit = (whole_run / CHECKPOINT).stat().st_size - 4000  # the history in it grows
    code = f"from mpi4py import MPI; import resource; resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit})); "
    done = subprocess.run(
        [sys.executable, "-c", code + COMMAND[2], *BOX, "--out", str(out)],
        capture_output=True, text=True, env=clean_environment(), check=False,
    )  # fmt: skip
    assert done.returncode == 1
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr
    assert "could not be written (File too large); the last one is intact" in done.stderr
    assert not list(out.rglob(".unfinished-*"))
    assert tmc("resume", str(out), "--quiet").returncode == 0
    assert result(out) == result(whole_run)
