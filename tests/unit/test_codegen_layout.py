"""The record that constants, orders and names come from, and integrands with other inputs than F and G."""

from __future__ import annotations

import re

import numpy as np
import pytest

from codegen.compiler import generate
from codegen.errors import CodegenError
from codegen.integrand import DEFORMATION_GRADIENT, LAYOUT, Integrand, Parameter, second_gradient_energy, stress_names
from codegen.kernel import TANGENT, Kernel, compile_energy, compiled
from codegen.layout import Input, Layout, Take
from codegen.sampling import from_vector, to_vector
from codegen.trace import trace


def stretch(F, p, m):
    det = F[0][0] * F[1][1] - F[0][1] * F[1][0]
    return p.mu / 2 * (sum(F[i][j] ** 2 for i in (0, 1) for j in (0, 1)) - 2 - 2 * m.log(det))


ONLY_F = Integrand("stretch", (DEFORMATION_GRADIENT,), (Parameter("mu", 2.0),), stretch)
FLUX = Integrand(
    "flux",
    (Input("q", "T", Take.GRADIENT, (1, 2)),),
    (Parameter("k"),),
    lambda q, p, m: p.k / 2 * (q[0][0] ** 2 + q[0][1] ** 2),
)


def test_the_order_is_that_of_appendix_c():
    assert LAYOUT.names == (
        *("F11", "F21", "F12", "F22"),
        *("G111", "G211", "G121", "G221", "G112", "G212", "G122", "G222"),
    )
    assert stress_names(LAYOUT) == tuple(name.replace("F", "P").replace("G", "T") for name in LAYOUT.names)
    assert LAYOUT.at_rest == (1, 0, 0, 1, *[0] * 8)
    assert (LAYOUT.part("F"), LAYOUT.part("G")) == (slice(0, 4), slice(4, 12))


def test_constants_of_two_components_in_the_plane():
    assert (LAYOUT.dimension, LAYOUT.n_components, LAYOUT.n_inputs, LAYOUT.n_hessian) == (2, 2, 12, 78)
    assert (LAYOUT.n_rows, LAYOUT.n_first_rows, LAYOUT.rows_of(("F",)), LAYOUT.rows_of(("G",))) == (6, 2, 2, 6)
    assert LAYOUT.upper_triangle[:2] == ((0, 0), (0, 1))
    assert LAYOUT.upper_triangle[12] == (1, 1)


def test_component_i_is_that_of_the_field_in_a_derivative_row():
    for entry, first in zip(LAYOUT.inputs, (0, 2), strict=True):
        for n, (i, *directions) in enumerate(entry.indices):
            assert n % 2 == i
            assert first + n // 2 == first + sum(j * 2**k for k, j in enumerate(directions))


def test_constants_of_the_source_are_those_of_the_layout():
    wide = Layout(LAYOUT.inputs, lanes=4)
    assert wide.c_constants(2) == (
        "enum { LANES = 4, DIMENSION = 2, N_COMPONENTS = 2, N_FIRST_ROWS = 2, N_ROWS = 2, N_X = 12, N_H = 78 };\n"
    )
    source = generate(trace(ONLY_F)).c_source
    assert re.search(r"N_FIRST_ROWS = 2, N_ROWS = 2, N_X = 4, N_H = 10 ", source)


def test_states_and_tensors_are_inverse():
    x_nx = np.random.default_rng(0).normal(size=(5, 12))
    F, G = from_vector(x_nx)
    assert F[:, 0, 1] == pytest.approx(x_nx[:, 2])
    assert F[:, 1, 1] == pytest.approx(x_nx[:, 3] + 1.0)
    assert G[:, 0, 1, 0] == pytest.approx(x_nx[:, 6])
    np.testing.assert_allclose(to_vector(F, G), x_nx, rtol=0, atol=1e-15)


def test_an_integrand_of_f_alone_has_a_smaller_vector():
    """The same function with an argument G that it does not read is the oracle."""
    kernel = Kernel(compiled(ONLY_F), ONLY_F)
    whole = compile_energy(lambda F, G, p, m: stretch(F, p, m), "stretch", ("mu",))
    x_nx = np.random.default_rng(1).uniform(-0.2, 0.2, (11, 12))
    found = kernel.points(TANGENT, x_nx[:, :4].copy(), np.array([2.0]))
    expected = whole.points(TANGENT, x_nx, np.array([2.0]))
    np.testing.assert_array_equal(found[0], expected[0])
    np.testing.assert_array_equal(found[1], expected[1][:, :4])
    np.testing.assert_array_equal(found[2], expected[2][:, :4, :4])
    assert not kernel.uses_second_gradient


def test_the_gradient_of_another_field():
    psi_n, g_nx, h_nxy = Kernel(compiled(FLUX), FLUX).points(TANGENT, np.array([[1.0, 2.0]]), np.array([3.0]))
    assert psi_n.tolist() == [7.5]
    assert g_nx.tolist() == [[3.0, 6.0]]
    assert h_nxy.tolist() == [[[3.0, 0.0], [0.0, 3.0]]]


def test_messages_and_keys_are_those_of_the_inputs():
    other = Input("H", "u", Take.GRADIENT, (2, 2))
    with pytest.raises(CodegenError, match=r"write H\[i\]\[j\], not H\[i, j\]"):
        trace(Integrand("mine", (other,), (), lambda H, p, m: H[0, 0]))
    with pytest.raises(CodegenError, match="it does not depend on H, so"):
        trace(Integrand("mine", (other,), (Parameter("mu"),), lambda H, p, m: p.mu))
    with pytest.raises(CodegenError, match="it depends on neither F nor G, so"):
        trace(second_gradient_energy(lambda F, G, p, m: p.mu, "mine", ("mu",)))
    keys = {
        trace(Integrand("mine", inputs, (), lambda H, *rest: H[0][0] ** 2)).fingerprint()
        for inputs in ((other,), (Input("H", "u", Take.GRADIENT, (2, 2), identity=True),))
    }
    assert len(keys) == 2


def test_defaults_of_parameters_are_kept_and_may_be_left_out():
    def density(F, G, p, m):
        return p.a * F[0][0] * p.b

    with_defaults = second_gradient_energy(density, "mine", {"a": 1.0, "b": None})
    assert with_defaults.parameters == (Parameter("a", 1.0), Parameter("b"))
    assert second_gradient_energy(density, "mine", ("a", "b")).parameter_names == with_defaults.parameter_names
