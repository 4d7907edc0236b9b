"""Displacements and positions of points, and distances of two: functions of u alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tmc_vem.problems.probes import AXES, Displacement, Gap, Position
from tmc_vem.sensitivity.functionals_nodes import Nodes, Point
from tmc_vem.sensitivity.functionals_record import Derivative, FunctionalState
from tmc_vem.support.errors import InputError
from tmc_vem.system.constraints import COMPONENTS

Float = NDArray[np.float64]


class PointFunctional:
    """A displacement component, or a coordinate, of a point.

    Args:
        probe: which.
        nodes: of the discretisation.

    Raises:
        InputError: there is no such point.
    """

    def __init__(self, probe: Displacement | Position, nodes: Nodes) -> None:
        self.words = str(probe)
        self._point = Point(nodes, probe.at)
        is_position = isinstance(probe, Position)
        self._component = AXES[probe.axis] if isinstance(probe, Position) else COMPONENTS[probe.component]
        self._origin = float(self._point.reference[self._component]) if is_position else 0.0

    def derivative(self, state: FunctionalState) -> Derivative:
        """Value and derivatives at a state."""
        value = self._origin + float(self._point.displacement(state.u)[self._component])
        return Derivative(value, self._point.vector(np.eye(2)[self._component]))


class GapFunctional:
    """Distance of two points, with its sign: ``d = s |x_2 - x_1|``, ``dd/dx_2 = (x_2 - x_1) / d``.

    Args:
        probe: which.
        nodes: of the discretisation.

    Raises:
        InputError: there is no such point.
    """

    def __init__(self, probe: Gap, nodes: Nodes) -> None:
        self.words = str(probe)
        self._points = [Point(nodes, place) for place in probe.places]

    def derivative(self, state: FunctionalState) -> Derivative:
        """Value and derivatives at a state.

        Raises:
            InputError: the points are at one place.
        """
        origins = [point.reference for point in self._points]
        places = [point.reference + point.displacement(state.u) for point in self._points]
        away = places[1] - places[0]
        distance = float(np.hypot(*away))
        if distance == 0.0:
            raise InputError(
                f"{self.words} is 0, where a distance has no derivative: take a coordinate of one of the points"
            )
        value = -distance if state.behind and state.behind(origins, places) else distance
        by_u = self._points[1].vector(away / value)
        by_u.axpy(1.0, self._points[0].vector(-away / value))
        return Derivative(value, by_u)
