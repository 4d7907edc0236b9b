"""Mutation runs: which faults there are, which tests are near, and what becomes of a fault."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from mutation import explained, measure, show
from mutation.c_sites import c_sites
from mutation.command import main
from mutation.judge import KILLED, SURVIVED, TIMEOUT, Judge, Outcome
from mutation.nearness import CALLERS, Nearness
from mutation.python_sites import python_sites
from mutation.sample import changes, draw, find, sites, sources
from mutation.site import Mutant, mutants
from mutation.trees import ROOT, Tree, end_session


def faults(text: str, file: str = "tmc_vem/x.py") -> dict[str, set[str]]:
    """Changed lines by kind of fault."""
    found: dict[str, set[str]] = {}
    for mutant in mutants(sites(file, text), text):
        found.setdefault(mutant.operator, set()).add(mutant.after)
    return found


@pytest.mark.parametrize(
    ("line", "operator", "after"),
    [
        ("x = a + b", "arithmetic", {"x = a - b"}),
        ("x = (a) * (b)", "arithmetic", {"x = (a) / (b)"}),
        ("x = a ** b", "arithmetic", {"x = a * b"}),
        ("x = a < b", "comparison", {"x = a <= b", "x = a >= b"}),
        ("x = a is not b", "comparison", {"x = a is b"}),
        ("x = a <= b < c", "comparison", {"x = a < b < c", "x = a > b < c", "x = a <= b <= c", "x = a <= b >= c"}),
        ("x = a and b or c", "and/or", {"x = a or b or c", "x = a and b and c"}),
        ("x = not (a or b)", "not dropped", {"x = (a or b)"}),
        ("x = -a", "sign", {"x = a"}),
        ("x = 3", "number", {"x = 4", "x = 2"}),
        ("x = 1e-6", "number", {"x = 1e-05", "x = 1e-07"}),
        ("x = 0.5", "number", {"x = 0.55"}),
        ("x = 20.0", "number", {"x = 22.0"}),
        ("x = True", "True/False", {"x = False"}),
        ("x = a.sum(axis=0)", "axis", {"x = a.sum(axis=1)"}),
        ("x = a[i:j]", "slice", {"x = a[i + 1:j]", "x = a[i - 1:j]", "x = a[i:j + 1]", "x = a[i:j - 1]"}),
        ("x = a[::-1]", "slice", {"x = a[:]"}),
        ("x = a[0]", "number", {"x = a[1]"}),
        ("x = min(a, b)", "name", {"x = max(a, b)"}),
        ("x = np.sin(a)", "name", {"x = np.cos(a)"}),
        ("x = f(a, b)", "swapped arguments", {"x = f(b, a)"}),
        ("x = f(a, k=b)", "keyword dropped", {"x = f(a)"}),
        ("x = f(k=b, m=c)", "keyword dropped", {"x = f(m=c)", "x = f(k=b)"}),
        ("x = a['gap']", "string", {"x = a['gap_']"}),
        ("x = a.T @ b", "transposition dropped", {"x = a @ b"}),
        ("x = [a for a in b if a]", "filter dropped", {"x = [a for a in b if True]"}),
        ("x = a if b else c", "condition", {"x = a if not (b) else c"}),
        ("a, b = c", "swapped", {"b, a = c"}),
        ("a.b = c", "statement deleted", {"pass"}),
        ("a.append(b)", "statement deleted", {"pass"}),
        ("µ = 'ß' + b * c", "arithmetic", {"µ = 'ß' + b / c"}),  # places are not counted in bytes
    ],
)
def test_faults_of_a_line(line: str, operator: str, after: set[str]) -> None:
    assert faults(line)[operator] == after


def test_faults_of_functions_and_classes() -> None:
    text = (
        "def f(a: float, b: float, c: int) -> float:\n    if c:\n        raise ValueError\n    x = 0\n"
        "    x = a\n    return x, b\n"
        "@dataclass(frozen=True)\nclass P:\n    width: float\n    height: float\n    n: int\n"
        "    def g(self):\n        return self.width\n"
    )
    found = faults(text)
    assert found["guard"] == {"if False:"}
    assert found["sibling"] == {"x = b", "return x, a", "return self.height"}
    assert found["swapped"] == {"return b, x"}
    assert found["statement deleted"] == {"pass"}, "only the second value of x"
    assert "True/False" not in found


@pytest.mark.parametrize(
    "text",
    [
        '"""Words 1 < 2."""\n',
        "raise ValueError('gap', 1, a < b)\n",
        "logger.warning('x', 1)\n",
        "x: Annotated[int, 3]\n",
        "__all__ = ['a']\n",
        "if TYPE_CHECKING:\n    x = 1\n",
        "Pair = tuple[int, Literal[1]]\n",
        "x = f(help='gap', linewidth=2, color='red')\n",
        "from a import b\n",
        "x = f'gap {a + 1}'\n",
        "x = 'a sentence of words'\n",
    ],
)
def test_what_computes_nothing_is_left_alone(text: str) -> None:
    assert faults(text) == {}


def test_words_of_reports_are_left_alone() -> None:
    text = "x = row('gap', a['gap'], b == 'mean')\n"
    assert faults(text, "tmc_vem/report/x.py")["string"] == {
        "x = row('gap', a['gap_'], b == 'mean')", "x = row('gap', a['gap'], b == 'mean_')",
    }  # fmt: skip
    assert len(faults(text)["string"]) == 3


def test_faults_of_c() -> None:
    text = (
        "/* 1 + 2 */\n#define N 3\nstatic void f(double *x, int n)\n{\n    for (int i = 0; i < n; i++)\n"
        "        x[i] += -a[i][j] * sin(2.0 * y); // 4 - 5\n}\n"
    )
    found = faults(text, "codegen/x.c")
    assert found["indices"] == {"x[i] += -a[j][i] * sin(2.0 * y); // 4 - 5"}
    assert found["sign"] == {"x[i] += a[i][j] * sin(2.0 * y); // 4 - 5"}
    assert found["name"] == {"x[i] += -a[i][j] * cos(2.0 * y); // 4 - 5"}
    assert found["number"] == {"for (int i = 1; i < n; i++)", "x[i] += -a[i][j] * sin(2.2 * y); // 4 - 5"}
    assert {"x[i] -= -a[i][j] * sin(2.0 * y); // 4 - 5", "for (int i = 0; i <= n; i++)"} <= found["operator"]
    assert not any("double /x" in line for lines in found.values() for line in lines), "no pointer is divided"
    in_python = 'SOURCE = """\nx[0] = a[1] + b;\n"""\n'
    assert "x[0] = a[1] - b;" in faults(in_python)["C, operator"]


def test_only_one_place_of_a_file_changes() -> None:
    """Every fault of a source of ours: what is before and after the place is as it was, and most can be read."""
    file = "tmc_vem/solve/path.py"
    text = (ROOT / file).read_text()
    every = list(mutants(python_sites(file, text), text))
    assert len(every) > 100
    for mutant in every:
        mutated = mutant.apply(text)
        assert mutated.startswith(text[: mutant.start])
        assert mutated.endswith(text[mutant.end :])
        assert changes(mutant, text) or mutant.operator in ("string", "sign", "swapped arguments"), mutant
    assert every[7] in find(ROOT, [every[7].key])[every[7].key]


def test_what_compiles_to_the_same_is_none() -> None:
    for before, new, same in (("x = 1.0\n", "1.00", True), ("x = 1.0\n", "2.0", False), ("x = 1.0\n", ") (", False)):
        mutant = Mutant("a.py", 1, "number", before, "", 4, 7, new)
        readable = new != ") ("
        assert changes(mutant, before) is (readable and not same)


def test_a_sample_depends_on_the_seed_only() -> None:
    files = [file for file in sources(ROOT) if file.startswith(("tmc_vem/solve/", "tmc_vem/vem/kernel/"))]
    one, again, other = (draw(ROOT, files, seed, 40) for seed in (1, 1, 2))
    assert one == again
    assert len({mutant.key for mutant in one} & {mutant.key for mutant in other}) < 20
    assert len({mutant.file for mutant in one}) > 8
    assert len({(mutant.file, mutant.start) for mutant in one}) == 40
    assert any(mutant.file.endswith(".c") for mutant in (*one, *other))


def test_a_sample_hardly_changes_with_the_sources(tmp_path: Path) -> None:
    """New lines, and lines that move, leave the rest of a sample where it is."""
    file = "tmc_vem/solve/path.py"
    (tmp_path / file).parent.mkdir(parents=True)
    text = (ROOT / file).read_text()
    (tmp_path / file).write_text(text)
    before = {mutant.key for mutant in draw(tmp_path, [file], 1, 30)}
    start = text.index("\ndef ")
    (tmp_path / file).write_text(text[:start] + "\nNEW = 3.0 + 4.0\n" + text[start:] + "\nLAST = NEW > 2\n")
    after = {mutant.key for mutant in draw(tmp_path, [file], 1, 30)}
    assert len(before & after) >= 28


def test_every_source_in_c_has_python_that_calls_it() -> None:
    for file in (file for file in sources(ROOT) if not file.endswith(".py")):
        (callers,) = (files for folder, files in CALLERS.items() if file.startswith(f"{folder}/"))
        assert all((ROOT / caller).is_file() for caller in callers), file


def test_every_entry_of_the_explained_has_its_line() -> None:
    entries = explained.read(ROOT / explained.EXPLAINED)
    assert explained.obsolete(ROOT, entries) == []


def test_explained_faults(tmp_path: Path) -> None:
    text = "def f(a, b):\n    return a + b\n"
    (tmp_path / "x.py").write_text(text)
    entry = '[[mutant]]\nfile = "x.py"\nbefore = "return a + b"\nafter = "return a - b"\nreason = "b is 0"\n'
    (tmp_path / "explained.toml").write_text(entry)
    known = explained.read(tmp_path / "explained.toml")
    (mutant,) = mutants(python_sites("x.py", text), text)
    assert explained.reason(mutant, known) == "b is 0"
    assert explained.obsolete(tmp_path, known) == []
    judged = show.Judged(mutant, Outcome(SURVIVED, "", 1.0), "b is 0")
    assert judged.status == "explained"
    show.write(tmp_path / "result.json", [judged, show.Judged(mutant, Outcome(SURVIVED, "", 1.0))])
    assert show.survivors(tmp_path / "result.json") == [(mutant.key, mutant.line)]
    (tmp_path / "x.py").write_text("def f(a, b):\n    return b + a\n")
    assert explained.obsolete(tmp_path, known) == known
    (tmp_path / "explained.toml").write_text(entry.replace("reason", "why"))
    with pytest.raises(ValueError, match="entry 1 needs file, before, after, reason"):
        explained.read(tmp_path / "explained.toml")


MODULE = """LIMIT = 4


def strong(a, b):
    return a - b


def weak(a, b):
    return a * b


def endless(n):
    while n < LIMIT:
        n += 1
    return n


def untested(a):
    return a + 1
"""
TESTS = """import pytest
from tmc_vem import x


@pytest.fixture(scope="module")
def product():
    return x.weak(2, 2)


def test_strong():
    assert x.strong(3, 1) == 2


def test_weak(product):
    assert product > 0


def test_endless():
    assert x.endless(1) == 4
"""


@pytest.fixture
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Tree:
    """A small package with its tests, measured."""
    monkeypatch.setattr(measure, "RECORDS", tmp_path / "map")
    monkeypatch.setattr(measure, "SOURCES", tmp_path / "sources")
    place = tmp_path / "tree"
    for name, text in {"tmc_vem/__init__.py": "", "tmc_vem/x.py": MODULE, "tests/unit/test_x.py": TESTS}.items():
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        (place / name).write_text(text)
    shutil.copytree(ROOT / "tests" / "mutation", place / "tests" / "mutation")
    (place / "pyproject.toml").write_text('[tool.pytest.ini_options]\nmarkers = ["slow", "paper"]\n')
    return Tree(place, tmp_path / "cache")


def fault(after: str) -> Mutant:
    return next(
        mutant for mutant in mutants(python_sites("tmc_vem/x.py", MODULE), MODULE) if mutant.after == after
    )  # fmt: skip


def test_a_strong_test_kills_and_a_weak_one_does_not(tree: Tree, monkeypatch: pytest.MonkeyPatch) -> None:
    tests = ["tests/unit/test_x.py"]
    assert measure.stale(tree.path, tests) == tests
    (record,) = measure.measure(tree, tests)
    assert measure.stale(tree.path, tests) == []
    assert len(record.seconds) == 3
    assert set(record.fixtures["tests/unit/test_x.py::test_weak"]) == {"product"}
    nearness = Nearness(tree.path, tests)

    def near(after: str) -> list[str]:
        return [test.name.partition("::")[2] for test in nearness.near(fault(after))]

    assert near("return a + b")[0] == "test_strong"
    assert near("return a / b")[0] == "test_weak", "the fixture runs it"
    assert near("LIMIT = 5")[0] == "test_endless", "a constant is used by the function that names it"
    assert len(near("return a - 1")) == 3, "what no test executes has all tests of the module"

    monkeypatch.setattr("mutation.judge.HANGS", 2.0)
    judge = Judge(tree, nearness, set())
    killed, survived, hangs = (judge.judge(fault(after)) for after in ("return a + b", "return a / b", "n -= 1"))
    assert (killed.status, killed.by) == (KILLED, "tests/unit/test_x.py::test_strong")
    assert (survived.status, survived.ran[0]) == (SURVIVED, "tests/unit/test_x.py::test_weak")
    assert (hangs.status, hangs.by) == (TIMEOUT, "tests/unit/test_x.py::test_endless")
    assert (tree.path / "tmc_vem/x.py").read_text() == MODULE

    # lines move: the tests of a line are those that it had where it was
    moved = '"""A module."""\n\n' + MODULE
    copy = tree.path.with_name("copy")
    shutil.copytree(tree.path, copy)
    (copy / "tmc_vem/x.py").write_text(moved)
    later = next(m for m in mutants(python_sites("tmc_vem/x.py", moved), moved) if m.after == "return a + b")
    assert Nearness(copy, tests).near(later)[0].name == "tests/unit/test_x.py::test_strong"
    (tree.path / "tests/unit/test_x.py").write_text(TESTS + "\n")
    assert measure.stale(tree.path, tests) == tests


def test_a_test_that_fails_anyway_does_not_count(tree: Tree) -> None:
    measure.measure(tree, ["tests/unit/test_x.py"])
    nearness = Nearness(tree.path, ["tests/unit/test_x.py"])
    (tree.path / "tests/unit/test_x.py").write_text(TESTS.replace("== 2", "== 3"))
    outcome = Judge(tree, nearness, set()).judge(fault("return a + b"))
    assert not outcome.seen
    assert outcome.broken == ("tests/unit/test_x.py::test_strong",)


def test_a_session_is_ended_with_all_that_it_started(tree: Tree) -> None:
    code = (
        "import subprocess, sys, time; p = subprocess.Popen(['sleep', '60']); print(p.pid, flush=True); time.sleep(60)"
    )
    log = tree.path.with_suffix(".log")
    ended = tree.run(["-c", code], stop=lambda seconds: seconds > 20 or bool(log.read_text().strip()))
    assert ended.code is None
    grandchild = Path("/proc") / ended.output.strip() / "stat"
    assert not grandchild.exists() or grandchild.read_text().rpartition(")")[2].split()[0] == "Z"
    end_session(2**22)  # nobody's


def test_a_mutated_file_is_never_taken_for_its_compiled_original(tree: Tree) -> None:
    command = ["-c", "from tmc_vem.x import strong; print(strong(3, 1))"]
    said = []
    for text in (MODULE, MODULE.replace("a - b", "a + b"), MODULE):
        tree.write("tmc_vem/x.py", text)
        said.append(tree.run(command, stop=lambda seconds: seconds > 20).output.strip())
    assert said == ["2", "4", "2"]


def test_bad_arguments_are_one_line(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text("{}")
    for arguments, words in (
        (["--only", "nothing.py"], "no source is called nothing.py"),
        (["--again", str(tmp_path / "none.json")], "No such file"),
    ):
        assert main([*arguments, "--list"]) == 2
        assert words in capsys.readouterr().err
    assert main(["--only", "tmc_vem/solve/path.py", "--number", "3", "--list"]) == 0
    assert capsys.readouterr().out.count("tmc_vem/solve/path.py:") == 3


def test_c_of_comments_is_left_alone() -> None:
    assert list(c_sites("x.c", '/* x = 1 + 2; */ // 3\n#include <math.h>\n"a + 4"\n')) == []
