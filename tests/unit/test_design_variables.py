"""From variables to densities: passive cells, symmetry, the chain rule and the volume."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from helpers_mesh import grid, voronoi

from tmc_vem.design.filters import cone_filter, helmholtz_filter
from tmc_vem.design.interpolation import Ramp, Simp
from tmc_vem.design.masks import in_box, in_circle
from tmc_vem.design.projection import Projection
from tmc_vem.design.symmetry import Mirror, orbits
from tmc_vem.design.variables import parametrise
from tmc_vem.mesh.cells import centroids_and_areas
from tmc_vem.mesh.make.weld import weld
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError


def mirrored(mesh, axis):
    """Mesh and its mirror image, on both sides of the unit square's side at 1."""
    points = mesh.points_vx.copy()
    points[:, axis] = 2.0 - points[:, axis]
    image = PolygonMesh.from_cells(points, [loop[::-1].tolist() for loop in mesh.cells()])
    return weld([PolygonMesh.from_cells(mesh.points_vx, [loop.tolist() for loop in mesh.cells()]), image])


def design(mesh, **more):
    made = {"solid_c": in_box(mesh, 0.0, 0.4, 0.2, 0.6), "void_c": in_circle(mesh, 0.75, 0.5, 0.15)} | more
    design_c = ~in_box(mesh, 0.45, 0.45, 0.55, 0.55)
    return parametrise(mesh, design_c, filter_of=cone_filter(mesh, np.flatnonzero(design_c), 0.25), **made)


@pytest.mark.parametrize("filter_of", [cone_filter, helmholtz_filter])
@pytest.mark.parametrize("projection", [None, Projection(4.0, 0.45)])
@pytest.mark.parametrize("mirrors", [(), (Mirror("y", 0.5),)])
def test_the_chain_rule(filter_of, projection, mirrors):
    """Of a functional of factors and of densities, and of the volume: the rate is 2."""
    mesh = grid(10, 10)
    every = np.ones(mesh.n_cells, dtype=bool)
    made = parametrise(
        mesh, every, solid_c=in_box(mesh, 0.0, 0.4, 0.2, 0.6), void_c=in_circle(mesh, 0.75, 0.5, 0.15), mirrors=mirrors,
        filter_of=filter_of(mesh, np.arange(mesh.n_cells), 0.25), projection=projection, interpolation=Ramp(6.0),
    )  # fmt: skip
    assert made.n_variables == (50 - 2 - 4 if mirrors else 100 - 4 - 8)
    rng = np.random.default_rng(2)
    z, direction = rng.uniform(0.2, 0.8, made.n_variables), rng.standard_normal(made.n_variables)
    load = rng.standard_normal(100)

    def value(z):
        return float(load @ made.factors(z) ** 2 + load[::-1] @ made.physical(z) ** 3)

    factors, physical = made.factors(z), made.physical(z)
    gradient = made.backward(z, by_factor_c=2.0 * load * factors, by_physical_c=3.0 * load[::-1] * physical**2)
    for function, slope in ((value, gradient @ direction), (made.volume, made.volume_gradient(z) @ direction)):
        errors = [abs(function(z + h * direction) - function(z) - h * slope) for h in (1e-2, 1e-3)]
        linear = function == made.volume and projection is None
        if linear:
            assert errors[0] < 1e-14
        else:
            assert np.log10(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.2)


def test_passive_cells_stay_what_they_are():
    mesh = voronoi(150)
    made = design(mesh, projection=Projection(2.0))
    solid, void = made.passive_c == 1.0, made.passive_c == 0.0
    assert solid.sum() > 3
    assert void.sum() > 3
    assert made.n_variables == len(made.cells) - solid.sum() - void.sum()
    for values in (made.densities, made.physical, made.factors):
        for z in (np.zeros(made.n_variables), np.full(made.n_variables, 0.6), np.ones(made.n_variables)):
            assert (values(z)[solid] == 1.0).all()
            assert (values(z)[void] == 0.0).all()
            assert 0.0 <= values(z).min() <= values(z).max() <= 1.0
    # beside a solid part the filter sees it
    beside = np.flatnonzero(~solid & ~void & in_box(mesh, 0.0, 0.35, 0.25, 0.65)[made.cells])
    assert (made.physical(np.zeros(made.n_variables))[beside] > 0.0).any()


def test_symmetric_designs():
    """On a Voronoi mesh and its image; cells of squares on the line are their own image."""
    mesh = mirrored(voronoi(40), 0)
    every = np.ones(mesh.n_cells, dtype=bool)
    made = parametrise(
        mesh, every, mirrors=[Mirror("x", 1.0)], filter_of=helmholtz_filter(mesh, np.arange(mesh.n_cells), 0.4)
    )
    assert made.n_variables * 2 == mesh.n_cells
    x = made.physical(np.random.default_rng(0).uniform(size=made.n_variables))
    half = mesh.n_cells // 2
    assert x[:half] == pytest.approx(x[half:], abs=1e-12)
    squares = grid(5, 3)
    both = parametrise(squares, np.ones(15, dtype=bool), mirrors=[Mirror("x", 0.5), Mirror("y", 0.5)])
    assert both.n_variables == 6
    assert both.variable_c.reshape(3, 5).tolist() == [[0, 1, 2, 1, 0], [3, 4, 5, 4, 3], [0, 1, 2, 1, 0]]


def test_what_is_not_symmetric():
    mesh = voronoi(40)
    with pytest.raises(InputError, match=r"not symmetric about x = 0.5: \d+ of 40 cells .* use a symmetric mesh"):
        parametrise(mesh, np.ones(40, dtype=bool), mirrors=[Mirror("x", 0.5)])
    squares = grid(4, 1)
    every = np.ones(4, dtype=bool)
    for at in (0.4, 0.501):
        with pytest.raises(InputError, match=rf"not symmetric about x = {at}"):
            parametrise(squares, every, mirrors=[Mirror("x", at)])
    with pytest.raises(InputError, match=r"the cell at \(0.875, 0.5\) is free, but its mirror image is solid"):
        parametrise(squares, every, solid_c=np.arange(4) == 0, mirrors=[Mirror("x", 0.5)])
    with pytest.raises(InputError, match="unknown axis of symmetry 'z'"):
        Mirror("z", 0.0)
    center, area = centroids_and_areas(squares)
    with pytest.raises(InputError, match=r"of area 0\.5"):
        orbits(center, area * [1, 1, 1, 2], [Mirror("x", 0.5)])


def test_the_volume():
    mesh = grid(10, 10)
    made = parametrise(mesh, np.ones(100, dtype=bool), solid_c=in_box(mesh, 0.0, 0.0, 0.2, 0.5))
    assert made.volume(np.zeros(90)) == pytest.approx(0.1)
    assert made.volume(np.full(90, 0.5)) == pytest.approx(0.1 + 0.45)
    assert made.volume_gradient(np.full(90, 0.5)) == pytest.approx(np.full(90, 0.01))
    for projection in (None, Projection(8.0, 0.3)):
        projected = made.with_projection(projection)
        assert projected.volume(projected.uniform(0.4)) == pytest.approx(0.4, rel=1e-12)
    with pytest.raises(InputError, match=r"volume 0.05: .* 0.1 to 1 of its area"):
        made.uniform(0.05)


def test_volumes_grow_with_every_variable():
    made = design(voronoi(60), projection=Projection(3.0))
    volumes = [made.volume(np.full(made.n_variables, v)) for v in np.linspace(0.0, 1.0, 9)]
    assert all(a < b for a, b in pairwise(volumes))
    assert (made.volume_gradient(np.full(made.n_variables, 0.4)) > 0.0).all()


def test_what_is_refused():
    mesh = grid(2, 2)
    every, none = np.ones(4, dtype=bool), np.zeros(4, dtype=bool)
    with pytest.raises(InputError, match=r"bool of shape \(3,\): give one bool for each of the 4 cells"):
        parametrise(mesh, every[:3])
    with pytest.raises(InputError, match="solid cells is an array of int64"):
        parametrise(mesh, every, solid_c=np.arange(4))
    with pytest.raises(InputError, match=r"cell at \(0.25, 0.25\) is to be solid and void \(4 such cells\)"):
        parametrise(mesh, every, solid_c=every, void_c=every)
    for design_c, solid_c in ((none, None), (every, every)):
        with pytest.raises(InputError, match="cells of the design may change"):
            parametrise(mesh, design_c, solid_c=solid_c)
    made = parametrise(mesh, every, interpolation=Simp(1.0))
    for z, message in (([0.5] * 3, "this design has 4"), ([0.5, 0.5, 1.1, 0.5], "variable 2 is 1.1"),
                       ([np.nan] * 4, "variable 0 is nan")):  # fmt: skip
        with pytest.raises(InputError, match=message):
            made.densities(np.array(z))
    assert made.factors(np.array([-1e-12, 1.0 + 1e-12, 0.0, 0.5])).tolist() == [0.0, 1.0, 0.0, 0.5]
