"""The kernel cache: shared by processes, proof against killed compilations, clear about what it cannot do."""

from __future__ import annotations

import ast
import ctypes
import importlib.util
import logging
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from codegen import build
from codegen.driver import Driver
from codegen.errors import CodegenError
from codegen.integrand import second_gradient_energy
from codegen.kernel import ENERGY, compile_energy, compiled

ONE_ENERGY = """
import logging, sys
from codegen.kernel import compile_energy
logging.basicConfig(level=logging.INFO, stream=sys.stdout)
kernel = compile_energy(lambda F, G, p, m: F[0][0] * F[0][0] + {n}, "square", ())
print("value", kernel.points(0, [[0.0] * 12], kernel.parameter_array({{}}))[0][0])
print("sympy" in sys.modules, "cffi" in sys.modules)
"""


@pytest.fixture
def cache(tmp_path, monkeypatch) -> Path:
    monkeypatch.setenv(build.CACHE_VARIABLE, str(tmp_path / "cache"))
    return tmp_path / "cache"


def square(F, G, p, m):
    return F[0][0] * F[0][0]


def start(n: int = 1, **environment: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", ONE_ENERGY.format(n=n)],
        env={**os.environ, **environment}, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def libraries(directory: Path) -> list[Path]:
    return sorted(directory.glob("*.so"))


def slow_compiler(directory: Path, seconds: float) -> Path:
    """A compiler that counts its calls and takes its time before it writes anything useful."""
    path = directory / "slow-gcc"
    path.write_text(
        "#!/bin/sh\n"
        f"echo call >> {directory}/calls\n"
        'for last in "$@"; do [ "$previous" = -o ] && echo half > "$last"; previous="$last"; done\n'
        f'sleep {seconds}\nexec gcc "$@"\n'
    )
    path.chmod(0o755)
    return path


def test_nothing_is_generated_or_compiled_when_nothing_changed(cache, monkeypatch):
    first = compile_energy(square, "square", ())
    stamp = first.library.stat().st_mtime_ns
    for name in ("codegen.kernel.generate", "codegen.build.compile_library"):
        monkeypatch.setattr(name, lambda *_: pytest.fail("this was in the cache"))
    again = compile_energy(square, "square", ())
    assert again.library == first.library
    assert again.library.stat().st_mtime_ns == stamp
    assert libraries(cache) == [first.library]


@pytest.mark.parametrize("change", ["energy", "name", "parameters", "flags", "compiler arguments"])
def test_whatever_changes_the_kernel_changes_the_key(cache, monkeypatch, change):
    first = compile_energy(square, "square", ())
    arguments = [square, "square", ()]
    if change == "energy":
        arguments[0] = lambda F, G, p, m: F[0][0] * F[0][0] + 1
    elif change == "name":
        arguments[1] = "other"
    elif change == "parameters":
        arguments[2] = ("mu",)
    elif change == "flags":
        monkeypatch.setattr(build, "FLAGS", (*build.FLAGS, "-DNOTHING"))
        build._toolchain_key.cache_clear()
    else:
        monkeypatch.setenv("CC", "gcc -DNOTHING")
    second = compile_energy(*arguments)
    build._toolchain_key.cache_clear()
    assert second.library != first.library
    assert len(libraries(cache)) == 2


def imports_of(path: Path) -> set[Path]:
    """Files of the generator that a file of it imports, wherever in the file."""
    nodes = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.ImportFrom)]
    names = {node.module for node in nodes} | {f"{node.module}.{alias.name}" for node in nodes for alias in node.names}
    above = Path(build.__file__).parents[1]
    places = [above.joinpath(*name.split(".")) for name in names if name.startswith("codegen.")]
    files = {file for place in places for file in (place.with_suffix(".py"), place / "__init__.py")}
    return {file for file in files if file.exists()}


def test_what_makes_the_text_is_in_the_key(monkeypatch):
    package = Path(build.__file__).parent
    beside = {package / name for name in build._BESIDE_THE_PIPELINE}
    assert all(path.is_file() for path in beside)
    found = {package / name for name in ("kernel.py", "compiler.py", "backends/c.py")}
    while (more := found | {other for path in found for other in imports_of(path)}) != found:
        found = more
    assert {"trace.py", "derive.py", "functions.py", "cprinter.py", "backend.py"} <= {path.name for path in found}
    read = set()
    original = Path.read_bytes
    monkeypatch.setattr(Path, "read_bytes", lambda path: read.add(path) or original(path))
    build._toolchain_key.cache_clear()
    build._toolchain_key(build.compiler())
    assert found <= read
    assert not read & beside


def test_a_change_of_a_driver_changes_the_key(cache, tmp_path):
    integrand = second_gradient_energy(square, "square")
    keys = []
    for number in (1, 2):
        directory = tmp_path / str(number)
        directory.mkdir()
        (directory / "mine.h").write_text("int mine(void);\n")
        (directory / "mine.c").write_text(f"int mine(void) {{ return {number}; }}\n")
        keys.append(compiled(integrand, Driver(directory / "mine.h", (directory / "mine.c",))))
    assert len({compiled(integrand), *keys}) == 3
    assert [ctypes.CDLL(str(key)).mine() for key in keys] == [1, 2]
    assert "int mine(void);" in keys[0].with_suffix(".c").read_text()


def test_processes_that_start_together_compile_once_and_all_load(cache, tmp_path):
    compiler = str(slow_compiler(tmp_path, 0.5))
    runs = [start(CC=compiler) for _ in range(3)]
    outputs = [run.communicate(timeout=60) for run in runs]
    assert [run.returncode for run in runs] == [0, 0, 0], outputs
    assert all("value 2.0" in out for out, _ in outputs)
    assert (tmp_path / "calls").read_text().split() == ["call"]
    assert sum("compiling kernel" in out for out, _ in outputs) == 1
    assert len(libraries(cache)) == 1


def test_a_killed_compilation_leaves_nothing_that_could_be_loaded(cache, tmp_path):
    run = start(CC=str(slow_compiler(tmp_path, 30)))
    while not (tmp_path / "calls").exists() and run.poll() is None:
        time.sleep(0.02)
    time.sleep(0.2)  # the half-written file exists now
    run.send_signal(signal.SIGKILL)
    run.communicate()
    assert list(cache.rglob("*.so"))  # in a scratch directory
    assert not libraries(cache)
    output, errors = start().communicate(timeout=60)  # the lock died with the process
    assert "value 2.0" in output, errors
    assert len(libraries(cache)) == 1


def test_a_damaged_kernel_is_named(cache):
    library = compile_energy(square, "square", ()).library
    library.unlink()  # the file itself is mapped into this process and must stay whole
    library.write_bytes(b"half")
    # A fresh process: a shared object that is loaded already is not read again.
    code = (
        "import test_codegen_cache as t; from codegen.kernel import Kernel;"
        "Kernel(t.Path({!r}), t.second_gradient_energy(t.square, 'square'))"
    )
    run = subprocess.run(
        [sys.executable, "-c", code.format(str(library))],
        capture_output=True, text=True, check=False, cwd=Path(__file__).parent,
    )  # fmt: skip
    assert f"CodegenError: kernel {library} cannot be loaded" in run.stderr
    assert "delete it and try again" in run.stderr


@pytest.mark.parametrize("kind", ["below a file", "not writable"])
def test_a_cache_that_cannot_be_written_is_replaced_with_a_warning(tmp_path, monkeypatch, caplog, kind):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "tmp"))
    (tmp_path / "tmp").mkdir()
    if kind == "below a file":
        (tmp_path / "file").write_text("")
        wanted = tmp_path / "file" / "cache"
    else:
        wanted = tmp_path / "cache"
        monkeypatch.setattr(os, "access", lambda path, mode: str(path) != str(wanted))  # root may write anywhere
    monkeypatch.setenv(build.CACHE_VARIABLE, str(wanted))
    build._usable_directory.cache_clear()
    with caplog.at_level(logging.WARNING, logger="codegen.build"):
        kernel = compile_energy(square, "square", ())
    build._usable_directory.cache_clear()
    fallback = tmp_path / "tmp" / f"tmc-vem-{os.getuid()}"
    assert kernel.library.parent == fallback
    assert fallback.stat().st_mode & 0o777 == 0o700
    reason = "Not a directory" if kind == "below a file" else "it is not writable"
    assert caplog.messages == [
        f"kernel cache {wanted} cannot be used ({reason}); using {fallback}. Set {build.CACHE_VARIABLE}."
    ]
    assert kernel.points(ENERGY, np.zeros((1, 12)), np.zeros(0))[0][0] == 1.0


def test_a_fallback_of_somebody_else_is_not_trusted(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    (tmp_path / "file").write_text("")
    monkeypatch.setenv(build.CACHE_VARIABLE, str(tmp_path / "file" / "cache"))
    uid = os.getuid()
    (tmp_path / f"tmc-vem-{uid + 1}").mkdir()
    monkeypatch.setattr(os, "getuid", lambda: uid + 1)
    with pytest.raises(CodegenError, match=f"the fallback cache .*/tmc-vem-{uid + 1} belongs to somebody else; set"):
        build.cache_directory()


def test_a_missing_compiler_is_named(cache, monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(CodegenError, match=r"no C compiler found \(tried CC=no-such-compiler\): install gcc"):
        compile_energy(square, "square", ())
    monkeypatch.delenv("CC")
    monkeypatch.setenv("PATH", str(cache))
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    build._find_compiler.cache_clear()
    wanted = r"tried gcc, cc, clang and the package ziglang\): install gcc \('apt-get install .*pip install ziglang"
    with pytest.raises(CodegenError, match=wanted) as caught:
        build.compiler()
    assert "\n" not in str(caught.value)


def test_without_a_compiler_that_of_the_package_ziglang_is_taken(cache, monkeypatch, tmp_path):
    zig = tmp_path / "ziglang" / "zig"
    zig.parent.mkdir()
    zig.write_text("#!/bin/sh\n")
    zig.chmod(0o755)
    (zig.parent / "__init__.py").touch()
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delenv("CC", raising=False)
    build._find_compiler.cache_clear()
    assert build.compiler()[0].endswith("gcc")
    monkeypatch.setenv("PATH", str(tmp_path))
    assert build.compiler() == (str(zig), "cc")
    key = build._toolchain_key(build.compiler())
    zig.write_text("#!/bin/sh\n# another version\n")
    build._toolchain_key.cache_clear()
    assert build._toolchain_key(build.compiler()) != key


def test_a_compiler_that_fails_is_quoted_and_leaves_nothing(cache, monkeypatch):
    monkeypatch.setenv("LC_ALL", "C")  # for plain quotes
    cache.mkdir()
    with pytest.raises(CodegenError, match=r"mine with .*gcc failed: .*error: 'nothing' undeclared") as caught:
        build.compile_library("int broken(void) { return nothing; }\n", cache / "mine.so")
    assert "\n" not in str(caught.value)
    assert list(cache.iterdir()) == []


# Time of the processor, the compiler's included: other programs may be using the machine.
LOADED = """
import numpy, subprocess, sys
from tmc_vem.vem.kernel.cells import compile_cells
from codegen.integrand import second_gradient_energy
from tmc_vem.energy import DENSITIES
started = []
run = subprocess.run
subprocess.run = lambda *words, **options: (started.append(words), run(*words, **options))[1]
energy = DENSITIES["medium_angle_damped"]
compile_cells(second_gradient_energy(energy.density, energy.name, energy.parameters))
print("sympy" in sys.modules, "cffi" in sys.modules, len(started))
"""


def test_a_kernel_of_the_cache_is_found_without_sympy_and_compiler(cache):
    """What makes it fast; how fast depends on what else the machine does."""
    run = [sys.executable, "-c", LOADED]
    first, later = (subprocess.run(run, capture_output=True, text=True, check=True).stdout.split() for _ in range(2))
    assert first[:2] == ["True", "False"]
    assert int(first[2]) > 0
    assert later == ["False", "False", "0"]
