"""Whether supports and loads fit together and hold everything, from names and geometry alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.mesh.rigid import ALONG, FreePart, free_parts
from tmc_vem.problems.base import RegionEnergy
from tmc_vem.problems.design_region import design_regions
from tmc_vem.support.errors import InputError
from tmc_vem.system.constrained import is_other
from tmc_vem.system.constraints import (
    ACROSS,
    COMPONENTS,
    Condition,
    Pair,
    Prescribed,
    PrescribedAcross,
    is_called,
)
from tmc_vem.system.control import Control
from tmc_vem.system.forces import BodyForce, CavityPressure, FollowerPressure, Force, PointForce, Spring, Traction
from tmc_vem.system.unloaded import require_regions

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]
# Displacements are one if they differ by less than this fraction of the mesh's extent.
ROUNDING = 1e-12
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


def held_components(mesh: PolygonMesh, prescribed: Sequence[Condition], forces: Sequence[Force] = ()) -> Bool:
    """(n_vertices, 2) which components are prescribed, or held by springs, at which vertices."""
    held = np.zeros((mesh.n_vertices, 2), dtype=np.bool_)
    for condition in prescribed:
        for x, y in condition.axes:
            if 0.0 in (x, y):
                held[vertices_at(mesh, condition.where), int(x == 0.0)] = True
    for force in forces:
        if isinstance(force, Spring):
            held[vertices_at(mesh, force.where)] |= np.array(force.stiffness) > 0.0
    return held


def held_across(mesh: PolygonMesh, prescribed: Sequence[Condition]) -> tuple[Int, Float]:
    """Vertices (n,) with a displacement prescribed that is neither along x nor along y, and (n, 2) along what."""
    found = [
        (vertex, axis)
        for condition in prescribed
        for axis in condition.axes
        if 0.0 not in axis
        for vertex in vertices_at(mesh, condition.where).tolist()
    ]
    vertices, axes = ([each[n] for each in found] for n in (0, 1))
    return np.array(vertices, dtype=np.int64), np.array(axes, dtype=float).reshape(-1, 2)


def check_conditions(
    prescribed: Sequence[Condition], load: Condition | Force | None = None, forces: Sequence[Force] = ()
) -> None:
    """Check what names alone tell.

    Args:
        prescribed: supports and loads.
        load: the one that is reported first; others that are loads have names.
        forces: what else acts.

    Raises:
        InputError: a component has a support and a load, two loads, or supports of different values, at places of one
            name; or nothing moves.
    """
    supports = [each for each in prescribed if not each.name]
    loads = [each for each in prescribed if each.name]
    if load in supports:
        supports.remove(load)
        loads.insert(0, load)
    first: dict[tuple[str, str], Condition] = {}
    for support in supports:
        for what in _held_by(support):
            for one in loads:
                if one.where == support.where and what in _held_by(one):
                    raise InputError(
                        f"'{one.where}' has both a support {_said(support)} and the load {_said(one)}: leave out one "
                        f"of them; the load prescribes {what} there alone"
                    )
            other = first.setdefault((support.where, what), support)
            if (other.value, other.amplitude) != (support.value, support.amplitude):
                raise InputError(
                    f"'{support.where}' has two supports, {_said(other)} and {_said(support)}: leave out one of them"
                )
    for n, one in enumerate(loads):
        for other in loads[:n]:
            both = [what for what in _held_by(one) if what in _held_by(other)]
            if other.where == one.where and both:
                raise InputError(
                    f"load {_named(one)} prescribes {both[0]} at '{one.where}', as load {_named(other)} does: leave "
                    "out one of them, or give one the history of both"
                )
    if any(map(acts, forces)) or any(each.value for each in prescribed):
        return
    if isinstance(load, Prescribed):
        raise InputError(
            f"nothing moves: the load {_NAMES[load.component]} = {load.value:g} at '{load.where}' and all supports are "
            "0; give the load the displacement that is reached at full load"
        )
    raise InputError("nothing moves: all loads and supports are 0")


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


def check_shared(
    mesh: PolygonMesh,
    prescribed: Sequence[Condition],
    load: Condition | Force | None = None,
    times: Sequence[float] = (),
) -> None:
    """Check that no node gets two different displacements in one direction, by whatever names.

    Args:
        mesh: the whole mesh.
        prescribed: supports and loads, with their axes.
        load: the one that is reported first.
        times: at which they are compared, besides the full load.

    Raises:
        InputError: one does; the message names both conditions and the place.
    """
    owners: dict[int, list[tuple[Pair, Float, Condition]]] = {}
    positions = [Control(time) for time in (1.0, *times)]
    tolerance = ROUNDING * float(np.ptp(mesh.points_vx, axis=0).max())
    for condition in prescribed:
        here = vertices_at(mesh, condition.where)
        along_tkn = np.array([condition.along(position, mesh.points_vx[here]) for position in positions])
        for n, vertex in enumerate(here.tolist()):
            known = owners.setdefault(vertex, [])
            before = list(known)
            for axis, along_t in zip(condition.axes, along_tkn[:, :, n].T, strict=True):
                torn = _torn(before, axis, along_t, tolerance)
                if torn is not None:
                    x, y = mesh.points_vx[vertex]
                    first, second = (_called(one, load) for one in (torn, condition))
                    raise InputError(
                        f"{first} and {second} meet at ({x:.6g}, {y:.6g}), where both cannot hold: leave out the "
                        "component in one of them, or let one end before that node"
                    )
                if len(known) < 2 and all(is_other(axis, own) for own, _, _ in known):
                    known.append((axis, along_t, condition))


def _torn(
    known: Sequence[tuple[Pair, Float, Condition]], axis: Pair, along_t: Float, tolerance: float
) -> Condition | None:
    """The condition that does not go with another displacement along an axis, at one of several times; or None."""
    for own, values_t, condition in known:
        if not is_other(axis, own):
            sign = np.sign(own[0] * axis[0] + own[1] * axis[1])
            return condition if np.abs(along_t - sign * values_t).max() > tolerance else None
    if len(known) == 2:
        factors = np.linalg.solve(np.array([own for own, _, _ in known]).T, np.array(axis))
        follows = factors @ np.array([values_t for _, values_t, _ in known])
        return known[-1][2] if np.abs(along_t - follows).max() > tolerance else None
    return None


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
    prescribed: Sequence[Condition],
    forces: Sequence[Force] = (),
) -> None:
    """Check that supports, springs and loads remove all rigid motions of each connected part, and of each solid in the
    medium.

    Raises:
        InputError: they do not, and the region does not say that the medium is meant to hold it.
    """
    held_vi, across = held_components(mesh, prescribed, forces), held_across(mesh, prescribed)
    every = np.ones(mesh.n_cells, dtype=np.bool_)
    for part in free_parts(mesh, every, held_vi, *across):
        raise InputError(
            f"nothing holds part {part.number} ({_regions(mesh, part)}){_around(part)} against {part.motion}: "
            f"{_remedy(part)}"
        )
    designs = set(design_regions(regions))  # which hold what hangs together with them, and are not held to be solid
    is_solid = np.array([name in designs or not regions[name].is_medium for name in mesh.region_names])[mesh.region_c]
    if is_solid.all():
        return
    for part in free_parts(mesh, is_solid, held_vi, *across):
        names = [mesh.region_names[n] for n in np.unique(mesh.region_c[part.cells])]
        if not any(regions[name].hold or name in designs for name in names):
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
    if part.motion.startswith(ALONG):
        return "add a support that holds it in that direction"
    return "add a support away from there, or one along edges instead of a point"


def _called(condition: Condition, load: Condition | Force | None) -> str:
    if condition.name:
        return f"load {_named(condition)} at '{condition.where}'"
    return f"{'load' if condition == load else 'support'} {_said(condition)} at '{condition.where}'"


def _named(condition: Condition) -> str:
    return f"'{condition.name}' with {_said(condition)}" if condition.name else _said(condition)


def _said(condition: Condition) -> str:
    return str(condition).removesuffix(f" at '{condition.where}'")


def _held_by(condition: Condition) -> tuple[str, ...]:
    """What a condition prescribes, in the words of problem files."""
    if isinstance(condition, Prescribed):
        return (_NAMES[condition.component],)
    return (condition.direction,) if isinstance(condition, PrescribedAcross) else (*COMPONENTS, *ACROSS)
