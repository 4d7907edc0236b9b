"""Stored energies: of regions, of everything, and the mean energy density of a region."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tmc_vem.sensitivity.functionals_nodes import Nodes
from tmc_vem.sensitivity.functionals_record import CellParts, Derivative, FunctionalState
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]
Bool = NDArray[np.bool_]

ON_SIDES = 1e-9  # of the energy in cells: less than that on the sides between them is rounding


class EnergyFunctional:
    """Energy stored in some regions; its derivative by u is what their cells resist with.

    Args:
        words: what it is called.
        regions: names of the regions.
        nodes: of the discretisation.
    """

    def __init__(self, words: str, regions: tuple[str, ...], nodes: Nodes) -> None:
        self.words, self._nodes, self._regions = words, nodes, regions
        self._chosen_c = chosen_cells(nodes, regions)

    def derivative(self, state: FunctionalState) -> Derivative:
        """Value and derivatives at a state.

        Raises:
            InputError: a part of the energy is on sides between cells.
        """
        system, chosen_c = self._nodes.system, self._chosen_c
        evaluation = system.energy(state.u)
        value = sum(evaluation.regions[name].energy for name in self._regions)
        in_cells = sum(system.comm.allgather(float(system.cell_energies(state.u)[chosen_c].sum())))
        if abs(value - in_cells) > ON_SIDES * abs(in_cells):
            raise InputError(
                f"{self.words}: {value - in_cells:.3g} of {value:.3g} is that of the interior penalty, which has no "
                "derivatives here: use --interior-penalty none"
            )
        by_u = self._nodes.vector(system.internal_forces(state.u, chosen_c))
        return Derivative(value, by_u, by_cells=CellParts(energy_weight_c=chosen_c.astype(np.float64)))


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
