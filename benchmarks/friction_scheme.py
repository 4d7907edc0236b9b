"""How far friction is off in a load step, by where in the step its slip systems are taken.

    python benchmarks/friction_scheme.py

A homogeneous layer, squeezed to a hundredth, at prescribed deformations: what the steps of a run do at a point, and
nothing else. "begin" takes normal, direction and bound of the slip systems at the beginning of a step, as a run does;
"bound at end" takes the bound at its end, "all at end" takes all there. The last two need an unsymmetric tangent, or a
second solution of the step with what the first has found.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from codegen.integrand import second_gradient_energy
from codegen.stress import Stress, stress_of
from tmc_vem.energy import DENSITIES
from tmc_vem.system.friction import Friction, SlipSystem, slip_system

Float = NDArray[np.float64]
Path = Callable[[float], Float]

FRICTION = Friction(0.3)
SQUEEZED = 0.01
SQUEEZE = (0.3, 0.1, 0.03, SQUEEZED)
SCHEMES = ("begin", "bound at end", "all at end")
STEPS = (10, 20, 40, 80, 160)
FINEST = 640  # steps of what others are compared with


def layer(stretch: float, slip: float) -> Float:
    """Deformation gradient of a layer whose upper face has moved by ``slip`` of its initial width."""
    return np.array([[1.0, slip], [0.0, stretch]])


def turned(angle: float, F: Float) -> Float:
    """The same, turned."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine], [sine, cosine]]) @ F


PATHS: Mapping[str, Path] = {
    "slides by one width": lambda t: layer(SQUEEZED, t),
    "slides by five widths": lambda t: layer(SQUEEZED, 5.0 * t),
    "slides by one while pressed to half": lambda t: layer(SQUEEZED * 0.5**t, t),
    "slides by one while turned by a right angle": lambda t: turned(0.5 * np.pi * t, layer(SQUEEZED, t)),
    "sticks while turned by a right angle": lambda t: turned(0.5 * np.pi * t, layer(SQUEEZED, 0.0012)),
}


def medium() -> Stress:
    """Stress of the paper's medium."""
    energy = DENSITIES["medium_huhu"]
    return stress_of(second_gradient_energy(energy.density, energy.name, energy.parameters))


def end_of(path: Path, n_steps: int, scheme: str, stress: Stress) -> Float:
    """Traction (2,) on the upper face at the end of a path, of the medium and of its friction."""

    def P_of(F: Float) -> Float:
        return stress.at(F[None], np.zeros((1, 2, 2, 2)), {"mu": 1.0, "gamma": 1.0, "alpha_r": 0.0})[0][0]

    def frozen(F: Float, tau: Float) -> SlipSystem:
        return slip_system(F, P_of(F), FRICTION, tau)

    before, tau, total = np.eye(2), np.zeros(()), np.zeros((2, 2))
    for F in (*(layer(stretch, 0.0) for stretch in SQUEEZE), *(path(k / n_steps) for k in range(1, n_steps + 1))):
        slip = frozen(before, tau)
        if scheme != "begin":
            end = frozen(F, tau)
            A_ij = end.A_ij if scheme == "all at end" else slip.A_ij
            slip = replace(end, A_ij=A_ij, AH=np.vdot(A_ij, before - np.eye(2)))
        tau = slip.response(F).tau
        before, total = F, P_of(F) + tau * slip.A_ij
    return total[:, 1]


def errors(name: str) -> dict[str, list[float]]:
    """Errors of the traction by scheme and number of steps, relative to the friction that there is at the end."""
    stress, path = medium(), PATHS[name]
    exact = end_of(path, FINEST, "all at end", stress)
    along = path(1.0)[:, 0]  # of the face, which is not stretched
    friction = FRICTION.coefficient * abs(exact @ np.array([-along[1], along[0]]))
    return {
        scheme: [float(np.hypot(*(end_of(path, n, scheme, stress) - exact)) / friction) for n in STEPS]
        for scheme in SCHEMES
    }


if __name__ == "__main__":
    for name in PATHS:
        print(name)
        for scheme, values in errors(name).items():
            print(f"  {scheme:14s}", *(f"{value:9.1e}" for value in values))
