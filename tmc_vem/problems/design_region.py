"""Regions whose cells are solid, medium, or something between: what a design is made in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tmc_vem.energy.mixed import MEDIUM_MODULUS, STIFFNESS, solid_in_medium
from tmc_vem.problems.base import RegionEnergy, medium_region, solid_region
from tmc_vem.problems.materials import Material, Medium
from tmc_vem.problems.stiffness_file import StiffnessOfFile
from tmc_vem.support.errors import InputError
from tmc_vem.system.graded import Graded

Float = NDArray[np.float64]


@dataclass(frozen=True)
class UniformStiffness:
    """The same stiffness in all cells of a design region until a design is given: implements
    :class:`tmc_vem.system.graded.Graded`.

    Attributes:
        value: fraction of the solid's, from 0 to 1.

    Raises:
        InputError: it is not.
    """

    value: float
    names: tuple[str, ...] = (STIFFNESS,)

    def __post_init__(self) -> None:
        if not 0.0 <= self.value <= 1.0:
            raise InputError(
                f"stiffness = {self.value:g} of a design region must be from 0, the medium alone, to 1, the solid"
            )

    def factors(self, centroid_cx: Float, data: Mapping[str, Float]) -> Float:
        """(n_cells, 1) stiffnesses."""
        return np.full((len(centroid_cx), 1), self.value)


def design_region(
    material: Material, medium: Medium, stiffness: float | Path = 1.0, mu: float | None = None, h: float | None = None
) -> RegionEnergy:
    """Region of a solid, weighted with a stiffness from cell to cell, in a third medium.

    Args:
        material, medium: both.
        stiffness: fraction of the solid that is in all cells until a design is given, or the file of a design, see
            :mod:`tmc_vem.problems.stiffness_file`.
        mu: shear modulus that the medium's gamma multiplies; that of the solid by default.
        h: initial width of the gap, if it is known.

    Raises:
        InputError: the stiffness is not from 0 to 1, its file is no design, or the medium has friction.
    """
    graded: Graded = StiffnessOfFile(stiffness) if isinstance(stiffness, Path) else UniformStiffness(stiffness)
    if medium.coulomb is not None:
        raise InputError("a design region has no friction: there are no derivatives with it; leave friction out")
    solid, gap = solid_region(material), medium_region(medium, material.moduli.mu if mu is None else mu, h)
    values = {**solid.values, **{MEDIUM_MODULUS if name == "mu" else name: value for name, value in gap.values.items()}}
    return RegionEnergy(
        solid_in_medium(solid.energy, gap.energy),
        {**values, STIFFNESS: 1.0},
        is_medium=True,
        graded=graded,
    )


def design_regions(regions: Mapping[str, RegionEnergy]) -> tuple[str, ...]:
    """Names of the design regions."""
    return tuple(
        name for name, of in regions.items() if STIFFNESS in of.values and of.is_medium and of.graded is not None
    )
