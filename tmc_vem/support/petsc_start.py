"""Starting PETSc, with MPI before it: the only place that imports petsc4py.

The petsc4py of a wheel finds the MPI library, which another wheel brings, only if mpi4py has loaded it already; linked
with the system's MPI both orders do. Modules take PETSc from :mod:`tmc_vem.support.petsc`; only who has options for it
calls :func:`start`, before any of them is imported.
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Sequence
from typing import Any

from tmc_vem.support.errors import InputError

INSTALL = (
    "pip install 'tmc-vem[wheels]' (Python 3.12 or newer), or apt-get install python3-petsc4py-real (Debian) and an "
    "environment with --system-site-packages"
)


def start(words: Sequence[str] | None = None) -> Any:
    """Start MPI and PETSc where they do not run yet.

    Args:
        words: name of the program and PETSc options; without them those of PETSC_OPTIONS count only.

    Returns:
        The module ``petsc4py.PETSc``.

    Raises:
        InputError: petsc4py, mpi4py or the MPI library is missing, or PETSc is built for complex numbers.
    """
    if int(os.environ.get("MPI_LOCALNRANKS") or 0) > len(os.sched_getaffinity(0)):  # MPICH
        os.environ.setdefault("MPIR_CVAR_ENABLE_HEAVY_YIELD", "1")  # who waits lets others work
    try:
        importlib.import_module("mpi4py.MPI")
        petsc4py = importlib.import_module("petsc4py")
        if words is not None:
            petsc4py.init(list(words))
        PETSc = importlib.import_module("petsc4py.PETSc")
    except (ImportError, RuntimeError) as error:  # mpi4py's wheel says RuntimeError where there is no MPI
        reason = " ".join(str(error).split())
        raise InputError(f"petsc4py is not available to this Python ({reason}): {INSTALL}") from None
    if PETSc.ScalarType().dtype.kind == "c":
        raise InputError(f"PETSc is built for complex numbers here; the real build is needed: {INSTALL}")
    return PETSc
