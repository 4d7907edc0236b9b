"""Derivatives of results with respect to numbers of the problem, by adjoint fields.

One adjoint field a result, one back-substitution each; with it, derivatives by any number and by any cell are sums over
cells (``functionals_record`` has the formula). Several results and numbers share all that can be shared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.energy.mixed import STIFFNESS
from tmc_vem.problems.base import Problem, with_friction
from tmc_vem.sensitivity.changes import Change, Changes, require_cells
from tmc_vem.sensitivity.equilibrium import Adjoint, Equilibrium, Moved
from tmc_vem.sensitivity.functionals import functional_of
from tmc_vem.sensitivity.functionals_record import CellParts, Derivative, Direct, Functional
from tmc_vem.sensitivity.numbers import rate, with_value
from tmc_vem.simulation.reading import along_x_and_y
from tmc_vem.support.errors import InputError
from tmc_vem.system.sensitivity import CellDerivatives

Float = NDArray[np.float64]
Int = NDArray[np.int64]


@dataclass(frozen=True)
class Sensitivity:
    """A result at an equilibrium, and what its derivatives are made of.

    Attributes:
        name: as it was asked for.
        derivative: of the result by the state.
        adjoint: its field.
        of_cells: derivatives by parameters in this rank's cells.
    """

    name: str
    derivative: Derivative
    adjoint: Adjoint
    of_cells: Sequence[Direct]

    @property
    def value(self) -> float:
        """The result itself."""
        return self.derivative.value


class Gradients:
    """Derivatives of results at an equilibrium; all ranks make and use it together.

    Args:
        problem: what was solved.
        equilibrium: the state.
        functionals: results by how they are asked for, made for this discretisation; those that are missing are added.

    Raises:
        InputError: the problem has friction: the state depends on the path, and not on the present numbers alone.
    """

    def __init__(
        self, problem: Problem, equilibrium: Equilibrium, functionals: dict[object, Functional] | None = None
    ) -> None:
        refuse_friction(problem)
        self._problem, self.equilibrium = problem, equilibrium
        self._system = equilibrium.system
        self._comm = equilibrium.system.comm
        state = equilibrium.state
        self._changes = Changes(problem, self._system, state.u, state.position)
        self._known: dict[object, Sensitivity] = {}
        self._by: dict[str, Change] = {}
        self._moving: dict[str, Moved] = {}
        self._functionals: dict[object, Functional] = {} if functionals is None else functionals

    def sensitivity(self, of: str | Functional) -> Sensitivity:
        """A result with its adjoint field; the second time it costs nothing.

        Raises:
            InputError: there is no such result, or it has no derivative.
            SingularTangent: the linear solver failed.
        """
        if of not in self._known:
            self._known[of] = self._solve(of)
        return self._known[of]

    def by(self, name: str) -> Change:
        """What a number of the problem changes; the second time it costs nothing.

        Raises:
            InputError: there is no such number, or it makes the mesh.
        """
        if name not in self._by:
            self._by[name] = self._changes.by(name)
        return self._by[name]

    def derivative(self, of: str | Functional, change: Change) -> float:
        """Derivative of a result by a number, equal on all ranks."""
        sensitivity = self.sensitivity(of)
        derivative, field = sensitivity.derivative, sensitivity.adjoint.field
        mine = sum(float(values.sum()) for _, values in self._in_cells(sensitivity, change))
        total = 0.0
        if change.force_ni is not None:
            by_forces_ni = -along_x_and_y(self._system, field)
            if derivative.by_forces is not None:
                by_forces_ni += along_x_and_y(self._system, derivative.by_forces)
            mine += float((by_forces_ni * change.force_ni).sum())
        if change.prescribed is not None:
            moved = self._moved(change)
            total += derivative.by_u.dot(moved.u) + field.dot(moved.force)
        if derivative.reads_loads and (change.force_ni is not None or change.prescribed is not None):
            total += self._explicit(of, change)
        return float(total + sum(self._comm.allgather(mine)))

    def per_load(self, of: str | Functional) -> float:
        """Derivative of a result along the path, per load factor."""
        sensitivity, rates = self.sensitivity(of), self.equilibrium
        derivative = sensitivity.derivative
        total = derivative.per_load + sensitivity.adjoint.by_u.dot(rates.per_load)
        if derivative.on_residual is not None:
            total += derivative.on_residual.dot(rates.residual_per_load)
        if derivative.by_forces is not None:
            total -= derivative.by_forces.dot(rates.residual_per_load)
        return float(total)

    def by_cells(self, of: str | Functional, change: Change) -> Float:
        """(n_cells of the whole mesh,) derivatives of a result by a number, changed in one cell at a time; 0 in cells
        that do not have it. Equal on all ranks; the sum is the derivative by the number in all cells.

        Raises:
            InputError: the number is that of a load or a support, which no cell has.
        """
        require_cells([change])
        return self._of_whole(self._in_cells(self.sensitivity(of), change))

    def by_own_cells(self, of: str | Functional, change: Change) -> Float:
        """(n_cells,) the same of this rank's cells, which are parts of the mesh's where they are cut into triangles."""
        values_c = np.zeros(len(self._system.cell_numbers()))
        for cells, values in self._in_cells(self.sensitivity(of), change):
            values_c[cells] += values
        return values_c

    def by_stiffness(self, sensitivity: Sensitivity, regions: Sequence[str]) -> Float:
        """(n_cells of the whole mesh,) derivatives of a result by the stiffness of every cell of design regions; 0 in
        other cells. Equal on all ranks."""
        return self._of_whole(
            [
                (each.cells, each.values_ck[:, each.names.index(STIFFNESS)])
                for each in sensitivity.of_cells
                if each.region in regions
            ]
        )

    # -- parts -----------------------------------------------------------------------------------------------------

    def _solve(self, of: str | Functional) -> Sensitivity:
        system, state = self._system, self.equilibrium.state
        derivative = self._functional(of).derivative(state)
        adjoint = self.equilibrium.adjoint(derivative)
        parts = derivative.by_cells or CellParts()
        energy_weight_c = parts.energy_weight_c
        cells: list[Direct] = []
        for each in system.parameter_derivatives(state.u, adjoint.field):
            values_ck = each.residual_ck.copy()
            if energy_weight_c is not None:
                values_ck += energy_weight_c[each.cells, None] * each.energy_ck
            cells.append(Direct(each.region, each.cells, each.names, values_ck))
        if parts.chosen_c is not None and parts.field is not None:
            cells += [_chosen(each, parts.chosen_c) for each in system.parameter_derivatives(state.u, parts.field)]
        cells += parts.direct
        name = of if isinstance(of, str) else of.words
        return Sensitivity(name, derivative, adjoint, cells)

    def _moved(self, change: Change) -> Moved:
        """What a number prescribes; its force is found once for all results."""
        if change.name not in self._moving:
            assert change.prescribed is not None
            self._moving[change.name] = self.equilibrium.moved(change.prescribed)
        return self._moving[change.name]

    def _functional(self, of: str | Functional) -> Functional:
        if of not in self._functionals:
            self._functionals[of] = functional_of(of, self._problem, self._system)
        return self._functionals[of]

    def _of_whole(self, mine: Sequence[tuple[Int, Float]]) -> Float:
        """(n_cells of the whole mesh,) sums of values in cells of all ranks."""
        numbers = self._system.cell_numbers()
        n_cells = 1 + max(self._comm.allgather(int(numbers.max(initial=-1))))
        total_c = np.zeros(n_cells)
        for part in self._comm.allgather([(numbers[cells], values) for cells, values in mine]):
            for cells, values in part:
                np.add.at(total_c, cells, values)
        return total_c

    def _in_cells(self, sensitivity: Sensitivity, change: Change) -> list[tuple[Int, Float]]:
        """Cells of this rank and their shares (n_cells,) of the derivative."""
        shares = []
        for each in sensitivity.of_cells:
            slopes = change.parameters.get(each.region, {})
            for k, name in enumerate(each.names):
                if name in slopes:
                    slope = slopes[name]
                    factor = slope[each.cells] if isinstance(slope, np.ndarray) else slope
                    shares.append((each.cells, each.values_ck[:, k] * factor))
        return shares

    def _explicit(self, of: str | Functional, change: Change) -> float:
        """What a result changes by with loads while nothing moves: work of forces, a centre that moments are about."""
        state = self.equilibrium.state

        def value(v: float) -> Float:
            functional = functional_of(of, with_value(self._problem, change.name, v), self._system)
            return np.array([functional.derivative(state).value])

        return float(rate(value, change.value, self._comm)[0])


def refuse_friction(problem: Problem) -> None:
    """Check that a state depends on the present numbers alone.

    Raises:
        InputError: it depends on the path, as there is friction.
    """
    regions = with_friction(problem)
    if regions:
        raise InputError(
            f"region '{regions[0]}' has friction, with which a state depends on all steps before it: there are no "
            "derivatives; leave friction out (--friction 0)"
        )


def _chosen(each: CellDerivatives, chosen_c: NDArray[np.bool_]) -> Direct:
    kept = chosen_c[each.cells]
    return Direct(each.region, each.cells[kept], each.names, each.residual_ck[kept])
