"""Design regions: a solid in a medium, what is said of them before and after a run."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from helpers_sensitivity import SEAL, own

from tmc_vem import RunOptions, run
from tmc_vem.cli.main import _run
from tmc_vem.problems import Material, Medium
from tmc_vem.problems.base import medium_region, solid_region
from tmc_vem.problems.conditions import require_held
from tmc_vem.problems.design_region import design_region, design_regions
from tmc_vem.problems.hints import hints
from tmc_vem.problems.inventory import narrowest, parts
from tmc_vem.results.plausibility import Evidence, findings_of
from tmc_vem.results.records import StepRecord
from tmc_vem.simulation.checkup import check
from tmc_vem.support.errors import InputError

CANTILEVER = """
name = "cantilever"
shapes.frame = { rectangle = [0, 0, 2, 1] }
mesh = { cells = "voronoi", size = 0.3 }
points.tip = [2, 0.5]
edges.left = { line = [[0, 0], [0, 1]] }
support = [{ at = "left", ux = 0, uy = 0 }]
load = { at = "tip", uy = -0.3 }
[regions.design]
shape = "frame"
stiffness = 0.5
solid = { E = 100, nu = 0.3 }
medium = { gamma = 1e-4, alpha_r = 1e-2, regulariser = "huhu_lulu" }
"""


def test_the_energy_is_that_of_both() -> None:
    material, medium = Material(E=100.0, nu=0.3), Medium(gamma=1e-3, alpha_r=0.2)
    both = design_region(material, medium, 0.25)
    solid, void = solid_region(material), medium_region(medium, material.moduli.mu)
    assert both.energy.parameters == ("K", "mu", "mu_medium", "gamma", "alpha_r", "beta", "stiffness")
    assert both.values["mu_medium"] == void.values["mu"]
    assert both.values["mu"] == solid.values["mu"]
    assert design_regions({"a": both, "b": solid, "c": void}) == ("a",)


def test_a_design_of_stiffness_one_is_the_solid_and_of_zero_the_medium() -> None:
    """But for a fraction gamma."""
    text = SEAL.replace("solid = { E = 40, nu = 0.3 }", "MADE")
    solid = "solid = { E = 40, nu = 0.3 }"
    designed = solid + ", medium = { mu = 10, gamma = 1e-7, alpha = 0.5, h = 0.2 }, stiffness = "
    options = RunOptions(steps=4, snapshots=0)
    reactions = {
        made: run(own(text.replace("MADE", made), "probes.cut"), options=options).reaction
        for made in (solid, *(f"{designed}{stiffness}" for stiffness in (1, 0.5, 0.05)))
    }
    values = list(reactions.values())
    assert values[1] == pytest.approx(values[0], rel=1e-5)
    assert abs(values[1]) > abs(values[2]) > abs(values[3])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("stiffness = 0.5", "stiffness = 1.5", "stiffness = 1.5 of a design region must be from 0, the medium"),
        ("gamma = 1e-4", "gamma = 1e-4, friction = 0.3", "a design region has no friction: there are no derivatives"),
        ("medium = {", "graded = { E = 'E * x' }\nmedium = {", "graded is for a solid or a medium alone"),
        ("solid = { E = 100, nu = 0.3 }", "", "stiffness = 0.5 is for design regions, which have a solid and a medium"),
    ],
)  # fmt: skip
def test_what_is_no_design_region(old: str, new: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        own(CANTILEVER.replace(old, new))


def test_a_run_has_no_doubts_about_its_medium() -> None:
    """All that resists is the design; it is no medium that carries the load."""
    result = run(own(CANTILEVER), options=RunOptions(steps=2, snapshots=0))
    assert result.complete
    assert result.warnings == result.errors == []
    assert result.inputs["regions"]["design"]["stiffness"] == 0.5
    assert result.inputs["regions"]["design"].keys() >= {"solid", "medium"}


def test_a_medium_beside_a_design_is_judged_by_itself() -> None:
    step = StepRecord(
        1, 1.0, -0.1, {}, -2.0, 3, 0, 0, {"gap": 0.8, "design": 0.9}, {"gap": 0.4, "design": 0.6}, 0, False, 1.0
    )
    judged = Evidence({}, [step], {}, ["gap"], 1.0, designs=("design",))
    (finding,) = findings_of(judged)
    assert "the medium alone gives 40% of the final reaction" in finding.text
    assert "100%" in findings_of(replace(judged, media=["gap", "design"], designs=()))[0].text
    squeezed = replace(step, min_j={"gap": 0.8, "design": 0.3})
    assert not any("before contact" in found.text for found in findings_of(replace(judged, history=[squeezed])))
    thin = replace(step, energy={"gap": 0.0, "design": 1.0}, min_j={"gap": 0.8, "design": 1e-7})
    (finding,) = findings_of(replace(judged, history=[thin]))
    assert "smallest J in region 'design' is 1e-07, below 1e-06" in finding.text


def test_a_design_is_a_part_that_is_held_and_no_gap() -> None:
    problem = own(SEAL.replace('regions.foot = { shape = "foot", solid', 'regions.foot = { shape = "foot", medium = '
                               '{ mu = 10, gamma = 1e-3, alpha = 0.5, h = 0.2 }, solid'), "probes.cut")  # fmt: skip
    mesh, regions = problem.make_mesh(), problem.regions()
    assert {part.regions for part in parts(mesh, regions, problem.prescribed())} == {("foot",), ("block",)}
    assert {gap.medium for gap in narrowest(mesh, regions)} == {"medium"}
    assert all(hint.regions[0] != "foot" for hint in hints(mesh, regions, problem.prescribed()))


def test_a_design_holds_what_hangs_together_with_it() -> None:
    """A solid at its end, to which the load is applied, needs no support of its own."""
    text = CANTILEVER.replace('shape = "frame"', 'shape = "frame - end"') + """
[shapes.end]
rectangle = [1.4, 0, 2, 1]
[regions.end]
shape = "end"
solid = { E = 100, nu = 0.3 }
"""  # fmt: skip
    problem = own(text)
    require_held(problem.make_mesh(), problem.regions(), problem.prescribed())
    apart = own(text.replace('"frame - end"', '"frame - gap - end"') + """
[shapes.gap]
rectangle = [0.8, 0, 1.4, 1]
[regions.gap]
shape = "gap"
medium = { gamma = 1e-4, alpha_r = 1e-2, mu = 1 }
""")  # fmt: skip
    with pytest.raises(InputError, match="only the medium holds region end"):
        require_held(apart.make_mesh(), apart.regions(), apart.prescribed())


def test_what_check_says(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = check(own(CANTILEVER))
    assert found.materials["design"]["design"]
    assert not found.materials["design"]["medium"]
    assert found.materials["design"]["parameters"]["stiffness"] == 0.5
    (tmp_path / "a.toml").write_text(CANTILEVER)
    assert _run(["check", str(tmp_path / "a.toml"), "--no-picture"]) == 0
    out = capsys.readouterr().out
    assert "design region, a solid in third medium, energy 'solid_in_medium_huhu_lulu': K = 83.333" in out
    assert "design around (1, 0.5)" in out
