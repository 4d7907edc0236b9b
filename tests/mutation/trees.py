"""Copies of the working tree, and processes in them that can be ended with all that they started."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
STORE = ROOT / "build" / "mutants"
PACKAGES = ("codegen", "tmc_vem")
POLL = 0.1  # seconds between two looks at a running process

_SETTINGS = {
    "OMP_NUM_THREADS": "1",
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "OMPI_MCA_mpi_yield_when_idle": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
}


@dataclass(frozen=True)
class Ended:
    """How a process ended.

    Attributes:
        code: its exit code; None if it was stopped.
        output: what it wrote.
        seconds: how long it ran.
    """

    code: int | None
    output: str
    seconds: float


class Tree:
    """A copy of all files that git knows or would take, with caches of its own.

    Args:
        path: where; made by :meth:`of`.
        cache: directory for compiled kernels and forms.
    """

    def __init__(self, path: Path, cache: Path) -> None:
        self.path, self.cache = path, cache
        self._clock = int(time.time())
        self._running: int | None = None

    @classmethod
    def of(cls, root: Path, path: Path, cache: Path) -> Tree:
        """Copy the files of ``root`` to ``path``."""
        listed = subprocess.run(
            ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
            cwd=root, capture_output=True, text=True, check=True,
        )  # fmt: skip
        for name in listed.stdout.split("\0"):
            if name and (root / name).is_file():
                (path / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(root / name, path / name)
        if (root / ".venv").exists():
            (path / ".venv").symlink_to(root / ".venv")
        return cls(path, cache)

    def write(self, name: str, text: str) -> None:
        """Replace a file, with a time of its own: Python tells a compiled file from this one's by time and size."""
        self._clock += 10
        (self.path / name).write_text(text)
        os.utime(self.path / name, (self._clock, self._clock))

    def environment(self, more: Mapping[str, str]) -> dict[str, str]:
        """Variables for processes here: this copy comes before the installed package."""
        kept = {name: value for name, value in os.environ.items() if not name.startswith(("COVERAGE_", "PYTEST_"))}
        place = {
            "PYTHONPATH": f"{self.path}{os.pathsep}{self.path / 'tests'}",
            "XDG_CACHE_HOME": str(self.cache),
        }
        return {**kept, **_SETTINGS, **place, **more}

    def run(
        self,
        arguments: Sequence[str],
        *,
        variables: Mapping[str, str] | None = None,
        stop: Callable[[float], bool],
    ) -> Ended:
        """Run this Python with arguments until it ends, or ``stop``, which is given the seconds so far, is true."""
        self.cache.mkdir(parents=True, exist_ok=True)
        log = self.path.with_suffix(".log")
        start = time.monotonic()
        with log.open("w") as output:
            process = subprocess.Popen(
                [sys.executable, *arguments], cwd=self.path, env=self.environment(variables or {}),
                stdout=output, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, start_new_session=True,
            )  # fmt: skip
            self._running = process.pid
            try:
                while process.poll() is None and not stop(time.monotonic() - start):
                    time.sleep(POLL)
                code = process.poll()
            finally:
                end_session(process.pid)
                process.wait()
                self._running = None
        return Ended(code, log.read_text(errors="replace"), time.monotonic() - start)

    def interrupt(self) -> None:
        """End what runs here, from another thread."""
        if self._running is not None:
            end_session(self._running)


def end_session(session: int) -> None:
    """End all processes of a session, those of mpirun included: asked first, then told."""
    for sent, patience in ((signal.SIGTERM, 3.0), (signal.SIGKILL, 1.0)):
        members = _members(session)
        for member in members:
            try:
                os.kill(member, sent)
            except ProcessLookupError:
                continue
        until = time.monotonic() + patience
        while members and time.monotonic() < until:
            time.sleep(POLL)
            members = _members(session)
        if not members:
            return


def _members(session: int) -> list[int]:
    """Living processes of a session; one that has ended and is not waited for yet does not count."""
    found = []
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            state, _, _, owner = (entry / "stat").read_text().rpartition(")")[2].split()[:4]
        except OSError:  # it has ended meanwhile
            continue
        if int(owner) == session and state not in "ZX":
            found.append(int(entry.name))
    return found
