"""Every option has an effect: of the command line on what is run, of a problem on mesh and energies, of a run on its
result. The lists are complete, so that a new option needs an entry here."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from helpers_blocks import blocks

from tmc_vem import Box, Medium, RunOptions, RunResult, run
from tmc_vem.cli import run as commands
from tmc_vem.cli import run_file
from tmc_vem.mesh.geometry import areas
from tmc_vem.problems import Bodies, CBox, Material, Problem, Punch
from tmc_vem.problems.base import medium_region
from tmc_vem.simulation import discretise, run_inputs
from tmc_vem.simulation.adapt_settings import AdaptSettings
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.support.petsc import PETSc
from tmc_vem.system.fem_settings import FemSettings
from tmc_vem.vem.spaces.element_settings import ElementSettings

# -- the command line ------------------------------------------------------------------------------------------------

# option and value -> where it must arrive
MEDIUM = [
    (("--gamma", "3e-4"), "problem.medium.gamma", 3e-4),
    (("--medium-energy", "balanced"), "problem.medium.energy", "balanced"),
    (("--log-j", "0.1"), "problem.medium.log_j", 0.1),
    (("--friction", "0.3"), "problem.medium.friction", 0.3),
    (("--elastic-slip", "0.1"), "problem.medium.elastic_slip", 0.1),
    (("--alpha-r", "0.3"), "problem.medium.alpha_r", 0.3),
    (("--alpha", "2.5"), "problem.medium.alpha", 2.5),
    (("--beta", "1.5"), "problem.medium.beta", 1.5),
    (("--regulariser", "huhu"), "problem.medium.regulariser", "huhu"),
    (("--regulariser", "{own}:bending", "--param", "kappa=0.2"), "problem.medium.parameters", {"kappa": 0.2}),
]
METHOD = [
    (("--steps", "7"), "settings.steps", 7),
    (("--path", "0 1 0.5"), "settings.path", (0.0, 1.0, 0.5)),
    (("--at", "0.25", "--at", "0.5"), "settings.output_loads", (0.25, 0.5)),
    (("--continuation", "gamma=1e-3"), "settings.continuation", {"gamma": 1e-3}),
    (("--follow",), "settings.follow", True),
    (("--extrapolate-gamma",), "settings.extrapolate_gamma", True),
    (("--extrapolate-gamma", "path"), "settings.extrapolate_gamma", "path"),
    (("--gamma-decades", "3"), "settings.gamma_decades", 3),
    (("--adapt", "gap, reaction"), "settings.adapt.of", "gap, reaction"),
    (("--adapt-tolerance", "0.5%", "--adapt", "gap"), "settings.adapt.tolerance", "0.5%"),
    (("--adapt-rounds", "3", "--adapt", "gap"), "settings.adapt.rounds", 3),
    (("--adapt-at", "0.5", "--adapt-at", "1", "--adapt", "gap"), "settings.adapt.at", (0.5, 1.0)),
    (("--adapt-estimator", "recovery", "--adapt", "gap"), "settings.adapt.estimator", "recovery"),
    (("--adapt-meshes", "anew", "--adapt", "gap"), "settings.adapt.meshes", "anew"),
    (("--adapt-cells", "1000", "--adapt", "gap"), "settings.adapt.cells", 1000),
    (("--friction-error", "0.02"), "settings.friction_error", 0.02),
    (("--allow-overlap",), "settings.allow_overlap", True),
    (("--max-iterations", "9"), "settings.max_iterations", 9),
    (("--max-seconds", "2.5"), "settings.max_seconds", 2.5),
    (("--method", "fem"), "settings.method", "fem"),
    (("--order", "3"), "settings.element.order", 3),
    (("--l", "4"), "settings.element.degree", 4),
    (("--projection", "composite"), "settings.element.projection", "composite"),
    (("--rule", "triangles"), "settings.element.rule", "triangles"),
    (("--quadrature", "7"), "settings.element.quadrature", 7),
    (("--method", "fem", "--order", "3"), "settings.fem.order", 3),
    (("--method", "fem", "--quadrature", "7"), "settings.fem.quadrature", 7),
    (("--method", "fem", "--interior-penalty", "full"), "settings.fem.interior_penalty", "full"),
    (("--method", "fem", "--eta", "3"), "settings.fem.eta", 3.0),
    (("--interior-penalty", "penalty"), "settings.element.interior_penalty", "penalty"),
    (("--eta", "3"), "settings.element.eta", 3.0),
    (("--method", "fem", "--triangles"), "settings.fem.triangles", True),
    (("--checkpoint-every", "5"), "settings.checkpoint_every", 5),
    (("--snapshots", "3"), "settings.snapshots", 3),
    (("--triangulated",), "settings.triangulated", True),
    (("--fields", "J, von_mises"), "settings.fields", "J, von_mises"),
    (("--solver", "iterative"), "settings.solver", "iterative"),
    (("--overwrite",), "settings.overwrite", True),
    (("--out", "somewhere"), "options.out", Path("somewhere")),
    (("--json",), "options.as_json", True),
    (("--quiet",), "options.quiet", True),
    (("--petsc", "-tmc_ksp_rtol 1e-10"), "options.petsc", "-tmc_ksp_rtol 1e-10"),
]
OWN = {
    "box": [
        (("--cells", "20", "5"), "problem.cells", (20, 5)),
        (("--mesh", "voronoi"), "problem.cell_kind", "voronoi"),
        (("--refine-medium", "2"), "problem.medium_refinement", 2),
        (("--uy", "-0.3"), "problem.uy", -0.3),
    ],
    "cbox": [
        (("--cells", "10", "5"), "problem.cells", (10, 5)),
        (("--mesh", "quadrilaterals"), "problem.solid_cells", "quadrilaterals"),
        (("--method", "fem"), "problem.solid_cells", "quadrilaterals"),
        (("--refine-medium", "2"), "problem.medium_refinement", 2),
        (("--uy", "-0.3"), "problem.uy", -0.3),
    ],
    "punch": [
        (("--size", "0.2"), "problem.size", 0.2),
        (("--stiffness", "100"), "problem.stiffness", 100.0),
        (("--gap0", "0.7"), "problem.gap0", 0.7),
        (("--uy", "-0.3"), "problem.uy", -0.3),
    ],
    "bodies": [
        (("--case", "2"), "problem.case", 2),
        (("--size", "0.15"), "problem.size", 0.15),
        (("--discs", "3"), "problem.discs", 3),
        (("--gap0", "0.2"), "problem.gap0", 0.2),
        (("--uy", "0.2"), "problem.uy", 0.2),
    ],
}
BENDING = "def bending(F, G, p, m):\n    return p.kappa * G[0][1][1] ** 2 / 2\n"


def asked(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> dict[str, Any]:
    """What ``tmc-vem run`` with these arguments would execute."""
    kept: dict[str, Any] = {}

    def keep(problem: Any, settings: Any, options: Mapping[str, Any]) -> None:
        kept.update(problem=problem, settings=settings, options=SimpleNamespace(**options))

    for module in (commands, run_file):
        monkeypatch.setattr(module, "execute", keep)
    commands.run_group.main(list(arguments), standalone_mode=False)
    return kept


def attribute(found: Mapping[str, Any], name: str) -> Any:
    first, *path = name.split(".")
    value = found[first]
    for part in path:
        value = getattr(value, part)
    return value


@pytest.mark.parametrize("command", OWN)
def test_options_of_a_benchmark_arrive(command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own = tmp_path / "own.py"
    own.write_text(BENDING)
    usual = asked(monkeypatch, command)
    named = set()
    for words, where, value in (*MEDIUM, *METHOD, *OWN[command]):
        words = tuple(word.format(own=own) for word in words)
        found = asked(monkeypatch, command, *words)
        if command in ("punch", "bodies") and "fem" in words:
            found["problem"] = found["problem"].problem  # on triangles
        assert attribute(found, where) == value, words
        assert attribute(usual, where) != value, words
        named |= {word for word in words if word.startswith("--")}
    assert named == {name for parameter in commands.run_group.commands[command].params for name in parameter.opts}


def test_options_beside_a_problem_file_arrive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = str(blocks(tmp_path))
    usual = asked(monkeypatch, path)
    command = commands.run_group.get_command(None, path)  # type: ignore[arg-type]
    assert command is not None
    names = {name for parameter in command.params for name in parameter.opts}
    chosen = [
        entry for entry in METHOD if entry[0][0] in names and len({*entry[0]} & {"--method"} - {entry[0][0]}) == 0
    ]
    chosen = [entry for entry in chosen if entry[0][0] != "--method" or len(entry[0]) == 2]
    for words, where, value in chosen:
        found = asked(monkeypatch, path, *words)
        assert attribute(found, where) == value, words
        assert attribute(usual, where) != value, words
    triangles = asked(monkeypatch, path, "--method", "fem", "--triangles")
    assert (attribute(triangles, "settings.fem.triangles"), attribute(usual, "settings.fem.triangles")) == (True, False)
    further = asked(monkeypatch, path, "--set", "load.uy=-0.125")
    assert (further["problem"].load().value, usual["problem"].load().value) == (-0.125, -0.25)
    assert {entry[0][0] for entry in chosen} | {"--triangles", "--set"} == names


# -- problems --------------------------------------------------------------------------------------------------------

PROBLEMS: dict[str, tuple[Problem, dict[str, Any]]] = {
    "box": (
        Box(cells=(20, 5)),
        {"cells": (40, 5), "medium": Medium(gamma=1e-3), "material": Material(20.0, 9.0), "uy": -0.5, "length": 1.0,
         "height": 0.25, "wall": 0.2, "medium_refinement": 2, "cell_kind": "voronoi"},
    ),
    "cbox": (
        CBox(cells=(10, 5)),
        {"cells": (20, 5), "medium_refinement": 2, "solid_cells": "quadrilaterals", "medium": Medium(gamma=1e-3),
         "material": Material(1.0, 1.0), "uy": -0.3, "length": 0.5, "height": 0.25, "wall": 0.2, "polygons_across": 4,
         "column_cells": 2},
    ),
    "punch": (
        Punch(size=0.2),
        {"size": 0.15, "stiffness": 2.0, "gap0": 0.7, "medium": Medium(gamma=1e-3), "material": Material(1.0, 1.0),
         "uy": -0.3, "width": 2.5, "height": 1.5, "radius": 1.2},
    ),
    "bodies": (
        Bodies(discs=1, length=2.0),
        {"case": 2, "size": 0.08, "discs": 2, "gap0": 0.15, "medium": Medium(gamma=1e-3), "beam": Material(50.0, 9.0),
         "disc": Material(5e4, 9e3), "uy": 0.2, "length": 2.5, "thickness": 0.3, "radius": 0.3},
    ),
}  # fmt: skip
ONLY_ENERGIES = ("medium", "material", "beam", "disc", "stiffness", "uy", "case")


def mesh_of(problem: Problem) -> tuple[Any, ...]:
    mesh = problem.make_mesh()
    total = [0.0] * len(mesh.region_names)
    for loop, region in zip(mesh.cells(), mesh.region_c, strict=True):
        total[region] += float(areas(mesh.points_vx[loop][None])[0])
    return mesh.n_cells, mesh.n_vertices, *np.round(total, 9).tolist()


def energies_of(problem: Problem) -> tuple[Any, ...]:
    regions = {n: (*made_of(r), r.hold) for n, r in problem.regions().items()}
    return regions, list(problem.prescribed())


@pytest.mark.parametrize("name", PROBLEMS)
def test_every_parameter_of_a_problem_changes_mesh_or_energies_and_is_recorded(name: str) -> None:
    problem, changes = PROBLEMS[name]
    assert set(changes) == {entry.name for entry in dataclasses.fields(problem)}  # type: ignore[arg-type]
    mesh, energies = mesh_of(problem), energies_of(problem)
    for key, value in changes.items():
        other = dataclasses.replace(problem, **{key: value})  # type: ignore[type-var]
        assert other.inputs() != problem.inputs(), key
        if key in ONLY_ENERGIES:
            assert energies_of(other) != energies, key
        else:
            assert mesh_of(other) != mesh, key


def made_of(region: Any) -> tuple[Any, ...]:
    return region.energy.name, dict(region.values), region.friction


def test_every_parameter_of_a_medium_changes_its_energy(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(BENDING)
    own = f"{tmp_path}/own.py:bending"
    usual: dict[str, Any] = {"gamma": 1e-5, "alpha_r": 1.0, "beta": 5.0, "regulariser": own, "parameters": {"kappa": 1},
                             "friction": 0.2}  # fmt: skip
    changes: dict[str, dict[str, Any]] = {
        "gamma": {"gamma": 1e-4}, "alpha_r": {"alpha_r": 2.0}, "beta": {"beta": 0.0},
        "regulariser": {"regulariser": "angle", "parameters": {}}, "parameters": {"parameters": {"kappa": 2.0}},
        "alpha": {"alpha_r": None, "alpha": 2.5}, "energy": {"energy": "balanced"},
        "log_j": {"log_j": 0.1}, "friction": {"friction": 0.1}, "elastic_slip": {"elastic_slip": 0.1},
    }  # fmt: skip
    assert set(changes) == {entry.name for entry in dataclasses.fields(Medium)}
    before = medium_region(Medium(**usual), 3.0, 0.5)
    for key, change in changes.items():
        after = medium_region(Medium(**{**usual, **change}), 3.0, 0.5)
        assert made_of(after) != made_of(before), key
    with_alpha = medium_region(Medium(**{**usual, "alpha_r": None, "alpha": 2.5}), 3.0, 0.5)
    assert with_alpha.values["alpha_r"] == pytest.approx(2.5 * 3.0 * 0.25)


# -- problem files ---------------------------------------------------------------------------------------------------

FILE = """
name = "frame"
gap = ["top", "bottom"]
[shapes]
outer = { rectangle = [0, 0, 2, 1] }
hole = { disc = [1, 0.5, 0.2] }
[regions.frame]
shape = "outer - hole"
solid = { K = 20, mu = 10 }
[regions.medium]
shape = "hole"
medium = { gamma = 1e-4, mu = 10 }
[mesh]
size = 0.15
refine = [{ near = [1, 1], size = 0.08 }]
[points]
top = [1, 0.7]
bottom = [1, 0.3]
pushed = [1, 1]
[edges]
foot = { line = [[0, 0], [2, 0]] }
[[support]]
at = "foot"
ux = 0
uy = 0
[load]
at = "pushed"
uy = -0.1
[probes.more]
displacement = "ux"
at = "top"
"""
# what is replaced -> by what
IN_FILES = {
    "rectangle": ("[0, 0, 2, 1]", "[0, 0, 2.2, 1]"),
    "polygon": ("{ rectangle = [0, 0, 2, 1] }", "{ polygon = [[0, 0], [2.2, 0], [2, 1], [0, 1]] }"),
    "disc": ("{ disc = [1, 0.5, 0.2] }", "{ rectangle = [0.8, 0.3, 1.2, 0.7] }"),
    "rounded": ("[0, 0, 2, 1] }", "[0, 0, 2, 1], rounded = 0.2 }"),
    "near": ("near = [1, 1]", "near = [[0.5, 1], [1.5, 1]]"),
    "size near": ("size = 0.08", "size = 0.06"),
    "within": ("size = 0.08", "size = 0.08, within = 0.3"),
    "size": ("size = 0.15", "size = 0.12"),
    "growth": ("size = 0.15", "size = 0.15\ngrowth = 0.1"),
    "cells": ("size = 0.15", 'size = 0.15\ncells = "triangles"'),
    "K": ("K = 20", "K = 21"),
    "mu of the solid": ("K = 20, mu = 10", "K = 20, mu = 11"),
    "density": ("solid = { K = 20, mu = 10 }", 'density = "own.py:stiff"\nparameters = { k = 3 }'),
    "hold": ("solid = { K = 20, mu = 10 }", 'solid = { K = 20, mu = 10 }\nhold = "medium"'),
    "gamma": ("gamma = 1e-4", "gamma = 1e-3"),
    "alpha_r": ("gamma = 1e-4", "gamma = 1e-4, alpha_r = 2"),
    "alpha": ("gamma = 1e-4", "gamma = 1e-4, alpha = 2.5"),
    "h": ("gamma = 1e-4", "gamma = 1e-4, alpha = 2.5, h = 0.2"),
    "beta": ("gamma = 1e-4", "gamma = 1e-4, beta = 3"),
    "regulariser": ("gamma = 1e-4", 'gamma = 1e-4, regulariser = "huhu"'),
    "energy": ("gamma = 1e-4", 'gamma = 1e-4, energy = "balanced"'),
    "log_j": ("gamma = 1e-4", "gamma = 1e-4, log_j = 0.1"),
    "friction": ("gamma = 1e-4", "gamma = 1e-4, friction = 0.3"),
    "elastic_slip": ("gamma = 1e-4", "gamma = 1e-4, friction = 0.3, elastic_slip = 0.1"),
    "parameters": ("gamma = 1e-4", 'gamma = 1e-4, regulariser = "own.py:bending", parameters = { kappa = 2 }'),
    "mu of the medium": ("1e-4, mu = 10", "1e-4, mu = 3"),
    "line": ("{ line = [[0, 0], [2, 0]] }", "{ line = [[0, 0], [0, 1]] }"),
    "box": ("{ line = [[0, 0], [2, 0]] }", "{ box = [0, 0, 1, 0] }"),
    "circle": ("{ line = [[0, 0], [2, 0]] }", '{ circle = [1, 0.5, 0.2], between = ["frame", "medium"] }'),
    "between": ("{ line = [[0, 0], [2, 0]] }", '{ between = ["frame", "medium"] }'),
    "ux": ("ux = 0\n", "ux = 0.1\n"),
    "uy": ("uy = -0.1", "uy = -0.2"),
    "at": ('at = "pushed"', 'at = "top"'),
    "points": ("top = [1, 0.7]", "top = [1.2, 0.5]"),
    "gap": ('gap = ["top", "bottom"]', 'gap = ["pushed", "bottom"]'),
    "displacement": ('displacement = "ux"', 'displacement = "uy"'),
    "position": ('displacement = "ux"', 'position = "x"'),
    "probe's gap": ('displacement = "ux"\nat = "top"', 'gap = ["top", "pushed"]'),
    "reaction": ('displacement = "ux"\nat = "top"', 'reaction = "uy"\nat = "foot"'),
    "mean": ('displacement = "ux"\nat = "top"', 'mean = "J"\nregion = "medium"'),
    "units": ("[edges]", '[units]\nlength = "mm"\nforce = "N"\n[edges]'),
}
STIFF = "def stiff(F, G, p, m):\n    J = F[0][0] * F[1][1] - F[0][1] * F[1][0]\n    return p.k * (J - 1) ** 2\n"


def problem_of(text: str, directory: Path) -> Problem:
    (directory / "problem.toml").write_text(text)
    return read_problem(directory / "problem.toml")[0]


def without_mesh(problem: Problem) -> tuple[Any, ...]:
    return energies_of(problem), problem.probes(), problem.units()


def with_mesh(problem: Problem) -> tuple[Any, ...]:
    """Cells and areas, and where named points and edges are."""
    mesh = problem.make_mesh()
    places = {name: mesh.points_vx[v].round(9).tolist() for name, v in mesh.named_points.items()}
    foot = np.round(np.sort(mesh.points_vx[mesh.named_edges["foot"]].reshape(-1, 2), axis=0), 9).tolist()
    return mesh_of(problem), places, foot


def test_every_entry_of_a_problem_file_has_an_effect(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(BENDING + STIFF)
    usual = problem_of(FILE, tmp_path)
    parts, mesh = without_mesh(usual), with_mesh(usual)
    for name, (old, new) in IN_FILES.items():
        assert FILE.count(old) == 1, name
        other = problem_of(FILE.replace(old, new), tmp_path)
        assert without_mesh(other) != parts or with_mesh(other) != mesh, name
        assert run_inputs(other, RunOptions()) != run_inputs(usual, RunOptions()), name


# -- runs ------------------------------------------------------------------------------------------------------------

BOX = Box(cells=(20, 5), uy=-0.05, medium=Medium(gamma=1e-4))


def loads(result: RunResult) -> list[float]:
    return [step.load for step in result.history]


@pytest.fixture(scope="module")
def usual() -> RunResult:
    return run(BOX, None, RunOptions(steps=2))


# option -> (its value, with what, what the result must be)
IN_MEMORY: dict[str, tuple[Any, Mapping[str, Any], Any]] = {
    "steps": (5, {}, lambda r: loads(r) == pytest.approx([0.2, 0.4, 0.6, 0.8, 1.0])),
    "largest_step": (0.04, {"steps": None}, lambda r: np.diff([0.0, *loads(r)]).max() <= 1.3 * 0.04),
    "solver": ("iterative", {}, lambda r: r.parallel["linear_iterations"] > 3 * r.newton_iterations),
    "path": ((0.0, 1.0, 0.0), {}, lambda r: loads(r) == pytest.approx([0.5, 1.0, 0.5, 0.0], abs=1e-12)),
    "output_loads": ((0.3,), {}, lambda r: loads(r) == pytest.approx([0.3, 0.5, 1.0])),
    "continuation": ({"gamma": 1e-3}, {}, lambda r: r.history[0].parameters == {"gamma": 1e-3}),
    "follow": (True, {"steps": None}, lambda r: abs(r.history[1].time - r.history[1].load) > 1e-3),
    "max_iterations": (4, {}, lambda r: not r.complete and r.newton_iterations <= 5),
    "max_seconds": (1e-6, {}, lambda r: not r.complete and "seconds" in r.reason),
    "extrapolate_gamma": (True, {}, lambda r: r.limit is not None and len(r.limit.gammas) == 3),
    "gamma_decades": (3, {"extrapolate_gamma": True}, lambda r: r.limit is not None and len(r.limit.gammas) == 4),
    "allow_overlap": (True, {}, lambda r: r.inputs["allow_overlap"]),
    "element": (ElementSettings(order=3), {}, lambda r: r.n_dofs > 1200),
    "adapt": (AdaptSettings("gap", "20%"), {}, lambda r: r.adaptivity is not None and r.adaptivity.of == ("gap",)),
    "method": ("fem", {}, lambda r: r.projection_degrees == {}),
}
NOT_HERE = (
    "fem",
    "snapshots",
    "checkpoint_every",
    "overwrite",
    "triangulated",
    "fields",
    "friction_error",
)  # they have tests of their own below


@pytest.mark.parametrize("name", IN_MEMORY)
def test_every_option_of_a_run_has_an_effect(name: str, usual: RunResult) -> None:
    value, others, shown = IN_MEMORY[name]
    if value == "fem":
        pytest.importorskip("dolfinx")
    if value == "iterative" and not PETSc.Sys.hasExternalPackage("ml"):
        pytest.skip("this PETSc is built without ML")
    assert not (name in usual.inputs and shown(usual)), "the test sees no difference"
    assert shown(run(BOX, None, RunOptions(**{"steps": 2, **others, name: value})))


def test_what_a_run_leaves_behind_is_as_its_options_say(tmp_path: Path) -> None:
    for snapshots, every in ((0, 0), (2, 3), (4, 1)):
        run(BOX, tmp_path / "box", RunOptions(steps=4, snapshots=snapshots, checkpoint_every=every, overwrite=True))
        assert len(list((tmp_path / "box").glob("fields/*.vtu"))) == snapshots
        assert (tmp_path / "box" / "checkpoint.npz").exists() == (every > 0)
        assert not (tmp_path / "box" / "triangulated.pvd").exists()
    run(BOX, tmp_path / "cut", RunOptions(steps=1, snapshots=1, triangulated=True))
    assert (tmp_path / "cut" / "triangulated.pvd").exists()
    from tmc_vem.support.errors import InputError

    with pytest.raises(InputError, match="overwrite"):
        run(BOX, tmp_path / "box", RunOptions(steps=1))


def test_the_list_of_options_is_complete() -> None:
    assert {*IN_MEMORY, *NOT_HERE} == {entry.name for entry in dataclasses.fields(RunOptions)}


ELEMENTS: dict[str, tuple[Any, Mapping[str, Any]]] = {
    "order": (3, {}), "degree": (4, {}), "quadrature": (8, {}), "projection": ("composite", {}),
    "rule": ("triangles", {}), "interior_penalty": ("penalty", {}), "eta": (5.0, {"interior_penalty": "penalty"}),
}  # fmt: skip
FINITE: dict[str, tuple[Any, Mapping[str, Any]]] = {
    "order": (3, {}), "quadrature": (6, {}), "interior_penalty": ("penalty", {}), "triangles": (True, {}),
    "eta": (5.0, {"interior_penalty": "penalty"}),
}  # fmt: skip


def noisy_energy(options: RunOptions) -> tuple[int, float]:
    """Degrees of freedom, and the medium's energy of a state that is the same function of the coordinates."""
    from mpi4py import MPI

    system = discretise(BOX, options, MPI.COMM_SELF)
    labels = system.node_labels()
    u = system.create_vector()
    u.getArray()[:] = 0.01 * np.column_stack(
        [np.sin(9.0 * labels[:, 0] + 7.0 * labels[:, 1]), np.cos(8.0 * labels[:, 0] - 11.0 * labels[:, 1])]
    ).ravel() * (labels[:, 2:] <= 1.0).repeat(2, axis=1).ravel()  # fmt: skip
    return system.n_dofs, system.energy(u).regions["medium"].energy


def test_every_option_of_an_element_has_an_effect() -> None:
    assert set(ELEMENTS) == {entry.name for entry in dataclasses.fields(ElementSettings)}
    for name, (value, others) in ELEMENTS.items():
        plain = noisy_energy(RunOptions(element=ElementSettings(**others)))
        dofs, energy = noisy_energy(RunOptions(element=ElementSettings(**{**others, name: value})))
        assert (dofs != plain[0]) == (name == "order"), name
        assert abs(energy - plain[1]) > 1e-8 * plain[1], name


def test_every_option_of_a_finite_element_has_an_effect() -> None:
    pytest.importorskip("dolfinx")
    assert set(FINITE) == {entry.name for entry in dataclasses.fields(FemSettings)}
    for name, (value, others) in FINITE.items():
        dofs, energy = noisy_energy(RunOptions("fem", fem=FemSettings(**others)))
        dofs_with, energy_with = noisy_energy(RunOptions("fem", fem=FemSettings(**{**others, name: value})))
        assert abs(energy_with - energy) > 1e-8 * energy, name
        assert (dofs_with != dofs) == (name in ("order", "triangles")) or name == "triangles"
