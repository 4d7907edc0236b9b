"""Scalar results by name: what there is to differentiate in a problem.

A result is a probe, by its name or as an object; ``reaction`` or ``displacement`` of the load that is reported first;
``NAME.reaction`` and the like of a load with a name; ``compliance``, the work of all forces; ``energy`` or
``energy.REGION``; ``contact.BODY.force_x`` and the like; or ``p_norm.FIELD.REGION``, with another exponent than that of
the probe at its end.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache, cached_property
from typing import Any

from tmc_vem.problems.base import Problem, forces_of, media_of, with_friction
from tmc_vem.problems.columns import named_loads, pair_of
from tmc_vem.problems.contact_probe import Contact
from tmc_vem.problems.contact_quantities import OF_BODY
from tmc_vem.problems.field_probes import (
    DENSITY,
    DISPLACEMENTS,
    LARGEST,
    MEAN,
    OF_P_NORM,
    SMALLEST,
    CutForce,
    EnergyOf,
    Over,
    PNorm,
    ValueAt,
)
from tmc_vem.problems.load_tables import Load
from tmc_vem.problems.probes import Displacement, Gap, MeanJ, Position, Probe, Reaction
from tmc_vem.results.records import CONTACT, OF
from tmc_vem.sensitivity.functionals_energy import DensityFunctional, EnergyFunctional
from tmc_vem.sensitivity.functionals_fields import (
    FieldFunctional,
    FieldIntegral,
    MeanDisplacementFunctional,
    PNormFunctional,
    mean_j,
)
from tmc_vem.sensitivity.functionals_forces import ContactFunctional, CutFunctional
from tmc_vem.sensitivity.functionals_loads import ComplianceFunctional, Forces, of_load, reaction_probe
from tmc_vem.sensitivity.functionals_nodes import Nodes
from tmc_vem.sensitivity.functionals_points import GapFunctional, PointFunctional
from tmc_vem.sensitivity.functionals_record import Functional
from tmc_vem.simulation.contact_gauge import ContactGauge
from tmc_vem.support.assignments import keys
from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import require_choice
from tmc_vem.system.discretisation import Discretisation
from tmc_vem.system.forces import Spring

ENERGY, COMPLIANCE = "energy", "compliance"
P_NORM = "p_norm" + OF  # what the names of p-norms begin with; then come the field, the region, and perhaps p
Result = str | Probe | Functional
Make = Callable[[], Functional]


class Functionals:
    """The results of a problem on its discretisation; all ranks make and use it together.

    Args:
        problem: whose results.
        system: its discretisation, with the parameters of the state.

    Raises:
        InputError: results depend on the path, not on the state alone: the problem has friction, or supports that hold
            in some stages only.
    """

    def __init__(self, problem: Problem, system: Discretisation) -> None:
        require_no_history(problem)
        self._problem, self._system = problem, system
        self._probes = dict(problem.probes())
        self._gauge: Callable[[], ContactGauge] = cache(self._make_gauge)

    def of(self, result: Result) -> Functional:
        """What differentiates a result.

        Args:
            result: its name, a probe, or a functional, which is what is given back.

        Raises:
            InputError: there is no such result, or it has no derivative; the message says why, and what has one.
        """
        if isinstance(result, str):
            return self._by_name(result)
        return self._of_probe(result) if isinstance(result, Probe) else result

    def names(self) -> list[str]:
        """Names of all results, those without a derivative included."""
        bodies = self._gauge().names() if media_of(self._problem) else ()
        others = [name for name in self._others if name != COMPLIANCE or forces_of(self._problem)]
        return [*self._probes, *others, *(CONTACT + of + OF + name for of in bodies for name in OF_BODY)]

    # -- parts -----------------------------------------------------------------------------------------------------

    @cached_property
    def _nodes(self) -> Nodes:
        return Nodes(self._system)

    @cached_property
    def _forces(self) -> Forces:
        return Forces(self._problem, self._nodes)

    def _make_gauge(self) -> ContactGauge:
        regions = self._problem.regions()
        media = {name: regions[name].integrand for name in media_of(self._problem)}
        return ContactGauge(self._system, media, self._system.order)

    def _by_name(self, name: str) -> Functional:
        if name in self._probes:
            try:
                return self._of_probe(self._probes[name])
            except InputError as error:
                raise InputError(f"{name}: {error}") from None
        if name in self._others:
            return self._others[name]()
        if name.startswith(P_NORM):
            return self.of(p_norm(name))
        of, _, quantity = name.removeprefix(CONTACT).rpartition(OF)
        if name.startswith(CONTACT) and of:
            return self._contact(of, quantity)
        require_choice("result", name, self.names())
        raise AssertionError(name)

    @cached_property
    def _others(self) -> Mapping[str, Make]:
        """What makes results that are no probes, by name."""
        problem, regions = self._problem, tuple(self._problem.regions())
        found: dict[str, Make] = {}
        for prefix, load in [("", problem.load()), *((load.name + OF, load) for load in named_loads(problem))]:
            if isinstance(load, Spring):
                continue
            for usual, quantity in zip(("displacement", "reaction"), pair_of(load), strict=True):
                found[prefix + (quantity if prefix else usual)] = self._maker(load, quantity)
        found[COMPLIANCE] = lambda: ComplianceFunctional(problem, self._forces, self._nodes)
        found[ENERGY] = lambda: EnergyFunctional("stored energy", regions, self._nodes)
        for region in regions:
            found[ENERGY + OF + region] = lambda region=region: self._of_probe(EnergyOf(region))  # type: ignore[misc]
        return found

    def _maker(self, load: Load, quantity: str) -> Make:
        return lambda: of_load(load, quantity, self._forces, self._nodes)

    def _contact(self, of: str, quantity: str) -> ContactFunctional:
        if not media_of(self._problem):
            raise InputError(f"{quantity} of contact, {of}: problem '{self._problem.name}' has no medium")
        return ContactFunctional(of, quantity, self._gauge, self._forces, self._nodes)

    def _of_probe(self, probe: Probe) -> Functional:
        kind: type = next((kind for kind in type(probe).__mro__ if kind in self._kinds), type(probe))
        if kind not in self._kinds:
            raise InputError(f"a probe of the kind {type(probe).__name__} has no derivative")
        made: Functional = self._kinds[kind](probe)
        return made

    @cached_property
    def _kinds(self) -> Mapping[type, Callable[[Any], Functional]]:
        """What makes a functional of a probe, by the probe's kind."""
        problem = self._problem
        return {
            Displacement: lambda probe: PointFunctional(probe, self._nodes),
            Position: lambda probe: PointFunctional(probe, self._nodes),
            Gap: lambda probe: GapFunctional(probe, self._nodes),
            Reaction: lambda probe: reaction_probe(probe, self._nodes),
            MeanJ: lambda probe: mean_j(probe, problem, self._nodes),
            EnergyOf: lambda probe: EnergyFunctional(str(probe), (probe.region,), self._nodes),
            CutForce: lambda probe: CutFunctional(probe, problem, self._nodes),
            Contact: lambda probe: self._contact(probe.of, probe.quantity),
            ValueAt: _refused_value,
            Over: self._over,
            PNorm: lambda probe: PNormFunctional(probe, problem, self._nodes),
        }

    def _over(self, probe: Over) -> Functional:
        if probe.what in (SMALLEST, LARGEST):
            norm = "its p-norm" if probe.field in OF_P_NORM else f"the p-norm of one of {', '.join(OF_P_NORM)}"
            raise InputError(
                f"{probe} has no derivative where its place changes: take the mean over a region, or {norm}"
            )
        if probe.field in DISPLACEMENTS:
            return MeanDisplacementFunctional(probe, self._problem, self._nodes)
        if not probe.is_area:
            raise InputError(f"{probe} is of recovered values, which are not differentiated: {_OVER_A_REGION}")
        if probe.field == DENSITY:
            return DensityFunctional(str(probe), str(probe.region), self._nodes, mean=probe.what == MEAN)
        integral = FieldIntegral(probe.field, str(probe.region), self._problem, self._nodes)
        return FieldFunctional(str(probe), integral, mean=probe.what == MEAN)


_OVER_A_REGION = "take the mean or the integral over a region, or a p-norm"


def _refused_value(probe: ValueAt) -> Functional:
    raise InputError(f"{probe} is a recovered value, which is not differentiated: {_OVER_A_REGION}")


def p_norm(name: str) -> PNorm:
    """The p-norm of a name, ``p_norm.von_mises.block`` or ``p_norm.von_mises.block.12``.

    Raises:
        InputError: it is not of that form, the field may be negative, or p is below 1.
    """
    _, *of = keys(name)
    try:
        return PNorm(of[0], of[1], *([float(".".join(of[2:]))] if of[2:] else []))
    except (IndexError, ValueError):
        raise InputError(f"'{name}' is no p-norm: write {P_NORM}FIELD.REGION or {P_NORM}FIELD.REGION.8") from None


def functional_of(result: Result, problem: Problem, system: Discretisation) -> Functional:
    """What differentiates one result; for several, :class:`Functionals` finds once what they share.

    Args:
        result: its name, a probe, or a functional.
        problem: whose result.
        system: its discretisation.

    Raises:
        InputError: there is no such result, or it has no derivative; the message says why, and what has one.
    """
    return Functionals(problem, system).of(result)


def require_no_history(problem: Problem) -> None:
    """Check that a state says all about itself.

    Raises:
        InputError: it does not: there is friction, or supports hold in some stages only.
    """
    frictional = with_friction(problem)
    if frictional:
        raise InputError(
            f"region '{frictional[0]}' has friction, which depends on the path and not on the state alone, so that "
            "there are no derivatives: leave friction out"
        )
    staged = [condition for condition in problem.prescribed() if condition.stages]
    if staged:
        raise InputError(
            f"{staged[0]} holds in some stages only and keeps what was reached before, so that there are no "
            "derivatives: let it hold in all stages"
        )
