"""One run: options, what it writes, and how it is interrupted and resumed.

The names below import what they need when they are first used. No module here is called like one of them: it would
take its place.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

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
    "discretised": ("compile_region", "discretise", "require_finite_start"),
    "options": ("METHODS", "RunOptions"),
    "plan": ("control_path", "order_of", "run_inputs"),
    "simulation": ("Simulation", "prepare", "run"),
}


def __getattr__(name: str) -> Any:
    for module, names in _MODULES.items():
        if name in names:
            return getattr(import_module(f"{__name__}.{module}"), name)
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
