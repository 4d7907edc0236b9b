"""What both discretisations say of the interior penalty: its kinds, and what weights it."""

from __future__ import annotations

from codegen.integrand import Integrand
from tmc_vem.support.errors import InputError

INTERIOR_PENALTIES = ("none", "penalty", "full")
WEIGHTS = ("gamma", "alpha_r")


def require_weights(name: str, integrand: Integrand) -> None:
    """Check that an energy has the parameters that the penalty is weighted by.

    Args:
        name: of its region, for the message.
        integrand: the energy.

    Raises:
        InputError: it lacks one of :data:`WEIGHTS`.
    """
    for wanted in WEIGHTS:
        if wanted not in integrand.parameter_names:
            raise InputError(
                f"region '{name}': the interior penalty is weighted by gamma and alpha_r, but energy "
                f"'{integrand.name}' has no parameter '{wanted}'; use interior penalty 'none'"
            )
