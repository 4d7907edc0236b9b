"""What a run leaves behind, as data: records, fields, files, findings."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tmc_vem.results.records import StepRecord
    from tmc_vem.results.run_result import RunResult

__all__ = ["RunResult", "StepRecord"]


def __getattr__(name: str) -> Any:
    from tmc_vem.results import records, run_result

    for module in (run_result, records):
        if hasattr(module, name):
            return getattr(module, name)
    raise AttributeError(f"module 'tmc_vem.results' has no attribute '{name}'")
