"""Friction in the cell driver: against sums written out in Python, and by differences on both sides of the kink."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from test_kernel_cells import PARAMETERS, kernel_of, random_batch, rows, run

from codegen.integrand import second_gradient_energy
from tmc_vem.energy import DENSITIES
from tmc_vem.vem.kernel.batch import CellBatch
from tmc_vem.vem.kernel.cells import CellKernel, compile_cells
from tmc_vem.vem.kernel.friction_packs import FrictionPacks

Array = NDArray[np.float64]

SHAPES = [(1, 3, 1, 1), (8, 9, 8, 2), (5, 13, 19, 4), (19, 7, 5, 1)]  # cells, functions, points, pieces


@dataclass(frozen=True)
class Frozen:
    """What is frozen at the points (n_cells, n_points) of random cells, whose gradients are ``B_cqra u``.

    Attributes:
        batch: of the cells.
        nodes_ca, w_cq, B_cqra: their nodes, weights and first derivative rows.
        A_cqri: direction of the shear, by derivative and component.
        AH_cq, bound_cq, stiffness_cq, tau_cq: as in kernel_abi.h.
    """

    batch: CellBatch
    nodes_ca: NDArray[np.int64]
    w_cq: Array
    B_cqra: Array
    A_cqri: Array
    AH_cq: Array
    bound_cq: Array
    stiffness_cq: Array
    tau_cq: Array

    @property
    def k_cqk(self) -> Array:
        """In the order of kernel_abi.h."""
        A = self.A_cqri.reshape(*self.w_cq.shape, 4)
        return np.concatenate(
            [A, np.stack([self.AH_cq, self.bound_cq, self.stiffness_cq, self.tau_cq], axis=-1)], axis=-1
        )

    @property
    def rough(self) -> CellBatch:
        """The batch with friction."""
        friction = FrictionPacks(*self.w_cq.shape)
        friction.set_cells(slice(0, len(self.w_cq)), self.k_cqk)
        return replace(self.batch, friction=friction)

    def trial(self, u_ni: Array) -> Array:
        """Shear (n_cells, n_points) before it is cut."""
        x_cqri = np.einsum("cqra,cai->cqri", self.B_cqra, u_ni[self.nodes_ca])
        return self.tau_cq + self.stiffness_cq * (np.einsum("cqri,cqri->cq", self.A_cqri, x_cqri) - self.AH_cq)

    def kinds(self, u_ni: Array) -> Array:
        """-1, 0 or 1: sliding one way, sticking, the other way; 9 without friction."""
        trial = self.trial(u_ni)
        return np.where(self.bound_cq > 0.0, np.sign(trial) * (np.abs(trial) >= self.bound_cq), 9.0)

    def by_sums(self, u_ni: Array, damping: float = 0.0) -> tuple[Array, Array, Array]:
        """Energies, residual and tangents of the friction alone, with a part of the stiffness of points that slip."""
        energy_c, residual = np.zeros(len(self.w_cq)), np.zeros_like(u_ni)
        n = 2 * self.nodes_ca.shape[1]
        tangent = np.zeros((len(self.w_cq), n, n))
        for c, q in np.argwhere(self.bound_cq > 0.0):
            w, bound, stiffness = self.w_cq[c, q], self.bound_cq[c, q], self.stiffness_cq[c, q]
            trial, start = self.trial(u_ni)[c, q], self.tau_cq[c, q]
            slope_ai = self.B_cqra[c, q].T @ self.A_cqri[c, q]
            energy_c[c] += w * (trial**2 - max(abs(trial) - bound, 0.0) ** 2 - start**2) / (2.0 * stiffness)
            residual[self.nodes_ca[c]] += w * min(max(trial, -bound), bound) * slope_ai
            tangent[c] += w * stiffness * (1.0 if abs(trial) < bound else damping) * np.outer(slope_ai, slope_ai)
        return energy_c, residual, tangent


def frozen(n_cells: int, n_basis: int, n_points: int, n_pieces: int, seed: int = 1) -> tuple[Frozen, Array]:
    """Random cells with friction at two points in three, and displacements at which all kinds of points are found."""
    rng = np.random.default_rng(seed)
    batch, arrays = random_batch(n_cells, n_basis, n_points, 3, rng, degrees=(2, 2), n_pieces=n_pieces)
    u = rng.normal(scale=0.01 / n_basis, size=(n_cells * n_basis, 2))
    shape = (n_cells, n_points)
    some = rng.uniform(size=shape) < 2 / 3
    bound = np.where(some, rng.uniform(0.5, 1.0, shape), 0.0)
    B = rows(arrays)[arrays["shape_c"]][:, :, :2]
    A = np.where(some[..., None, None], rng.normal(scale=20.0, size=(*shape, 2, 2)), 0.0)
    AH = np.einsum("cqri,cqra,cai->cq", A, B, u[arrays["nodes_ca"]]) - rng.normal(scale=0.4, size=shape)
    w, tau = arrays["w_sq"][arrays["shape_c"]], bound * rng.uniform(-1.0, 1.0, shape)
    return Frozen(batch, arrays["nodes_ca"], w, B, A, AH, bound, bound / 0.3, tau), u


def close(found: Array, expected: Array) -> None:
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("name", ["solid", "medium_angle_damped"])
@pytest.mark.parametrize("shape", SHAPES)
def test_friction_is_added_at_every_point(name: str, shape: tuple[int, int, int, int]) -> None:
    """Also to entries of gradient and Hessian that the energy leaves zero, and in packs that are partly full."""
    cells, u = frozen(*shape)
    kernel = kernel_of(name)
    plain, plain_residual, plain_tangent = run(kernel, cells.batch, u)
    found, residual, tangent = run(kernel, cells.rough, u)
    energy_c, forces, stiffness = cells.by_sums(u)
    close(found.energy_c, plain.energy_c + energy_c)
    close(residual, plain_residual + forces)
    close(tangent, plain_tangent + stiffness)
    np.testing.assert_array_equal(found.min_j_c, plain.min_j_c)
    if len(cells.w_cq) > 1:
        assert set(cells.kinds(u).ravel()) == {-1.0, 0.0, 1.0, 9.0}


def test_entries_that_an_energy_leaves_out_do_not_add_up_over_points() -> None:
    """Gradient and Hessian have one entry each, so that nothing but friction is in the others."""
    energy = second_gradient_energy(lambda F, G, p, m: p.mu * (F[0][0] - 1) * (F[0][0] - 1), "pull", ("mu",))
    kernel, (cells, u) = compile_cells(energy), frozen(11, 7, 5, 1)
    batch, (energy_c, forces, stiffness) = cells.rough, cells.by_sums(u)
    plain, plain_residual, plain_tangent = run(kernel, cells.batch, u)
    found, residual, tangent = run(kernel, batch, u)
    close(found.energy_c, plain.energy_c + energy_c)
    close(residual, plain_residual + forces)
    close(tangent, plain_tangent + stiffness)
    alone = np.zeros_like(u)
    kernel.cells(batch, u, kernel.parameter_array(PARAMETERS), alone)
    close(alone, residual)


@pytest.mark.parametrize("level", ["residual", "energy"])
def test_lower_levels_have_the_friction_of_the_tangent(level: str) -> None:
    cells, u = frozen(11, 7, 5, 2)
    kernel, batch = kernel_of("medium_huhu_damped"), cells.rough
    whole, expected, _ = run(kernel, batch, u)
    out = np.zeros_like(u) if level == "residual" else None
    found = kernel.cells(batch, u, kernel.parameter_array(PARAMETERS), out)
    np.testing.assert_allclose(found.energy_c, whole.energy_c, rtol=1e-12)
    if out is not None:
        close(out, expected)


def test_the_kernel_is_consistent_on_both_sides_of_the_kink() -> None:
    """Residual and tangent against differences of the kernel itself, while every point keeps to its side."""
    cells, u = frozen(19, 7, 5, 2)
    kernel, batch = kernel_of("medium_huhu_lulu_damped"), cells.rough
    direction = np.random.default_rng(3).normal(size=u.shape)
    direction, t = direction / np.abs(direction).max(), 1e-8
    ahead, behind = u + t * direction, u - t * direction
    kinds = cells.kinds(u)
    assert all((kinds == kind).sum() > 5 for kind in (-1.0, 0.0, 1.0, 9.0))
    np.testing.assert_array_equal(cells.kinds(ahead), kinds)
    np.testing.assert_array_equal(cells.kinds(behind), kinds)
    _, residual, tangent = run(kernel, batch, u)
    (after, forces_after, _), (before, forces_before, _) = (run(kernel, batch, state) for state in (ahead, behind))
    slope = (after.energy_c - before.energy_c).sum() / (2 * t)
    assert np.vdot(residual, direction) == pytest.approx(slope, rel=1e-6)
    change = np.zeros_like(u)
    for nodes, K in zip(cells.nodes_ca, tangent, strict=True):
        change[nodes] += (K @ direction[nodes].ravel()).reshape(-1, 2)
    error = (forces_after - forces_before) / (2 * t) - change
    assert np.abs(error).max() < 1e-6 * np.abs(change).max()
    np.testing.assert_allclose(tangent, np.swapaxes(tangent, 1, 2), rtol=0, atol=1e-12 * np.abs(tangent).max())


def test_slip_is_damped_in_tangents_alone() -> None:
    """Those of cells that were taken apart as well; energies and forces are what they were."""
    cells, u = frozen(11, 7, 5, 2)
    kernel, batch = kernel_of("medium_huhu_damped"), cells.rough
    whole, expected, before = run(kernel, batch, u)
    taken = batch.take(np.arange(3, 9))
    assert batch.friction is not None
    batch.friction.damping[:] = 0.125
    found, residual, tangent = run(kernel, batch, u)
    np.testing.assert_array_equal(found.energy_c, whole.energy_c)
    np.testing.assert_array_equal(residual, expected)
    close(tangent - before, cells.by_sums(u, 0.125)[2] - cells.by_sums(u)[2])
    close(run(kernel, taken, u)[2], tangent[3:9])


def test_points_without_a_bound_change_nothing_to_the_bit() -> None:
    cells, u = frozen(11, 7, 5, 2)
    kernel = kernel_of("medium_angle_damped")
    none = replace(cells.batch, friction=FrictionPacks(11, 5))
    for found, expected in zip(run(kernel, none, u)[1:], run(kernel, cells.batch, u)[1:], strict=True):
        np.testing.assert_array_equal(found, expected)


def test_cells_that_were_taken_follow_the_others() -> None:
    """In any order and twice, before and after the friction changes, as do cells taken from these."""
    cells, u = frozen(19, 7, 5, 1)
    kernel, batch = kernel_of("solid"), cells.rough
    chosen = np.array([17, 3, 3, 11, 0, 9, 10, 8, 1])
    taken = batch.take(chosen)
    again = taken.take(slice(2, 5))
    assert batch.friction is not None
    for factor in (1.0, 0.5):
        batch.friction.set_cells(slice(0, 19), cells.k_cqk * np.r_[np.ones(5), factor, factor, factor])
        energy_c = kernel.cells(batch, u, kernel.parameter_array(PARAMETERS)).energy_c
        for some, numbers in ((taken, chosen), (again, chosen[2:5])):
            found = kernel.cells(some, u, kernel.parameter_array(PARAMETERS)).energy_c
            np.testing.assert_allclose(found, energy_c[numbers], rtol=1e-13)


def test_parts_of_the_cells_are_set_and_read_by_packs() -> None:
    packs, rng = FrictionPacks(19, 3), np.random.default_rng(5)
    values = rng.normal(size=(19, 3, 8))
    packs.set_cells(slice(0, 16), values[:16])
    packs.set_cells(slice(16, 19), values[16:])
    np.testing.assert_array_equal(packs.cells(slice(0, 19)), values)
    np.testing.assert_array_equal(packs.cells(slice(8, 16)), values[8:16])
    for c in range(19):
        np.testing.assert_array_equal(packs.values_cpqk[c // 8, :, :, c % 8], values[c])


def test_cells_whose_parameters_vary_have_friction_as_well() -> None:
    energy = DENSITIES["solid"]
    integrand = second_gradient_energy(energy.density, energy.name, energy.parameters).varying(["K"])
    kernel: CellKernel = compile_cells(integrand)
    cells, u = frozen(11, 7, 5, 1)
    factor = {"factor_ck": np.linspace(0.5, 2.0, 11)[:, None]}
    plain: Any = run(kernel, replace(cells.batch, **factor), u)
    found: Any = run(kernel, replace(cells.rough, **factor), u)
    energy_c, forces, stiffness = cells.by_sums(u)
    close(found[0].energy_c, plain[0].energy_c + energy_c)
    close(found[1], plain[1] + forces)
    close(found[2], plain[2] + stiffness)
