"""A probe for any quantity of contact: force, pressure or width, of a body or a pair of outlines."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tmc_vem.problems.contact_quantities import OF_BODY, OF_FRICTION, OF_PAIR, joint_of, pair_name
from tmc_vem.problems.probes import Known, Probe
from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import check_fields, require_choice

if TYPE_CHECKING:
    from tmc_vem.mesh.polygon import PolygonMesh
    from tmc_vem.problems.base import RegionEnergy


@dataclass(frozen=True)
class Contact(Probe):
    """A quantity of contact.

    Attributes:
        quantity: one of ``OF_PAIR`` or ``OF_FRICTION`` of :mod:`tmc_vem.problems.contact_quantities`; of a body, one of
            ``OF_BODY`` or ``OF_FRICTION``.
        of: name of a body, or of two that face each other, as ``block-seal``.
    """

    quantity: str
    of: str

    def __post_init__(self) -> None:
        check_fields(self)
        require_choice("contact", self.quantity, {**OF_PAIR, **OF_FRICTION})

    @property
    def kind(self) -> str:
        """Kind of the quantity."""
        return {**OF_PAIR, **OF_FRICTION}[self.quantity]

    def check(self, known: Known) -> None:
        """Nothing is known without a mesh: regions may have several bodies."""

    def examine(self, mesh: PolygonMesh, regions: Mapping[str, RegionEnergy]) -> None:
        """Check that there are such bodies, and that a body has the quantity."""
        import numpy as np

        from tmc_vem.mesh.bodies import body_names

        solid = np.array([not regions[name].is_medium for name in mesh.region_names], dtype=np.bool_)
        bodies = body_names(mesh, solid[mesh.region_c])
        numbers, joint = range(len(bodies)), joint_of(bodies)
        pairs = [pair_name(bodies, (a, b), joint) for a in numbers for b in numbers if a <= b]
        if self.of not in (*bodies, *pairs):
            raise InputError(
                f"of: there is no body or pair '{self.of}': give one of {', '.join(bodies)}, or two of them in this "
                f"order with a '{joint}' between"
            )
        if self.of in bodies and self.quantity not in {**OF_BODY, **OF_FRICTION}:
            raise InputError(
                f"of: '{self.of}' is one body, which has {', '.join(OF_BODY)}: {self.quantity} is that of a pair, as "
                f"'{pairs[min(1, len(pairs) - 1)]}'"
            )

    def __str__(self) -> str:
        return f"{self.quantity} of contact, {self.of}"
