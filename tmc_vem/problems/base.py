"""What every problem says about itself; it holds data only and solves nothing."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol

from tmc_vem.constraints import Prescribed
from tmc_vem.energy import Energy, Regulariser, hyperelastic_solid, third_medium
from tmc_vem.errors import InputError
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.probes import Probe
from tmc_vem.problems.regularisers import RegulariserLike, resolve_regulariser
from tmc_vem.units import Units
from tmc_vem.validation import check_fields, require_positive


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
        alpha_r: weight of the regulariser (length squared for (6) and (9)).
        beta: exponent of the damping factor exp(-beta J); 0 leaves the factor out.
        regulariser: name of a regulariser of Table 1, ``FILE.py:FUNCTION``, or a function ``density(F, G, p, m)``.
        parameters: values of a regulariser's own parameters.
    """

    gamma: float = 1e-5
    alpha_r: float = 1.0
    beta: float = 5.0
    regulariser: RegulariserLike = "huhu_lulu"
    parameters: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_fields(self)
        require_positive("gamma", self.gamma, "the medium's stiffness relative to the solid, try 1e-5")
        require_positive("alpha_r", self.alpha_r, "the weight of the regulariser, try 1")
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

    def as_dict(self) -> dict[str, Any]:
        """Inputs as plain values for result files."""
        regulariser, parameters = self.resolve()
        return {
            "gamma": self.gamma,
            "alpha_r": self.alpha_r,
            "beta": self.beta,
            "regulariser": self.regulariser if isinstance(self.regulariser, str) else regulariser.name,
            **({"parameters": parameters} if parameters else {}),
        }


@dataclass(frozen=True)
class RegionEnergy:
    """Energy of a region, the values of its parameters, and whether it is the third medium."""

    energy: Energy
    values: Mapping[str, float]
    is_medium: bool = False


def solid_region(material: Material) -> RegionEnergy:
    """Region of a hyperelastic solid."""
    return RegionEnergy(hyperelastic_solid(), {"K": material.K, "mu": material.mu})


def medium_region(medium: Medium, mu: float) -> RegionEnergy:
    """Region of third medium, with the shear modulus of the solid around it."""
    regulariser, parameters = medium.resolve()
    energy = third_medium(regulariser, damped=medium.beta > 0.0)
    values = {"mu": mu, "gamma": medium.gamma, "alpha_r": medium.alpha_r, "beta": medium.beta, **parameters}
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
