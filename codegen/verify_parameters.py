"""Check compiled derivatives of an energy with respect to its parameters: against numpy, and by Taylor expansions.

The expansions are in the kernel's own energy and gradient at parameters nearby; numpy runs the density's record
backwards (:mod:`codegen.mixed`). Neither relies on the symbolic derivatives.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codegen.by_parameters import ParameterKernel
from codegen.finding import Finding, rate_finding, relative
from codegen.kernel import GRADIENT, Kernel
from codegen.mixed import mixed_of
from codegen.sampling import directions, from_vector

Array = NDArray[np.float64]

VALUE_LIMIT = 1e-9  # numpy, not the kernel, loses digits where J is small
TINY = 1e-3  # (exp(b x) - 1) / b by b: where x is small, numpy is left with a difference of larger numbers
STEPS = (4e-4, 2e-4, 1e-4)  # relative to the parameter


def parameter_findings(
    kernel: Kernel, derivatives: ParameterKernel, values: Mapping[str, float], x_nx: Array, rng: np.random.Generator
) -> Iterator[Finding]:
    """Findings about the derivatives of energy and stress by each parameter.

    Args:
        kernel: the compiled energy.
        derivatives: its compiled derivatives.
        values: of the parameters.
        x_nx: (n_states, 12) states.
        rng: gives directions.
    """
    if not derivatives.parameters:
        return
    y_nx, array = directions(x_nx, rng), kernel.parameter_array(values)
    found = derivatives.by_parameters(x_nx, y_nx, array)
    yield _against_numpy(derivatives, found, values, x_nx, y_nx)
    before = _energy_and_work(kernel, array, x_nx, y_nx)
    for k, name in enumerate(derivatives.parameters):
        unit = abs(float(array[k])) or 1.0
        moved = []
        for step in STEPS:
            changed = array.copy()
            changed[k] += step * unit
            moved.append(_energy_and_work(kernel, changed, x_nx, y_nx))
        for n, what in enumerate(("energy", "stress")):
            slope = unit * found[n][:, k]
            scale = np.abs(before[n]) + np.abs(slope) + np.finfo(float).tiny
            remainders = np.stack([after[n] - before[n] - h * slope for h, after in zip(STEPS, moved, strict=True)])
            words = f"The derivative of the {what} by {name} is not that of the {what}."
            yield rate_finding(f"{what} by {name}, Taylor rate", STEPS, remainders / scale, 2, words)


def _energy_and_work(kernel: Kernel, array: Array, x_nx: Array, y_nx: Array) -> tuple[Array, Array]:
    """(n_states,) the energy, and its rate along directions."""
    psi, g, _ = kernel.points(GRADIENT, x_nx, array)
    assert g is not None
    return psi, np.asarray(np.einsum("nx,nx->n", g, y_nx))


def _against_numpy(
    derivatives: ParameterKernel, found: tuple[Array, Array], values: Mapping[str, float], x_nx: Array, y_nx: Array
) -> Finding:
    mixed = mixed_of(derivatives.integrand)
    # what a density subtracts from numbers close to it costs numpy digits, and the kernel none
    at, ahead = from_vector(x_nx.astype(np.longdouble)), from_vector(y_nx.astype(np.longdouble))
    along: Any = (ahead[0] - np.eye(2), ahead[1])  # a direction is no state: nothing is at rest
    expected = mixed.energy_by_parameters(at, values), mixed.rate_by_parameters(at, along, values)
    error = max(
        float(np.max(relative(a[:, k], np.asarray(b[:, k], dtype=np.float64), TINY), initial=0.0))
        for a, b in zip(found, expected, strict=True)
        for k in range(len(derivatives.parameters))
    )
    passed = error < VALUE_LIMIT
    words = "" if passed else "Derivatives by parameters disagree with those of the Python function: please report it."
    return Finding("by parameters, against numpy", f"{error:.1e}", f"< {VALUE_LIMIT:.0e}", passed, words)
