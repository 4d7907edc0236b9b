"""Derivatives of what a run says about a state, with respect to anything that the state depends on."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tmc_vem.support.lazy import lazily

if TYPE_CHECKING:
    from tmc_vem.sensitivity.at_end import Sensitivities, SensitivityWarning, of_directory, sensitivities
    from tmc_vem.sensitivity.table import SensitivityTable

__all__ = ["Sensitivities", "SensitivityTable", "SensitivityWarning", "of_directory", "sensitivities"]

__getattr__ = lazily(__name__, {**dict.fromkeys(__all__, "at_end"), "SensitivityTable": "table"})
