"""What ran where: versions of programs and libraries, machine, ranks."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from tmc_vem.support.version import VERSION

DOLFINX = ("fenics-dolfinx", "dolfinx-solver-real", "dolfinx-solver-complex")  # packages that bring it


def versions(n_ranks: int = 1) -> dict[str, Any]:
    """Versions and machine as plain values for result files."""
    from tmc_vem.support.petsc import PETSc

    return {
        "tmc-vem": VERSION,
        "revision": revision(),
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
