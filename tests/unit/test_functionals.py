"""Derivatives of results by a state and by parameters: against differences of the results. Values: against gauges."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from helpers_forces import Parts, cavity_plate
from helpers_functionals import AT, Case, Layers, by_parameters, by_state, case_of, is_second_order

from tmc_vem.problems import Box, Medium
from tmc_vem.problems.base import media_of, medium_region
from tmc_vem.problems.contact_probe import Contact
from tmc_vem.problems.field_probes import CutForce, EnergyOf, Over, PNorm, ValueAt
from tmc_vem.problems.probes import Displacement, Gap, MeanJ, Position, Reaction
from tmc_vem.sensitivity.functionals import Functionals, functional_of
from tmc_vem.simulation.contact_gauge import ContactGauge
from tmc_vem.simulation.gauge import Gauge
from tmc_vem.simulation.measured import LoadGauge
from tmc_vem.support.errors import InputError
from tmc_vem.system.constraints import Prescribed, PrescribedRotation
from tmc_vem.system.control import Control
from tmc_vem.system.forces import CavityPressure, PointForce

CUT = ((-0.1, 0.8), (1.1, 1.0))
INSIDE = (0.41, 0.53)
PROBES = {
    "node": Displacement("uy", "corner"),
    "inside": Displacement("ux", INSIDE),
    "height": Position("y", (1.0, 0.7)),
    "gap": Gap("corner", (0.3, 0.2)),
    "held": Reaction("ux", "bottom"),
    "squeezed": MeanJ("medium"),
    "stored": EnergyOf("medium"),
    "density": Over("energy_density", "mean", "block"),
    "shift": Over("ux", "integral", "medium"),
    "mises": Over("von_mises", "mean", "block"),
    "shear": Over("cauchy_stress_xy", "integral", "medium"),
    "nominal": Over("first_piola_stress_xY", "mean", "medium"),
    "across": Over("first_piola_stress_zZ", "mean", "foot"),
    "plane": Over("in_plane_stress_2", "mean", "foot"),
    "volume": Over("J", "integral", "medium"),
    "strain": Over("log_strain_xx", "mean", "medium"),
    "through": CutForce("normal", CUT),
    "sideways": CutForce("x", CUT),
    "bending": CutForce("moment", CUT),
    "edge": Over("uy", "mean", edges="right", region="block"),
    "line": Over("ux", "integral", line=((0.0, 0.55), (1.0, 0.6))),
    "norm": PNorm("von_mises", "block", 6.0),
    "norm_of_j": PNorm("J", "medium", 3.0),
}
OTHERS = (
    "reaction", "displacement", "compliance", "pull.displacement", "energy", "energy.block", "contact.block.force",
    "contact.block.force_x", "contact.foot.force_y", "contact.foot.moment",
)  # fmt: skip
# whose central differences have no error: linear and quadratic in u, or no function of it
EXACT = {"node", "inside", "height", "shift", "squeezed", "volume", "displacement", "pull.displacement", "compliance",
         "edge", "line"}  # fmt: skip
# what the energies have of parameters is linear but for the damping beta, and products of gamma with others
LINEAR = {"held", "density", "mises", "across", "plane", "through", "sideways", "bending", "norm", "reaction",
          "energy.block", "contact.foot.force_y"}  # fmt: skip
WITHOUT = {"gap", "strain", "norm_of_j"}  # of no parameter
CASES = {
    "voronoi": (Layers("voronoi", 0.0, PROBES), "vem"),
    "hanging": (Layers("hanging", 0.2, PROBES), "vem"),
    "elements": (Layers("squares", 0.2, PROBES), "fem"),
}


@pytest.fixture(scope="module", params=CASES)
def case(request: pytest.FixtureRequest) -> Case:
    problem, method = CASES[request.param]
    if method == "fem":
        pytest.importorskip("dolfinx")
    return case_of(problem, method)


@pytest.fixture(scope="module")
def functionals(case: Case) -> Functionals:
    return Functionals(case.problem, case.system)


@pytest.mark.parametrize("name", [*PROBES, *OTHERS])
def test_derivatives_by_the_state(case: Case, functionals: Functionals, name: str) -> None:
    slope, away = by_state(case, functionals.of(name))
    assert name == "displacement" or abs(slope) > 1e-5
    assert is_second_order(slope, away, exact=name in EXACT), away


@pytest.mark.parametrize("name", [*PROBES, *OTHERS])
def test_derivatives_by_parameters(case: Case, functionals: Functionals, name: str) -> None:
    slope, away = by_parameters(case, functionals.of(name))
    if name in EXACT | WITHOUT:
        assert slope == 0.0 == np.abs(away).max()
        return
    assert abs(slope) > 1e-5
    assert is_second_order(slope, away, exact=name in LINEAR | {"shear"}), away


def test_values_are_those_of_gauges(case: Case, functionals: Functionals) -> None:
    problem, system, state = case.problem, case.system, case.state(case.u)
    found = {name: functionals.of(name).derivative(state).value for name in [*PROBES, *OTHERS]}
    expected = dict(Gauge(problem, system).read(state.u, state.residual))
    loads = LoadGauge(problem, system).read(state.u, state.residual, AT, None)
    expected |= {"reaction": loads.reaction, "displacement": loads.displacement}
    pull = loads.loads["pull"]
    expected |= {"pull.displacement": pull["displacement"], "compliance": pull["potential"] * pull["amplitude"]}
    energies = {name: values.energy for name, values in system.energy(state.u).regions.items()}
    expected |= {"energy": sum(energies.values()), "energy.block": energies["block"]}
    media = {name: problem.regions()[name].integrand for name in media_of(problem)}
    contact = ContactGauge(system, media, 2).read(state.u, state.residual)
    for of, quantity in (name.removeprefix("contact.").split(".") for name in OTHERS if name.startswith("contact.")):
        expected[f"contact.{of}.{quantity}"] = contact[of][quantity]
    assert found == pytest.approx(expected, rel=1e-12, abs=1e-16)


def test_the_force_on_one_of_two_outlines_that_face_each_other() -> None:
    """The box faces itself: on the body as a whole hardly anything acts, on its lower half the contact force does."""
    case = case_of(Box(cells=(20, 5), medium=Medium(gamma=0.01)))
    functionals, state = Functionals(case.problem, case.system), case.state(case.u)
    contact = ContactGauge(case.system, {"medium": case.problem.regions()["medium"].integrand}, 2)
    values = contact.read(state.u, state.residual)
    for quantity in ("force_y", "moment"):
        functional = functionals.of(f"contact.solid-solid.{quantity}")
        assert values["solid-solid"][quantity] > 1.2 * values["solid"][quantity]
        assert functional.derivative(state).value == pytest.approx(values["solid-solid"][quantity], rel=1e-12)
        assert is_second_order(*by_state(case, functional))
        assert is_second_order(*by_parameters(case, functional), exact=True)
    with pytest.raises(InputError, match="'box' has none: take 'reaction'"):
        functionals.of("compliance")
    assert "compliance" not in functionals.names()


def test_p_norms_go_from_the_mean_to_the_largest_value(case: Case, functionals: Functionals) -> None:
    state = case.state(case.u)
    values = [functionals.of(PNorm("von_mises", "block", p)).derivative(state).value for p in (1.0, 8.0, 900.0)]
    assert values[0] == pytest.approx(functionals.of("mises").derivative(state).value, rel=1e-13)
    largest = functionals.of("norm")._integral.largest(state.u)  # type: ignore[union-attr]
    assert values[0] < values[1] < values[2] < largest
    assert values[2] == pytest.approx(largest, rel=0.02)
    at_rest = functionals.of("norm").derivative(case.state(case.system.create_vector()))
    assert (at_rest.value, at_rest.by_u.norm()) == (0.0, 0.0)


@dataclass(frozen=True)
class Inflated(Parts):
    """A plate with a hole under pressure, which is its load."""

    def load(self) -> Any:
        return self.acting[0]


@pytest.mark.parametrize("force", [CavityPressure("f", "hole", 0.7), PointForce("f", "tip", (0.3, -0.2))])
def test_displacements_of_forces(force: Any) -> None:
    held = (Prescribed("left", 0), Prescribed("bottom", 1))
    case = case_of(Inflated(cavity_plate, held, [force]))
    functionals, state = Functionals(case.problem, case.system), case.state(case.u)
    loads = LoadGauge(case.problem, case.system).read(state.u, state.residual, AT, None)
    functional = functionals.of("displacement")
    assert functional.derivative(state).value == pytest.approx(loads.displacement, rel=1e-13)
    for name in ("displacement", "compliance"):
        slope, away = by_state(case, functionals.of(name))
        assert abs(slope) > 1e-5
        assert is_second_order(slope, away, exact=True)
    with pytest.raises(InputError, match=r"is given, no result: take its .*, or 'compliance'"):
        functionals.of("reaction")


def test_reactions_count_where_something_is_held_only(case: Case, functionals: Functionals) -> None:
    """Elsewhere the residual of an equilibrium is 0, as across the axis of an incline."""
    state, free = case.state(case.u), np.ones(2 * case.nodes.n_owned, dtype=bool)
    free[case.system.constrained()] = False
    for result in (Reaction("uy", "top"), "reaction", "contact.block.force_x"):
        held = functionals.of(result).derivative(state).on_residual
        assert held is not None
        assert held.norm() > 0.1
        assert not held.getArray()[free].any()


@pytest.mark.parametrize("slope", [0.0, 0.2])
def test_how_far_a_load_has_gone_is_what_is_prescribed(slope: float) -> None:
    """Whatever its nodes have, of which another support may hold some."""
    case = case_of(Layers("squares", slope))
    found = functional_of("displacement", case.problem, case.system).derivative(case.state(case.u))
    assert found.value == pytest.approx(-0.07, rel=1e-13)
    assert found.per_load == pytest.approx(-0.1, rel=1e-13)
    assert found.reads_loads
    assert found.by_u.norm() == 0.0


def test_angle_and_moment_of_a_rotation() -> None:
    turned = PrescribedRotation("top", (0.4, 0.6), 10.0)
    case = case_of(Layers("squares", 0.0, {}, turned))
    functionals = Functionals(case.problem, case.system)
    moment = functionals.of("reaction")
    loads = LoadGauge(case.problem, case.system)
    state = case.state(case.u)
    expected = loads.read(state.u, state.residual, AT, None).reaction
    assert moment.derivative(state).value == pytest.approx(expected, rel=1e-12)
    assert is_second_order(*by_state(case, moment))
    assert is_second_order(*by_parameters(case, moment), exact=True)
    found = functionals.of("displacement").derivative(state)
    assert found.value == pytest.approx(7.0, rel=1e-13)
    assert found.per_load == pytest.approx(10.0, rel=1e-13)


def test_the_sign_of_a_gap_is_that_of_its_derivative(case: Case, functionals: Functionals) -> None:
    gap = functionals.of("gap")
    open_, crossed = (gap.derivative(replace(case.state(case.u), behind=lambda *_, b=b: b)) for b in (False, True))
    assert crossed.value == -open_.value < 0.0
    crossed.by_u.axpy(1.0, open_.by_u)
    assert crossed.by_u.norm() == 0.0


def test_what_has_no_derivative_is_refused_with_what_has_one(case: Case, functionals: Functionals) -> None:
    line = ((0.0, 0.3), (1.0, 0.3))
    for result, words in {
        ValueAt("von_mises", "corner"): "recovered value, which is not differentiated: take the mean or the integral",
        Over("von_mises", "mean", line=line): "recovered values, which are not differentiated",
        Over("von_mises", "largest", "block"): r"has no derivative where its place changes: .*, or its p-norm",
        Over("ux", "smallest", "block"): "has no derivative where its place changes",
        Contact("gap", "block-foot"): "it is the smallest distance of all nodes; take a probe of the gap",
        Contact("half_width", "block-foot"): "goes by which nodes are above a part of the largest pressure",
        Contact("pressure_max", "block-foot"): "goes by the node with the largest pressure; take the force",
        Contact("friction", "block"): "friction depends on the path",
        "reactoin": r"unknown result 'reactoin' \(did you mean 'reaction'\?\): choose one of node, .*contact.block.f",
        "contact.block.width": "unknown quantity of contact 'width'.*: choose one of force, force_x, force_y, moment",
    }.items():
        with pytest.raises(InputError, match=words):
            functionals.of(result)
    with pytest.raises(InputError, match=r"no body of that name \(there are: .*block.*\), and no pair"):
        functionals.of("contact.lid.force").derivative(case.state(case.u))
    with pytest.raises(InputError, match="is 0, where a distance has no derivative"):
        functionals.of(Gap("corner", (1.0, 1.0 + case.problem.slope))).derivative(case.state(case.u))


def test_a_force_without_a_direction_has_no_derivative() -> None:
    case = case_of(Layers("squares"))
    case.system.set_position(Control(0.0))  # without forces
    state = case.state(case.system.create_vector())
    with pytest.raises(InputError, match="is 0, where it has no direction and no derivative: take force_x"):
        functional_of("contact.block.force", case.problem, case.system).derivative(state)


@dataclass(frozen=True)
class Staged(Layers):
    """A problem with a support that begins later."""

    def prescribed(self) -> Any:
        return [*super().prescribed(), Prescribed("left", 0, stages=("later",))]


@dataclass(frozen=True)
class Rubbing(Layers):
    """One whose medium has friction."""

    def regions(self) -> Any:
        return {**super().regions(), "medium": medium_region(Medium(gamma=0.05, friction=0.3), 1.5)}


def test_results_that_depend_on_the_path_are_refused(case: Case) -> None:
    for problem, words in ((Staged(), "holds in some stages only"), (Rubbing(), "'medium' has friction")):
        with pytest.raises(InputError, match=f"{words}.* so that there are no derivatives"):
            functional_of("energy", problem, case.system)
