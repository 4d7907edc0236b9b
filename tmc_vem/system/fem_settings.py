"""Choices for the finite element discretisation."""

from __future__ import annotations

from dataclasses import dataclass

from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import check_fields, require_choice, require_positive

INTERIOR_PENALTIES = ("none", "penalty", "full")


@dataclass(frozen=True)
class FemSettings:
    """Element, quadrature and treatment of the second gradient.

    Attributes:
        order: polynomial degree, 2 or 3.
        quadrature: degree of the rule in cells and on facets. 4 means 3 x 3 points on quadrilaterals and 6 on
            triangles for every order; degrees 2 and 3 let quadratic quadrilaterals hourglass.
        interior_penalty: 'none' takes second derivatives inside the elements only, 'penalty' adds a penalty on jumps of
            the gradient across facets in the medium, 'full' adds the consistency term as well.
        eta: penalty factor, without a unit.
        triangles: cut the problem's quadrilaterals in two.
    """

    order: int = 2
    quadrature: int = 4
    interior_penalty: str = "none"
    eta: float = 10.0
    triangles: bool = False

    def __post_init__(self) -> None:
        check_fields(self)
        if self.order not in (2, 3):
            raise InputError(f"finite element order {self.order}: use 2 or 3, the energy has second derivatives")
        if not 2 <= self.quadrature <= 20:
            raise InputError(f"quadrature degree {self.quadrature}: use 2 to 20")
        require_choice("interior penalty", self.interior_penalty, INTERIOR_PENALTIES)
        require_positive("eta", self.eta, "10 is a sane value")
