"""The wheel and the sdist have every file that is needed, and nothing else."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("tmc_vem", "codegen")
BUILD = "import sys; from setuptools import build_meta as b; to = sys.argv[1]; b.build_wheel(to); b.build_sdist(to)"


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with a wheel and an sdist, made of a copy of the sources."""
    pytest.importorskip("setuptools")
    place = tmp_path_factory.mktemp("dist")
    for name in (*PACKAGES, "tests", "demos", "docs", "scripts", "benchmarks", "findings"):
        shutil.copytree(ROOT / name, place / "copy" / name, ignore=shutil.ignore_patterns("__pycache__", ".hypothesis"))
    for path in ROOT.iterdir():
        if path.is_file() and path.name != ".git":
            shutil.copy(path, place / "copy" / path.name)
    done = subprocess.run(
        [sys.executable, "-c", BUILD, str(place)], cwd=place / "copy", capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return place


def of_packages() -> set[str]:
    files = (path for package in PACKAGES for path in (ROOT / package).rglob("*") if path.is_file())
    return {path.relative_to(ROOT).as_posix() for path in files if "__pycache__" not in path.parts}


def test_the_wheel_has_all_files_of_the_packages(built: Path) -> None:
    (wheel,) = built.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
        entry_points = next(name for name in archive.namelist() if name.endswith("entry_points.txt"))
        assert "tmc-vem = tmc_vem.cli.main:main" in archive.read(entry_points).decode()
    assert names == of_packages()
    # else there would be nothing to compare
    for suffix in (".c", ".h", ".cuh", ".hpp", ".csv", ".j2", ".petsc", "py.typed"):
        assert any(name.endswith(suffix) for name in names), suffix


def test_the_sdist_can_be_tested(built: Path) -> None:
    (sdist,) = built.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert of_packages() <= names
    for wanted in ("README.md", "LICENSE", "CITATION.cff", "Makefile", "scripts/setup.sh", "tests/unit/test_dist.py"):
        assert wanted in names, wanted
    assert not [name for name in names if "__pycache__" in name]
