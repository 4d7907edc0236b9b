"""Choices for the virtual element discretisation."""

from __future__ import annotations

from dataclasses import dataclass, field

from tmc_vem.support.errors import InputError
from tmc_vem.support.settings import about, described, same_as
from tmc_vem.support.validation import check_fields, require_positive
from tmc_vem.system.fem_settings import FemSettings

RULES = ("auto", "compressed", "triangles")
PROJECTIONS = ("auto", "full", "harmonic", "macro", "composite")
LARGEST_DEGREE = 8


@described
@dataclass(frozen=True)
class ElementSettings:
    """Choices for the discretisation."""

    order: int = field(
        default=2,
        metadata=about(
            "Order k of the elements: 2 or 3; virtual elements may also have 4.",
            detail="The polynomial degree on their edges.",
        ),
    )
    degree: int | None = field(
        default=None,
        metadata=about(
            "Degree l of the gradient's projection on [P_l]^2, for experts.", none="a spectral test of each cell shape"
        ),
    )
    quadrature: int | None = field(
        default=None,
        metadata=about(
            "Degree of the rule on the sub-triangles of a cell.",
            none="the larger of 2 k and l + k - 1",
            detail="That integrates the product of a stress of degree k - 1 and a projected gradient, and so keeps the "
            "order of convergence. A lower degree is raised to l, below which constant stresses are out of balance. On "
            "the box, degrees 4 to 10 change the gap by less than one percent for k = 2.",
        ),
    )
    projection: str = field(
        default="auto",
        metadata=about(
            "What gradients are projected on. full: [P_l]^2 on all cells, as in the paper; auto: on cells without "
            "hanging nodes and many sides, else composite.",
            choices=PROJECTIONS,
            detail="'full' takes the smallest l that the spectral test allows; 'harmonic': [P_k]^2 and as many "
            "gradients of harmonic polynomials as it takes; 'macro': H(div)-conforming piecewise [P_k]^2; 'composite': "
            "gradients of continuous piecewise P_(k+1); 'auto': 'full' where l up to k + 1 does well, 'composite' "
            "elsewhere.",
        ),
    )
    rule: str = field(
        default="auto",
        metadata=about(
            "Quadrature. triangles: points in all sub-triangles of a cell; compressed: the fewest points where one "
            "polynomial describes a cell; auto: few on triangles and quadrilaterals only.",
            choices=RULES,
            detail="See :mod:`tmc_vem.vem.spaces.rules`. 'triangles' puts the rule of the full degree on every "
            "sub-triangle. 'auto' has few points on triangles and convex quadrilaterals only, and on those moves the "
            "gap of the box by 0.02 percent. The fewest points move it by 0.1 percent on quadrilaterals, by 2 to 3 on "
            "larger polygons.",
        ),
    )

    interior_penalty: str = field(default="none", metadata=same_as(FemSettings, "interior_penalty"))
    eta: float | None = field(
        default=None,
        metadata=about(
            "Factor of the interior penalty, without a unit.", none="10 (k - 1), and 10 for finite elements"
        ),
    )

    def __post_init__(self) -> None:
        check_fields(self)
        if self.eta is not None:
            require_positive("eta", self.eta, "10 is a sane value")
        if self.degree is not None and self.projection not in ("auto", "full"):
            raise InputError(f"a degree l belongs to the projection 'full': '{self.projection}' has its own")
        if self.order not in (2, 3, 4):
            raise InputError(f"element order k = {self.order}: use 2 (the paper's), 3 or 4")
        if self.degree is not None and not self.order - 1 <= self.degree <= LARGEST_DEGREE:
            raise InputError(f"projection degree l = {self.degree}: use {self.order - 1} to {LARGEST_DEGREE}")
        if self.quadrature is not None and not 2 <= self.quadrature <= 20:
            raise InputError(f"quadrature degree {self.quadrature}: use 2 to 20")

    @property
    def penalty_factor(self) -> float:
        """Factor of the interior penalty: twice the smallest with which all polygons that were tried are coercive."""
        return 10.0 * (self.order - 1) if self.eta is None else self.eta

    @property
    def quadrature_degree(self) -> int:
        """Degree of the rule on the sub-triangles, except for cells with a high l; see :meth:`rule_degree`."""
        return 2 * self.order if self.quadrature is None else self.quadrature

    def rule_degree(self, degree: int) -> int:
        """Degree of the rule on the sub-triangles of cells with the projection degree l = ``degree``."""
        if self.quadrature is None:
            return max(2 * self.order, degree + self.order - 1)
        return max(self.quadrature, degree)
