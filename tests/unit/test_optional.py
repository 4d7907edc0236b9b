"""Packages that may be missing: what is said, and that ``tmc-vem info`` sees libraries that are."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from helpers_process import process

from tmc_vem.mesh.files.io import read_mesh
from tmc_vem.mesh.make.outline import Region
from tmc_vem.mesh.make.triangles import triangle_mesh
from tmc_vem.support import optional
from tmc_vem.support.errors import InputError

WITHOUT_GLU = "raise OSError('libGLU.so.1: cannot open shared object file: No such file or directory')\n"


@pytest.fixture
def gmsh_without_libraries(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "gmsh.py").write_text(WITHOUT_GLU)
    monkeypatch.delitem(sys.modules, "gmsh", raising=False)
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path


def test_a_library_that_is_missing_is_named_with_its_remedy(gmsh_without_libraries: Path) -> None:
    square = Region("domain", [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    with pytest.raises(InputError, match=r"gmsh \(libGLU.so.1: .*apt-get install libglu1-mesa") as caught:
        triangle_mesh([square], 0.3)
    assert "\n" not in str(caught.value)


def test_a_package_that_is_missing_is_named_with_its_remedy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gmsh", None)
    with pytest.raises(InputError, match=r"triangles need gmsh .*pip install gmsh or apt-get install python3-gmsh"):
        triangle_mesh([Region("domain", [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)])], 0.3)


def test_a_geometry_says_so_too(gmsh_without_libraries: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(gmsh_without_libraries))
    (gmsh_without_libraries / "a.geo").write_text("Point(1) = {0, 0, 0};\n")
    with pytest.raises(InputError, match=r"needs gmsh .*apt-get install libglu1-mesa"):
        read_mesh(gmsh_without_libraries / "a.geo")


def test_info_sees_it(gmsh_without_libraries: Path) -> None:
    done = process(
        ["-c", "from tmc_vem.cli.main import main; main()", "info"],
        environment={"PYTHONPATH": str(gmsh_without_libraries)},
    )
    assert done.returncode == 0, done.stderr
    (line,) = [line for line in done.stdout.splitlines() if line.startswith("gmsh ")]
    assert "does not load (libGLU.so.1" in line
    assert "apt-get install libglu1-mesa" in line
    for name in ("MPI", "PETSc's solvers", "C compiler", "Python.h", *optional.PACKAGES):
        assert any(row.startswith(f"{name} ") for row in done.stdout.splitlines()), name
    dolfinx = next(row for row in done.stdout.splitlines() if row.startswith("dolfinx "))
    assert "available: --method fem" in dolfinx


def test_what_is_not_installed_says_how_to(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(
        optional.PACKAGES, "no_such_package", optional.Package("nothing", "pip install no_such_package")
    )
    assert optional.state("no_such_package") == "not installed: nothing; pip install no_such_package"
