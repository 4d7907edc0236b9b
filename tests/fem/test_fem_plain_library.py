"""Forms compiled without Python's headers give the same numbers, and are found again."""

from __future__ import annotations

import sysconfig
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers_fem import grid, make_system, medium

from tmc_vem.fem import compat, plain_library
from tmc_vem.support import optional
from tmc_vem.support.errors import InputError


def assembled() -> tuple[np.ndarray, np.ndarray]:
    system = make_system(grid(2, 2), medium(), interior_penalty="penalty")
    u, residual = system.create_vector(), system.create_vector()
    u.getArray()[:] = 0.02 * np.sin(np.arange(u.getLocalSize()))
    system.residual(u, residual)
    matrix = system.create_matrix()
    system.jacobian(u, matrix)
    return residual.getArray().copy(), matrix.getValuesCSR()[2].copy()


def test_the_same_numbers_and_found_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    usual = assembled()
    monkeypatch.setitem(compat.JIT_OPTIONS, "cache_dir", str(tmp_path))
    monkeypatch.setattr(plain_library, "needed", lambda: True)
    for ours, theirs in zip(assembled(), usual, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-14 * abs(theirs).max())
    libraries = {path: path.stat().st_mtime_ns for path in tmp_path.glob("*.plain.so")}
    assert libraries
    assert not [path for path in tmp_path.glob("*.so") if not path.name.endswith(".plain.so")]

    # found again, also when there are headers meanwhile
    monkeypatch.setattr(plain_library, "needed", lambda: False)
    monkeypatch.setattr(plain_library._Builder, "compile", None)
    again = assembled()
    np.testing.assert_array_equal(again[0], assembled()[0])
    assert {path: path.stat().st_mtime_ns for path in tmp_path.glob("*.plain.so")} == libraries


def test_a_compiler_that_fails_is_quoted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(compat.JIT_OPTIONS, "cache_dir", str(tmp_path))
    monkeypatch.setattr(plain_library, "needed", lambda: True)
    monkeypatch.setattr(plain_library, "compiler", lambda: ("sh", "-c", "echo 'form.c:1: error: no such word'; exit 1"))
    with pytest.raises(InputError, match=r"compiling a form with sh .*failed: form.c:1: error: no such word") as caught:
        assembled()
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.glob("*.so"))


@pytest.mark.parametrize("lacking", ["headers", "compiler"])
def test_when_it_is_needed(lacking: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "Python.h").touch()
    (tmp_path / "mine").touch(mode=0o755)
    paths: dict[str, Any] = {"include": str(tmp_path)}
    monkeypatch.setattr(sysconfig, "get_paths", lambda: paths)
    monkeypatch.setenv("CC", str(tmp_path / "mine"))
    assert not plain_library.needed()
    assert optional.python_headers().startswith("available")
    if lacking == "headers":
        (tmp_path / "Python.h").unlink()
        assert "apt-get install python3-dev" in optional.python_headers()
    else:
        monkeypatch.setenv("CC", "no-such-compiler")
    assert plain_library.needed()
