"""``--set NAME=VALUE``: how entries and values are written, what is recorded of them, and what is wrong with others."""

from __future__ import annotations

import dataclasses
import json
import pickle
import tomllib
from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import CliRunner
from helpers_plug import plug
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tmc_vem import RunOptions, RunResult, run
from tmc_vem.cli import run_file
from tmc_vem.cli.main import _run
from tmc_vem.cli.run import run_group
from tmc_vem.problems import Box, Medium
from tmc_vem.simulation.problem_file import NAMED, problem_text, read_problem
from tmc_vem.support.assignments import changed, keys, parse_changes, parse_choices, said
from tmc_vem.support.errors import InputError
from tmc_vem.support.toml_text import as_table, toml_text
from tmc_vem.system.fem_settings import FemSettings
from tmc_vem.vem.spaces.element_settings import ElementSettings

EXAMPLES = sorted((Path(__file__).parents[2] / "demos" / "problems").glob("*.toml"))


# -- names and values ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("20", 20), ("-3", -3), ("+4", 4), ("007", 7), ("-0.3", -0.3), ("1e-4", 1e-4), (".5", 0.5), ("5.", 5.0),
        ("-.5E2", -50.0), ("1_000", 1000), ("true", True), ("false", False), ("True", "True"),
        ('"20"', "20"), ("'a, b'", "a, b"), ('"a, \\"b\\""', 'a, "b"'),
        ("frame - (a + b)", "frame - (a + b)"), ("mesh/a.msh", "mesh/a.msh"), ("2d.msh", "2d.msh"), ("1e-4x", "1e-4x"),
        ("2024-01-01", "2024-01-01"), ("1\nb = 2", "1\nb = 2"),
        ("[0, 1]", [0, 1]), ('[["a", "b"], []]', [["a", "b"], []]), ("{ K = 2, nu = 0.3 }", {"K": 2, "nu": 0.3}),
        (" 7 ", 7), ("a=b", "a=b"), ('""', ""),
    ],
)  # fmt: skip
def test_values_are_those_of_toml_and_text_without_quotes(text: str, value: Any) -> None:
    found = parse_changes([f"mesh.size={text}"])
    assert found == {"mesh.size": value}
    assert type(found["mesh.size"]) is type(value)


def test_several_values_stand_between_commas() -> None:
    assert parse_choices(["a=1,2.5 , x y", "b=[1,2],{c=[3,4]},'5,6',\"7\\\",8\"", "c=true"]) == {
        "a": [1, 2.5, "x y"], "b": [[1, 2], {"c": [3, 4]}, "5,6", '7",8'], "c": [True],
    }  # fmt: skip


def test_names_are_divided_by_dots_outside_quotes() -> None:
    assert keys("a.b-c.1") == ("a", "b-c", "1")
    assert keys(' regions . "a b.c" . \'d"\' ') == ("regions", "a b.c", 'd"')


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        (["mesh.size"], "--set 'mesh.size' is not NAME=VALUE, for example regions.block.solid.mu=20"),
        (["=3"], "--set '=3' is not NAME=VALUE, for example regions.block.solid.mu=20"),
        (["a="], '--set a=: a value is missing; an empty text is ""'),
        (["a=1,,2"], '--set a=1,,2: a value is missing; an empty text is ""'),
        (["a..b=1"], "--set 'a..b' is no name of an entry: write regions.block.solid.mu=20, with dots between the "
                     "names"),
        (["a.=1"], "--set 'a.' is no name of an entry: write regions.block.solid.mu=20, with dots between the names"),
        (["a b=1"], "--set 'a b' is no name of an entry: write regions.block.solid.mu=20, with dots between the "
                    "names"),
        (["b=1", "a=1,2"], "--set a=1,2: 'a' takes one value here, not 2: 'tmc-vem sweep' goes through several, a "
                           "list is [1, 2], and text with a comma stands in quotes"),
        (["a.b=1", "a.'b'=2"], "--set a.'b': 'a.b' is set twice: give it once"),
        (["a=[1"], "--set a=[1 is no value of TOML: Unclosed array"),
        (['a="b'], '--set a="b is no value of TOML: Unterminated string'),
        (["a=" + "[" * 5000], None),
    ],
)  # fmt: skip
def test_what_is_no_change(texts: list[str], message: str | None) -> None:
    with pytest.raises(InputError) as error:
        parse_changes(texts)
    assert message is None or str(error.value) == message
    assert "\n" not in str(error.value)


TABLE = {"name": "x", "mesh": {"size": 1, "refine": [{"size": 2}, {"size": 3}]},
         "support": [{"at": "top", "ux": 0}, {"at": "low"}, {"at": "low"}, {"name": "p"}],
         "regions": {"a": {"solid": {"mu": 1}}}}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "value", "found"),
    [
        ("mesh.size", 5, lambda t: t["mesh"]["size"]),
        ("solve.element.order", 3, lambda t: t["solve"]["element"]["order"]),
        ("mesh.refine.1.size", 9, lambda t: t["mesh"]["refine"][0]["size"]),
        ("mesh.refine.2", {"size": 7}, lambda t: t["mesh"]["refine"][1]),
        ("support.top.ux", 4, lambda t: t["support"][0]["ux"]),
        ("support.3.ux", 4, lambda t: t["support"][2]["ux"]), ("support.p.uy", 4, lambda t: t["support"][3]["uy"]),
        ("regions.a.solid.mu", 2, lambda t: t["regions"]["a"]["solid"]["mu"]),
        ("regions.a", {}, lambda t: t["regions"]["a"]),
        ("gap", ["a", "b"], lambda t: t["gap"]),
    ],
)  # fmt: skip
def test_a_change_changes_one_entry_of_a_copy(name: str, value: Any, found: Any) -> None:
    before = json.dumps(TABLE)
    after = changed(TABLE, {name: value}, ("regions",))
    assert found(after) == value
    assert json.dumps(TABLE) == before
    assert changed(TABLE, {}) == TABLE


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("regions.b.solid.mu", "regions has no 'b': it has a"), ("regions.b", "regions has no 'b': it has a"),
        ("name.first", "name = 'x' has no entry 'first': it is no table and no list"),
        ("name.first.more", "name = 'x' has no entry 'first': it is no table and no list"),
        ("support.low.ux", "support has 2 entries 'low': say which by number, 2 and 3"),
        ("support.topp.ux", "support has no 'topp' (did you mean 'top'?): it has top, low, low, p"),
        ("support.0.ux", "support has no entry 0: its 4 entries are counted from 1"),
        ("support.5", "support has no entry 5: its 4 entries are counted from 1"),
        ("mesh.refine.first.size", "mesh.refine has no 'first': it has 1, 2"),
    ],
)  # fmt: skip
def test_what_a_table_does_not_have(name: str, message: str) -> None:
    with pytest.raises(InputError) as error:
        changed(TABLE, {name: 1}, ("regions",))
    assert str(error.value) == message


def test_a_change_is_said_as_it_is_given() -> None:
    assert said("mesh.size", 0.1) == "--set mesh.size=0.1"
    assert said("mesh.file", "a") == "--set mesh.file='a'"


# -- problem files ---------------------------------------------------------------------------------------------------


def test_names_that_users_choose() -> None:
    """Probes may be added, as they change no number."""
    assert {"shapes", "regions", "points", "edges"} == NAMED


def test_a_problem_with_changes(tmp_path: Path) -> None:
    path = plug(tmp_path)
    changes = {
        "regions.base.solid.mu": 12, "support.top.ux": 0.01, "mesh.refine.1.size": 0.1, "solve.steps": 3,
        "probes.more": {"mean": "J", "region": "plug"}, "load.uy": -0.3,
    }  # fmt: skip
    problem, options = read_problem(path, changes)
    assert problem.regions()["base"].values["mu"] == 12.0
    assert problem.load().value == -0.3
    assert problem.table.support[1].ux == 0.01
    assert problem.table.mesh.refine[0].size == 0.1
    assert "more" in problem.probes()
    assert options.steps == 3
    plain, _ = read_problem(path)
    assert problem.inputs()["set"] == changes
    assert "set" not in plain.inputs()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"regions.bas.solid.mu": 1}, "plug.toml: regions has no 'bas' (did you mean 'base'?): it has base, plug, "
                                      "medium (--set regions.bas.solid.mu=1)"),
        ({"points.tpi": [0, 1]}, "plug.toml: points has no 'tpi' (did you mean 'tip'?): it has tip, ground "
                                 "(--set points.tpi=[0, 1])"),
        ({"mesh.size": 0.2, "mesh.growth": -1}, "plug.toml: mesh: growth = -1 must be a positive number: try 0.3 "
                                                "(--set mesh.growth=-1)"),
        ({"regions.base.solid.E": 3}, "plug.toml: regions: base: solid: give two of K, mu, E, nu and lambda, not K and "
                                      "mu and E (--set regions.base.solid.E=3)"),
        ({"name": 3}, "plug.toml: name = 3 must be text (--set name=3)"),
        ({"gap": ["tip", "tip"]}, "plug.toml: the gap of tip and itself is 0 always: name points on the two surfaces "
                                  "that approach (--set gap=['tip', 'tip'])"),
        ({"solve.snapshots": -1}, None), ({"mesh.size": "small"}, None), ({"regions": 3}, None), ({"solve": []}, None),
        ({"mesh.file": "a.msh"}, None), ({"load.ux": 1}, None), ({"shapes.base.disc": [0, 0, 1]}, None),
    ],
)  # fmt: skip
def test_the_change_at_fault_is_named(tmp_path: Path, changes: dict[str, Any], message: str | None) -> None:
    with pytest.raises(InputError) as error:
        read_problem(plug(tmp_path), changes)
    name, value = list(changes.items())[-1]
    text = str(error.value)
    assert message is None or text == message
    assert text.endswith(f"({said(name, value)})")


def test_a_fault_of_the_file_has_its_line(tmp_path: Path) -> None:
    path = plug(tmp_path, ("size = 0.25", "siez = 0.25"))
    with pytest.raises(InputError, match=r"did you mean 'size'.*\(line 23\)$"):
        read_problem(path, {"load.uy": -0.1})


def test_changes_that_are_right_together_only(tmp_path: Path) -> None:
    """The order counts for what is said of a fault, not for what is right."""
    changes = {"mesh.file": "a.msh", "shapes": {}, "mesh.cells": "voronoi", "regions": {}}
    with pytest.raises(InputError, match="regions: there is none"):
        read_problem(plug(tmp_path), {"regions": {}})
    with pytest.raises(InputError, match=r"\(--set mesh.file='a.msh'\)$"):
        read_problem(plug(tmp_path), changes)
    problem, _ = read_problem(plug(tmp_path), {"regions.plug.solid": {"K": 1}, "regions.plug.solid.mu": 2})
    assert problem.regions()["plug"].values == {"K": 1.0, "mu": 2.0}


# -- what is written -------------------------------------------------------------------------------------------------

TEXT = st.text(st.sampled_from("ab-_.1 \"'\\#=[]{}\n\t\x7f\x00é𝛼"), max_size=4)
PLAIN = st.recursive(
    st.booleans() | st.integers(-(2**60), 2**60) | st.floats(allow_nan=False) | TEXT,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(TEXT, inner, max_size=3),
    max_leaves=6,
)  # fmt: skip


@settings(max_examples=60, deadline=None)
@given(st.dictionaries(TEXT, PLAIN, max_size=4))
def test_tables_come_back_from_their_text(table: dict[str, Any]) -> None:
    assert tomllib.loads(toml_text(table)) == table


def test_the_text_of_a_table_is_laid_out_for_readers() -> None:
    long = [[1.0] * 9, [2.0] * 9]
    table = {"none": None, "a b": 1, "regions": {"x": {"shape": "y", "solid": {"K": 2.5}}, "z": {"w": True}},
             "support": [{"at": "a"}, {"at": "b"}], "empty": [], "nothing": {},
             "long": [long[0] * 3, *long]}  # fmt: skip
    lines = toml_text(table).splitlines()
    assert lines[:4] == ['"a b" = 1', "empty = []", "long = [", f"  {[1.0] * 27},"]
    at = lines.index("[regions]")
    assert lines[at - 1 : at + 5] == ["", "[regions]", "z = { w = true }", "", "[regions.x]", 'shape = "y"']
    assert lines[at + 5 : at + 9] == ["solid = { K = 2.5 }", "", "[[support]]", 'at = "a"']
    assert lines[-2:] == ["", "[nothing]"]
    assert toml_text({"regions": {"x": {"y": {}}}}) == "\n[regions.x]\ny = {}\n"


def test_tables_have_what_is_not_the_default() -> None:
    assert as_table(RunOptions()) == {}
    assert as_table(RunOptions(steps=2, path=(0.0, 1.0, 0.0), element=ElementSettings(order=3))) == {
        "steps": 2, "path": [0.0, 1.0, 0.0], "element": {"order": 3},
    }  # fmt: skip
    assert as_table(Box(medium=Medium(gamma=1e-3)))["medium"] == {"gamma": 1e-3, "alpha_r": 1.0}


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_the_file_of_a_run_is_the_problem_that_was_solved(path: Path, tmp_path: Path) -> None:
    region = "medium" if "[regions.medium]" in path.read_text() else "design"
    problem, options = read_problem(path, {f"regions.{region}.medium.gamma": 2e-4, "solve.largest_step": 0.05})
    copy = tmp_path / "copy.toml"
    copy.write_text(
        problem_text(problem, dataclasses.replace(options, overwrite=True, max_iterations=1, max_seconds=1))
    )
    again, same = read_problem(copy)
    assert same == options
    assert again.table == dataclasses.replace(problem.table, solve=again.table.solve)
    assert {**again.inputs(), "set": problem.inputs()["set"]} == problem.inputs()


OF_FILE = """
name = "of_file"
regions = { body = { solid = { K = 2, mu = 1 } } }
mesh = { file = "a.msh" }
support = []
load = { at = "top", ux = 1 }
"""


def test_files_in_the_file_of_a_run_are_named_from_the_root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.py").write_text("def bend(F, G, p, m):\n    return p.k * (F[0][0] - 1.0) ** 2\n")
    (tmp_path / "a.petsc").write_text("-tmc_ksp_type preonly\n")
    path = plug(
        tmp_path, ('regulariser = "huhu_lulu"', 'regulariser = "own.py:bend", parameters = { k = 1 }'),
        ("solid = { K = 20, mu = 10 }", 'density = "own.py:bend"\nparameters = { k = 2 }'),
    )  # fmt: skip
    problem, options = read_problem(path.name, {"solve.solver": "a.petsc"})
    table = tomllib.loads(problem_text(problem, options))
    assert table["regions"]["medium"]["medium"]["regulariser"] == f"{tmp_path}/own.py:bend"
    assert table["regions"]["base"]["density"] == f"{tmp_path}/own.py:bend"
    assert table["solve"]["solver"] == f"{tmp_path}/a.petsc"
    (tmp_path / "of_file.toml").write_text(OF_FILE)
    table = tomllib.loads(problem_text(read_problem("of_file.toml")[0], RunOptions()))
    assert table["mesh"] == {"file": f"{tmp_path}/a.msh"}
    assert "solve" not in table


def test_a_problem_goes_to_other_processes(tmp_path: Path) -> None:
    problem, _ = read_problem(plug(tmp_path), {"load.uy": -0.1})
    _ = problem.regions(), problem.make_mesh()
    again = pickle.loads(pickle.dumps(problem))
    assert again == problem
    assert again.inputs() == problem.inputs()


# -- runs ------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def solved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run directory of the plug with another modulus and load."""
    directory = tmp_path_factory.mktemp("plug")
    words = ["run", str(plug(directory)), "--set", "regions.base.solid.mu=15", "--set", "load.uy=-0.03", "--quiet"]
    assert _run([*words, "--steps", "2", "--out", str(directory / "out"), "--max-iterations", "3"]) == 3
    (directory / "plug.toml").unlink()  # the copy in the run directory will do
    assert _run(["resume", str(directory / "out"), "--quiet"]) == 0
    return directory / "out"


def test_a_run_records_what_was_set(solved: Path) -> None:
    result = RunResult.read(solved)
    assert result.inputs["set"] == {"regions.base.solid.mu": 15, "load.uy": -0.03}
    assert result.inputs["regions"]["base"]["solid"]["mu"] == 15
    assert result.last is not None
    assert result.last.displacement == -0.03


def test_the_file_of_a_run_gives_the_same_numbers(solved: Path) -> None:
    problem, options = read_problem(solved / "problem.toml")
    assert (options.steps, options.max_iterations, options.overwrite) == (2, None, False)
    again = run(problem, options=options)
    first = RunResult.read(solved)
    assert (again.gap, again.reaction, again.steps) == (first.gap, first.reaction, first.steps)


@pytest.mark.parametrize(
    ("words", "settings_"),
    [
        ("--path '0 1 0' --at 0.5 --at 0.25", {"path": (0.0, 1.0, 0.0), "output_loads": (0.5, 0.25)}),
        ("--continuation gamma=1e-3", {"continuation": {"gamma": 1e-3}}),
        ("--follow", {"follow": True, "steps": None}),
        ("--solver reproducible", {"solver": "reproducible"}),
        ("--order 3 --l 4 --projection full --rule triangles --quadrature 7 --interior-penalty full --eta 3",
         {"element": ElementSettings(3, 4, 7, projection="full", rule="triangles", interior_penalty="full", eta=3.0)}),
        ("--method fem --order 3 --quadrature 7 --interior-penalty full --eta 3 --triangles",
         {"method": "fem",
          "fem": FemSettings(order=3, quadrature=7, interior_penalty="full", eta=3.0, triangles=True)}),
    ],
)  # fmt: skip
def test_every_run_option_counts_for_a_file(
    words: str, settings_: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import shlex

    seen: list[Any] = []
    monkeypatch.setattr(run_file, "execute", lambda *given: seen.append(given))
    path = plug(tmp_path, *([("steps = 1\n", "")] if "follow" in words else []))
    done = CliRunner().invoke(run_file.problem_command(str(path)), shlex.split(words), catch_exceptions=False)
    assert done.exit_code == 0, done.output
    assert seen[0][1] == RunOptions(**{"steps": 1, "snapshots": 0, **settings_})


def test_files_have_the_options_of_benchmarks() -> None:
    """But for those of problem and medium, which are entries of the file."""
    of_medium = {"gamma", "alpha", "alpha_r", "medium_energy", "log_j", "regulariser", "parameters", "beta",
                 "friction", "elastic_slip"}  # fmt: skip
    of_box = {"cells", "cell_kind", "refine_medium", "uy"}
    box = {param.name for param in run_group.commands["box"].params} - of_medium - of_box
    assert box <= {param.name for param in run_file.problem_command("a.toml").params}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--set", "mesh.siez=1"], "did you mean 'size'"), (["--set", "load.uy=-1,-2"], "'tmc-vem sweep'"),
        (["--set", "load.uy"], "NAME=VALUE"), (["--method", "fem", "--l", "3"], "--l belongs to --method vem"),
        (["--method", "fem", "--rule", "triangles"], "--rule belongs"), (["--triangles"], "--triangles belongs"),
        (["--method", "fem", "--projection", "full"], "--projection belongs"), (["--path", "0 x"], "load factors"),
        (["--set", "solve.method=fem", "--rule", "triangles"], "--rule belongs"),
        (["--continuation", "mu=1"], "continuation"), (["--order", "9"], "order"), (["--follow"], "follow does not go"),
    ],
)  # fmt: skip
def test_bad_options_are_one_line(
    words: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert _run(["run", str(plug(tmp_path)), *words]) == 2
    said_ = capsys.readouterr().err
    assert message in said_
    assert said_.count("\n") == 1


WORDS = ("regions", "base", "solid", "mu", "mesh", "refine", "1", "0", "support", "top", "load", "uy", "solve", "steps",
         "x", "points", "tip", "name", "gap", "probes")  # fmt: skip
VALUES = ("1", "-1", "x", "[]", "{}", "[1,2]", "[[1]]", "true", "nan", "inf", "1e999", "''", "{a=1}", "=", "9" * 400)


def one_line_or(make: Any, *given_: Any) -> Any:
    """What is made, or None with an error of one line."""
    try:
        return make(*given_)
    except InputError as error:
        said_ = str(error)
    assert "\n" not in said_
    return None


@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.sampled_from(WORDS), min_size=1, max_size=4), st.sampled_from(VALUES))
def test_anything_set_is_a_problem_or_one_line(tmp_path: Path, names: list[str], text: str) -> None:
    path = tmp_path / "plug.toml"
    if not path.exists():
        plug(tmp_path)
    changes = one_line_or(parse_changes, [f"{'.'.join(names)}={text}"])
    made = one_line_or(read_problem, path, changes)
    if made is not None:
        json.dumps(made[0].inputs())


@settings(max_examples=100, deadline=None)
@given(st.lists(st.text("ab.=,[]{}\"'\\ 1-e\n#", max_size=12), max_size=3))
def test_any_text_is_a_change_or_one_line(texts: list[str]) -> None:
    one_line_or(parse_choices, texts)


def test_groups_take_files_for_commands() -> None:
    with pytest.raises(NotImplementedError):
        run_file.FileGroup("x").get_command(click.Context(run_group), "a.toml")
