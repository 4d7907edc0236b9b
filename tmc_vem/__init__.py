"""Third medium contact on polygonal meshes with stabilization-free virtual elements.

Importing this package loads nothing heavy; the names below import what they need when they are first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from tmc_vem.moved import install as _find_moved_modules
from tmc_vem.support.lazy import lazily
from tmc_vem.support.version import VERSION as __version__

if TYPE_CHECKING:
    from tmc_vem.adapt.run import run
    from tmc_vem.design.session import optimise
    from tmc_vem.problems import Box, Material, Medium
    from tmc_vem.results.run_result import RunResult
    from tmc_vem.simulation.checkup import Checkup, check
    from tmc_vem.simulation.options import RunOptions
    from tmc_vem.simulation.simulation import Simulation, prepare

_MODULES = {
    "Box": "problems",
    "Checkup": "simulation.checkup",
    "Material": "problems",
    "Medium": "problems",
    "RunOptions": "simulation.options",
    "RunResult": "results.run_result",
    "Simulation": "simulation.simulation",
    "check": "simulation.checkup",
    "optimise": "design.session",
    "prepare": "simulation.simulation",
    "run": "adapt.run",
}

__all__ = [
    "Box",
    "Checkup",
    "Material",
    "Medium",
    "RunOptions",
    "RunResult",
    "Simulation",
    "__version__",
    "check",
    "optimise",
    "prepare",
    "run",
]

__getattr__ = lazily(__name__, _MODULES)
_find_moved_modules()
