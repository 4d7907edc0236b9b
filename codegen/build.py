"""Compile generated C and keep the result in a content-addressed cache.

The key covers what the energy computes (its trace), the driver, the generator itself, sympy, the compiler, its flags
and the processor. Any number of processes or MPI ranks may start at once: a lock file lets one of them generate and
compile while the others wait, and a finished library is moved into place atomically, so a killed compilation leaves
nothing behind that could be loaded.
"""

from __future__ import annotations

import contextlib
import fcntl
import functools
import hashlib
import importlib.util
import logging
import os
import re
import shlex
import shutil
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from codegen.errors import CodegenError

logger = logging.getLogger(__name__)

# Everything but -ffast-math, which would hide NaN: no errno, no traps, so that loops over points vectorise.
FLAGS = ("-std=gnu99", "-O3", "-march=native", "-fno-math-errno", "-fno-trapping-math", "-fPIC", "-shared")
# Files that no generated C depends on; all others, new ones included, are part of the key.
_BESIDE_THE_PIPELINE = {
    "__main__.py", "backends/cuda.py", "backends/host.py", "cli.py", "declare.py", "finding.py", "mixed.py",
    "oracle.py", "record.py", "reference.py", "sampling.py", "show.py", "stress_rates.py", "tensors.py", "userfile.py",
    "verify.py", "verify_parameters.py",
}  # fmt: skip
CACHE_VARIABLE = "TMC_VEM_CACHE"


def cache_directory() -> Path:
    """Where compiled kernels are kept: ``$TMC_VEM_CACHE``, else ``tmc-vem`` in the user's cache directory.

    A directory that cannot be written to is replaced by one in the temporary directory, with a warning.

    Raises:
        CodegenError: the replacement belongs to another user or cannot be made either.
    """
    named = os.environ.get(CACHE_VARIABLE)
    base = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return _usable_directory(Path(named) if named else Path(base) / "tmc-vem")


@functools.cache
def _usable_directory(wanted: Path) -> Path:
    try:
        wanted.mkdir(parents=True, exist_ok=True)
        if os.access(wanted, os.W_OK | os.X_OK):
            return wanted
        reason = "it is not writable"
    except OSError as error:
        reason = error.strerror or str(error)
    import tempfile

    fallback = Path(tempfile.gettempdir()) / f"tmc-vem-{os.getuid()}"
    logger.warning("kernel cache %s cannot be used (%s); using %s. Set %s.", wanted, reason, fallback, CACHE_VARIABLE)
    try:
        fallback.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise CodegenError(f"nor can {fallback} be used as kernel cache ({error}); set {CACHE_VARIABLE}") from error
    if fallback.stat().st_uid != os.getuid():  # code is loaded from there: it must be ours
        raise CodegenError(f"the fallback cache {fallback} belongs to somebody else; set {CACHE_VARIABLE}")
    return fallback


def compiler() -> tuple[str, ...]:
    """Command of the C compiler: ``$CC``, else gcc, cc, clang, or the one in the Python package ziglang.

    Raises:
        CodegenError: there is none.
    """
    return _find_compiler(os.environ.get("CC"), os.environ.get("PATH"))


@functools.cache
def _find_compiler(wanted: str | None, search_path: str | None) -> tuple[str, ...]:
    try:
        named = [shlex.split(wanted)] if wanted else [["gcc"], ["cc"], ["clang"]]
    except ValueError as error:
        raise CodegenError(f"CC={wanted} is no command ({error}); set CC to gcc or clang, with its arguments") from None
    for command in named:
        executable = shutil.which(command[0], path=search_path) if command else None
        if executable:
            return (executable, *command[1:])
    zig = None if wanted else _zig()
    if zig:
        return (zig, "cc")
    tried = f"CC={wanted}" if wanted else "gcc, cc, clang and the package ziglang"
    raise CodegenError(
        f"no C compiler found (tried {tried}): install gcc ('apt-get install gcc libc6-dev'), or without root "
        "'pip install ziglang', or set CC"
    )


def _zig() -> str | None:
    """The compiler that ``pip install ziglang`` brings, for machines without one and without root."""
    package = importlib.util.find_spec("ziglang")
    folder = next(iter(package.submodule_search_locations or ()), None) if package else None
    return shutil.which("zig", path=folder) if folder else None


@functools.cache
def _toolchain_key(command: tuple[str, ...]) -> str:
    """What besides the energy decides the machine code: compiler, flags, processor, sympy, the generator's files."""
    digest = hashlib.sha256()
    digest.update(repr((_programs(command), command[1:], FLAGS, os.uname().machine)).encode())
    with contextlib.suppress(OSError), open("/proc/cpuinfo") as cpuinfo:
        for line in cpuinfo:
            if line.startswith(("flags", "Features", "model name")):
                digest.update(line.encode())
            if line.startswith(("flags", "Features")):
                break  # the other cores repeat it
    sympy = importlib.util.find_spec("sympy")  # its version, without the third of a second that importing it takes
    sources = [Path(sympy.origin).with_name("release.py")] if sympy and sympy.origin else []
    package = Path(__file__).parent
    pipeline = (entry for entry in package.rglob("*") if entry.suffix in (".py", ".c", ".h"))
    sources += sorted(entry for entry in pipeline if entry.relative_to(package).as_posix() not in _BESIDE_THE_PIPELINE)
    for source in sources:
        with contextlib.suppress(OSError):
            digest.update(source.name.encode() + source.read_bytes())
    return digest.hexdigest()


def _programs(command: Sequence[str]) -> list[tuple[str, str, int, int]]:
    """Name, file, size and time of the programs in a command: of ``ccache gcc`` both, as only gcc may have changed."""
    found = [path for word in command if not word.startswith("-") and (path := shutil.which(word))]
    return [(path, os.path.realpath(path), os.stat(path).st_size, os.stat(path).st_mtime_ns) for path in found]


def library_path(name: str, fingerprint: str) -> Path:
    """Where the compiled kernel of an energy with this fingerprint is, or will be."""
    key = hashlib.sha256((fingerprint + _toolchain_key(compiler())).encode()).hexdigest()[:24]
    safe = "".join(ch if ch.isalnum() or ch in "_-" else "_" for ch in name)
    return cache_directory() / f"{safe}-{key}.so"


def compile_commands(source: Path, output: Path) -> list[list[str]]:
    """Commands that compile a kernel, to be tried in this order: libmvec exists on some systems only."""
    command, files = [*compiler(), *FLAGS], ["-o", str(output), str(source)]
    return [[*command, "-DTMC_USE_LIBMVEC", *files, "-lmvec", "-lm"], [*command, *files, "-lm"]]


def compile_library(c_source: str, output: Path) -> None:
    """Compile C source into a shared object, which appears under its name only when it is complete.

    Warnings do not stop it: what a compiler of tomorrow warns about is for the tests to find.

    Raises:
        CodegenError: the compiler failed (the message has its first error) or the directory cannot be written to.
    """
    import subprocess
    import tempfile

    said = ""
    try:
        with tempfile.TemporaryDirectory(dir=output.parent, prefix=".build-") as scratch:
            source = Path(scratch) / (output.stem + ".c")
            source.write_text(c_source)
            target = Path(scratch) / output.name
            for command in compile_commands(source, target):
                result = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
                said = result.stderr or result.stdout
                if result.returncode == 0 and target.is_file():
                    logger.debug("%s", said)
                    os.replace(source, output.with_suffix(".c"))
                    os.replace(target, output)
                    return
    except OSError as error:
        raise CodegenError(f"compiling {output.stem} failed: {error}") from error
    logger.info("%s", said)
    raise CodegenError(f"compiling {output.stem} with {shlex.join(compiler())} failed: {_first_error(said, c_source)}")


def _first_error(said: str, c_source: str) -> str:
    """What went wrong in one line: the words of an assertion if it is one, else the compiler's own."""
    lines = said.splitlines()
    first = next((line for line in lines if "error:" in line), next(iter(lines), "it made no library and said nothing"))
    place = re.search(r"\.c:(\d+)", first)
    numbered = c_source.splitlines()[int(place[1]) - 1 : int(place[1])] if place else []
    asserted = re.search(r'_Static_assert\(.*"(.*)"\)', "".join(numbered))  # not every compiler repeats its words
    return asserted[1] if asserted else first.strip()


def build(name: str, fingerprint: str, generate_source: Callable[[], str]) -> Path:
    """Path of the compiled kernel, generating and compiling it if the cache does not have it.

    Raises:
        CodegenError: there is no compiler, it failed, or no cache directory can be written to.
    """
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
    try:
        handle = path.open("w")
    except OSError as error:
        raise CodegenError(f"cannot write to the kernel cache: {error}; set {CACHE_VARIABLE}") from error
    with handle:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
