"""Third medium contact on polygonal meshes with stabilization-free virtual elements.

Importing this package loads nothing heavy; the names below import what they need when they are first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from tmc_vem.moved import install as _find_moved_modules
from tmc_vem.support.version import VERSION as __version__

if TYPE_CHECKING:
    from tmc_vem.problems import Box, Material, Medium
    from tmc_vem.results.run_result import RunResult
    from tmc_vem.simulation.options import RunOptions
    from tmc_vem.simulation.simulation import Simulation, prepare, run

_LAZY = {
    "Box": "tmc_vem.problems",
    "Material": "tmc_vem.problems",
    "Medium": "tmc_vem.problems",
    "RunOptions": "tmc_vem.simulation.options",
    "RunResult": "tmc_vem.results.run_result",
    "Simulation": "tmc_vem.simulation.simulation",
    "prepare": "tmc_vem.simulation.simulation",
    "run": "tmc_vem.simulation.simulation",
}

__all__ = ["Box", "Material", "Medium", "RunOptions", "RunResult", "Simulation", "__version__", "prepare", "run"]


_find_moved_modules()


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        return getattr(import_module(_LAZY[name]), name)
    raise AttributeError(f"module 'tmc_vem' has no attribute '{name}'")
