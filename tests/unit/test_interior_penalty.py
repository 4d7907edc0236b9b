"""The interior penalty of virtual elements: patch tests, a linear problem, Taylor tests, step limits, parameters."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from helpers_mesh import grid, hanging, voronoi
from helpers_penalty import LINEAR, amplitude, bricks, medium, named, penalised, triangles
from helpers_system import dense, interpolate, make_system

from codegen.integrand import second_gradient_energy
from tmc_vem import Box, Medium, RunOptions, run
from tmc_vem.mesh import PolygonMesh
from tmc_vem.support.errors import InputError
from tmc_vem.vem.facets.energy import facet_integrand
from tmc_vem.vem.spaces.element_settings import ElementSettings
from tmc_vem.vem.system import VemSystem

B = 0.3
SECOND_ONLY = {"a": 0.0, "gamma": 1.0, "alpha_r": B}
MEDIUM = {"mu": 3.0, "gamma": 0.2, "alpha_r": 0.5, "beta": 1.5}
MESHES: dict[str, Callable[[int], PolygonMesh]] = {
    "squares": lambda n: grid(n, n),
    "triangles": lambda n: triangles(grid(n, n)),
    "voronoi": lambda n: named(voronoi(n * n)),
    "bricks": bricks,
    "hanging": lambda n: named(hanging(n)),
}


def residual(system: VemSystem, field: Callable[[Any], Any]) -> Any:
    """Nodes' labels (n, 3), and the residual (n, 2) at a displacement."""
    out = system.create_vector()
    system.residual(interpolate(system, field), out)
    return system.node_labels(), out.getArray().reshape(-1, 2).copy()


def wave(x: Any) -> Any:
    """A displacement with large gradients and J > 0."""
    return 0.12 * np.column_stack([np.sin(3 * x[:, 0] + 2 * x[:, 1]), np.cos(2 * x[:, 0] - 3 * x[:, 1]) + x[:, 0] ** 2])


@pytest.mark.parametrize("mesh", MESHES)
def test_the_second_gradient_problem_is_solved(mesh: str) -> None:
    coarse, fine = (abs(amplitude(MESHES[mesh](n), "full") - 1.0) for n in (6, 12))
    assert fine < (0.06 if mesh == "triangles" else 0.01)
    assert coarse > 2.0 * fine
    # without it the answer is another problem's, whatever the mesh
    assert amplitude(MESHES[mesh](6), "none") > 1.4


@pytest.mark.parametrize("mesh", ["squares", "voronoi", "bricks"])
def test_the_penalty_alone_comes_close(mesh: str) -> None:
    assert 1.0 < amplitude(MESHES[mesh](12), "penalty") < 1.07


def test_one_weight_is_one_medium_on_all_cells() -> None:
    """The regulariser of the box, in cells and between them, where it counts; without, a third is missing."""

    def regulariser(cells: str, kind: str) -> float:
        box = Box(cells=(20, 5), uy=-0.2, medium=Medium(alpha_r=10.0, gamma=1e-3), cell_kind=cells)
        result = run(box, options=RunOptions(element=ElementSettings(interior_penalty=kind), steps=3))
        return float(result.checks["regulariser_energy"] + result.checks.get("penalty_energy", 0.0))

    squares = regulariser("quadrilaterals", "full")
    assert regulariser("voronoi", "full") == pytest.approx(squares, rel=0.05)
    assert regulariser("voronoi", "none") < 0.7 * squares


def test_order_three_converges_faster() -> None:
    coarse, fine = (abs(amplitude(grid(n, n), "full", order=3) - 1.0) for n in (3, 6))
    assert fine < 1e-3
    assert coarse > 10.0 * fine


@pytest.mark.parametrize("mesh", MESHES)
def test_twist_is_held_by_forces_at_the_corners_only(mesh: str) -> None:
    """u = x y has a constant second gradient: plate theory has corner forces 2 b and nothing else."""
    system = make_system(MESHES[mesh](4), penalised(LINEAR, SECOND_ONLY, "full"), ())
    labels, forces = residual(system, lambda x: np.column_stack([x[:, 0] * x[:, 1], 0.0 * x[:, 0]]))
    corner = np.isin(labels[:, :2], (0.0, 1.0)).all(axis=1) & (labels[:, 2] == 0.0)
    sign = np.where(labels[corner, 0] == labels[corner, 1], 1.0, -1.0)
    np.testing.assert_allclose(forces[corner, 0], 2.0 * B * sign, rtol=1e-9)
    assert np.abs(forces[~corner]).max() < 1e-9


@pytest.mark.parametrize(
    ("mesh", "order"), [("squares", 2), ("voronoi", 2), ("bricks", 2), ("hanging", 3), ("voronoi", 3)]
)
def test_polynomials_have_no_forces_inside(mesh: str, order: int) -> None:
    system = make_system(MESHES[mesh](4), penalised(LINEAR, SECOND_ONLY, "full"), (), ElementSettings(order))
    powers = [(p, q) for p in range(order + 1) for q in range(order + 1 - p) if p + q >= 2]
    for p, q in powers:
        labels, forces = residual(
            system, lambda x, p=p, q=q: np.column_stack([0.0 * x[:, 0], x[:, 0] ** p * x[:, 1] ** q])
        )
        inside = ((labels[:, :2] > 0.3) & (labels[:, :2] < 0.7)).all(axis=1)
        scale = np.abs(forces).max()
        assert inside.any()
        assert np.abs(forces[inside]).max() < 1e-9 * max(scale, B)


@pytest.mark.parametrize("order", [2, 3])
def test_polynomials_have_no_energy_in_sides(order: int) -> None:
    """Neither jumps nor, at the edges of media, differences from the derivative along the side, either way round."""
    mesh = voronoi(16)
    cells = [list(cell) for cell in mesh.cells()]
    right = [int(mesh.points_vx[cell][:, 0].mean() > 0.5) for cell in cells]
    media = PolygonMesh.from_cells(mesh.points_vx, cells, right, ("left", "right"))
    system = make_system(media, penalised(LINEAR, SECOND_ONLY, "penalty"), (), ElementSettings(order))
    assert system.penalty is not None
    edges = system.distributed.edges
    assert not edges.forward[edges.n_cells_e[edges.cell_edges] == 2].all()
    powers = [(p, q) for p in range(order + 1) for q in range(order + 1 - p)]
    for p, q in powers:
        u = interpolate(system, lambda x, p=p, q=q: np.column_stack([x[:, 0] ** p * x[:, 1] ** q, x[:, 1] ** p]))
        energies = [terms.energies(system.nodal_values(u))[0] for terms in system.penalty.terms]
        assert np.concatenate(energies).max() < 1e-18


@pytest.mark.parametrize("kind", ["penalty", "full"])
@pytest.mark.parametrize(
    ("energy", "order", "mesh"),
    [
        ("medium_huhu_damped", 2, "voronoi"), ("medium_huhu_lulu_damped", 2, "hanging"), ("medium_angle", 2, "bricks"),
        ("medium_angle_damped", 3, "voronoi"), ("medium_tangent_damped", 2, "triangles"),
    ],
)  # fmt: skip
def test_residual_and_tangent_are_derivatives(energy: str, order: int, mesh: str, kind: str) -> None:
    integrand = medium(energy)
    values = {name: MEDIUM[name] for name in integrand.parameter_names}
    system = make_system(MESHES[mesh](3), penalised(integrand, values, kind), (), ElementSettings(order))
    u, direction = interpolate(system, wave), system.create_vector()
    direction.getArray()[:] = np.random.default_rng(3).normal(size=direction.getSize())
    direction.scale(1.0 / direction.norm())
    slope, matrix = system.create_vector(), system.create_matrix()
    start = system.residual(u, slope).energy
    system.jacobian(u, matrix)
    action = system.create_vector()
    matrix.mult(direction, action)
    again = system.create_vector()
    system.tangent_action(direction, again)
    again.axpy(-1.0, action)
    assert again.norm() < 1e-12 * action.norm()
    first, second = [], []
    for h in (1e-4, 5e-5):
        moved, there = u.duplicate(), system.create_vector()
        moved.waxpy(h, direction, u)
        value = system.residual(moved, there).energy
        first.append(abs(value - start - h * slope.dot(direction)))
        there.axpy(-1.0, slope)
        there.axpy(-h, action)
        second.append(there.norm())
    assert first[0] / first[1] == pytest.approx(4.0, rel=0.1)
    assert second[0] / second[1] == pytest.approx(4.0, rel=0.1)
    whole = dense(matrix)
    assert np.abs(whole - whole.T).max() < 1e-12 * np.abs(whole).max()


def test_turning_a_state_changes_nothing() -> None:
    integrand = medium("medium_angle_damped")
    system = make_system(named(voronoi(12)), penalised(integrand, MEDIUM, "full"), ())
    before = system.energy(interpolate(system, wave)).energy
    c, s = np.cos(2.2), np.sin(2.2)
    turned = lambda x: (x + wave(x)) @ np.array([[c, s], [-s, c]]) - x  # noqa: E731
    assert system.energy(interpolate(system, turned)).energy == pytest.approx(before, rel=1e-11)
    rigid = interpolate(system, lambda x: x @ np.array([[c, s], [-s, c]]) - x)
    forces = system.create_vector()
    assert abs(system.residual(rigid, forces).energy) < 1e-12
    assert forces.norm() < 1e-10


def test_sides_belong_to_one_medium() -> None:
    """Two media side by side: no bending stiffness between them, and each has its own weight."""
    mesh = grid(4, 2)
    halves = PolygonMesh.from_cells(
        mesh.points_vx, [list(c) for c in mesh.cells()], [0, 0, 1, 1] * 2, ("left", "right")
    )
    kernels = {
        name: penalised(LINEAR, {**SECOND_ONLY, "alpha_r": weight}, "full")
        for name, weight in (("left", B), ("right", 2 * B))
    }
    system = make_system(halves, kernels, ())
    assert system.penalty is not None
    together = [np.column_stack([t.cells]) for t in system.penalty.terms if t.cells.shape[1] == 2]
    pairs = np.concatenate(together)
    assert (halves.region_c[pairs[:, 0]] == halves.region_c[pairs[:, 1]]).all()
    # a kink between them costs nothing, one within a medium does
    kink = lambda at: lambda x: np.column_stack([np.abs(x[:, 0] - at), 0.0 * x[:, 0]])  # noqa: E731
    assert system.energy(interpolate(system, kink(0.5))).energy < 1e-20
    within = [system.energy(interpolate(system, kink(at))).energy for at in (0.25, 0.75)]
    assert within[1] == pytest.approx(2.0 * within[0], rel=1e-12)
    # 2 = [[du/dx]], h = 1/4, side of length 1 at eta = 10
    assert within[0] == pytest.approx(10.0 * B / (2 * 0.25) * 4.0, rel=1e-12)


def test_steps_stop_where_a_trace_turns_over() -> None:
    integrand = medium("medium_huhu_lulu_damped")
    plain = make_system(grid(2, 2), penalised(integrand, MEDIUM, "none"), ())
    sides = make_system(grid(2, 2), penalised(integrand, MEDIUM, "full"), ())
    squeeze = lambda x: np.column_stack([-(x[:, 0] ** 2), 0.0 * x[:, 0]])  # noqa: E731
    limits = [s.max_step(s.create_vector(), interpolate(s, squeeze)) for s in (plain, sides)]
    # J = 1 - 2 s x: the trace at x = 1 is the first to vanish
    assert limits[1] == pytest.approx(0.5, rel=1e-9)
    assert limits[0] > limits[1]
    lowest = sides.energy(interpolate(sides, lambda x: 0.45 * squeeze(x)))
    assert min(region.min_j for region in lowest.regions.values()) == pytest.approx(0.1, rel=1e-9)


def test_the_penalty_alone_bears_traces_that_turn_over() -> None:
    """Its weight exp(-beta J) has a value there: neither steps nor the smallest J are those of the sides."""
    integrand = medium("medium_huhu_lulu_damped")
    plain, sides = (make_system(grid(2, 2), penalised(integrand, MEDIUM, kind), ()) for kind in ("none", "penalty"))
    squeeze = lambda x: np.column_stack([-0.51 * x[:, 0] ** 2, 0.0 * x[:, 0]])  # noqa: E731
    limits = [s.max_step(s.create_vector(), interpolate(s, squeeze)) for s in (plain, sides)]
    assert limits[0] == limits[1] > 1.0
    lowest = [s.energy(interpolate(s, squeeze)).min_j for s in (plain, sides)]
    assert lowest[0] == lowest[1] > 0.0
    assert np.isfinite(sides.energy(interpolate(sides, squeeze)).energy)


def test_parameters_change_in_sides_too() -> None:
    integrand = medium("medium_huhu_lulu_damped")
    changed, fresh = (
        make_system(named(voronoi(9)), penalised(integrand, {**MEDIUM, **more}, "full"), ())
        for more in ({}, {"gamma": 0.7, "alpha_r": 2.0})
    )
    changed.set_parameters({"gamma": 0.7, "alpha_r": 2.0})
    energies = [system.energy(interpolate(system, wave)).energy for system in (changed, fresh)]
    assert energies[0] == pytest.approx(energies[1], rel=1e-14)


def test_a_regulariser_of_ones_own() -> None:
    def own(F: Any, G: Any, p: Any, m: Any) -> Any:
        """grad ln J, which needs the derivative of a quotient."""
        J = F[0][0] * F[1][1] - F[0][1] * F[1][0]
        rise = [
            (F[1][1] * G[0][0][k] - F[1][0] * G[0][1][k] - F[0][1] * G[1][0][k] + F[0][0] * G[1][1][k]) / J
            for k in (0, 1)
        ]
        return p.gamma * (m.log(J) ** 2 + p.alpha_r * m.sqrt(1 + rise[0] ** 2 + rise[1] ** 2) * m.exp(-0.3 * m.atan(J)))

    integrand = second_gradient_energy(own, "own_log", ("gamma", "alpha_r"))
    values = {"gamma": 0.2, "alpha_r": 0.5}
    system = make_system(named(voronoi(9)), penalised(integrand, values, "full"), ())
    u, direction, slope = (
        interpolate(system, wave),
        interpolate(system, lambda x: np.cos(5 * x)),
        system.create_vector(),
    )
    start = system.residual(u, slope).energy
    left = []
    for h in (1e-4, 5e-5):
        moved = u.duplicate()
        moved.waxpy(h, direction, u)
        left.append(abs(system.energy(moved).energy - start - h * slope.dot(direction)))
    assert left[0] / left[1] == pytest.approx(4.0, rel=0.1)


def test_a_medium_without_weights_is_refused() -> None:
    integrand = second_gradient_energy(lambda F, G, p, m: p.c * G[0][0][0] ** 2, "bare", ("c",))
    with pytest.raises(InputError, match=r"region 'medium': the interior penalty is weighted by gamma and alpha_r"):
        penalised(integrand, {"c": 1.0}, "full")


def test_settings() -> None:
    assert [ElementSettings(order).penalty_factor for order in (2, 3)] == [10.0, 20.0]
    assert ElementSettings(3, eta=4.0).penalty_factor == 4.0
    with pytest.raises(InputError, match="eta = -1"):
        ElementSettings(eta=-1.0)
    with pytest.raises(InputError, match="unknown interior penalty 'half'"):
        ElementSettings(interior_penalty="half")


def test_only_what_is_read_is_in_the_kernel() -> None:
    sizes = [facet_integrand(LINEAR, full).layout.n_inputs for full in (False, True)]
    assert sizes == [8, 24]
