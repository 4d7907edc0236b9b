"""Block of docs/guide/loads.md."""

from __future__ import annotations

import load_runs

from pages.block import Block
from pages.runs import ROOT, Measure


def examples(measure: Measure) -> str:
    """The two problem files whose loads are pressures."""
    texts = {name: (ROOT / f"demos/problems/{name}.toml").read_text() for name in ("pneumatic", "bistable")}
    finger, arch = (measure(load_runs.history, text) for text in texts.values())
    last, full = finger[-1], min(arch, key=lambda step: abs(step["load"] - 1.0))
    through = next(step for step in arch if step["jumped"])
    return (
        f"The chambers grow from {last['air.area_at_start']:.3f} to {last['air.area']:.3f}, and the finger presses on "
        f"the block with {last['contact']:.4f}. The arch goes through at {100 * through['load']:.0f} % of the "
        f"pressure; it presses on the floor with {full['contact']:.4f} at full pressure, and when the pressure is gone "
        f"with {arch[-1]['contact']:.4f}, its crown {-arch[-1]['crown']:.3f} lower than in the beginning."
    )


BLOCKS = (Block("loads-examples", "minutes", examples),)
