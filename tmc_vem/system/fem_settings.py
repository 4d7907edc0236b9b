"""Choices for the finite element discretisation."""

from __future__ import annotations

from dataclasses import dataclass, field

from tmc_vem.support.errors import InputError
from tmc_vem.support.settings import about, described
from tmc_vem.support.validation import check_fields, require_positive
from tmc_vem.system.interior_penalty import INTERIOR_PENALTIES


@described
@dataclass(frozen=True)
class FemSettings:
    """Element, quadrature and treatment of the second gradient."""

    order: int = field(default=2, metadata=about("Polynomial degree of the elements: 2 or 3."))
    quadrature: int = field(
        default=4,
        metadata=about(
            "Degree of the rule in cells and on facets.",
            detail="4 means 3 x 3 points on quadrilaterals and 6 on triangles for every order; degrees 2 and 3 let "
            "quadratic quadrilaterals hourglass.",
        ),
    )
    interior_penalty: str = field(
        default="none",
        metadata=about(
            "Jumps of the gradient between cells of the medium.",
            choices=INTERIOR_PENALTIES,
            detail="'none' takes second derivatives inside the cells only, 'penalty' adds a penalty on jumps of the "
            "gradient across sides in the medium, 'full' adds the consistency term as well.",
        ),
    )
    eta: float = field(default=10.0, metadata=about("Factor of the interior penalty, without a unit."))
    triangles: bool = field(default=False, metadata=about("Cut the problem's quadrilaterals in two."))

    def __post_init__(self) -> None:
        check_fields(self)
        if self.order not in (2, 3):
            raise InputError(f"finite element order {self.order}: use 2 or 3, the energy has second derivatives")
        if not 2 <= self.quadrature <= 20:
            raise InputError(f"quadrature degree {self.quadrature}: use 2 to 20")
        require_positive("eta", self.eta, "10 is a sane value")
