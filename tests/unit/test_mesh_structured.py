"""Structured quadrilaterals and the parameter checks of the box."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tmc_vem.mesh import Rectangle, structured_quadrilaterals
from tmc_vem.mesh.geometry import areas
from tmc_vem.problems import Box, Material, Medium
from tmc_vem.support.errors import InputError

WHOLE = Rectangle("solid", 0.0, 2.0, 0.0, 1.0)


def test_cells_and_regions_where_they_belong():
    x, y = [0.0, 0.5, 0.6, 2.0], [0.0, 0.25, 1.0]
    mesh = structured_quadrilaterals(x, y, [WHOLE, Rectangle("hole", 0.5, 2.0, 0.25, 1.0)], {"tip": (2.0, 0.25)})
    assert (mesh.n_cells, mesh.n_vertices) == (6, 12)
    assert mesh.points_vx[mesh.named_vertex("tip")].tolist() == [2.0, 0.25]
    for c, loop in enumerate(mesh.cells()):
        corners = mesh.points_vx[loop]
        i, j = c % 3, c // 3
        assert corners.tolist() == [[x[i], y[j]], [x[i + 1], y[j]], [x[i + 1], y[j + 1]], [x[i], y[j + 1]]]
        assert mesh.region_names[mesh.region_c[c]] == ("hole" if i > 0 and j > 0 else "solid")
    assert sum(areas(mesh.points_vx[loop][None])[0] for loop in mesh.cells()) == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("x", "y", "rectangles", "points", "message"),
    [
        ([0, 2], [0, 1], [WHOLE, Rectangle("m", 0.1, 2, 0, 1)], {}, r"region 'm' ends at x = 0\.1, .* \(nearest 0\)"),
        ([0, 2], [0, 1], [Rectangle("m", 0, 2, 0, 1.5)], {}, r"region 'm' ends at y = 1\.5, which is not a mesh line"),
        ([0, 1, 2], [0, 1], [Rectangle("m", 1, 2, 0, 1)], {}, r"lower left corner \(0, 0\) is in no region"),
        ([0, 2, 1], [0, 1], [WHOLE], {}, r"x mesh lines must be at least two increasing numbers"),
        ([0, 2], [0], [WHOLE], {}, r"y mesh lines must be at least two increasing numbers"),
        ([0, 2], [0, math.nan], [WHOLE], {}, r"y mesh lines must be at least two increasing numbers"),
        ([0, math.inf], [0, 1], [WHOLE], {}, r"x mesh lines .*"),
        ([0, 2], [0, 1], [WHOLE], {"load": (1.0, 1.0)}, r"'load': no node at \(1, 1\)"),
        ([0, 1, 2], [0, 1], [Rectangle("m", 2, 0, 0, 1)], {}, r"region 'm' is an empty rectangle: x0 = 2, x1 = 0"),
    ],
)
def test_bad_input(x, y, rectangles, points, message):
    with pytest.raises(InputError, match=message):
        structured_quadrilaterals(x, y, rectangles, points)


@pytest.mark.parametrize("cells", [(20, 5), (20, 10), (40, 10), (60, 30)])
def test_box_regions_have_their_areas(cells):
    mesh = Box(cells=cells).make_mesh()
    area = dict.fromkeys(mesh.region_names, 0.0)
    for c, loop in enumerate(mesh.cells()):
        area[mesh.region_names[mesh.region_c[c]]] += areas(mesh.points_vx[loop][None])[0]
    assert area == pytest.approx({"solid": 2 * 0.5 - 1.8 * 0.3, "medium": 1.8 * 0.3})
    where = {name: mesh.points_vx[v].tolist() for name, v in mesh.named_points.items()}
    assert where["load"] == pytest.approx([1.0, 0.5])
    assert where["flange_top"] == pytest.approx([1.0, 0.4])
    assert where["flange_bottom"] == pytest.approx([1.0, 0.1])
    assert np.ptp(mesh.points_vx, axis=0).tolist() == [2.0, 0.5]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"cells": (30, 10)}, r"30 cells in x do not resolve the wall: 0\.1 is 1\.5 cells .*use a multiple of 20"),
        ({"cells": (40, 12)}, r"12 cells in y do not resolve the wall: .*use a multiple of 5"),
        ({"cells": (10, 5)}, r"10 cells in x do not resolve the wall"),
        ({"cells": (0, 5)}, r"cells = \(0, 5\): give the number of cells"),
        ({"cells": (20,)}, r"cells = \(20,\)"),
        ({"cells": (20, 5), "length": 1.9, "wall": 0.1}, r"20 cells in x do not resolve the wall"),
        ({"cells": (19, 5), "length": 1.9}, r"19 cells in x leave no node in the middle"),
        ({"wall": 0.0}, r"wall = 0 must be a positive number"),
        ({"wall": -0.1}, r"wall = -0\.1 must be a positive number"),
        ({"length": math.nan}, r"length = nan must be a positive number"),
        ({"height": math.inf}, r"height = inf must be a positive number"),
        ({"wall": 0.25}, r"wall = 0\.25 leaves no cavity in a box of 2 x 0\.5"),
        ({"uy": math.nan}, r"uy = nan must be a finite number"),
    ],
)
def test_box_refuses(arguments, message):
    with pytest.raises(InputError, match=message):
        Box(**arguments)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"gamma": 0.0}, r"gamma = 0 must be a positive number"),
        ({"gamma": -1e-5}, r"gamma = -1e-05 must be a positive number"),
        ({"gamma": math.nan}, r"gamma = nan must be"),
        ({"alpha_r": 0.0}, r"alpha_r = 0 must be a positive number"),
        ({"beta": -1.0}, r"beta = -1 must not be negative"),
        ({"beta": math.nan}, r"beta = nan"),
        (
            {"regulariser": "hulu"},
            r"unknown regulariser 'hulu' \(did you mean 'huhu'\?\): choose one of huhu, huhu_lulu",
        ),
        ({"parameters": {"c": 1.0}}, r"regulariser 'huhu_lulu' takes no parameters; given: c"),
    ],
)
def test_medium_refuses(arguments, message):
    with pytest.raises(InputError, match=message):
        Medium(**arguments)


@pytest.mark.parametrize("values", [(0.0, 1.0), (1.0, -1.0), (math.inf, 1.0)])
def test_material_refuses(values):
    with pytest.raises(InputError, match="must be a positive number"):
        Material(*values)
