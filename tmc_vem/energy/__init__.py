"""Energy densities: plain functions of (F, G, p, m), written once and used by every path."""

from tmc_vem.energy.registry import (
    DENSITIES,
    REGULARISERS,
    Energy,
    Regulariser,
    energy_name,
    get_regulariser,
    hyperelastic_solid,
    third_medium,
)

__all__ = [
    "DENSITIES",
    "REGULARISERS",
    "Energy",
    "Regulariser",
    "energy_name",
    "get_regulariser",
    "hyperelastic_solid",
    "third_medium",
]
