"""Stress and strain of a state, made of the energies' own derivatives: at quadrature points and as means of cells."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from codegen.integrand import Integrand
from codegen.stress import Stress, stress_of
from tmc_vem.support.distributed import Vec
from tmc_vem.system.discretisation import Discretisation
from tmc_vem.system.point_states import PointStates
from tmc_vem.system.tensors import CAUCHY, COMPONENTS, determinant, tensors_of

Float = NDArray[np.float64]


class Stresses:
    """Stress of the regions' energies on a discretisation.

    Args:
        system: the discretisation.
        integrands: energy by region name.

    Attributes:
        withheld: why there is no stress across the plane, and so no von Mises stress, by region; those that have it are
            not there.
    """

    def __init__(self, system: Discretisation, integrands: Mapping[str, Integrand]) -> None:
        self.system = system
        self._stress: dict[str, Stress] = {name: stress_of(integrand) for name, integrand in integrands.items()}
        self.withheld = {name: stress.reason for name, stress in self._stress.items() if stress.reason}

    def at_points(self, u: Vec, regions: Sequence[str] | None = None) -> Iterator[tuple[PointStates, dict[str, Float]]]:
        """This rank's cells at their quadrature points, with the tensors (n_cells, n_points, n_components); friction's
        shear is in the stress of media that have it.

        Args:
            u: displacements.
            regions: those that are wanted; all by default.
        """
        frictional = self.system.friction_states(u)
        rubs = next(frictional, None)
        for states in self.system.point_states(u):
            friction = None
            if (
                rubs is not None
                and rubs.points.region == states.region
                and np.array_equal(rubs.points.cells, states.cells)
            ):
                friction, rubs = rubs, next(frictional, None)
            if regions is None or states.region in regions:
                stress = self._stress[states.region]
                G = states.G_cqijk if stress.uses_second_gradient else None
                P, across = stress.at(states.F_cqij, G, states.parameters)
                if friction is not None:
                    P = P + friction.response.tau[..., None, None] * friction.slip.A_ij
                yield states, tensors_of(states.F_cqij, P, across)

    def cell_means(self, u: Vec, wanted: Sequence[str]) -> dict[str, Float]:
        """Means (n_cells, n_components) of tensors over this rank's cells: F and P over the reference area, the Cauchy
        stress over the deformed one."""
        n_cells = len(self.system.cell_numbers())
        found = {name: np.full((n_cells, len(COMPONENTS[name])), np.nan) for name in wanted}
        for states, tensors in self.at_points(u):
            for name in wanted:
                found[name][states.cells] = mean_of(name, states.w_cq, tensors)
        return found


def mean_of(name: str, w_cq: Float, tensors: Mapping[str, Float]) -> Float:
    """Mean (n_cells, n_components) of a tensor over cells."""
    weight_cq = w_cq * determinant(tensors["deformation_gradient"]) if name == CAUCHY else w_cq
    mean: Float = (weight_cq[:, None] @ tensors[name])[:, 0] / weight_cq.sum(axis=1)[:, None]
    return mean
