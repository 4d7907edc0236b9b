"""The interior penalty as an energy at a point of one face of a side, made of the medium's own density.

With the trace q of a cell, the one polynomial whose derivatives are the second gradient of the cell's energy, the jump
[[q]] and the normal n, a side between two cells of one medium stores, one half for each of its faces::

    eta gamma alpha_r / 2 exp(-beta J) |D|^2 - dpsi/dG : B,      D = [[q]] / sqrt(h),  B = [[q]] (x) n,

at F = I + q and G = grad q of that face. The second term makes the method consistent, as in interior penalty methods
for the biharmonic problem (Brenner & Sung, J. Sci. Comput. 22 (2005) 83-118); it is left out for 'penalty'.
"""

from __future__ import annotations

from typing import Any

from codegen.directional import RatedMath, RatedParameters, rated
from codegen.integrand import DEFORMATION_GRADIENT, SECOND_GRADIENT, Integrand, Parameter
from codegen.layout import Input, Take
from tmc_vem.energy import kinematics as kin

SCALED_JUMP = Input("D", "u", Take.JUMP, (2, 2))
JUMP_BY_NORMAL = Input("B", "u", Take.JUMP, (2, 2, 2))
ETA = "eta_of_sides"  # the factor of the penalty among the parameters


def facet_integrand(medium: Integrand, full: bool) -> Integrand:
    """Energy at a point of one face of a side, with the medium's parameters and :data:`ETA`.

    Args:
        medium: its energy, as in cells.
        full: with the term that makes it consistent.
    """
    jumps = (SCALED_JUMP, JUMP_BY_NORMAL) if full else (SCALED_JUMP,)
    state = (DEFORMATION_GRADIENT, SECOND_GRADIENT) if full else (DEFORMATION_GRADIENT,)

    def penalty(F: Any, D: Any, p: Any, m: Any) -> Any:
        weight = getattr(p, ETA) * p.gamma * p.alpha_r / 2
        if "beta" in medium.parameter_names:
            weight = weight * m.exp(-p.beta * kin.det(F))
        return weight * kin.squared_norm([D[i][j] for j in kin.AXES for i in kin.AXES])

    def complete(F: Any, G: Any, D: Any, B: Any, p: Any, m: Any) -> Any:
        psi = medium.function(
            rated(DEFORMATION_GRADIENT, F), rated(SECOND_GRADIENT, G, B), RatedParameters(p), RatedMath(m)
        )
        return penalty(F, D, p, m) - psi.rate

    return Integrand(
        f"{medium.name}_{'full' if full else 'penalty'}",
        (*state, *jumps),
        tuple(sorted((*medium.parameters, Parameter(ETA)), key=lambda parameter: parameter.varies)),
        complete if full else penalty,
        f"interior penalty of {medium.name}",
    )
