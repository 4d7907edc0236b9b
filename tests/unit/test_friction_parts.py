"""Parts of what is said about friction, on numbers by hand: integrals, records, balance of energy, warnings, stress."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from test_energy_balance import record as plain_record
from test_plausibility import MEDIA, SIZE, of_two, texts
from test_plausibility import record as contact_record

from codegen.integrand import Integrand, second_gradient_energy
from tmc_vem.energy import kinematics as kin
from tmc_vem.problems.contact_quantities import OF_FRICTION, OF_PAIR, quantities_of, shown
from tmc_vem.results.energy_balance import energy_balance
from tmc_vem.results.plausibility import Evidence, coefficient_of, findings_of
from tmc_vem.results.records import OF_REGION, StepRecord
from tmc_vem.results.run_result import _name
from tmc_vem.simulation.friction_gauge import FrictionGauge, RegionFriction
from tmc_vem.system.friction import SlipResponse, SlipSystem
from tmc_vem.system.friction_energy import stored_in_regions
from tmc_vem.system.point_states import PointStates
from tmc_vem.system.stress import Stresses
from tmc_vem.system.tensors import COMPONENTS

# One cell with two points of weights 1 and 3: F stretches by 2 and 0.25 across, the shear acts along x.
W, F = np.array([[1.0, 3.0]]), np.array([[[[1.0, 0.5], [0.0, 0.25]], [[1.0, 0.0], [0.0, 0.5]]]])
A = np.array([[[[0.0, 1.0], [2.0, 0.0]], [[0.0, 4.0], [0.0, 0.0]]]])
BOUND, TAU, STICKS = np.array([[2.0, 4.0]]), np.array([[0.5, -4.0]]), np.array([[True, False]])


def states() -> Any:
    points = PointStates("m", np.array([1]), W, np.zeros((1, 2, 2)), F, None, {})
    slip = SlipSystem(A, np.zeros((1, 2)), BOUND, BOUND / 0.2, np.zeros((1, 2)), np.zeros((1, 2, 2)))
    energy, stored, gone = np.array([[0.25, 1.0]]), np.array([[0.125, 0.5]]), np.array([[0.0, 2.0]])
    response = SlipResponse(TAU, np.zeros((1, 2)), energy, stored, gone, STICKS)
    return SimpleNamespace(points=points, slip=slip, response=response)


class Ranks:
    """Two ranks that have the same."""

    def allgather(self, mine: Any) -> list[Any]:
        return [mine, mine]


def system(**more: Any) -> Any:
    found = {"comm": Ranks(), "cell_numbers": lambda: np.arange(3), "friction_states": lambda u: iter([states()])}
    return SimpleNamespace(**found | more)


def test_integrals_over_regions_of_all_ranks() -> None:
    found = FrictionGauge(system(), ["m", "n"]).of_regions(None)  # type: ignore[arg-type]
    # potential 0.25 + 3, stored 0.125 + 1.5, dissipated 6, bound 2 + 12, 2 of it sticks, times J of 0.25 and 0.5
    assert found["m"] == RegionFriction(6.5, 3.25, 12.0, 28.0, 4.0, 13.0)
    assert found["n"] == RegionFriction(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert found["m"].reported({"dissipated": 1.0, "work": 2.0}) == {
        "slip_energy": 3.25, "dissipated": 13.0, "work": 8.5, "sticking": 1 / 7, "contact_j": 13 / 28,
    }  # fmt: skip
    assert found["n"].reported({}) == {"slip_energy": 0.0, "dissipated": 0.0, "work": 0.0}
    assert list(found["m"].reported(None)) == ["slip_energy", "sticking", "contact_j"], "beside the load path"
    none = FrictionGauge(system(friction_states=None), [])
    assert (none.is_used, none.of_regions(None)) == (False, {})  # type: ignore[arg-type]


def test_means_over_the_deformed_area_of_cells() -> None:
    """J is 0.25 and 0.5, so the area 1.75; tau A F^T has tau_1 [[0.5, 0.25], [2, 0]] and tau_2 [[0, 2], [0, 0]]."""
    found = FrictionGauge(system(), ["m"]).of_cells(None)  # type: ignore[arg-type]
    stress = 0.5 * np.array([[0.5, 0.25], [2.0, 0.0]]) + 3.0 * -4.0 * np.array([[0.0, 2.0], [0.0, 0.0]])
    assert found[1] == pytest.approx(np.array([*stress.ravel(), 14.0, 2.0]) / 1.75)
    assert (found[[0, 2]] == 0.0).all()


def test_energies_without_friction() -> None:
    regions = {"m": SimpleNamespace(energy=10.0), "s": SimpleNamespace(energy=4.0)}
    made = system()
    assert stored_in_regions(made, None, SimpleNamespace(regions=regions)) == {"m": 10.0 - 6.5, "s": 4.0}  # type: ignore[arg-type]


def linear() -> Integrand:
    """The energy F : F / 2, whose stress is F."""
    return second_gradient_energy(lambda F, G, p, m: kin.trace_c(F) / 2, "linear", {})


def test_the_shear_of_friction_is_in_the_stress() -> None:
    """Of its own cells, which are not all; the first and the last cells have none."""
    plain = [dataclasses.replace(states().points, cells=np.array([c])) for c in (0, 1, 2)]
    made = system(point_states=lambda u: iter(plain))
    P = [tensors["first_piola_stress"] for _, tensors in Stresses(made, {"m": linear()}).at_points(None)]  # type: ignore[arg-type]
    order = [COMPONENTS["first_piola_stress"].index(name) for name in ("xX", "xY", "yX", "yY")]
    own, with_shear = (P[n][0][:, order].reshape(2, 2, 2) for n in (0, 1))
    assert own == pytest.approx(F[0])
    assert with_shear == pytest.approx(F[0] + TAU[0][:, None, None] * A[0])
    assert np.array_equal(P[2], P[0])
    assert [key for key, _ in Stresses(made, {"m": linear()}).at_points(None, ["n"])] == []  # type: ignore[arg-type]


# -- records ---------------------------------------------------------------------------------------------------------


def test_columns_of_friction() -> None:
    pair = {"pressure_max": 1.0, "friction": 2.0, "sticking": 0.5}
    assert list(quantities_of(pair)) == [*OF_PAIR, *OF_FRICTION]
    assert list(quantities_of({"force": 1.0, "friction": 0.0}))[-7:] == list(OF_FRICTION)
    assert "friction" not in quantities_of({"pressure_max": 1.0})
    region = {"slip_energy": 1.0, "dissipated": 2.0, "work": 3.0}
    made = contact_record(contact={"a": {"force": 1.0, "friction": 4.0}, "a-b": pair}, friction={"m.x": region})
    row = {name: str(value) for name, value in made.as_row().items()}
    assert [row[f"friction.m.x.{quantity}"] for quantity in OF_REGION] == ["1.0", "2.0", "3.0", "", ""]
    assert (row["contact.a-b.sticking"], row["contact.a-b.slip_max"]) == ("0.5", "")
    again = StepRecord.from_row({**row, "friction.force": "7.0"})
    assert again.friction == {"m.x": region}
    assert again.contact["a-b"] == pair
    assert again.forces == {"friction": {"force": 7.0}}, "a load of that name"
    assert "friction.m.x.work" not in contact_record().as_row()
    assert _name("friction.m.work [N]", {}) == "friction.m.work"
    assert _name("contact.a.force [N]", {}) == "contact.a.force"
    assert _name("mine [N]", {}) == "mine [N]"


def test_what_of_friction_is_shown() -> None:
    body = {"force": 1.0, "friction": 2.0, "apparent_coefficient": 0.3, "sticking": 1.0}
    pair = {"force": 3.0, "pressure_max": 4.0, "half_width": 5.0, **body}
    both = {("a", "force"): 1.0, ("b", "force"): 1.0}
    of_pair = {
        ("a-b", name): pair[name]
        for name in ("force", "pressure_max", "half_width", "friction", "apparent_coefficient")
    }
    assert shown({"a": body, "b": body, "a-b": pair}) == both | of_pair
    assert shown({"a": body}) == {("a", name): body[name] for name in ("force", "friction", "apparent_coefficient")}, (
        "on ground"
    )


# -- balance ---------------------------------------------------------------------------------------------------------


def rubbed(load: float, energy: float, force: float, work: float, gone: float, slip: float) -> StepRecord:
    values = {"work": work, "dissipated": gone, "slip_energy": slip}
    of_two = {"m": values, "n": {name: 2.0 * value for name, value in values.items()}}
    return dataclasses.replace(plain_record(load, energy, force), friction=of_two)


def test_the_work_that_goes_into_friction_is_no_error() -> None:
    """Work 0.5 and 1.5 of a load; friction takes 0.125 and 0.25 more in each of two media, times 1 and 2."""
    history = [rubbed(1.0, 0.125, 1.0, 0.125, 0.0, 0.125), rubbed(2.0, 0.75, 2.0, 0.375, 0.25, 0.0625)]
    found = energy_balance(history)
    assert found is not None
    assert found.work == pytest.approx(2.0)
    assert (found.slip, found.dissipated, found.released) == pytest.approx((0.1875, 0.75, 0.1875))
    assert found.stored == pytest.approx(0.75 + 0.1875)
    assert found.integration_error == pytest.approx(0.75 + 3.0 * 0.375 - 2.0)
    assert found.stored == pytest.approx(found.work + found.integration_error - found.dissipated - found.released)
    assert found.as_dict()["released"] == found.released
    jumped = energy_balance([history[0], dataclasses.replace(history[1], jumped=True)])
    assert jumped is not None
    assert jumped.jumps[0].lost == pytest.approx(1.5 - (0.75 - 0.125) - 3.0 * 0.25)
    plain = energy_balance([dataclasses.replace(record, friction={}) for record in history])
    assert plain is not None
    assert {"slip", "dissipated", "released"}.isdisjoint(plain.as_dict())


# -- warnings --------------------------------------------------------------------------------------------------------


def inputs(friction: float | None) -> Mapping[str, Any]:
    return {"medium": {"gamma": 1e-5, **({} if friction is None else {"friction": friction})}}


@pytest.mark.parametrize(
    ("J", "said"),
    [
        (0.014, []),
        (0.0142, ["the medium 'm' has a friction of its own of up to 0.015 (1.06 J, with J = 0.014 in contact), 5.0% "
                  "of friction = 0.3 (more than 5% counts): use a smaller gamma, or cite friction_coefficient, which "
                  "is without it"]),
        (None, []),
    ],
)  # fmt: skip
def test_the_medium_s_own_friction_is_said(J: float | None, said: list[str]) -> None:
    values = {"work": 0.0, "dissipated": 0.0, "slip_energy": 0.0, **({} if J is None else {"contact_j": J})}
    assert texts(contact_record(friction={"m": values}), inputs=inputs(0.3)) == said
    assert texts(contact_record(friction={"m": {**values, "contact_j": 0.2}}), inputs=inputs(None)) == []


def test_every_medium_has_its_own_coefficient() -> None:
    regions = {"medium": {"medium": {"friction": 0.1}}, "medium b": {"medium": {"friction": 1.0}}, "s": 3}
    values = {"work": 0.0, "contact_j": 0.02}
    last = of_two((0.4, 0.0), (0.4, 0.0), friction={"medium": values, "medium b": values})
    (finding,) = findings_of(Evidence({"regions": regions}, [last], {}, MEDIA, SIZE))
    assert finding.text.startswith("the medium 'medium' has a friction of its own of up to 0.021")
    assert coefficient_of({"regions": regions}, "medium b") == 1.0
    assert coefficient_of({"regions": regions, "medium": {"friction": 0.5}}, "s") == 0.5
    assert coefficient_of({"regions": 3}, "m") is None
    assert coefficient_of({"medium": 3}, "m") is None


def test_work_that_friction_takes_counts_as_work_of_the_load() -> None:
    """A tenth of what the bodies store and friction takes squeezes the medium: less than a twentieth."""
    energy = {"solid": 1.0, "medium": 0.1}
    values = {"m": {"work": 0.9}}
    (said,) = texts(contact_record(energy=energy, friction={"m": {"work": 0.8}}))
    assert said.startswith("5.3% of the final reaction squeezes")
    assert texts(contact_record(energy=energy, friction={"m": {"work": 1.0}})) == []
    before = contact_record(0.5, energy={"solid": 0.0, "medium": 0.0}, friction={"m": {"work": 0.1}})
    (said,) = texts(before, contact_record(energy=energy, friction=values))
    assert said.startswith("5.3% of the final reaction squeezes")


def test_ranks_of_one() -> None:
    """What a communicator of MPI does with it."""
    made = FrictionGauge(system(comm=MPI.COMM_SELF), ["m"]).of_regions(None)  # type: ignore[arg-type]
    assert made["m"].bound == 14.0
