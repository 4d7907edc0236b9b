"""What reports warn of, in any unit of length."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tmc_vem.report import cautions
from tmc_vem.report.canvas import ticks
from tmc_vem.report.page import Page, Section
from tmc_vem.report.write import to_html, to_markdown
from tmc_vem.results.contact.contact import ContactReport
from tmc_vem.results.plausibility import ERROR, WARNING, Finding
from tmc_vem.results.run_result import RunResult
from tmc_vem.results.snapshots import Snapshot
from tmc_vem.system.fields import Fields, Polygons


def result(**changes: object) -> RunResult:
    values = {"inputs": {}, "versions": {}, "complete": True, "reason": "", "load": 1.0, "n_cells": 1, "n_dofs": 8,
              "newton_iterations": 1, "cut_backs": 0, "projection_degrees": {}, "seconds": {"total": 1.0},
              "history": (), "directory": Path("run")}  # fmt: skip
    return RunResult(**{**values, **changes})  # type: ignore[arg-type]


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e3])
@pytest.mark.parametrize(("depth", "area", "said"), [(1e-3, 0.0, True), (0.0, 1e-5, True), (1e-8, 1e-8, False)])
def test_overlaps_are_compared_with_the_size_of_the_domain(
    size: float, depth: float, area: float, said: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    square = size * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    polygons = Polygons(square, np.array([0, 4]), np.arange(4), np.array([0]), ("solid",))
    one = np.ones(1)
    contact = ContactReport(area * size**2, depth * size, 0.0, None, 0, None, None, None)
    monkeypatch.setattr(cautions, "snapshots", lambda _: [Snapshot(1.0, ())])
    monkeypatch.setattr(cautions, "read_fields", lambda *_: Fields(polygons, 0.0 * square, one, one, one))
    monkeypatch.setattr(cautions, "check_contact", lambda *_, **__: contact)
    rows, findings = cautions.of_contact({"a": result()})
    assert rows == [["a", contact.summary()]]
    assert [f.severity for f in findings] == ([ERROR] if said else [])
    told = result(errors=[f"{contact.summary()}: use smaller cells"])
    assert cautions.of_contact({"a": told})[1] == []


def test_errors_stand_first_in_a_report() -> None:
    runs = {"a": result(warnings=["doubtful"]), "b": result(errors=["wrong"], warnings=["doubtful"])}
    block = cautions.listed(cautions.of_runs(runs))
    assert (list(block.errors), list(block.messages)) == (["b: wrong"], ["a, b: doubtful"])
    page = Page("t", "l", [Section("s", [block])])
    assert to_markdown(page).index("- **Error:** b: wrong") < to_markdown(page).index("- **Warning:** a, b: doubtful")
    assert '<li class="error"><strong>Error:</strong> b: wrong</li>' in to_html(page)
    failed = cautions.listed([Finding(WARNING, "w"), *cautions.of_failures(["c gave no result"])])
    assert list(failed.errors) == ["c gave no result"]


@pytest.mark.parametrize("scale", [1e-16, 1e-9, 1e-6, 1.0, 1e7])
@pytest.mark.parametrize("start", [0.0, 4e3])
def test_ticks_are_told_apart_at_any_size(scale: float, start: float) -> None:
    found = ticks(scale * start, scale * (start + 1.0), 5)
    assert len(found) > 2
    assert len({label for _, label in found}) == len(found)
    for value, label in found:
        assert float(label.replace("\N{MINUS SIGN}", "-")) == pytest.approx(value, rel=1e-9, abs=1e-9 * scale)
