"""The check of an energy finds what is wrong with it, and says which property it is."""

from __future__ import annotations

import numpy as np
import pytest

from codegen.by_parameters import compile_by_parameters
from codegen.declare import Declaration
from codegen.integrand import second_gradient_energy
from codegen.kernel import compile_energy
from codegen.sampling import REGIMES, directions, from_vector, rotate, sample, to_vector
from codegen.verify import verify
from tmc_vem.energy import DENSITIES

PARAMETERS = {"K": 20.0, "mu": 10.0, "gamma": 1e-3, "alpha_r": 0.7, "beta": 2.0}


class Tampered:
    """A kernel whose values, gradient or Hessian are changed on the way out."""

    def __init__(self, kernel, psi=lambda v: v, g=lambda v: v, h=lambda v: v):
        self.kernel, self.changes = kernel, (psi, g, h)
        self.parameter_array = kernel.parameter_array

    def points(self, level, x_nx, parameters):
        values = self.kernel.points(level, x_nx, parameters)
        return tuple(
            None if value is None else change(value) for change, value in zip(self.changes, values, strict=True)
        )


def failures(kernel, density, declared=None) -> dict[str, str]:
    return {f.what: f.words for f in verify(kernel, density, PARAMETERS, declared) if not f.passed}


def kernel_of(name):
    energy = DENSITIES[name]
    return compile_energy(energy.density, energy.name, energy.parameters, energy.description)


def scaled(value, entry, factor):
    value = value.copy()
    value[entry] *= factor
    return value


def test_a_sound_energy_has_no_failures():
    findings = verify(kernel_of("medium_angle_damped"), DENSITIES["medium_angle_damped"].density, PARAMETERS)
    assert [f.what for f in findings if not f.passed] == []
    assert {f.what for f in findings if "rate" in f.what} == {
        f"{d}, Taylor rate, {r.name}" for d in ("gradient", "Hessian") for r in REGIMES
    }
    rates = {f.what: float(f.measured) for f in findings if "rate" in f.what}
    assert all(
        rate == pytest.approx(2.0 if what.startswith("gradient") else 3.0, abs=0.1) for what, rate in rates.items()
    )


def test_wrong_values():
    kernel = Tampered(kernel_of("solid"), psi=lambda psi: psi * (1 + 1e-6))
    assert (
        "The kernel and the Python function disagree"
        in failures(kernel, DENSITIES["solid"].density)["energy against numpy"]
    )


@pytest.mark.parametrize("component", [0, 2, 5, 11])
def test_one_wrong_component_of_the_gradient(component):
    kernel = Tampered(kernel_of("medium_angle"), g=lambda g: scaled(g, np.s_[:, component], 1.01))
    found = failures(kernel, DENSITIES["medium_angle"].density)
    assert found["gradient, Taylor rate, mild"] == "The gradient is not that of the energy."
    assert "Hessian symmetric, against differences" in found
    assert "energy against numpy" not in found


@pytest.mark.parametrize("entry", [(0, 0), (0, 3), (3, 9), (11, 11)])
def test_one_wrong_entry_of_the_hessian(entry):
    def change(h):
        return scaled(scaled(h, np.s_[:, entry[0], entry[1]], 1.05), np.s_[:, entry[1], entry[0]], 1.05)

    found = failures(Tampered(kernel_of("medium_angle"), h=change), DENSITIES["medium_angle"].density)
    assert found["Hessian, Taylor rate, mild"] == "The Hessian is not that of the energy."
    assert "Hessian symmetric, against differences" in found
    assert not {what for what in found if what.startswith("gradient")}


def check(density, declared=None, parameters=()):
    return failures(compile_energy(density, "mine", parameters), density, declared)


def test_an_energy_that_resists_rotation():
    found = check(lambda F, G, p, m: (F[0][1] - F[1][0]) ** 2 + (F[0][0] - 1) ** 2)
    assert list(found) == ["unchanged by superposed rotation"]
    words = found["unchanged by superposed rotation"]
    assert words.startswith("The energy is not objective (frame indifferent): a superposed rotation of ")
    assert words.endswith("; psi(QF, QG) must equal psi(F, G).")


def test_an_energy_declared_as_not_objective():
    def density(F, G, p, m):
        return (F[0][1] - F[1][0]) ** 2

    assert check(density, Declaration(objective=False)) == {}
    kernel = compile_energy(density, "mine", ())
    (note,) = (f for f in verify(kernel, density, {}, Declaration(objective=False)) if f.words)
    assert note.required == "declared otherwise"
    assert note.words.endswith(", as declared.")


def test_a_two_dimensional_trace_is_found_by_the_stress_at_rest():
    def density(F, G, p, m):
        J = F[0][0] * F[1][1] - F[0][1] * F[1][0]
        trace_c = F[0][0] ** 2 + F[0][1] ** 2 + F[1][0] ** 2 + F[1][1] ** 2
        return m.exp(-2 / 3 * m.log(J)) * trace_c - 2

    found = check(density)
    assert list(found) == ["stress at F = I"]
    assert "P11 = 0.6667 (in plane strain tr C = F:F + 1, as F33 = 1)" in found["stress at F = I"]
    assert check(density, Declaration(stress_free=False)) == {}


def test_an_energy_that_does_not_vanish_at_rest():
    def density(F, G, p, m):
        J = F[0][0] * F[1][1] - F[0][1] * F[1][0]
        return (J - 1) ** 2 + 0.25

    assert check(density) == {"energy at F = I": "The energy at F = I is 0.25, not 0: subtract it."}


def test_an_energy_that_is_not_a_number_somewhere():
    def density(F, G, p, m):
        return m.sqrt(F[0][0])

    (what, words), *others = check(density).items()
    assert what.startswith("finite, J 1e-4 to 3")
    assert "infinite or not a number at [F - I, G] = [" in words
    assert others == []


def hand_written(F, G, p, m):
    """Of huhu, with one slip: T212 where T122 belongs and the other way round."""
    T = [[[G[i][j][k] for k in (0, 1)] for j in (0, 1)] for i in (0, 1)]
    T[0][1][1], T[1][0][1] = T[1][0][1], T[0][1][1]
    return [[0.0, 0.0], [0.0, 0.0]], T


def test_a_slip_in_a_hand_written_gradient_is_located():
    huhu = DENSITIES["medium_huhu"].density.__globals__["densities"].huhu
    assert check(huhu, Declaration(gradient=lambda F, G, p, m: ([[0, 0], [0, 0]], G))) == {}
    assert check(huhu, Declaration(gradient=hand_written)) == {
        "hand-written gradient": "The hand-written gradient is wrong: its components T212, T122 are not the energy's."
    }


# ---- The states -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("regime", REGIMES, ids=lambda regime: regime.name)
def test_states_reach_the_bounds_of_their_regime_and_stay_inside(regime):
    F, G = from_vector(sample(regime, 200, np.random.default_rng(0)))
    J = np.linalg.det(F)
    rotation = np.abs(np.degrees(np.arctan2(F[:, 1, 0] - F[:, 0, 1], F[:, 0, 0] + F[:, 1, 1])))
    assert J.min() == pytest.approx(regime.j_min, rel=1e-6)
    assert J.max() == pytest.approx(regime.j_max, rel=1e-6)
    assert rotation.max() == pytest.approx(regime.rotation, rel=1e-6)
    assert np.std(G) == pytest.approx(0.5, rel=0.1)
    limited = from_vector(sample(regime, 200, np.random.default_rng(0), max_rotation=50.0))[0]
    turned = np.abs(np.degrees(np.arctan2(limited[:, 1, 0] - limited[:, 0, 1], limited[:, 0, 0] + limited[:, 1, 1])))
    assert turned.max() <= 40.0 + 1e-9


def test_rotating_and_packing_states():
    x = np.arange(12.0)[None] + 1
    F, G = from_vector(x)
    np.testing.assert_array_equal(to_vector(F, G), x)
    np.testing.assert_allclose(from_vector(rotate(x, np.array([90.0])))[0][0], [[0, -1], [1, 0]] @ F[0], atol=1e-14)
    np.testing.assert_allclose(
        from_vector(rotate(x, np.array([90.0])))[1][0], np.stack([-G[0, 1], G[0, 0]]), atol=1e-14
    )


def test_directions_do_not_leave_the_admissible_states():
    rng = np.random.default_rng(0)
    for regime in REGIMES:
        x = sample(regime, 100, rng)
        d = directions(x, rng)
        for step in (-0.02, 0.02):
            J = np.linalg.det(from_vector(x + step * d)[0])
            assert np.all(0.9 * np.linalg.det(from_vector(x)[0]) < J)


# ---- derivatives by parameters --------------------------------------------------------------------------------------


class TamperedByParameters:
    """Compiled derivatives of which one is changed on the way out."""

    def __init__(self, derivatives, part, entry, factor):
        self._derivatives, self._changed = derivatives, (part, entry, factor)
        self.parameters, self.integrand = derivatives.parameters, derivatives.integrand

    def by_parameters(self, x_nx, y_nx, parameters):
        part, entry, factor = self._changed
        values = self._derivatives.by_parameters(x_nx, y_nx, parameters)
        return tuple(scaled(v, np.s_[:, entry], factor) if n == part else v for n, v in enumerate(values))


def derivatives_of(name):
    energy = DENSITIES[name]
    return compile_by_parameters(second_gradient_energy(energy.density, energy.name, energy.parameters))


@pytest.mark.parametrize("name", ["solid", "medium_angle_damped"])
def test_sound_derivatives_by_parameters(name):
    energy = DENSITIES[name]
    findings = verify(kernel_of(name), energy.density, PARAMETERS, by_parameters=derivatives_of(name))
    assert all(f.passed for f in findings)
    assert {f.what for f in findings if " by " in f.what and "rate" in f.what} == {
        f"{what} by {parameter}, Taylor rate" for what in ("energy", "stress") for parameter in energy.parameters
    }
    (numpy,) = (f for f in findings if f.what == "by parameters, against numpy")
    assert float(numpy.measured) < 1e-10
    if name == "medium_angle_damped":  # the only parameter that it is not linear in
        measured = {f.what: f.measured for f in findings}
        assert measured["energy by mu, Taylor rate"] == "exact"
        assert float(measured["stress by beta, Taylor rate"]) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize(("part", "what"), [(0, "energy"), (1, "stress")])
def test_wrong_derivatives_by_parameters(part, what):
    derivatives = TamperedByParameters(derivatives_of("medium_angle_damped"), part, 3, 1 + 1e-3)
    assert derivatives.parameters[3] == "beta"
    found = verify(
        kernel_of("medium_angle_damped"), DENSITIES["medium_angle_damped"].density, PARAMETERS,
        by_parameters=derivatives,
    )  # fmt: skip
    assert {f.what: f.words for f in found if not f.passed} == {
        "by parameters, against numpy": "Derivatives by parameters disagree with those of the Python function: please "
                                        "report it.",
        f"{what} by beta, Taylor rate": f"The derivative of the {what} by beta is not that of the {what}.",
    }  # fmt: skip


def test_energies_without_parameters_have_no_derivatives_by_them():
    def stretch(F, G, p, m):
        return (F[0][0] ** 2 + F[1][0] ** 2 - 1.0) ** 2 + (F[0][1] ** 2 + F[1][1] ** 2 - 1.0) ** 2

    kernel = compile_energy(stretch, "stretch", ())
    derivatives = compile_by_parameters(second_gradient_energy(stretch, "stretch", ()))
    assert len(verify(kernel, stretch, {}, by_parameters=derivatives)) == len(verify(kernel, stretch, {}))
