"""Check a compiled energy: values, derivatives and the properties that a strain energy must have.

The kernel is compared with numpy evaluations of the density and its derivatives with its own values by Taylor
expansions, so nothing here relies on the symbolic derivatives.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codegen import oracle
from codegen.by_parameters import ParameterKernel
from codegen.declare import Declaration
from codegen.errors import CodegenError
from codegen.finding import Finding, rate_finding, relative
from codegen.integrand import LAYOUT, second_gradient_energy, stress_names
from codegen.kernel import ENERGY, GRADIENT, TANGENT, Kernel
from codegen.out_of_plane import out_of_plane_stress
from codegen.reference import fault_at_reference
from codegen.sampling import REGIMES, SAFETY_ANGLE, Regime, directions, from_vector, rotate, sample
from codegen.trace import trace
from codegen.verify_parameters import parameter_findings

Array = NDArray[np.float64]

N_STATES = 40
VALUE_LIMIT = 1e-9  # numpy, not the kernel, loses digits where J is small
DIFFERENCE_LIMIT = 1e-5
REFERENCE_LIMIT = 1e-12
MARGIN = 0.1  # of a declared domain, which is 1 at F = I: derivatives by differences need room
MOST_HALVINGS = 60
DECLARED_OTHERWISE = "declared otherwise"
DERIVATIVE_NAMES = stress_names(LAYOUT)
GRADIENT_STEPS = (4e-5, 2e-5, 1e-5)  # small, so that a slightly wrong component stands out, yet far above rounding
HESSIAN_STEPS = (1e-3, 5e-4, 2.5e-4)


def verify(
    kernel: Kernel,
    density: Callable[..., Any],
    parameters: Mapping[str, float],
    declared: Declaration | None = None,
    seed: int = 0,
    by_parameters: ParameterKernel | None = None,
) -> list[Finding]:
    """All findings about a kernel; it is sound if all of them passed.

    Args:
        kernel: the compiled energy.
        density: the function that it came from.
        parameters: values of its parameters.
        declared: what the author stated about it.
        seed: of the random states.
        by_parameters: its derivatives with respect to parameters, if they are to be checked as well.
    """
    rng = np.random.default_rng(seed)
    return list(_findings(kernel, density, parameters, declared or Declaration(), rng, by_parameters))


def _findings(
    kernel: Kernel,
    density: Callable[..., Any],
    values: Mapping[str, float],
    declared: Declaration,
    rng: np.random.Generator,
    by_parameters: ParameterKernel | None,
) -> Iterator[Finding]:
    drawn = {regime: sample(regime, N_STATES, rng, declared.max_rotation) for regime in REGIMES}
    states = {regime: _within(declared.domain, x_nx, values) for regime, x_nx in drawn.items()}
    everything = np.concatenate(list(states.values()))
    array = kernel.parameter_array(values)

    finite = _finite(kernel, array, everything, declared)
    yield finite
    if not finite.passed:
        return
    yield _against_numpy(kernel, array, density, values, everything)
    for regime, x_nx in states.items():
        yield from _taylor(kernel, array, regime, x_nx, rng)
    yield _symmetry(kernel, array, everything)
    yield _objectivity(kernel, array, everything, declared, rng)
    yield from _reference_state(kernel, array, density, values, declared)
    if declared.gradient is not None:
        yield _hand_written(kernel, array, declared.gradient, values, everything)
    if by_parameters is not None:
        yield from parameter_findings(kernel, by_parameters, values, everything, rng)


def _within(domain: Callable[..., Any] | None, x_nx: Array, values: Mapping[str, float]) -> Array:
    """The states, those that are outside a domain half as far from F = I, G = 0, as often as it takes.

    Raises:
        CodegenError: F = I itself is outside.
    """
    if domain is None:
        return x_nx
    for _ in range(MOST_HALVINGS):
        with np.errstate(all="ignore"):  # J <= 0 on the way is outside
            inside = oracle.energy_density(domain, x_nx, values) >= MARGIN
        if inside.all():
            return x_nx
        x_nx = np.where(inside[:, None], x_nx, x_nx / 2)
    raise CodegenError("the declared domain excludes F = I: it must be 1 there, and positive where there is an energy")


def _all_derivatives(kernel: Kernel, array: Array, x_nx: Array) -> tuple[Array, Array, Array]:
    psi, g, h = kernel.points(TANGENT, x_nx, array)
    assert g is not None
    assert h is not None
    return psi, g, h


def _gradient(kernel: Kernel, array: Array, x_nx: Array) -> Array:
    g = kernel.points(GRADIENT, x_nx, array)[1]
    assert g is not None
    return g


def _finite(kernel: Kernel, array: Array, x_nx: Array, declared: Declaration) -> Finding:
    psi, g, h = _all_derivatives(kernel, array, x_nx)
    good = np.isfinite(psi) & np.isfinite(g).all(axis=1) & np.isfinite(h).all(axis=(1, 2))
    rotation = min(declared.max_rotation - SAFETY_ANGLE, max(regime.rotation for regime in REGIMES))
    where = "J 1e-4 to 3" if declared.domain is None else "in its domain"
    what = f"finite, {where}, rotation to {rotation:.0f} deg"
    words = ""
    if not good.all():
        state = ", ".join(f"{v:.3g}" for v in x_nx[np.argmin(good)])
        words = f"The energy or a derivative is infinite or not a number at [F - I, G] = [{state}]."
    elif declared.max_rotation < 180.0:
        words = f"Declared for rotations below {declared.max_rotation:.0f} degrees only; nothing was checked beyond."
    return Finding(what, f"{good.sum()} of {len(good)}", "all", bool(good.all()), words)


def _against_numpy(
    kernel: Kernel, array: Array, density: Callable[..., Any], values: Mapping[str, float], x_nx: Array
) -> Finding:
    psi = kernel.points(ENERGY, x_nx, array)[0]
    expected = oracle.energy_density(density, x_nx, values)
    error = float(np.max(relative(psi, expected)))
    words = "" if error < VALUE_LIMIT else "The kernel and the Python function disagree: please report it."
    return Finding("energy against numpy", f"{error:.1e}", f"< {VALUE_LIMIT:.0e}", error < VALUE_LIMIT, words)


def _taylor(kernel: Kernel, array: Array, regime: Regime, x_nx: Array, rng: np.random.Generator) -> Iterator[Finding]:
    """Decay of ``psi(x + h d) - psi - h g.d`` (rate 2) and of the same less ``h^2/2 d.H.d`` (rate 3)."""
    d_nx = directions(x_nx, rng)
    psi, g, h = _all_derivatives(kernel, array, x_nx)
    slope = np.einsum("nx,nx->n", g, d_nx)
    curvature = np.einsum("nx,nxy,ny->n", d_nx, h, d_nx)
    scale = np.abs(psi) + np.abs(slope) + np.abs(curvature) + np.finfo(float).tiny
    first = _remainders(kernel, array, x_nx, d_nx, GRADIENT_STEPS, lambda h: psi + h * slope) / scale
    second = (
        _remainders(kernel, array, x_nx, d_nx, HESSIAN_STEPS, lambda h: psi + h * slope + h**2 / 2 * curvature) / scale
    )
    name = regime.name
    yield rate_finding(
        f"gradient, Taylor rate, {name}", GRADIENT_STEPS, first, 2, "The gradient is not that of the energy."
    )
    yield rate_finding(
        f"Hessian, Taylor rate, {name}", HESSIAN_STEPS, second, 3, "The Hessian is not that of the energy."
    )


def _remainders(
    kernel: Kernel, array: Array, x_nx: Array, d_nx: Array, steps: Sequence[float], model: Callable[[float], Array]
) -> Array:
    """``psi(x + h d)`` less its model for each step h: (n_steps, n_states)."""
    return np.stack([kernel.points(ENERGY, x_nx + h * d_nx, array)[0] - model(h) for h in steps])


def _symmetry(kernel: Kernel, array: Array, x_nx: Array) -> Finding:
    """Derivatives of the gradient by central differences: they must be symmetric and equal to the Hessian."""
    h = _all_derivatives(kernel, array, x_nx)[2]
    differences = np.empty_like(h)
    F = from_vector(x_nx)[0]
    step = 3e-5 * np.minimum(1.0, np.linalg.det(F) / np.abs(F).max(axis=(1, 2)))
    for b in range(LAYOUT.n_inputs):
        ahead, behind = x_nx.copy(), x_nx.copy()
        ahead[:, b] += step
        behind[:, b] -= step
        change = _gradient(kernel, array, ahead) - _gradient(kernel, array, behind)
        differences[:, :, b] = change / (ahead[:, b] - behind[:, b])[:, None]
    size = _size(h, _gradient(kernel, array, x_nx))[:, None, None]
    skew = float(np.max(np.abs(differences - differences.swapaxes(1, 2)) / size))
    wrong = float(np.max(np.abs(differences - h) / size))
    worst = max(skew, wrong)
    passed = worst < DIFFERENCE_LIMIT
    words = "" if passed else "The Hessian is not the derivative of the gradient, or that is not symmetric."
    return Finding("Hessian symmetric, against differences", f"{worst:.1e}", f"< {DIFFERENCE_LIMIT:.0e}", passed, words)


def _size(h_nxy: Array, g_nx: Array) -> Array:
    """(n,) what derivatives are compared with: the largest entry of the Hessian, of the gradient if that is zero."""
    largest = np.abs(h_nxy).max(axis=(1, 2))
    gradient = np.abs(g_nx).max(axis=1)
    return np.asarray(np.where(largest > 0.0, largest, np.where(gradient > 0.0, gradient, 1.0)))


def _objectivity(kernel: Kernel, array: Array, x_nx: Array, declared: Declaration, rng: np.random.Generator) -> Finding:
    angles = rng.uniform(5.0, 170.0, len(x_nx))
    psi = kernel.points(ENERGY, x_nx, array)[0]
    turned = kernel.points(ENERGY, rotate(x_nx, angles), array)[0]
    change = relative(turned, psi)
    worst = int(np.nanargmax(change)) if np.isfinite(change).any() else 0
    objective = bool(change[worst] < VALUE_LIMIT)
    words = ""
    if not objective:
        effect = f"{angles[worst]:.0f} degrees changes psi from {psi[worst]:.3g} to {turned[worst]:.3g}"
        words = f"The energy is not objective (frame indifferent): a superposed rotation of {effect}"
        words += ", as declared." if not declared.objective else "; psi(QF, QG) must equal psi(F, G)."
    elif not declared.objective:
        words = "Declared as not objective, but no superposed rotation changed it."
    required = f"< {VALUE_LIMIT:.0e}" if declared.objective else DECLARED_OTHERWISE
    passed = objective or not declared.objective
    return Finding("unchanged by superposed rotation", f"{change[worst]:.1e}", required, passed, words)


def _reference_state(
    kernel: Kernel, array: Array, density: Callable[..., Any], values: Mapping[str, float], declared: Declaration
) -> Iterator[Finding]:
    at_rest = np.zeros((1, LAYOUT.n_inputs))
    psi, g, h = _all_derivatives(kernel, array, at_rest)
    integrand = second_gradient_energy(density, getattr(density, "__name__", "energy"), values)
    if not (np.isfinite(psi).all() and np.isfinite(g).all() and np.isfinite(h).all()):
        fault = fault_at_reference(trace(integrand), values)
        what = "The energy" if not np.isfinite(psi).all() else "A derivative of the energy"
        words = f"{what} is infinite or not a number at F = I: {fault or 'it has a singularity there'}."
        yield Finding("finite at F = I", "no", "yes", False, words)
        return
    size = float(_size(h, g)[0])
    required = f"< {REFERENCE_LIMIT:.0e}" if declared.stress_free else DECLARED_OTHERWISE
    advice = "" if declared.stress_free else " As declared."
    energy = abs(float(psi[0])) / size
    worst = int(np.abs(g[0]).argmax())
    stress = abs(float(g[0, worst])) / size
    energy_words = f"The energy at F = I is {psi[0]:.4g}, not 0: subtract it."
    stress_words = (
        f"F = I is not free of stress: {DERIVATIVE_NAMES[worst]} = {g[0, worst]:.4g} "
        "(in plane strain tr C = F:F + 1, as F33 = 1)."
    )
    properties = [("energy", energy, energy_words), ("stress", stress, stress_words)]
    across = out_of_plane_stress(integrand).stress
    if across is not None:
        p33 = float(oracle.energy_density(across.function, at_rest, values)[0])
        across_words = (
            f"F = I is not free of stress across the plane: P33 = {p33:.4g}; an energy that uses F[2][2] must do so in "
            "all its parts."
        )
        properties.append(("out-of-plane stress", abs(p33) / size, across_words))
    for what, value, words in properties:
        fine = value < REFERENCE_LIMIT  # False for NaN
        passed = fine or not declared.stress_free
        yield Finding(f"{what} at F = I", f"{value:.1e}", required, passed, "" if fine else words + advice)


def _hand_written(
    kernel: Kernel, array: Array, hook: Callable[..., Any], values: Mapping[str, float], x_nx: Array
) -> Finding:
    g = _gradient(kernel, array, x_nx)
    error_nx = np.abs(oracle.hand_written_gradient(hook, x_nx, values) - g) / np.abs(g).max(axis=1)[:, None]
    worst = int(error_nx.max(axis=0).argmax())
    error = float(error_nx[:, worst].max())
    words = ""
    if not error < VALUE_LIMIT:
        wrong = [DERIVATIVE_NAMES[a] for a in range(LAYOUT.n_inputs) if not error_nx[:, a].max() < VALUE_LIMIT]
        words = f"The hand-written gradient is wrong: its components {', '.join(wrong)} are not the energy's."
    return Finding("hand-written gradient", f"{error:.1e}", f"< {VALUE_LIMIT:.0e}", error < VALUE_LIMIT, words)
