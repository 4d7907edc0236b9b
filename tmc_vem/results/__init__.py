"""What a run leaves behind, as data: records, fields, files, findings."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tmc_vem.results.records import StepRecord
    from tmc_vem.results.run_result import RunResult

__all__ = ["RunResult", "StepRecord"]


def __getattr__(name: str) -> Any:
    for module in ("run_result", "records"):
        found = import_module(f"{__name__}.{module}")  # a from-import would ask here for the module first, and for ever
        if hasattr(found, name):
            return getattr(found, name)
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
