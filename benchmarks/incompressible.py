"""Nearly incompressible solids: what elements make of a bonded block, from K / mu = 10 to 1e6."""

from __future__ import annotations

import warnings

import box_runs

RATIOS = (10.0, 1e2, 1e3, 1e4, 1e5)
ELEMENTS = (("quadrilaterals", 2), ("voronoi", 2), ("voronoi", 3))
ACROSS = (5, 10)  # cells along a side
PRESS = """\
name = "bonded block"
[shapes]
block = {{ rectangle = [0, 0, 1, 1] }}
[regions.block]
shape = "block"
solid = {{ K = {ratio}, mu = 1 }}
[mesh]
cells = "{cells}"
size = {size}
[edges]
bottom = {{ line = [[0, 0], [1, 0]] }}
top = {{ line = [[0, 1], [1, 1]] }}
[[support]]
at = "bottom"
ux = 0
uy = 0
[[support]]
at = "top"
ux = 0
[load]
at = "top"
uy = -0.1
[solve]
steps = 2
element = {{ order = {order} }}
"""


def press(ratio: float, cells: str, order: int, across: int) -> dict[str, float]:
    """Reaction and Newton iterations of a block that is pressed by a tenth between plates that it is bonded to.

    Args:
        ratio: K / mu.
        cells: 'quadrilaterals' or 'voronoi'.
        order: of the elements.
        across: cells along each side.
    """
    text = PRESS.format(ratio=ratio, cells=cells, order=order, size=1.0 / across)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = box_runs.problem(text)
    assert found["load"] == 1.0
    return {name: float(found[name]) for name in ("reaction", "iterations")}
