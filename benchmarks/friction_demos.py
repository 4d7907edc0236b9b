"""How close the demos of friction come to their analytic solutions: numbers of docs/guide/verification.md."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "demos"))


def block(friction: float) -> list[float]:
    """Force at which the block slides over that of Coulomb, less 1, at its three turns."""
    from demo_sliding_block import at_turns, solve

    with tempfile.TemporaryDirectory() as directory:
        result = solve(friction, Path(directory), quick=False)
    return [turn.error(friction) for turn in at_turns(result)]


def bar(gamma: float, cells: str) -> dict[str, float]:
    """Differences of the bar's forces to the analytic ones, in parts of the largest, and of the energy of a cycle."""
    from demo_shear_lag import BARS, solve

    with tempfile.TemporaryDirectory() as directory:
        found = solve(BARS[gamma], gamma, cells, Path(directory), quick=False)
    names = ("loading", "at_turn", "all_the_way_back", "unloading", "energy")
    return {name: getattr(found, name) for name in names}


def cattaneo(gamma: float) -> dict[str, float]:
    """Differences of the half widths of contact and stick zone to the analytic ones, in parts of the contact's."""
    from demo_cattaneo import solve

    with tempfile.TemporaryDirectory() as directory:
        found = solve(Path(directory), gamma, quick=False)
    known = found.contact
    return {
        "contact": found.width / known.half_width - 1.0,
        "stick": (found.stick - known.stick) / known.half_width,
        "ratio": known.stick / known.half_width,
    }
