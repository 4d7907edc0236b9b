"""Compiling forms where Python's headers are missing, as on a machine without root: as plain C libraries.

dolfinx makes an extension module of every form, which needs Python.h and the compiler that Python was built with. The
code that FFCx writes needs neither. Here it becomes a shared library, compiled by the compiler of our own
kernels, and a module beside it that opens it with the same declarations. Both are kept in dolfinx' cache.
"""

from __future__ import annotations

import importlib.util
import os
import shlex
import shutil
import subprocess
import sysconfig
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

from codegen.build import compiler
from tmc_vem.support.errors import InputError
from tmc_vem.support.optional import has_python_headers

MODULE = """\
import os
import cffi
ffi = cffi.FFI()
ffi.cdef({declarations!r})
lib = ffi.dlopen(os.path.join(os.path.dirname(__file__), {library!r}))
"""


def needed() -> bool:
    """Whether extension modules cannot be compiled here."""
    command = shlex.split(os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc")
    return not (has_python_headers() and command and shutil.which(command[0]))


@contextmanager
def plain_libraries(jit: Any) -> Iterator[None]:
    """Let FFCx make plain libraries for as long as this lasts.

    Args:
        jit: FFCx' module that compiles.
    """
    original = jit.cffi, jit._load_objects
    jit.cffi = SimpleNamespace(FFI=_Builder)
    jit._load_objects = lambda folder, name, names: objects(Path(folder), name, names)
    try:
        yield
    finally:
        jit.cffi, jit._load_objects = original


def is_plain(folder: Path, name: str) -> bool:
    """Whether a form was compiled here."""
    return (folder / f"{name}.py").exists()


def objects(folder: Path, name: str, names: Sequence[str]) -> tuple[list[Any], ModuleType]:
    """Objects of a compiled form, and the module that keeps their library open."""
    spec = importlib.util.spec_from_file_location(name, folder / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return [getattr(module.lib, wanted) for wanted in names], module


class _Builder:
    """What FFCx asks of ``cffi.FFI``."""

    def set_source(
        self, name: str, code: str, include_dirs: Sequence[str] = (), extra_compile_args: Sequence[str] = (), **_: Any
    ) -> None:
        """The code of a module."""
        self._name, self._code = name, code
        includes = [f"-I{folder}" for folder in include_dirs]
        self._flags = ["-fPIC", "-shared", "-fwrapv", *(extra_compile_args or ()), *includes]

    def cdef(self, declarations: str) -> None:
        """What it declares."""
        self._declarations = declarations

    def compile(self, tmpdir: str | Path, verbose: bool = False, debug: bool | None = None) -> None:
        """Compile it; the names of the results appear when they are complete.

        Raises:
            InputError: the compiler failed; its first error.
        """
        folder = Path(tmpdir)
        source, library = folder / f"{self._name}.c", folder / f"{self._name}.plain.so"
        source.write_text(self._code)
        command = [*compiler(), *self._flags, "-o", str(library), str(source), "-lm"]
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
        if done.returncode:
            said = (done.stderr or done.stdout).splitlines()
            first = next((line for line in said if "error:" in line), next(iter(said), "it said nothing")).strip()
            raise InputError(f"compiling a form with {shlex.join(compiler())} failed: {first}")
        module = folder / f"{self._name}.py"
        unfinished = module.with_suffix(f".{os.getpid()}")
        unfinished.write_text(MODULE.format(declarations=self._declarations, library=library.name))
        unfinished.replace(module)
