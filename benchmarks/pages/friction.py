"""Blocks of docs/friction.md, and of friction in docs/guide/verification.md."""

from __future__ import annotations

import friction_base
import friction_belt
import friction_block
import friction_demos
import friction_scheme

from pages.block import Block
from pages.runs import Measure, percent, table


def scheme(measure: Measure) -> str:
    """Errors of a layer's friction by path, scheme and number of steps."""
    rows = []
    for name in friction_scheme.PATHS:
        for scheme, values in measure(friction_scheme.errors, name).items():
            rows.append([name, scheme, *(_percent(value) for value in values)])
    return table(("the layer", "slip systems of", *(f"{n} steps" for n in friction_scheme.STEPS)), rows)


def block(measure: Measure) -> str:
    """Force ratio of a block by steps, with one and with two solutions of each, and their Newton iterations."""
    rows = []
    for n_steps in friction_block.STEPS:
        row = [str(n_steps)]
        for solutions in friction_block.SOLUTIONS:
            found = measure(friction_block.push, n_steps, solutions)
            row += [f"{found['ratio']:.5f}", str(found["iterations"])]
        rows.append(row)
    head = ("steps of the push", "beginning", "iterations", "again at the end", "iterations")
    return table(head, rows)


COEFFICIENTS = (0.3, 0.6)
CELLS = {"quadrilaterals": "quadrilaterals", "voronoi": "Voronoi cells"}
GAMMAS = (1e-5, 1e-6)  # of the line contact


def sliding(measure: Measure) -> str:
    """Errors of the force at which a block slides."""
    rows = []
    for coefficient in COEFFICIENTS:
        errors = measure(friction_demos.block, coefficient)
        rows.append([f"{coefficient:g}", *(percent(error, 1) for error in errors)])
    return table(("friction", "to the right", "to the left", "to the right again"), rows)


def bar(measure: Measure) -> str:
    """Differences of a bar with shear lag to the analytic forces."""
    return _bar(measure, 1e-5)


def thin_bar(measure: Measure) -> str:
    """The same of a thinner bar that is pulled less far."""
    return _bar(measure, 1e-6)


def _bar(measure: Measure, gamma: float) -> str:
    rows = []
    for cells, title in CELLS.items():
        found = measure(friction_demos.bar, gamma, cells)
        rows.append([f"{gamma:.0e}", title, percent(found["at_turn"], 1),
                     *(f"{100.0 * found[name]:.1f} %" for name in ("loading", "unloading", "all_the_way_back")),
                     percent(found["energy"], 1)])  # fmt: skip
    head = (
        "gamma",
        "cells",
        "at $u_m$",
        "pulled, at most",
        "let back, at most from $u_m/2$ on",
        "right after the turn, too",
        "energy of a cycle",
    )
    return table(head, rows)


def partial_slip(measure: Measure) -> str:
    """Differences of a line contact to Hertz, Cattaneo and Mindlin."""
    rows = []
    for gamma in GAMMAS:
        found = measure(friction_demos.cattaneo, gamma)
        rows.append([f"{gamma:.0e}", percent(found["contact"], 1), f"{found['ratio']:.3f}", percent(found["stick"], 1)])
    head = ("gamma", "half width of contact", "stick zone's over it, analytic", "half width of the stick zone")
    return table(head, rows)


def belt(measure: Measure) -> str:
    """Forces at the ends of a belt, and the growth of the pressure below it, next to the capstan's."""
    rows = []
    for friction, cells, meet in friction_belt.CASES:
        found = measure(friction_belt.slide, friction, cells, meet)
        rows.append([f"{friction:g}", str(cells), "meet" if meet else "slide apart", f"{found['stretch']:.3f}",
                     f"{found['ratio']:.3f}", f"{found['thin']:.3f}",
                     f"{found['thick']:.3f} ({percent(found['ratio'] / found['thick'] - 1, 1)})",
                     f"{found['growth']:.4f}",
                     f"{found['exponent']:.4f} ({percent(found['growth'] / found['exponent'] - 1, 1)})"])  # fmt: skip
    head = ("friction", "cells along the wrap", "nodes of drum and belt", "J in contact", "head / tail", "thin belt",
            "its thickness counted", "growth of ln p", "its thickness counted")  # fmt: skip
    return table(head, rows)


def base(measure: Measure) -> str:
    """A block on bases of other stiffness."""
    rows = []
    for young in friction_base.MODULI:
        found = measure(friction_base.slide, young)
        rows.append([f"{young / friction_base.BLOCK:g}", f"{found['ratio']:.4f}", f"{found['coefficient']:.4f}",
                     f"{found['sticking']:.2f}", f"{found['stretch']:.3f}"])  # fmt: skip
    return table(("E of base / block", "R_t / R_n", "friction_coefficient", "sticking", "J in contact"), rows)


def _percent(share: float) -> str:
    """A share with two digits; what is exact but for rounding is 0."""
    return "0" if share < 1e-10 else f"{100.0 * share:.2g} %"


BLOCKS = (
    Block("friction-scheme", "seconds", scheme),
    Block("friction-block", "minutes", block),
    Block("verification-sliding", "minutes", sliding),
    Block("verification-bar", "minutes", bar),
    Block("verification-thin-bar", "minutes", thin_bar),
    Block("verification-cattaneo", "minutes", partial_slip),
    Block("verification-belt", "minutes", belt),
    Block("friction-base", "seconds", base),
)
