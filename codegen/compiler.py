"""The pipeline from a density to C source: trace, derive, schedule, print.

Only tracing runs when a kernel is in the cache already; sympy is imported when it is not.
"""

from __future__ import annotations

import logging
import platform
import time
from collections.abc import Callable, Mapping
from typing import TypeVar

from codegen.driver import Driver
from codegen.ir import DerivedEnergy, KernelSource
from codegen.trace import TracedEnergy

logger = logging.getLogger(__name__)

T = TypeVar("T")


def generate(
    traced: TracedEnergy,
    description: str = "",
    versions: Mapping[str, str] | None = None,
    driver: Driver | None = None,
) -> KernelSource:
    """C source of a traced energy.

    Args:
        traced: from :func:`codegen.trace.trace`.
        description: for the provenance comment.
        versions: for the provenance comment, from :func:`versions`; left out of kernels that only the cache sees.
        driver: what the kernel has besides the functions of a point.

    Raises:
        CodegenError: the energy cannot be differentiated.
    """
    from codegen.schedule import schedule
    from codegen.templates import kernel_source

    derived = derive(traced)
    schedules = _timed("schedule", lambda: schedule(derived))
    return _timed("print", lambda: kernel_source(derived, schedules, description, versions, driver))


def derive(traced: TracedEnergy) -> DerivedEnergy:
    """Symbolic energy, gradient and Hessian of a traced energy.

    Raises:
        CodegenError: the energy cannot be differentiated.
    """
    from codegen.derive import differentiate

    return _timed("derive", lambda: differentiate(traced))


def versions() -> dict[str, str]:
    """What generated a kernel: this package, sympy and Python."""
    from importlib import metadata

    found = {}
    for name in ("tmc-vem", "sympy"):
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "unknown"
    return {**found, "Python": platform.python_version()}


def _timed(stage: str, run: Callable[[], T]) -> T:
    start = time.perf_counter()
    result = run()
    logger.info("%s: %.3f s", stage, time.perf_counter() - start)
    return result
