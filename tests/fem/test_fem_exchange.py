"""What scripts in dolfinx take from here: polygon meshes and energies."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from helpers_process import process
from mpi4py import MPI

from tmc_vem.energy import get_regulariser, hyperelastic_solid, third_medium
from tmc_vem.fem import compat, energy_density, form, interior_penalty, measures, polygon_mesh, vector_space
from tmc_vem.fem.system import FemSystem
from tmc_vem.mesh.geometry import areas
from tmc_vem.problems.base import RegionEnergy
from tmc_vem.simulation.sample import function_at
from tmc_vem.support.errors import InputError
from tmc_vem.system.fem_settings import FemSettings

SOLID = {"K": 20.0, "mu": 10.0}
MEDIUM = {"mu": 10.0, "gamma": 1e-2, "alpha_r": 1.0, "beta": 5.0}


def rectangle(cell: str, n: int = 4) -> Any:
    compat.require()
    from dolfinx import mesh

    corners = [np.array([0.0, 0.0]), np.array([2.0, 1.0])]
    return mesh.create_rectangle(MPI.COMM_SELF, corners, [2 * n, n], getattr(mesh.CellType, cell))


def tagged(domain: Any) -> tuple[Any, np.ndarray]:
    """Tags 3 and 7 of the cells: left and right."""
    from dolfinx import mesh

    cells = np.arange(domain.topology.index_map(2).size_local, dtype=np.int32)
    values = np.where(mesh.compute_midpoints(domain, 2, cells)[:, 0] < 1.0, 3, 7).astype(np.int32)
    return mesh.meshtags(domain, 2, cells, values), values


@pytest.mark.parametrize("cell", [compat.TRIANGLE, compat.QUADRILATERAL])
@pytest.mark.parametrize("dual", [False, True])
def test_regions_names_and_areas_are_those_of_the_tags(cell: str, dual: bool) -> None:
    from dolfinx import mesh

    domain = rectangle(cell)
    tags, _ = tagged(domain)
    bottom = mesh.locate_entities_boundary(domain, 1, lambda x: np.isclose(x[1], 0.0))
    facets = mesh.meshtags(domain, 1, np.sort(bottom), np.full(len(bottom), 5, dtype=np.int32))
    polygons = polygon_mesh(
        domain, tags, facets, regions={7: "right"}, edges={5: "bottom"}, points={"corner": (2.0, 1.0)}, dual=dual
    )
    assert polygons.region_names == ("region_3", "right")
    total = np.zeros(2)
    for _, cells, vertices in polygons.cells_by_size():
        np.add.at(total, polygons.region_c[cells], areas(polygons.points_vx[vertices]))
    assert total == pytest.approx([1.0, 1.0])
    pairs = polygons.named_edges["bottom"]
    assert len(pairs) == (2 if dual else 1) * 8
    assert abs(polygons.points_vx[pairs][..., 1]).max() == 0.0
    assert polygons.points_vx[polygons.named_points["corner"]] == pytest.approx([2.0, 1.0])


def test_tags_of_one_name_are_one_region() -> None:
    domain = rectangle(compat.TRIANGLE)
    polygons = polygon_mesh(domain, tagged(domain)[0], regions={3: "all", 7: "all"})
    assert polygons.region_names == ("all",)
    assert polygon_mesh(domain).region_names == ("domain",)


UNTAGGED = """
from mpi4py import MPI
import numpy as np
from dolfinx import mesh
from tmc_vem.fem import polygon_mesh
from tmc_vem.support.errors import InputError

comm = MPI.COMM_WORLD
domain = mesh.create_unit_square(comm, 4, 4)
n = domain.topology.index_map(2).size_local
tagged = np.arange(n if comm.rank == 0 else n - 1, dtype=np.int32)
try:
    polygon_mesh(domain, mesh.meshtags(domain, 2, tagged, np.zeros(len(tagged), dtype=np.int32)))
except InputError as error:
    said = comm.gather(f"{comm.rank} {error}")  # what ranks print at once may mix
    print(*(said or []), sep="\\n", end="", flush=True)
"""


def test_what_one_rank_refuses_is_refused_on_all() -> None:
    done = process(["-c", UNTAGGED], ranks=2)
    assert done.returncode == 0, done.stderr
    said = [line for line in done.stdout.splitlines() if not line.startswith("[")]  # what mpirun says
    assert [line[0] for line in said] == ["0", "1"]
    assert all("has no tag: cell_tags need a value for every cell" in line for line in said)


def test_what_has_no_polygon_mesh_is_refused() -> None:
    from dolfinx import mesh

    domain = rectangle(compat.TRIANGLE)
    some = mesh.meshtags(domain, 2, np.arange(3, dtype=np.int32), np.zeros(3, dtype=np.int32))
    with pytest.raises(InputError, match="cell 3 has no tag"):
        polygon_mesh(domain, some)
    with pytest.raises(InputError, match="no node at"):
        polygon_mesh(domain, points={"nowhere": (5.0, 5.0)})
    cube = mesh.create_unit_cube(MPI.COMM_SELF, 1, 1, 1)
    with pytest.raises(InputError, match="dimension 3"):
        polygon_mesh(cube)
    domain.geometry.x[0, 2] = 1.0
    with pytest.raises(InputError, match="different z"):
        polygon_mesh(domain)


@pytest.mark.parametrize("cell", [compat.TRIANGLE, compat.QUADRILATERAL])
@pytest.mark.parametrize("penalty", ["none", "penalty", "full"])
def test_the_potential_of_a_script_is_that_of_our_own_system(cell: str, penalty: str) -> None:
    domain = rectangle(cell, 3)
    tags, values = tagged(domain)
    from dolfinx import fem

    u = fem.Function(vector_space(domain, 2))
    u.interpolate(lambda x: np.stack([0.05 * np.sin(2 * x[0]) * x[1], 0.1 * np.sin(3 * x[0] + x[1] ** 2)]))
    medium = third_medium(get_regulariser("huhu_lulu"), damped=True)
    dx, dS = measures(domain, values == 7)
    energy = energy_density(u, hyperelastic_solid(), SOLID) * dx(0) + energy_density(u, medium, MEDIUM) * dx(1)
    if penalty != "none":
        energy = energy + interior_penalty(u, medium, MEDIUM, consistent=penalty == "full") * dS(1)

    polygons = polygon_mesh(domain, tags, regions={3: "solid", 7: "medium"})
    regions = {
        "solid": RegionEnergy(hyperelastic_solid(), SOLID),
        "medium": RegionEnergy(medium, MEDIUM, is_medium=True),
    }
    system = FemSystem(MPI.COMM_SELF, lambda: polygons, regions, settings=FemSettings(interior_penalty=penalty))
    state = system.create_vector()
    state.getArray()[:] = function_at(u, system.nodes.points_nx).ravel()
    assert fem.assemble_scalar(form(energy)) == pytest.approx(system.energy(state).energy, rel=1e-11)


def test_parameters_are_checked() -> None:
    from dolfinx import fem

    u = fem.Function(vector_space(rectangle(compat.TRIANGLE, 1), 2))
    with pytest.raises(InputError, match="'solid' has a parameter 'mu' without a value"):
        energy_density(u, hyperelastic_solid(), {"K": 1.0})
    with pytest.raises(InputError, match=r"no parameter 'nu' \(it has: K, mu\)"):
        energy_density(u, hyperelastic_solid(), {**SOLID, "nu": 0.3})
    with pytest.raises(InputError, match="weighted by gamma and alpha_r"):
        interior_penalty(u, hyperelastic_solid(), SOLID)
