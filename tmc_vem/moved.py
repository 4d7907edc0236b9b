"""Names of modules that users of earlier versions import: each is found where it is now."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Sequence
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

PREFIX = "tmc_vem."
# what documentation and demos have named
MOVED = {
    "batch": "study.batch",
    "checkpoint": "simulation.checkpoint",
    "compare": "study.compare",
    "constraints": "system.constraints",
    "errors": "support.errors",
    "export": "results.export",
    "fem.settings": "system.fem_settings",
    "fields": "system.fields",
    "gauge": "simulation.gauge",
    "mesh.far": "mesh.make.far",
    "mesh.distribute": "mesh.spread.distribute",
    "mesh.io": "mesh.files.io",
    "mesh.outline": "mesh.make.outline",
    "mesh.refine": "mesh.make.refine",
    "mesh.shapes": "mesh.make.shapes",
    "mesh.structured": "mesh.make.structured",
    "mesh.triangles": "mesh.make.triangles",
    "mesh.voronoi": "mesh.make.voronoi",
    "mesh.weld": "mesh.make.weld",
    "monitor": "simulation.monitor",
    "notes": "support.notes",
    "output": "results.output",
    "places": "system.places",
    "plausibility": "results.plausibility",
    "probes": "problems.probes",
    "problem_file": "simulation.problem_file",
    "problems.tables": "problems.description",
    "report.contact": "results.contact.contact",
    "report.snapshots": "results.snapshots",
    "reproduce": "study.paper.reproduce",
    "run_directory": "results.directory",
    "sample": "simulation.sample",
    "solve.protocol": "system.discretisation",
    "units": "support.units",
    "validation": "support.validation",
    "vem.element": "vem.spaces.element",
    "vem.monomials": "vem.spaces.monomials",
    "vem.projector": "vem.spaces.projector",
    "vem.quadrature": "vem.spaces.quadrature",
    "vtu": "results.vtu",
}


class Finder:
    """Makes a stand-in of a moved module, whose names are those of the module at its new place."""

    @staticmethod
    def find_spec(name: str, path: Sequence[str] | None = None, target: ModuleType | None = None) -> ModuleSpec | None:
        """How to import a module of ours by its old name; None for all others, such as a package called ``units``."""
        is_moved = name.startswith(PREFIX) and name.removeprefix(PREFIX) in MOVED
        return ModuleSpec(name, Finder) if is_moved else None  # type: ignore[arg-type]

    @staticmethod
    def create_module(spec: ModuleSpec) -> ModuleType | None:
        """An empty module."""

    @staticmethod
    def exec_module(module: ModuleType) -> None:
        """Forward all names."""
        old = module.__name__
        new = PREFIX + MOVED[old.removeprefix(PREFIX)]
        warnings.warn(f"{old} is now {new}", DeprecationWarning, stacklevel=2)

        def forward(name: str) -> Any:
            return getattr(import_module(new), name)

        module.__dict__["__getattr__"] = forward
        module.__doc__ = f"See :mod:`{new}`."


def install() -> None:
    """Let old names be found, once."""
    if Finder not in sys.meta_path:
        sys.meta_path.append(Finder)
