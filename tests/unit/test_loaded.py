"""Forces on both discretisations: derivatives, closed forms, and that both say the same."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from helpers_forces import (
    KINDS,
    METHODS,
    ROLLERS,
    SOLID,
    Float,
    Squared,
    cavity_plate,
    discretised,
    interpolated,
    plate,
    random,
    renamed,
    ring,
    smooth,
)
from helpers_system import dense, rates

from tmc_vem.mesh import PolygonMesh
from tmc_vem.solve.newton import NewtonSolver
from tmc_vem.support.errors import InputError
from tmc_vem.system.constraints import Prescribed
from tmc_vem.system.control import Control
from tmc_vem.system.forces import (
    BodyForce,
    CavityPressure,
    FollowerPressure,
    Force,
    PointForce,
    Spring,
    Traction,
)
from tmc_vem.system.loaded import with_forces


@dataclass(frozen=True)
class Late:
    """A pulse long after load factor 1."""

    def at(self, position: Control) -> float:
        return float(700.0 < position.load < 800.0)

    def per_load(self, position: Control) -> float:
        return 0.0


@pytest.fixture(scope="module")
def bare() -> dict[str, Any]:
    return {method: discretised(method, cavity_plate()) for method in METHODS}


@pytest.mark.parametrize("kind", KINDS)
def test_derivatives_of_the_work_are_exact(bare: dict[str, Any], kind: str) -> None:
    """The potential less that of the body alone is quadratic: its differences are known exactly."""
    force = replace(KINDS[kind], amplitude=Squared())
    body, h = bare["vem"], 0.25
    system = with_forces(body, [force])
    system.set_position(Control(1.5))
    u, d, moved = interpolated(body, smooth), random(body, 0.1, 3), system.create_vector()
    moved.waxpy(h, d, u)
    gradient, alone, product, plain = (system.create_vector() for _ in range(4))
    start, without = system.residual(u, gradient), body.residual(u, alone)
    gradient.axpy(-1.0, alone)
    matrix, tangent = system.create_matrix(), system.create_matrix()
    body.jacobian(u, tangent)
    body.tangent_action(d, plain)
    system.jacobian(u, matrix)
    system.tangent_action(d, product)
    product.axpy(-1.0, plain)
    change = (system.energy(moved).energy - body.energy(moved).energy) - (start.energy - without.energy)
    slope = gradient.dot(d)
    assert change == pytest.approx(h * slope + 0.5 * h**2 * product.dot(d), rel=1e-9)
    assert abs(slope) > 1e-4
    # the matrix has it where nothing is prescribed, and the identity elsewhere
    added, free = dense(matrix) - dense(tangent), np.ones(len(d.getArray()), dtype=bool)
    held = system.constrained()
    free[held] = False
    assert not added[held].any()
    assert not added[:, held].any()
    inner = d.copy()
    inner.getArray()[held] = 0.0
    system.tangent_action(inner, product)
    body.tangent_action(inner, plain)
    product.axpy(-1.0, plain)
    assert (added @ inner.getArray())[free] == pytest.approx(product.getArray()[free], abs=1e-12)
    is_linear = kind in ("point force", "traction", "body force")
    assert (abs(added).max() > 1e-3) == (not is_linear)
    # per load factor, amplitude load^2; the potential at the reference state is that of the body
    zero, out = system.create_vector(), system.create_vector()
    assert system.energy(zero).energy == body.energy(zero).energy
    system.add_residual_per_load(u, Control(1.5), out)
    out.axpy(-2.0 / 1.5, gradient)
    assert out.norm() == pytest.approx(0.0, abs=1e-13)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("kind", KINDS)
def test_taylor_rates_with_the_body(bare: dict[str, Any], kind: str, method: str) -> None:
    """Of the whole potential: 2 with the gradient, 3 with the tangent as well; 2 of the gradient with the tangent."""
    if method == "fem":
        pytest.importorskip("dolfinx")
    system = with_forces(bare[method], [KINDS[kind]])
    system.set_position(Control(2.0))
    start, d = (interpolated(bare[method], field) for field in (smooth, lambda x: x @ [[0.5, 0.3], [-0.4, 0.6]]))
    gradient, moved, at_moved, product = (system.create_vector() for _ in range(4))
    energy = system.residual(start, gradient).energy
    system.jacobian(start, system.create_matrix())
    system.tangent_action(d, product)
    slope, curvature = gradient.dot(d), product.dot(d)
    sizes, left = (0.1, 0.05, 0.025), []
    for h in sizes:
        moved.waxpy(h, d, start)
        change = system.residual(moved, at_moved).energy - energy
        at_moved.axpy(-1.0, gradient)
        at_moved.axpy(-h, product)
        left.append((abs(change - h * slope), abs(change - h * slope - 0.5 * h**2 * curvature), at_moved.norm()))
    for values, rate in zip(np.transpose(left), (2.0, 3.0, 2.0), strict=True):
        assert rates(sizes, values.tolist()) == pytest.approx([rate, rate], abs=0.25)


def test_the_tangent_is_that_of_the_position_where_it_was_made(bare: dict[str, Any]) -> None:
    body = bare["vem"]
    system = with_forces(body, [CavityPressure("air", "hole", 1.0)])
    u, d, at_one, later, plain = (system.create_vector() for _ in range(5))
    d = random(body, 1.0, 5)
    system.set_position(Control(1.0))
    system.jacobian(u, system.create_matrix())
    system.tangent_action(d, at_one)
    body.tangent_action(d, plain)
    system.set_position(Control(0.5))
    system.tangent_action(d, later)
    assert (later - at_one).norm() == 0.0
    system.jacobian(u, system.create_matrix())
    system.tangent_action(d, later)
    assert (2.0 * (later - plain) - (at_one - plain)).norm() == pytest.approx(0.0, abs=1e-12)
    assert (at_one - plain).norm() > 0.01


@pytest.mark.parametrize("order", [2, 3])
def test_both_methods_say_the_same_of_a_displacement(order: int) -> None:
    """A polynomial that both represent exactly: forces, moments, work and area agree."""
    pytest.importorskip("dolfinx")
    forces = [replace(force, name=kind) for kind, force in KINDS.items()]
    measured = []
    for method in METHODS:
        system = with_forces(discretised(method, cavity_plate(), order=order), forces)
        measured.append(system.measures(interpolated(system, smooth), Control(0.8)))
    vem, fem = measured
    assert list(vem) == list(KINDS)
    for kind in KINDS:
        assert vem[kind] == pytest.approx(fem[kind], rel=1e-9, abs=1e-12), kind


def stretched(x: Float) -> Float:
    """By 1.5 in x, by 0.8 in y, and sheared."""
    return x @ (np.array([[1.5, 0.25], [0.0, 0.8]]).T - np.eye(2))


@pytest.mark.parametrize("method", METHODS)
def test_measures_by_hand(method: str) -> None:
    """A homogeneous deformation of a plate 2 x 1: resultants at their places, moments about the origin, work, areas."""
    forces = [
        PointForce("push", "pair", (3.0, -2.0)),
        Traction("wind", "right", (0.5, 1.0)),
        BodyForce("weight", ("block",), (0.25, -1.0)),
        Spring("bedding", "top", (2.0, 4.0)),
        Spring("foot", "pair", (1.0, 3.0)),
    ]
    system = with_forces(discretised(method, plate(2, 2, 2.0)), forces)
    found = system.measures(interpolated(system, stretched), Control(0.5))
    # x = 1.5 X + 0.25 Y, y = 0.8 Y
    low, high = np.array([3.0, 0.0]), np.array([3.25, 0.8])
    assert found["push"] == pytest.approx({
        "force_x": 3.0, "force_y": -2.0, "moment": 0.5 * (3.0 * -2.0 + (3.25 * -2.0 - 0.8 * 3.0)), "amplitude": 0.5,
        "potential": 3.0 * (1.0 + 1.25) - 2.0 * (0.0 - 0.2),
    })  # fmt: skip
    middle = 0.5 * (low + high)
    assert found["wind"] == pytest.approx({
        "force_x": 0.25, "force_y": 0.5, "moment": middle[0] * 0.5 - middle[1] * 0.25, "amplitude": 0.5,
        "potential": 0.5 * 1.125 + 1.0 * -0.1,
    })  # fmt: skip
    assert found["weight"] == pytest.approx({
        "force_x": 0.25, "force_y": -1.0, "moment": 1.625 * -1.0 - 0.4 * 0.25, "amplitude": 0.5,
        "potential": 2.0 * (0.25 * 0.625 + 1.0 * 0.1),
    })  # fmt: skip
    # along the top u = 0.25 + s/2, v = -0.2 with s from 0 to 2
    energy = 0.5 * 2.0 * (1.25**3 - 0.25**3) / 1.5 + 0.5 * 4.0 * 0.04 * 2.0
    moment = 0.8 * 2.0 * 1.5 + 4.0 * 0.2 * 2.0 * 1.75
    assert found["bedding"] == pytest.approx({
        "force_x": -2.0 * 1.5, "force_y": 4.0 * 0.2 * 2.0, "moment": moment, "amplitude": 1.0, "potential": -energy,
        "energy": energy,
    })  # fmt: skip
    assert found["foot"]["energy"] == pytest.approx(0.5 * (1.0 + 1.25**2 + 3.0 * 0.04))
    assert (found["foot"]["force_x"], found["foot"]["force_y"]) == pytest.approx((-2.25, 0.6))


@pytest.mark.parametrize("method", METHODS)
def test_the_area_of_a_cavity_is_known(method: str) -> None:
    """A polygon with 8 corners; homogeneous, and with sides that become parabolas."""
    system = with_forces(discretised(method, ring(8), ()), [CavityPressure("air", "inner", 2.0)])
    polygon = 8 * 0.5 * np.sin(2 * np.pi / 8)
    found = system.measures(interpolated(system, stretched), Control(0.5))["air"]
    assert found["area_at_start"] == pytest.approx(polygon)
    assert found["area"] == pytest.approx(1.5 * 0.8 * polygon)
    assert found["potential"] == pytest.approx(2.0 * 0.2 * polygon)
    assert (found["pressure"], found["amplitude"]) == (1.0, 0.5)
    assert [found[name] for name in ("force_x", "force_y", "moment")] == pytest.approx([0.0] * 3, abs=1e-14)
    # x + c (y^2 - x^2), y - 2 c x y: the determinant is 1 - 4 c x + 4 c^2 (x^2 - y^2) ... integrated over the boundary
    c, s = 0.2, np.linspace(0.0, 1.0, 5)
    u = interpolated(system, lambda x: c * np.column_stack([x[:, 1] ** 2 - x[:, 0] ** 2, -2.0 * x[:, 0] * x[:, 1]]))
    corners = np.array([(np.cos(a), np.sin(a)) for a in 2 * np.pi * np.arange(9) / 8])
    total = 0.0
    for start, end in pairwise(corners):
        X, Y = start[:, None] + (end - start)[:, None] * s
        x, y = (np.polyfit(s, values, 2) for values in (X + c * (Y**2 - X**2), Y - 2.0 * c * X * Y))
        integrand = np.polysub(np.polymul(x, np.polyder(y)), np.polymul(y, np.polyder(x)))
        total += 0.5 * float(np.polyval(np.polyint(integrand), 1.0))
    area = system.measures(u, Control(0.5))["air"]["area"]
    assert area == pytest.approx(total, rel=1e-12)
    assert abs(area / polygon - 1.0) > 0.01


# -- what is in equilibrium --------------------------------------------------------------------------------------------


def solved(system: Any, load: float = 1.0, steps: int = 1) -> tuple[Any, Any]:
    """Equilibrium at a load factor, and how it was found."""
    solver, u, out = NewtonSolver(system), system.create_vector(), system.create_vector()
    for n in range(1, steps + 1):
        assert solver.predict(u, Control(load * n / steps), out)
        result = solver.solve(out)
        assert result.converged, result.reason
        out.copy(u)
    return u, result


def stress(method: str, F: Float) -> Float:
    """P = dW/dF by differences of the energy of a homogeneous deformation."""
    system = discretised(method, plate(1, 1), ())

    def energy(F: Float) -> float:
        return float(system.energy(interpolated(system, lambda x: x @ (F - np.eye(2)).T)).energy)

    P, h = np.zeros((2, 2)), 1e-4
    for i in range(2):
        for j in range(2):
            step = np.zeros((2, 2))
            step[i, j] = h
            near = energy(F + step) - energy(F - step)
            P[i, j] = (8.0 * near - (energy(F + 2 * step) - energy(F - 2 * step))) / (12.0 * h)
    return P


@pytest.mark.parametrize("method", METHODS)
def test_constant_tractions_give_a_constant_stress(method: str) -> None:
    F = np.diag([1.3, 0.9])
    P = stress(method, F)
    forces = [Traction("pull", "right", (P[0, 0], 0.0)), Traction("press", "top", (0.0, P[1, 1]))]
    system = with_forces(discretised(method, plate(3, 2, 2.0, bent=0.05)), forces)
    u, result = solved(system, steps=2)
    exact = interpolated(system, lambda x: x @ (F - np.eye(2)).T)
    exact.axpy(-1.0, u)
    assert exact.norm(3) < 1e-8
    # the supports' forces are those on the other side
    assert system.reaction(result.residual, "left", 0) == pytest.approx(-P[0, 0], rel=1e-8)
    assert system.reaction(result.residual, "bottom", 1) == pytest.approx(-2.0 * P[1, 1], rel=1e-8)
    assert result.evaluation.springs == {}


@pytest.mark.parametrize("method", METHODS)
def test_springs_alone_hold_a_body(method: str) -> None:
    """Stretched by a traction between rollers and springs; and hanging on springs, without any reaction."""
    P = stress(method, np.diag([1.2, 1.0]))
    k = P[0, 0] / 0.2
    held = (*ROLLERS, Prescribed("top", 1))
    pull, pad = Traction("pull", "right", (2.0 * P[0, 0], 0.0)), Spring("pad", "right", (k, 0.0))
    system = with_forces(discretised(method, plate(2, 2), held), [pull, pad])
    u, result = solved(system, steps=2)
    assert system.point_displacements(u, ["tip"])[0] == pytest.approx([0.2, 0.0], abs=1e-8)
    assert result.evaluation.springs == pytest.approx({"pad": 0.5 * k * 0.04})
    assert system.reaction(result.residual, "left", 0) == pytest.approx(-P[0, 0], rel=1e-8)
    free = discretised(method, plate(2, 2), ())
    forces = [BodyForce("weight", ("block",), (0.0, -0.04)), Spring("bed", "bottom", (1.0, 2.0))]
    hanging = with_forces(free, forces)
    u, result = solved(hanging)
    found = hanging.measures(u, Control(1.0))
    assert found["bed"]["force_y"] == pytest.approx(0.04, rel=1e-8)
    assert result.evaluation.springs["bed"] == found["bed"]["energy"] > 0.0
    assert result.evaluation.energy == pytest.approx(
        sum(of.energy for of in result.evaluation.regions.values())
        + found["bed"]["energy"]
        - found["weight"]["potential"]
    )


def test_how_much_forces_contribute_is_the_larger_of_loads_and_springs(bare: dict[str, Any]) -> None:
    """Two point forces of norm 5 at two points are 5 sqrt 2; springs that pull back less or more."""
    pair, u = PointForce("f", "pair", (3.0, -4.0)), interpolated(bare["vem"], lambda x: np.ones_like(x))
    for k, norm in ((0.0, 50.0), (3.0, 50.0), (6.0, 2 * 2 * 36.0)):
        system = with_forces(bare["vem"], [pair, Spring("k", "pair", (k, k))])
        system.set_position(Control(1.0))
        assert system.energy(u).forces ** 2 == pytest.approx(norm)


@pytest.mark.parametrize("method", METHODS)
def test_a_ring_under_inner_pressure_opens_as_lame_says(method: str) -> None:
    """Small pressure in a ring's cavity, and on a quarter's inner chain; polygons differ from circles by h^2."""
    pressure, mu, K = 1e-4, SOLID.values["mu"], SOLID.values["K"]
    nu = (3 * K - 2 * mu) / (6 * K + 2 * mu)
    exact = pressure / (2.0 * mu * (4.0 - 1.0)) * ((1.0 - 2.0 * nu) + 4.0)
    n = 32
    hold = [Prescribed("east", 1), Prescribed("west", 1), Prescribed("north", 0)]
    system = with_forces(discretised(method, ring(n), hold), [CavityPressure("air", "inner", pressure)])
    u, _ = solved(system)
    found = system.point_displacements(u, ["east", "north", "west"])
    assert found == pytest.approx(exact * np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]]), abs=0.01 * exact)
    quarter = ring(n // 4 * 4, part=0.25)
    quarter = PolygonMesh(
        quarter.points_vx, quarter.cell_offsets, quarter.cell_vertices, quarter.region_c, quarter.region_names,
        {"east": 0, "north": n}, quarter.named_edges,
    )  # fmt: skip
    roll = [Prescribed("start", 1), Prescribed("end", 0)]
    system = with_forces(discretised(method, quarter, roll), [FollowerPressure("air", "inner", pressure)])
    u, _ = solved(system)
    found = system.point_displacements(u, ["east", "north"])
    assert found == pytest.approx(exact * np.eye(2), abs=0.002 * exact)


def test_pressure_that_follows_has_the_force_of_what_it_pushes(bare: dict[str, Any]) -> None:
    """p times the chord, whatever the shape, with the body on its left; at held ends as well: reactions are true ones.

    Its moment about the origin is p (x x' + y y') along the chain, half the change of the square of the distance.
    """
    system = with_forces(bare["vem"], [FollowerPressure("water", "corner", 0.5)])
    ends = np.array([[1.0, 0.0], [0.0, 1.0]])

    def held(x: Float) -> Float:
        return smooth(x) * x  # ux = 0 on the left, uy = 0 at the bottom

    found = system.measures(interpolated(bare["vem"], held), Control(0.5))["water"]
    (x, y), (z, w) = ends + held(ends)
    assert (found["force_x"], found["force_y"]) == pytest.approx((-0.25 * (w - y), 0.25 * (z - x)), rel=1e-12)
    assert found["moment"] == pytest.approx(0.125 * (z * z + w * w - x * x - y * y), rel=1e-12)
    assert (found["pressure"], found["amplitude"]) == (0.25, 0.5)
    assert "area" not in found


# -- what is refused ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("force", "said"),
    [
        (PointForce("f", "nowhere", (1.0, 0.0)), "f: the mesh has neither a point nor edges named 'nowhere'"),
        (
            PointForce("f", "right", (1.0, 0.0)),
            "f: 'right' are edges, and a point force acts at points: use a traction",
        ),
        (Traction("f", "tip", (1.0, 0.0)), "f: the mesh has no edges named 'tip'"),
        (Spring("f", "nowhere", (1.0, 0.0)), "f: the mesh has neither a point nor edges named 'nowhere'"),
        (BodyForce("f", ("hole",), (1.0, 0.0)), r"f: the mesh has no region 'hole' \(it has: block\)"),
        (CavityPressure("f", "nowhere", 1.0), "f: the mesh has no edges named 'nowhere'"),
        (CavityPressure("f", "right", 1.0), r"f: the edges 'right' do not close, they end at \(1, 0\) and \(1, 1\)"),
        (
            FollowerPressure("f", "right", 1.0),
            r"f: the edges 'right' end at \(1, 1\), where no support holds ux or uy at 0: a pressure",
        ),
    ],
)
def test_what_is_not_there_is_refused(bare: dict[str, Any], method: str, force: Force, said: str) -> None:
    if method == "fem":
        pytest.importorskip("dolfinx")
    with pytest.raises(InputError, match=f"^{said}"):
        with_forces(bare[method], [force])


def test_forces_may_be_added_to_forces(bare: dict[str, Any]) -> None:
    """Two after another are both at once."""
    first, second = replace(KINDS["traction"], name="g"), KINDS["cavity"]
    once, twice = with_forces(bare["vem"], [first, second]), with_forces(with_forces(bare["vem"], [first]), [second])
    u, found = interpolated(bare["vem"], smooth), []
    for system in (once, twice):
        system.set_position(Control(0.6))
        gradient, per_load = system.create_vector(), system.create_vector()
        energy = system.residual(u, gradient).energy
        system.add_residual_per_load(u, Control(0.6), per_load)
        found.append((energy, gradient.norm(), per_load.norm()))
    assert found[0] == pytest.approx(found[1], rel=1e-13)


def test_names_are_given_once(bare: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="two forces are called 'f': give each a name of its own"):
        with_forces(bare["vem"], [KINDS["traction"], PointForce("g", "tip", (1.0, 0.0)), KINDS["springs"]])
    assert with_forces(bare["vem"], []) is bare["vem"]


def test_an_end_that_moves_is_not_held() -> None:
    """A component that is prescribed but not 0 holds no end, also if it moves late; the other one may."""
    corner = FollowerPressure("f", "right", 1.0)
    for amplitude in (Squared(), Late()):
        moving = (*ROLLERS, Prescribed("top", 0, 0.1, amplitude))
        with pytest.raises(InputError, match=r"end at \(1, 1\)"):
            with_forces(discretised("vem", plate(), moving), [corner])
    held = (*moving, Prescribed("top", 1))
    assert with_forces(discretised("vem", plate(), held), [corner]).measures


def test_pressure_between_solid_and_medium_is_on_the_solid() -> None:
    """Two cells side by side; the right one is called medium: the pressure pushes the left one to the left."""
    mesh = plate(2, 1)
    line = mesh.edges.vertices_ev[mesh.edges.n_cells_e == 2]
    two = replace(renamed(mesh, between=line), region_c=np.array([0, 1]), region_names=("solid", "soft"))
    held = (*ROLLERS, Prescribed("top", 1))
    for media, sign in ((["soft"], -1.0), (["solid"], 1.0)):
        system = with_forces(discretised("vem", two, held), [FollowerPressure("f", "between", 2.0)], media)
        found = system.measures(system.create_vector(), Control(1.0))["f"]
        assert (found["force_x"], found["force_y"]) == pytest.approx((sign * 2.0, 0.0))


@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("method", METHODS)
def test_a_body_force_acts_on_its_regions(method: str, order: int) -> None:
    """On the second of two columns of cells: its area, and a moment about its middle, at x = 0.75."""
    two = replace(plate(2, 2), region_c=np.array([0, 1, 0, 1]), region_names=("solid", "soft"))
    body = discretised(method, two, order=order)
    system = with_forces(body, [BodyForce("f", ("soft",), (2.0, 4.0)), BodyForce("g", ("soft", "solid"), (0.0, 1.0))])
    found = system.measures(system.create_vector(), Control(1.0))
    assert [found["f"][key] for key in ("force_x", "force_y", "moment")] == pytest.approx([1.0, 2.0, 1.5 - 0.5])
    assert [found["g"][key] for key in ("force_x", "force_y", "moment")] == pytest.approx([0.0, 1.0, 0.5], abs=1e-14)


def test_triangles_of_finite_elements_have_the_same_sides() -> None:
    pytest.importorskip("dolfinx")
    from mpi4py import MPI

    from tmc_vem.fem.system import FemSystem
    from tmc_vem.system.fem_settings import FemSettings

    system = FemSystem(MPI.COMM_SELF, cavity_plate, {"block": SOLID}, ROLLERS, FemSettings(triangles=True))
    forces = [replace(force, name=kind) for kind, force in KINDS.items()]
    found = with_forces(system, forces).measures(system.interpolate(smooth), Control(0.8))
    squares: Any = discretised("vem", cavity_plate())
    expected = with_forces(squares, forces).measures(interpolated(squares, smooth), Control(0.8))
    for kind in KINDS:
        assert found[kind] == pytest.approx(expected[kind], rel=1e-9, abs=1e-12), kind
