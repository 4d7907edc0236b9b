"""Numbers made of stress and strain tensors, against numpy's linear algebra."""

from __future__ import annotations

import numpy as np
import pytest

from tmc_vem.support.errors import InputError
from tmc_vem.support.units import NONE, STRESS
from tmc_vem.system.tensors import (
    COMPONENTS,
    SCALARS,
    kind_of,
    require_fields,
    tensors_needed,
    tensors_of,
    values_of,
)

RNG = np.random.default_rng(2)
F = np.eye(2) + 0.4 * RNG.normal(size=(30, 2, 2))
F[0], F[1] = np.eye(2), [[0.0, -2.0], [2.0, 0.0]]
F = F[np.linalg.det(F) > 0.05]
P, ACROSS = RNG.normal(size=F.shape), RNG.normal(size=len(F))
TENSORS = tensors_of(F, P, ACROSS)
J = np.linalg.det(F)
SIGMA = np.zeros((len(F), 3, 3))
SIGMA[:, :2, :2] = P @ np.swapaxes(F, 1, 2) / J[:, None, None]
SIGMA[:, 2, 2] = ACROSS / J
SIGMA = 0.5 * (SIGMA + np.swapaxes(SIGMA, 1, 2))


def check(name: str, expected: np.ndarray) -> None:
    np.testing.assert_allclose(values_of(name, TENSORS), expected, rtol=1e-9, atol=1e-11, err_msg=name)


def test_stresses() -> None:
    for name, (i, j) in {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1)}.items():
        check(f"cauchy_stress_{name}", SIGMA[:, i, j])
    for name, (i, j) in {"xX": (0, 0), "xY": (0, 1), "yX": (1, 0), "yY": (1, 1)}.items():
        check(f"first_piola_stress_{name}", P[:, i, j])
        check(f"deformation_gradient_{name}", F[:, i, j])
    check("first_piola_stress_zZ", ACROSS)
    mean = np.trace(SIGMA, axis1=1, axis2=2) / 3.0
    check("hydrostatic_stress", mean)
    deviator = SIGMA - mean[:, None, None] * np.eye(3)
    check("von_mises", np.sqrt(1.5 * (deviator**2).sum(axis=(1, 2))))
    ordered = np.linalg.eigvalsh(SIGMA)
    for n in range(3):
        check(f"principal_stress_{n + 1}", ordered[:, 2 - n])
    for n in range(2):
        check(f"in_plane_stress_{n + 1}", np.linalg.eigvalsh(SIGMA[:, :2, :2])[:, 1 - n])


def test_strains() -> None:
    check("J", J)
    for n in range(2):
        check(f"principal_stretch_{n + 1}", np.linalg.svd(F, compute_uv=False)[:, n])
    E = 0.5 * (np.swapaxes(F, 1, 2) @ F - np.eye(2))
    values, vectors = np.linalg.eigh(F @ np.swapaxes(F, 1, 2))
    H = (vectors * 0.5 * np.log(values)[:, None]) @ np.swapaxes(vectors, 1, 2)
    for n, (i, j) in enumerate(((0, 0), (1, 1), (0, 1))):
        check(f"green_lagrange_strain_{('XX', 'YY', 'XY')[n]}", E[:, i, j])
        check(f"log_strain_{('xx', 'yy', 'xy')[n]}", H[:, i, j])


def test_without_the_stress_across_the_plane_what_needs_it_is_no_number() -> None:
    withheld = tensors_of(F, P, None)
    for name, scalar in SCALARS.items():
        assert np.isnan(values_of(name, withheld)).all() == scalar.across, name
        assert np.isfinite(values_of(name, withheld)).all() == (not scalar.across), name


def test_names_and_kinds() -> None:
    assert tensors_needed(("von_mises", "cauchy_stress", "J")) == ("cauchy_stress", "deformation_gradient")
    assert [kind_of(name) for name in ("von_mises", "cauchy_stress", "log_strain_xx", "deformation_gradient")] == [
        STRESS, STRESS, NONE, NONE,
    ]  # fmt: skip
    require_fields((*COMPONENTS, *SCALARS))
    with pytest.raises(InputError, match=r"unknown field 'mises': choose from deformation_gradient, .*von_mises"):
        require_fields(("von_mises", "mises"))
