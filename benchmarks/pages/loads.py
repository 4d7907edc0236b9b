"""Block of docs/guide/loads.md."""

from __future__ import annotations

import itertools

import load_runs

from pages.block import Block
from pages.runs import ROOT, Measure


def examples(measure: Measure) -> str:
    """The problem files whose loads are pressures, and a force."""
    texts = {name: (ROOT / f"demos/problems/{name}.toml").read_text() for name in ("pneumatic", "bistable", "snap")}
    finger, arch, lid = (measure(load_runs.history, text) for text in texts.values())
    last, full = finger[-1], min(arch, key=lambda step: abs(step["load"] - 1.0))
    through = next(step for step in arch if step["jumped"])
    most = next(a for a, b in itertools.pairwise(lid) if b["load"] < a["load"])
    least = min(lid, key=lambda step: step["load"])
    return (
        f"The chambers grow from {last['air.area_at_start']:.3f} to {last['air.area']:.3f}, and the finger presses on "
        f"the block with {last['contact']:.4f}. The arch goes through at {100 * through['load']:.0f} % of the "
        f"pressure; it presses on the floor with {full['contact']:.4f} at full pressure, and when the pressure is gone "
        f"with {arch[-1]['contact']:.4f}, its crown {-arch[-1]['crown']:.3f} lower than in the beginning. The lid's "
        f"force rises to {100 * most['load']:.0f} % where the crown is {-most['crown']:.3f} lower, falls to "
        f"{100 * least['load']:.0f} % at {-least['crown']:.3f}, and at 100 % the lid lies on the floor with "
        f"{lid[-1]['contact']:.4f}."
    )


BLOCKS = (Block("loads-examples", "minutes", examples),)
