"""What the solver sees: boundary conditions, tangent products, reactions, loads, output."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_fem import CLAMPED, SOLID, grid, layered, make_system, medium, problem_system, random_vector, wavy

from tmc_vem.problems import Box
from tmc_vem.support.errors import InputError
from tmc_vem.system.constraints import Prescribed
from tmc_vem.system.control import Control


def test_points_that_do_not_exist_are_refused() -> None:
    system = problem_system(Box(cells=(20, 5)))
    u = system.create_vector()
    for ask in (system.point_coordinates, lambda names: system.point_displacements(u, names)):
        with pytest.raises(InputError, match="'nose'"):
            ask(("load", "nose"))


def test_tangent_has_identity_rows_where_constrained() -> None:
    system = make_system(layered(3, 3), {"solid": SOLID, "medium": medium()}, CLAMPED)
    matrix, u = system.create_matrix(), system.interpolate(wavy)
    for _ in range(2):  # the second time reuses the matrix
        system.jacobian(u, matrix)
    n = matrix.getSize()[0]
    dense = np.array(matrix.getValues(range(n), range(n)))
    fixed = system.constrained()
    free = np.setdiff1d(np.arange(n), fixed)
    assert (dense[np.ix_(fixed, fixed)] == np.eye(len(fixed))).all()
    assert not dense[np.ix_(fixed, free)].any()
    assert not dense[np.ix_(free, fixed)].any()

    whole = make_system(layered(3, 3), {"solid": SOLID, "medium": medium()})
    full = whole.create_matrix()
    whole.jacobian(u, full)
    everything = np.array(full.getValues(range(n), range(n)))
    assert dense[np.ix_(free, free)] == pytest.approx(everything[np.ix_(free, free)], rel=1e-13)
    du, product = random_vector(system, 5, 1.0), system.create_vector()
    system.tangent_action(du, product)
    assert product.getArray() == pytest.approx(everything @ du.getArray(), rel=1e-10, abs=1e-10)


def test_reactions_balance_the_load() -> None:
    system = make_system(grid(3, 3), SOLID, CLAMPED)
    system.set_body_force(lambda x: np.broadcast_to([2.0, -3.0], x.shape))
    residual = system.create_vector()
    system.residual(system.create_vector(), residual)
    total = residual.getArray().reshape(-1, 2).sum(axis=0)
    assert total == pytest.approx([-2.0, 3.0])
    boundary = [system.reaction(residual, "boundary", component) for component in (0, 1)]
    inner = np.ones(system.nodes.n_owned, dtype=bool)
    inner[system.nodes.named("boundary")] = False
    assert boundary == pytest.approx(total - residual.getArray().reshape(-1, 2)[inner].sum(axis=0))


def test_work_of_the_load_is_in_the_potential() -> None:
    system = make_system(grid(3, 3), SOLID)
    u = system.interpolate(lambda x: np.broadcast_to([0.1, 0.2], x.shape))
    assert system.energy(u).energy == pytest.approx(0.0, abs=1e-15)
    system.set_body_force(lambda x: x * [1.0, 0.0])
    assert system.energy(u).energy == pytest.approx(-0.05)


def test_point_displacements_come_in_the_order_asked_for() -> None:
    system = problem_system(Box(cells=(20, 5)))
    u = system.interpolate(lambda x: x @ np.array([[0.1, 0.2], [0.3, 0.4]]))
    names = ("support_right", "flange_top", "load")
    expected = system.point_coordinates(names) @ np.array([[0.1, 0.2], [0.3, 0.4]])
    assert system.point_displacements(u, names) == pytest.approx(expected)


def test_later_conditions_win() -> None:
    system = make_system(grid(2, 2), SOLID, [Prescribed("boundary", 0, 0.0), Prescribed("corner", 0, 0.25)])
    assert sorted(system.prescribed(Control(1.0)))[-1] == 0.25
    assert len(system.constrained()) == 16


def test_cell_values() -> None:
    system = make_system(grid(3, 2, distort=0.2), medium())
    u = system.interpolate(lambda x: x @ np.array([[0.1, 0.0], [0.2, -0.3]]))
    mean, smallest = system.cell_jacobians(u)
    assert mean == pytest.approx(np.full(6, 1.1 * 0.7))
    assert smallest == pytest.approx(mean)
    density = system.cell_energies(u) / system.cell_areas()
    assert density == pytest.approx(np.full(6, density[0]))
    assert system.n_dofs == 2 * 7 * 5
    assert system.size == 1.0


def test_parameters_can_change_after_the_forms_are_compiled() -> None:
    """Energy, residual, tangent and penalty follow, as if the system had been made with the new values."""
    settings = {"interior_penalty": "penalty"}
    system = make_system(layered(3, 3), {"solid": SOLID, "medium": medium(gamma=1e-2)}, CLAMPED, **settings)
    other = make_system(layered(3, 3), {"solid": SOLID, "medium": medium(gamma=1e-3)}, CLAMPED, **settings)
    u = system.interpolate(wavy)
    parts = []
    system.residual(u, system.create_vector())  # compiled with the first values
    system.set_parameters({"gamma": 1e-3})
    for one in (system, other):
        residual, matrix = one.create_vector(), one.create_matrix()
        evaluation = one.residual(u, residual)
        one.jacobian(u, matrix)
        parts.append((evaluation.energy, residual.getArray().copy(), matrix.norm()))
    assert parts[0][0] == pytest.approx(parts[1][0], rel=1e-12)
    assert parts[0][1] == pytest.approx(parts[1][1], rel=1e-10, abs=1e-14)
    assert parts[0][2] == pytest.approx(parts[1][2], rel=1e-12)
