"""Derivatives of results at equilibria by numbers of problems: remainders fall with the square of the change."""

from __future__ import annotations

import pytest
from helpers_sensitivity import case_of, finer, own, per_cell_sums, wrong

from tmc_vem.problems import Box, CBox, Medium

OF_BOX = ("gap", "reaction", "energy", "energy.medium", "p_norm.von_mises.solid.6", "p_norm.J.medium")
BY_BOX = ("material.mu", "solid.K", "medium.gamma", "medium.alpha_r", "medium.beta", "uy")
MEDIUM = Medium(gamma=1e-3, alpha_r=0.5, beta=2.0)
OF_SEAL = (
    "gap", "side", "hold", "squeezed", "cut", "mises", "stored", "reaction", "energy", "contact.block.force_y",
    "contact.block.moment", "p_norm.von_mises.block",
)  # fmt: skip
BY_SEAL = (
    "regions.foot.solid.E", "regions.foot.solid.nu", "regions.block.solid.J_m", "block.K",
    "regions.medium.medium.gamma", "regions.medium.medium.alpha", "regions.medium.medium.mu", "load.uy",
    "support.top.ux",
)  # fmt: skip


@pytest.mark.parametrize(
    "problem", [Box((20, 5), MEDIUM), Box((20, 5), MEDIUM, medium_refinement=2)], ids=["", "hanging"]
)
def test_box(problem: Box) -> None:
    case = case_of(problem, steps=8)
    assert case.found.value("gap") < 0.1
    assert not wrong(case, OF_BOX, BY_BOX)
    assert max(per_cell_sums(case, OF_BOX, BY_BOX[:-1]).values()) < 1e-12


def test_cbox() -> None:
    case = case_of(CBox((10, 5), 1, "polygons", Medium(gamma=1e-3, alpha_r=20.0, beta=0.0, regulariser="angle")))
    of = ("gap", "reaction", "energy.medium", "p_norm.J.medium.4")
    assert not wrong(case, of, ("material.mu", "medium.alpha_r", "uy"))


def test_several_bodies_in_contact(method: str) -> None:
    problem = own() if method == "vem" else finer(own(), cells="triangles", size=0.2)
    case = case_of(problem, method, steps=4)
    assert case.found.value("gap") < 0.07
    assert not wrong(case, OF_SEAL, BY_SEAL)
    assert max(per_cell_sums(case, OF_SEAL, BY_SEAL[:-2]).values()) < 1e-12
