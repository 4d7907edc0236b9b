"""Thresholds, tolerances and names of files as they are documented: matters of judgement, which no case shows to the
last digit. Whoever changes one changes it here too, with docs/solver.md and the changelog."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np
import pytest

from tmc_vem.problems import hints
from tmc_vem.simulation.options import RunOptions
from tmc_vem.solve.arclength import ArcOptions
from tmc_vem.solve.newton import NewtonOptions
from tmc_vem.solve.stepping import SteppingOptions
from tmc_vem.support.settings import about_of, field_of
from tmc_vem.system.fem_settings import FemSettings
from tmc_vem.vem.spaces.element_settings import ElementSettings

THRESHOLDS: dict[str, dict[str, Any]] = {
    "solve.newton": {
        "TO_THE_BOUNDARY": 0.9, "ARMIJO": 1e-4, "SHORTEST_STEP": 1e-4, "STALLED": 0.3, "NEAR_EQUILIBRIUM": 1e-4,
        "SMALLEST_SHIFT": 1e-9, "LARGEST_SHIFT": 10.0, "ENERGY_ROUNDING": 1e-12, "SMALLEST_REACTION": 1e-6,
        "SLOWER": 2.0,
    },
    "solve.stepping": {
        "JUMP": 100.0, "FAR": 3.0, "FAR_AT_LEAST": 1e-3, "DETOURS": (10.0, 100.0),
        "STIFFER": (10.0, 100.0, 1000.0),
    },
    "solve.arclength": {"DIVERGED": 1e3, "STRAIGHT": 1.4},
    "solve.linear": {"INCONSISTENT": 1e-3, "PREFIX": "tmc_", "BAD_OPTION": (56, 60, 62, 63, 86, 92)},
    "solve.factor": {
        "WORK_SPACE_TOO_SMALL": (-8, -9, -14, -15), "NO_MEMORY": (-13, -19), "SINGULAR": -10, "MOST_ENLARGEMENTS": 10,
        "ORDERINGS": {0: "AMD", 1: "given", 2: "AMF", 3: "SCOTCH", 4: "PORD", 5: "METIS", 6: "QAMD"},
        "PARALLEL_ORDERINGS": {1: "PT-SCOTCH", 2: "ParMETIS"},
    },
    "solve.path": {"DECADE": 0.2, "CLOSE": 1e-12},
    "solve.states": {"ORDER": 5, "KEPT": 4, "SLOPES_KEPT": 3, "ON_LINE": 1e-9},
    "solve.prediction": {
        "SMALL_WAY": 1e-6, "SOLUTIONS": 2, "WORTH": 1e-3, "WRONG": 0.5, "REACH": 2.0, "CONTRACTION": 0.1,
        "A_LITTLE_LESS": 0.95, "LEAST": 0.25, "CUTS": 5,
    },
    "solve.sizes": {"DONE": 1e-12},
    "problems.hints": {"ENOUGH_ALPHA": 2.5, "SHORT_LENGTH": 0.25, "NEAR": 0.5, "NEAR_CORNER": 0.75, "AT_CORNER": 0.1},
    "problems.examine": {"STIFF": 1e3, "ABSURD": 1e6, "FAR": 2.0, "SAME": 1e-9},
    "problems.box": {"VORONOI_SIZE": 1.2, "WIDEST": 0.7},
    "problems.own": {"ON": 1e-6},
    "results.plausibility": {
        "LARGE_GAMMA": 1e-2, "MEDIUM_REACTION": 0.05, "UNSQUEEZED": 0.5, "SMALLEST_SOLID_J": 0.2,
        "SMALLEST_MEDIUM_J": 1e-6, "FEW": 4, "SAME": 1e-9,
    },
    "results.contact.contact": {"CLOSED": 0.1, "NEAR": 0.05, "ROUNDING": 1e-12, "OVERLAP": 1e-6, "EQUAL": 1e-9},
    "results.contact.solids": {"SAME": 1.2345e-9, "CELLS_AT_ONCE": 8192, "PAIRS_AT_ONCE": 2**20},
    "results.lock": {"LOCK": "run.lock", "INSTANT": 0.02, "ATTEMPTS": 5},
    "results.records": {
        "RESULT": "result.json", "HISTORY": "history.csv", "FIELDS": "fields", "COLLECTION": "fields.pvd",
        "PICTURE": "deformed.png", "TRIANGULATED": "triangulated",
        "MARKS": ("result.json", "run.json", "command.json", "checkpoint.npz"),
    },
    "results.vtu": {"BLOCK": 2**20, "STORED": 0, "COMPRESSED": 1},
    "simulation.checkpoint": {"SCHEMA": 4, "DURABLE": 10.0, "TOLERANCE": 1e-9, "PARTS": "checkpoint-part-*.npz"},
    "simulation.discretised": {"MEDIUM_COST": 2.5},
    "simulation.overlap": {"SQUEEZED": 0.1, "PIECES": 8, "PASSED": 0.25, "PER_THICKNESS": 4.0, "MOST_BETWEEN": 64},
    "simulation.plan": {"LONGEST_BRANCH": 10},
    "study.batch_worker": {"KILLED": 137},
    "study.compare": {"COST": {"vem": 1.0, "fem": 2.0}},
    "study.paper.jobs": {"COST": {"vem": 1.0, "fem": 1.2}},
    "study.paper.point_loads": {"LOADED": ((1.0, 0.5), (1.0, 0.4)), "SUPPORTED": ((0.0, 0.0), (0.0, 0.1))},
    "support.parallel": {"PATIENCE": 20.0},
    "support.vtk_types": {"BLUNT": 1e-4},
    "system.places": {"ROUNDING": 1e-6},
    "cli.columns": {"WHOLE": 10_000},
    "cli.list": {"WIDEST": 24, "RESULTS": ("load", "gap", "reaction", "doubts")},
    "cli.progress": {"SILENCE": 20.0},
}  # fmt: skip


@pytest.mark.parametrize("module", THRESHOLDS)
def test_thresholds_are_those_that_are_documented(module: str) -> None:
    found = importlib.import_module(f"tmc_vem.{module}")
    assert {name: getattr(found, name) for name in THRESHOLDS[module]} == THRESHOLDS[module]


def test_angles_of_hints() -> None:
    assert np.rad2deg(hints.SHARP) == pytest.approx(130.0)
    assert np.rad2deg(np.arccos(hints.OPPOSITE)) == pytest.approx(28.0)
    assert np.rad2deg(np.arccos(hints.STRAIGHT)) == pytest.approx(37.0)
    assert {
        f"medium_balanced_{name}{damped}" for name in ("angle_log", "huhu_log") for damped in ("", "_damped")
    } == hints.DRAWS_NOTHING_IN


def test_defaults_of_solvers() -> None:
    assert NewtonOptions() == NewtonOptions(1e-8, 1e-7, 1e-6, 1e-5, 20)
    assert SteppingOptions() == SteppingOptions(None, 0.01, 0.1, 1e-5, 4, 2.0, 5, True, True)
    assert ArcOptions() == ArcOptions(0.01, 0.1, 1e-6, 4, 1.5, 12, 5000)


# choices, what None stands for, and the first words of what only the API says
SAID: dict[tuple[Any, str], tuple[tuple[str, ...], str, str]] = {
    (RunOptions, "method"): (("vem", "fem"), "", ""),
    (RunOptions, "steps"): ((), "automatic steps", ""),
    (RunOptions, "path"): ((), "", "As a tuple"),
    (RunOptions, "continuation"): ((), "", "The first leg"),
    (RunOptions, "follow"): ((), "", "It is followed"),
    (RunOptions, "max_iterations"): ((), "no limit", "Failed attempts"),
    (RunOptions, "max_seconds"): ((), "no limit", ""),
    (FemSettings, "quadrature"): ((), "", "4 means 3 x 3"),
    (FemSettings, "interior_penalty"): (("none", "penalty", "full"), "", "'none' takes"),
    (ElementSettings, "order"): ((), "", ""),
}


@pytest.mark.parametrize(("cls", "name"), SAID, ids=lambda value: getattr(value, "__name__", value))
def test_settings_say_what_they_may_be(cls: Any, name: str) -> None:
    said = about_of(field_of(cls, name))
    assert said is not None
    choices, none, detail = SAID[cls, name]
    assert (said.choices, said.none, said.detail[: len(detail)]) == (choices, none, detail)
    assert bool(said.detail) is bool(detail) or cls is ElementSettings
