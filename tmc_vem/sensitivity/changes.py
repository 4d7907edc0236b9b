"""What a problem changes by per unit of one of its numbers, on its discretisation: energies, displacements, forces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tmc_vem.problems.base import Problem, RegionEnergy, forces_of, media_of, stages_of
from tmc_vem.problems.on_mesh import OnMesh
from tmc_vem.problems.own import OwnProblem
from tmc_vem.sensitivity.numbers import nearby, rate, value_of, with_value
from tmc_vem.support.assignments import keys
from tmc_vem.support.errors import InputError
from tmc_vem.support.parallel import from_root
from tmc_vem.system.constrained import Constrained
from tmc_vem.system.constraints import Condition, PrescribedAcross
from tmc_vem.system.control import Control, parameter_of
from tmc_vem.system.discretisation import Discretisation
from tmc_vem.system.forces import Force
from tmc_vem.system.loaded import with_forces

Float = NDArray[np.float64]

# Entries of problem files that make the mesh, or that nothing is solved with.
OF_MESH = ("mesh", "shapes", "points", "edges")
OF_NOTHING = ("probes", "gap", "units", "solve", "name", "stage")
SAFE = ("material", "medium")  # of benchmarks: no part of the mesh


@dataclass(frozen=True)
class Change:
    """Derivatives by one number.

    Attributes:
        name: of the number.
        value: of it.
        parameters: by region and by parameter of its energy, of the value in this rank's cells: a number where it is
            the same in all, or (n_cells,).
        prescribed: (n,) of what is prescribed at this rank's constrained degrees of freedom; None if nothing is.
        force_ni: (n_owned_nodes, 2) of the forces along x and y at the nodes; None if there are none.
    """

    name: str
    value: float
    parameters: Mapping[str, Mapping[str, float | Float]] = field(default_factory=dict)
    prescribed: Float | None = None
    force_ni: Float | None = None


class Changes:
    """Finds out what numbers of a problem change; all ranks make and use it together.

    Args:
        problem: whose numbers.
        system: its discretisation.
        u, position: the state, on which forces depend.
    """

    def __init__(self, problem: Problem, system: Discretisation, u: object, position: Control) -> None:
        self._problem, self._system, self._u, self._position = problem, system, u, position
        self._regions = problem.regions()

    def by(self, name: str) -> Change:
        """What a number changes: one of the problem, or ``REGION.PARAMETER`` of an energy alone.

        Raises:
            InputError: there is no such number, it makes the mesh, or nothing of the equations depends on it.
        """
        own = parameter_by_name(self._problem, name)
        if own is not None:
            region, parameter = own
            value = self._position.parameters.get(
                parameter_of(region, parameter), self._regions[region].values[parameter]
            )
            slope: float | Float = 1.0
            if self._varies(region, parameter):
                slope = self._factors(self._regions[region], region, parameter)
            return Change(name, value, {region: {parameter: slope}})
        value = value_of(self._problem, name)
        self._check_place(name)
        change = Change(
            name, value, self._of_energies(name, value), self._of_prescribed(name, value), self._of_forces(name, value)
        )
        if not change.parameters and change.prescribed is None and change.force_ni is None:
            raise InputError(f"nothing that is solved for changes with '{name}'")
        return change

    # -- parts -----------------------------------------------------------------------------------------------------

    @property
    def _shaped(self) -> Problem:
        """The problem with the mesh that its numbers make, even if it is solved on another one."""
        return self._problem.problem if isinstance(self._problem, OnMesh) else self._problem

    def _check_place(self, name: str) -> None:
        """Check that a number does not make the mesh.

        Raises:
            InputError: it does.
        """
        first = keys(name)[0]
        shape = (
            f"'{name}' makes the mesh: there are derivatives by materials, media, displacements and loads, none by "
            "shapes; run the problem with values nearby, 'tmc-vem sweep'"
        )
        if isinstance(self._shaped, OwnProblem):
            if first in OF_MESH:
                raise InputError(shape)
            if first in OF_NOTHING:
                raise InputError(f"nothing that is solved for changes with '{name}'")
        elif first not in SAFE and self._moves_mesh(name):
            raise InputError(shape)

    def _moves_mesh(self, name: str) -> bool:
        """Whether a mesh differs with a number."""

        def differs() -> bool:
            try:
                other = nearby(self._shaped, name, value_of(self._shaped, name)).make_mesh().points_vx
            except InputError:  # a number of cells, say
                return True
            points = self._shaped.make_mesh().points_vx
            return points.shape != other.shape or bool((points != other).any())

        return from_root(self._system.comm, differs)

    def _of_energies(self, name: str, value: float) -> dict[str, dict[str, float | Float]]:
        """Derivatives of all parameters of all energies that change, those that vary in every cell."""
        places = [(region, parameter) for region, of in self._regions.items() for parameter in of.values]

        def values(v: float) -> Float:
            changed = self._at(name, v)
            return np.concatenate([np.ravel(self._value(changed[region], region, k)) for region, k in places])

        sizes = [np.size(self._value(self._regions[region], region, k)) for region, k in places]
        try:
            slopes = np.split(rate(values, value, self._system.comm), np.cumsum(sizes)[:-1]) if places else []
        except InputError as error:
            raise InputError(
                f"'{name}' cannot change alone ({error}); name a parameter of one energy, REGION.PARAMETER"
            ) from None
        found: dict[str, dict[str, float | Float]] = {}
        for (region, parameter), slope in zip(places, slopes, strict=True):
            if slope.any():
                found.setdefault(region, {})[parameter] = slope if self._varies(region, parameter) else float(slope[0])
        return self._everywhere(found)

    def _everywhere(self, found: dict[str, dict[str, float | Float]]) -> dict[str, dict[str, float | Float]]:
        """With what changes on other ranks only, which have cells of a region that this one has not."""
        keys_of_all = self._system.comm.allgather([(r, k) for r, of in found.items() for k in of])
        for region, parameter in {pair for part in keys_of_all for pair in part}:
            found.setdefault(region, {}).setdefault(parameter, 0.0)
        return found

    def _varies(self, region: str, parameter: str) -> bool:
        graded = self._regions[region].graded
        return graded is not None and parameter in graded.names

    def _value(self, energy: RegionEnergy, region: str, parameter: str) -> float | Float:
        if self._varies(region, parameter):
            return energy.values[parameter] * self._factors(energy, region, parameter)
        return energy.values[parameter]

    def _at(self, name: str, value: float) -> Mapping[str, RegionEnergy]:
        """Regions with another value of a number.

        Raises:
            InputError: one of them has another energy then, such as a medium that is damped.
        """
        changed = with_value(self._problem, name, value).regions()
        for region, of in self._regions.items():
            if changed[region].energy.parameters != of.energy.parameters:
                raise InputError(f"region '{region}' has another energy with other values")
        return changed

    def _factors(self, energy: RegionEnergy, region: str, parameter: str) -> Float:
        """(n_cells,) what a parameter that varies is multiplied with in this rank's cells of a region; 0 in others."""
        assert energy.graded is not None
        centroid_cx, here_c = self._cells
        factor_c = np.zeros(len(centroid_cx))
        here = here_c == region
        data = {name: values[here] for name, values in self._data.items()}
        try:
            factor_ck = energy.graded.factors(centroid_cx[here], data)
        except InputError as error:
            raise InputError(f"regions: {region}: {error}") from None
        factor_c[here] = factor_ck[:, energy.graded.names.index(parameter)]
        return factor_c

    @cached_property
    def _data(self) -> Mapping[str, Float]:
        """Cell data of the mesh by name, (n_cells,) in this rank's cells; asked for on all ranks together."""
        whole = from_root(self._system.comm, lambda: dict(self._problem.make_mesh().cell_data))
        numbers = self._system.cell_numbers()
        return {name: values[numbers] for name, values in whole.items()}

    @cached_property
    def _cells(self) -> tuple[Float, NDArray[np.str_]]:
        """(n_cells, 2) centroids of this rank's cells, and the names of their regions."""
        from tmc_vem.mesh.geometry import centroids

        polygons = self._system.output_polygons()
        corners = [polygons.points_nx[polygons.cell(c)[:: self._system.order]] for c in range(polygons.n_cells)]
        centroid_cx = np.array([centroids(polygon[None])[0] for polygon in corners]).reshape(-1, 2)
        return centroid_cx, np.array(polygons.region_names)[polygons.region_c]

    def _of_prescribed(self, name: str, value: float) -> Float | None:
        before = tuple(self._problem.prescribed())
        other = tuple(nearby(self._problem, name, value).prescribed())
        if before == other:
            return None
        if stages_of(self._problem):
            raise InputError(f"'{name}' is prescribed in a run with stages: its derivative is not known")
        on_mesh = self._system.conditions
        labels_nx = self._system.node_labels()[:, :2]

        def displacements(v: float) -> Float:
            conditions = [
                _with_value(known, new)
                for known, new in zip(on_mesh, with_value(self._problem, name, v).prescribed(), strict=True)
            ]
            held = Constrained.of(conditions, self._system.owned_nodes, labels_nx)
            same = np.array_equal(held.dofs, self._system.constrained())
            if not all(self._system.comm.allgather(same)):  # so that all ranks raise it, or none
                raise InputError(f"'{name}' changes what is held, not only how far it moves")
            return held.at(self._position)

        return rate(displacements, value, self._system.comm)

    def _of_forces(self, name: str, value: float) -> Float | None:
        before = tuple(forces_of(self._problem))
        other = tuple(forces_of(nearby(self._problem, name, value)))
        if before == other:
            return None
        return rate(lambda v: self._acting(forces_of(with_value(self._problem, name, v))), value, self._system.comm)

    def _acting(self, forces: Sequence[Force]) -> Float:
        """(n_owned_nodes, 2) what forces do at the state, whatever other forces the system has."""
        loaded = with_forces(self._system, forces, media_of(self._problem))
        loaded.set_position(self._position)
        total_ni = loaded.external_forces(self._u)  # type: ignore[arg-type]
        own_ni: Float = total_ni - self._system.external_forces(self._u)  # type: ignore[arg-type]
        self._system.set_position(self._position)
        return own_ni


def require_cells(changes: Sequence[Change]) -> list[Change]:
    """Those that belong to cells, and are not numbers of loads or supports.

    Raises:
        InputError: none does.
    """
    found = [change for change in changes if change.parameters]
    if changes and not found:
        raise InputError(f"'{changes[0].name}' belongs to no cells: it is that of a load or a support")
    return found


def parameter_by_name(problem: Problem, name: str) -> tuple[str, str] | None:
    """Region and parameter of its energy alone, if a name is one, ``solid.mu`` or ``regions.solid.solid.mu``, and the
    problem has no such number."""
    way, regions = keys(name), problem.regions()
    region, parameter = (
        way if len(way) == 2 else (way[1], way[3]) if len(way) == 4 and way[0] == "regions" else ("", "")
    )
    if region not in regions or parameter not in regions[region].values:
        return None
    try:
        value_of(problem, name)
    except InputError:
        return region, parameter
    return None


def _with_value(known: Condition, new: Condition) -> Condition:
    """A condition with the axes that it has on the mesh, and the value and amplitude of another."""
    return (
        replace(new, axis=known.axis)
        if isinstance(known, PrescribedAcross) and isinstance(new, PrescribedAcross)
        else new
    )
