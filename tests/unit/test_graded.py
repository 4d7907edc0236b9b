"""Parameters that vary from cell to cell: in kernels, on sides, in formulas of problem files, on any ranks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers_mesh import grid, voronoi
from helpers_penalty import bricks
from helpers_system import CLAMPED, dense, interpolate, make_system

from codegen.integrand import second_gradient_energy
from codegen.kernel import GRADIENT, TANGENT, compile_energy
from tmc_vem import Material, Medium, run
from tmc_vem.energy.registry import DENSITIES
from tmc_vem.mesh import PolygonMesh
from tmc_vem.problems.base import RegionEnergy, medium_region, solid_region
from tmc_vem.problems.graded import ByFormulas, OfMedium, OfParameters, OfSolid, check_cells
from tmc_vem.simulation.discretised import _kernels
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.support.errors import InputError
from tmc_vem.vem.kernel.cells import compile_cells
from tmc_vem.vem.spaces.element_settings import ElementSettings

MEDIUM = Medium(gamma=0.3, alpha_r=0.7, beta=2.0, regulariser="angle")
HALVES = "where(x < 0.5, 1, 3)"


def wavy(x: Any) -> Any:
    return 0.1 * np.stack([np.sin(2.0 * x[:, 0] + x[:, 1]), np.cos(x[:, 0] - 2.5 * x[:, 1])], axis=1)


def halves(mesh: PolygonMesh) -> PolygonMesh:
    centre = np.array([mesh.points_vx[mesh.cell(c)].mean(axis=0) for c in range(mesh.n_cells)])
    return replace(mesh, region_c=(centre[:, 0] > 0.5).astype(np.int64), region_names=("left", "right"))


def values_of(mesh: PolygonMesh, regions: dict[str, RegionEnergy], penalty: str = "none") -> tuple[float, Any, Any]:
    """Energy, residual and tangent at a wavy state."""
    settings = ElementSettings(interior_penalty=penalty)
    kernels = {name: _kernels(name, region, settings) for name, region in regions.items()}
    system = make_system(mesh, kernels, CLAMPED, settings)
    u, out, tangent = interpolate(system, wavy), system.create_vector(), system.create_matrix()
    energy = system.residual(u, out).energy
    system.jacobian(u, tangent)
    tangent.assemble()
    assert system.energy(u).energy == pytest.approx(energy, rel=1e-14)
    return energy, out.getArray().copy(), dense(tangent)


@pytest.mark.parametrize("make", [lambda: grid(4, 3), lambda: voronoi(23)], ids=["squares", "voronoi"])
def test_a_graded_region_is_many_regions(make: Any) -> None:
    """A solid and a medium whose numbers jump in the middle are two solids and two media; packs of eight mix cells."""
    mesh = halves(make())
    factor = {"left": 1.0, "right": 3.0}
    one = replace(mesh, region_c=np.zeros_like(mesh.region_c), region_names=("all",))
    cases = [
        (solid_region(Material(K=3.0, mu=1.5), graded={"mu": f"mu * {HALVES}"}),
         {name: solid_region(Material(K=3.0, mu=1.5 * f)) for name, f in factor.items()}),
        (medium_region(MEDIUM, 1.5, graded={"gamma": f"gamma * {HALVES}", "beta": f"beta / {HALVES}"}),
         {name: medium_region(replace(MEDIUM, gamma=0.3 * f, beta=2.0 / f), 1.5) for name, f in factor.items()}),
    ]  # fmt: skip
    for graded, split in cases:
        for made, wanted in zip(values_of(one, {"all": graded}), values_of(mesh, split), strict=True):
            assert made == pytest.approx(wanted, rel=1e-13, abs=1e-13)


@pytest.mark.parametrize("kind", ["penalty", "full"])
def test_sides_take_the_mean_of_their_two_cells(kind: str) -> None:
    """The energy is linear in gamma: that of a field is the sum of its cells', and of a uniform one the usual one."""
    mesh = bricks(2)
    of = [f"{v + 1} * x + {v}" for v in range(2)]

    def energy(formula: str | None) -> tuple[float, Any, Any]:
        region = medium_region(MEDIUM, 1.5, graded=None if formula is None else {"gamma": f"gamma * ({formula})"})
        return values_of(mesh, dict.fromkeys(mesh.region_names, region), kind)

    for made, wanted in zip(energy("2"), energy(None), strict=True):
        assert made == pytest.approx(2.0 * np.asarray(wanted) - (np.asarray(wanted) == 1.0), rel=1e-12, abs=1e-12)
    first, second, both = energy(of[0]), energy(of[1]), energy(f"{of[0]} + ({of[1]})")
    assert both[0] == pytest.approx(first[0] + second[0], rel=1e-13)
    assert both[1] == pytest.approx(first[1] + second[1], rel=1e-12, abs=1e-13)
    assert first[0] != pytest.approx(second[0], rel=1e-3)


def test_the_level_of_a_field_is_the_number_of_the_region() -> None:
    """Continuation sets gamma: the field keeps its shape."""
    mesh = grid(3, 3)
    region = medium_region(MEDIUM, 1.5, graded={"gamma": "gamma * (1 + x)"})
    system = make_system(mesh, _kernels("all", region, ElementSettings()), CLAMPED)
    u = interpolate(system, wavy)
    before, without = system.energy(u).energy, system.cell_energies(u, "gamma")
    system.set_parameters({"gamma": 0.6})
    assert system.energy(u).energy == pytest.approx(2.0 * before, rel=1e-14)
    assert without == pytest.approx(0.0, abs=1e-300)


def test_kernels_know_what_varies() -> None:
    energy = DENSITIES["solid"]
    plain = second_gradient_energy(energy.density, "solid", energy.parameters)
    varying = plain.varying(["K"])
    assert plain.parameter_names == ("K", "mu")
    assert plain.n_varying == 0
    assert varying.parameter_names == ("mu", "K")
    assert varying.n_varying == 1
    assert [p.varies for p in varying.parameters] == [False, True]
    assert plain.varying(["mu", "K"]).parameter_names == ("mu", "K")
    cells = compile_cells(varying)
    assert cells.parameters == ("mu", "K")
    assert cells.n_varying == 1
    state = np.random.default_rng(1).uniform(-0.2, 0.2, (11, 12))
    usual = compile_energy(energy.density, "solid", energy.parameters)
    for level in (GRADIENT, TANGENT):
        made = cells.points(level, state, cells.parameter_array({"K": 3.0, "mu": 1.5}))
        wanted = usual.points(level, state, usual.parameter_array({"K": 3.0, "mu": 1.5}))
        for a, b in zip(made[: level + 1], wanted[: level + 1], strict=True):
            assert np.array_equal(a, b)


def test_a_batch_without_factors_is_refused() -> None:
    mesh = grid(2, 2)
    region = solid_region(Material(K=3.0, mu=1.5), graded={"mu": "mu * (1 + x)"})
    system = make_system(mesh, _kernels("all", region, ElementSettings()))
    block = system.blocks[0]
    u = np.zeros((system.dofmap.n_nodes, 2))
    for factor in (None, np.ones((3, 1)), np.ones((4, 2))):
        with pytest.raises(ValueError, match=r"factor_ck of energy 'solid' has shape .*expected \(4, 1\)"):
            block.kernel.cells(replace(block.batch, factor_ck=factor), u, block.parameters)


# -- formulas ----------------------------------------------------------------------------------------------------------

PLACES = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, 2.0], [0.25, 0.5]])
GIVEN = {
    "two moduli": {"K": 20.0, "mu": 10.0},
    "technical": {"E": 26.0, "nu": 0.3}, "E and lambda": {"E": 26.0, "lambda_": 9.0},
    "K and E": {"K": 20.0, "E": 26.0}, "K and nu": {"K": 20.0, "nu": 0.3}, "K and lambda": {"K": 20.0, "lambda_": 9.0},
    "mu and E": {"mu": 10.0, "E": 26.0},
    "mu and nu": {"mu": 10.0, "nu": 0.3}, "mu and lambda": {"mu": 10.0, "lambda_": 9.0},
    "nu and lambda": {"nu": 0.3, "lambda_": 9.0}, "gent": {"model": "gent", "E": 26.0, "nu": 0.3, "J_m": 30.0},
    "yeoh": {"model": "yeoh", "c1": 5.0, "c2": -0.02, "c3": 0.003, "nu": 0.4},
    "mooney": {"model": "mooney_rivlin", "c10": 2.0, "E": 26.0, "nu": 0.3},
    "mooney by constants": {"model": "mooney_rivlin", "c10": 2.0, "c01": 3.0, "K": 20.0},
    "chains": {"model": "arruda_boyce", "mu_r": 9.0, "lambda_m": 3.0, "K": 20.0},
    "svk": {"model": "saint_venant_kirchhoff", "E": 26.0, "nu": 0.3},
}  # fmt: skip


@pytest.mark.parametrize("name", GIVEN)
def test_cells_have_the_material_that_their_numbers_make(name: str) -> None:
    material = Material(**GIVEN[name])  # type: ignore[arg-type]
    graded = ByFormulas(OfSolid(material), {key: f"{key} * (1 + 0.1 * x - 0.04 * y)" for key in material.numbers})
    factor_cp = graded.factors(PLACES, {})
    assert factor_cp.shape == (4, len(graded.names))
    assert set(graded.names) <= set(material.values)
    for (x, y), factors in zip(PLACES.tolist(), factor_cp.tolist(), strict=True):
        there = material.with_numbers({key: v * (1 + 0.1 * x - 0.04 * y) for key, v in material.numbers.items()})
        made = {key: material.values[key] for key in material.values}
        made |= {key: material.values[key] * f for key, f in zip(graded.names, factors, strict=True)}
        assert made == pytest.approx(there.values, rel=1e-12)


def test_only_what_changes_varies() -> None:
    technical, plain = Material(E=26.0, nu=0.3), Material(K=20.0, mu=10.0)
    assert ByFormulas(OfSolid(technical), {"E": "E * (1 + x)"}).names == ("K", "mu")
    assert ByFormulas(OfSolid(plain), {"mu": "mu * (1 + x)"}).names == ("mu",)
    mooney = Material(model="mooney_rivlin", c10=2.0, c01=3.0, K=20.0)
    assert ByFormulas(OfSolid(mooney), {"c01": "c01 * (1 + x)"}).names == ("c01",)


def test_numbers_of_a_medium() -> None:
    medium = Medium(gamma=1e-3, alpha=2.5, beta=3.0, log_j=0.5)
    given = OfMedium(medium, 10.0, 0.2)
    assert given.numbers == {"mu": 10.0, "gamma": 1e-3, "alpha": 2.5, "beta": 3.0, "log_j": 0.5}
    formulas = {
        "mu": "mu + x",
        "gamma": "gamma * 10 ** y",
        "alpha": "alpha + x",
        "beta": "beta + y",
        "log_j": "0.5 + x",
    }
    graded = ByFormulas(given, formulas)
    assert set(graded.names) == {"mu", "gamma", "alpha_r", "beta", "log_j"}
    (factors,) = graded.factors(np.array([[0.5, 1.0]]), {})
    made = {name: medium.values(10.0, 0.2)[name] * f for name, f in zip(graded.names, factors, strict=True)}
    wanted = {"mu": 10.5, "gamma": 1e-2, "alpha_r": 3.0 * 10.5 * 0.2**2, "beta": 4.0, "log_j": 1.0}
    assert made == pytest.approx(wanted, rel=1e-14)
    assert OfMedium(MEDIUM, 1.5).numbers == {"mu": 1.5, "gamma": 0.3, "alpha_r": 0.7, "beta": 2.0, "log_j": 0.0}
    direct = ByFormulas(OfMedium(MEDIUM, 1.5), {"alpha_r": "alpha_r * x"})
    assert direct.factors(np.array([[0.5, 1.0]]), {}).tolist() == [[0.5]]


def test_cell_data_are_names_in_formulas() -> None:
    graded = ByFormulas(OfParameters({"kappa": 2.0, "l": 1.0}), {"kappa": "modulus * kappa + y"})
    assert graded.factors(PLACES, {"modulus": np.array([1.0, 2.0, 3.0, 4.0])}).ravel().tolist() == [1.0, 2.0, 4.0, 4.25]
    with pytest.raises(InputError, match=r"graded: kappa: formula 'modulus \* kappa \+ y' has no 'modulus'.*it has "):
        graded.factors(PLACES, {"moduli": np.ones(4)})


@pytest.mark.parametrize(
    ("formulas", "message"),
    [
        ({"G": "x"}, "graded has no 'G': it has E, nu"),
        ({"E": "E *"}, "graded: E: 'E *' is no formula"),
        ({"E": "E * (x - 0.5)"}, "graded: in the cell around (0, 0): E = -13 must be a positive number"),
        ({"E": "E / x"}, "graded: E: E / x is inf in the cell around (0, 0)"),
        ({"E": "E * log(y)"}, "graded: E: E * log(y) is -inf in the cell around (0, 0)"),
        ({"nu": "0.3 + x / 4"}, "graded: in the cell around (1, 0): nu = 0.55 must be between -1 and 0.5"),
    ],
)
def test_formulas_that_are_refused(formulas: dict[str, str], message: str) -> None:
    with pytest.raises(InputError) as refused:
        ByFormulas(OfSolid(Material(E=26.0, nu=0.3)), formulas).factors(PLACES, {})
    assert message in str(refused.value)


def test_media_that_are_refused() -> None:
    given = OfMedium(replace(MEDIUM, beta=0.0), 1.5)
    with pytest.raises(InputError, match="graded: beta is 0 in the region: give the number there"):
        ByFormulas(given, {"beta": "x"})
    for name, text in (("gamma", "gamma * (x - 0.5)"), ("mu", "-mu"), ("alpha_r", "0 * x")):
        with pytest.raises(InputError, match=rf"graded: in the cell around \(.*{name} = .* positive"):
            ByFormulas(given, {name: text}).factors(PLACES, {})


def test_numbers_that_are_bad_together_only() -> None:
    """K and E are good everywhere, with their extremes elsewhere, but in one cell there is no solid that has both."""
    graded = ByFormulas(OfSolid(Material(K=20.0, E=26.0)), {"K": "bulk", "E": "young"})
    data = {"bulk": np.array([20.0, 2.0, 5.0, 10.0]), "young": np.array([100.0, 5.0, 60.0, 20.0])}
    with pytest.raises(InputError, match=r"in the cell around \(0.5, 2\): K = 5 and E = 60 make K = 5 and mu = -60,"):
        graded.factors(PLACES, data)
    data["young"][2] = 44.0
    assert graded.factors(PLACES, data).shape == (4, 2)


def test_the_whole_mesh_is_checked_with_its_regions() -> None:
    mesh = halves(grid(4, 2))
    graded = ByFormulas(OfParameters({"kappa": 2.0}), {"kappa": "kappa / (x - 0.625)"})
    check_cells(mesh, {"left": graded, "right": None, "none": graded})
    with pytest.raises(
        InputError, match=r"regions: right: graded: kappa: .* is -?inf in the cell around \(0.625, 0.25\)"
    ):
        check_cells(mesh, {"left": None, "right": graded})
    data = replace(mesh, cell_data={"soft": np.arange(8.0)})
    soft = ByFormulas(OfParameters({"kappa": 2.0}), {"kappa": "1 / (soft - 5)"})  # a cell of the left half
    check_cells(data, {"right": soft})
    with pytest.raises(InputError, match=r"regions: left: graded: .* is inf in the cell around \(0.375, 0.75\)"):
        check_cells(data, {"left": soft})


def test_a_medium_that_is_softer_where_bodies_touch_carries_less(tmp_path: Path) -> None:
    """The example that the documentation shows, with larger cells."""
    text = (Path(__file__).parents[2] / "demos" / "problems" / "finger.toml").read_text()
    assert text.count("size = 0.08") == text.count("graded = { gamma") == 1
    reactions, gaps = [], []
    for number, of in enumerate((text, text.replace("graded = { gamma", "# { gamma"))):
        path = tmp_path / f"{number}.toml"
        path.write_text(of.replace("size = 0.08", "size = 0.12").replace("rounded = 0.05", "rounded = 0"))
        problem, options = read_problem(path)
        result = run(problem, None, options)
        assert result.complete
        reactions.append(result.history[-1].reaction)
        gaps.append(result.history[-1].probes["gap"])
    assert reactions[0] == pytest.approx(-0.112, rel=0.03)  # versions of gmsh make other triangles
    assert 1.05 < reactions[1] / reactions[0] < 1.5
    assert gaps[0] > gaps[1] > 0.0
