"""Voronoi meshes: exact interfaces, relaxation, short edges, refusals; patch test and rates."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tmc_vem.mesh.check import find_faults
from tmc_vem.mesh.geometry import areas, centroids
from tmc_vem.mesh.make.outline import Arc, Region, make_skeleton
from tmc_vem.mesh.make.triangles import triangle_mesh
from tmc_vem.mesh.make.voronoi import voronoi_mesh
from tmc_vem.mesh.quality import measure
from tmc_vem.support.errors import InputError

SQUARE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
CIRCLE = [Arc((0.5, 0.5), 0.25, 0, 180), Arc((0.5, 0.5), 0.25, 180, 360)]
PUNCH = [
    Region("block", [(0, 0), (2, 0), (2, 1), (0, 1)]),
    Region("punch", [Arc((0, 2.3), 1, -90, 0), (0, 2.3)]),
    Region("medium", [(0, 1), (2, 1), (2, 2.3), (1, 2.3), Arc((0, 2.3), 1, 0, -90)]),
]
DOMAINS = {
    "square": [Region("a", SQUARE)],
    "straight interface": [
        Region("a", [(0, 0), (2, 0), (1.4, 1), (0, 1)]),
        Region("b", [(2, 0), (3, 0.7), (2.4, 1.6), (1.4, 1)]),
    ],
    "circle in a square": [Region("around", SQUARE, [CIRCLE]), Region("disc", CIRCLE)],
    "re-entrant corner": [Region("L", [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)])],
    "T-junction": [Region("a", [(0, 0), (2, 0), (2, 1), (0, 1)]), Region("b", [(0, 1), (1, 1), (1, 2), (0, 2)])],
    "punch": PUNCH,
}


def region_areas(mesh):
    area = dict.fromkeys(mesh.region_names, 0.0)
    for c, loop in enumerate(mesh.cells()):
        area[mesh.region_names[mesh.region_c[c]]] += areas(mesh.points_vx[loop][None])[0]
    return area


@pytest.mark.parametrize("size", [0.13, 0.07])
@pytest.mark.parametrize("name", DOMAINS)
def test_interfaces_are_edges_and_nodes_lie_on_the_curves(name, size):
    regions = DOMAINS[name]
    mesh = voronoi_mesh(regions, size)
    assert not find_faults(mesh)
    skeleton = make_skeleton(regions, size)
    position = {tuple(p): v for v, p in enumerate(mesh.points_vx.tolist())}
    edges = set(map(tuple, mesh.edges.vertices_ev.tolist()))
    for a, b in skeleton.segments_sn:
        ends = sorted(position[tuple(skeleton.nodes_nx[n])] for n in (a, b))  # to the last bit
        assert tuple(ends) in edges
    curves = [curve for region in regions for curve in region.curves()]
    for node in skeleton.nodes_nx.tolist():
        assert min(curve.parameter_of(tuple(node))[1] for curve in curves) < 1e-12
    inside = measure(mesh)
    assert inside.star_shaped_c.all()
    exact = {}
    for region in regions:
        exact[region.name] = exact.get(region.name, 0.0) + region.polygon().area
    assert region_areas(mesh) == pytest.approx(exact, rel=0.05)  # chords of curves
    if not any(isinstance(e, Arc) for r in regions for e in (*r.outline, *(x for h in r.holes for x in h))):
        assert region_areas(mesh) == pytest.approx(exact, rel=1e-12)


def test_lloyd_moves_sites_towards_centroids():
    rough = voronoi_mesh([Region("a", SQUARE)], lambda x: 0.05 + 0.05 * x[:, 0], relaxation=0, shortest=0.0)
    smooth = voronoi_mesh([Region("a", SQUARE)], lambda x: 0.05 + 0.05 * x[:, 0], relaxation=30, shortest=0.0)
    assert measure(smooth).aspect_c.mean() < measure(rough).aspect_c.mean() - 0.05
    relative = [np.percentile((q.shortest_edge_c / q.diameter_c), 20) for q in (measure(rough), measure(smooth))]
    assert relative[1] > 1.5 * relative[0]


def test_the_size_field_sets_the_size():
    mesh = voronoi_mesh([Region("a", SQUARE)], lambda x: 0.02 + 0.08 * x[:, 0], relaxation=10)
    centers = np.array([centroids(mesh.points_vx[loop][None])[0] for loop in mesh.cells()])
    size = np.sqrt([areas(mesh.points_vx[loop][None])[0] for loop in mesh.cells()])
    ratio = size / (0.02 + 0.08 * centers[:, 0])
    assert np.median(ratio) == pytest.approx(1.0, abs=0.1)
    assert np.percentile(ratio, [5, 95]) == pytest.approx([1.0, 1.0], abs=0.4)


@pytest.mark.parametrize("shortest", [0.0, 0.15, 0.3])
def test_no_edge_is_shorter_than_the_fraction(shortest):
    mesh = voronoi_mesh(PUNCH, 0.1, shortest=shortest, relaxation=2)
    edges = mesh.points_vx[mesh.edges.vertices_ev]
    length = np.hypot(*(edges[:, 1] - edges[:, 0]).T)
    assert length.min() >= 0.9 * shortest * 0.1 or shortest == 0.0
    if shortest == 0.0:
        assert length.min() < 0.01


def test_equal_seeds_give_equal_meshes():
    one, two, other = (voronoi_mesh(PUNCH, 0.15, seed=seed) for seed in (4, 4, 5))
    assert (one.points_vx == two.points_vx).all()
    assert one.n_vertices != other.n_vertices or (one.points_vx != other.points_vx).any()


def test_named_points_become_vertices():
    mesh = voronoi_mesh([Region("a", SQUARE)], 0.13, {"load": (0.37, 1.0), "corner": (0.0, 0.0)})
    assert mesh.points_vx[mesh.named_vertex("load")].tolist() == [0.37, 1.0]
    assert mesh.points_vx[mesh.named_vertex("corner")].tolist() == [0.0, 0.0]


def near_the_middle(x):
    return 1e-4 + 0.3 * np.maximum(np.hypot(x[:, 0] - 0.5, x[:, 1] - 0.5) - 0.04, 0.0)


@pytest.mark.parametrize(
    ("regions", "size", "more", "message"),
    [
        ([], 0.1, {}, r"at least one region"),
        ([Region("a", SQUARE)], 0.0, {}, r"size of cells is 0 at .* positive"),
        ([Region("a", SQUARE)], math.nan, {}, r"size of cells is nan"),
        ([Region("a", SQUARE)], lambda x: x[:, 0] - 0.5, {}, r"must be a positive number"),
        ([Region("a", SQUARE)], 1e-5, {}, r"about 1e\+10 cells, more than 1e\+06"),
        ([Region("a", SQUARE)], near_the_middle, {}, r"of size 0\.0001, .* 20 million"),
        ([Region("a", SQUARE), Region("b", SQUARE)], 0.1, {}, r"regions 0 \('a'\) and 1 \('b'\) overlap"),
        ([Region("a", SQUARE)], 0.1, {"points": {"p": (0.5, 0.5)}}, r"named point 'p' .* on no region's outline"),
        ([Region("a", SQUARE)], 0.1, {"shortest": 0.9}, r"shortest = 0\.9"),
        ([Region("a", SQUARE)], 0.1, {"relaxation": -1}, r"relaxation = -1"),
        ([Region("a", [(0, 0), (1, 0)])], 0.1, {}, r"outline needs at least 3 points"),
        ([Region("a", [(0, 0), (1, 1), (1, 0), (0, 1)])], 0.1, {}, r"region 'a': Self-intersection"),
        ([Region("a", [(0, 0), (2, 0), (2, 0.5)])], 0.1, {}, r"meet at 14\.0 degrees at \(0, 0\)"),
        (
            [Region("a", SQUARE), Region("b", [(0, 1.02), (1, 1.02), (1, 2), (0, 2)])],
            0.2,
            {},
            r"near .* not resolved: .* 0.02 wide",
        ),
    ],
)
def test_bad_input(regions, size, more, message):
    with pytest.raises(InputError, match=message):
        voronoi_mesh(regions, size, **more)


@pytest.mark.parametrize("arguments", [((0, 0), -1.0, 0, 90), ((0, 0), 1.0, 0, 360), ((0, 0), 1.0, 5, 5)])
def test_bad_arcs(arguments):
    with pytest.raises(InputError, match="arc about"):
        Arc(*arguments)


@pytest.mark.parametrize("quadrilaterals", [False, True])
def test_triangles_of_the_same_outlines(quadrilaterals):
    mesh = triangle_mesh(PUNCH, 0.15, {"tip": (0.0, 1.3)}, quadrilaterals=quadrilaterals)
    assert not find_faults(mesh)
    assert mesh.region_names == ("block", "punch", "medium")
    assert region_areas(mesh)["block"] == pytest.approx(2.0)
    assert mesh.points_vx[mesh.named_vertex("tip")] == pytest.approx([0.0, 1.3])
    assert (mesh.n_sides_c == 3).mean() < 0.2 if quadrilaterals else (mesh.n_sides_c == 3).all()
    assert sum(region_areas(mesh).values()) == pytest.approx(4.6)


@pytest.mark.slow
def test_a_hundred_thousand_cells(tmp_path):
    import time

    from tmc_vem.mesh.files.io import write_mesh

    start = time.process_time()
    lower = Region("a", [(0, 0), (1, 0), (1, 0.5), (0, 0.5)])
    mesh = voronoi_mesh([lower, Region("b", [(0, 0.5), (1, 0.5), (1, 1), (0, 1)])], 1 / 318)
    assert mesh.n_cells > 99_000
    assert time.process_time() - start < 60.0
    start = time.process_time()
    assert not find_faults(mesh)
    assert time.process_time() - start < 10.0
    start = time.process_time()
    write_mesh(mesh, tmp_path / "large.vtu")
    assert time.process_time() - start < 10.0
