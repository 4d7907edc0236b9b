"""A run that is killed while a form is compiled does not hold up those that come after it."""

from __future__ import annotations

import fcntl
import logging
import threading
import time
from pathlib import Path

import pytest

pytest.importorskip("dolfinx")

from mpi4py import MPI

from tmc_vem.fem import compat, jit_lock


def area(cache: Path, degree: int):
    """A compiled form of its own cache."""
    import ufl
    from dolfinx import mesh

    domain = mesh.create_unit_square(MPI.COMM_SELF, 2, 2)
    x = ufl.SpatialCoordinate(domain)
    return compat.form((1 + x[0] ** degree) * ufl.dx(domain))


@pytest.fixture
def cache(tmp_path, monkeypatch) -> Path:
    monkeypatch.setattr(compat, "JIT_OPTIONS", {**compat.JIT_OPTIONS, "cache_dir": str(tmp_path), "timeout": 20})
    return tmp_path


def killed_while_compiling(cache: Path) -> Path:
    """The cache as such a run leaves it: the form is marked, and will never be ready."""
    area(cache, 3)
    (source,) = cache.glob("libffcx_forms_*.c")
    for file in cache.iterdir():
        file.unlink()
    source.write_text("")
    return source


def test_what_a_dead_run_left_over_is_compiled_anew(cache):
    source = killed_while_compiling(cache)
    start = time.monotonic()
    form = area(cache, 3)
    assert time.monotonic() - start < 15
    assert compat.assemble_scalar(form) == pytest.approx(1.25)
    assert Path(f"{source}.cached").exists()


def test_a_living_run_is_waited_for_with_a_word(cache, monkeypatch, caplog):
    monkeypatch.setattr(jit_lock, "SILENT", 0.1)
    source = killed_while_compiling(cache)
    lock = source.with_suffix(".lock").open("w")
    fcntl.flock(lock, fcntl.LOCK_EX)
    threading.Timer(1.0, lock.close).start()
    with caplog.at_level(logging.WARNING, logger="tmc_vem.fem.jit_lock"):
        form = area(cache, 3)
    assert compat.assemble_scalar(form) == pytest.approx(1.25)
    assert caplog.messages == [f"waiting for another run that compiles the same form ({source.stem})"]
