"""Mixed derivatives of energies by parameters, F and G: Taylor rates against derivatives by the complex step."""

from __future__ import annotations

import numpy as np
import pytest

from codegen import oracle
from codegen.errors import CodegenError
from codegen.integrand import SECOND_GRADIENT, Integrand, second_gradient_energy
from codegen.kernel import GRADIENT, Kernel, compiled
from codegen.mixed import mixed_of
from codegen.record import AT_ONCE
from codegen.sampling import REGIMES, directions, from_vector, sample, to_vector
from tmc_vem.energy import DENSITIES, third_medium
from tmc_vem.problems.materials import Medium

VALUES = {"log_j": 1.7, "K": 20.0, "mu": 3.0, "gamma": 0.5, "alpha_r": 0.3, "beta": 2.0, "a": 0.7, "b": 1.4}
STEPS = [2.0**-n for n in range(4, 9)]


def everything(F, G, p, m):
    """Each function and operator, of parameters and of F, in an order in which a wrong slope shows."""
    det = F[2][2] * (F[0][0] * F[1][1] - F[0][1] * F[1][0])
    turned = m.atan2(F[1][0] - p.a * F[0][1] + 0.2, F[0][0] + p.b * F[1][1]) ** 2
    bent = m.exp(-p.a * det) * G[0][0][1] ** 2 + m.cos(G[1][1][0] * F[0][1] * p.b)
    rest = m.sqrt(F[0][0] * p.a + 3) - m.sin(F[1][1] - p.b) * m.atan(F[1][0] + p.a) + (-det) / (p.b + p.a * p.a)
    return m.log(p.b * det) ** 2 / 3 - turned + bent + rest


def of(energy):
    return second_gradient_energy(energy.density, energy.name, energy.parameters)


def medium(regulariser, **more):
    return of(third_medium(Medium(regulariser=regulariser).resolve()[0], damped=True, **more))


ENERGIES = {
    "everything": second_gradient_energy(everything, "everything", ("a", "b")),
    "solid": of(DENSITIES["solid"]),
    "balanced": medium("huhu", medium="balanced", volumetric=False),
    "huhu_lulu": medium("huhu_lulu", medium="isochoric", volumetric=False),
    "angle": medium("angle", medium="isochoric", volumetric=True),
}
NAMES = pytest.mark.parametrize("name", ENERGIES)


@pytest.fixture(scope="module")
def states() -> np.ndarray:
    rng = np.random.default_rng(8)
    return np.concatenate([sample(regime, 10, rng) for regime in REGIMES[:2]])


@pytest.fixture(scope="module")
def along(states) -> np.ndarray:
    return directions(states, np.random.default_rng(9))


def tensors(x_nx, at_rest=1.0):
    F, G = from_vector(x_nx)
    return F - (1.0 - at_rest) * np.eye(2), G


def moved(energy, step):
    """Parameters changed along a direction, and the direction."""
    change = np.random.default_rng(3).uniform(-1.0, 1.0, len(energy.parameters))
    values = {name: VALUES[name] * (1.0 + step * c) for name, c in zip(energy.parameter_names, change, strict=True)}
    return values, np.array([VALUES[name] for name in energy.parameter_names]) * change


def rate(remainders) -> float:
    sizes = [np.linalg.norm(remainder) for remainder in remainders]
    return float(np.log(sizes[-2] / sizes[-1]) / np.log(2.0))


@NAMES
def test_energy_by_parameters(name, states) -> None:
    energy = ENERGIES[name]
    slope = mixed_of(energy).energy_by_parameters(tensors(states), VALUES) @ moved(energy, 0.0)[1]
    before = oracle.energy_density(energy.function, states, VALUES)
    remainders = [
        oracle.energy_density(energy.function, states, moved(energy, h)[0]) - before - h * slope for h in STEPS
    ]
    if name == "solid":  # linear in its moduli
        assert max(abs(remainders[0]) / abs(before)) < 1e-13
    else:
        assert rate(remainders) == pytest.approx(2.0, abs=0.1)


@NAMES
def test_rate_by_parameters(name, states, along) -> None:
    energy = ENERGIES[name]
    found = mixed_of(energy).rate_by_parameters(tensors(states), tensors(along, 0.0), VALUES)
    assert found.shape == (len(states), len(energy.parameters))

    def work(values):
        return (oracle.gradient(energy.function, states, values) * along).sum(axis=1)

    slope, before = found @ moved(energy, 0.0)[1], work(VALUES)
    remainders = [work(moved(energy, h)[0]) - before - h * slope for h in STEPS]
    if name == "solid":
        assert max(abs(remainders[0])) < 1e-13 * max(abs(before))
    else:
        assert rate(remainders) == pytest.approx(2.0, abs=0.1)


@NAMES
def test_rate_of_stress(name, states, along) -> None:
    energy = ENERGIES[name]
    dP, dT = mixed_of(energy).rate_of_stress(tensors(states), tensors(along, 0.0), VALUES)
    assert (dT is None) == (name == "solid")
    slope = to_vector(dP + np.eye(2), np.zeros((*dP.shape, 2)) if dT is None else dT)
    before, steps = oracle.gradient(energy.function, states, VALUES), [0.1 * h for h in STEPS]
    remainders = [oracle.gradient(energy.function, states + h * along, VALUES) - before - h * slope for h in steps]
    assert rate(remainders) == pytest.approx(2.0, abs=0.1)


def test_kernels_have_the_same_rates(states, along) -> None:
    """gamma multiplies all of a medium's energy, so that the compiled stress is a derivative of this kind."""
    energy = ENERGIES["huhu_lulu"]
    kernel = Kernel(compiled(energy), energy)
    _, stress, _ = kernel.points(GRADIENT, states, kernel.parameter_array(VALUES))
    assert stress is not None
    found = mixed_of(energy).rate_by_parameters(tensors(states), tensors(along, 0.0), VALUES)
    by_gamma = found[:, energy.parameter_names.index("gamma")]
    np.testing.assert_allclose(by_gamma, (stress * along).sum(axis=1) / VALUES["gamma"], rtol=1e-9, atol=1e-9)


def test_parameters_may_vary_and_points_come_in_any_number(states, along) -> None:
    """More points than are taken at once, with a parameter of each row; one point alone has no axis."""
    mixed = mixed_of(ENERGIES["solid"])
    shape = (AT_ONCE // 8 + 3, 16)
    F, dF = (np.broadcast_to(x[0], (*shape, 2, 2)) for x in (tensors(states)[0], tensors(along, 0.0)[0]))
    mu = np.arange(1.0, shape[0] + 1.0)[:, None]
    dP, dT = mixed.rate_of_stress((F, None), (dF, None), {"K": 0.0, "mu": mu})
    assert dT is None
    np.testing.assert_allclose(dP, mu[..., None, None] * dP[:1], rtol=1e-12)
    one = mixed.rate_by_parameters((F[0, 0], None), (dF[0, 0], None), VALUES)
    assert one.shape == (2,)
    many = mixed.rate_by_parameters((F, None), (dF, None), {"K": 0.0, "mu": mu})
    np.testing.assert_allclose(many, np.broadcast_to(one, many.shape), rtol=1e-12)


def test_energies_near_rest_keep_their_digits_in_higher_precision() -> None:
    strain, mixed = 1e-7, mixed_of(ENERGIES["solid"])
    F = np.eye(2, dtype=np.longdouble)
    F[0, 1] = strain
    by_mu = mixed.energy_by_parameters((F, None), VALUES)[1]
    assert by_mu.dtype == np.longdouble
    if np.finfo(np.longdouble).eps < 1e-18:
        assert float(by_mu) == pytest.approx(0.5 * strain**2, rel=1e-3)


def test_a_parameter_at_zero_is_no_error() -> None:
    energy = second_gradient_energy(lambda F, G, p, m: F[0][0] * p.a**0.5 + F[1][1] * p.b**2, "root", ("a", "b"))
    found = mixed_of(energy).energy_by_parameters((np.eye(2)[None], None), {"a": 0.0, "b": 0.0})
    assert np.isinf(found[0, 0])
    assert found[0, 1] == 0.0


def test_an_energy_says_what_it_needs(states) -> None:
    with pytest.raises(ValueError, match="needs second gradients"):
        mixed_of(ENERGIES["angle"]).energy_by_parameters((np.eye(2)[None], None), VALUES)
    with pytest.raises(CodegenError, match="not one of F and G"):
        mixed_of(Integrand("bare", (SECOND_GRADIENT,), (), lambda G, p, m: G[0][0][0]))
