"""Fields, cells as VTK has them, degrees of freedom and evaluations of several ranks, value by value."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from helpers_ranks import Ranks

from tmc_vem.support.errors import InputError
from tmc_vem.support.vtk_types import cell_types, from_vtk, to_vtk
from tmc_vem.system.constrained import Constrained
from tmc_vem.system.constraints import Prescribed, is_called
from tmc_vem.system.control import Control
from tmc_vem.system.discretisation import Evaluation, RegionValues
from tmc_vem.system.fields import Fields, Polygons, units_label, write_pvd, write_pvtu
from tmc_vem.system.interior_penalty import require_weights
from tmc_vem.system.layout import DISPLACEMENT, NodeLayout
from tmc_vem.system.reduction import Shares, in_order

# -- cells and fields ------------------------------------------------------------------------------------------------


def ring(*corners: tuple[float, float], bulge: float = 0.0) -> Any:
    """Corners with the middles of the sides between them; the first is moved."""
    x = np.array(corners)
    middles = 0.5 * (x + np.roll(x, -1, axis=0))
    middles[0] += bulge
    return np.stack([x, middles], axis=1).reshape(-1, 2)


TRIANGLE, SQUARE = ((0, 0), (1, 0), (0, 1)), ((0, 0), (1, 0), (1, 1), (0, 1))


@pytest.mark.parametrize(
    ("points", "kind"),
    [
        (ring(*TRIANGLE), 22), (ring(*SQUARE), 23), (ring(*TRIANGLE, bulge=2e-9), 7),
        (ring(*TRIANGLE, bulge=0.5e-9), 22), (ring(*SQUARE[::-1]), 7), (ring((0, 0), (1, 0), (0.4, 0.4), (0, 1)), 7),
        (ring((0, 0), (1, 0), (0.5, 0.5), (0, 1)), 7),
        (ring((0, 0), (1, 0), (1, 2e-4)), 22), (ring((0, 0), (1, 0), (1, 0.5e-4)), 7),
        (ring((0, 0), (2, 0), (2, 1), (1, 2), (0, 1)), 7),
    ],
)  # fmt: skip
def test_cells_in_which_vtk_interpolates_exactly(points: Any, kind: int) -> None:
    """At any size; between other cells."""
    for scale in (1.0, 1e-6):
        others = [scale * ring(*SQUARE), scale * points, scale * ring(*TRIANGLE)]
        offsets = np.concatenate([[0], np.cumsum([len(other) for other in others])])
        connectivity = np.arange(offsets[-1])
        types = cell_types(np.concatenate(others), offsets, connectivity)
        assert types.tolist() == [23, kind, 22]
        there = to_vtk(offsets, connectivity, types)
        assert there[:8].tolist() == [0, 2, 4, 6, 1, 3, 5, 7]
        assert (there[-6:] - offsets[2]).tolist() == [0, 2, 4, 1, 3, 5]
        assert from_vtk(offsets, there, types).tolist() == connectivity.tolist()
    assert cell_types(np.empty((0, 2)), np.array([0]), np.empty(0, dtype=int)).tolist() == []


def test_two_cells_of_a_kind_keep_their_nodes() -> None:
    points = np.concatenate([ring(*SQUARE), ring(*SQUARE)])
    offsets, connectivity = np.array([0, 8, 16]), np.arange(16)[::-1].copy()[np.arange(16)][::-1]
    types = cell_types(points, offsets, connectivity)
    there = to_vtk(offsets, connectivity, types)
    assert there.tolist() == [0, 2, 4, 6, 1, 3, 5, 7, 8, 10, 12, 14, 9, 11, 13, 15]
    assert from_vtk(offsets, there, types).tolist() == list(range(16))


def fields(n: int, start: float, media: tuple[str, ...] = ("m",)) -> Fields:
    x = np.arange(2.0 * n).reshape(n, 2) + start
    polygons = Polygons(x, np.array([0, n - 1, n]), np.arange(n), np.array([0, 1]), ("s", "m"), media)
    return Fields(polygons, x + 0.5, *(np.array([start, start + k]) for k in (1.0, 2.0, 3.0)))


def test_fields_of_ranks_are_put_together() -> None:
    merged = Fields.merge([fields(4, 0.0), fields(3, 100.0)])
    assert merged.polygons.offsets.tolist() == [0, 3, 4, 6, 7]
    assert merged.polygons.connectivity.tolist() == [0, 1, 2, 3, 4, 5, 6]
    assert merged.polygons.points_nx[4].tolist() == [100.0, 101.0]
    assert merged.displacement_ni[4].tolist() == [100.5, 101.5]
    assert (merged.jacobian_c.tolist(), merged.min_jacobian_c.tolist(), merged.energy_density_c.tolist()) == (
        [0.0, 1.0, 100.0, 101.0], [0.0, 2.0, 100.0, 102.0], [0.0, 3.0, 100.0, 103.0],
    )  # fmt: skip
    assert (merged.polygons.region_names, merged.polygons.media) == (("s", "m"), ("m",))
    assert merged.polygons.region_c.tolist() == [0, 1, 0, 1]
    assert merged.polygons.is_solid_c.tolist() == [True, False, True, False]
    assert fields(3, 0.0, ()).polygons.is_solid_c.tolist() == [True, True]
    assert (merged.polygons.n_cells, merged.polygons.cell(2).tolist()) == (4, [4, 5])


def test_collections_and_pieces_as_paraview_reads_them(tmp_path: Path) -> None:
    write_pvd(tmp_path / "a.pvd", [(0.5, ["x.vtu"]), (1.0, ["y.vtu", "z.vtu"])])
    lines = (tmp_path / "a.pvd").read_text().splitlines()
    assert lines[3:-2] == [
        '    <DataSet timestep="0.5" part="0" file="x.vtu"/>', '    <DataSet timestep="1" part="0" file="y.vtu"/>',
        '    <DataSet timestep="1" part="1" file="z.vtu"/>',
    ]  # fmt: skip
    write_pvtu(tmp_path / "a.pvtu", ["x_0.vtu", "x_1.vtu"])
    text = (tmp_path / "a.pvtu").read_text()
    assert text.index('<Piece Source="x_0.vtu"/>') < text.index('<Piece Source="x_1.vtu"/>')
    for name, kind in (("J", "Float64"), ("min_J", "Float64"), ("energy_density", "Float64"), ("region", "Int64"),
                       ("medium", "UInt8")):  # fmt: skip
        assert f'<PDataArray type="{kind}" Name="{name}">' in text
    assert units_label("") == ""
    assert units_label("mm") == '<InformationKey name="UNITS_LABEL" location="vtkDataArray">mm</InformationKey>'


def test_degrees_of_freedom_of_nodes() -> None:
    assert (DISPLACEMENT.size(5), DISPLACEMENT.n_nodes(10), DISPLACEMENT.dof(3, 1), DISPLACEMENT.dof(3)) == (
        10,
        5,
        7,
        6,
    )
    three = NodeLayout(3)
    assert three.dofs(np.array([[0, 2]])).tolist() == [[[0, 1, 2], [6, 7, 8]]]
    assert (three.node(np.array([4, 8])).tolist(), three.component(np.array([4, 8])).tolist()) == ([1, 2], [1, 2])
    assert three.nodal(np.arange(6)).tolist() == [[0, 1, 2], [3, 4, 5]]


def test_evaluations_put_together() -> None:
    """Of two ranks, with dead loads; the smallest J, or one that is none, is named with its cell."""
    shares = Shares(("a", "b"))
    shares.add_cells("a", np.array([1.0, 2.0]), np.array([0.5, 0.25]), np.array([7, 8]))
    shares.add_cells("a", np.array([4.0]), np.array([0.75]), np.array([9]))
    shares.add("b", 8.0)
    other = ({"a": 16.0, "b": 32.0}, {"a": (0.125, 3), "b": (0.5, 4)}, 0.5)
    found = shares.together(Ranks(0, other=other), 0.25)  # type: ignore[arg-type]
    assert found == Evaluation(
        62.25, {"a": RegionValues(23.0, 0.125), "b": RegionValues(40.0, 0.5)}, "J = 0.125 in cell 3 of region 'a'"
    )
    odd = ({"a": 0.0, "b": 0.0}, {"a": (0.125, 3), "b": (float("nan"), 4)}, 0.0)
    found = shares.together(Ranks(0, other=odd))  # type: ignore[arg-type]
    assert found.worst == "J = nan in cell 4 of region 'b'"
    assert not found.admissible
    assert Evaluation(0.0, {"a": RegionValues(0.0, 0.5), "b": RegionValues(0.0, 0.25)}).min_j == 0.25
    assert [Evaluation(0.0, {"a": RegionValues(0.0, j)}).admissible for j in (1e-300, 0.0, -1.0)] == [
        True,
        False,
        False,
    ]


def test_values_in_the_order_of_names() -> None:
    found = {"a": np.array([1.0, 2.0]), "b": np.array([3.0, 4.0])}
    assert in_order(("b", "a"), found).tolist() == [[3.0, 4.0], [1.0, 2.0]]
    assert in_order((), found).shape == (0, 2)
    with pytest.raises(InputError, match=r"^the mesh has no named point 'c'$"):
        in_order(("a", "c"), found)
    assert Control(0.5) == Control(0.5, {})


# -- conditions ------------------------------------------------------------------------------------------------------


def test_points_of_a_group_go_by_its_name() -> None:
    named = {("a", "a"): True, ("a#1", "a"): True, ("a#12", "a"): True, ("a#x", "a"): False, ("b#1", "a"): False,
             ("a1", "a"): False, ("1", "a"): False, ("a#", "a"): False, ("a#1", "a#1"): True}  # fmt: skip
    assert {pair: is_called(*pair) for pair in named} == named


def test_prescribed_degrees_of_freedom() -> None:
    """Where two conditions meet the last one holds; nodes that a rank has not are left out."""
    nodes = {"a": np.array([4, 1]), "b": np.array([1, 2])}
    conditions = (Prescribed("a", 1, 0.5), Prescribed("b", 0, 2.0), Prescribed("b", 1, 3.0))
    found = Constrained.of(conditions, nodes.__getitem__)
    assert (found.dofs.tolist(), found.condition_d.tolist()) == ([2, 3, 4, 5, 9], [1, 2, 1, 2, 0])
    assert found.at(Control(0.5)).tolist() == [1.0, 1.5, 1.0, 1.5, 0.25]
    assert found.per_load(Control(0.5)).tolist() == [2.0, 3.0, 2.0, 3.0, 0.5]
    other = found.renumbered(np.array([0, 7, -1, 5, 6]))
    assert (other.dofs.tolist(), other.condition_d.tolist()) == ([14, 15, 13], [1, 2, 0])
    assert other.prescribed == conditions
    with pytest.raises(InputError) as caught:
        require_weights("m", SimpleNamespace(name="mine", parameter_names=("gamma",)))  # type: ignore[arg-type]
    assert str(caught.value) == (
        "region 'm': the interior penalty is weighted by gamma and alpha_r, but energy 'mine' has no parameter "
        "'alpha_r'; use interior penalty 'none'"
    )
