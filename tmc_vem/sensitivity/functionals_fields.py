"""Integrals over regions of fields of stress and strain: means, and p-norms of fields that are nowhere negative.

A field is a function f of F and of the stress ``P = dpsi/dF`` at a quadrature point. With ``A = df/dP`` (and a that of
the stress across the plane) held, ``df = df/dF|_P : dF + d(P : A + P33 a)``; the latter comes from
:mod:`codegen.stress_rates`, by F, by G and by all parameters together. Nothing here is a difference of values.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codegen.stress import stress_of
from codegen.stress_rates import stress_rates_of
from tmc_vem.problems.base import Problem
from tmc_vem.problems.field_probes import DISPLACEMENTS, INTEGRAL, FieldProbe, Over, PNorm
from tmc_vem.problems.probes import MeanJ
from tmc_vem.sensitivity.field_slopes import SLOPES
from tmc_vem.sensitivity.functionals_nodes import Nodes
from tmc_vem.sensitivity.functionals_record import CellParts, Derivative, Direct, FunctionalState
from tmc_vem.simulation.field_gauge import FieldReader
from tmc_vem.support.distributed import Vec
from tmc_vem.support.validation import require_choice
from tmc_vem.system.point_states import PointStates
from tmc_vem.system.tensors import DEFORMATION, PIOLA, SCALARS, tensors_of, values_of

Float = NDArray[np.float64]
Shape = Callable[[Float], tuple[Float, Float]]  # h(f) and dh/df of values f


@dataclass(frozen=True)
class Sum:
    """Integral over a region of h(f), and its derivatives.

    Attributes:
        integral, area: equal on all ranks.
        by_u: a vector of the system.
        direct: by what this rank's cells have of parameters.
    """

    integral: float
    area: float
    by_u: Vec
    direct: Sequence[Direct]

    def scaled(self, value: float, factor: float) -> Derivative:
        """The derivative of a function of the integral, whose value and slope are given."""
        self.by_u.scale(factor)
        direct = [Direct(part.region, part.cells, part.names, factor * part.values_ck) for part in self.direct]
        return Derivative(value, self.by_u, by_cells=CellParts(direct=direct) if direct else None)


class FieldIntegral:
    """Integrals over a region of functions of a field; all ranks make and use it together.

    Args:
        field: its name.
        region: name of the region.
        problem: whose region.
        nodes: of its discretisation.

    Raises:
        InputError: there is no such region, or the energy lacks the stress across the plane, which the field needs.
    """

    def __init__(self, field: str, region: str, problem: Problem, nodes: Nodes) -> None:
        regions = problem.regions()
        require_choice("region", region, regions)
        FieldProbe(field).require_across([region], regions)
        self.region, self._field, self._nodes = region, field, nodes
        self._of = SCALARS[field].of
        integrand = regions[region].integrand
        self._stress, self._rates = stress_of(integrand), stress_rates_of(integrand)

    def largest(self, u: Vec) -> float:
        """Largest value at any quadrature point, equal on all ranks."""
        system = self._nodes.system
        mine = [
            float(values_of(self._field, self._tensors(states)[0]).max(initial=0.0))
            for states in system.point_states(u)
            if states.region == self.region
        ]
        return max((value for part in system.comm.allgather(mine) for value in part), default=0.0)

    def sum(self, u: Vec, shape: Shape) -> Sum:
        """Integral of h(f) and its derivatives.

        Args:
            u: displacements.
            shape: h and dh/df.
        """
        direct: list[Direct] = []
        totals = np.zeros(2)

        def forces(states: PointStates) -> tuple[Float, Float | None] | None:
            if states.region != self.region:
                return None
            tensors, P, across = self._tensors(states)
            value_cq, slope_cq = shape(values_of(self._field, tensors))
            totals[:] += (states.w_cq * value_cq).sum(), states.w_cq.sum()
            by_cqn = slope_cq[..., None] * SLOPES[self._field](tensors[self._of])
            by_F, A, a = _pulled_back(self._of, by_cqn, tensors[self._of], states.F_cqij, P, across)
            if A is None:
                return by_F, None
            G = states.G_cqijk if self._rates.uses_second_gradient else None
            rates = self._rates.at(states.F_cqij, G, states.parameters, A, a)
            values_ck = (states.w_cq[..., None] * rates.by_parameter).sum(axis=1)
            direct.append(Direct(states.region, states.cells, self._rates.parameters, values_ck))
            return by_F + rates.by_F, rates.by_G

        system = self._nodes.system
        by_u = system.create_vector()
        system.add_point_forces(u, forces, by_u)
        integral, area = np.sum(system.comm.allgather(totals), axis=0).tolist()
        return Sum(integral, area, by_u, direct)

    def _tensors(self, states: PointStates) -> tuple[dict[str, Float], Float, Float | None]:
        if self._of == DEFORMATION:  # that has no stress in it
            F = states.F_cqij
            return {DEFORMATION: F.reshape(*F.shape[:-2], 4)}, F, None
        G = states.G_cqijk if self._stress.uses_second_gradient else None
        P, across = self._stress.at(states.F_cqij, G, states.parameters)
        return tensors_of(states.F_cqij, P, across), P, across


class FieldFunctional:
    """Mean or integral of a field over a region.

    Args:
        words: what it is called.
        integral: of the field.
        mean: the mean, not the integral.
    """

    def __init__(self, words: str, integral: FieldIntegral, *, mean: bool) -> None:
        self.words, self._integral, self._is_mean = words, integral, mean

    def derivative(self, state: FunctionalState) -> Derivative:
        """Value and derivatives at a state."""
        found = self._integral.sum(state.u, lambda f: (f, np.ones_like(f)))
        factor = 1.0 / found.area if self._is_mean else 1.0
        return found.scaled(factor * found.integral, factor)


class PNormFunctional:
    """A p-norm ``M (mean (f / M)^p)^(1/p)``, M the largest value, so that no power is too large for a number.

    Args:
        norm: which.
        problem: whose region.
        nodes: of its discretisation.

    Raises:
        InputError: there is no such region, or no such stress in it.
    """

    def __init__(self, norm: PNorm, problem: Problem, nodes: Nodes) -> None:
        self.words, self._p = str(norm), norm.p
        self._integral = FieldIntegral(norm.field, norm.region, problem, nodes)

    def derivative(self, state: FunctionalState) -> Derivative:
        """Value and derivatives at a state; where the field vanishes everywhere, the latter are 0."""
        p, largest = self._p, self._integral.largest(state.u)
        unit = largest if largest > 0.0 else 1.0

        def shape(f: Float) -> tuple[Float, Float]:
            return (f / unit) ** p, p / unit * (f / unit) ** (p - 1.0)

        found = self._integral.sum(state.u, shape)
        mean = found.integral / found.area
        value = unit * mean ** (1.0 / p)
        return found.scaled(value, value / (p * found.integral) if found.integral > 0.0 else 0.0)


class MeanDisplacementFunctional:
    """Mean or integral of a displacement component over a region, along edges or along a line.

    Args:
        probe: which.
        problem: whose probe.
        nodes: of its discretisation.

    Raises:
        InputError: the line goes through no cell.
    """

    def __init__(self, probe: Over, problem: Problem, nodes: Nodes) -> None:
        self.words, self._nodes = str(probe), nodes
        along = np.eye(2)[DISPLACEMENTS[probe.field]]
        vector, size = _along(probe, problem, nodes, along) if not probe.is_area else _over(probe, nodes, along)
        vector.scale(1.0 if probe.what == INTEGRAL else 1.0 / size)
        self._vector = vector

    def derivative(self, state: FunctionalState) -> Derivative:
        """Value and derivatives at a state."""
        return Derivative(self._vector.dot(state.u), self._vector.copy())


def _over(probe: Over, nodes: Nodes, along: Float) -> tuple[Vec, float]:
    """What gives the integral over a region of the displacement along a direction, and the region's area."""
    system, polygons = nodes.system, nodes.system.output_polygons()
    here_c = np.array(polygons.region_names)[polygons.region_c] == probe.region
    area = sum(system.comm.allgather(float(system.cell_areas()[here_c].sum())))
    return nodes.vector(np.outer(system.area_weights((str(probe.region),)), along)), area


def _along(probe: Over, problem: Problem, nodes: Nodes, along: Float) -> tuple[Vec, float]:
    """The same along a line or edges, and their length."""
    pieces, places = FieldReader({"line": probe}, problem, nodes.system).pieces["line"]
    assert places is not None
    weight_n = pieces.every_weight_n
    return nodes.from_points(places, np.outer(weight_n, along)), float(weight_n.sum())


def mean_j(probe: MeanJ, problem: Problem, nodes: Nodes) -> FieldFunctional:
    """The probe of the mean of J over a region."""
    return FieldFunctional(str(probe), FieldIntegral("J", probe.region, problem, nodes), mean=True)


def _pulled_back(
    of: str, by_cqn: Float, tensor_cqn: Float, F: Float, P: Float, across: Float | None
) -> tuple[Float, Float | None, Float | None]:
    """From derivatives by the components of a tensor to those by F with the stress held, by P, and by P33; None where
    the tensor has no stress in it.

    With ``sigma = P F^T / J``, S the symmetric matrix of the derivatives by sigma and s that by ``sigma_zz = P33 / J``:
    by P ``S F / J``, by P33 ``s / J``, and by F ``S P / J - (S : sigma + s sigma_zz) F^-T``.
    """
    shape = F.shape[:-2]
    if of == PIOLA:
        return np.zeros_like(F), by_cqn[..., :4].reshape(*shape, 2, 2), by_cqn[..., 4]
    if of == DEFORMATION:
        return by_cqn.reshape(*shape, 2, 2), None, None
    xx, yy, zz, xy = np.moveaxis(by_cqn, -1, 0)
    S = np.stack([np.stack([xx, 0.5 * xy], axis=-1), np.stack([0.5 * xy, yy], axis=-1)], axis=-2)
    J = F[..., 0, 0] * F[..., 1, 1] - F[..., 0, 1] * F[..., 1, 0]
    cofactor = np.empty_like(F)
    cofactor[..., 0, 0], cofactor[..., 1, 1] = F[..., 1, 1], F[..., 0, 0]
    cofactor[..., 0, 1], cofactor[..., 1, 0] = -F[..., 1, 0], -F[..., 0, 1]
    known = slice(None) if across is not None else [0, 1, 3]  # without a stress across the plane it is no number
    shrinks = (by_cqn[..., known] * tensor_cqn[..., known]).sum(axis=-1) / J
    by_F = S @ P / J[..., None, None] - shrinks[..., None, None] * cofactor
    return by_F, S @ F / J[..., None, None], None if across is None else zz / J
