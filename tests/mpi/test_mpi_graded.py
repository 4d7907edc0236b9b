"""A graded block with moduli from a mesh file's cell data and a graded gap: read, distributed, the same on ranks."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista
from helpers_process import tmc

from tmc_vem import run
from tmc_vem.mesh.files.io import read_mesh, write_mesh
from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
from tmc_vem.mesh.parts import with_names
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.support.errors import InputError

PROBLEM = """
name = "graded"
[mesh]
file = "layers.vtu"
[regions.block]
solid = { E = 26, nu = 0.3 }
graded = { E = "modulus + 2 * y", nu = "nu + 0.1 * x" }
[regions.gap]
medium = { gamma = 1e-3, alpha_r = 1, beta = 2, mu = 10 }
graded = { gamma = "gamma * 10 ** (-x)", alpha_r = "alpha_r * soft" }
[[support]]
at = "bottom"
ux = 0
uy = 0
[load]
at = "top"
uy = -0.05
[solve]
steps = 2
element = { interior_penalty = "penalty" }
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("graded")
    lines = np.linspace(0.0, 1.0, 6)
    layers = [Rectangle("block", 0.0, 1.0, 0.0, 0.6), Rectangle("gap", 0.0, 1.0, 0.6, 1.0)]
    edges = {"bottom": ((0.0, 0.0), (1.0, 0.0)), "top": ((0.0, 1.0), (1.0, 1.0))}
    write_mesh(with_names(structured_quadrilaterals(lines, lines, layers), lines=edges), path / "layers.vtu")
    grid = pyvista.read(path / "layers.vtu")
    n, rng = grid.n_cells, np.random.default_rng(5)
    grid.cell_data["modulus"] = rng.uniform(20.0, 30.0, n)
    grid.cell_data["soft"] = rng.integers(1, 4, n)
    grid.cell_data["vector"] = rng.uniform(0.0, 1.0, (n, 3))
    grid.save(path / "layers.vtu")
    (path / "graded.toml").write_text(PROBLEM)
    return path


def test_ranks_and_methods_agree(folder: Path) -> None:
    problem, options = read_problem(folder / "graded.toml")
    alone = run(problem, None, options)
    assert alone.complete
    done = tmc("run", str(folder / "graded.toml"), "--json", ranks=2)
    assert done.returncode == 0, done.stderr[-2000:]
    result: dict[str, Any] = json.loads(done.stdout)
    assert result["reaction"] == pytest.approx(alone.history[-1].reaction, rel=1e-9)
    assert result["inputs"]["regions"]["block"]["graded"] == {"E": "modulus + 2 * y", "nu": "nu + 0.1 * x"}
    plain = folder / "plain.toml"
    plain.write_text("\n".join(line for line in PROBLEM.splitlines() if not line.startswith("graded")))
    uniform = run(*_arguments(plain))
    assert abs(uniform.history[-1].reaction / alone.history[-1].reaction - 1.0) > 1e-3


def _arguments(path: Path) -> tuple[Any, ...]:
    problem, options = read_problem(path)
    return problem, None, options


def test_cell_data_stay_with_their_cells(folder: Path) -> None:
    grid = pyvista.read(folder / "layers.vtu")
    mesh = read_mesh(folder / "layers.vtu", cell_data=["modulus", "soft"])
    assert set(mesh.cell_data) == {"modulus", "soft"}
    centre = np.array([mesh.points_vx[mesh.cell(c)].mean(axis=0) for c in range(mesh.n_cells)])
    cells = [cell for cell in range(grid.n_cells) if grid.get_cell(cell).GetCellDimension() == 2]
    of_file = {tuple(np.round(grid.get_cell(c).points.mean(axis=0)[:2], 9)): c for c in cells}
    order = [of_file[tuple(place)] for place in np.round(centre, 9)]
    for name in ("modulus", "soft"):
        assert mesh.cell_data[name].tolist() == grid.cell_data[name][order].tolist()
    assert dict(read_mesh(folder / "layers.vtu").cell_data) == {}
    for wanted in ("vector", "none"):
        with pytest.raises(
            InputError, match=f"there is no cell data '{wanted}' with a number for every cell .*modulus"
        ):
            read_mesh(folder / "layers.vtu", cell_data=[wanted])


def test_formulas_that_no_cell_data_help_are_refused_in_one_line(folder: Path) -> None:
    for old, new, message in (
        ("modulus + 2 * y", "modules + 2 * y", "there is no cell data 'modules' with a number for every cell"),
        ("modulus + 2 * y", "modulus - 25", "regions: block: graded: in the cell around ("),
        ("nu + 0.1 * x", "nu + x", "nu = 0.6 must be between -1 and 0.5"),
        ("graded = { E", "graded = { e", "graded has no 'e'"),
        ('"modulus + 2 * y"', '"modulus +"', "regions: block: graded: E: 'modulus +' is no formula"),
        ('"modulus + 2 * y"', "5", "E = 5 must be text"),
    ):
        (folder / "bad.toml").write_text(PROBLEM.replace(old, new))
        done = tmc("run", str(folder / "bad.toml"))
        assert done.returncode == 2, done.stdout
        assert message in " ".join(done.stderr.split()), (new, done.stderr)
        assert "Traceback" not in done.stderr
