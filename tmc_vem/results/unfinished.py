"""Runs without a result: they go on, were interrupted, or nobody can tell; what is known of them before their end.

A run says in ``run.json`` what it is before its first step, and takes the file away when it has a result. Whether it
goes on is known by the lock on its directory. Where a file system has none, the run's process is looked for, which can
only be done on the machine that it runs on.
"""

from __future__ import annotations

import json
import os
import shlex
import socket
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tmc_vem.results.lock import is_held

BEGUN, COMMAND = "run.json", "command.json"
CHECKPOINT, BEFORE = "checkpoint.npz", "checkpoint-before.npz"
ROUNDS = "adapt/rounds.json"  # of a run whose mesh is being adapted
RUNNING, INTERRUPTED, UNKNOWN = "running", "interrupted", "unknown"
SILENT = "its process ended without a word: killed, or lost with its machine"


def process_facts(*, locked: bool) -> dict[str, Any]:
    """What this process is known by later; ``locked`` says whether it holds the lock of its run directory."""
    number = os.getpid()
    return {"id": number, "host": socket.gethostname(), "began": _began(number), "locked": locked}


def unfinished(path: Path) -> dict[str, Any]:
    """What is known of a run without a result, by the names of ``result.json``, and its state as ``unfinished``.

    Raises:
        FileNotFoundError: there is no run.
        ValueError: a file of it is damaged.
    """
    facts = _begun(path)
    process = facts.get("process", {})
    state = _state(path, process)
    why, how = str(facts.get("reason") or SILENT), how_to_go_on(path)
    reason = {
        RUNNING: _named(process),
        INTERRUPTED: why if not how or how in why else f"{why}; {how}",
        UNKNOWN: f"{_named(process)} may be at work: its file system has no locks",
    }[state]
    known = {"versions": {}, "n_cells": 0, "n_dofs": 0, "projection_degrees": {}, "units": {}}
    return {**known, **facts, "complete": False, "unfinished": state, "reason": reason}


def how_to_go_on(path: Path) -> str:
    """How a run that was cut short goes on; nothing if it has no checkpoint."""
    if not any((path / name).is_file() for name in (CHECKPOINT, BEFORE, ROUNDS)):
        return ""
    if (path / COMMAND).is_file():
        return f"'tmc-vem resume {shlex.quote(str(path))}' goes on"
    return "run(..., resume=True) goes on"


def _begun(path: Path) -> dict[str, Any]:
    """What the run has said of itself; of one from before ``run.json``, what its other files say."""
    try:
        facts = json.loads((path / BEGUN).read_text())
    except FileNotFoundError:
        return {"inputs": _inputs(path)}
    if not (isinstance(facts, dict) and isinstance(facts.get("process", {}), dict)):
        raise ValueError(f"{BEGUN} is damaged") from None
    return facts


def checkpoint_inputs(path: Path) -> dict[str, Any] | None:
    """Inputs of the run that a directory has a checkpoint of; None without one that can be read."""
    import numpy as np

    for name in (CHECKPOINT, BEFORE):
        try:
            with np.load(path / name, allow_pickle=False) as file:
                inputs: dict[str, Any] = dict(json.loads(str(file["facts"]))["inputs"])
                return inputs
        except (OSError, EOFError, KeyError, TypeError, ValueError, zipfile.BadZipFile):
            continue
    return None


def _inputs(path: Path) -> dict[str, Any]:
    inputs = checkpoint_inputs(path)
    if inputs is not None:
        return inputs
    command = json.loads((path / COMMAND).read_text())
    if not isinstance(command, dict):
        raise ValueError(f"{COMMAND} is damaged")
    return {"problem": str(command.get("problem", "run"))}


def _state(path: Path, process: Mapping[str, Any]) -> str:
    held = is_held(path) if process.get("locked", True) else None
    goes_on = _lives(process) if held is None else held
    return UNKNOWN if goes_on is None else RUNNING if goes_on else INTERRUPTED


def _lives(process: Mapping[str, Any]) -> bool | None:
    """Whether a process of this machine lives; None for one of another machine."""
    number = process.get("id")
    if process.get("host") != socket.gethostname() or not isinstance(number, int):
        return None
    try:
        os.kill(number, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        pass  # somebody else's
    return _began(number) == process.get("began")  # numbers of processes are used again


def _began(number: int) -> int | None:
    """When a process began, in ticks since the machine was started; None if that is not known here."""
    try:
        return int(Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[19])
    except (OSError, ValueError, IndexError):
        return None


def _named(process: Mapping[str, Any]) -> str:
    return f"process {process['id']} on {process['host']}" if {"id", "host"} <= process.keys() else "another process"
