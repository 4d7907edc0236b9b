"""Solids by name: what they are given as, what they become, and stresses against closed forms."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from codegen.declare import declaration
from codegen.integrand import second_gradient_energy
from codegen.kernel import GRADIENT
from codegen.oracle import energy_density, gradient
from codegen.out_of_plane import out_of_plane_stress
from codegen.sampling import to_vector
from codegen.verify import verify
from tmc_vem.cli.progress import summary_rows
from tmc_vem.energy import SOLIDS, hyperelastic_solid
from tmc_vem.energy.solids import MODELS, VOLUMETRIC, stiffening
from tmc_vem.problems import Material, Medium, Punch
from tmc_vem.problems.base import RegionEnergy, medium_region, solid_region
from tmc_vem.problems.examine import of_moduli
from tmc_vem.problems.moduli import NAMES, Moduli, moduli
from tmc_vem.problems.own import OwnProblem
from tmc_vem.problems.solids import conversions, softening
from tmc_vem.results.run_result import RunResult
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.support.errors import InputError
from tmc_vem.vem.kernel.cells import compile_cells

K, MU = 20.0, 6.0
GIVEN: dict[str, dict[str, Any]] = {
    "neo_hooke": {"mu": MU},
    "mooney_rivlin": {"mu": MU, "c01": 1.25},
    "yeoh": {"mu": MU, "c2": -0.06, "c3": 0.01},
    "gent": {"mu": MU, "J_m": 25.0},
    "arruda_boyce": {"mu": MU, "lambda_m": 2.5},
    "saint_venant_kirchhoff": {"mu": MU},
}
CASES = [
    (model, volumetric)
    for model in GIVEN
    for volumetric in ((*VOLUMETRIC,) if model in ("neo_hooke", "mooney_rivlin") else ("log",))
]


def material(model: str, volumetric: str = "log") -> Material:
    return Material(K=K, model=model, volumetric=volumetric, **GIVEN[model])


# ---- Closed forms, written in principal stretches: nothing of the densities or of their invariants is used ----------


def pressure(volumetric: str, J: float) -> float:
    """U'(J)."""
    return {
        "log": K * math.log(J) / J,
        "quadratic": K * (J - 1.0),
        "simo_taylor": K / 2.0 * (J - 1.0 / J),
    }[volumetric]


def slopes(model: str, i1: float) -> tuple[float, float]:
    """Derivatives of the isochoric energy by its two invariants."""
    x = i1 - 3.0
    if model == "neo_hooke":
        return MU / 2.0, 0.0
    if model == "mooney_rivlin":
        return MU / 2.0 - 1.25, 1.25
    if model == "yeoh":
        return MU / 2.0 - 2.0 * 0.06 * x + 3.0 * 0.01 * x**2, 0.0
    if model == "gent":
        return MU / 2.0 * 25.0 / (25.0 - x), 0.0
    a = 2.5**-2
    series = [0.5, i1 / 10.0, 11.0 * i1**2 / 350.0, 19.0 * i1**3 / 1750.0, 519.0 * i1**4 / 134750.0]
    at_rest = [0.5, 3 / 10.0, 11.0 * 9 / 350.0, 19.0 * 27 / 1750.0, 519.0 * 81 / 134750.0]
    rubbery = MU / 2.0 / sum(c * a**n for n, c in enumerate(at_rest))
    return rubbery * sum(c * a**n for n, c in enumerate(series)), 0.0


def principal_stresses(model: str, volumetric: str, stretches: tuple[float, float, float]) -> list[float]:
    """First Piola-Kirchhoff stresses ``P_i`` along the principal directions of a diagonal F."""
    if model == "saint_venant_kirchhoff":
        strains = [(s * s - 1.0) / 2.0 for s in stretches]
        lam = K - 2.0 * MU / 3.0
        return [s * (lam * sum(strains) + 2.0 * MU * e) for s, e in zip(stretches, strains, strict=True)]
    J = math.prod(stretches)
    squares = [(s / J ** (1.0 / 3.0)) ** 2 for s in stretches]  # of isochoric stretches
    i1, i2 = sum(squares), sum(1.0 / b for b in squares)
    w1, w2 = slopes(model, i1)
    # Kirchhoff stress: tau_i = J U' + dev(2 w1 b - 2 w2 b^-1)_i
    tau = [J * pressure(volumetric, J) + 2.0 * w1 * (b - i1 / 3.0) - 2.0 * w2 * (1.0 / b - i2 / 3.0) for b in squares]
    return [t / s for t, s in zip(tau, stretches, strict=True)]


def piola(of: Material, F_nij: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """In-plane stress (n, 2, 2) by the complex step of the density, and the stress across the plane (n,)."""
    energy = hyperelastic_solid(of.model, of.volumetric)
    x = to_vector(F_nij, np.zeros((len(F_nij), 2, 2, 2)))
    g = gradient(energy.density, x, of.values)
    across = out_of_plane_stress(second_gradient_energy(energy.density, energy.name, energy.parameters)).stress
    assert across is not None
    return g[:, :4].reshape(-1, 2, 2).swapaxes(1, 2), energy_density(across.function, x, of.values)


def across_free(model: str, volumetric: str, along: float) -> float:
    """Stretch across a uniaxial load in plane strain, the sides free: the closed form's root, by bisection."""
    low, high = 0.2, 3.0
    for _ in range(100):
        middle = (low + high) / 2.0
        positive = principal_stresses(model, volumetric, (along, middle, 1.0))[1] > 0.0
        low, high = (low, middle) if positive else (middle, high)
    return low


@pytest.mark.parametrize(("model", "volumetric"), CASES)
def test_a_confined_strip_has_the_stress_of_the_closed_form(model: str, volumetric: str) -> None:
    """Uniaxial strain, J = lambda from 0.2 to 3: stress along, across and out of the plane."""
    J = np.linspace(0.2, 3.0, 29)
    F = np.zeros((len(J), 2, 2))
    F[:, 0, 0], F[:, 1, 1] = J, 1.0
    P, across = piola(material(model, volumetric), F)
    expected = np.array([principal_stresses(model, volumetric, (j, 1.0, 1.0)) for j in J.tolist()])
    found = np.stack([P[:, 0, 0], P[:, 1, 1], across], axis=1)
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-10 * K)
    assert np.abs(P[:, 0, 1]).max() < 1e-10 * K


@pytest.mark.parametrize(("model", "volumetric"), CASES)
def test_a_strip_with_free_sides_has_the_stress_of_the_closed_form(model: str, volumetric: str) -> None:
    """Uniaxial load in plane strain, the sides free."""
    along = np.array([0.5, 0.8, 1.0, 1.2, 1.5])
    pairs = np.array([(a, across_free(model, volumetric, a)) for a in along.tolist()])
    assert pairs[2, 1] == pytest.approx(1.0, abs=1e-12)
    assert (np.diff(pairs[:, 1]) < -0.05).all()
    F = np.zeros((len(pairs), 2, 2))
    F[:, 0, 0], F[:, 1, 1] = pairs.T
    P, across = piola(material(model, volumetric), F)
    expected = np.array([principal_stresses(model, volumetric, (a, b, 1.0)) for a, b in pairs.tolist()])
    np.testing.assert_allclose(P[:, 0, 0], expected[:, 0], rtol=1e-10, atol=1e-10 * K)
    np.testing.assert_allclose(across, expected[:, 2], rtol=1e-10, atol=1e-10 * K)
    assert np.abs(P[:, 1, 1]).max() < 1e-10 * K


@pytest.mark.parametrize(("model", "volumetric"), CASES)
def test_simple_shear_has_the_stress_of_the_closed_form(model: str, volumetric: str) -> None:
    """Shear by kappa on top of a dilatation, J from 0.2 to 3, by the principal stretches of F."""
    for J in (0.2, 0.5, 1.0, 1.7, 3.0):
        for kappa in (0.3, 1.0, -0.7):
            F = math.sqrt(J) * np.array([[1.0, kappa], [0.0, 1.0]])
            left, stretches, right = np.linalg.svd(F)
            stresses = principal_stresses(model, volumetric, (*stretches.tolist(), 1.0))
            P, across = piola(material(model, volumetric), F[None])
            np.testing.assert_allclose(P[0], left @ np.diag(stresses[:2]) @ right, rtol=1e-10, atol=1e-10 * K)
            assert across[0] == pytest.approx(stresses[2], rel=1e-10, abs=1e-10 * K)


# ---- What is given and what it becomes ------------------------------------------------------------------------------


def test_any_two_moduli_say_the_others() -> None:
    """K = 20 and mu = 6: E = 9 K mu / (3 K + mu), nu = (3 K - 2 mu) / (2 (3 K + mu)), lambda = K - 2 mu / 3."""
    values = {"K": K, "mu": MU, "E": 9 * K * MU / (3 * K + MU), "nu": (3 * K - 2 * MU) / (2 * (3 * K + MU))}
    values["lambda"] = K - 2 * MU / 3
    for n, first in enumerate(NAMES):
        for second in NAMES[n + 1 :]:
            found = moduli({second: values[second], first: values[first]})
            assert (found.K, found.mu) == pytest.approx((K, MU), rel=1e-12), (first, second)
    assert Moduli(K, MU).nu == pytest.approx(values["nu"])
    foam = moduli({"E": 3.0, "nu": -0.5})
    assert (foam.K, foam.mu) == (0.5, 3.0)
    auxetic = moduli({"E": 3.0, "lambda": -0.5})
    assert auxetic.K - 2 / 3 * auxetic.mu == pytest.approx(-0.5)


@pytest.mark.parametrize(("model", "volumetric"), CASES)
def test_moduli_at_small_strains_are_those_that_were_given(model: str, volumetric: str) -> None:
    """d2psi/dF2 at F = I is lambda dij dkl + mu (dik djl + dil djk), by differences of the stress."""
    h, of = 1e-6, material(model, volumetric)
    eye = np.eye(2)
    for k in (0, 1):
        for j in (0, 1):
            step = np.zeros((2, 2))
            step[k, j] = h
            P, across = piola(of, np.stack([eye + step, eye - step]))
            expected = (K - 2 * MU / 3) * (k == j) * eye + MU * (step + step.T) / h
            np.testing.assert_allclose((P[0] - P[1]) / (2 * h), expected, atol=1e-5 * K)
            assert (across[0] - across[1]) / (2 * h) == pytest.approx((K - 2 * MU / 3) * (k == j), abs=1e-5 * K)


def test_a_solid_given_by_K_and_mu_is_the_papers_as_before() -> None:
    for of in (Material(20.0, 10.0), Material(K=20, mu=10, model="neo_hooke", volumetric="log")):
        assert (of.K, of.mu, of.values, of.moduli) == (20.0, 10.0, {"K": 20.0, "mu": 10.0}, Moduli(20.0, 10.0))
        assert of.as_dict() == {"K": 20.0, "mu": 10.0}
        region = solid_region(of)
        assert (region.energy.name, region.energy.parameters) == ("solid", ("K", "mu"))
    assert SOLIDS["neo_hooke"] == SOLIDS["solid"] == hyperelastic_solid()


VALUES = [
    ({"E": 5.0, "nu": 0.25}, {"K": 10 / 3, "mu": 2.0}),
    ({"lambda_": 4.0, "mu": 3.0}, {"K": 6.0, "mu": 3.0}),
    ({"model": "mooney_rivlin", "K": 9.0, "mu": 3.0, "c10": 1.0}, {"K": 9.0, "c10": 1.0, "c01": 0.5}),
    ({"model": "mooney_rivlin", "K": 9.0, "mu": 3.0, "c01": 0.25}, {"K": 9.0, "c10": 1.25, "c01": 0.25}),
    ({"model": "mooney_rivlin", "K": 9.0, "c10": 1.0, "c01": 0.25}, {"K": 9.0, "c10": 1.0, "c01": 0.25}),
    ({"model": "mooney_rivlin", "nu": 0.25, "c10": 1.0, "c01": 0.5}, {"K": 5.0, "c10": 1.0, "c01": 0.5}),
    ({"model": "yeoh", "lambda_": 2.0, "c1": 1.5, "c2": -0.1, "c3": 0.2}, {"K": 4.0, "c1": 1.5, "c2": -0.1, "c3": 0.2}),
    ({"model": "yeoh", "K": 2.0, "mu": 3.0, "c2": 0, "c3": 0}, {"K": 2.0, "c1": 1.5, "c2": 0.0, "c3": 0.0}),
    ({"model": "gent", "K": 2.0, "mu": 3.0, "J_m": 30.0}, {"K": 2.0, "mu": 3.0, "J_m": 30.0}),
    ({"model": "arruda_boyce", "K": 2.0, "mu": 3.0, "lambda_m": 3.0}, {"K": 2.0, "mu": 3.0, "lambda_m": 3.0}),
    (
        {"model": "arruda_boyce", "K": 2.0, "mu_r": 3.0, "lambda_m": 2.0},
        {"K": 2.0, "mu": 3 * (1 + 3 / 20 + 99 / 2800 + 513 / 56000 + 42039 / 17248000), "lambda_m": 2.0},
    ),
    ({"model": "saint_venant_kirchhoff", "K": 2.0, "mu": 3.0}, {"K": 2.0, "mu": 3.0}),
]


@pytest.mark.parametrize(("given", "expected"), VALUES)
def test_values_of_the_kernel_come_from_what_is_given(given: dict[str, Any], expected: dict[str, float]) -> None:
    of = Material(**given)
    assert of.values == pytest.approx(expected)
    assert tuple(of.values) == solid_region(of).energy.parameters
    assert of.of is MODELS[of.model]
    assert solid_region(of).moduli == of.moduli
    # what is written into result.json, with the words of problem files, says it all and builds the same again
    plain = of.as_dict()
    kept = {key.replace("lambda_", "lambda") if key == "lambda_" else key: value for key, value in given.items()}
    assert {key: value for key, value in plain.items() if key != "made"} == kept
    made = plain.get("made", {})
    assert {**{k: v for k, v in kept.items() if k in of.values}, **made}.items() >= of.values.items()
    assert all(key not in made for key in kept)
    assert {"K", "mu"} <= {*kept, *made}


BAD = [
    ({}, "give two of K, mu, E, nu and lambda, not none"),
    ({"K": 1.0}, "give two of K, mu, E, nu and lambda, not K"),
    ({"K": 1.0, "mu": 1.0, "nu": 0.2}, "give two of K, mu, E, nu and lambda, not K and mu and nu"),
    ({"K": -1.0, "mu": 1.0}, "K = -1 must be a positive number: the bulk modulus"),
    ({"K": 1.0, "mu": 0.0}, "mu = 0 must be a positive number: the shear modulus"),
    ({"E": -5.0, "nu": 0.3}, "E = -5 must be a positive number: Young's modulus"),
    ({"E": 5.0, "nu": 0.5}, "nu = 0.5 must be between -1 and 0.5, without these: 0.499 is nearly incompressible"),
    ({"E": 5.0, "nu": -1.0}, r"nu = -1 must be between -1 and 0.5, without these$"),
    ({"E": 5.0, "nu": float("nan")}, "nu = nan must be a finite number"),
    ({"E": 3.0, "mu": 1.0}, "mu = 1 and E = 3 do not say what K and mu are: give others of K, mu, E, nu, lambda"),
    ({"E": 4.0, "mu": 1.0}, "mu = 1 and E = 4 make K = -1.33333 and mu = 1, which must be positive: there is no such"),
    ({"K": 1.0, "lambda_": 2.0}, "K = 1 and lambda = 2 make K = 1 and mu = -1.5, which must be positive"),
    ({"lambda_": 0.0, "nu": 0.0}, "nu = 0 and lambda = 0 do not say"),
    ({"lambda_": float("inf"), "nu": 0.1}, "lambda = inf must be a finite number"),
    ({"model": "ogden", "K": 1.0, "mu": 1.0}, "unknown model 'ogden'"),
    ({"model": "mooney_rivlm", "K": 1.0, "mu": 1.0}, r"did you mean 'mooney_rivlin'\?"),
    ({"volumetric": "linear", "K": 1.0, "mu": 1.0}, "unknown volumetric 'linear': choose one of log, quadratic, simo"),
    ({"J_m": 3.0, "K": 1.0, "mu": 1.0}, "J_m = 3 belongs to model 'gent'; neo_hooke has no constants of its own"),
    ({"model": "gent", "c2": 3.0, "K": 1.0, "mu": 1.0}, "c2 = 3 belongs to model 'yeoh'; gent has J_m"),
    ({"model": "gent", "K": 1.0, "mu": 1.0}, "gent lacks 'J_m': it takes two moduli and J_m"),
    ({"model": "gent", "K": 1.0, "mu": 1.0, "J_m": 0.0}, "J_m = 0 must be a positive number"),
    ({"model": "yeoh", "K": 1.0, "mu": 1.0, "c2": 0.1}, "yeoh lacks 'c3': it takes two moduli and c1, c2, c3"),
    ({"model": "yeoh", "K": 1.0, "c1": -1.0, "c2": 0.1, "c3": 0.0}, "c1 = -1 must be a positive number"),
    ({"model": "yeoh", "K": 1.0, "c1": 1.0, "c2": float("nan"), "c3": 0.0}, "c2 = nan must be a finite number"),
    ({"model": "arruda_boyce", "K": 1.0, "mu": 1.0, "lambda_m": 1.0}, "lambda_m = 1 must be above 1"),
    ({"model": "arruda_boyce", "K": 1.0, "mu_r": -1.0, "lambda_m": 2.0}, "mu_r = -1 must be a positive number"),
    ({"model": "mooney_rivlin", "K": 1.0, "mu": 1.0}, "mooney_rivlin lacks 'c01' or 'c10'"),
    ({"model": "mooney_rivlin", "K": 1.0, "mu": 1.0, "c10": 0.2, "c01": 0.2},
     r"c10 = 0.2 and c01 = 0.2 make mu = 0.8, so give one of K, nu, E and lambda besides, not K and mu"),
    ({"model": "mooney_rivlin", "c10": 0.2, "c01": 0.2}, "besides, not none"),
    ({"model": "mooney_rivlin", "mu": 0.8, "c10": 0.2, "c01": 0.2}, "besides, not mu"),
    ({"model": "mooney_rivlin", "K": 1.0, "c10": 0.2, "c01": -0.2}, "mu = 0 must be a positive number: the shear mod"),
    ({"model": "saint_venant_kirchhoff", "volumetric": "quadratic", "K": 1.0, "mu": 1.0},
     "volumetric = 'quadratic' is not for saint_venant_kirchhoff, which has no such part"),
    ({"K": "stiff", "mu": 1.0}, "K = 'stiff' must be a number"),
]  # fmt: skip


@pytest.mark.parametrize(("given", "message"), BAD)
def test_a_solid_that_cannot_be_is_refused_in_one_line(given: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        Material(**given)
    assert len(str(caught.value).splitlines()) == 1


def test_a_stiffer_solid_has_all_moduli_times_the_factor() -> None:
    for given, _ in VALUES:
        of = Material(**given)
        assert (of.stiffer(3.0).moduli.K, of.stiffer(3.0).moduli.mu) == pytest.approx(
            (3.0 * of.moduli.K, 3.0 * of.moduli.mu)
        )
        same = {name for name in of.values if name in ("J_m", "lambda_m")}
        for name, value in of.stiffer(3.0).values.items():
            assert value == pytest.approx(of.values[name] * (1.0 if name in same else 3.0)), name
    regions = Punch(stiffness=100.0, material=Material(E=3.0, nu=0.25)).regions()
    assert regions["punch"].values["mu"] == pytest.approx(100.0 * regions["block"].values["mu"])
    assert regions["medium"].values["mu"] == pytest.approx(1.2)


def test_the_rubbery_modulus_is_softer_than_the_shear_modulus() -> None:
    s = 0.3
    assert stiffening(s) == pytest.approx(1 + s * (3 / 5 + s * (99 / 175 + s * (513 / 875 + s * 42039 / 67375))))


# ---- What is said about it ------------------------------------------------------------------------------------------


def test_what_was_given_and_what_it_became_is_said() -> None:
    rubber = Material(model="mooney_rivlin", volumetric="quadratic", E=6.0, nu=0.25, c01=0.2)
    regions = {"seal": {"solid": rubber.as_dict()}, "lid": {"solid": {"K": 20, "mu": 10}}, "gap": {"medium": {}}}
    said = "E = 6, nu = 0.25, c01 = 0.2: K = 4, mu = 2.4, c10 = 1"
    assert conversions({"regions": regions}) == [("material, seal", f"mooney_rivlin, quadratic, {said}")]
    assert conversions({"material": Material(E=6.0, nu=0.25).as_dict(), "medium": {}}) == [
        ("material", "E = 6, nu = 0.25: K = 4, mu = 2.4")
    ]
    assert conversions({"disc": Material(1.0, 2.0).as_dict()}) == []
    assert [name for name, _ in conversions({"beam": Material(E=6.0, nu=0.25).as_dict()})] == ["material, beam"]
    gent = Material(model="gent", K=1.0, mu=2.0, J_m=3.0)
    assert gent.as_dict() == {"model": "gent", "K": 1.0, "mu": 2.0, "J_m": 3.0}


def warnings_of(**given: Any) -> list[str]:
    return of_moduli({"block": solid_region(Material(**given))})


def test_what_is_known_about_a_model_is_said_before_solving() -> None:
    (soft,) = warnings_of(model="saint_venant_kirchhoff", K=3.0, mu=1.0)
    assert soft.startswith("region 'block' is a Saint Venant-Kirchhoff solid, which softens in compression")
    (below,) = warnings_of(model="mooney_rivlin", K=3.0, c10=1.0, c01=-0.25)
    assert below.endswith("has c10 = 1 and c01 = -0.25: where J is below 0.125 its energy has no lower bound")
    (above,) = warnings_of(model="mooney_rivlin", K=3.0, c10=-0.25, c01=1.0)
    assert above.endswith("where J is above 8 its energy has no lower bound")
    (gives,) = warnings_of(model="yeoh", K=3.0, c1=1.0, c2=-0.1, c3=0.0)
    assert gives.endswith("has a Yeoh energy that decreases beyond J^(-2/3) I1 - 3 = 5: it gives way there")
    for fine in (
        {"model": "yeoh", "c1": 0.5, "c2": -0.02, "c3": 0.003},
        {"model": "mooney_rivlin", "c10": 1.0, "c01": 0.0},
        {"model": "gent", "mu": 1.0, "J_m": 2.0},
        {"mu": 1.0},
    ):
        assert warnings_of(K=3.0, **fine) == []
    (nearly,) = warnings_of(E=3.0, nu=0.4996)
    assert "nearly incompressible" in nearly
    assert "K / mu" in nearly


def test_where_yeohs_stress_vanishes() -> None:
    assert softening(1.0, 0.0, 0.0) is None
    assert softening(1.0, 0.5, 0.0) is None
    assert softening(1.0, -0.5, 0.0) == 1.0
    assert softening(1.0, -0.5, 1.0) is None
    assert softening(1.0, -2.0, 1.0) == pytest.approx(1 / 3)  # 1 - 4 x + 3 x^2
    assert softening(1.0, 2.0, 1.0) is None
    assert softening(1.0, 1.0, -1.0) == pytest.approx(1.0)  # 1 + 2 x - 3 x^2


def test_moduli_of_a_region_without_a_material() -> None:
    region = RegionEnergy(hyperelastic_solid(), {"K": 3.0, "mu": 2.0})
    assert region.moduli == Moduli(3.0, 2.0)
    assert dataclasses.replace(region, energy=hyperelastic_solid("gent")).moduli is None


def test_unknown_names_are_refused() -> None:
    with pytest.raises(InputError, match="unknown model 'rubber': choose one of neo_hooke, mooney_rivlin, yeoh, gent"):
        hyperelastic_solid("rubber")
    with pytest.raises(InputError, match="unknown volumetric 'cubic'"):
        hyperelastic_solid("gent", "cubic")
    names = {energy.name for energy in SOLIDS.values()}
    assert {"solid", "neo_hooke_quadratic", "gent_simo_taylor", "yeoh", "saint_venant_kirchhoff"} <= names
    assert "saint_venant_kirchhoff_quadratic" not in names
    assert SOLIDS["gent_quadratic"].description == "Gent solid with volumetric part 'quadratic'"
    assert SOLIDS["gent"].description == "Gent solid"
    assert SOLIDS["solid"].description == "hyperelastic solid (2)"


# ---- Problem files --------------------------------------------------------------------------------------------------

PRESS = """
name = "press"
mesh = { size = 0.5 }
edges.bottom = { line = [[0, 0], [1, 0]] }
edges.top = { line = [[0, 2], [1, 2]] }
shapes.lower = { rectangle = [0, 0, 1, 1] }
shapes.space = { rectangle = [0, 1, 1, 1.25] }
shapes.upper = { rectangle = [0, 1.25, 1, 2] }
support = [{ at = "bottom", ux = 0, uy = 0 }, { at = "top", ux = 0 }]
load = { at = "top", uy = -0.1 }

[regions]
lower = { shape = "lower", solid = { model = "gent", E = 5, nu = 0.25, J_m = 30 } }
upper = { shape = "upper", solid = { lambda = 6, mu = 2 } }
medium = { shape = "space", medium = { gamma = 1e-3 } }
"""


def press(folder: Path, old: str = "", new: str = "") -> OwnProblem:
    assert old in PRESS
    path = folder / "press.toml"
    path.write_text(PRESS.replace(old, new, 1) if old else PRESS)
    return read_problem(path)[0]


def test_a_problem_file_names_its_solids(tmp_path: Path) -> None:
    problem = press(tmp_path)
    regions = problem.regions()
    assert regions["lower"].energy.name == "gent"
    assert regions["lower"].values == pytest.approx({"K": 10 / 3, "mu": 2.0, "J_m": 30.0})
    assert regions["upper"].values == pytest.approx({"K": 6 + 4 / 3, "mu": 2.0})
    assert regions["medium"].values["mu"] == pytest.approx(2.0)
    solids = {name: region.get("solid") for name, region in problem.inputs()["regions"].items()}
    made = {"K": pytest.approx(10 / 3), "mu": 2.0}
    assert solids["lower"] == {"model": "gent", "E": 5.0, "nu": 0.25, "J_m": 30.0, "made": made}
    assert solids["upper"] == {"mu": 2.0, "lambda": 6.0, "made": {"K": pytest.approx(22 / 3)}}
    old = press(tmp_path, "lambda = 6, mu = 2", "mu = 2, K = 20").inputs()["regions"]["upper"]
    assert old == {"shape": "upper", "solid": {"K": 20.0, "mu": 2.0}}


def test_the_mediums_modulus_is_the_one_that_solids_agree_on(tmp_path: Path) -> None:
    nearly = press(tmp_path, "mu = 2", "mu = 2.000000001")
    assert nearly.regions()["medium"].values["mu"] == 2.0
    with pytest.raises(InputError, match=r"press.toml: regions: medium: medium lacks 'mu': the solids have several"):
        press(tmp_path, "mu = 2", "mu = 2.00000001")
    table = "density = 'tmc_vem.energy:solid', parameters = { K = 3, mu = 7 }"
    own = press(tmp_path, "solid = { lambda = 6, mu = 2 }", table)
    assert own.regions()["medium"].values["mu"] == 2.0


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("J_m = 30", "J_n = 30", r"regions: lower: solid has no 'J_n' \(did you mean 'J_m'\?\).* \(line 13\)"),
        (", J_m = 30", "", r"regions: lower: solid: gent lacks 'J_m'"),
        ('"gent"', '"gant"', r"solid: unknown model 'gant' \(did you mean 'gent'\?\).* \(line 13\)"),
        ("nu = 0.25", "nu = 0.6", r"nu = 0.6 must be between -1 and 0.5.* \(line 13\)"),
        ("lambda = 6", "lambda = '6'", r"regions: upper: solid: lambda = '6' must be a number \(line 14\)"),
        ("lambda = 6", "lambda_ = 6", r"upper: solid has no 'lambda_'.* it has K, mu, model.*, lambda, c10"),
    ],
)
def test_bad_solids_of_a_problem_file(old: str, new: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        press(tmp_path, old, new)


# ---- Kernels --------------------------------------------------------------------------------------------------------

KERNELS = (
    ("mooney_rivlin", "simo_taylor"), ("yeoh", "quadratic"), ("gent", "log"), ("arruda_boyce", "log"),
    ("saint_venant_kirchhoff", "log"),
)  # fmt: skip


@pytest.mark.parametrize(("model", "volumetric"), KERNELS)
def test_kernels_pass_the_check_and_have_the_stress_of_the_density(model: str, volumetric: str) -> None:
    """The kernels are those of tests/fem/test_fem_solids.py; what ``codegen --check`` says, and stresses to 1e-10."""
    of = material(model, volumetric)
    energy = hyperelastic_solid(model, volumetric)
    kernel = compile_cells(solid_region(of).integrand)
    findings = verify(kernel, energy.density, of.values, declaration(energy.density))
    assert [finding.what for finding in findings if not finding.passed] == []
    assert any("out-of-plane" in finding.what for finding in findings)
    F = np.array([[[j, 0.3], [-0.1, 1.1]] for j in np.linspace(0.25, 2.7, 9)])
    x = to_vector(F, np.zeros((len(F), 2, 2, 2)))
    found = kernel.points(GRADIENT, x, kernel.parameter_array(of.values))[1]
    np.testing.assert_allclose(found, gradient(energy.density, x, of.values), rtol=1e-10, atol=1e-10 * K)
    assert not kernel.uses_second_gradient


def test_gents_domain_ends_where_it_locks() -> None:
    domain = declaration(hyperelastic_solid("gent").density).domain
    assert domain is not None
    x = to_vector(np.array([np.eye(2), np.diag([2.0, 0.5])]), np.zeros((2, 2, 2, 2)))
    assert energy_density(domain, x, {"J_m": 4.5}).tolist() == pytest.approx([1.0, 1.0 - (4.25 - 2.0) / 4.5])
    assert math.isnan(energy_density(hyperelastic_solid("gent").density, x, {"K": K, "mu": MU, "J_m": 2.0})[1])


# ---- The medium -----------------------------------------------------------------------------------------------------


def test_a_medium_with_a_volumetric_part() -> None:
    medium = Medium(gamma=0.5, log_j=0.25, regulariser="huhu")
    region = medium_region(medium, 3.0)
    assert region.energy.name == "medium_huhu_damped_log_j"
    assert region.values == {"mu": 3.0, "gamma": 0.5, "alpha_r": 1.0, "beta": 5.0, "log_j": 0.25}
    assert medium.as_dict()["log_j"] == 0.25
    assert "log_j" not in Medium().as_dict()
    assert "log_j" not in medium_region(Medium(), 3.0).values
    for wrong in (-0.1, float("nan"), float("inf")):
        with pytest.raises(InputError, match=f"log_j = {wrong:g} must not be negative: 0 is the paper's medium"):
            Medium(log_j=wrong)


def test_a_medium_with_a_volumetric_part_in_a_problem_file(tmp_path: Path) -> None:
    problem = press(tmp_path, "gamma = 1e-3", "gamma = 1e-3, log_j = 0.1")
    assert problem.regions()["medium"].values["log_j"] == 0.1
    assert problem.inputs()["medium"]["log_j"] == 0.1
    assert "log_j" not in press(tmp_path).inputs()["medium"]
    with pytest.raises(InputError, match=r"regions: medium: log_j = -1 must not be negative.*\(line 15\)"):
        press(tmp_path, "gamma = 1e-3", "gamma = 1e-3, log_j = -1")


def test_the_summary_says_what_materials_became() -> None:
    inputs = {"problem": "box", "material": Material(E=6.0, nu=0.25).as_dict()}
    result = RunResult(inputs, {}, True, "", 1.0, 1, 8, 9, 1, {}, {"total": 1.0}, [])
    assert ("material", "E = 6, nu = 0.25: K = 4, mu = 2.4") in summary_rows(result)
