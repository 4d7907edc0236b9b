"""How far the single nodes that carry and load the box sink in, and what that does to its gap.

The box stands on two nodes and is loaded at one. A point on the boundary of a plane body sinks in without bound when
the mesh is refined, by about the same amount for every halving (Flamant's solution has a logarithm there). So the
flanges are pressed together a little less on every finer mesh, and the gap has no limit in the strict sense.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from tmc_vem.report.page import Table
from tmc_vem.report.tables import number, percent
from tmc_vem.results.run_result import RunResult
from tmc_vem.results.snapshots import read_fields, snapshots
from tmc_vem.support.errors import InputError
from tmc_vem.system.fields import Fields

# the loaded node and a supported one, with the points on the other face of the wall
LOADED = ((1.0, 0.5), (1.0, 0.4))
SUPPORTED = ((0.0, 0.0), (0.0, 0.1))


def sinking(runs: Mapping[str, RunResult | None]) -> Table | None:
    """Table of meshes: how far the nodes have sunk in, and the change of the gap that this explains.

    The gap's derivative with respect to the displacement is taken from the last load step; what the nodes sink in is
    taken from the displacement.

    Args:
        runs: by name of the mesh, from coarse to fine.

    Returns:
        The table, or None if a run or its fields are missing.
    """
    rows: list[Sequence[str]] = []
    before: tuple[float, float] | None = None
    for name, run in runs.items():
        if run is None or not run.complete or run.gap is None or run.steps < 2:
            return None
        try:
            fields = read_fields(run, snapshots(run)[-1])
        except (InputError, IndexError):
            return None
        load, support = _shortened(fields, *LOADED), _shortened(fields, *SUPPORTED)
        row = [name, number(load, 3), number(support, 3), number(run.gap)]
        if before is None:
            row += ["–", "–"]
        else:
            row.append(percent(run.gap / before[1] - 1.0))
            row.append(percent(-_slope(run) * (load + support - before[0]) / before[1]))
        rows.append(row)
        before = (load + support, run.gap)
    head = ("mesh", "load sinks in", "support sinks in", "gap", "change of the gap", "of it by sinking in")
    return Table("How far the single nodes sink into the wall, and what that does to the gap.", head, rows)


def creep(coarse: RunResult | None, fine: RunResult | None) -> float:
    """Change of the gap, relative to it, by what the single nodes sink in further on a finer mesh; 0 if unknown."""
    try:
        if coarse is None or fine is None or not fine.gap or fine.steps < 2:
            return 0.0
        first, second = (read_fields(run, snapshots(run)[-1]) for run in (coarse, fine))
    except (InputError, IndexError):
        return 0.0
    deeper = sum(_shortened(second, *pair) - _shortened(first, *pair) for pair in (LOADED, SUPPORTED))
    return -_slope(fine) * deeper / fine.gap


def _shortened(fields: Fields, first: tuple[float, float], second: tuple[float, float]) -> float:
    """By how much two points have come closer."""
    points = fields.polygons.points_nx
    a, b = (int(np.argmin(np.hypot(*(points - np.array(at)).T))) for at in (first, second))
    moved = points + fields.displacement_ni
    return float(np.hypot(*(points[a] - points[b])) - np.hypot(*(moved[a] - moved[b])))


def _slope(run: RunResult) -> float:
    """Derivative of the gap with respect to the size of the displacement, at the end."""
    last, previous = run.history[-1], run.history[-2]
    assert last.gap is not None
    assert previous.gap is not None
    return (last.gap - previous.gap) / (abs(last.displacement) - abs(previous.displacement))
