"""PETSc for all modules: ``from tmc_vem.support.petsc import PETSc``, which starts it where it does not run yet."""

from __future__ import annotations

from typing import Any

from tmc_vem.support.petsc_start import start

PETSc: Any = start()
