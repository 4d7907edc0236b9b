"""The pipeline from a density to C source: trace, derive, schedule, print.

Only tracing runs when a kernel is in the cache already; sympy is imported when it is not.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from typing import TypeVar

from codegen.ir import KernelSource
from codegen.trace import TracedEnergy

logger = logging.getLogger(__name__)

T = TypeVar("T")


def generate(traced: TracedEnergy, description: str = "") -> KernelSource:
    """C source of a traced energy.

    Raises:
        CodegenError: the energy cannot be differentiated.
    """
    from codegen.derive import differentiate
    from codegen.schedule import schedule
    from codegen.templates import kernel_source

    derived = _timed("derive", lambda: differentiate(traced))
    schedules = _timed("schedule", lambda: schedule(derived))
    return _timed("print", lambda: kernel_source(derived, schedules, description))


def _timed(stage: str, run: Callable[[], T]) -> T:
    start = time.perf_counter()
    result = run()
    logger.info("%s: %.3f s", stage, time.perf_counter() - start)
    return result
