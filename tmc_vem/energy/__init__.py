"""Energy densities: plain functions of (F, G, p, m), written once and used by every path."""

from typing import Any

from tmc_vem.energy.registry import (
    DENSITIES,
    MEDIA,
    PAPER_DENSITIES,
    PAPER_MEDIUM,
    REGULARISERS,
    SOLIDS,
    Energy,
    Regulariser,
    energy_name,
    get_regulariser,
    hyperelastic_solid,
    third_medium,
)

__all__ = [
    "DENSITIES",
    "MEDIA",
    "PAPER_DENSITIES",
    "PAPER_MEDIUM",
    "REGULARISERS",
    "SOLIDS",
    "Energy",
    "Regulariser",
    "energy_name",
    "get_regulariser",
    "hyperelastic_solid",
    "third_medium",
]


def __getattr__(name: str) -> Any:
    """Built-in energies and regularisers by name, so that ``tmc_vem.energy:medium_angle`` names one."""
    for table in (DENSITIES, SOLIDS, REGULARISERS):
        if name in table:
            return table[name]
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted({*globals(), *DENSITIES, *SOLIDS, *REGULARISERS})
