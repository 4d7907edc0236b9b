"""What every problem says about itself; it holds data only and solves nothing."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol

from codegen.integrand import Integrand, second_gradient_energy
from tmc_vem.energy import Energy, Regulariser, hyperelastic_solid, third_medium
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems.probes import Probe
from tmc_vem.problems.regularisers import RegulariserLike, resolve_regulariser
from tmc_vem.support.errors import InputError
from tmc_vem.support.units import Units
from tmc_vem.support.validation import check_fields, require_choice, require_positive
from tmc_vem.system.constraints import Prescribed

HOLDS = ("medium",)


@dataclass(frozen=True)
class Material:
    """Hyperelastic solid (2): bulk modulus K and shear modulus mu (force per area)."""

    K: float
    mu: float

    def __post_init__(self) -> None:
        check_fields(self)
        require_positive("K", self.K, "the bulk modulus, 20 for the box of the paper")
        require_positive("mu", self.mu, "the shear modulus, 10 for the box of the paper")


@dataclass(frozen=True)
class Medium:
    """Third medium (4).

    Attributes:
        gamma: stiffness relative to the solid, far below 1.
        alpha_r: weight of the regulariser in gamma (psi_m + alpha_r psi_r): a modulus times a length squared, that is a
            force, for the regularisers of Table 1. It scales with the unit of moduli as well as with the geometry. 1 if
            alpha is not given either.
        beta: exponent of the damping factor exp(-beta J); 0 leaves the factor out.
        regulariser: name of a regulariser of Table 1, ``FILE.py:FUNCTION``, or a function ``density(F, G, p, m)``.
        parameters: values of a regulariser's own parameters.
        alpha: instead of alpha_r, the same without dimension: alpha_r = alpha mu h^2 with the shear modulus mu that
            gamma multiplies and the initial width h of the gap. 2.5 suits any geometry and any units.
    """

    gamma: float = 1e-5
    alpha_r: float | None = None
    beta: float = 5.0
    regulariser: RegulariserLike = "huhu_lulu"
    parameters: Mapping[str, float] = field(default_factory=dict)
    alpha: float | None = None

    def __post_init__(self) -> None:
        check_fields(self)
        require_positive("gamma", self.gamma, "the medium's stiffness relative to the solid, try 1e-5")
        object.__setattr__(self, "alpha_r", chosen_weight(self.alpha_r, self.alpha))
        if not (math.isfinite(self.beta) and self.beta >= 0.0):
            raise InputError(
                f"beta = {self.beta:g} must not be negative: 5 damps as in the paper, 0 switches damping off"
            )
        self.resolve()

    def resolve(self) -> tuple[Regulariser, dict[str, float]]:
        """The regulariser itself and the values of its own parameters.

        A file is executed once, when the medium is made: what becomes of it during a run changes nothing.
        """
        return self._resolved

    @cached_property
    def _resolved(self) -> tuple[Regulariser, dict[str, float]]:
        return resolve_regulariser(self.regulariser, self.parameters)

    def __getstate__(self) -> dict[str, Any]:
        """What is sent to other processes: functions of a file are not, they are found there again."""
        return {name: value for name, value in vars(self).items() if name != "_resolved"}

    def weight(self, mu: float, h: float | None) -> float:
        """alpha_r, given or from alpha.

        Args:
            mu: shear modulus that gamma multiplies.
            h: initial width of the gap, if it is known.

        Raises:
            InputError: alpha is given, and the width is not known.
        """
        if self.alpha is None:
            assert self.alpha_r is not None
            return self.alpha_r
        if h is None:
            raise InputError(f"alpha = {self.alpha:g} needs the width h of the gap: give it, or alpha_r instead")
        require_positive("h", h, "the initial width of the gap, a length")
        return self.alpha * mu * h**2

    def as_dict(self, mu: float | None = None, h: float | None = None) -> dict[str, Any]:
        """Inputs as plain values for result files; with ``mu`` and ``h`` also the alpha_r that alpha makes."""
        regulariser, parameters = self.resolve()
        made = self.alpha_r if mu is None else self.weight(mu, h)
        return {
            "gamma": self.gamma,
            **({} if made is None else {"alpha_r": made}),
            **({} if self.alpha is None else {"alpha": self.alpha}),
            **({} if self.alpha is None or h is None else {"h": h}),
            "beta": self.beta,
            "regulariser": self.regulariser if isinstance(self.regulariser, str) else regulariser.name,
            **({"parameters": parameters} if parameters else {}),
        }


def chosen_weight(alpha_r: float | None, alpha: float | None) -> float | None:
    """alpha_r, 1 if neither it nor alpha is given; None if alpha is.

    Raises:
        InputError: both are given, or one is not positive.
    """
    if alpha_r is not None and alpha is not None:
        raise InputError(
            f"alpha = {alpha:g} and alpha_r = {alpha_r:g} say one thing in two ways, alpha_r = alpha mu h^2: give one"
        )
    if alpha is not None:
        require_positive("alpha", alpha, "alpha_r / (mu h^2) with the gap's width h, try 2.5")
        return None
    chosen = 1.0 if alpha_r is None else alpha_r
    require_positive("alpha_r", chosen, "the weight of the regulariser, try 1")
    return chosen


@dataclass(frozen=True)
class RegionEnergy:
    """What a region is made of.

    Attributes:
        energy: its density.
        values: of the density's parameters.
        is_medium: whether it is the third medium.
        hold: ``"medium"`` for a solid that may have no supports of its own, as the medium is meant to hold it.
    """

    energy: Energy
    values: Mapping[str, float]
    is_medium: bool = False
    hold: str | None = None

    def __post_init__(self) -> None:
        check_hold(self.hold, self.is_medium)

    @property
    def integrand(self) -> Integrand:
        """The energy as the code generator and forms take it."""
        energy = self.energy
        return second_gradient_energy(energy.density, energy.name, energy.parameters, energy.description)


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


def solid_region(material: Material, hold: str | None = None) -> RegionEnergy:
    """Region of a hyperelastic solid."""
    return RegionEnergy(hyperelastic_solid(), {"K": material.K, "mu": material.mu}, hold=hold)


def medium_region(medium: Medium, mu: float, h: float | None = None) -> RegionEnergy:
    """Region of third medium, with the shear modulus of the solid around it and the initial width of the gap.

    Raises:
        InputError: the medium has alpha, and the width is not known.
    """
    regulariser, parameters = medium.resolve()
    energy = third_medium(regulariser, damped=medium.beta > 0.0)
    weight = medium.weight(mu, h)
    values = {"mu": mu, "gamma": medium.gamma, "alpha_r": weight, "beta": medium.beta, **parameters}
    return RegionEnergy(energy, values, is_medium=True)


class Problem(Protocol):
    """A boundary value problem: everything but the discretisation and the solver."""

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

    def prescribed(self) -> Sequence[Prescribed]:
        """Supports and loads."""

    def probes(self) -> Mapping[str, Probe]:
        """What is measured at every load step, by name; reports compare problems by ``gap``, if there is one."""

    def units(self) -> Units:
        """Units of its lengths and forces, ``Units()`` if it has none in particular."""

    def load(self) -> Prescribed:
        """The condition that carries the load; its displacement and reaction are reported."""

    def inputs(self) -> dict[str, Any]:
        """All parameters as plain values for result files."""


def media_of(problem: Problem) -> list[str]:
    """Names of the regions that are third medium."""
    return [name for name, region in problem.regions().items() if region.is_medium]
