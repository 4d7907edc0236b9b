"""The comparison with other programs: our density file is their energy, and tables say what runs have said.

Nothing here needs the others, and nothing is timed.
"""

from __future__ import annotations

import copy
import importlib
import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from codegen.kernel import compile_energy
from codegen.tensors import stress_and_moduli
from codegen.userfile import load_density
from tmc_vem.mesh.cells import centroids_and_areas

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
PARAMETERS = {"mu": 5.0 / 14.0, "lmbda": 5.0 / 3.0, "gamma": 0.05, "alpha_r": 0.3}


@pytest.fixture
def module(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], ModuleType]]:
    """Imports a benchmark by its name, and forgets it and its neighbours afterwards."""
    before = set(sys.modules)
    monkeypatch.syspath_prepend(str(BENCHMARKS / "peers"))
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    yield importlib.import_module
    for name in set(sys.modules) - before:
        if str(getattr(sys.modules[name], "__file__", "")).startswith(str(BENCHMARKS)):
            del sys.modules[name]


# ---- Energy ---------------------------------------------------------------------------------------------------------


def states(n: int = 300) -> tuple[Any, Any]:
    """Random F (n, 2, 2) with J from 0.1 on, and G (n, 2, 2, 2)."""
    generator = np.random.default_rng(7)
    F = np.eye(2) + 0.6 * generator.uniform(-1, 1, (3 * n, 2, 2))
    F = F[np.linalg.det(F) > 0.1][:n]
    return F, generator.normal(size=(len(F), 2, 2, 2))


def in_space(F_nij: Any) -> Any:
    """(n, 3, 3) with the third direction of plane strain."""
    F = np.zeros((len(F_nij), 3, 3))
    F[:, :2, :2], F[:, 2, 2] = F_nij, 1.0
    return F


def neo_hooke(F_nij: Any) -> tuple[Any, Any]:
    """Energies and first Piola-Kirchhoff stresses of the compressible neo-Hookean solid, by matrices of space."""
    F, mu, lmbda = in_space(F_nij), PARAMETERS["mu"], PARAMETERS["lmbda"]
    trace_c = np.trace(F.transpose(0, 2, 1) @ F, axis1=1, axis2=2)
    log_j = np.linalg.slogdet(F)[1]
    inverse = np.linalg.inv(F).transpose(0, 2, 1)
    P = mu * (F - inverse) + lmbda * log_j[:, None, None] * inverse
    return mu * (trace_c - 3) / 2 - mu * log_j + lmbda * log_j**2 / 2, P[:, :2, :2]


@pytest.mark.parametrize("name", ["solid", "medium"])
def test_the_density_file_is_felupes_energy(name: str) -> None:
    F, G = states()
    loaded = load_density(f"{BENCHMARKS / 'peers' / 'cbox_energy.py'}:{name}")
    values = {key: PARAMETERS[key] for key in loaded.parameters}
    kernel = compile_energy(loaded.function, loaded.name, tuple(values))
    found = stress_and_moduli(kernel, F, G, values)
    psi, P = neo_hooke(F)
    T = np.zeros_like(G)
    if name == "medium":
        traces = np.einsum("nijj->ni", G)
        psi = PARAMETERS["gamma"] * psi + PARAMETERS["alpha_r"] / 2 * (
            np.einsum("nijk,nijk->n", G, G) - (traces**2).sum(axis=1) / 2
        )
        P = PARAMETERS["gamma"] * P
        T = PARAMETERS["alpha_r"] * (G - np.einsum("ni,jk->nijk", traces, np.eye(2)) / 2)
    np.testing.assert_allclose(found.psi_n, psi, rtol=1e-12, atol=1e-12 * np.abs(psi).max())
    np.testing.assert_allclose(
        found.P_n4.reshape(-1, 2, 2).transpose(0, 2, 1), P, rtol=1e-12, atol=1e-12 * np.abs(P).max()
    )
    np.testing.assert_allclose(found.T_n8.reshape(-1, 2, 2, 2).transpose(0, 3, 2, 1), T, rtol=1e-12, atol=1e-12)


def test_the_problem_file_has_the_regions_of_the_c(module: Callable[[str], ModuleType], tmp_path: Path) -> None:
    problem, cells = module("peer_problems").CBox(), (24, 12)
    made = module("with_tmc_vem").cbox(problem, cells, tmp_path)
    mesh = made.make_mesh()
    area_c = centroids_and_areas(mesh)[1]
    area = {name: area_c[mesh.region_c == n].sum() for n, name in enumerate(mesh.region_names)}
    assert mesh.n_cells == 24 * 12
    assert area["solid"] == pytest.approx(1.0 * 0.5 - 0.9 * 0.3, rel=1e-12)
    assert area["medium"] == pytest.approx(1.1 * 0.5 - area["solid"], rel=1e-12)
    assert made.regions()["medium"].values["alpha_r"] == problem.alpha_r
    assert made.regions()["medium"].is_medium


@pytest.mark.parametrize("cells", [(12, 12), (10, 5), (6, 3)])
def test_meshes_that_do_not_resolve_the_wall_are_refused(
    module: Callable[[str], ModuleType], cells: tuple[int, int]
) -> None:
    with pytest.raises(SystemExit, match=f"cells {cells[0]} x {cells[1]}: use a multiple of 12 x 6"):
        module("peer_problems").CBox().lines(cells)


# ---- Tables ---------------------------------------------------------------------------------------------------------


def said(setup: float, run: float, **more: Any) -> dict[str, Any]:
    """What a run says; wall times are twice the processor times, half of the run is the linear solver."""
    compilation = more.pop("compilation", None)
    parts = {"start-up": 0.5, "set-up": setup, "run": run, "linear solve": run / 2}
    if compilation is not None:
        parts |= {"compilation": compilation, "set-up": setup + compilation}
    found = {"unknowns": 650, "steps": 20, "attempts": 20, "iterations": 50, "residual": 2e-9, "reaction": -6.75e-4}
    seconds = {name: {"cpu": value, "wall": 2 * value} for name, value in parts.items()}
    return {**found, "versions": {"other": "1.2"}, **more, "seconds": seconds}


@pytest.fixture
def recorded(module: Callable[[str], ModuleType]) -> dict[str, Any]:
    tables = module("peer_tables")

    def run(problem: str, program: str, cells: tuple[int, int], stepping: str, samples: list[Any]) -> dict[str, Any]:
        return {"problem": problem, "program": program, "cells": cells, "stepping": stepping, "samples": samples}

    runs = [
        run("cbox", tables.FIRST, (12, 6), tables.EQUAL, [said(0.1, 0.9), said(0.1, 1.9), said(0.1, 5.9)]),
        run("cbox", tables.FIRST, (12, 6), tables.OWN, [said(0.1, 0.4)]),
        run("cbox", "other", (12, 6), tables.EQUAL, [said(1.0, 11.0, steps=22, attempts=23, iterations=100)]),
        run("cbox", "broken", (12, 6), tables.EQUAL, []),
        run("cbox", tables.FIRST, (48, 24), tables.EQUAL, [said(0.1, 0.9, phases={"solve": 3.0, "total": 4.0})]),
        run("box", tables.FIRST, (20, 10), tables.OWN, [said(0.5, 0.5)]),
        run("box", "compiled", (20, 10), tables.OWN, [said(0.25, 4.75, compilation=16.0)]),
    ]
    same = dict.fromkeys(("density", "stress", "energy", "forces", "displacement", "reaction"), 3e-14)
    return {
        "machine": {"processor": "P", "stack": "PETSc 3"},
        "runs": json.loads(json.dumps(runs)),
        "first_start": {f"cbox, {tables.FIRST}": 5.0},
        "same": same,
        "left_out": {"missing": "no wheel"},
    }


def columns(tables: ModuleType, row: tuple[str, ...]) -> dict[str, str]:
    return dict(zip(tables.COLUMNS, row, strict=True))


def test_rows_have_medians_and_ratios_to_the_same_steps(
    module: Callable[[str], ModuleType], recorded: dict[str, Any]
) -> None:
    tables = module("peer_tables")
    # the broken one is not there
    ours, own, other, finest = (columns(tables, row) for row in tables.rows(recorded, "cbox"))
    assert (finest["cells"], finest["ratio"]) == ("48 x 24", "1.0")
    assert (ours["seconds"], ours["ratio"], ours["wall"], ours["ms each"]) == ("2.00", "1.0", "4.00", "38.0")
    assert (own["seconds"], own["ratio"], own["load steps"]) == ("0.50", "0.2", "20, automatic")
    assert (other["seconds"], other["ratio"], other["solver"]) == ("12.00", "6.0", "50 %")
    assert (other["load steps"], other["iterations"]) == ("22, 20 equal, 1 failed", "100")


def test_compilation_in_a_run_is_no_time_of_the_run(
    module: Callable[[str], ModuleType], recorded: dict[str, Any]
) -> None:
    tables = module("peer_tables")
    _, compiled = (columns(tables, row) for row in tables.rows(recorded, "box"))
    assert (compiled["seconds"], compiled["ratio"], compiled["wall"]) == ("5.00", "5.0", "10.00")
    starts = {row[0]: row[1:] for row in tables.starts(recorded)}
    assert starts["box, compiled"] == ("1.00 s", "32.0 s, in every run")
    assert starts[f"cbox, {tables.FIRST}"] == ("1.00 s", "4.0 s, once")
    assert starts["cbox, other"] == ("1.00 s", "none")


def test_phases_are_those_of_the_finest_mesh(module: Callable[[str], ModuleType], recorded: dict[str, Any]) -> None:
    tables = module("peer_tables")
    assert tables.phases(recorded) == [("solve", "3.000 s", "75 %"), ("total", "4.000 s", "100 %")]
    assert tables.phases({**recorded, "runs": recorded["runs"][:1]}) == []


def test_a_mesh_without_our_run_has_no_ratio(module: Callable[[str], ModuleType], recorded: dict[str, Any]) -> None:
    tables, without = module("peer_tables"), copy.deepcopy(recorded)
    without["runs"][0]["samples"] = []
    assert [columns(tables, row)["ratio"] for row in tables.rows(without, "cbox")] == ["", "", "1.0"]


def test_the_page_has_a_place_for_every_part(
    module: Callable[[str], ModuleType], recorded: dict[str, Any], tmp_path: Path
) -> None:
    tables, page = module("peer_tables"), tmp_path / "peers.md"
    page.write_text(tables.PAGE.read_text())
    fill = module("page_parts").fill
    fill(page, tables.parts(recorded))
    text = page.read_text()
    assert "| other | 22, 20 equal, 1 failed | 12 x 6 |" in text
    assert "P; PETSc 3; other 1.2. Left out: missing (no wheel)." in text
    fill(page, tables.parts(recorded))
    assert page.read_text() == text
    with pytest.raises(SystemExit, match="has no place for somewhere"):
        fill(page, {"peers_box": str, "somewhere": str})
    assert page.read_text() == text


def test_without_felupe_nothing_is_said_of_its_energies(
    module: Callable[[str], ModuleType], recorded: dict[str, Any]
) -> None:
    tables = module("peer_tables")
    assert tables.same({**recorded, "same": {}}) == "FElupe was left out."


# ---- Runs -----------------------------------------------------------------------------------------------------------


def test_a_program_that_fails_is_left_out_and_the_others_go_on(
    module: Callable[[str], ModuleType], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = module("peer_runs")
    asked: list[list[str]] = []

    def start(script: str, arguments: list[str], *, peer: bool) -> subprocess.CompletedProcess[str]:
        asked.append([script, *arguments])
        if script == "broken.py":
            return subprocess.CompletedProcess([], 1, "", "Traceback\nImportError: no module\n")
        line = json.dumps({**said(0.1, 0.9), "loads": [0.25, 1.0]})
        return subprocess.CompletedProcess([], 0, f"talk\n{line}\n", "")

    monkeypatch.setattr(runs, "start", start)
    ours = runs.Entry("box", "tmc-vem", (20, 10), "ours.py")
    broken = runs.Entry("box", "broken", (20, 10), "broken.py", group="broken")
    other = runs.Entry("box", "other", (20, 10), "other.py", ("--fast",), "ngsolve")
    runs.rounds([ours, broken, other], 3, float("inf"))
    assert [len(entry.samples) for entry in (ours, broken, other)] == [3, 0, 3]
    assert [call[0] for call in asked].count("broken.py") == 1
    assert "left out: box, broken" in capsys.readouterr().out
    assert broken.failure == "ImportError: no module"
    assert asked[2] == ["other.py", "--fast", "--cells", "20", "10", "--loads", "0.25", "1.0"]


def test_slow_programs_run_in_every_second_round_and_nothing_after_the_limit(
    module: Callable[[str], ModuleType], monkeypatch: pytest.MonkeyPatch
) -> None:
    runs = module("peer_runs")

    class Slow(runs.Entry):  # type: ignore[misc, name-defined]
        def run(self, more: Any = ()) -> dict[str, Any]:
            self.wall = runs.SLOW + 1.0
            return said(0.1, 0.9)

    def entry() -> Any:
        return Slow("cbox", "other", (12, 6), "other.py", (), "felupe")

    first, second = entry(), entry()
    runs.rounds([first], 5, float("inf"))
    assert len(first.samples) == 3
    runs.rounds([second], 5, 0.0)
    assert len(second.samples) == 1  # the first round is always done


def test_requirements_are_pinned_in_groups(module: Callable[[str], ModuleType]) -> None:
    environment = module("peer_environment")
    groups = environment.groups(environment.REQUIREMENTS.read_text())
    assert set(groups) == {entry.group for entry in module("peer_runs").entries()} - {""}
    assert all("==" in line for lines in groups.values() for line in lines)


def test_a_group_that_cannot_be_installed_is_named_with_the_reason(
    module: Callable[[str], ModuleType], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    environment = module("peer_environment")
    asked: list[str] = []

    def install(wanted: list[str]) -> str:
        asked.extend(wanted)
        return "ERROR: no such version" if any(line.startswith("felupe") for line in wanted) else ""

    monkeypatch.setattr(environment, "_install", install)
    monkeypatch.setattr(environment, "ENVIRONMENT", tmp_path)
    assert environment.installed() == {"felupe": "ERROR: no such version"}
    asked.clear()
    assert environment.installed() == {"felupe": "ERROR: no such version"}  # is tried again; what is there is not
    assert asked
    assert not any(line.startswith("ngsolve") for line in asked)
