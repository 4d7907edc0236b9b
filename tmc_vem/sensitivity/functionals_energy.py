"""Stored energies: of regions, of everything, and the mean energy density of a region."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tmc_vem.problems.base import Problem, media_of
from tmc_vem.sensitivity.functionals_nodes import Nodes
from tmc_vem.sensitivity.functionals_record import CellParts, Derivative, FunctionalState
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]
Bool = NDArray[np.bool_]

NOTHING = 1e-13  # of the energy of the medium: less than this on the sides between its cells is rounding


class EnergyFunctional:
    """Energy stored in some regions, that on the sides between cells included; its derivative by u is their force.

    What is on sides is known as a whole: what resists less what the cells do. It is the medium's, of which there is one
    then.

    Args:
        words: what it is called.
        regions: names of the regions.
        problem: whose regions.
        nodes: of the discretisation.
    """

    def __init__(self, words: str, regions: tuple[str, ...], problem: Problem, nodes: Nodes) -> None:
        self.words, self._nodes, self._regions = words, nodes, regions
        self._media = media_of(problem)
        self._is_all = set(regions) == set(problem.regions())
        self._chosen_c = chosen_cells(nodes, regions)

    def derivative(self, state: FunctionalState) -> Derivative:
        """Value and derivatives at a state.

        Raises:
            InputError: sides between the cells of several media have energies.
        """
        nodes, system = self._nodes, self._nodes.system
        evaluation = system.energy(state.u)
        value = sum(evaluation.regions[name].energy for name in self._regions)
        resisted_ni = nodes.along(state.residual) + system.external_forces(state.u)
        if self._is_all:
            force_ni = resisted_ni
        else:
            force_ni = system.internal_forces(state.u, self._chosen_c)
            media = set(self._media) & set(self._regions)
            if media:
                of_sides = self._of_sides(state, sum(evaluation.regions[name].energy for name in self._media))
                if of_sides and media != set(self._media):
                    raise InputError(
                        f"{self.words}: sides between cells of several media have energies, whose forces are known "
                        "together only: take the energy of all regions"
                    )
                if of_sides:
                    every = np.ones(len(self._chosen_c), dtype=np.bool_)
                    force_ni = force_ni + resisted_ni - system.internal_forces(state.u, every)
        by_u = nodes.vector(force_ni)
        return Derivative(value, by_u, by_cells=CellParts(energy_weight_c=self._chosen_c.astype(np.float64)))

    def _of_sides(self, state: FunctionalState, energy: float) -> bool:
        """Whether the energy of the media has a part that is not in their cells."""
        system = self._nodes.system
        mine = float(system.cell_energies(state.u)[chosen_cells(self._nodes, tuple(self._media))].sum())
        in_cells = sum(system.comm.allgather(mine))
        return abs(energy - in_cells) > NOTHING * abs(in_cells)


class DensityFunctional:
    """Integral or mean over a region of the energy density, what is on the sides between cells left out.

    Args:
        words: what it is called.
        region: its name.
        nodes: of the discretisation.
        mean: the mean, not the integral.
    """

    def __init__(self, words: str, region: str, nodes: Nodes, *, mean: bool) -> None:
        self.words, self._nodes = words, nodes
        self._chosen_c = chosen_cells(nodes, (region,))
        area = sum(nodes.system.comm.allgather(float(nodes.system.cell_areas()[self._chosen_c].sum())))
        self._factor = 1.0 / area if mean else 1.0

    def derivative(self, state: FunctionalState) -> Derivative:
        """Value and derivatives at a state."""
        system, chosen_c = self._nodes.system, self._chosen_c
        mine = float(system.cell_energies(state.u)[chosen_c].sum())
        value = self._factor * sum(system.comm.allgather(mine))
        by_u = self._nodes.vector(self._factor * system.internal_forces(state.u, chosen_c))
        return Derivative(value, by_u, by_cells=CellParts(energy_weight_c=self._factor * chosen_c))


def chosen_cells(nodes: Nodes, regions: tuple[str, ...]) -> Bool:
    """(n_cells,) which of this rank's cells are in some regions."""
    polygons = nodes.system.output_polygons()
    chosen: Bool = np.isin(np.array(polygons.region_names)[polygons.region_c], regions)
    return chosen
