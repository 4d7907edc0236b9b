"""The unit of everything that has one: energies and forces are per unit of thickness, as all is plane strain."""

from __future__ import annotations

from pathlib import Path

import pytest
import pyvista

from tmc_vem import Box, Medium, RunOptions, RunResult, run
from tmc_vem.problems import Material
from tmc_vem.problems.contact_quantities import OF_BODY, OF_PAIR
from tmc_vem.problems.probes import Displacement, Gap, MeanJ, Position, Probe, Reaction
from tmc_vem.problems.wrapped import Probed
from tmc_vem.support.units import ENERGY, FORCE, LENGTH, NONE, STRESS, Units

PROBES: dict[str, Probe] = {
    "down": Displacement("uy", "load"),
    "height": Position("y", "load"),
    "opening": Gap("flange_top", "flange_bottom"),
    "left": Reaction("uy", "support_left"),
    "cavity": MeanJ("medium"),
}
WANTED = {
    "displacement": "mm", "reaction": "N/mm", "gap": "mm", "down": "mm", "height": "mm", "opening": "mm",
    "left": "N/mm", "cavity": "1", "energy_solid": "N", "energy_medium": "N", "min_j_solid": "1", "min_j_medium": "1",
    "load_force": "N",
} | {
    f"contact.{name}.{quantity}": {LENGTH: "mm", FORCE: "N/mm", ENERGY: "N", STRESS: "N/mm^2"}[kind]
    for name, kinds in (("solid", OF_BODY), ("solid-solid", OF_PAIR)) for quantity, kind in kinds.items()
}  # fmt: skip


def test_kinds_of_quantities() -> None:
    """Energy per thickness is force times length over length: a force. So is work per load factor."""
    units = Units("mm", "N")
    assert {kind: units.of(kind) for kind in (LENGTH, FORCE, ENERGY, STRESS, NONE)} == {
        LENGTH: "mm", FORCE: "N/mm", ENERGY: "N", STRESS: "N/mm^2", NONE: "1",
    }  # fmt: skip


def test_arrays_of_fields() -> None:
    assert Units("mm", "N").of_fields() == {
        "Points": "mm", "displacement": "mm", "J": "1", "min_J": "1", "energy_density": "N/mm^2", "region": "1",
        "medium": "1",
    }  # fmt: skip


def test_kinds_of_probes() -> None:
    assert {name: probe.kind for name, probe in PROBES.items()} == {
        "down": LENGTH, "height": LENGTH, "opening": LENGTH, "left": FORCE, "cavity": NONE,
    }  # fmt: skip


def test_columns_that_have_none_are_left_out() -> None:
    columns = ["step", "load", "iterations", "seconds", "time", "jumped", "parameter_gamma", "negative_pivots"]
    assert Units("mm", "N").of_columns([*columns, "displacement"], {}) == {"displacement": "mm"}


def test_units_are_those_of_a_consistent_set(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a run: history, result and fields; and in m and MN the same numbers scale as the units say."""

    def solve(scale: float, pressure: float, units: Units, out: Path | None) -> RunResult:
        monkeypatch.setattr(Box, "units", lambda self: units)
        material = {"K": 20.0 * pressure, "mu": 10.0 * pressure}
        sizes = {"length": 2.0 * scale, "height": 0.5 * scale, "wall": 0.1 * scale}
        medium = Medium(gamma=1e-4, alpha_r=pressure * scale**2)
        box = Box((20, 5), medium, Material(**material), uy=-0.1 * scale, **sizes)
        return run(Probed(box, PROBES), out, RunOptions(steps=2, snapshots=1))

    first = solve(1.0, 1.0, Units("mm", "N"), tmp_path / "box")
    assert dict(first.units) == WANTED
    heading = (tmp_path / "box" / "history.csv").read_text().splitlines()[0]
    for name, unit in WANTED.items():
        assert (f"{name} [{unit}]" if unit != "1" else name) in heading
    mesh = pyvista.read(next((tmp_path / "box" / "fields").glob("*.vtu")))
    assert mesh.cell_data["energy_density"].max() > 0.0

    scale, pressure = 3.0, 7.0
    second = solve(scale, pressure, Units(), None)
    factor = {"mm": scale, "N/mm": pressure * scale, "N": pressure * scale**2, "N/mm^2": pressure, "1": 1.0}
    mine, theirs = (result.history[-1].as_row() for result in (first, second))
    of_rounding = {f"contact.solid.{quantity}" for quantity in OF_BODY}  # a body that faces itself alone
    for name, unit in WANTED.items():
        if name in of_rounding or mine[name] == "":
            assert mine[name] == theirs[name] == "" or abs(mine[name]) < 1e-12
            continue
        assert abs(theirs[name] - factor[unit] * mine[name]) <= 1e-8 * factor[unit] * abs(mine[name]), name


def test_a_problem_without_units_has_words() -> None:
    assert Units().of(STRESS) == "force/length^2"
    assert not Units().declared
    assert Units("mm", "N").declared
