"""Readers on C libraries, in a process of their own: a bad file may end scipy, HDF5 or gmsh, but not the program."""

from __future__ import annotations

import pickle
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

from tmc_vem.mesh.files.record import Reading, Record
from tmc_vem.support.errors import InputError

LONGEST = 600.0  # seconds that reading may take


def read(module: str, path: Path, reading: Reading, longest: float | None = LONGEST) -> Record:
    """What ``module.read(path, reading)`` gives.

    Args:
        module: its name.
        path: the file.
        reading: how to read it.
        longest: seconds that it may take.

    Raises:
        InputError: the reader refuses the file, crashes, or does not end.
    """
    command = [sys.executable, "-m", __name__, module, str(path)]
    try:
        done = subprocess.run(command, input=pickle.dumps(reading), capture_output=True, timeout=longest, check=False)
    except subprocess.TimeoutExpired:
        raise InputError(f"reading it takes more than {longest:g} s: it is damaged") from None
    if done.returncode < 0:
        raise InputError(f"the library that reads it ended with signal {-done.returncode}")
    try:
        answer: Any = pickle.loads(done.stdout)
    except (pickle.UnpicklingError, EOFError):
        said = done.stderr.decode("utf-8", "replace").strip().splitlines()
        raise InputError(f"reading it failed: {said[-1] if said else f'exit code {done.returncode}'}") from None
    if isinstance(answer, Record):
        return answer
    raise InputError(str(answer))


def serve(module: str, path: str) -> Record | str:
    """The record of a file, or why there is none."""
    reading: Reading = pickle.load(sys.stdin.buffer)
    try:
        record: Record = import_module(module).read(Path(path), reading)
    except InputError as error:
        return str(error)
    except OSError as error:
        return f"it cannot be read: {error.strerror or error}"
    except Exception as error:  # what is damaged in ways that no check foresees
        return f"it is damaged ({str(error) or type(error).__name__})"
    return record


if __name__ == "__main__":
    sys.stdout.buffer.write(pickle.dumps(serve(*sys.argv[1:3])))
