"""What a check of an energy finds: a property, its figure and the verdict; and rates at which remainders fall."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

EXACT = 1e-13


@dataclass(frozen=True)
class Finding:
    """One checked property.

    Attributes:
        what: the property.
        measured: the figure, as text.
        required: what it must be, as text.
        passed: the verdict.
        words: what is wrong, or what to know, in a sentence; empty if there is nothing to say.
    """

    what: str
    measured: str
    required: str
    passed: bool
    words: str = ""


def rate_finding(what: str, steps: Sequence[float], remainders: Array, order: int, words: str) -> Finding:
    """Whether remainders (n_steps, n_states), relative to what they are of, fall with a power of the step.

    Args:
        what: the property.
        steps: from the largest on.
        remainders: for each step.
        order: the power.
        words: what is wrong if they do not.
    """
    required = f"> {order - 0.1:.1f}"
    size = np.sqrt(np.mean(remainders**2, axis=1))
    if size[0] < EXACT:  # a polynomial of lower degree: there is nothing left to decay
        return Finding(what, "exact", required, True)
    rate = float(np.polyfit(np.log(steps), np.log(size), 1)[0]) if np.isfinite(size).all() else np.nan
    passed = rate > order - 0.1
    return Finding(what, f"{rate:.2f}", required, passed, "" if passed else words)


def relative(found: Array, expected: Array, tiny: float = 1e-6) -> Array:
    """Relative differences; of what is below a tiny part of the usual size, relative to that part."""
    size = np.abs(expected)
    return np.asarray(np.abs(found - expected) / np.maximum(size, tiny * np.median(size) + np.finfo(float).tiny))
