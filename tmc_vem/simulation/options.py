"""How a problem is discretised and solved."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import check_fields, require_choice, require_finite, require_known, require_positive
from tmc_vem.system.fem_settings import FemSettings
from tmc_vem.vem.spaces.element import ElementSettings

METHODS = ("vem", "fem")
CONTINUED = ("gamma", "alpha_r")


@dataclass(frozen=True)
class RunOptions:
    """How a problem is discretised and solved.

    Attributes:
        method: 'vem' for virtual elements, 'fem' for Lagrange elements in dolfinx.
        element: order, projection degree and quadrature of the virtual elements.
        fem: order, quadrature and interior penalty of the Lagrange elements.
        steps: equal load steps, or None for automatic ones.
        largest_step: largest automatic step, as a fraction of the load.
        solver: linear solver, 'direct', 'reproducible', 'iterative' or a file of PETSc options.
        path: load factors to go through one after another: (0, 1, 0) loads and unloads.
        output_loads: load factors to hit exactly and write, besides those of the path.
        continuation: values of the medium's gamma or alpha_r that the first leg of the path is gone with; at its end
            they are brought to those of the problem step by step, and the rest of the path follows.
        allow_overlap: take converged states in which solids overlap, which are refused else.
        follow: follow the equilibrium branch through limit points by its length, the load going back there, instead of
            jumping to another branch.
        max_iterations: Newton iterations after which the run ends, or None; failed attempts count.
        max_seconds: wall time after which the run ends, or None.
        snapshots: load steps that are written as VTU files, evenly spread over the load.
        triangulated: write them once more with cells cut into triangles, in which all filters of VTK are exact.
        checkpoint_every: converged load steps between checkpoints in the output directory; 0 for none.
        overwrite: replace an earlier run in the output directory.
    """

    method: str = "vem"
    element: ElementSettings = field(default_factory=ElementSettings)
    fem: FemSettings = field(default_factory=FemSettings)
    steps: int | None = None
    largest_step: float = 0.1
    solver: str = "direct"
    path: tuple[float, ...] = (0.0, 1.0)
    output_loads: tuple[float, ...] = ()
    continuation: Mapping[str, float] = field(default_factory=dict)
    follow: bool = False
    allow_overlap: bool = False
    max_iterations: int | None = None
    max_seconds: float | None = None
    snapshots: int = 10
    triangulated: bool = False
    checkpoint_every: int = 1
    overwrite: bool = False

    def __post_init__(self) -> None:
        check_fields(self)
        require_choice("method", self.method, METHODS)
        if not 0 <= self.snapshots <= 10_000:
            raise InputError(f"snapshots = {self.snapshots}: use 0 to 10000")
        if self.checkpoint_every < 0:
            raise InputError(f"checkpoint every {self.checkpoint_every} steps: use 1 or more, or 0 for none")
        if not 0.0 < self.largest_step <= 1.0:
            raise InputError(f"largest step = {self.largest_step:g}: use a fraction of the load, above 0 and up to 1")
        if self.path[:1] != (0.0,):
            raise InputError(f"load path {' '.join(f'{load:g}' for load in self.path)} must begin with 0")
        for load in self.output_loads:
            require_finite("output load", load)
            low, high = min(self.path), max(self.path)
            if not low <= load <= high:
                raise InputError(f"output load {load:g} is not on the load path, which goes from {low:g} to {high:g}")
        require_known(self.continuation, CONTINUED, "continuation")
        for name, value in self.continuation.items():
            require_positive(f"continuation from {name}", value, "it is where the parameter starts from")
        for name in ("path", "output_loads", "continuation", "steps"):
            if self.follow and getattr(self, name) != getattr(RunOptions(), name):
                raise InputError(f"follow does not go with {name}: the load is not prescribed along the branch")
        for name in ("max_iterations", "max_seconds"):
            if getattr(self, name) is not None:
                require_positive(name, getattr(self, name), "or leave it out for no limit")
