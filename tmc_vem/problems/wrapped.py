"""A problem that differs from another one in a part."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from tmc_vem.mesh.make.outline import Arc
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems.base import Problem, RegionEnergy, curves_of, forces_of, stages_of
from tmc_vem.problems.probes import Probe, as_plain
from tmc_vem.support.errors import InputError
from tmc_vem.support.units import Units
from tmc_vem.system.constraints import Condition
from tmc_vem.system.forces import Force
from tmc_vem.system.stage import Stage


@dataclass(frozen=True)
class Wrapped:
    """Implements :class:`tmc_vem.problems.base.Problem` by another problem; subclasses change a part.

    Attributes:
        problem: the other one.
    """

    problem: Problem

    @property
    def name(self) -> str:
        """Name of the problem."""
        return self.problem.name

    def make_mesh(self) -> PolygonMesh:
        """Mesh of the problem."""
        return self.problem.make_mesh()

    def regions(self) -> Mapping[str, RegionEnergy]:
        """Regions of the problem."""
        return self.problem.regions()

    def prescribed(self) -> Sequence[Condition]:
        """Supports and loads of the problem."""
        return self.problem.prescribed()

    def forces(self) -> Sequence[Force]:
        """Forces and springs of the problem."""
        return forces_of(self.problem)

    def curves(self) -> Sequence[Arc]:
        """Curved pieces of outlines that the mesh follows when it is refined."""
        return curves_of(self.problem)

    def stages(self) -> Sequence[Stage]:
        """Stages of the problem."""
        return stages_of(self.problem)

    def probes(self) -> Mapping[str, Probe]:
        """Probes of the problem."""
        return self.problem.probes()

    def units(self) -> Units:
        """Units of the problem."""
        return self.problem.units()

    def load(self) -> Condition | Force:
        """Load of the problem."""
        return self.problem.load()

    def inputs(self) -> dict[str, Any]:
        """Inputs of the problem."""
        return self.problem.inputs()


@dataclass(frozen=True)
class Loaded(Wrapped):
    """A problem with more forces and springs, ``Loaded(Box(), [PointForce("push", "tip", (0.0, -1.0))])``.

    Attributes:
        more: forces and springs.
    """

    more: Sequence[Force]

    def forces(self) -> Sequence[Force]:
        """Forces of the problem, and more."""
        return (*super().forces(), *self.more)

    def inputs(self) -> dict[str, Any]:
        """Inputs of the problem, and the forces; an amplitude as it prints itself."""
        plain = [{"kind": type(each).__name__, **vars(each), "amplitude": repr(each.amplitude)} for each in self.more]
        inputs = self.problem.inputs()
        return {**inputs, "forces": [*inputs.get("forces", []), *plain]}


@dataclass(frozen=True)
class Probed(Wrapped):
    """A problem with more probes, ``Probed(Box(), {"side": Displacement("ux", (0.0, 0.25))})``.

    Attributes:
        more: probes by name.

    Raises:
        InputError: the problem has a probe of such a name already.
    """

    more: Mapping[str, Probe]

    def __post_init__(self) -> None:
        for name in self.more:
            if name in self.problem.probes():
                raise InputError(f"probes: {name}: problem '{self.name}' has one already; choose another name")

    def probes(self) -> Mapping[str, Probe]:
        """Probes of the problem, and more."""
        return {**self.problem.probes(), **self.more}

    def inputs(self) -> dict[str, Any]:
        """Inputs of the problem, and the probes."""
        return {**self.problem.inputs(), "probes": {name: as_plain(probe) for name, probe in self.more.items()}}
