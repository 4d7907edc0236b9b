"""Two runs never share a directory; what a process held is free when it ends, however it ends."""

from __future__ import annotations

import fcntl
import subprocess
import sys
from pathlib import Path

import pytest

from tmc_vem import Box, RunOptions, run
from tmc_vem.results.lock import LOCK, DirectoryLock
from tmc_vem.support.errors import InputError


def test_a_lock_excludes_another(tmp_path: Path) -> None:
    lock = DirectoryLock(tmp_path)
    assert lock.held
    with pytest.raises(InputError, match=r"is in use by process \d+ on .*: wait for it, or choose another"):
        DirectoryLock(tmp_path)
    lock.release()
    assert not (tmp_path / LOCK).exists()
    DirectoryLock(tmp_path).release()


def test_a_killed_process_leaves_no_lock(tmp_path: Path) -> None:
    code = f"from tmc_vem.results.lock import DirectoryLock; from pathlib import Path; import sys, time; \
lock = DirectoryLock(Path({str(tmp_path)!r})); print('held', flush=True); time.sleep(60)"
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "held\n"
    with pytest.raises(InputError, match=f"process {process.pid}"):
        DirectoryLock(tmp_path)
    process.kill()
    process.wait()
    DirectoryLock(tmp_path).release()


def test_a_file_system_without_locks_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise OSError(37, "No locks available")

    monkeypatch.setattr(fcntl, "flock", refuse)
    assert not DirectoryLock(tmp_path).held
    result = run(Box(cells=(20, 5), uy=-0.1), tmp_path / "box", RunOptions(snapshots=0))
    assert any("has no locks" in text for text in result.warnings)


def test_a_directory_in_use_is_refused_and_not_touched(tmp_path: Path) -> None:
    out = tmp_path / "box"
    first = run(Box(cells=(20, 5), uy=-0.1), out, RunOptions(snapshots=0))
    lock = DirectoryLock(out)
    with pytest.raises(InputError, match="in use"):
        run(Box(cells=(20, 5), uy=-0.2), out, RunOptions(snapshots=0, overwrite=True))
    lock.release()
    assert type(first).read(out).gap == first.gap
    assert not (out / LOCK).exists()
