"""The ground by itself: ranks, files, clocks, packages, types and units."""

from __future__ import annotations

import importlib
import pickle
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from helpers_ranks import Ranks

from tmc_vem import moved
from tmc_vem.support import memory, notes, optional, parallel, petsc_start, timing
from tmc_vem.support.environment import MOST_CELLS, VARIABLE, cells_allowed
from tmc_vem.support.errors import ConvergenceError, EvaluationError, InputError, Note, TmcError
from tmc_vem.support.files import remove_unfinished, whole_file, write_atomically
from tmc_vem.support.lazy import lazily
from tmc_vem.support.settings import about, about_of, described, field_of, same_as
from tmc_vem.support.units import Units
from tmc_vem.support.validation import (
    conform,
    printable,
    require_choice,
    require_finite,
    require_known,
    require_positive,
    require_within,
    shown,
)

# -- ranks -----------------------------------------------------------------------------------------------------------


def fail() -> int:
    raise InputError("on this rank")


def test_what_rank_0_does_is_known_to_all() -> None:
    root, other = Ranks(0), Ranks(1)
    assert parallel.on_root(root, lambda: 5) == 5
    assert root.sent == [None]
    assert parallel.on_root(other, fail) is None, "it is not called there"
    with pytest.raises(InputError, match="on this rank"):
        parallel.on_root(root, fail)
    assert str(root.sent[-1]) == "on this rank"
    with pytest.raises(InputError, match="elsewhere"):
        parallel.on_root(Ranks(1, InputError("elsewhere")), fail)
    assert parallel.from_root(root, lambda: 7) == 7
    assert parallel.from_root(Ranks(1), fail) is None


def test_an_error_of_any_rank_is_raised_on_all() -> None:
    for rank in (0, 1):
        assert parallel.on_every_rank(Ranks(rank), lambda: 5) == 5
        with pytest.raises(InputError, match="on this rank"):
            parallel.on_every_rank(Ranks(rank), fail)
        with pytest.raises(InputError, match="elsewhere"):
            parallel.on_every_rank(Ranks(rank, other=InputError("elsewhere")), lambda: 5)
    with pytest.raises(InputError, match="first"):
        parallel.on_every_rank(Ranks(1, other=InputError("first")), fail)


class Unsendable(Exception):
    def __init__(self, a: int, b: int) -> None:
        super().__init__(f"{a} and {b}")


def test_an_error_that_cannot_travel_says_what_it_said() -> None:
    error = parallel._portable(Unsendable(1, 2))
    assert (type(error), str(error)) == (RuntimeError, "Unsendable: 1 and 2")
    kept = InputError("a")
    assert parallel._portable(kept) is kept
    pickle.loads(pickle.dumps(error))


def test_ranks_leave_together_or_are_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    clock, codes = [0.0], list[int]()
    monkeypatch.setattr(parallel.time, "monotonic", lambda: clock[0])
    monkeypatch.setattr(parallel.time, "sleep", lambda seconds: clock.__setitem__(0, clock[0] + 1.0))
    for here, ended in ((5.0, 0), (20.5, 0), (22.5, 1)):
        clock[0] = 0.0
        codes.clear()
        comm: Any = SimpleNamespace(
            Ibarrier=lambda here=here: SimpleNamespace(Test=lambda: clock[0] >= here), Abort=codes.append
        )
        parallel.leave_together(comm, 3)
        assert codes[:1] == [3] * ended, here


# -- files, clocks, environment --------------------------------------------------------------------------------------


def test_files_appear_whole_and_the_old_one_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[int] = []
    monkeypatch.setattr("tmc_vem.support.files.os.fsync", synced.append)
    path, before = tmp_path / "a.txt", tmp_path / "before.txt"
    write_atomically(path, "one")
    assert (path.read_text(), len(synced), path.stat().st_mode & 0o777) == ("one", 1, 0o644)
    write_atomically(path, "two", durable=False)
    assert (path.read_text(), len(synced)) == ("two", 1)
    with whole_file(path, before) as temporary:
        assert (temporary.parent, temporary.suffix, temporary.name[:14]) == (tmp_path, ".txt", ".unfinished-a-")
        temporary.write_text("three")
        assert path.read_text() == "two"
    assert (path.read_text(), before.read_text()) == ("three", "two")
    with pytest.raises(KeyError), whole_file(path, before):
        raise KeyError
    assert (path.read_text(), before.read_text()) == ("three", "two")
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / ".unfinished-x").write_text("")
    remove_unfinished(tmp_path)
    assert sorted(entry.name for entry in tmp_path.rglob("*")) == ["a.txt", "b", "before.txt"]


def test_a_timer_counts_each_second_once(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = [100.0]
    monkeypatch.setattr(timing.time, "perf_counter", lambda: clock[0])
    timer = timing.Timer()
    clock[0] += 1.0
    with timer("outer"):
        clock[0] += 2.0
        with timer("inner"):
            clock[0] += 4.0
        clock[0] += 8.0
    timer.pause()
    clock[0] += 16.0
    timer.go_on()
    clock[0] += 32.0

    def broken() -> None:
        clock[0] += 64.0
        raise KeyError

    with pytest.raises(KeyError), timer("inner"):
        broken()
    assert timer.report() == {"outer": 10.0, "inner": 68.0, "other": 33.0, "total": 111.0}


@pytest.mark.parametrize(("text", "limit"), [("", MOST_CELLS), ("2e6", 2e6), ("0.5", 0.5)])
def test_cells_that_a_mesh_may_have(text: str, limit: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, text)
    assert (cells_allowed(), cells_allowed(5.0), MOST_CELLS) == (limit, 5.0, 1_000_000)
    for bad in ("0", "-1", "many", "nan"):
        monkeypatch.setenv(VARIABLE, bad)
        with pytest.raises(InputError) as caught:
            cells_allowed()
        assert str(caught.value) == (f"{VARIABLE} = '{bad}' in the environment must be a positive number, such as 2e6")


def test_codes_of_errors() -> None:
    assert [error("").exit_code for error in (TmcError, InputError, EvaluationError, ConvergenceError)] == [1, 2, 1, 3]


def test_notes_go_to_who_listens_last() -> None:
    one, two = list[str](), list[str]()
    with notes.heard_by(one.append):
        with notes.heard_by(two.append):
            notes.say("a")
        notes.say("b")
    assert (one, two) == (["b"], ["a"])
    with pytest.warns(Note, match="c") as caught:
        notes.say("c", stacklevel=1)
    assert caught[0].filename == notes.__file__ or caught[0].filename == __file__


def test_names_are_imported_when_they_are_used() -> None:
    get = lazily("tmc_vem.support", {"Units": "units"})
    assert get("Units") is Units
    with pytest.raises(AttributeError, match=r"^module 'tmc_vem\.support' has no attribute 'Other'$"):
        get("Other")


@pytest.mark.parametrize("old", moved.MOVED)
def test_modules_that_have_moved_are_where_the_table_says(old: str) -> None:
    assert importlib.util.find_spec(f"tmc_vem.{moved.MOVED[old]}") is not None  # type: ignore[attr-defined]
    assert moved.Finder.find_spec(f"tmc_vem.{old}") is not None
    assert moved.Finder.find_spec(old) is None
    assert moved.Finder.find_spec(f"tmc_vem.{moved.MOVED[old]}") is None


def test_memory_is_kept_by_the_right_parameters(monkeypatch: pytest.MonkeyPatch) -> None:
    """M_MMAP_THRESHOLD is -3 in malloc.h of glibc, M_TRIM_THRESHOLD -1."""
    calls: list[Any] = []
    library = SimpleNamespace(mallopt=lambda *given: calls.append(given), malloc_trim=lambda pad: calls.append(pad))
    monkeypatch.setattr(memory.ctypes, "CDLL", lambda _: library)
    memory.reuse_freed()
    memory.give_back()
    assert calls == [(-3, 32 * 2**20), (-1, -1), 0]
    for broken in (OSError, AttributeError):

        def refuse(_: Any, broken: type[Exception] = broken) -> Any:
            raise broken

        monkeypatch.setattr(memory.ctypes, "CDLL", refuse)
        memory.reuse_freed()
        memory.give_back()


# -- packages --------------------------------------------------------------------------------------------------------


def test_packages_and_the_commands_that_bring_them() -> None:
    assert {name: (entry.install, entry.libraries) for name, entry in optional.PACKAGES.items()} == {
        "dolfinx": (
            "pip install 'tmc-vem[wheels]' (Python 3.12 or newer) or apt-get install python3-dolfinx-real", ""
        ),
        "gmsh": ("pip install gmsh or apt-get install python3-gmsh",
                 "apt-get install libglu1-mesa libgl1 libxcursor1 libxft2 libxinerama1 libgomp1"),
        "nlopt": ("pip install 'tmc-vem[design]' (Python 3.12 or newer) or apt-get install python3-nlopt", ""),
        "pandas": ("pip install 'tmc-vem[analysis]'", ""), "pyvista": ("pip install 'tmc-vem[analysis]'", ""),
        "h5py": ("pip install 'tmc-vem[meshes]'", ""), "netCDF4": ("pip install 'tmc-vem[meshes]'", ""),
        "lz4": ("pip install 'tmc-vem[meshes]'", ""), "sphinx": ("pip install 'tmc-vem[docs]'", ""),
    }  # fmt: skip
    gmsh, pandas = optional.PACKAGES["gmsh"], optional.PACKAGES["pandas"]
    lost = ImportError("libGLU.so.1: cannot open shared object file")
    assert optional.remedy("gmsh", lost) == optional.remedy("gmsh", OSError("gone")) == gmsh.libraries
    assert optional.remedy("gmsh", ImportError("No module named gmsh")) == gmsh.install
    assert optional.remedy("pandas", lost) == pandas.install


def test_what_is_said_of_a_package(monkeypatch: pytest.MonkeyPatch) -> None:
    found: dict[str, Any] = {"gmsh": object(), "pandas": object()}

    def load(name: str) -> Any:
        raise ImportError("libGL.so.1: cannot open\n it")

    monkeypatch.setattr(optional.importlib.util, "find_spec", found.get)
    monkeypatch.setattr(optional.importlib, "import_module", load)
    gmsh = optional.PACKAGES["gmsh"]
    assert optional.state("pandas") == "available: RunResult.to_pandas"
    assert optional.state("lz4") == ("not installed: meshes in VTK files with LZ4; pip install 'tmc-vem[meshes]'")
    assert optional.state("gmsh") == (f"does not load (libGL.so.1: cannot open it): {gmsh.purpose}; {gmsh.libraries}")
    with pytest.raises(InputError) as caught:
        optional.load("gmsh", "this needs")
    assert str(caught.value) == f"this needs gmsh (libGL.so.1: cannot open it): {gmsh.libraries}"


def test_python_h(monkeypatch: pytest.MonkeyPatch) -> None:
    for there, start in ((True, "available: forms"), (False, "not installed: finite elements do without it")):
        monkeypatch.setattr(optional, "has_python_headers", lambda there=there: there)
        assert optional.python_headers().startswith(start)


def test_petsc_that_is_of_no_use_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []

    def of_kind(kind: str) -> Any:
        petsc = SimpleNamespace(ScalarType=lambda: SimpleNamespace(dtype=SimpleNamespace(kind=kind)))
        modules = {"petsc4py": SimpleNamespace(init=asked.append), "petsc4py.PETSc": petsc, "mpi4py.MPI": None}
        return lambda name: modules[name]

    monkeypatch.setattr(petsc_start.importlib, "import_module", of_kind("f"))
    petsc_start.start()
    petsc_start.start(("a", "-b"))
    assert asked == [["a", "-b"]]
    monkeypatch.setattr(petsc_start.importlib, "import_module", of_kind("c"))
    with pytest.raises(InputError, match="PETSc is built for complex numbers here; the real build is needed: pip inst"):
        petsc_start.start()

    def missing(name: str) -> Any:
        raise RuntimeError("no\n MPI")

    monkeypatch.setattr(petsc_start.importlib, "import_module", missing)
    with pytest.raises(InputError, match=r"petsc4py is not available to this Python \(no MPI\): pip install"):
        petsc_start.start()


@pytest.mark.parametrize(("ranks", "cores", "value"), [("", 1, None), ("2", 2, None), ("3", 2, "1")])
def test_who_waits_lets_others_work_where_ranks_share_cores(
    ranks: str, cores: int, value: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MPI_LOCALNRANKS", ranks)
    monkeypatch.delenv("MPIR_CVAR_ENABLE_HEAVY_YIELD", raising=False)
    monkeypatch.setattr(petsc_start.os, "sched_getaffinity", lambda _: set(range(cores)))
    petsc_start.start()
    assert petsc_start.os.environ.get("MPIR_CVAR_ENABLE_HEAVY_YIELD") == value
    monkeypatch.delenv("MPIR_CVAR_ENABLE_HEAVY_YIELD", raising=False)


# -- values ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Table:
    k: float = 1.0


@pytest.mark.parametrize(
    ("hint", "good", "bad", "wanted"),
    [
        (int, [(3, 3), (np.int64(3), 3)], [True, 1.0, "1", None], "a whole number"),
        (float, [(3, 3.0), (2.5, 2.5), (np.float32(0.5), 0.5)], [True, "1", None, 1j], "a number"),
        (bool, [(True, True), (False, False)], [1, "yes", None], "true or false"),
        (str, [("a", "a")], [1, None, b"a"], "text"),
        (type(None), [(None, None)], [0, ""], "nothing"),
        (tuple[int, ...], [([1, 2], (1, 2)), ((), ())], [3, "12", {"a": 1}], "a list"),
        (tuple[int, str], [([1, "a"], (1, "a"))], [(1,), (1, "a", 2)], "a list of 2"),
        (Sequence[float], [([1, 2], (1.0, 2.0))], ["12", 3, {1}], "a list"),
        (list[int], [([1], (1,))], ["1"], "a list"),
        (Mapping[str, float], [({"a": 1}, {"a": 1.0})], [[1], 3], "a table of names and values"),
        (dict[str, int], [({"a": 1}, {"a": 1})], [[1]], "a table of names and values"),
        (Table, [({"k": 2}, Table(2.0)), (Table(), Table())], [3], "a table of names and values or a Table"),
        (Callable[[int], int], [(len, len)], [3], "a function"),
        (Path, [(Path("a"), Path("a"))], ["a"], "a Path"),
        (Any, [(3, 3), (None, None)], [], ""),
        (int | None, [(3, 3), (None, None)], ["a"], "a whole number"),
        (str | float, [("a", "a"), (2, 2.0)], [[1]], "a number"),
    ],
)
def test_values_become_what_they_are_declared_as(hint: Any, good: list[Any], bad: list[Any], wanted: str) -> None:
    for value, made in good:
        found = conform(value, hint, "x")
        assert (found, type(found)) == (made, type(made))
    for value in bad:
        with pytest.raises(InputError) as caught:
            conform(value, hint, "x")
        assert str(caught.value) == f"x = {shown(value)} must be {wanted}"


def test_entries_are_called_by_their_place() -> None:
    for value, hint, said in (
        ([1, "a"], tuple[int, ...], "x, entry 2 = 'a' must be a whole number"),
        (["a", 1], tuple[int, int], "x, entry 1 = 'a' must be a whole number"),
        ([1, "a"], Sequence[int], "x, entry 2 = 'a' must be a whole number"),
        ({"k": "a"}, Mapping[str, int], "x: k = 'a' must be a whole number"),
        ({3: 1}, Mapping[str, int], "a name in x = 3 must be text"),
        ({"q": 1}, Table, "x has no 'q': it has k"),
        (10**400, float, f"x = {'1' + '0' * 56}... is too large for a number"),
    ):
        with pytest.raises(InputError) as caught:
            conform(value, hint, "x")
        assert str(caught.value) == said
    kept = (1, 2)
    assert conform(kept, tuple[int, ...], "x") is kept


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.1 + 0.2, "0.3"), ("a\nb", "'a\\nb'"), ("x" * 58, f"'{'x' * 58}'"), ("x" * 59, f"'{'x' * 56}..."),
     ([1, 2], "[1, 2]")],
)  # fmt: skip
def test_values_in_messages(value: Any, text: str) -> None:
    assert shown(value) == text
    assert len(shown("x" * 200)) == 60
    assert printable("a\tb\x1b[1m") == "a\\tb\\x1b[1m"


@pytest.mark.parametrize(
    ("check", "arguments", "said"),
    [
        (require_positive, ("x", 1e-300, "h"), None),
        (require_positive, ("x", 0, "h"), "x = 0 must be a positive number: h"),
        (require_positive, ("x", True, "h"), "x = True must be a positive number: h"),
        (require_positive, ("x", float("inf"), "h"), "x = inf must be a positive number: h"),
        (require_finite, ("x", -1.0), None),
        (require_finite, ("x", "a"), "x = 'a' must be a finite number"),
        (require_finite, ("x", float("nan"), "h"), "x = nan must be a finite number: h"),
        (require_within, ("x", 1, 1, 2), None),
        (require_within, ("x", 2, 1, 2), None),
        (require_within, ("x", 0.9, 1, 2), "x = 0.9: use 1 to 2"),
        (require_within, ("x", 2.1, 1, 2, "h"), "x = 2.1: use 1 to 2, h"),
        (require_within, ("x", None, 1, 2), "x = None: use 1 to 2"),
        (require_choice, ("x", "a", ("a", "b")), None),
        (require_choice, ("x", "alp", ("alpha", "b"), "h"),
         "unknown x 'alp' (did you mean 'alpha'?): choose one of alpha, b; h"),
        (require_choice, ("x", "z", ("alpha", "b")), "unknown x 'z': choose one of alpha, b"),
        (require_known, (["a"], ["a"], "t"), None),
        (require_known, (["alp"], ["alpha"], "t"), "t has no 'alp' (did you mean 'alpha'?): it has alpha"),
        (require_known, ([3], [], "t"), "t has no '3': it has nothing"),
    ],
)  # fmt: skip
def test_checks_of_values(check: Any, arguments: tuple[Any, ...], said: str | None) -> None:
    if said is None:
        check(*arguments)
    else:
        with pytest.raises(InputError) as caught:
            check(*arguments)
        assert str(caught.value) == said


def test_settings_are_described_where_they_are() -> None:
    from dataclasses import field

    @described
    @dataclass
    class Settings:
        """Some."""

        a: int = field(default=1, metadata=about("A number.", choices=("x", "y"), none="none at all", detail="More."))
        b: int = 2
        c_: int = field(default=3, metadata=about("Called name_, too."))

    assert Settings.__doc__ == (
        "Some.\n\nAttributes:\n    a: A number. One of 'x', 'y'. None: none at all. More.\n"
        "    c_: Called ``name_``, too.\n"
    )
    assert about_of(field_of(Settings, "b")) is None
    assert same_as(Settings, "a") == field_of(Settings, "a").metadata


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"length": "mm"}, "give the units of both length and force, such as mm and N, or of neither"),
        ({"force": "N"}, "give the units of both length and force, such as mm and N, or of neither"),
        ({"length": "", "force": "N"}, "unit of length = '': use a short word such as mm or N"),
        ({"length": "mm", "force": "k N"}, "unit of force = 'k N': use a short word such as mm or N"),
        ({"length": "m" * 21, "force": "N"}, f"unit of length = '{'m' * 21}': use a short word such as mm or N"),
        ({"length": "m" * 20, "force": "N"}, None),
        ({}, None),
    ],
)
def test_units_are_words(given: dict[str, str], said: str | None) -> None:
    if said is None:
        assert Units(**given).declared is bool(given)
    else:
        with pytest.raises(InputError) as caught:
            Units(**given)
        assert str(caught.value) == said


def test_units_of_columns() -> None:
    columns = ["displacement", "reaction", "load_force", "energy_a", "min_j_a", "mine", "load"]
    assert Units("mm", "N").of_columns(columns, {"mine": "stress", "reaction": "length"}) == {
        "displacement": "mm", "reaction": "mm", "load_force": "N", "energy_a": "N", "min_j_a": "1", "mine": "N/mm^2",
    }  # fmt: skip
