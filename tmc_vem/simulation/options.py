"""How a problem is discretised and solved."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from tmc_vem.simulation.adapt_settings import AdaptSettings
from tmc_vem.support.errors import InputError
from tmc_vem.support.settings import about, described
from tmc_vem.support.validation import check_fields, require_finite, require_known, require_positive, shown
from tmc_vem.system.fem_settings import FemSettings
from tmc_vem.system.friction_settings import FRICTION_ERROR
from tmc_vem.vem.spaces.element_settings import ElementSettings

METHODS = ("vem", "fem")
CONTINUED = ("gamma", "alpha_r")
PATH = "path"  # of extrapolate_gamma: at loads along the path as well


@described
@dataclass(frozen=True)
class RunOptions:
    """How a problem is discretised and solved."""

    method: str = field(
        default="vem",
        metadata=about("Virtual elements, or Lagrange elements in dolfinx for comparison.", choices=METHODS),
    )
    element: ElementSettings = field(
        default_factory=ElementSettings,
        metadata=about("Order, projection and quadrature of the virtual elements."),
    )
    fem: FemSettings = field(
        default_factory=FemSettings,
        metadata=about("Order, quadrature and interior penalty of the Lagrange elements."),
    )
    adapt: AdaptSettings = field(
        default_factory=AdaptSettings,
        metadata=about("Results that the mesh is adapted to, and how far; by default it is taken as it is."),
    )
    steps: int | None = field(
        default=None, metadata=about("Equal load steps (the paper's box: 100).", none="automatic steps")
    )
    largest_step: float = field(
        default=0.1, metadata=about("Largest automatic step, as a fraction of the load, above 0 and up to 1.")
    )
    solver: str = field(
        default="direct",
        metadata=about(
            "Linear solver: direct; reproducible (same bits in every run on as many ranks); iterative; or FILE with "
            "PETSc options, such as -tmc_ksp_type."
        ),
    )
    path: tuple[float, ...] = field(
        default=(0.0, 1.0),
        metadata=about(
            "Load factors to go through one after another: 0 1 0 1 to load, unload and load again.",
            detail="As a tuple, (0, 1, 0, 1); the first is 0.",
        ),
    )
    output_loads: tuple[float, ...] = field(
        default=(), metadata=about("Load factor to hit exactly and write, besides those of the path.")
    )
    continuation: Mapping[str, float] = field(
        default_factory=dict,
        metadata=about(
            "Load with this gamma or alpha_r, then bring it to the wanted value at full load.",
            detail="The first leg of the path is gone with it; at its end the parameter is brought to that of the "
            "problem step by step, and the rest of the path follows.",
        ),
    )
    follow: bool = field(
        default=False,
        metadata=about(
            "Follow the branch through limit points, where the load goes back, instead of jumping to another.",
            detail="It is followed by its length.",
        ),
    )
    extrapolate_gamma: bool | str = field(
        default=False,
        metadata=about(
            "Lower gamma at the last load, and give the limit of everything that is reported for gamma to 0, with its "
            "uncertainty; with 'path' also at loads along the path.",
            detail="True, or 'path'. What the run reports otherwise is that of its own gamma, as without this.",
        ),
    )
    gamma_decades: int = field(
        default=2, metadata=about("By how many decades gamma is lowered for its limit, from 2, which is usual, to 6.")
    )
    friction_error: float = field(
        default=FRICTION_ERROR,
        metadata=about(
            "Friction may be behind by this part of the largest friction in a step: automatic steps are shortened, and "
            "where it was more the result says so.",
            detail="Steps are of first order: half of it takes twice as many. Above 0 and up to 1.",
        ),
    )
    allow_overlap: bool = field(
        default=False,
        metadata=about("Go on where solids overlap, for those who study it: such states are refused else."),
    )
    max_iterations: int | None = field(
        default=None,
        metadata=about(
            "Stop after this many Newton iterations; resume goes on.",
            none="no limit",
            detail="Failed attempts count.",
        ),
    )
    max_seconds: float | None = field(
        default=None, metadata=about("Stop after this wall time; resume goes on.", none="no limit")
    )
    snapshots: int = field(default=10, metadata=about("Load steps written for ParaView, evenly spread over the load."))
    triangulated: bool = field(
        default=False,
        metadata=about("Write them once more, cut into triangles, in which all filters of VTK are exact."),
    )
    fields: str = field(
        default="cauchy_stress,von_mises",
        metadata=about(
            "Stress and strain in them, of cells and recovered at points: names with commas between, or none. Names: "
            "cauchy_stress, first_piola_stress, deformation_gradient, von_mises, principal_stress_1 to _3, "
            "principal_stretch_1, and those of docs/howto/stress.md."
        ),
    )
    checkpoint_every: int = field(default=1, metadata=about("Load steps from one checkpoint to the next; 0 for none."))
    overwrite: bool = field(default=False, metadata=about("Replace an earlier run in the run directory."))

    @property
    def field_names(self) -> tuple[str, ...]:
        """Names of stress and strain that are written."""
        names = tuple(name.strip() for name in self.fields.split(",") if name.strip())
        return () if names == ("none",) else names

    def __post_init__(self) -> None:
        from tmc_vem.system.tensors import require_fields  # with numpy, which options themselves do not need

        check_fields(self)
        if not 0 <= self.snapshots <= 10_000:
            raise InputError(f"snapshots = {self.snapshots}: use 0 to 10000")
        try:
            require_fields(self.field_names)
        except InputError as error:
            raise InputError(f"fields: {error}") from None
        if self.checkpoint_every < 0:
            raise InputError(f"checkpoint every {self.checkpoint_every} steps: use 1 or more, or 0 for none")
        if not 0.0 < self.largest_step <= 1.0:
            raise InputError(f"largest step = {self.largest_step:g}: use a fraction of the load, above 0 and up to 1")
        if not 0.0 < self.friction_error <= 1.0:
            raise InputError(
                f"friction_error = {self.friction_error:g}: use a part of the largest friction, above 0 and up to 1"
            )
        if self.path[:1] != (0.0,):
            raise InputError(f"load path {' '.join(f'{load:g}' for load in self.path)} must begin with 0")
        for load in self.output_loads:
            require_finite("output load", load)
            low, high = min(self.path), max(self.path)
            if self.path == RunOptions.path:  # histories may make it longer, which the problem knows
                high = max(high, load)
            if not low <= load <= high:
                raise InputError(f"output load {load:g} is not on the load path, which goes from {low:g} to {high:g}")
        if self.extrapolate_gamma not in (True, False, PATH):
            raise InputError(f"extrapolate_gamma = {shown(self.extrapolate_gamma)}: use true, false or '{PATH}'")
        if not 2 <= self.gamma_decades <= 6:
            raise InputError(f"gamma_decades = {self.gamma_decades}: use 2 to 6")
        require_known(self.continuation, CONTINUED, "continuation")
        for name, value in self.continuation.items():
            require_positive(f"continuation from {name}", value, "it is where the parameter starts from")
        for name in ("path", "output_loads", "continuation", "steps"):
            if self.follow and getattr(self, name) != getattr(RunOptions(), name):
                raise InputError(f"follow does not go with {name}: the load is not prescribed along the branch")
        for name in ("max_iterations", "max_seconds"):
            if getattr(self, name) is not None:
                require_positive(name, getattr(self, name), "or leave it out for no limit")
