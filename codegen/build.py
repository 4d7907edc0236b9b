"""Compile generated C and keep the result in a content-addressed cache.

The key covers what the energy computes (its trace), the generator itself, the compiler, its flags and the processor.
Any number of processes or MPI ranks may start at once: a lock file lets one of them generate and compile while the
others wait, and a finished library is moved into place atomically, so a killed compilation leaves nothing behind that
could be loaded.
"""

from __future__ import annotations

import contextlib
import fcntl
import functools
import hashlib
import logging
import os
import platform
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from importlib.resources import files
from pathlib import Path

from codegen.errors import CodegenError

logger = logging.getLogger(__name__)

WARNING_FLAGS = ("-Wall", "-Wextra", "-Werror")
# Everything but -ffast-math, which would hide NaN: no errno, no traps, so that loops over points vectorise.
FLAGS = ("-std=gnu99", "-O3", "-march=native", "-fno-math-errno", "-fno-trapping-math", "-fPIC", "-shared")
CACHE_VARIABLE = "TMC_VEM_CACHE"


def cache_directory() -> Path:
    """Where compiled kernels are kept: ``$TMC_VEM_CACHE``, else ``tmc-vem`` in the user's cache directory.

    A directory that cannot be written to is replaced by one in the temporary directory, with a warning.
    """
    named = os.environ.get(CACHE_VARIABLE)
    base = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    wanted = Path(named) if named else Path(base) / "tmc-vem"
    try:
        wanted.mkdir(parents=True, exist_ok=True)
        if os.access(wanted, os.W_OK | os.X_OK):
            return wanted
        reason = "it is not writable"
    except OSError as error:
        reason = error.strerror or str(error)
    fallback = Path(tempfile.gettempdir()) / f"tmc-vem-{os.getuid()}"
    logger.warning("kernel cache %s cannot be used (%s); using %s. Set %s.", wanted, reason, fallback, CACHE_VARIABLE)
    fallback.mkdir(mode=0o700, parents=True, exist_ok=True)
    if fallback.stat().st_uid != os.getuid():  # code is loaded from there: it must be ours
        raise CodegenError(f"the fallback cache {fallback} belongs to somebody else; set {CACHE_VARIABLE}")
    return fallback


@functools.cache
def compiler() -> str:
    """The C compiler: ``$CC`` or gcc or cc.

    Raises:
        CodegenError: there is none.
    """
    wanted = os.environ.get("CC")
    for name in (wanted,) if wanted else ("gcc", "cc"):
        path = shutil.which(name)
        if path:
            return path
    tried = wanted or "gcc and cc"
    raise CodegenError(f"no C compiler found (tried {tried}): install gcc ('apt-get install gcc libc6-dev') or set CC")


@functools.cache
def _toolchain_key() -> str:
    """What besides the energy decides the machine code: compiler, flags, processor, the generator's own files."""
    digest = hashlib.sha256()
    path = Path(compiler()).resolve()
    stat = path.stat()
    digest.update(repr((str(path), stat.st_size, stat.st_mtime_ns, FLAGS, platform.machine())).encode())
    with contextlib.suppress(OSError):
        cpu = [
            line for line in Path("/proc/cpuinfo").read_text().splitlines() if line.startswith(("flags", "model name"))
        ]
        digest.update("".join(sorted(set(cpu))).encode())
    for resource in sorted(files("codegen").iterdir(), key=lambda entry: entry.name):
        if resource.name.endswith((".py", ".c", ".h")):
            digest.update(resource.name.encode())
            digest.update(resource.read_bytes())
    return digest.hexdigest()


def library_path(name: str, fingerprint: str) -> Path:
    """Where the compiled kernel of an energy with this fingerprint is, or will be."""
    key = hashlib.sha256((fingerprint + _toolchain_key()).encode()).hexdigest()[:24]
    safe = "".join(ch if ch.isalnum() or ch in "_-" else "_" for ch in name)
    return cache_directory() / f"{safe}-{key}.so"


def compile_library(c_source: str, output: Path) -> None:
    """Compile C source into a shared object, which appears under its name only when it is complete.

    Raises:
        CodegenError: the compiler failed; the message has its first lines.
    """
    with tempfile.TemporaryDirectory(dir=output.parent, prefix=".build-") as scratch:
        source = Path(scratch) / (output.stem + ".c")
        source.write_text(c_source)
        target = Path(scratch) / output.name
        with_vector_functions = ["-DTMC_USE_LIBMVEC", "-o", str(target), str(source), "-lmvec", "-lm"]
        plain = ["-o", str(target), str(source), "-lm"]
        result = None
        for arguments in (with_vector_functions, plain):  # libmvec exists on some systems only
            result = subprocess.run(
                [compiler(), *FLAGS, *WARNING_FLAGS, *arguments], capture_output=True, text=True, check=False
            )
            if result.returncode == 0:
                os.replace(source, output.with_suffix(".c"))
                os.replace(target, output)
                return
        assert result is not None
        raise CodegenError(f"compiling {output.stem} with {compiler()} failed:\n{result.stderr[:2000]}")


def build(name: str, fingerprint: str, generate_source: Callable[[], str]) -> Path:
    """Path of the compiled kernel, generating and compiling it if the cache does not have it."""
    library = library_path(name, fingerprint)
    if library.exists():
        return library
    with _locked(library.with_suffix(".lock")):
        if not library.exists():  # another process may have finished it while this one waited
            logger.info("compiling kernel %s", library.name)
            compile_library(generate_source(), library)
    return library


@contextlib.contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Hold an advisory lock that the system releases even if the process is killed."""
    with path.open("w") as handle:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
