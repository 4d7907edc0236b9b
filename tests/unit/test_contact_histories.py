"""Contact step by step: pairs that come and go, stages, graded media, and runs that go on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from helpers_traction import LAYERS, changed, solved

from tmc_vem import RunResult
from tmc_vem.simulation.contact_gauge import ContactGauge

SMALL = changed(LAYERS, ("size = 0.2", "size = 0.4"), ("uy = -0.5", "uy = -0.2"), ("steps = 5", "steps = 4"))
UNITS = changed(SMALL, ("gap =", 'units = { length = "mm", force = "N" }\ngap ='))


def test_pairs_that_come_and_go(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A pair that faces in the second and third of four steps only is read back with its name, value and unit, from a
    run that goes on as well."""
    measured, calls, running = ContactGauge.measured, [], []

    def some(self: ContactGauge, traction: Any) -> Any:
        calls.append(measured(self, traction))
        if len(calls) == 4:
            running.append(RunResult.read(tmp_path / "run"))
        return {name: values for name, values in calls[-1].items() if name != "low-up" or len(calls) in (2, 3)}

    monkeypatch.setattr(ContactGauge, "measured", some)
    result = solved(tmp_path, UNITS, tmp_path / "run").result
    again = RunResult.read(tmp_path / "run")
    assert [len(step.contact) for step in result.history] == [2, 3, 3, 2]
    assert [step.contact for step in again.history] == [step.contact for step in result.history]
    assert running[0].unfinished == "running"
    assert [step.contact for step in running[0].history] == [step.contact for step in result.history[:3]]
    for each in (result, again):
        assert each.unit("contact.low-up.force") == each.unit("contact.up.force") == "N/mm"
        assert each.unit("contact.low-up.pressure_max") == "N/mm^2"
