"""Errors by recovered gradients: cheap, without another mesh, and crude where bodies are in contact."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tmc_vem.adapt.estimate import Estimate
from tmc_vem.adapt.recovery import dual_indicators, energy_indicators
from tmc_vem.adapt.solved import Solved
from tmc_vem.problems.base import forces_of
from tmc_vem.results.adaptivity import RECOVERED
from tmc_vem.sensitivity.equilibrium import Equilibrium, SingularTangent
from tmc_vem.sensitivity.functionals import functional_of
from tmc_vem.simulation.adaptable import ENERGY
from tmc_vem.support.errors import EvaluationError, InputError

Float = NDArray[np.float64]

CRUDE = "the errors are from recovered gradients, which say little about squeezed medium"


def recovered_estimate(solved: Solved, names: tuple[str, ...]) -> Estimate:
    """Errors of the results of a state.

    Args:
        solved: the state.
        names: results that the mesh is adapted to; those without derivatives have no error, and are adapted to by the
            energy of the error.
    """
    system, problem = solved.simulation.system, solved.problem
    of_energy = energy_indicators(problem, system, solved.mesh, solved.u) ** 2
    errors: dict[str, float] = {}
    if not forces_of(problem):  # under prescribed displacements the exact energy is the smallest
        errors[ENERGY] = -float(of_energy.sum())
    indicators = {}
    equilibrium: Equilibrium | None = None
    for name in names:
        indicators[name] = of_energy
        if name == ENERGY:
            continue
        try:
            equilibrium = equilibrium or solved.equilibrium()
            functional = functional_of(name, problem, system)
            field = equilibrium.adjoint(functional.derivative(equilibrium.state)).field
        except (InputError, SingularTangent, EvaluationError):
            continue
        estimate, indicators[name] = dual_indicators(problem, system, solved.mesh, solved.u, field)
        errors[name] = -estimate
    return Estimate(solved.values(), errors, indicators, RECOVERED, CRUDE)
