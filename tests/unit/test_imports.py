"""Imports run with the flow of data, and importing the package is cheap."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

# package -> modules it must not import, directly or inside a function
FORBIDDEN = {
    "codegen": ("tmc_vem", "petsc4py", "mpi4py", "dolfinx", "ufl"),
    "tmc_vem/energy": ("codegen", "petsc4py", "mpi4py", "dolfinx", "sympy", "tmc_vem.vem", "tmc_vem.mesh"),
    "tmc_vem/mesh": ("codegen", "dolfinx", "ufl", "tmc_vem.vem", "tmc_vem.fem", "tmc_vem.solve", "tmc_vem.energy"),
    "tmc_vem/vem": ("dolfinx", "ufl", "tmc_vem.fem", "tmc_vem.problems", "tmc_vem.report", "tmc_vem.cli"),
    "tmc_vem/fem": ("tmc_vem.problems", "tmc_vem.report", "tmc_vem.cli"),
    "tmc_vem/solve": ("dolfinx", "ufl", "codegen", "tmc_vem.vem", "tmc_vem.fem", "tmc_vem.mesh", "tmc_vem.problems"),
    "tmc_vem/problems": ("petsc4py", "mpi4py", "dolfinx", "ufl", "tmc_vem.vem", "tmc_vem.fem", "tmc_vem.solve"),
    "tmc_vem/report": ("petsc4py", "mpi4py", "dolfinx", "ufl", "tmc_vem.vem", "tmc_vem.fem", "tmc_vem.solve"),
}


def imported(path: Path) -> Iterator[str]:
    """Names of all modules that a file imports, wherever in the file; those for type checkers only do not count."""
    tree = ast.parse(path.read_text())
    skipped = {
        id(inner)
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"
        for inner in ast.walk(node)
    }
    for node in ast.walk(tree):
        if id(node) in skipped:
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


@pytest.mark.parametrize("package", FORBIDDEN)
def test_imports_follow_the_flow(package: str) -> None:
    files = sorted((ROOT / package).rglob("*.py"))
    assert files
    wrong = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in files
        for name in imported(path)
        if any(name == banned or name.startswith(banned + ".") for banned in FORBIDDEN[package])
    ]
    assert not wrong, "\n".join(wrong)


def test_only_compat_knows_versions_of_dolfinx() -> None:
    for path in (ROOT / "tmc_vem").rglob("*.py"):
        if path.name != "compat.py":
            assert "dolfinx.__version__" not in path.read_text(), path


def test_importing_the_package_loads_nothing_heavy() -> None:
    code = "import sys, tmc_vem, tmc_vem.energy, tmc_vem.cli.main, tmc_vem.cli.run; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    heavy = {"numpy", "sympy", "petsc4py", "mpi4py", "matplotlib", "meshio", "scipy", "dolfinx", "ufl", "rich"}
    assert not heavy & set(loaded)
