"""The conventional contact reference: its energy, elements, contact and solver, each against what is known exactly."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from tmc_vem.mesh import PolygonMesh

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
sys.path.append(str(BENCHMARKS))

import conventional_medium as medium  # noqa: E402
from conventional import lagrange, neohooke, solve, studies  # noqa: E402
from conventional.body import Body, with_middles  # noqa: E402
from conventional.contact import Contact, both_ways, nearest, rule  # noqa: E402
from conventional.faces import solids  # noqa: E402
from conventional.solve import System  # noqa: E402
from pages import verification  # noqa: E402

K, MU = 20.0, 10.0


def moduli(n: int = 1) -> tuple[np.ndarray, np.ndarray]:
    return np.full(n, K), np.full(n, MU)


def test_energy_of_a_squeezed_layer_is_known():
    F = np.array([[[1.0, 0.0], [0.0, 0.5]]])
    expected = K / 2 * np.log(2.0) ** 2 + MU / 2 * (0.5 ** (-2 / 3) * 2.25 - 3.0)
    assert neohooke.energy(F, *moduli())[0] == pytest.approx(expected, rel=1e-14)


def test_stress_and_tangent_are_derivatives():
    rng = np.random.default_rng(0)
    F = np.eye(2) + 0.25 * rng.uniform(-1, 1, (6, 2, 2))
    D, h = rng.uniform(-1, 1, F.shape), 1e-5
    difference = (neohooke.energy(F + h * D, *moduli(6)) - neohooke.energy(F - h * D, *moduli(6))) / (2 * h)
    assert difference == pytest.approx(np.einsum("qij,qij->q", neohooke.stress(F, *moduli(6)), D), rel=1e-7)
    difference = (neohooke.stress(F + h * D, *moduli(6)) - neohooke.stress(F - h * D, *moduli(6))) / (2 * h)
    assert np.allclose(difference, np.einsum("qijkl,qkl->qij", neohooke.tangent(F, *moduli(6)), D), rtol=0, atol=1e-6)


def test_tangent_at_rest_has_the_moduli():
    A = neohooke.tangent(np.eye(2)[None], *moduli())[0]
    assert A[0, 0, 0, 0] == pytest.approx(K + 4 / 3 * MU)
    assert A[0, 0, 1, 1] == pytest.approx(K - 2 / 3 * MU)
    assert A[0, 1, 0, 1] == A[0, 1, 1, 0] == pytest.approx(MU)


SQUARE, TRIANGLE = [(-1, -1), (1, -1), (1, 1), (-1, 1)], [(0, 0), (1, 0), (0, 1)]


@pytest.mark.parametrize(("shape", "corners"), [(lagrange.square, SQUARE), (lagrange.triangle, TRIANGLE)])
def test_shape_functions_reproduce_quadratics(shape, corners):
    nodes, cells, _ = with_middles(np.array(corners, float), [list(range(len(corners)))])
    nodes = nodes[cells[0]]

    def quadratic(x):
        return 1 + 2 * x[:, 0] - x[:, 1] + 3 * x[:, 0] ** 2 - x[:, 0] * x[:, 1] + x[:, 1] ** 2

    N, dN, w = shape(3)
    x = N @ nodes
    assert N @ quadratic(nodes) == pytest.approx(quadratic(x), abs=1e-13)
    slopes = np.stack([2 + 6 * x[:, 0] - x[:, 1], -1 - x[:, 0] + 2 * x[:, 1]], axis=1)
    assert np.allclose(np.einsum("qkj,k->qj", dN, quadratic(nodes)), slopes, atol=1e-13)
    assert w.sum() == pytest.approx(4.0 if len(corners) == 4 else 0.5)


POINTS = np.array([[0, 0], [1, 0], [2, 0], [0, 1], [1.2, 0.9], [2, 1.0]])
MIXED = [[0, 1, 4, 3], [1, 2, 5], [1, 5, 4]]


def mixed() -> Body:
    """A distorted quadrilateral beside two triangles."""
    nodes, cells, _ = with_middles(POINTS, MIXED)
    return Body(nodes, cells, *moduli(3))


def test_patch_of_quadrilaterals_and_triangles():
    body, H = mixed(), np.array([[0.1, 0.2], [-0.1, -0.15]])
    u = body.X_ni @ H.T
    F = (np.eye(2) + H)[None]
    area = 0.95 * 2.0  # the upper outline has a mean height of 0.95
    assert body.energy(u) == pytest.approx(area * neohooke.energy(F, *moduli())[0], rel=1e-12)
    r = body.forces(u).reshape(-1, 2)
    (between,) = (n for n, X in enumerate(body.X_ni) if np.allclose(X, [1.1, 0.45]))
    assert np.abs(r[between]).max() < 1e-13
    P = neohooke.stress(F, *moduli())[0]
    (middle,) = (n for n, X in enumerate(body.X_ni) if np.allclose(X, [2.0, 0.5]))
    assert r[middle] == pytest.approx(P @ [1.0, 0.0] * 4 / 6, rel=1e-12)


def test_forces_and_tangent_of_a_body_are_derivatives():
    body, rng, h = mixed(), np.random.default_rng(1), 1e-6
    u, d = (scale * rng.uniform(-1, 1, body.X_ni.shape) for scale in (0.03, 1.0))
    assert (body.energy(u + h * d) - body.energy(u - h * d)) / (2 * h) == pytest.approx(body.forces(u) @ d.ravel())
    difference = (body.forces(u + h * d) - body.forces(u - h * d)) / (2 * h)
    assert np.allclose(difference, body.tangent(u) @ d.ravel(), rtol=1e-6, atol=1e-6)


def test_a_body_that_is_turned_inside_out_has_no_energy():
    body = mixed()
    assert body.energy(np.where(body.X_ni == [0, 1], -2.0, 0.0)) == np.inf
    with pytest.raises(ValueError, match="counter-clockwise"):
        Body(body.X_ni[:, ::-1], body.cells, *moduli(3))


def test_rules_of_the_contact():
    for name, exact in (("nodes", 3), ("gauss 2", 3), ("gauss 4", 7)):
        xi, w = rule(name)
        assert [w @ xi**p for p in range(exact + 1)] == pytest.approx(
            [2 / (p + 1) * (p % 2 == 0) for p in range(exact + 1)]
        )
    assert rule("middles 2")[0].tolist() == [-0.5, 0.5]
    assert rule("middles 2")[1].tolist() == [1.0, 1.0]
    with pytest.raises(ValueError, match="'many': use"):
        rule("many")


def test_nearest_points_of_a_parabola():
    y_ski = np.array([[[-2, 4], [-1, 1], [0, 0]], [[0, 0], [1, 1], [2, 4]]], float)  # (x, x^2)
    foot = np.array([-1.3, 0.4, 1.9])
    off = 0.2 * np.stack([-2 * foot, np.ones(3)], axis=1) / np.sqrt(1 + 4 * foot**2)[:, None]
    side, xi = nearest(np.stack([foot, foot**2], axis=1) + off, y_ski)
    assert side.tolist() == [0, 1, 1]
    assert [s * 2 - 1 + t for s, t in zip(side, xi, strict=True)] == pytest.approx(foot, abs=1e-12)


# a face of two sides at y = 0 with its body above, and one side of a face above it that has its body below
FACES = np.array([[0, 0], [0.5, 0], [1, 0], [1.5, 0], [2, 0], [1.7, 0.03], [0.9, 0.05], [0.2, 0.02]], float)


def touching() -> Contact:
    return Contact(FACES, np.array([[5, 6, 7]]), np.array([[0, 1, 2], [2, 3, 4]]), 100.0, "gauss 4", 1.0)


def test_points_on_the_side_of_the_body_touch():
    contact = touching()
    u = np.zeros_like(FACES)
    assert len(contact.touching(u).w_m) == 4
    u[5:, 1] = -0.2
    assert contact.energy(u) == 0.0
    u[5:, 1] = 1.5
    assert contact.energy(u) == 0.0  # deeper than asked for
    u[5:] = [2.5, 0.0]
    assert contact.energy(u) == 0.0  # beyond the end


def test_forces_and_tangent_of_the_contact_are_derivatives():
    contact, rng, h = touching(), np.random.default_rng(3), 1e-6
    u, d = (scale * rng.uniform(-1, 1, FACES.shape) for scale in (0.01, 1.0))
    assert contact.touching(u).inner_m.all()
    r = contact.forces(u)
    assert (contact.energy(u + h * d) - contact.energy(u - h * d)) / (2 * h) == pytest.approx(r @ d.ravel(), rel=1e-6)
    difference = (contact.forces(u + h * d) - contact.forces(u - h * d)) / (2 * h)
    assert np.allclose(difference, contact.tangent(u) @ d.ravel(), rtol=1e-6, atol=1e-5)
    assert np.abs(r.reshape(-1, 2).sum(axis=0)).max() < 1e-14
    x = FACES + u
    assert abs(np.cross(x, r.reshape(-1, 2)).sum()) < 1e-14


def blocks(below: int, above: int, gap: float) -> tuple[PolygonMesh, float]:
    """Two squares above each other."""
    points, cells, regions = [], [], []
    for region, (n, y0) in enumerate(((below, 0.0), (above, 1.0 + gap))):
        start = len(points)
        points += [(i / n, y0 + j / n) for j in range(n + 1) for i in range(n + 1)]
        cells += [[start + j * (n + 1) + i + k for k in (0, 1, n + 2, n + 1)] for j in range(n) for i in range(n)]
        regions += [region] * n * n
    return PolygonMesh.from_cells(points, cells, regions, ("low", "up")), 2.0 + gap


@pytest.fixture
def columns() -> System:
    mesh, top = blocks(3, 3, 0.1)
    part = solids(mesh, {"low": (K, MU), "up": (2 * K, MU)})
    X = part.body.X_ni
    faces = [part.face(studies.level(y, 0.0, 1.0)) for y in (1.0, 1.1)]
    held = {2 * int(n): 0.0 for n in np.flatnonzero((X[:, 0] < 1e-9) | (X[:, 0] > 1 - 1e-9))}
    held |= {2 * int(n) + 1: 0.0 for n in np.flatnonzero(X[:, 1] < 1e-9)}
    held |= {2 * int(n) + 1: -1.0 for n in np.flatnonzero(X[:, 1] > top - 1e-9)}
    return System(part.body, both_ways(X, faces[0], faces[1], 500.0, "gauss 3", 0.5), held)


def test_two_blocks_are_pressed_together_as_known(columns):
    """Uniform stretches a, b with P(a) = P(b) = -penalty times penetration, which is 0.2 - (1 - a) - (1 - b)."""

    def pressure(stretch, bulk):
        F = np.array([[[1.0, 0.0], [0.0, stretch]]])
        return -neohooke.stress(F, np.array([bulk]), np.array([MU]))[0, 1, 1]

    def stretched(p, bulk):
        return brentq(lambda stretch: pressure(stretch, bulk) - p, 0.3, 1.0, xtol=1e-15)

    p = brentq(lambda p: p / 500.0 - (0.2 - (1 - stretched(p, K)) - (1 - stretched(p, 2 * K))), 0.0, 10.0, xtol=1e-14)
    states = []
    columns.path([0.05, 0.3], lambda load, u: states.append(u))
    assert np.abs(columns.forces(states[0])).max() < 1e-12  # not yet in contact
    u = states[1]
    X, r = columns.body.X_ni, columns.forces(u).reshape(-1, 2)
    assert -r[X[:, 1] > 2.0 + 1e-9, 1].sum() == pytest.approx(p, rel=1e-9)
    assert u.reshape(-1, 2)[np.abs(X[:, 1] - 1.0) < 1e-9, 1] == pytest.approx(stretched(p, K) - 1.0, rel=1e-9)
    for contact in columns.contacts:
        place, pressures, w = contact.pressure(u.reshape(-1, 2))
        assert 2 * pressures == pytest.approx(p, rel=1e-8)
        assert w.sum() == pytest.approx(1.0)
        assert (place[:, 0] > 0).all()
        assert (place[:, 0] < 1).all()


def test_a_load_without_equilibrium_says_so(columns, monkeypatch):
    monkeypatch.setattr(solve, "ITERATIONS", 0)
    with pytest.raises(solve.NotConvergedError, match="within 0 iterations"):
        columns.path([0.05], lambda load, u: None)


def test_a_face_is_one_chain():
    mesh, _ = blocks(2, 2, 0.1)
    part = solids(mesh, {"low": (K, MU)})
    assert len(part.body.cells) == 4
    chain = part.face(lambda x: x[0] > 1e-9)
    assert part.body.X_ni[chain[:, 1]].tolist() == [
        [0.25, 0.0], [0.75, 0.0], [1.0, 0.25], [1.0, 0.75], [0.75, 1.0], [0.25, 1.0]]  # fmt: skip
    for where in (lambda x: False, lambda x: True, lambda x: abs(x[1] - 0.5) > 0.4):
        with pytest.raises(ValueError, match="one open chain"):
            part.face(where)


def test_box_and_cbox_before_they_touch():
    """Both start with the stiffness of the solid alone; nothing touches."""
    box = studies.box([20, 5], [0.001, 0.002], 1e3)
    assert box["touching"] == [0, 0]
    assert box["reactions"][1] / box["reactions"][0] == pytest.approx(2.0, abs=0.01)
    assert box["gaps"] == pytest.approx([0.3 - 0.001, 0.3 - 0.002], abs=3e-4)
    cbox = studies.cbox([10, 5], [0.01], 1e3)
    assert cbox["touching"] == [0]
    assert cbox["reactions"][0] > 0
    assert cbox["gaps"][0] == pytest.approx(0.3 - 0.01, abs=1e-3)


@pytest.mark.slow
def test_box_has_the_reaction_of_another_program():
    """Of an independent program with the same mesh, penalty and faces."""
    found = studies.box([20, 10], [0.4, 0.7], 1e4)
    assert found["reactions"] == pytest.approx([0.011146, 0.025534], rel=2e-4)


def test_pages_extrapolate_with_the_powers_of_gamma_and_of_the_penalty():
    assert verification.limit([7.0, *(2 + 3 * gamma**0.6 for gamma in (1e-4, 1e-5))]) == pytest.approx(2.0, rel=1e-13)
    assert verification.stiff(5 - 2 / 1e3, 5 - 2 / 1e4) == pytest.approx(5.0, rel=1e-13)


def fake(function, *arguments):
    """Reactions that exceed conventional ones by gamma^0.6, which lack 1 over the penalty."""
    if function is medium.limits:
        _, _, gamma, loads = arguments
        at = [[-load * (1 + (gamma * part) ** 0.6) for part in (1.0, 0.1, 0.01)] for load in loads]
        return [{"at": a, "limit": -load, "uncertainty": 0.01 * load} for load, a in zip(loads, at, strict=True)]
    if function is medium.hertz:
        return dict.fromkeys(("force", "half_width", "peak"), 2.0 * (1 + arguments[0] ** 0.6))
    if function is studies.hertz:
        return dict.fromkeys(("force", "half_width", "peak"), 2.0 * (1 - 1 / arguments[1]))
    _, loads, penalty, points = arguments
    return {"reactions": [load * (1 - 1 / penalty) * (1.01 if points == "gauss 10" else 1) for load in loads]}


def test_pages_compare_medium_limit_and_conventional_contact():
    row = verification.reactions(fake).splitlines()[3]
    assert row.split(" | ")[0].strip("| ") == "box, u_y = -0.7"
    assert row.split(" | ")[1] == "1e-04"
    assert ["(+0.40 %)" in cell for cell in row.split(" | ")[2:5]] == [True, False, False]
    assert row.split(" | ")[5] == "7.00000e-01 (+0.00 %) ± 1.00 %"
    assert row.split(" | ")[6:] == ["7.00000e-01", "1.00 % |"]
    last = verification.reactions(fake).splitlines()[-1]
    assert last.split(" | ")[:2] == ["| C-box, u_y = -0.5", "3e-04"]
    force = verification.hertz(fake).splitlines()[2].split(" | ")
    assert force[4:6] == ["2.00000 (+0.00 %)", "2.00000"]
    width = verification.hertz(fake).splitlines()[3].split(" | ")[-1]
    assert float(width.strip("| ")) == pytest.approx(np.sqrt(4 * 2 * 2.0 / (np.pi * 1000 / (2 * 0.91))), abs=1e-5)


def test_a_step_that_turns_cells_inside_out_is_refused(monkeypatch):
    monkeypatch.setattr(solve, "SMALLEST_STEP", 1.0)  # whole steps only
    body = mixed()
    held = {2 * n + i: -float(i == 1 and body.X_ni[n, 1] > 0.8) for n in range(len(body.X_ni)) for i in (0, 1)
            if body.X_ni[n, 1] > 0.8 or body.X_ni[n, 1] == 0.0}  # fmt: skip
    system = System(body, [], held)
    with pytest.raises(solve.NotConvergedError, match="turned inside out"):
        system.equilibrium(np.zeros(2 * len(body.X_ni)), 2.0)
    assert np.isfinite(system.energy(system.equilibrium(np.zeros(2 * len(body.X_ni)), 0.1)))
