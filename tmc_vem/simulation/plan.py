"""What is made of a run's options: the path of its load, where fields are written, its inputs as they are recorded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from tmc_vem.problems.base import Problem, forces_of, stages_of, with_friction
from tmc_vem.simulation.options import PATH, RunOptions
from tmc_vem.solve.path import ControlPath
from tmc_vem.support.errors import InputError
from tmc_vem.system.constraints import Amplitude
from tmc_vem.system.control import Control
from tmc_vem.system.histories import kinks_of

# How long a branch may be, in units of the load, with fields written along all of it.
LONGEST_BRANCH = 10


def order_of(options: RunOptions) -> int:
    """Polynomial degree along the sides of cells."""
    return options.fem.order if options.method == "fem" else options.element.order


def control_path(problem: Problem, options: RunOptions) -> ControlPath:
    """The path of loads and continued parameters that the options ask for.

    Raises:
        InputError: a load is repeated or not usable, or the problem has no medium whose parameters could be continued;
            or the branch is to be followed and the loads have histories; or friction would take another path.
    """
    kinks, loads = times_of(problem), loads_of(problem, options)
    require_own_path(problem, options)
    if options.follow and kinks not in ((), (1.0,)):
        raise InputError("follow does not go with a history or a stage: the load is not prescribed along the branch")
    if not options.continuation or len(loads) < 2:
        return ControlPath([Control(load) for load in loads], options.output_loads, kinks)
    media = [region.values for region in problem.regions().values() if region.is_medium]
    end: dict[str, float] = {}
    for name in options.continuation:
        values = {region[name] for region in media}
        if len(values) != 1:
            raise InputError(f"continuation in {name} needs one value of it in the medium, got {len(values)}")
        end[name] = values.pop()
    first, second, *rest = loads
    begin = {name: options.continuation[name] for name in end}
    corners = [Control(first, begin), Control(second, begin), Control(second, end), *(Control(x, end) for x in rest)]
    return ControlPath(corners, options.output_loads, kinks)


def require_own_path(problem: Problem, options: RunOptions) -> None:
    """Check that a problem with friction is taken along the path of its load, which friction remembers.

    Raises:
        InputError: it would be taken along another.
    """
    region = next(iter(with_friction(problem)), None)
    if region is None:
        return
    where = f"does not go with friction (in region '{region}')"
    if options.follow:
        raise InputError(
            f"follow {where}, which depends on the way of the load, an unknown along a branch: leave out one of them"
        )
    for name in options.continuation:
        raise InputError(
            f"continuation in {name} {where}: what has slipped at another {name} stays where it is; leave it out, and "
            "take smaller steps, more alpha_r or rule = 'triangles' if the medium does not follow"
        )
    if options.extrapolate_gamma and stages_of(problem):
        raise InputError(f"extrapolate_gamma {where} and [[stage]] together: leave out one of them")
    if options.extrapolate_gamma == PATH:
        raise InputError(
            f"extrapolate_gamma = '{PATH}' {where}: every gamma goes the whole path by itself, and there is a limit at "
            "its end; use extrapolate_gamma = true"
        )


def loads_of(problem: Problem, options: RunOptions) -> tuple[float, ...]:
    """The load factors to go through one after another: those of the options, or up to the last time of a history.

    Raises:
        InputError: an output load is not on the way.
    """
    kinks = kinks_of(amplitudes_of(problem))
    path = (0.0, kinks[-1]) if kinks and options.path == RunOptions.path else options.path
    stages = stages_of(problem)
    if stages and path != (0.0, path[-1]):
        raise InputError("path does not go with [[stage]]: stages follow each other in time, so leave the path out")
    if stages and stages[-1].begins >= path[-1]:
        raise InputError(
            f"stage '{stages[-1].name}' begins at {stages[-1].begins:g}, but the run ends at {path[-1]:g}: give a load "
            "a history that goes on"
        )
    for load in options.output_loads:
        low, high = min(path), max(path)
        if not low <= load <= high:
            raise InputError(f"output load {load:g} is not on the load path, which goes from {low:g} to {high:g}")
    return path


def amplitudes_of(problem: Problem) -> list[Amplitude]:
    """Of all that is prescribed."""
    return [each.amplitude for each in (*problem.prescribed(), *forces_of(problem))]


def times_of(problem: Problem) -> tuple[float, ...]:
    """Times after 0 that are hit exactly: kinks of histories, and beginnings of stages."""
    begins = {stage.begins for stage in stages_of(problem)} - {0.0}
    return tuple(sorted({*kinks_of(amplitudes_of(problem)), *begins}))


def snapshot_times(path: ControlPath, options: RunOptions) -> list[float]:
    """Where fields are written: evenly along the path, and where it must be hit exactly."""
    if not options.snapshots:
        return []
    pieces = options.snapshots * (LONGEST_BRANCH if options.follow else 1)
    return sorted({path.end * (n + 1) / options.snapshots for n in range(pieces)} | set(path.stops))


def run_inputs(problem: Problem, options: RunOptions) -> dict[str, Any]:
    """The inputs as a run directory records them; two runs with equal ones give equal results."""
    units = problem.units()
    friction = {"friction_error": options.friction_error} if with_friction(problem) else {}
    return {
        **problem.inputs(),
        **({"units": asdict(units)} if units.declared else {}),
        **_method_inputs(options),
        **friction,
        **({"adapt": asdict(options.adapt)} if options.adapt.names else {}),
    }


def _method_inputs(options: RunOptions) -> Mapping[str, Any]:
    if options.method == "fem":
        discretisation = asdict(options.fem)
    else:
        element = options.element
        discretisation = {
            "order": element.order,
            "projection": element.projection,
            "projection_degree": "spectral test" if element.degree is None else element.degree,
            "quadrature": element.quadrature_degree,
            "rule": element.rule,
            **(
                {}
                if element.interior_penalty == "none"
                else {"interior_penalty": element.interior_penalty, "eta": element.penalty_factor}
            ),
        }
    return {
        "method": options.method,
        **discretisation,
        "load_steps": "automatic" if options.steps is None else options.steps,
        "largest_step": options.largest_step,
        **({} if options.path == RunOptions.path else {"load_path": list(options.path)}),
        **({"output_loads": list(options.output_loads)} if options.output_loads else {}),
        **({"continuation": dict(options.continuation)} if options.continuation else {}),
        **({"follow": True} if options.follow else {}),
        **({"allow_overlap": True} if options.allow_overlap else {}),
        **({"extrapolate_gamma": options.extrapolate_gamma} if options.extrapolate_gamma else {}),
        **({"gamma_decades": options.gamma_decades} if options.gamma_decades != RunOptions.gamma_decades else {}),
    }
