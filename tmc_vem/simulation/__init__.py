"""One run: options, what it writes, and how it is interrupted and resumed.

The names below import what they need when they are first used. No module here is called like one of them: it would
take its place.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from tmc_vem.support.lazy import lazily

if TYPE_CHECKING:
    from tmc_vem.simulation.discretised import compile_region, discretise, require_finite_start
    from tmc_vem.simulation.options import METHODS, RunOptions
    from tmc_vem.simulation.plan import control_path, order_of, run_inputs
    from tmc_vem.simulation.simulation import Simulation, prepare, run

__all__ = [
    "METHODS",
    "RunOptions",
    "Simulation",
    "compile_region",
    "control_path",
    "discretise",
    "order_of",
    "prepare",
    "require_finite_start",
    "run",
    "run_inputs",
]

_MODULES = {
    "METHODS": "options",
    "RunOptions": "options",
    "Simulation": "simulation",
    "compile_region": "discretised",
    "control_path": "plan",
    "discretise": "discretised",
    "order_of": "plan",
    "prepare": "simulation",
    "require_finite_start": "discretised",
    "run": "simulation",
    "run_inputs": "plan",
}

__getattr__ = lazily(__name__, _MODULES)
