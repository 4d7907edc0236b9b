"""Runs of the box as the pages quote them, and what problem files of the documentation give."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from tmc_vem.problems import Bodies, Box, CBox, Medium, Problem, Punch
from tmc_vem.problems.cbox import angle_medium
from tmc_vem.results.run_result import RunResult
from tmc_vem.simulation import RunOptions, run
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.system.fem_settings import FemSettings
from tmc_vem.vem.spaces.element_settings import ElementSettings


def box(cells: tuple[int, int], alpha_r: float, gamma: float, method: str = "vem", **settings: Any) -> dict[str, Any]:
    """Gap, reaction and effort.

    Args:
        cells: in x and y.
        alpha_r, gamma: of the medium.
        method: 'vem' or 'fem'.
        settings: by what they belong to, ``box``, ``medium``, ``element`` and ``fem``: other arguments of
            :class:`tmc_vem.problems.Box`, :class:`tmc_vem.problems.materials.Medium`,
            :class:`tmc_vem.vem.spaces.element_settings.ElementSettings` and
            :class:`tmc_vem.system.fem_settings.FemSettings`.
    """
    medium = Medium(gamma=gamma, alpha_r=alpha_r, **settings.get("medium", {}))
    element, fem = ElementSettings(**settings.get("element", {})), FemSettings(**settings.get("fem", {}))
    benchmark = Box(cells=(cells[0], cells[1]), medium=medium, **settings.get("box", {}))
    return values(run(benchmark, None, RunOptions(method=method, element=element, fem=fem)))


def values(result: RunResult) -> dict[str, Any]:
    """What pages say about a run."""
    last = result.history[-1]
    energy = sum(last.energy.values())
    return {
        "gap": result.gap, "first_gap": result.history[0].gap, "reaction": abs(last.reaction), "load": result.load,
        "n_cells": result.n_cells, "n_dofs": result.n_dofs, "steps": result.steps,
        "iterations": result.newton_iterations, "jumps": sum(record.jumped for record in result.history),
        "medium_energy": sum(last.energy[name] for name in result.media) / energy, "warnings": list(result.warnings),
        "inverted": sum(result.checks.get("inverted_cells", {}).values()),
        "checks": {name: value for name, value in result.checks.items() if isinstance(value, int | float)},
    }  # fmt: skip


def problem(text: str) -> dict[str, Any]:
    """Gap, reaction, effort and warnings of a problem file by its text."""
    with TemporaryDirectory() as directory:
        path = Path(directory) / "problem.toml"
        path.write_text(text)
        own, options = read_problem(path)
        return values(run(own, None, options))


def figure_problem(name: str) -> dict[str, Any]:
    """Gap, reaction, effort and checks of the hard problems of the page on the solver, and of several bodies."""
    soft = angle_medium(1e-5, 1.0)
    problems: dict[str, Problem] = {
        "cbox": CBox(uy=-1.0, medium=soft),
        "punch": Punch(stiffness=100.0, medium=soft),
        "bodies 1": Bodies(case=1),
        "bodies 2": Bodies(case=2),
    }
    return values(run(problems[name], None))
