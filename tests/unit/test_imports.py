"""Importing the package is cheap, and names of earlier versions are found."""

from __future__ import annotations

import importlib
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tmc_vem.moved import MOVED
from tmc_vem.support.errors import InputError
from tmc_vem.support.petsc_start import start

ROOT = Path(__file__).parents[2]


def test_only_compat_knows_versions_of_dolfinx() -> None:
    for path in (ROOT / "tmc_vem").rglob("*.py"):
        if path.name != "compat.py":
            assert "dolfinx.__version__" not in path.read_text(), path


def test_only_one_module_imports_petsc4py() -> None:
    """MPI has to be loaded before, and there is one place that sees to it."""
    for package in ("tmc_vem", "codegen", "demos", "tests"):
        for path in (ROOT / package).rglob("*.py"):
            if path.name != "petsc_start.py" and path != Path(__file__):
                assert not re.search(r"(import|from) petsc4py", path.read_text()), path


def test_missing_petsc_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "petsc4py", None)
    with pytest.raises(
        InputError, match=r"petsc4py is not available .*pip install .*\[wheels\].*apt-get install"
    ) as caught:
        start()
    assert "\n" not in str(caught.value)


def test_complex_petsc_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(start(), "ScalarType", np.complex128)
    with pytest.raises(InputError, match="built for complex numbers"):
        start()


def test_mpi_comes_first() -> None:
    code = "import sys, tmc_vem.support.petsc; names = list(sys.modules); "
    code += "sys.exit(names.index('mpi4py.MPI') > names.index('petsc4py'))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_names_and_modules_of_the_results_are_found_in_any_order() -> None:
    """In a process that has imported nothing else: the package must not ask itself for them for ever."""
    code = "from tmc_vem.results import export, RunResult, StepRecord, unfinished; import tmc_vem.results as results; "
    code += "print(export.__name__, RunResult.__name__, StepRecord.__name__, unfinished.__name__, results.HISTORY)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    wanted = "tmc_vem.results.export RunResult StepRecord tmc_vem.results.unfinished history.csv\n"
    assert (done.stdout, done.stderr) == (wanted, "")
    missing = subprocess.run(
        [sys.executable, "-c", "import tmc_vem.results as r; r.nothing"], capture_output=True, text=True
    )
    assert missing.stderr.endswith("AttributeError: module 'tmc_vem.results' has no attribute 'nothing'\n")


def test_importing_the_package_loads_nothing_heavy() -> None:
    code = "import sys, tmc_vem, tmc_vem.energy, tmc_vem.cli.main, tmc_vem.cli.run; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    heavy = {"numpy", "sympy", "petsc4py", "mpi4py", "matplotlib", "meshio", "scipy", "dolfinx", "ufl", "rich"}
    assert not heavy & set(loaded)


@pytest.mark.parametrize("old", MOVED)
def test_moved_modules_are_found_by_their_old_names(old: str) -> None:
    sys.modules.pop(f"tmc_vem.{old}", None)
    with pytest.warns(DeprecationWarning, match=f"tmc_vem.{MOVED[old]}"):
        stand_in = importlib.import_module(f"tmc_vem.{old}")
    there = importlib.import_module(f"tmc_vem.{MOVED[old]}")
    names = [name for name, value in vars(there).items() if getattr(value, "__module__", "") == there.__name__]
    assert names
    for name in names:
        assert getattr(stand_in, name) is getattr(there, name)


def test_names_of_old_modules_that_are_packages_now() -> None:
    from tmc_vem.results import COLUMNS, RunResult, StepRecord
    from tmc_vem.results.records import COLUMNS as columns

    assert COLUMNS is columns
    assert RunResult.__name__ == "RunResult"
    assert StepRecord.__name__ == "StepRecord"
    with pytest.raises(ImportError, match="no_name"):
        importlib.import_module("tmc_vem.mesh.no_name")
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        importlib.import_module("tmc_vem.results").nothing  # noqa: B018


@pytest.mark.parametrize("name", ["units", "fields", "compare"])
def test_modules_of_others_are_not_taken_for_moved_ones(name: str) -> None:
    """Who asks for a package of that name, which may be missing, has to hear that it is."""
    assert name in MOVED
    code = f"import tmc_vem, importlib.util, sys; sys.exit(importlib.util.find_spec('{name}') is not None)"
    assert subprocess.run([sys.executable, "-P", "-c", code], check=False).returncode == 0
