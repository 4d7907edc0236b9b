"""What is said of a region's friction; without numpy, as options of the command line are made of it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from tmc_vem.support.errors import InputError

ELASTIC_SLIP = 0.2
FRICTION_ERROR = 0.01  # part of the largest friction by which it may be behind in a step


@dataclass(frozen=True)
class Friction:
    """Coulomb's friction in a third medium, see :mod:`tmc_vem.system.friction`.

    Attributes:
        coefficient: of Coulomb's law.
        elastic_slip: slip per present width of the gap at which the full shear is reached.

    Raises:
        InputError: one is not positive and finite.
    """

    coefficient: float
    elastic_slip: float = ELASTIC_SLIP

    def __post_init__(self) -> None:
        if not (math.isfinite(self.coefficient) and self.coefficient > 0.0):
            raise InputError(f"friction = {self.coefficient:g} must be a positive coefficient, try 0.3")
        if not (math.isfinite(self.elastic_slip) and self.elastic_slip > 0.0):
            raise InputError(
                f"elastic_slip = {self.elastic_slip:g} must be positive: the slip, in widths of the squeezed gap, at "
                f"which friction is reached in full, try {ELASTIC_SLIP:g}"
            )
