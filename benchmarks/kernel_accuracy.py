"""Errors of generated kernels against 50-digit arithmetic, on the states of the tests: a table of docs/codegen.md.

python benchmarks/kernel_accuracy.py
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests" / "unit"))


def largest_errors(state: str, name: str) -> list[float]:
    """Largest relative errors of energy, gradient and Hessian of a built-in energy; of the last two relative to norms.

    Args:
        state: of the states in ``test_codegen_accuracy.py``.
        name: of the energy.
    """
    import mpmath
    from test_codegen_accuracy import DIGITS, PARAMETERS, STATES, TANGENT, reference, relative_error

    from codegen.kernel import compile_energy
    from tmc_vem.energy import DENSITIES

    energy = DENSITIES[name]
    kernel = compile_energy(energy.density, energy.name, energy.parameters, energy.description)
    psi, g, h = kernel.points(TANGENT, STATES[state], kernel.parameter_array(PARAMETERS))
    found = []
    with mpmath.workdps(DIGITS + 2 * 22):  # as in the tests
        for n, x in enumerate(STATES[state]):
            exact = reference(energy.density, x)
            ours = [psi[n]], g[n], h[n].ravel()
            found.append([relative_error(a, b) for a, b in zip(ours, ([exact[0]], *exact[1:]), strict=True)])
    return [max(column) for column in zip(*found, strict=True)]


if __name__ == "__main__":
    from pages.guide import ACCURACY
    from pages.study import main

    main(__doc__, [ACCURACY], "codegen-")
