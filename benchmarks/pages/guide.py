"""Blocks of the guide and the how-to pages, and of docs/codegen.md."""

from __future__ import annotations

import re
from typing import Any

import box_runs
import kernel_accuracy
import numpy as np
import projection_space
import vtk_strain

from pages import contact, fem
from pages.block import Block
from pages.runs import ROOT, Measure, percent, table

EXAMPLES = {"seal": "demos/problems/seal.toml", "gripper": "demos/problems/gripper.toml"}
STATES = {
    "\\|F - I\\| = 1e-8, 1e-6, 1e-4": ("H=1e-8", "H=1e-6", "H=1e-4"),
    "\\|F - I\\| = 0.01 to 0.2": ("H=1e-2", "H=0.06", "H=0.2"),
    "J = 1e-6, squeezed in one direction or in both, rotations to 60 degrees": ("J=1e-6", "J=1e-6, flat"),
    "J = 1e-3 and J = 3, rotations to 60 degrees": ("J=1e-3", "J=3"),
}


def squeezed(run: dict[str, Any]) -> int:
    """What the summary warns of: percent of the final reaction that squeeze the medium; 0 without a warning."""
    found = [re.match(r"(\d+)[.\d]*% of the final reaction squeezes", warning) for warning in run["warnings"]]
    return max((int(match[1]) for match in found if match), default=0)


def plug() -> str:
    """The problem file that stands in the tutorial."""
    page = (ROOT / "docs/guide/tutorial.md").read_text()
    text = re.search(r"cat > plug.toml <<'EOF'\n(.*?)^EOF$", page, re.DOTALL | re.MULTILINE)
    assert text is not None
    return text[1]


def tutorial(measure: Measure) -> str:
    """The plug of the tutorial."""
    run = measure(box_runs.problem, plug())
    return (
        f"The gap closes from 0.15 to {run['gap']:.4f}, and the plug is compressed by the rest. The summary also "
        f"warns: {squeezed(run)} % of the final reaction squeezes the medium and not the bodies. That is the gap that "
        "is left, by which plug and base are pressed together too far; the reaction is too large by about as much."
    )


def _example(measure: Measure, name: str, gamma: str | None = None) -> dict[str, Any]:
    text = (ROOT / EXAMPLES[name]).read_text()
    if gamma:
        assert text.count("gamma = 1e-4") == 1
        text = text.replace("gamma = 1e-4", f"gamma = {gamma}")
    found: dict[str, Any] = measure(box_runs.problem, text)
    return found


def examples(measure: Measure) -> str:
    """What the two problem files give."""
    rows = []
    for name in EXAMPLES:
        run = _example(measure, name)
        reached = "full load" if run["load"] == 1.0 else f"{100 * run['load']:.0f} % of the load"
        rows.append([name, reached, str(run["steps"]), f"{run['gap']:.2e}", f"{100 * run['medium_energy']:.1f} %",
                     f"{squeezed(run)} %" if squeezed(run) else "below 5 %"])  # fmt: skip
    head = (
        "problem",
        "reached",
        "load steps",
        "gap",
        "medium's part of the energy",
        "reaction that squeezes the medium",
    )
    return table(head, rows)


def gripper(measure: Measure) -> str:
    """The warning of the gripper, and what a smaller gamma does."""
    runs = [_example(measure, "gripper", gamma) for gamma in (None, "1e-5")]
    change = percent(runs[1]["reaction"] / runs[0]["reaction"] - 1, 0)
    share = squeezed(runs[0])
    return f"`demos/problems/gripper.toml` says {share} %; with gamma = 1e-5 its reaction changes by {change}."


def units(measure: Measure) -> str:
    """The box with an alpha_r that belongs to other units."""
    right, small, large = (measure(box_runs.box, (40, 10), alpha_r, 1e-5) for alpha_r in (1.0, 1e-6, 1e6))
    assert right["load"] == small["load"] == large["load"] == 1.0
    change = percent(small["gap"] / right["gap"] - 1, 1)
    return (
        "The same body in Pa instead of MPa needs an `alpha_r` that is 10^6 times larger. With the old number the gap "
        f"of the box (`--alpha-r 1e-6` in place of 1) changes by {change}; in the other direction (`--alpha-r 1e6`) it "
        f"is {large['gap']:.2f} instead of {right['gap']:.1e}."
    )


def degree_4(measure: Measure) -> str:
    """A larger degree than necessary, on squares."""
    changes = []
    for gamma in (1e-4, 1e-5, 1e-6):
        gaps = [measure(box_runs.box, (40, 10), 1.0, gamma, element={"projection": "full", "degree": degree})["gap"]
                for degree in (3, 4)]  # fmt: skip
        changes.append(f"{percent(gaps[1] / gaps[0] - 1, 0)} at gamma = {gamma:.0e}")
    return f"On 40 x 10 squares, alpha_r = 1, `--l 4` instead of 3 changes the gap by {', '.join(changes)}."


def vtk(measure: Measure) -> str:
    """Strains by VTK."""
    outline, triangles, polygons = measure(vtk_strain.strains)
    return (
        "The box under a tenth of its load, `demos/demo_vtk_filters.py`. The mean of du_y/dy is "
        f"{outline:.3f} by the displacements of the outline; the filter gives {triangles:.3f} in triangles and "
        f"{polygons:.3f} in polygons."
    )


def rates(measure: Measure) -> str:
    """Orders on Voronoi cells."""
    rows = []
    for order in (2, 3):
        found = np.array([measure(projection_space.voronoi_errors, n, order) for n in (16, 64, 256)])
        sizes = found[:, 2] ** -0.5
        orders = np.diff(np.log(found[:, :2]), axis=0) / np.diff(np.log(sizes))[:, None]
        cells = [
            f"{', '.join(f'{x:.2f}' for x in column)} ({order + 1 - n} expected)" for n, column in enumerate(orders.T)
        ]
        rows.append([f"virtual elements, $k = {order}$", *cells])
    return table(("", r"$\lVert u - u_h \rVert$", r"$\lVert \nabla u - \Pi \nabla u_h \rVert$"), rows)


def same_squares(measure: Measure) -> str:
    """Both methods on equal squares."""
    n = fem.CONVERGENCE_MESHES[-1]
    rows = []
    for pair in fem.CONVERGENCE_PAIRS:
        found = fem.both_methods(measure, n, pair)
        rows.append([f"{pair[0]:g}, {pair[1]:.0e}", *(f"{gap:.4e} / {energy:.3e}" for gap, energy in found)])
    return table((r"$\alpha_r$, $\gamma$", "finite elements, 3 x 3 points", "virtual elements, 4 x 4 points"), rows)


def other_cells(measure: Measure) -> str:
    """Both methods, Voronoi cells and hanging nodes."""
    voronoi, full = {"cell_kind": "voronoi"}, {"interior_penalty": "full"}
    cases: dict[str, dict[str, Any]] = {
        "finite elements on squares, 3 x 3 points": {"method": "fem"},
        "virtual elements on squares, 4 x 4 points (Q2)": {},
        "virtual elements on Voronoi cells": {"box": voronoi},
        "virtual elements, cells of the medium halved (hanging nodes)": {"box": {"medium_refinement": 2}},
        "virtual elements on squares, interior penalty `full`": {"element": full},
        "virtual elements on Voronoi cells, interior penalty `full`": {"box": voronoi, "element": full},
    }
    runs = {label: measure(box_runs.box, (80, 20), 1.0, 1e-5, **case) for label, case in cases.items()}
    base = next(iter(runs.values()))["gap"]
    rows = [[label, f"{run['gap']:.4e}", "" if n == 0 else percent(run["gap"] / base - 1), f"{run['reaction']:.4e}",
             f"{_bending(run):.2e}"] for n, (label, run) in enumerate(runs.items())]  # fmt: skip
    return table(("", "gap", "difference", "reaction", "energy of the regulariser"), rows)


def _bending(run: dict[str, Any]) -> float:
    """Energy of the regulariser in cells and between them."""
    return float(run["checks"]["regulariser_energy"] + run["checks"].get("penalty_energy", 0.0))


def accuracy(measure: Measure) -> str:
    """Errors of kernels."""
    from tmc_vem.energy import PAPER_DENSITIES

    rows = []
    for label, states in STATES.items():
        found = [measure(kernel_accuracy.largest_errors, state, name) for state in states for name in PAPER_DENSITIES]
        rows.append([label, *(f"{max(column):.0e}" for column in zip(*found, strict=True))])
    return table(("states", "energy", "gradient", "Hessian"), rows)


ACCURACY = Block("codegen-accuracy", "minutes", accuracy)
BLOCKS = (
    Block("tutorial-plug", "seconds", tutorial),
    Block("examples", "minutes", examples),
    Block("gripper", "minutes", gripper),
    Block("units", "seconds", units),
    Block("degree-4", "seconds", degree_4),
    Block("vtk-strains", "seconds", vtk),
    Block("verification-rates", "seconds", rates),
    Block("verification-squares", "minutes", same_squares),
    Block("verification-cells", "minutes", other_cells),
    Block("verification-bricks", "seconds", contact.bricks),
    ACCURACY,
)
