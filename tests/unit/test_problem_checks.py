"""Problem files that leave something arbitrary are refused in one line; what geometry tells is said before a run."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from helpers_process import tmc

from tmc_vem import Box, Material, Medium, RunOptions, run
from tmc_vem.mesh.make.outline import Region
from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
from tmc_vem.mesh.make.voronoi import voronoi_mesh
from tmc_vem.problems import Bodies, CBox, Punch
from tmc_vem.problems.base import RegionEnergy, solid_region
from tmc_vem.problems.examine import examine, of_moduli
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.support.errors import InputError

BLOCKS = """\
name = "blocks"
gap = ["tip", "ground"]
[shapes]
low = { rectangle = [0, 0, 1, 0.4] }
mid = { rectangle = [0, 0.4, 1, 0.6] }
up = { rectangle = [0, 0.6, 1, 1.0] }
[regions.low]
shape = "low"
solid = { K = 20, mu = 10 }
[regions.up]
shape = "up"
solid = { K = 20, mu = 10 }
[regions.medium]
shape = "mid"
medium = { gamma = 1e-4, alpha_r = 1 }
[mesh]
size = 0.1
[points]
tip = [0.5, 0.6]
ground = [0.5, 0.4]
corner = [0, 1]
[edges]
bottom = { line = [[0, 0], [1, 0]] }
top = { line = [[0, 1], [1, 1]] }
lid = { between = ["up", "outside"] }
[[support]]
at = "bottom"
ux = 0
uy = 0
[[support]]
at = "top"
ux = 0
[load]
at = "top"
uy = -0.05
[solve]
steps = 1
"""


def refusal(tmp_path: Path, *changes: tuple[str, str]) -> str:
    """What is said about the file with some changes."""
    text = BLOCKS
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / "blocks.toml"
    path.write_text(text)

    def look() -> None:
        problem, options = read_problem(path)
        examine(problem, problem.make_mesh(), options.path)

    with pytest.raises(InputError) as error:
        look()
    message = str(error.value)
    assert "\n" not in message
    return message


SUPPORT = '[[support]]\nat = "top"\nux = 0\n'


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (SUPPORT, SUPPORT + "uy = 0\n", ("'top'", "support uy = 0", "load uy = -0.05")),
        (SUPPORT, SUPPORT + '[[support]]\nat = "lid"\nuy = 0\n', ("'lid'", "'top'", "meet at (")),
        (SUPPORT, SUPPORT + '[[support]]\nat = "corner"\nuy = 0.1\n', ("'corner'", "'top'", "meet at (0, 1)")),
        ('[load]\nat = "top"', '[load]\nat = "bottom"', ("'bottom'", "support uy = 0", "load uy = -0.05")),
        ('gap = ["tip", "ground"]', 'gap = ["tip", "tip"]', ("gap", "tip", "itself")),
        ('gap = ["tip", "ground"]', 'gap = ["tip", [0.5, 0.6]]', ("gap", "(0.5, 0.6)", "two surfaces")),
        ('gap = ["tip", "ground"]', "gap = [[0.5, 0.5], [0.5, 0.5]]", ("gap", "(0.5, 0.5)", "itself")),
        ("[solve]", '[probes]\ng = { gap = ["tip", "tip"] }\n[solve]', ("g", "tip", "itself")),
        ("uy = -0.05", "uy = 0", ("nothing moves", "uy = 0", "'top'")),
        (SUPPORT, "", ("only the medium holds region up", "moving in x", "[regions.up]")),
        ("ux = 0\nuy = 0", "uy = 0", ("only the medium holds region low", "moving in x")),
        ("solid = {", 'hold = "glue"\nsolid = {', ("hold", "'glue'", "medium")),
        ("medium = {", 'hold = "medium"\nmedium = {', ("hold", "solids")),
        ("[mesh]\n", '[mesh]\nfile = "x.msh"\n', ("mesh",)),
        ("alpha_r = 1", "alpha_r = 1, alpha = 2.5", ("alpha = 2.5", "alpha_r = 1")),
        ("alpha_r = 1", "alpha_r = 1, h = 0.2", ("h = 0.2", "alpha")),
        ("alpha_r = 1", "alpha = 0", ("alpha = 0", "positive")),
        ("alpha_r = 1", "alpha = 1, h = -1", ("h = -1", "positive")),
    ],
)
def test_what_is_arbitrary_is_refused(tmp_path, old, new, words):
    message = refusal(tmp_path, (old, new))
    assert all(word in message for word in words), message


def test_alpha_needs_a_gap_or_its_width(tmp_path):
    message = refusal(tmp_path, ('gap = ["tip", "ground"]', ""), ("alpha_r = 1", "alpha = 2.5"))
    assert "needs the width of the gap" in message


@pytest.mark.parametrize("key", ["size = 0.1", 'cells = "triangles"', "refine = [{ near = [0, 0], size = 0.1 }]"])
def test_nothing_of_cells_beside_a_file(tmp_path, key):
    text = BLOCKS[BLOCKS.index("[points]") :]
    regions = '[regions.low]\nsolid = { K = 20, mu = 10 }\n[mesh]\nfile = "x.msh"\n'
    path = tmp_path / "blocks.toml"
    path.write_text(f'name = "blocks"\n{regions}{key}\n{text}')
    with pytest.raises(InputError, match=rf"file = 'x.msh' and {key.split(' ')[0]}"):
        read_problem(path)


def test_supports_of_one_value_may_meet(tmp_path):
    path = tmp_path / "blocks.toml"
    path.write_text(BLOCKS.replace(SUPPORT, SUPPORT + '[[support]]\nat = "corner"\nux = 0\n'))
    problem, _ = read_problem(path)
    assert examine(problem, problem.make_mesh()) == []


def test_a_solid_may_hang_in_the_medium_if_the_file_says_so(tmp_path):
    path = tmp_path / "blocks.toml"
    path.write_text(BLOCKS.replace(SUPPORT, "").replace('shape = "up"\n', 'shape = "up"\nhold = "medium"\n'))
    problem, _ = read_problem(path)
    assert "ends flush" in " ".join(examine(problem, problem.make_mesh(), (0.0, 5.0)))


def test_a_byte_order_mark_is_read_over(tmp_path):
    path = tmp_path / "blocks.toml"
    path.write_bytes(b"\xef\xbb\xbf" + BLOCKS.encode())
    assert read_problem(path)[0].name == "blocks"


def test_warnings_come_before_the_run_and_stand_in_the_result(tmp_path):
    path = tmp_path / "blocks.toml"
    path.write_text(BLOCKS.replace("-0.05", "-0.12").replace("K = 20", "K = 1e5", 1).replace("steps = 1", "steps = 2"))
    done = tmc("run", str(path), "--out", str(tmp_path / "out"), "--max-iterations", "1")
    stderr = " ".join(done.stderr.split())
    assert stderr.index("warning: region 'low'") < stderr.index("stopped")
    for words in ("region 'low' has K / mu = 100000 / 10 = 1e+04", "ends flush at (1, 0.4)-(1, 0.6)"):
        assert words in stderr
        assert words in " ".join(json.loads((tmp_path / "out" / "result.json").read_text())["warnings"])


@pytest.mark.parametrize(("K", "words"), [(9e3, None), (2e4, "may lock"), (2e7, "check the units"), (1e-6, "units")])
def test_moduli_that_lock_or_are_in_two_units(K, words):
    found = of_moduli({"block": solid_region(Material(K, 10.0))})
    assert bool(found) == bool(words)
    assert words is None or (words in found[0] and "'block'" in found[0])


def test_a_gap_that_is_too_thin_for_the_cells(tmp_path):
    path = tmp_path / "blocks.toml"
    path.write_text(BLOCKS.replace("0.6]", "0.41]").replace("0.6, 1,", "0.41, 1,"))
    problem, _ = read_problem(path)
    with pytest.raises(InputError, match=r"region 'medium' is 0.01 wide there.*size of 0.005 or less"):
        problem.make_mesh()


@pytest.mark.parametrize(("uy", "said"), [("-1.9", False), ("-5", True)])
def test_a_displacement_of_several_domains_is_doubtful(tmp_path, uy, said):
    path = tmp_path / "blocks.toml"
    path.write_text(BLOCKS.replace("-0.05", uy))
    problem, _ = read_problem(path)
    found = " ".join(examine(problem, problem.make_mesh()))
    assert ("uy = -5 at 'top' is 5 times the size of the mesh (1)" in found) is said


def test_a_wall_that_is_too_thin_for_the_cells():
    wall = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    hole = [(0.02, 0.02), (0.98, 0.02), (0.98, 0.98), (0.02, 0.98)]
    with pytest.raises(InputError, match=r"region 'wall' is 0.02 wide"):
        voronoi_mesh([Region("wall", wall, [hole]), Region("medium", hole)], 0.1)


UNITS = {"N, mm": (1.0, 1.0), "Pa, m": (1e6, 1e-3), "GPa, mm": (1e-3, 1.0), "Pa, mm": (1e6, 1.0)}


def box(modulus: float, length: float) -> Box:
    """A small box with moduli and lengths in other units."""
    return Box(
        cells=(20, 5), uy=-0.6 * length, length=2.0 * length, height=0.5 * length, wall=0.1 * length,
        material=Material(20.0 * modulus, 10.0 * modulus), medium=Medium(gamma=1e-4, alpha=2.5),
    )  # fmt: skip


def test_alpha_gives_the_same_numbers_in_any_units():
    options = RunOptions(snapshots=0)
    first = run(box(1.0, 1.0), None, options)
    medium = first.inputs["medium"]
    assert (medium["alpha_r"], medium["h"]) == (pytest.approx(2.5 * 10.0 * 0.3**2), pytest.approx(0.3))
    for modulus, length in list(UNITS.values())[1:]:
        other = run(box(modulus, length), None, options)
        assert other.gap / length == pytest.approx(first.gap, rel=1e-9)
        assert other.last.reaction / (modulus * length) == pytest.approx(first.last.reaction, rel=1e-9)
        assert other.newton_iterations == first.newton_iterations


def test_alpha_of_a_problem_file_uses_its_gap_or_h(tmp_path):
    path = tmp_path / "blocks.toml"
    for text, h in (("alpha = 2", 0.2), ("alpha = 2, h = 0.5", 0.5)):
        path.write_text(BLOCKS.replace("alpha_r = 1", text))
        problem, _ = read_problem(path)
        assert problem.regions()["medium"].values["alpha_r"] == pytest.approx(2.0 * 10.0 * h**2)
        medium = problem.inputs()["medium"]
        assert (medium["alpha"], medium["h"]) == (2.0, pytest.approx(h))
        assert medium["alpha_r"] == pytest.approx(2.0 * 10.0 * h**2)
    path.write_text(BLOCKS)
    assert set(read_problem(path)[0].inputs()["medium"]) == {"gamma", "alpha_r", "beta", "regulariser"}


@pytest.mark.parametrize(
    ("problem", "mu", "h"),
    [(Box, 10.0, 0.3), (CBox, 5.0 / 14.0, 0.3), (Punch, 5.0 / 14.0, 0.6), (Bodies, 10.0, 0.1)],
)
def test_alpha_of_the_benchmarks(problem, mu, h):
    made = problem(medium=Medium(alpha=2.5))
    assert made.regions()["medium"].values["alpha_r"] == pytest.approx(2.5 * mu * h**2)
    assert made.inputs()["medium"]["alpha_r"] == pytest.approx(2.5 * mu * h**2)


def test_alpha_and_alpha_r_of_a_medium():
    assert (Medium().alpha_r, Medium(alpha=2.0).alpha_r) == (1.0, None)
    with pytest.raises(InputError, match=r"alpha = 2 and alpha_r = 1"):
        Medium(alpha=2.0, alpha_r=1.0)
    with pytest.raises(InputError, match="alpha = 2 needs the width"):
        Medium(alpha=2.0).weight(10.0, None)


def test_the_command_line_takes_alpha_and_shows_what_it_makes(tmp_path):
    out = tmp_path / "out"
    common = ("run", "box", "--cells", "20", "5", "--uy", "-0.05", "--alpha", "2.5")
    done = tmc(*common, "--out", str(out), "--max-iterations", "6")
    assert "alpha_r = 2.25 (alpha = 2.5, h = 0.3)" in " ".join(done.stdout.split())
    again = tmc("resume", str(out), "--json")
    assert again.returncode == 0, again.stderr
    assert json.loads(again.stdout)["inputs"]["medium"]["alpha"] == 2.5
    both = tmc(*common, "--alpha-r", "1")
    assert both.returncode == 2
    assert "alpha = 2.5 and alpha_r = 1" in both.stderr


def test_a_region_of_python_says_what_holds_it():
    with pytest.raises(InputError, match="unknown hold 'glue'"):
        RegionEnergy(solid_region(Material(1.0, 1.0)).energy, {}, hold="glue")
    x = np.linspace(0.0, 1.0, 3)
    mesh = structured_quadrilaterals(x, x, [Rectangle("all", 0.0, 1.0, 0.0, 1.0)])
    with pytest.raises(InputError, match="region 'all' has no energy"):
        examine(Box(), mesh)


def test_where_there_is_no_bar_a_step_that_takes_long_is_said(capsys, monkeypatch):
    from tmc_vem.cli import progress

    clock = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: clock[0])
    monitor = progress.ConsoleMonitor()
    monitor.iterated(1, 1.0)
    assert capsys.readouterr().err == ""
    for clock[0] in (21.0, 22.0, 30.0):
        monitor.iterated(7, 1e-3)
    assert capsys.readouterr().err == "after load 0: iteration 7, residual 1.0e-03\n"
