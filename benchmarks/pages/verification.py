"""Third medium, its limit and conventional contact, for docs/guide/verification.md."""

from __future__ import annotations

import math

import conventional_medium as medium
from conventional import studies

from pages.block import Block
from pages.runs import Measure, percent, table

GAMMAS = (1e-4, 1e-5, 1e-6)
FIRST = {"box": 1e-4, "cbox": 3e-4}  # from 1e-4 on, the sharp corner of the C-box would slip into the lower arm
LOADS = {"box": (0.4, 0.7, 1.0), "cbox": (0.36, 0.45, 0.5)}
TITLES = {"box": "box", "cbox": "C-box"}
CELLS = [20, 10]
PENALTIES = {"box": (1e4, 1e5), "cbox": (1e2, 1e3)}
POINTS = {
    "box": ("gauss 4", "gauss 10"),
    "cbox": ("nodes", "gauss 10"),
}  # in the C-box a corner touches, which is a node
HERTZ_PENALTIES = (1e5, 1e6)
HERTZ_LOAD = 0.027


def limit(values: list[float], ratio: float = 10.0) -> float:
    """Value at gamma -> 0 from the last two, of gammas in a ratio: errors shrink like gamma^(3/5)."""
    return values[-1] - (values[-2] - values[-1]) / (ratio**0.6 - 1.0)


def stiff(soft: float, hard: float, ratio: float = 10.0) -> float:
    """Value at infinite penalty from two penalties in a ratio: errors shrink like one over the penalty."""
    return hard + (hard - soft) / (ratio - 1.0)


def reactions(measure: Measure) -> str:
    """Reactions of box and C-box."""
    rows = []
    for name, loads in LOADS.items():
        study = getattr(studies, name)
        found = measure(medium.limits, name, CELLS, FIRST[name], list(loads))
        first, *others = POINTS[name]
        soft, hard = (measure(study, CELLS, list(loads), penalty, first)["reactions"] for penalty in PENALTIES[name])
        else_where = [measure(study, CELLS, list(loads), PENALTIES[name][1], other)["reactions"] for other in others]
        for n, load in enumerate(loads):
            truth = stiff(soft[n], hard[n])
            doubt = max(abs(value - hard[n]) for value in (truth, *(values[n] for values in else_where)))
            values = [_against(abs(value), truth) for value in found[n]["at"]]
            limited = f"{_against(abs(found[n]['limit']), truth)} ± {100 * found[n]['uncertainty'] / truth:.2f} %"
            rows.append([f"{TITLES[name]}, u_y = -{load:g}", f"{FIRST[name]:.0e}", *values, limited, f"{truth:.5e}",
                         f"{100 * doubt / truth:.2f} %"])  # fmt: skip
    head = (
        "reaction of",
        "gamma",
        "there",
        "gamma / 10",
        "gamma / 100",
        "limit",
        "conventional",
        "its own uncertainty",
    )
    return table(head, rows)


def _against(value: float, truth: float) -> str:
    return f"{value:.5e} ({percent(value / truth - 1, 2)})"


def hertz(measure: Measure) -> str:
    """Hertz's contact on triangles."""
    runs = [measure(medium.hertz, gamma) for gamma in GAMMAS]
    soft, hard = (measure(studies.hertz, HERTZ_LOAD, penalty) for penalty in HERTZ_PENALTIES)
    force = stiff(soft["force"], hard["force"])
    width = math.sqrt(8.0 * force / (math.pi * 1000.0 / 1.82))
    analytic = {"force": "", "half_width": f"{width:.5f}", "peak": f"{4.0 * force / (math.pi * width):.3f}"}
    rows = []
    for name, title, digits in (
        ("force", "force of the half", 5),
        ("half_width", "half width", 5),
        ("peak", "peak", 3),
    ):
        truth = stiff(soft[name], hard[name])
        values = [run[name] for run in runs]
        both = [f"{value:.{digits}f} ({percent(value / truth - 1, 2)})" for value in (*values, limit(values))]
        rows.append([title, *both, f"{truth:.{digits}f}", analytic[name]])
    head = ("", *(f"gamma = {gamma:.0e}" for gamma in GAMMAS), "limit", "conventional", "Hertz at that force")
    return table(head, rows)


BLOCKS = (
    Block("verification-conventional", "minutes", reactions),
    Block("verification-hertz", "minutes", hertz),
)
