"""Whether supports and loads fit together and hold everything, from names and geometry alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.mesh.rigid import FreePart, free_parts
from tmc_vem.problems.base import RegionEnergy
from tmc_vem.support.errors import InputError
from tmc_vem.system.constraints import COMPONENTS, Prescribed, is_called
from tmc_vem.system.forces import BodyForce, CavityPressure, FollowerPressure, Force, PointForce, Spring, Traction
from tmc_vem.system.unloaded import require_regions

Int = NDArray[np.int64]
Bool = NDArray[np.bool_]
_NAMES = {number: name for name, number in COMPONENTS.items()}


def vertices_at(mesh: PolygonMesh, where: str) -> Int:
    """Vertices of a named point, of a group of points and of named edges.

    Raises:
        InputError: the mesh has nothing of that name.
    """
    points = [vertex for name, vertex in mesh.named_points.items() if is_called(name, where)]
    if not points and where not in mesh.named_edges:
        raise InputError(f"the mesh has neither a point nor edges named '{where}'")
    edges = mesh.named_edges.get(where, np.empty((0, 2), dtype=np.int64))
    found: Int = np.union1d(np.array(points, dtype=np.int64), edges.ravel())
    return found


def held_components(mesh: PolygonMesh, prescribed: Sequence[Prescribed], forces: Sequence[Force] = ()) -> Bool:
    """(n_vertices, 2) which components are prescribed, or held by springs, at which vertices."""
    held = np.zeros((mesh.n_vertices, 2), dtype=np.bool_)
    for condition in prescribed:
        held[vertices_at(mesh, condition.where), condition.component] = True
    for force in forces:
        if isinstance(force, Spring):
            held[vertices_at(mesh, force.where)] |= np.array(force.stiffness) > 0.0
    return held


def check_conditions(prescribed: Sequence[Prescribed], load: Prescribed, forces: Sequence[Force] = ()) -> None:
    """Check what names alone tell.

    Args:
        prescribed: supports and the load.
        load: the one among them that is the load.
        forces: what acts besides.

    Raises:
        InputError: a component has a support and the load, or supports of different values, at places of one name; or
            nothing moves.
    """
    supports = list(prescribed)
    if load in supports:
        supports.remove(load)
    first: dict[tuple[str, int], Prescribed] = {}
    for support in supports:
        component = _NAMES[support.component]
        if (support.where, support.component) == (load.where, load.component):
            raise InputError(
                f"'{load.where}' has both a support {component} = {support.value:g} and the load {component} = "
                f"{load.value:g}: leave out one of them; the load prescribes {component} there alone"
            )
        other = first.setdefault((support.where, support.component), support)
        if other.value != support.value:
            raise InputError(
                f"'{support.where}' has two supports, {component} = {other.value:g} and {component} = "
                f"{support.value:g}: leave out one of them"
            )
    if not any(condition.value for condition in (*supports, load)) and not any(map(acts, forces)):
        raise InputError(
            f"nothing moves: the load {_NAMES[load.component]} = {load.value:g} at '{load.where}' and all supports are "
            "0; give the load the displacement that is reached at full load"
        )


def acts(force: Force) -> bool:
    """Whether a force is not 0, and no spring."""
    if isinstance(force, Spring):
        return False
    if isinstance(force, CavityPressure | FollowerPressure):
        return force.pressure != 0.0
    return any(force.traction if isinstance(force, Traction) else force.force)


def check_forces(mesh: PolygonMesh, forces: Sequence[Force]) -> None:
    """Check that what forces act on is there.

    Raises:
        InputError: it is not, or two forces have one name.
    """
    names = [force.name for force in forces]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise InputError(f"two forces are called '{twice[0]}': give each a name of its own")
    for force in forces:
        try:
            if isinstance(force, BodyForce):
                require_regions(force.regions, mesh.region_names)
            elif isinstance(force, PointForce | Spring):
                vertices_at(mesh, force.where)
            elif force.where not in mesh.named_edges:
                known = ", ".join(mesh.named_edges) or "none"
                raise InputError(f"the mesh has no edges named '{force.where}' (there are: {known})")
        except InputError as error:
            raise InputError(f"{force.name}: {error}") from None


def check_shared(mesh: PolygonMesh, prescribed: Sequence[Prescribed], load: Prescribed) -> None:
    """Check that no node gets two different values of a component, by whatever names.

    Raises:
        InputError: one does; the message names both conditions and the place.
    """
    owner_vi = np.full((mesh.n_vertices, 2), -1)
    value_vi = np.zeros((mesh.n_vertices, 2))
    for n, condition in enumerate(prescribed):
        here, i = vertices_at(mesh, condition.where), condition.component
        torn = here[(owner_vi[here, i] >= 0) & (value_vi[here, i] != condition.value)]
        if len(torn):
            x, y = mesh.points_vx[torn[0]]
            other = prescribed[int(owner_vi[torn[0], i])]
            first, second = (_called(one, load) for one in (other, condition))
            raise InputError(
                f"{first} and {second} meet at ({x:.6g}, {y:.6g}), where both cannot hold: leave out the component in "
                "one of them, or let one end before that node"
            )
        owner_vi[here, i], value_vi[here, i] = n, condition.value


def require_cells(mesh: PolygonMesh) -> None:
    """Check that every region has cells.

    Raises:
        InputError: one has none.
    """
    empty = np.setdiff1d(np.arange(len(mesh.region_names)), mesh.region_c)
    if len(empty):
        raise InputError(
            f"region '{mesh.region_names[empty[0]]}' has no cells: use smaller cells than its width, or leave it out"
        )


def require_held(
    mesh: PolygonMesh,
    regions: Mapping[str, RegionEnergy],
    prescribed: Sequence[Prescribed],
    forces: Sequence[Force] = (),
) -> None:
    """Check that supports, springs and loads remove all rigid motions of each connected part, and of each solid in the
    medium.

    Raises:
        InputError: they do not, and the region does not say that the medium is meant to hold it.
    """
    held_vi = held_components(mesh, prescribed, forces)
    every = np.ones(mesh.n_cells, dtype=np.bool_)
    for part in free_parts(mesh, every, held_vi):
        raise InputError(
            f"nothing holds part {part.number} ({_regions(mesh, part)}){_around(part)} against {part.motion}: "
            f"{_remedy(part)}"
        )
    is_solid = np.array([not regions[name].is_medium for name in mesh.region_names])[mesh.region_c]
    if is_solid.all():
        return
    for part in free_parts(mesh, is_solid, held_vi):
        names = [mesh.region_names[n] for n in np.unique(mesh.region_c[part.cells])]
        if not any(regions[name].hold for name in names):
            raise InputError(
                f"only the medium holds {_regions(mesh, part)}{_around(part)} against {part.motion}: {_remedy(part)}; "
                f'if that is meant, say hold = "medium" in [regions.{names[0]}]'
            )


def _regions(mesh: PolygonMesh, part: FreePart) -> str:
    names = [mesh.region_names[n] for n in np.unique(mesh.region_c[part.cells])]
    return f"region{'s' if len(names) > 1 else ''} {', '.join(names)}"


def _around(part: FreePart) -> str:
    return f", around ({part.middle[0]:.4g}, {part.middle[1]:.4g})," if part.n_parts > 1 else ""


def _remedy(part: FreePart) -> str:
    if part.components:
        return f"add a support with {' and '.join(part.components)} at one of its points or edges"
    return "add a support away from there, or one along edges instead of a point"


def _called(condition: Prescribed, load: Prescribed) -> str:
    kind = "load" if condition == load else "support"
    return f"{kind} {_NAMES[condition.component]} = {condition.value:g} at '{condition.where}'"
