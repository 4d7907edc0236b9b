"""Probes of fields, energies and cuts: homogeneous and bent plates against closed forms and equilibrium; refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from helpers_forces import interpolated
from helpers_plate import LEFT_AND_BOTTOM, file_of
from helpers_system import interpolate, problem_system
from scipy.optimize import brentq

from codegen.integrand import second_gradient_energy
from codegen.stress import stress_of
from tmc_vem import Box, RunOptions, RunResult, run
from tmc_vem.energy import hyperelastic_solid
from tmc_vem.problems.field_probes import CutForce, EnergyOf, Over, PNorm, ValueAt
from tmc_vem.problems.probe_table import ProbeTable
from tmc_vem.problems.wrapped import Probed
from tmc_vem.simulation.gauge import Gauge
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.support.errors import InputError
from tmc_vem.system.tensors import tensors_of, values_of

PULLED = LEFT_AND_BOTTOM + '[[load]]\nat = "right"\nux = 0.4\n'
BENT = '[[support]]\nat = "left"\nux = 0\nuy = 0\n[[load]]\nat = "right"\nuy = -0.3\n'
OF_PULLED = """[probes]
stretch = { value = "principal_stretch_1", at = [0.7, 0.3] }
here = { value = "cauchy_stress_xx", at = "c" }
mises = { largest = "von_mises", region = "block" }
least = { smallest = "von_mises", region = "block" }
mean_mises = { mean = "von_mises", region = "block" }
work = { energy = "stored", region = "block" }
density = { mean = "energy_density", region = "block" }
pull = { integral = "first_piola_stress_xX", edges = "right" }
inside = { integral = "first_piola_stress_xX", line = [[1.3, 0.0], [1.3, 1.0]] }
slanted = { mean = "ux", line = [[0.0, 0.0], [2.0, 1.0]] }
moved = { mean = "ux", region = "block" }
farthest = { largest = "ux", region = "block" }
lowest = { smallest = "uy", edges = "top" }
cut = { cut_force = "normal", line = [[1.0, 0.0], [1.0, 1.0]] }
"""
OF_BENT = """[probes]
shear = { cut_force = "shear", line = [[1.0, -0.1], [1.0, 1.1]] }
down = { cut_force = "y", line = [[1.0, 0.0], [1.0, 1.0]], region = "block" }
normal = { cut_force = "normal", line = [[1.0, 0.0], [1.0, 1.0]] }
back = { cut_force = "y", line = [[1.0, 1.0], [1.0, 0.0]] }
moment = { cut_force = "moment", line = [[0.5, 0.0], [0.5, 1.0]] }
second = { cut_force = "moment", line = [[1.5, 0.0], [1.5, 1.0]] }
x1 = { position = "x", at = [0.5, 0.5] }
x2 = { position = "x", at = [1.5, 0.5] }
held = { reaction = "uy", at = "left" }
"""


def solved(directory: Path, text: str, method: str) -> RunResult:
    directory.mkdir(exist_ok=True)
    problem = read_problem(file_of(directory, text))[0]
    return run(problem, None, RunOptions(method, steps=2, snapshots=0))


@pytest.fixture(scope="module", params=["vem", "fem"])
def runs(request, tmp_path_factory):
    if request.param == "fem":
        pytest.importorskip("dolfinx")
    where = tmp_path_factory.mktemp("plates")
    return {
        name: solved(where / name, text, request.param)
        for name, text in (("pulled", PULLED + OF_PULLED), ("bent", BENT + OF_BENT))
    }


def uniaxial(stretch: float) -> tuple[float, float, float]:
    """Lateral stretch, and Cauchy stresses along and across the plane, of K/2 (ln J)^2 + mu/2 (J^(-2/3) I1 - 3)."""

    def stresses(lateral: float) -> np.ndarray:
        J, b = stretch * lateral, np.array([stretch**2, lateral**2, 1.0])
        return 20.0 * np.log(J) / J + 10.0 * J ** (-5.0 / 3.0) * (b - b.mean())

    lateral = brentq(lambda value: stresses(value)[1], 0.5, 1.2, xtol=1e-15)
    return lateral, stresses(lateral)[0], stresses(lateral)[2]


def test_a_pulled_plate_has_the_stress_of_the_closed_form(runs) -> None:
    """Uniaxial tension in plane strain: everything is homogeneous."""
    values, units = runs["pulled"].probes, runs["pulled"].units
    lateral, along, across = uniaxial(1.2)
    mises = np.sqrt(along**2 - along * across + across**2)
    assert values["stretch"] == pytest.approx(1.2, abs=1e-8)
    assert values["here"] == pytest.approx(along, rel=1e-7)
    assert [values[name] for name in ("mises", "least", "mean_mises")] == pytest.approx([mises] * 3, rel=1e-7)
    assert values["pull"] == pytest.approx(along * lateral, rel=1e-7)
    assert [values["inside"], values["cut"]] == pytest.approx([values["pull"]] * 2, rel=1e-7)
    assert values["cut"] == pytest.approx(runs["pulled"].reaction, rel=1e-9)
    assert values["work"] == pytest.approx(runs["pulled"].last.energy["block"], rel=1e-12)
    assert values["density"] == pytest.approx(values["work"] / 2.0, rel=1e-12)
    assert [values[name] for name in ("slanted", "moved", "farthest")] == pytest.approx([0.2, 0.2, 0.4], abs=1e-8)
    assert values["lowest"] == pytest.approx(lateral - 1.0, abs=1e-8)
    assert [units[name] for name in ("mises", "pull", "work", "density", "slanted", "stretch", "cut")] == [
        "force/length^2", "force/length", "force", "force/length^2", "length", "1", "force/length",
    ]  # fmt: skip


def test_forces_through_cuts_are_in_equilibrium(runs) -> None:
    """What is right of a cut is held by the load alone: its reaction, and a moment that grows with the arm."""
    values, reaction = runs["bent"].probes, runs["bent"].reaction
    assert reaction < -0.1
    assert [values["shear"], values["down"]] == pytest.approx([reaction] * 2, rel=1e-8)
    assert values["held"] == pytest.approx(-values["down"], rel=1e-8)
    assert values["normal"] == pytest.approx(0.0, abs=1e-8)
    assert values["back"] == pytest.approx(-reaction, rel=1e-8)  # of the other part, on this one
    assert values["moment"] - values["second"] == pytest.approx((values["x2"] - values["x1"]) * reaction, rel=1e-8)
    assert abs(values["moment"]) > 2.0 * abs(values["second"])
    assert [runs["bent"].units[name] for name in ("shear", "moment")] == ["force/length", "force"]


def test_integrals_of_known_states_of_several_regions() -> None:
    """An affine state of the box: fields are constant in solid and medium, each with its own stress."""
    line = ((0.05, 0.25), (1.95, 0.25))
    probes = {
        "solid": Over("cauchy_stress_xy", "mean", "solid"),
        "medium": Over("cauchy_stress_xy", "smallest", "medium"),
        "both": Over("J", "integral", line=line),
        "wall": Over("cauchy_stress_xy", "integral", "solid", line=line),
        "at_solid": ValueAt("cauchy_stress_xy", (1.0, 0.1)),
        "at_medium": ValueAt("cauchy_stress_xy", (1.0, 0.1), "medium"),
        "u": Over("uy", "integral", "medium"),
        "energy": EnergyOf("medium"),
        "densities": Over("energy_density", "integral", "medium"),
        "densest": Over("energy_density", "largest", "medium"),
    }
    problem = Probed(Box(cells=(20, 5)), probes)
    system = problem_system(problem)
    slope = np.array([[0.1, -0.3], [0.2, 0.05]])
    u = interpolate(system, lambda x: x @ slope.T)
    values, J = Gauge(problem, system).read(u, system.create_vector()), 1.1 * 1.05 + 0.06
    expected = {}
    for name, of in problem.regions().items():
        P, across = stress_of(of.integrand).at((np.eye(2) + slope)[None], np.zeros((1, 2, 2, 2)), of.values)
        expected[name] = float(values_of("cauchy_stress_xy", tensors_of((np.eye(2) + slope)[None], P, across))[0])
    assert values["solid"] == pytest.approx(expected["solid"], rel=1e-9)
    assert values["at_solid"] == pytest.approx(expected["solid"], rel=1e-9)
    assert [values["medium"], values["at_medium"]] == pytest.approx([expected["medium"]] * 2, rel=1e-6)
    assert values["both"] == pytest.approx(1.9 * J, rel=1e-9)
    assert values["wall"] == pytest.approx(0.1 * expected["solid"], rel=1e-9)
    assert values["u"] == pytest.approx(1.8 * 0.3 * (0.2 * 1.0 + 0.05 * 0.25), rel=1e-9)
    assert values["energy"] == pytest.approx(values["densities"], rel=1e-12)
    assert values["densest"] == pytest.approx(values["densities"] / 0.54, rel=1e-9)


@pytest.mark.parametrize("method", ["vem", "fem"])
@pytest.mark.parametrize("name", ["gamma", "medium.gamma"])
def test_stresses_follow_parameters_that_the_path_changes(method, name) -> None:
    """A lowered or continued gamma is that of the stress; of a single region, its own alone."""
    problem = Probed(Box(cells=(20, 5)), {"p": Over("cauchy_stress_xy", "mean", "medium")})
    if method == "vem":
        system = problem_system(problem)
    else:
        pytest.importorskip("dolfinx")
        from mpi4py import MPI

        from tmc_vem.fem.system import FemSystem

        system = FemSystem(MPI.COMM_SELF, problem.make_mesh, problem.regions(), problem.prescribed())
    slope = np.array([[0.1, -0.3], [0.2, 0.05]])
    u = interpolated(system, lambda x: x @ slope.T)
    of = problem.regions()["medium"]
    gauge = Gauge(problem, system)
    for gamma in (of.values["gamma"], 0.3):
        system.set_parameters({name: gamma})
        P, across = stress_of(of.integrand).at(
            (np.eye(2) + slope)[None], np.zeros((1, 2, 2, 2)), {**of.values, "gamma": gamma}
        )
        expected = values_of("cauchy_stress_xy", tensors_of((np.eye(2) + slope)[None], P, across))[0]
        assert gauge.read(u, system.create_vector())["p"] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("model", "values", "closed"),
    [
        ("neo_hooke", {"K": 20.0, "mu": 3.0}, lambda k: 3.0 * np.sqrt(3 * k**2 + k**4)),
        ("yeoh", {"K": 20.0, "c1": 1.0, "c2": 0.3, "c3": 0.2},
         lambda k: 2 * (1.0 + 0.6 * k**2 + 0.6 * k**4) * np.sqrt(3 * k**2 + k**4)),
        ("gent", {"K": 20.0, "mu": 3.0, "J_m": 5.0}, lambda k: 3.0 * 5.0 / (5.0 - k**2) * np.sqrt(3 * k**2 + k**4)),
    ],
)  # fmt: skip
def test_von_mises_stress_in_simple_shear(model, values, closed) -> None:
    """sigma = 2 dW/dI1 b + p I, so that it is 2 dW/dI1 sqrt(3 k^2 + k^4)."""
    energy = hyperelastic_solid(model, "log")
    k = np.array([0.1, 0.7, 1.5])
    F = np.tile(np.eye(2), (3, 1, 1))
    F[:, 0, 1] = k
    integrand = second_gradient_energy(energy.density, energy.name, energy.parameters)
    P, across = stress_of(integrand).at(F, None, values)
    assert values_of("von_mises", tensors_of(F, P, across)) == pytest.approx(closed(k), rel=1e-10)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        (
            {"value": "mises", "at": "c"},
            r"unknown value 'mises' \(did you mean 'von_mises'\?\): choose one of von_mises, ",
        ),
        ({"value": "von_mises"}, "value lacks 'at'"),
        ({"value": "von_mises", "at": "c", "line": ((0, 0), (1, 1))}, "value has no use for 'line'"),
        ({"largest": "von_mises"}, "largest lacks a place: give region, edges or line"),
        ({"largest": "von_mises", "line": ((0.0, 1.0), (0.0, 1.0))}, r"line: both ends are \(0, 1\)"),
        ({"integral": "J", "line": ((0.0, 0.0), (1.0, 0.0)), "edges": "top"}, "give edges or a line, not both"),
        ({"mean": "energy_density", "edges": "top"}, "energy_density is known by cells only"),
        ({"energy": "all", "region": "block"}, "unknown energy 'all': choose one of stored"),
        ({"cut_force": "z", "line": ((0.0, 0.0), (1.0, 0.0))}, "unknown cut_force 'z': choose one of x, y, normal"),
        ({"cut_force": "x"}, "cut_force lacks 'line'"),
        ({"p_norm": "von_mises"}, "p_norm lacks 'region'"),
        (
            {"p_norm": "uy", "region": "a"},
            "unknown p_norm 'uy': choose one of von_mises, .*; others may be negative",
        ),
        ({"p_norm": "J", "region": "a", "exponent": 0.5}, "exponent = 0.5: use 1 to 1000, 6 to 12 in most uses"),
    ],
)
def test_tables_that_are_refused(table, words) -> None:
    with pytest.raises(InputError, match=words):
        ProbeTable(**table)


@pytest.mark.parametrize(
    ("probe", "words"),
    [
        ("{ mean = 'von_mises', region = 'air' }", "p: there is no region 'air'"),
        ("{ mean = 'von_mises', edges = 'rim' }", "p: the mesh has no edges 'rim'"),
        ("{ value = 'von_mises', at = [3.0, 0.5] }", r"p: point \(3, 0.5\) lies 1 outside of the mesh"),
        (
            "{ cut_force = 'x', line = [[3.0, 0.0], [3.0, 1.0]] }",
            "p: the cut from .* goes through no inner side of block",
        ),
        ("{ mean = 'ux', line = [[3.0, 0.0], [3.0, 1.0]] }", "p: mean of ux along .* goes through no cell"),
    ],
)
def test_places_that_are_not_there_are_refused(probe, words, tmp_path) -> None:
    with pytest.raises(InputError, match=words):
        solved(tmp_path, f"{PULLED}[probes]\np = {probe}\n", "vem")


def test_probes_in_words() -> None:
    cut = ((0.0, 0.5), (1.0, 0.5))
    words = {
        ValueAt("von_mises", "c"): "von Mises stress at c",
        Over("uy", "largest", "block"): "largest uy over block",
        Over("J", "mean", "block", line=cut): "mean of J along (0, 0.5) to (1, 0.5) in block",
        EnergyOf("block"): "energy of block",
        PNorm("von_mises", "block", 6.0): "6-norm of von Mises stress over block",
        CutForce("shear", cut): "shear force through the cut (0, 0.5) to (1, 0.5)",
        CutForce("x", cut): "x component of the force through the cut (0, 0.5) to (1, 0.5)",
    }
    assert [str(probe) for probe in words] == list(words.values())
