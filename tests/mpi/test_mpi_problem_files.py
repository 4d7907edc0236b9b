"""Problem files on several ranks: the same mesh, steps and probes as on one."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista
from helpers_plate import result_of
from helpers_process import tmc

EXAMPLES = Path(__file__).parents[2] / "demos" / "problems"
# cells, and the part of the load, that tests have time for
QUICK = {
    "seal": (("size = 0.06", "size = 0.12"), ("uy = -0.2", "uy = -0.06"), ("size = 0.02,", "size = 0.025,")),
    "gripper": (("size = 0.1\n", "size = 0.15\n"), ("ux = -0.4", "ux = -0.15")),
}


@cache
def run(name: str, ranks: int, method: str, folder: Path) -> dict[str, Any]:
    text = (EXAMPLES / f"{name}.toml").read_text()
    for old, new in QUICK[name]:
        assert old in text
        text = text.replace(old, new)
    path = folder / f"{name}.toml"
    path.write_text(text.replace('cells = "voronoi"', 'cells = "triangles"') if method == "fem" else text)
    out = folder / f"{name}-{method}-{ranks}"
    done = tmc("run", str(path), "--method", method, "--steps", "2", "--out", str(out), "--json", ranks=ranks)
    assert done.returncode == 0, done.stderr[-2000:]
    result: dict[str, Any] = json.loads(done.stdout)
    assert result["parallel"]["ranks"] == max(ranks, 1)
    return result


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("files")


@pytest.mark.parametrize(
    ("name", "ranks", "method"),
    [
        ("seal", 3, "vem"),
        ("gripper", 2, "vem"),
        ("seal", 2, "fem"),
        *(pytest.param(*case, marks=pytest.mark.slow) for case in (("seal", 2, "vem"), ("gripper", 3, "vem"))),
    ],
)
def test_probes_do_not_depend_on_the_ranks(name: str, ranks: int, method: str, folder: Path) -> None:
    if method == "fem":
        pytest.importorskip("dolfinx")
    expected, found = (run(name, n, method, folder) for n in (1, ranks))
    assert found["complete"]
    assert len(expected["probes"]) >= 5
    assert found["probes"] == pytest.approx(expected["probes"], rel=1e-7, abs=1e-10)
    assert found["reaction"] == pytest.approx(expected["reaction"], rel=1e-7)
    assert found["contact"].keys() == expected["contact"].keys()
    for body, values in expected["contact"].items():
        assert found["contact"][body] == pytest.approx(values, rel=1e-6, abs=1e-9), body
    tables = [np.genfromtxt(folder / f"{name}-{method}-{n}" / "contact.csv", delimiter=",", skip_header=1)[:, 2:]
              for n in (1, ranks)]  # fmt: skip
    assert tables[1] == pytest.approx(tables[0], rel=1e-6, abs=1e-7, nan_ok=True), "tractions, station by station"
    assert (found["n_dofs"], found["steps"]) == (expected["n_dofs"], expected["steps"])
    whole = pyvista.read(max((folder / f"{name}-{method}-{ranks}" / "fields").glob("*.pvtu")))
    moved = whole.GetPointData().GetArray("displacement")
    assert whole.n_cells == expected["n_cells"]
    assert moved.GetInformation().Get(moved.UNITS_LABEL()) == {"seal": "mm", "gripper": "cm"}[name]


def test_a_point_outside_of_the_mesh_is_said_once_on_two_ranks(tmp_path: Path) -> None:
    text = (EXAMPLES / "seal.toml").read_text().replace("at = [0.3, 0.55]", "at = [3.3, 0.55]")
    (tmp_path / "seal.toml").write_text(text)
    done = tmc("run", str(tmp_path / "seal.toml"), "--out", str(tmp_path / "out"), ranks=2)
    assert done.returncode == 2
    assert done.stderr.count("probes: bulge: point (3.3, 0.55) lies 2.3 outside of the mesh") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("method", ["vem", "fem"])
def test_a_body_that_nothing_holds_is_said_once_on_two_ranks(method: str, tmp_path: Path) -> None:
    if method == "fem":
        pytest.importorskip("dolfinx")
    text = (EXAMPLES / "seal.toml").read_text().replace('cells = "voronoi"', 'cells = "triangles"')
    top = '[[support]]\nat = "top"\nux = 0\n'
    assert top in text
    (tmp_path / "seal.toml").write_text(text.replace(top, ""))
    done = tmc("run", str(tmp_path / "seal.toml"), "--method", method, "--out", str(tmp_path / "out"), ranks=2)
    assert done.returncode == 2
    assert done.stderr.count("only the medium holds region seal, around (0, 0.675), against moving in x") == 1
    assert not (tmp_path / "out").exists()


ROLLERS = """[[support]]
at = "left"
normal = 0
[[support]]
at = "bottom"
normal = 0
[[load]]
name = "press"
at = "top"
normal = -0.1
history = [[0, 0], [1, 1], [1.5, 0.5]]
[[load]]
name = "pull"
at = "right"
traction = [0.5, 1.0]
history = [[1, 0], [1.5, 1]]
"""


@pytest.mark.parametrize("method", ["vem", "fem"])
def test_loads_and_rollers_on_inclines_do_not_depend_on_the_ranks(method: str, tmp_path: Path) -> None:
    if method == "fem":
        pytest.importorskip("dolfinx")
    expected = result_of(tmp_path, ROLLERS, 30.0, method=method, steps=1)
    out = str(tmp_path / "out")
    done = tmc("run", str(tmp_path / "plate.toml"), "--method", method, "--steps", "1", "--out", out, "--json", ranks=2)
    assert done.returncode == 0, done.stderr[-2000:]
    found = json.loads(done.stdout)
    assert (found["parallel"]["ranks"], found["steps"], found["load"]) == (2, 2, 1.5)
    for name, values in expected.loads.items():
        assert found["loads"][name] == pytest.approx(values, rel=1e-8, abs=1e-11)
    assert found["energy"] == pytest.approx(expected.last.energy, rel=1e-9)
