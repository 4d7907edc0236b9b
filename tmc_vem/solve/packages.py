"""What PETSc is built with, as far as solvers and orderings depend on it."""

from __future__ import annotations

from tmc_vem.support.petsc import PETSc

# for factorisations, orderings, and preconditioners
PACKAGES = ("mumps", "superlu_dist", "metis", "parmetis", "ptscotch", "ml", "hypre")


def has(package: str) -> bool:
    """Whether PETSc is built with a package."""
    return bool(PETSc.Sys.hasExternalPackage(package))


def described() -> str:
    """One line: what there is, and what is missing."""
    missing = [package for package in PACKAGES if not has(package)]
    there = ", ".join(package for package in PACKAGES if has(package)) or "none but its own"
    return f"{there}; without {', '.join(missing)}" if missing else there
