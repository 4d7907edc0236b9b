"""What cells of finite elements change by with parameters, and forces and tangents of cells: Taylor rates of all."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers_fem import grid, make_system, random_vector, rates, wavy
from helpers_process import process

from codegen.stress import stress_of
from tmc_vem.mesh import PolygonMesh
from tmc_vem.problems import Material, Medium
from tmc_vem.problems.base import medium_region, solid_region
from tmc_vem.support.errors import InputError
from tmc_vem.system.friction_settings import Friction

MEDIUM = Medium(gamma=0.3, alpha_r=0.7, beta=2.0, regulariser="huhu_lulu")
REGIONS = {
    "solid": solid_region(Material(K=3.0, mu=1.5)),
    "medium": medium_region(MEDIUM, 1.5, graded={"gamma": "gamma * 10 ** (x - y)", "alpha_r": "alpha_r * (1 + soft)"}),
}
ELEMENTS = [{}, {"triangles": True}, {"order": 3}]
STEPS = [2.0**-n for n in range(4, 8)]


def layers() -> PolygonMesh:
    """A band of medium in a solid; cells are no parallelograms."""
    mesh = grid(4, 3, distort=0.15)
    region = (np.arange(12) // 4 == 1).astype(np.int64)
    soft = np.random.default_rng(2).uniform(0.0, 1.0, 12)
    return replace(mesh, region_c=region, region_names=("solid", "medium"), cell_data={"soft": soft})


def state(**settings):
    system = make_system(layers(), REGIONS, **settings)
    return system, system.interpolate(wavy), random_vector(system, 5, 0.3)


def work(system, u, adjoint) -> float:
    out = system.create_vector()
    system.residual(u, out)
    return float(out.dot(adjoint))


def order_of(remainders, scale) -> float:
    """Observed order, infinite where nothing is left."""
    if max(remainders) < 1e-12 * scale:
        return np.inf
    return float(rates(STEPS, remainders)[-1])


@pytest.mark.parametrize("settings", ELEMENTS)
def test_derivatives_by_values_of_regions(settings) -> None:
    """Along a direction in all parameters of a region: a factor of a cell multiplies the change there."""
    system, u, adjoint = state(**settings)
    found = list(system.parameter_derivatives(u, adjoint))
    assert [of.region for of in found] == ["solid", "medium"]
    assert np.sort(np.concatenate([of.cells for of in found])).tolist() == list(range(system.mesh.n_owned))
    for of in found:
        values = REGIONS[of.region].values
        assert of.names == REGIONS[of.region].integrand.parameter_names
        change = dict(zip(of.names, np.random.default_rng(1).uniform(0.3, 1.0, len(of.names)), strict=True))
        factors = {name: system._factors[of.region].get(name, np.ones((len(of.cells), 1)))[:, 0] for name in of.names}
        by_value = np.stack([factors[name] * change[name] * values[name] for name in of.names], axis=1)
        slopes = (of.energy_ck * by_value).sum(), (of.residual_ck * by_value).sum()
        before = system.cell_energies(u)[of.cells].sum(), work(system, u, adjoint)
        remainders = []
        for step in STEPS:
            system.set_parameters(
                {f"{of.region}.{name}": values[name] * (1 + step * change[name]) for name in of.names}
            )
            after = system.cell_energies(u)[of.cells].sum(), work(system, u, adjoint)
            remainders.append([abs(a - b - step * s) for a, b, s in zip(after, before, slopes, strict=True)])
        system.set_parameters({f"{of.region}.{name}": value for name, value in values.items()})
        for kind, scale in enumerate(np.abs(before)):
            order = order_of([remainder[kind] for remainder in remainders], scale)
            assert order == np.inf if of.region == "solid" else order == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("settings", ELEMENTS)
def test_derivatives_by_factors_of_one_cell(settings) -> None:
    system, u, adjoint = state(**settings)
    (of,) = (found for found in system.parameter_derivatives(u, adjoint) if found.region == "medium")
    row = 1
    cell, varying = of.cells[row], ("gamma", "alpha_r")
    factor_ck = np.ones((system.mesh.n_owned, 2))
    factor_ck[of.cells] = np.concatenate([system._factors["medium"][name] for name in varying], axis=1)
    change = np.array([0.4, 0.9])
    level = np.array([REGIONS["medium"].values[name] for name in varying])
    columns = [of.names.index(name) for name in varying]
    energy, residual = (values_ck[row, columns] @ (level * change) for values_ck in (of.energy_ck, of.residual_ck))
    before, work_before = system.cell_energies(u), work(system, u, adjoint)
    energies, works = [], []
    for step in STEPS:
        changed = factor_ck.copy()
        changed[cell] += step * change
        system.set_factors("medium", changed)
        after = system.cell_energies(u)
        assert np.delete(after, cell).tolist() == np.delete(before, cell).tolist()
        energies.append(abs(after[cell] - before[cell] - step * energy))
        works.append(abs(work(system, u, adjoint) - work_before - step * residual))
    assert rates(STEPS, energies)[-1] == pytest.approx(2.0, abs=0.1)
    assert rates(STEPS, works)[-1] == pytest.approx(2.0, abs=0.1)
    system.set_factors("medium", factor_ck)
    assert work(system, u, adjoint) == work_before
    assert system.cell_energies(u).tolist() == before.tolist()


def test_without_an_adjoint_field_energies_alone_are_differentiated() -> None:
    system, u, adjoint = state()
    for alone, both in zip(system.parameter_derivatives(u), system.parameter_derivatives(u, adjoint), strict=True):
        assert alone.energy_ck.tolist() == both.energy_ck.tolist()
        assert not alone.residual_ck.any()


@pytest.mark.skipif(np.finfo(np.longdouble).eps > 1e-18, reason="no extended precision on this machine")
def test_energies_of_small_strains_have_derivatives_with_all_digits() -> None:
    """The energy is linear in the moduli, so that it is a sum of products."""
    system = make_system(grid(2, 2), REGIONS["solid"])
    u = system.interpolate(lambda x: 1e-4 * wavy(x))
    (of,) = system.parameter_derivatives(u)
    values = np.array([REGIONS["solid"].values[name] for name in of.names])
    np.testing.assert_allclose(of.energy_ck @ values, system.cell_energies(u)[of.cells], rtol=1e-8)


@pytest.mark.parametrize("settings", ELEMENTS)
def test_stresses_at_points_are_the_residual(settings) -> None:
    system, u, _ = state(**settings)
    stress = {name: stress_of(region.integrand) for name, region in REGIONS.items()}

    def of_first_gradient(states):
        return stress[states.region].at(states.F_cqij, states.G_cqijk, states.parameters)[0], None

    expected, out = system.create_vector(), system.create_vector()
    solid = np.array(system.region_names)[system.mesh.region_c[: system.mesh.n_owned]] == "solid"
    expected.getArray()[:] = system.internal_forces(u, solid).ravel()
    out.set(1.0)
    system.add_point_forces(u, lambda states: of_first_gradient(states) if states.region == "solid" else None, out)
    np.testing.assert_allclose(out.getArray() - 1.0, expected.getArray(), rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize("settings", ELEMENTS)
def test_forces_at_points_are_the_work_of_gradients(settings) -> None:
    """For any P and T, also such that no energy has."""
    system, u, v = state(**settings)
    v_nodes, expected, out = system.nodal_values(v), 0.0, system.create_vector()
    rng = np.random.default_rng(6)
    given = [(rng.normal(size=s.F_cqij.shape), rng.normal(size=(*s.F_cqij.shape, 2))) for s in system.point_states(u)]
    for states, (P, T) in zip(system.point_states(u), given, strict=True):
        first, second = system.points.gradients(v_nodes[system.nodes.cell_nodes_ca[states.cells]], states.cells)
        expected += (states.w_cq * ((P * first).sum(axis=(2, 3)) + (T * second).sum(axis=(2, 3, 4)))).sum()
    forces = iter(given)
    system.add_point_forces(u, lambda _: next(forces), out)
    assert out.dot(v) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("settings", ELEMENTS)
def test_tangent_of_some_cells(settings) -> None:
    system, u, du = state(**settings)
    chosen = np.arange(system.mesh.n_owned) % 3 != 1
    action, steps = system.create_vector(), [0.1 * step for step in STEPS]
    system.cell_tangent_action(u, du, chosen, action)
    before, remainders = system.internal_forces(u, chosen), []
    trial = u.duplicate()
    for step in steps:
        trial.waxpy(step, du, u)
        change = system.internal_forces(trial, chosen) - before
        remainders.append(np.linalg.norm(change.ravel() - step * action.getArray()))
    assert rates(steps, remainders)[-1] == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("settings", ELEMENTS)
def test_tangent_of_all_cells_is_the_tangent(settings) -> None:
    """With friction too, where points stick and where they slip."""
    rough = {"solid": REGIONS["solid"], "medium": replace(REGIONS["medium"], friction=Friction(0.4, 0.3))}
    system = make_system(layers(), rough, **settings)
    squeezed = system.interpolate(lambda x: np.column_stack([0.05 * x[:, 1] ** 2, -0.6 * x[:, 1]]))
    system.advance(squeezed)
    u = system.interpolate(lambda x: np.column_stack([0.05 * x[:, 1] ** 2 + 0.3 * x[:, 0] * x[:, 1], -0.6 * x[:, 1]]))
    sticks = np.concatenate([s.response.sticks.ravel() for s in system.friction_states(u)])
    bound = np.concatenate([s.slip.bound.ravel() for s in system.friction_states(u)])
    assert 0 < sticks[bound > 0.0].sum() < (bound > 0.0).sum()
    system.damp_slip(0.0)
    system.jacobian(u, system.create_matrix())
    du, expected, out = random_vector(system, 5, 0.3), system.create_vector(), system.create_vector()
    system.tangent_action(du, expected)
    system.cell_tangent_action(u, du, np.ones(system.mesh.n_owned, dtype=bool), out)
    out.axpy(-1.0, expected)
    assert out.norm() < 1e-11 * expected.norm()


def test_what_cannot_be_done_is_refused() -> None:
    system, u, _ = state(interior_penalty="penalty")
    with pytest.raises(InputError, match=r"interior penalty 'penalty': .*; use 'none'"):
        system.parameter_derivatives(u)
    with pytest.raises(InputError, match="no region 'water'"):
        system.set_factors("water", np.ones((12, 0)))
    with pytest.raises(ValueError, match=r"region 'medium': shape \(12, 1\), expected \(12, 2\)"):
        system.set_factors("medium", np.ones((12, 1)))


PROGRAM = """
import json, sys
import numpy as np
from mpi4py import MPI
from helpers_fem import wavy
from test_fem_sensitivity import layers, REGIONS
from tmc_vem.fem.system import FemSystem
from tmc_vem.system.fem_settings import FemSettings

comm = MPI.COMM_WORLD
system = FemSystem(comm, layers, REGIONS, (), FemSettings(triangles=sys.argv[1] == "1"))
u, adjoint = system.interpolate(wavy), system.interpolate(lambda x: np.sin(3.0 * x) + x[:, ::-1] ** 2)
label_c = system.cell_numbers()
system.set_factors("medium", 1.0 + np.outer(label_c % 5, [0.1, 0.3]))
sums = {}
for of in system.parameter_derivatives(u, adjoint):
    weights = 1.0 + label_c[of.cells]
    sums.setdefault(of.region, np.zeros(2 * len(of.names)))
    sums[of.region] += np.concatenate([weights @ of.energy_ck, weights @ of.residual_ck])
values = [value for name in ("solid", "medium")
          for value in comm.allreduce(sums.get(name, np.zeros(2 * len(REGIONS[name].values)))).tolist()]
out = system.create_vector()
system.residual(u, out)
values += [out.norm(), out.dot(adjoint)]
system.add_point_forces(u, lambda s: (s.F_cqij ** 2, s.G_cqijk), out)
values += [out.norm(), out.dot(adjoint)]
out.set(0.0)
system.cell_tangent_action(u, adjoint, label_c % 3 == 1, out)
values += [out.norm(), out.dot(u)]
settings = FemSettings(triangles=sys.argv[1] == "1", interior_penalty="penalty")
beside = FemSystem(comm, layers, REGIONS, (), settings)
beside.set_factors("medium", 1.0 + np.outer(label_c % 5, [0.1, 0.3]))
values += [beside.residual(u, out).energy, out.norm()]  # sides between ranks have the factors of both cells
if comm.rank == 0:
    print(json.dumps(values), flush=True)
"""


@pytest.mark.parametrize("triangles", ["0", "1"])
def test_ranks_agree(triangles: str) -> None:
    one, two = (
        process(["-c", PROGRAM, triangles], ranks=ranks, cwd=Path(__file__).parent, environment={"PYTHONPATH": path()})
        for ranks in (1, 2)
    )
    assert one.returncode == 0, one.stderr
    assert two.returncode == 0, two.stderr
    assert json.loads(two.stdout) == pytest.approx(json.loads(one.stdout), rel=1e-12)


def path() -> str:
    here = Path(__file__).parent
    return ":".join(map(str, (here, here.parent, here.parents[1])))
