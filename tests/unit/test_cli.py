"""The command line: results, bad input in one line, and what is on disk afterwards."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest
from helpers_process import tmc

CELLS = ("--cells", "20", "5")
SHORT = (*CELLS, "--uy", "-0.05")


def test_json_is_all_that_stdout_has() -> None:
    done = tmc("run", "box", *SHORT, "--json")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["complete"]
    assert result["load"] == 1.0
    assert 0.2 < result["gap"] < 0.3
    assert result["inputs"]["medium"]["regulariser"] == "huhu_lulu"
    assert set(result["min_j"]) == {"solid", "medium"}
    assert result["seconds"]["total"] > result["seconds"]["assembly"] > 0.0


def test_run_directory_is_complete(tmp_path: Path) -> None:
    out = tmp_path / "deep" / "box"
    done = tmc("run", "box", *SHORT, "--steps", "4", "--snapshots", "2", "--out", str(out))
    assert done.returncode == 0, done.stderr
    result = json.loads((out / "result.json").read_text())
    assert result["steps"] == 4
    with (out / "history.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["load"]) for row in rows] == pytest.approx([0.25, 0.5, 0.75, 1.0], abs=1e-15)
    assert float(rows[-1]["gap"]) == result["gap"]
    assert (out / "deformed.png").read_bytes().startswith(b"\x89PNG")
    collection = (out / "fields.pvd").read_text()
    for step in (2, 4):
        assert f"fields/step_{step:05d}.vtu" in collection
        assert (out / f"fields/step_{step:05d}.vtu").exists()
    assert "gap" in done.stdout
    assert not list(out.glob(".*"))  # no temporary files


def test_fields_hold_quadratic_quadrilaterals(tmp_path: Path) -> None:
    meshio = pytest.importorskip("meshio")
    out = tmp_path / "box"
    assert tmc("run", "box", *SHORT, "--snapshots", "1", "--out", str(out), "--quiet").returncode == 0
    mesh = meshio.read(next(out.glob("fields/*.vtu")))
    assert [(block.type, block.data.shape) for block in mesh.cells] == [("quad8", (100, 8))]
    assert set(mesh.cell_data) == {"J", "min_J", "energy_density", "region", "medium", "cauchy_stress", "von_mises"}
    displacement = mesh.point_data["displacement"]
    load_point = ((mesh.points[:, :2] - (1.0, 0.5)) ** 2).sum(axis=1).argmin()
    assert displacement[load_point, 1] == pytest.approx(-0.05)
    assert (mesh.cell_data["J"][0] > 0).all()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--gamma", "-1"), ("gamma", "-1", "positive")),
        (("--gamma", "0"), ("gamma", "positive")),
        (("--gamma", "nan"), ("gamma", "positive")),
        (("--gamma", "soft"), ("gamma", "soft")),
        (("--alpha-r", "0"), ("alpha_r", "positive")),
        (("--beta", "-5"), ("beta", "negative")),
        (("--uy", "inf"), ("uy", "finite")),
        (("--regulariser", "nope"), ("nope", "huhu", "angle")),
        (("--regulariser", "missing.py:f"), ("missing.py",)),
        (("--regulariser", "huhu", "--param", "kappa=1"), ("huhu", "no parameters")),
        (("--param", "kappa"), ("kappa", "NAME=VALUE")),
        (("--cells", "30", "10"), ("30 cells in x", "wall", "multiple of 20")),
        (("--cells", "40", "7"), ("7 cells in y", "wall", "multiple of 5")),
        (("--cells", "0", "0"), ("cells",)),
        (("--cells", "2000000", "500000"), ("1e+12 cells", "more than 1e+06")),
        (("--cells", "40"), ("--cells",)),
        (("--l", "2"), ("cell 0", "2 spurious modes", "l >= 3")),
        (("--l", "9"), ("l = 9",)),
        (("--order", "1"), ("order k = 1",)),
        (("--steps", "0"), ("0 load steps",)),
        (("--quadrature", "1"), ("quadrature",)),
        (("--snapshots", "-1"), ("snapshots",)),
        (("--gama", "1"), ("--gama", "--gamma")),
        (("--at", "1.5"), ("output load 1.5", "from 0 to 1")),
        (("--petsc", "tmc_pc_type lu"), ("'tmc_pc_type' is not an option", "-tmc_")),
        (("--petsc", "'-tmc_pc_type lu"), ("quot",)),
        (("--petsc", "-tmc_pc_type nonsense"), ("PETSc refuses", "--petsc", "nonsense")),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    arguments: tuple[str, ...], words: tuple[str, ...], tmp_path: Path
) -> None:
    out = tmp_path / "out"
    done = tmc("run", "box", *arguments, "--out", str(out), cwd=tmp_path)
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr
    for word in words:
        assert word in done.stderr
    assert done.stdout == ""
    assert not list(tmp_path.iterdir())  # nothing half-written


def test_output_directory_that_is_a_file_is_refused(tmp_path: Path) -> None:
    target = tmp_path / "file"
    target.write_text("mine")
    done = tmc("run", "box", *SHORT, "--out", str(target))
    assert done.returncode == 2
    assert "is a file" in done.stderr
    assert target.read_text() == "mine"


def test_earlier_runs_and_other_things_are_not_replaced(tmp_path: Path) -> None:
    out = tmp_path / "box"
    assert tmc("run", "box", *SHORT, "--out", str(out), "--quiet").returncode == 0
    before = (out / "result.json").read_bytes()
    again = tmc("run", "box", *SHORT, "--out", str(out))
    assert again.returncode == 2
    assert "--overwrite" in again.stderr
    assert (out / "result.json").read_bytes() == before
    assert tmc("run", "box", *SHORT, "--uy", "-0.02", "--out", str(out), "--overwrite", "--quiet").returncode == 0
    assert json.loads((out / "result.json").read_text())["displacement"] == -0.02
    other = tmp_path / "other"
    other.mkdir()
    (other / "thesis.tex").write_text("years")
    refused = tmc("run", "box", *SHORT, "--out", str(other), "--overwrite")
    assert refused.returncode == 2
    assert (other / "thesis.tex").read_text() == "years"


def test_unreached_load_is_exit_code_3_and_keeps_what_converged(tmp_path: Path) -> None:
    out = tmp_path / "box"
    done = tmc("run", "box", *CELLS, "--uy", "-40", "--max-iterations", "60", "--out", str(out), "--quiet")
    assert done.returncode == 3, done.stderr
    assert "stopped at" in done.stderr
    result = json.loads((out / "result.json").read_text())
    assert not result["complete"]
    assert 0.0 < result["load"] < 1.0
    with (out / "history.csv").open() as file:
        assert float(list(csv.DictReader(file))[-1]["load"]) == result["load"]


def test_own_regulariser_from_a_file(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(
        "def bending(F, G, p, m):\n"
        "    skew = [G[0][1][k] - G[1][0][k] for k in (0, 1)]\n"
        "    return p.kappa / 2 * (skew[0] ** 2 + skew[1] ** 2 + G[0][0][0] ** 2 + G[1][1][1] ** 2)\n"
    )
    arguments = ("--regulariser", "mine.py:bending", "--param", "kappa=0.1")
    done = tmc("run", "box", *SHORT, *arguments, "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["inputs"]["medium"]["parameters"] == {"kappa": 0.1}


@pytest.mark.parametrize("method", ["vem", "fem"])
@pytest.mark.parametrize(
    ("psi", "words"),
    [
        ("p.w * G[0][0][0] ** 2", ("p.w", "--param w=VALUE")),
        ("math.sqrt(G[0][0][0])", ("m.sqrt",)),
        ("m.root(G[0][0][0])", ("m.root", "m.sqrt")),
        ("G[0][0][0] / 0", ("'faulty'", "divides by zero")),
        ("m.sqrt(F[0][0] - 2)", ("energy of region 'medium'", "codegen FILE.py:FUNCTION --check")),
        ("m.sqrt(G[0][0][0] ** 2 + G[0][0][1] ** 2)", ("the stress", "undeformed")),
    ],
)
def test_faulty_regularisers_are_refused_in_words(
    method: str, psi: str, words: tuple[str, ...], tmp_path: Path
) -> None:
    (tmp_path / "mine.py").write_text(f"import math\n\n\ndef faulty(F, G, p, m):\n    return {psi}\n")
    done = tmc("run", "box", *SHORT, "--method", method, "--regulariser", "mine.py:faulty", "--quiet", cwd=tmp_path)
    assert done.returncode == 2, done.stderr
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr
    for word in words:
        assert word in done.stderr


def test_two_ranks_print_once_and_write_pieces(tmp_path: Path) -> None:
    out = tmp_path / "box"
    done = tmc("run", "box", *SHORT, "--steps", "1", "--snapshots", "1", "--json", "--out", str(out), ranks=2)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["versions"]["ranks"] == 2
    assert len(list(out.glob("fields/*.vtu"))) == 2
    assert (out / "deformed.png").exists()


def test_summary_on_two_ranks_has_no_codes_for_a_terminal() -> None:
    done = tmc("run", "box", *SHORT, "--steps", "1", ranks=2)
    assert done.returncode == 0, done.stderr
    assert "reaction" in done.stdout
    assert "\x1b" not in done.stdout


@pytest.mark.parametrize(
    "arguments",
    [
        ("cbox", "--uy", "-0.01"),
        ("punch", "--size", "0.25", "--uy", "-0.01"),
        ("bodies", "--size", "0.15", "--uy", "0.01"),
    ],
)
def test_every_benchmark_has_a_mesh_for_finite_elements(arguments: tuple[str, ...]) -> None:
    done = tmc("run", *arguments, "--method", "fem", "--steps", "1", "--json")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert (result["complete"], result["inputs"]["method"]) == (True, "fem")


def test_bad_input_on_two_ranks_is_said_once() -> None:
    done = tmc("run", "box", "--l", "2", ranks=2)
    assert done.returncode != 0
    assert done.stderr.count("spurious modes") == 1


@pytest.mark.parametrize("arguments", [("--help",), ("run", "--help"), ("run", "box", "--help"), ("codegen", "--help")])
def test_help_pages(arguments: tuple[str, ...]) -> None:
    done = tmc(*arguments)
    assert done.returncode == 0
    assert "Usage: tmc-vem" in done.stdout


def test_info_names_versions() -> None:
    done = tmc("info")
    assert done.returncode == 0, done.stderr
    for name in ("tmc-vem", "petsc", "C compiler"):
        assert name in done.stdout
