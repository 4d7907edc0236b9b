"""What ran where: versions of programs and libraries, machine, ranks."""

from __future__ import annotations

import hashlib
import os
import platform
import subprocess
import sys
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from tmc_vem.support.version import VERSION

ROOT = Path(__file__).parents[2]
OTHERS = ("cli", "report", "study")  # what these do comes before and after the numbers of a run
DOLFINX = ("fenics-dolfinx", "dolfinx-solver-real", "dolfinx-solver-complex")  # packages that bring it


def versions(n_ranks: int = 1) -> dict[str, Any]:
    """Versions and machine as plain values for result files."""
    from tmc_vem.support.petsc import PETSc

    return {
        "tmc-vem": VERSION,
        "revision": revision(),
        "sources": sources(),
        "python": platform.python_version(),
        "petsc": ".".join(map(str, PETSc.Sys.getVersion())),
        **{name: _version(name) for name in ("numpy", "sympy")},
        "fenics-dolfinx": next((found for name in DOLFINX if (found := _version(name))), None),
        "machine": platform.machine(),
        "processor": _processor(),
        "ranks": n_ranks,
        "threads": os.environ.get("OMP_NUM_THREADS", "unset"),
        "command": " ".join(sys.argv),
    }


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _processor() -> str:
    try:
        with open("/proc/cpuinfo") as file:
            return next(line.split(":", 1)[1].strip() for line in file if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor()


@cache
def sources() -> str:
    """Hash of all sources that a run's numbers depend on: as long as it stays, a run need not be repeated.

    A revision of git says less: it changes with every page of the documentation, and knows files that differ from it
    only as ``-dirty``.
    """
    found = hashlib.sha256()
    for package in ("codegen", "tmc_vem"):
        for path in sorted((ROOT / package).rglob("*")):
            name = path.relative_to(ROOT / package)
            if path.suffix in (".py", ".c", ".h", ".petsc") and name.parts[0] not in OTHERS:
                found.update(f"{package}/{name.as_posix()}\0".encode() + path.read_bytes() + b"\0")
    return found.hexdigest()[:16]


def revision() -> str | None:
    """Git revision of the program's sources, with ``-dirty`` if files differ from it; None outside of a clone."""
    root = Path(__file__).parents[1]
    if not (root / ".git").exists():
        return None
    command = ["git", "-C", str(root), "describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=10, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip() or None
