"""A small cantilever to be designed."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tmc_vem.problems.own import OwnProblem
from tmc_vem.simulation import RunOptions
from tmc_vem.simulation.problem_file import read_problem

CANTILEVER = """\
name = "cantilever"

[mesh]
cells = "grid"
size = 0.25

[shapes]
plate = { rectangle = [0, 0, 2, 1] }

[regions.plate]
shape = "plate"
solid = { E = 1.0, nu = 0.3 }
medium = { gamma = 1e-4, alpha_r = 1e-3, beta = 5 }
stiffness = 0.3

[points]
tip = [2, 0.5]

[edges]
wall = { line = [[0, 0], [0, 1]] }

[[support]]
at = "wall"
ux = 0
uy = 0

[load]
at = "tip"
force = [0, -0.001]

[probes]
tip = { displacement = "uy", at = "tip" }

[design]
minimise = "compliance"
volume = 0.5
iterations = 6
filter = { radius = 0.4 }

[solve]
snapshots = 1
"""


def cantilever_file(directory: Path, text: str = CANTILEVER) -> Path:
    """The problem file."""
    path = directory / "cantilever.toml"
    path.write_text(text)
    return path


def cantilever(directory: Path, changes: Mapping[str, Any] | None = None) -> tuple[OwnProblem, RunOptions]:
    """The problem, with other values for some entries."""
    return read_problem(cantilever_file(directory), changes)


def design_rows(directory: Path) -> list[dict[str, str]]:
    """Rows of history.csv of a search, but for what the clock says."""
    found = list(csv.DictReader(io.StringIO((directory / "history.csv").read_text())))
    return [{name: value for name, value in row.items() if name != "seconds"} for row in found]
