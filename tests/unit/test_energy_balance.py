"""The balance of work and stored energy, with what was lost in jumps."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import pytest

from tmc_vem import Box, Medium, RunOptions, run
from tmc_vem.results.energy_balance import energy_balance
from tmc_vem.results.records import StepRecord

BOX = Box(cells=(20, 5), uy=-0.5, medium=Medium(gamma=1e-4))


def record(
    load: float, energy: float, force: float | None, jumped: bool = False, parameters: Mapping[str, float] | None = None
) -> StepRecord:
    return StepRecord(1, load, load, {}, 0.0, 1, 0, 0, {}, {"a": 0.25 * energy, "b": 0.75 * energy}, 0, jumped, 0.0,
                      load, parameters or {}, force)  # fmt: skip


def test_a_spring_that_snaps() -> None:
    """psi = 2 u^2 up to u = 1, where half of the energy and of the stiffness are lost; then gamma is raised."""
    history = [
        record(0.5, 0.5, 2.0),
        record(1.0, 2.0, 4.0),
        record(1.5, 2.25, 3.0, jumped=True),
        record(1.5, 4.5, 6.0, parameters={"gamma": 2.0}),
        record(2.0, 8.0, 8.0, parameters={"gamma": 2.0}),
    ]
    balance = energy_balance(history)
    assert balance is not None
    assert balance.work == pytest.approx(0.5 + 1.5 + 1.75 + 0.0 + 3.5)
    (jump,) = balance.jumps
    assert jump.lost == pytest.approx(2.0 + 1.75 - 2.25)
    assert jump.uncertainty == pytest.approx(0.5 * 1.0 * 0.5)
    assert balance.parameters == pytest.approx(2.25)
    assert balance.integration_error == pytest.approx(0.0, abs=1e-15)
    assert balance.stored == pytest.approx(8.0)
    assert balance.as_dict()["jumps"][0]["load"] == 1.5


def test_forces_and_springs_take_part() -> None:
    """A force f = 4 load on a spring k = 2 in parallel with a body c = 2: u = load, so W = f(1) u and -k u^2 / 2.

    From load 1 on the force stays, and the spring softens to nothing: the body goes to u = 2 and stores 4.
    """

    def state(load: float, u: float, f: float, k: float) -> StepRecord:
        push, pad = {"amplitude": f, "potential": 4.0 * u}, {"amplitude": k, "potential": -(u**2), "energy": k * u**2}
        return dataclasses.replace(record(load, u**2, 0.0), forces={"push": push, "pad": pad})

    history = [state(0.5, 0.5, 0.5, 1.0), state(1.0, 1.0, 1.0, 1.0), state(2.0, 2.0, 1.0, 0.0)]
    balance = energy_balance(history)
    assert balance is not None
    # steps: 4 (0.25 / 2 + 0.75 / 2 ...) of the force; the last one 4 u, less what is taken out with the spring
    assert balance.work == pytest.approx(4.0 * (0.125 + 0.375 + 1.0) - 0.5 * (1.0 + 4.0))
    assert balance.stored == pytest.approx(4.0)
    assert balance.integration_error == pytest.approx(4.0 - 3.5)
    jump = dataclasses.replace(history[1], jumped=True)
    found = energy_balance([history[0], jump])
    assert found is not None
    (one,) = found.jumps
    assert one.uncertainty == pytest.approx(0.5 * 0.5 * 2.0)
    assert one.lost == pytest.approx(0.0)


def test_old_runs_have_none() -> None:
    assert energy_balance([]) is None
    assert energy_balance([record(1.0, 1.0, None)]) is None


def balance_of(steps: int, **options: Any) -> Any:
    result = run(BOX, options=RunOptions(steps=steps, **options))
    found = energy_balance(result.history)
    assert found is not None
    assert result.checks["energy_balance"] == found.as_dict()
    return found


def test_the_stored_energy_is_the_work_of_the_load() -> None:
    """To the second order in the steps; the same when the load goes back."""
    errors = [abs(balance_of(steps).integration_error) for steps in (10, 20)]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.15)
    there_and_back = balance_of(20, path=(0.0, 1.0, 0.0))
    assert there_and_back.work == pytest.approx(0.0, abs=1e-12)
    assert there_and_back.stored == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("method", ["vem", "fem"])
def test_the_force_of_the_load(method: str) -> None:
    """Of a single prescribed displacement it is the reaction times that."""
    result = run(BOX, options=RunOptions(method, steps=2))
    last: Sequence[StepRecord] = result.history
    assert last[-1].load_force == pytest.approx(last[-1].reaction * BOX.uy, rel=1e-12)
