"""Filters of densities: means, adjoints, bounds, the volume, and the order of the Helmholtz filter on all cells."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_mesh import grid, hanging, mesh_of, non_convex, voronoi

from tmc_vem.design.filters import Within, cone_filter, density_filter, helmholtz_filter
from tmc_vem.design.masks import in_box, in_circle, in_regions
from tmc_vem.design.triangulation import triangulate
from tmc_vem.mesh.cells import centroids_and_areas
from tmc_vem.support.errors import InputError

MESHES = {
    "squares": lambda n: grid(n, n),
    "stretched": lambda n: grid(n, 4 * n),
    "Voronoi": lambda n: voronoi(n * n),
    "hanging nodes": lambda n: hanging(n, 0.05),
}


def density(n_cells, seed=3):
    """Cells that are full or empty: the hardest for bounds."""
    return np.random.default_rng(seed).integers(0, 2, n_cells).astype(float)


@pytest.mark.parametrize("kind", MESHES)
@pytest.mark.parametrize("name", ["cone", "helmholtz", "none"])
@pytest.mark.parametrize("radius", [0.01, 0.2, 3.0])
def test_properties(name, kind, radius):
    mesh = MESHES[kind](6)
    cells = np.flatnonzero(~in_box(mesh, 0.3, 0.3, 0.6, 0.7))
    made = density_filter(name, mesh, cells, radius)
    rng = np.random.default_rng(1)
    x, y = rng.standard_normal((2, len(cells)))
    assert made.forward(x) @ y == pytest.approx(x @ made.backward(y), rel=1e-12)
    assert made.forward(np.full(len(cells), 0.7)) == pytest.approx(np.full(len(cells), 0.7), abs=1e-13)
    filtered = made.forward(density(len(cells)))
    assert filtered.min() >= -1e-13
    assert filtered.max() <= 1.0 + 1e-13


@pytest.mark.parametrize("kind", MESHES)
def test_helmholtz_keeps_the_volume(kind):
    mesh = MESHES[kind](6)
    cells = np.flatnonzero(~in_box(mesh, 0.3, 0.3, 0.6, 0.7))
    area = centroids_and_areas(mesh)[1][cells]
    made, x = helmholtz_filter(mesh, cells, 0.5), density(len(cells))
    assert np.ptp(made.forward(x)) < 0.95  # it does filter
    assert area @ made.forward(x) == pytest.approx(area @ x, rel=1e-13)


@pytest.mark.parametrize("kind", MESHES)
def test_helmholtz_is_of_second_order(kind):
    """y = cos(pi x) cos(2 pi y) has no flux through the unit square; in the mean over cells."""
    radius, errors, sizes = 0.5, [], []
    for n in (6, 12, 24):
        mesh = MESHES[kind](n)
        center, area = centroids_and_areas(mesh)
        y = np.cos(np.pi * center[:, 0]) * np.cos(2.0 * np.pi * center[:, 1])
        x = (1.0 + radius**2 / 12.0 * 5.0 * np.pi**2) * y
        errors.append(np.sqrt(area @ (helmholtz_filter(mesh, np.arange(mesh.n_cells), radius).forward(x) - y) ** 2))
        sizes.append(np.sqrt(1.0 / mesh.n_cells))
    rate = np.log(errors[1] / errors[2]) / np.log(sizes[1] / sizes[2])
    assert 1.7 < rate < 2.3
    assert errors[2] < 0.01


@pytest.mark.parametrize("kind", MESHES)
def test_triangles_fill_the_design_and_have_no_negative_weight(kind):
    mesh = MESHES[kind](5)
    cells = np.flatnonzero(~in_circle(mesh, 0.5, 0.5, 0.25))
    made = triangulate(mesh, cells)
    a, b, c = np.moveaxis(made.points_px[made.triangles_tp], 1, 0)
    area = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    assert area.min() > 0.0
    assert area.sum() == pytest.approx(centroids_and_areas(mesh)[1][cells].sum())
    ends, weight = made.weights()
    # exact for linear functions, which a weight that had been cut off at 0 would spoil: energy = area of the design
    for column in (0, 1):
        difference = np.diff(made.points_px[ends][:, :, column], axis=1).ravel()
        assert weight @ difference**2 == pytest.approx(area.sum(), rel=1e-12)


def test_cells_that_are_not_star_shaped():
    mesh = non_convex()
    made = helmholtz_filter(mesh, np.arange(4), 2.0)
    area = centroids_and_areas(mesh)[1]
    x = np.array([1.0, 0.0, 0.0, 1.0])
    assert area @ made.forward(x) == pytest.approx(area @ x)
    assert made.forward(np.ones(4)) == pytest.approx(np.ones(4))
    u = mesh_of(np.array([(0, 0), (3, 0), (3, 2), (2, 2), (2, 1), (1, 1), (1, 2), (0, 2)], dtype=float))
    assert helmholtz_filter(u, np.array([0]), 1.0).forward(np.array([0.3])) == pytest.approx([0.3])


def test_cone_by_hand():
    """Three cells in a row with areas 1, 1 and 2, centroids at 0.5, 1.5 and 3."""
    from tmc_vem.mesh import Rectangle, structured_quadrilaterals

    mesh = structured_quadrilaterals([0, 1, 2, 4], [0, 1], [Rectangle("a", 0, 4, 0, 1)])
    made = cone_filter(mesh, np.arange(3), 2.0)
    expected = np.array([[2.0, 1.0, 0.0], [1.0, 2.0, 0.5 * 2.0], [0.0, 0.5, 2.0 * 2.0]])
    assert made.matrix_cc.toarray() == pytest.approx(expected / expected.sum(axis=1)[:, None])


def test_nothing_passes_through_what_is_no_design():
    """Two halves with a column of other cells between: the Helmholtz filter keeps them apart, the cone does not."""
    mesh = grid(9, 3)
    cells = np.flatnonzero(~in_box(mesh, 4 / 9, 0.0, 5 / 9, 1.0))
    left = (centroids_and_areas(mesh)[0][cells, 0] < 0.5).astype(float)
    assert helmholtz_filter(mesh, cells, 1.0).forward(left) == pytest.approx(left, abs=1e-14)
    assert np.ptp(cone_filter(mesh, cells, 1.0).forward(left) - left) > 0.1


def test_how_far_they_smooth():
    """Second moment of what becomes of a single cell: 2 l^2 = r^2 / 6 of Helmholtz, 3 r^2 / 20 of the cone."""
    mesh = grid(61, 61)
    center, area = centroids_and_areas(mesh)
    x = in_circle(mesh, 0.5, 0.5, 1e-6) / area[0]
    for name, expected in (("cone", 0.15), ("helmholtz", 1.0 / 6.0)):
        y = density_filter(name, mesh, np.arange(mesh.n_cells), 0.2).forward(x)
        moment = area @ (y * (center[:, 0] - 0.5) ** 2)
        assert moment == pytest.approx(expected * 0.04, rel=0.02)


def test_masks():
    mesh = grid(4, 2)
    assert in_box(mesh, 0.0, 0.0, 0.5, 0.5).tolist() == [True, True, False, False] + [False] * 4
    assert in_circle(mesh, 0.125, 0.25, 0.3).tolist() == [True, True, False, False] + [False] * 4
    assert in_regions(mesh, ["domain"]).all()
    with pytest.raises(InputError, match="has no 'dmain'"):
        in_regions(mesh, ["dmain"])
    with pytest.raises(InputError, match="is empty"):
        in_box(mesh, 1.0, 0.0, 0.5, 1.0)
    with pytest.raises(InputError, match="radius of the circle"):
        in_circle(mesh, 0.0, 0.0, 0.0)


def test_what_is_refused():
    mesh = grid(3, 3)
    for name in ("cone", "Helmholtz"):
        with pytest.raises(InputError, match=rf"radius of the {name} filter = -1"):
            density_filter(name.lower(), mesh, np.arange(9), -1.0)
    with pytest.raises(InputError, match="unknown filter 'conic'"):
        density_filter("conic", mesh, np.arange(9), 1.0)


def test_a_cone_that_does_not_fit(monkeypatch):
    monkeypatch.setattr("tmc_vem.design.filters.MOST_NEIGHBOURS", 80)
    with pytest.raises(InputError, match=r"radius 9 .* covers 9 cells around each of 9"):
        cone_filter(grid(3, 3), np.arange(9), 9.0)


def test_void_is_no_part_of_a_filter() -> None:
    """Cells that stay void keep 0, and a solid beside them keeps 1."""
    mesh = grid(6, 4)
    void_c = np.arange(mesh.n_cells) % 6 == 2
    of = Within(density_filter("cone", mesh, np.flatnonzero(~void_c), 0.4), ~void_c)
    x_c = np.where(void_c, 0.0, 1.0)
    assert np.abs(of.forward(x_c) - x_c).max() < 1e-14
    rng = np.random.default_rng(0)
    a_c, b_c = rng.normal(size=(2, mesh.n_cells))
    assert of.forward(a_c) @ b_c == pytest.approx(a_c @ of.backward(b_c), rel=1e-13)
