"""What every problem says about itself; it holds data only and solves nothing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from codegen.integrand import Integrand, second_gradient_energy
from tmc_vem.energy import Energy, densities, hyperelastic_solid, third_medium
from tmc_vem.mesh.make.outline import Arc
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems.graded import ByFormulas, OfMedium, OfSolid
from tmc_vem.problems.materials import Material, Medium
from tmc_vem.problems.moduli import Moduli
from tmc_vem.problems.probes import Probe
from tmc_vem.support.errors import InputError
from tmc_vem.support.units import Units
from tmc_vem.support.validation import require_choice
from tmc_vem.system.constraints import Condition
from tmc_vem.system.forces import Force
from tmc_vem.system.friction_settings import Friction
from tmc_vem.system.graded import Graded
from tmc_vem.system.stage import Stage

HOLDS = ("medium",)


@dataclass(frozen=True)
class RegionEnergy:
    """What a region is made of.

    Attributes:
        energy: its density.
        values: of the density's parameters.
        is_medium: whether it is the third medium.
        hold: ``"medium"`` for a solid that may have no supports of its own, as the medium is meant to hold it.
        material: of a solid that has one by name, which knows its moduli at small strains.
        graded: parameters that vary from cell to cell; ``values`` has the number that their factors multiply.
        friction: of a medium with some.
    """

    energy: Energy
    values: Mapping[str, float]
    is_medium: bool = False
    hold: str | None = None
    material: Material | None = None
    graded: Graded | None = None
    friction: Friction | None = None

    def __post_init__(self) -> None:
        check_hold(self.hold, self.is_medium)

    @property
    def moduli(self) -> Moduli | None:
        """K and mu at small strains, if they are known."""
        if self.material is not None:
            return self.material.moduli
        return Moduli(self.values["K"], self.values["mu"]) if self.energy.density is densities.solid else None

    @property
    def integrand(self) -> Integrand:
        """The energy as the code generator and forms take it."""
        energy = self.energy
        made = second_gradient_energy(energy.density, energy.name, energy.parameters, energy.description)
        return made if self.graded is None else made.varying(self.graded.names)


def check_hold(hold: str | None, is_medium: bool) -> None:
    """Check what is said to hold a region.

    Raises:
        InputError: it is not the medium, or the region is medium itself.
    """
    if hold is None:
        return
    require_choice("hold", hold, HOLDS, "leave it out for a body that supports hold")
    if is_medium:
        raise InputError("hold is for solids: a medium hangs on what is around it")


def solid_region(material: Material, hold: str | None = None, graded: Mapping[str, str] | None = None) -> RegionEnergy:
    """Region of a hyperelastic solid.

    Args:
        material: what it is made of.
        hold: see :class:`RegionEnergy`.
        graded: formulas of numbers of the material that vary from cell to cell, see :mod:`tmc_vem.problems.graded`.

    Raises:
        InputError: a formula is not usable.
    """
    energy = hyperelastic_solid(material.model, material.volumetric)
    varying = ByFormulas(OfSolid(material), graded) if graded else None
    return RegionEnergy(energy, material.values, hold=hold, material=material, graded=varying)


def medium_region(
    medium: Medium, mu: float, h: float | None = None, graded: Mapping[str, str] | None = None
) -> RegionEnergy:
    """Region of third medium.

    Args:
        medium: what it is made of.
        mu: shear modulus of the solid around it, at small strains.
        h: initial width of the gap, if it is known.
        graded: formulas of numbers of the medium that vary from cell to cell, ``mu`` is one of them.

    Raises:
        InputError: the medium has alpha, and the width is not known; or a formula is not usable.
    """
    energy = third_medium(
        medium.resolve()[0], damped=medium.beta > 0.0, medium=medium.energy, volumetric=medium.log_j > 0.0
    )
    varying = ByFormulas(OfMedium(medium, mu, h), graded) if graded else None
    return RegionEnergy(energy, medium.values(mu, h), is_medium=True, graded=varying, friction=medium.coulomb)


class Problem(Protocol):
    """A boundary value problem: everything but the discretisation and the solver.

    One whose supports change over the run has a method ``stages() -> Sequence[Stage]``, see :func:`stages_of`. One with
    forces or springs has a method ``forces() -> Sequence[Force]`` besides, see :func:`forces_of`.
    """

    @property
    def name(self) -> str:
        """Short name, as on the command line."""

    def make_mesh(self) -> PolygonMesh:
        """The mesh, with regions and named points; called on one rank only.

        Raises:
            InputError: the number of cells does not fit the geometry.
        """

    def regions(self) -> Mapping[str, RegionEnergy]:
        """Energy of every region of the mesh."""

    def prescribed(self) -> Sequence[Condition]:
        """Supports and loads."""

    def probes(self) -> Mapping[str, Probe]:
        """What is measured at every load step, by name; reports compare problems by ``gap``, if there is one."""

    def units(self) -> Units:
        """Units of its lengths and forces, ``Units()`` if it has none in particular."""

    def load(self) -> Condition | Force:
        """The load that is reported first, with its displacement and reaction; see :mod:`tmc_vem.simulation.measured`
        for what these are if it is none of a displacement. Loads with names are reported by name as well."""

    def inputs(self) -> dict[str, Any]:
        """All parameters as plain values for result files."""


def media_of(problem: Problem) -> list[str]:
    """Names of the regions that are third medium."""
    return [name for name, region in problem.regions().items() if region.is_medium]


def with_friction(problem: Problem) -> list[str]:
    """Names of the regions with friction."""
    return [name for name, region in problem.regions().items() if region.friction is not None]


def stages_of(problem: Problem) -> tuple[Stage, ...]:
    """Stages of a problem that has a method ``stages()``; none of one that says nothing of any."""
    method = getattr(problem, "stages", None)
    return () if method is None else tuple(method())


def curves_of(problem: Problem) -> tuple[Arc, ...]:
    """Curved pieces of outlines that a mesh follows when it is refined, of a problem that has a method ``curves()``;
    none of one that says nothing of any."""
    method = getattr(problem, "curves", None)
    return () if method is None else tuple(method())


def forces_of(problem: Problem) -> tuple[Force, ...]:
    """Forces and springs of a problem; none of one that says nothing of any."""
    method = getattr(problem, "forces", None)
    return () if method is None else tuple(method())
