"""What is checked about a problem on its mesh before anything is solved, and what is said about it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems.base import Problem, RegionEnergy, forces_of, media_of, stages_of
from tmc_vem.problems.conditions import check_conditions, check_forces, check_shared, require_cells, require_held
from tmc_vem.problems.directions import on_mesh
from tmc_vem.problems.hints import cause_at, hints, likely
from tmc_vem.problems.probes import Gap, Place, Probe, examine_probes
from tmc_vem.support.errors import InputError
from tmc_vem.system.constraints import COMPONENTS, Condition, Prescribed, PrescribedAcross
from tmc_vem.system.control import Control

# Ratios K / mu above which elements lock a little, and which are hardly meant: Poisson's ratio is 0.4995 and 0.4999995.
STIFF, ABSURD = 1e3, 1e6
# Prescribed displacements that differ by more than this multiple of the mesh's extent are hardly meant.
FAR = 2.0
# Points are one if they are as close as this fraction of the mesh's extent.
SAME = 1e-9


def examine(problem: Problem, mesh: PolygonMesh, loads: Sequence[float] = (1.0,)) -> list[str]:
    """Check that conditions, probes and regions fit the mesh and leave nothing arbitrary.

    Args:
        problem: the problem.
        mesh: its whole mesh.
        loads: load factors that are gone to.

    Returns:
        Warnings: known causes of trouble that the geometry and the moduli show.

    Raises:
        InputError: something can move freely, has two values at once, or is not there.
    """
    regions, load, forces = problem.regions(), problem.load(), forces_of(problem)
    prescribed = on_mesh(problem.prescribed(), mesh, media_of(problem))
    missing = [name for name in mesh.region_names if name not in regions]
    if missing:
        raise InputError(f"region '{missing[0]}' has no energy (given: {', '.join(regions)})")
    require_cells(mesh)
    check_conditions(problem.prescribed(), load, forces)
    check_forces(mesh, forces)
    check_shared(mesh, prescribed, load, loads)
    check_gaps(mesh, problem.probes())
    examine_probes(problem.probes(), mesh, regions)
    for stage in stages_of(problem) or (None,):
        holding = [each for each in prescribed if not each.stages or (stage and stage.name in each.stages)]
        try:
            require_held(mesh, regions, holding, forces)
        except InputError as error:
            raise InputError(f"stage '{stage.name}': {error}" if stage else str(error)) from None
    return [
        *of_moduli(regions),
        *of_displacements(mesh, prescribed, loads),
        *likely(hints(mesh, regions, prescribed, loads)),
    ]


def known_cause(problem: Problem, place: tuple[float, float] | None, loads: Sequence[float] = (1.0,)) -> str | None:
    """The sentence about the cause that is known for bodies to overlap at a place of the mesh, or None.

    Args:
        problem: the problem.
        place: coordinates in the reference configuration; None if it is not known.
        loads: load factors that are gone to.
    """
    if not place:
        return None
    mesh = problem.make_mesh()
    prescribed = on_mesh(problem.prescribed(), mesh, media_of(problem))
    cause = cause_at(hints(mesh, problem.regions(), prescribed, loads), place)
    return cause.sentence if cause else None


def check_gaps(mesh: PolygonMesh, probes: Mapping[str, Probe]) -> None:
    """Check that the two points of a gap are at two places.

    Raises:
        InputError: they are not.
    """
    for name, probe in probes.items():
        if not isinstance(probe, Gap):
            continue
        places = [_coordinates(mesh, place) for place in probe.places]
        first, second = places
        if first is None or second is None:
            continue  # said where probes are located
        if np.hypot(*(first - second)) <= SAME * np.ptp(mesh.points_vx, axis=0).max():
            raise InputError(
                f"probes: {name}: {probe} is 0 always, as both are at ({first[0]:.6g}, {first[1]:.6g}): name points on "
                "the two surfaces that approach"
            )


def of_displacements(mesh: PolygonMesh, prescribed: Sequence[Condition], loads: Sequence[float]) -> list[str]:
    """A warning about displacements that take parts of the mesh farther apart than it is large."""
    extent = float(np.ptp(mesh.points_vx, axis=0).max())
    for name, component in COMPONENTS.items():
        of_axis = [each for each in prescribed if isinstance(each, Prescribed) and each.component == component]
        for load in loads if of_axis else ():
            values = [condition.at(Control(load)) for condition in of_axis]
            far = int(np.argmax(np.abs(values)))
            apart = max(abs(values[far] - other) for other in values)
            if apart > FAR * extent:
                return [_far(f"{name} = {values[far]:g} at '{of_axis[far].where}'", apart, extent)]
    for condition in prescribed:
        if isinstance(condition, PrescribedAcross):
            apart = max((abs(condition.at(Control(load))) for load in loads), default=0.0)
            if apart > FAR * extent:
                return [_far(str(condition), apart, extent)]
    return []


def _far(said: str, apart: float, extent: float) -> str:
    return (
        f"{said} is {apart / extent:.3g} times the size of the mesh ({extent:.4g}): bodies cannot pass through each "
        "other, so check its unit and the geometry"
    )


def of_moduli(regions: Mapping[str, RegionEnergy]) -> list[str]:
    """Warnings about solids: ratios of their moduli, and strains at which their models lose stiffness."""
    found = []
    for name, region in regions.items():
        if region.material is not None:
            found += [f"region '{name}' {doubt}" for doubt in region.material.doubts()]
        if region.moduli is None:
            continue
        K, mu = region.moduli.K, region.moduli.mu
        ratio = K / mu
        said = f"region '{name}' has K / mu = {K:g} / {mu:g} = {ratio:.3g}"
        if ratio > ABSURD:
            found.append(
                f"{said}, above {ABSURD:g}: nothing is that incompressible, so check the units of K and mu; elements "
                "lock, and load steps fail. Rubber has about 1e3 to 1e4"
            )
        elif ratio >= STIFF:
            found.append(
                f"{said}, nearly incompressible ({STIFF:g} or more): displacements may lock; compare with smaller "
                "cells or order 3"
            )
        elif ratio < 1.0 / ABSURD:
            found.append(f"{said}, below {1.0 / ABSURD:g}: check the units of K and mu")
    return found


def _coordinates(mesh: PolygonMesh, place: Place) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]] | None:
    if not isinstance(place, str):
        return np.asarray(place, dtype=float)
    vertex = mesh.named_points.get(place)
    return None if vertex is None else mesh.points_vx[vertex]
