"""Small files of every kind and format in tests/corpus: read with the right cells and names, or refused in words.

``expected.toml`` says for each file the cells and the area of every region, the number of named edges, the named
points, and words of the notes; or words of the message that refuses it.
"""

from __future__ import annotations

import dataclasses
import importlib.util
import shutil
import subprocess
import sys
import tomllib
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tmc_vem import run
from tmc_vem.cli.main import main
from tmc_vem.mesh.check import find_faults
from tmc_vem.mesh.files.io import read_mesh
from tmc_vem.mesh.quality import measure
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.support.errors import InputError

CORPUS = Path(__file__).parents[1] / "corpus"
EXPECTED: dict[str, dict[str, Any]] = tomllib.loads((CORPUS / "expected.toml").read_text())


def needs(*packages: str) -> None:
    """Skip without these; they are not imported here, as their HDF5 does not go with that of dolfinx in one process."""
    for name in packages:
        if importlib.util.find_spec(name) is None:
            pytest.skip(f"{name} is not installed")


def test_every_file_of_the_corpus_has_its_expectation() -> None:
    files = {str(path.relative_to(CORPUS)) for path in CORPUS.rglob("*") if path.is_file()}
    assert files - {"expected.toml", "abaqus/nodes.inc"} == set(EXPECTED)


@pytest.mark.parametrize("name", EXPECTED)
def test_file_is_read_right_or_refused_in_words(name: str) -> None:
    if CORPUS.joinpath(name).suffix == ".med" or name in ("polygons/ugrid_hdf5.nc", "polygons/polymesher73.mat"):
        needs("h5py")
    if "lz4" in name.lower():
        needs("lz4")
    expected, notes = EXPECTED[name], list[str]()
    options = expected.get("options", {})
    if "refused" in expected:
        with pytest.raises(InputError) as refused:
            read_mesh(CORPUS / name, notes=notes, **options)
        assert expected["refused"] in str(refused.value)
        assert "\n" not in str(refused.value)
        return
    mesh = read_mesh(CORPUS / name, notes=notes, **options)
    assert not find_faults(mesh)
    area_c = measure(mesh).area_c
    found = {
        region: [int((mesh.region_c == n).sum()), round(float(area_c[mesh.region_c == n].sum()), 6)]
        for n, region in enumerate(mesh.region_names)
    }
    assert found == expected["regions"]
    assert {edges: len(pairs) for edges, pairs in mesh.named_edges.items()} == expected.get("edges", {})
    points = {point: np.round(mesh.points_vx[v], 6).tolist() for point, v in mesh.named_points.items()}
    assert points == expected.get("points", {})
    assert len(notes) == len(expected.get("notes", []))
    for note, words in zip(notes, expected.get("notes", []), strict=True):
        assert words in note


@pytest.mark.parametrize("name", [name for name, expected in EXPECTED.items() if "fixed" in expected])
def test_faults_are_named_and_repaired(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    expected = EXPECTED[name]
    with pytest.raises(SystemExit) as left:
        main(["mesh", "check", str(CORPUS / name)])
    out = capsys.readouterr().out
    assert left.value.code == 1
    assert expected["refused"] in out
    assert "--fix repairs this" in out
    with pytest.raises(SystemExit) as left:
        main(["mesh", "check", str(CORPUS / name), "--fix", str(tmp_path / "good.vtu")])
    assert left.value.code == 0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mesh = read_mesh(tmp_path / "good.vtu")
    assert [mesh.n_cells, mesh.n_vertices] == expected["fixed"]
    assert round(float(measure(mesh).area_c.sum()), 5) == expected["area"]


def test_a_med_file_of_medcoupling_runs(tmp_path: Path) -> None:
    """The example of the how-to page on meshes."""
    needs("medcoupling", "h5py")
    shutil.copytree(CORPUS.parents[1] / "demos" / "meshes", tmp_path, dirs_exist_ok=True)
    subprocess.run([sys.executable, "write_med.py", "blocks.med"], cwd=tmp_path, check=True)
    problem, options = read_problem(tmp_path / "med.toml")
    result = run(problem, options=dataclasses.replace(options, steps=2))
    assert result.n_cells == 10
    assert set(result.min_j) == {"gap", "block", "base"}
    assert result.reaction == pytest.approx(-0.0015781456, rel=1e-6)
