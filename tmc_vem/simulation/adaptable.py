"""What does not go with meshes that are adapted, and why."""

from __future__ import annotations

from dataclasses import replace

from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems.base import Problem, stages_of, with_friction
from tmc_vem.problems.design_region import design_regions
from tmc_vem.problems.mesh_tables import GRID
from tmc_vem.problems.own import OwnProblem
from tmc_vem.simulation.adapt_settings import ANEW, CUT
from tmc_vem.simulation.options import RunOptions
from tmc_vem.simulation.plan import loads_of
from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import shown
from tmc_vem.system.constraints import Condition

ENERGY, REACTION, DISPLACEMENT = "energy", "reaction", "displacement"


def require_adaptable(problem: Problem, options: RunOptions) -> None:
    """Check that the mesh of a problem can be adapted to what is asked for.

    Raises:
        InputError: it cannot; the message says why, and what can be done.
    """
    settings = options.adapt
    if options.method != "vem":
        raise InputError(
            f"adapt goes with virtual elements only: refinement leaves hanging nodes, which method = {options.method!r}"
            " has no elements for; leave out one of them"
        )
    known = [*problem.probes(), REACTION, ENERGY]
    if not isinstance(problem.load(), Condition):
        known.append(DISPLACEMENT)
    for name in settings.names:
        if name not in known:
            raise InputError(f"adapt: of = {shown(name)} is no result of problem '{problem.name}': {', '.join(known)}")
    if settings.meshes == ANEW and not (isinstance(problem, OwnProblem) and problem.table.shapes):
        raise InputError(
            f"adapt: meshes = '{ANEW}' is for a problem file with shapes, which meshes are made of; use '{CUT}'"
        )
    if settings.meshes == ANEW and isinstance(problem, OwnProblem) and problem.table.mesh.cells == GRID:
        raise InputError(f"adapt: meshes = '{ANEW}' and cells = '{GRID}' do not go together: all its cells are equal")
    region = next(iter(with_friction(problem)), None)
    if region is not None:
        raise InputError(
            f"adapt does not go with friction (in region '{region}'), whose state belongs to the points of one mesh"
        )
    if stages_of(problem):
        raise InputError("adapt does not go with [[stage]]: what stages keep belongs to the nodes of one mesh")
    if options.follow:
        raise InputError("adapt does not go with follow: the load of a state is an unknown along a branch")
    if options.allow_overlap:
        raise InputError("adapt does not go with allow_overlap: errors of such states mean nothing")
    designed = next(iter(design_regions(problem.regions())), None)
    if designed is not None:
        raise InputError(f"adapt does not go with the design in region '{designed}', whose densities are of its cells")
    targets_of(problem, options)


def targets_of(problem: Problem, options: RunOptions) -> tuple[float | None, ...]:
    """Load factors at which the mesh is adapted; a single None for the end of any path.

    Raises:
        InputError: one is not on the way, or there are several on a path that is more than loading.
    """
    at, loads = options.adapt.at, loads_of(problem, options)
    end = loads[-1]
    if not at or at == (end,):
        return (None,)
    if len(loads) != 2 or options.continuation:
        raise InputError(
            f"adapt: at = {list(at)} is for a load that goes from 0 to {end:g} in one way, without continuation: leave "
            "it out to adapt at the end"
        )
    if at[-1] > end:
        raise InputError(f"adapt: at = {at[-1]:g} is beyond the last load factor, {end:g}")
    return at if at[-1] == end else (*at, end)


def fitted(problem: Problem) -> tuple[Problem, PolygonMesh]:
    """A problem and its mesh; where its shapes are too narrow for its cells, with cells that are fitted there.

    Raises:
        InputError: the mesh cannot be made for another reason.
    """
    try:
        return problem, problem.make_mesh()
    except InputError:
        if not isinstance(problem, OwnProblem) or not problem.table.shapes:
            raise
        mesh = problem.table.mesh
        if mesh.fit or mesh.cells == GRID:
            raise
        other = replace(problem, table=replace(problem.table, mesh=replace(mesh, fit=True)))
        return other, other.make_mesh()
