"""Problems on meshes from files: groups are regions, points and edges, whatever the format and their names."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from helpers_process import tmc

from tmc_vem.mesh.files.io import read_mesh, write_mesh
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.support.errors import InputError

FROM_FILE = """
name = "strip"
[mesh]
file = "strip.geo"
[regions.left]
solid = { K = 20, mu = 10 }
[regions.right]
solid = { K = 20, mu = 10 }
[points]
corner = [0, 0]
[[support]]
at = "fixed"
ux = 0
[[support]]
at = "corner"
uy = 0
[load]
at = "pulled"
ux = 0.004
"""
GEO = """
h = 0.25;
Point(1) = {0, 0, 0, h}; Point(2) = {1, 0, 0, h}; Point(3) = {2, 0, 0, h};
Point(4) = {2, 1, 0, h}; Point(5) = {1, 1, 0, h}; Point(6) = {0, 1, 0, h};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 5}; Line(5) = {5, 6}; Line(6) = {6, 1};
Line(7) = {2, 5};
Curve Loop(1) = {1, 7, 5, 6}; Plane Surface(1) = {1};
Curve Loop(2) = {2, 3, 4, -7}; Plane Surface(2) = {2};
Physical Surface("left") = {1}; Physical Surface("right") = {2};
Physical Curve("fixed") = {6}; Physical Curve("pulled") = {3};
"""


@pytest.mark.parametrize("kind", ["geo", "msh", "vtu", "inp", "mat", "nc"])
def test_meshes_from_files(tmp_path: Path, kind: str) -> None:
    """Groups of gmsh and names in mesh files are regions, points and edges; the force does not depend on the format."""
    (tmp_path / "strip.geo").write_text(GEO)
    if kind != "geo":
        write_mesh(read_mesh(tmp_path / "strip.geo"), tmp_path / f"strip.{kind}")
    path = tmp_path / "strip.toml"
    path.write_text(FROM_FILE.replace("strip.geo", f"strip.{kind}"))
    done = tmc("run", str(path), "--json")
    assert done.returncode == 0, done
    result = json.loads(done.stdout)
    assert "content" in result["inputs"]["mesh"]
    # a bar of length 2 and width 1, free to contract: E / (1 - nu^2) = 4 mu (lambda + mu) / (lambda + 2 mu)
    lame = 20 - 2 * 10 / 3
    modulus = 4 * 10 * (lame + 10) / (lame + 2 * 10)
    assert result["reaction"] == pytest.approx(modulus * 0.004 / 2, rel=0.01)
    assert result["gap"] is None


NUMBERS = GEO.replace('"left"', "1").replace('"right"', "2").replace('"fixed"', "11").replace('"pulled"', "12")


@pytest.mark.parametrize(
    "changes",
    [
        {"[mesh]": '[mesh]\nnames = { 1 = "left", 2 = "right", 11 = "fixed", curve_12 = "pulled" }'},
        {
            "[regions.left]": "[regions.1]", "[regions.right]": "[regions.region_2]", '"fixed"': '"11"',
            '"pulled"': '"curve_12"',
        },
    ],
    ids=["names", "numbers"],
)  # fmt: skip
def test_groups_with_numbers_only(tmp_path: Path, changes: dict[str, str]) -> None:
    (tmp_path / "strip.geo").write_text(NUMBERS)
    text = FROM_FILE
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "strip.toml").write_text(text)
    mesh = read_problem(tmp_path / "strip.toml")[0].make_mesh()
    plain = tmp_path / "plain.toml"
    plain.write_text(FROM_FILE.replace("strip.geo", "plain.geo"))
    (tmp_path / "plain.geo").write_text(GEO)
    expected = read_problem(plain)[0].make_mesh()
    assert mesh.region_c.tolist() == expected.region_c.tolist()
    ours, theirs = list(mesh.named_edges.values()), list(expected.named_edges.values())
    assert [pairs.tolist() for pairs in ours] == [pairs.tolist() for pairs in theirs]


def test_names_that_do_not_fit_a_mesh_file(tmp_path: Path) -> None:
    (tmp_path / "strip.geo").write_text(NUMBERS)
    for mesh, message in (
        ("[mesh]", r"the mesh has region_1, region_2; .* \[mesh\] names = \{ 1 = \"left\" \}"),
        (
            '[mesh]\nnames = { 7 = "left" }',
            r"no group '7' \(there are: 1 \(region region_1\), .*11 \(curve",
        ),
    ):
        (tmp_path / "strip.toml").write_text(FROM_FILE.replace("[mesh]", mesh))
        with pytest.raises(InputError, match=message):
            read_problem(tmp_path / "strip.toml")[0].make_mesh()
