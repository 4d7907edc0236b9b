"""Which dolfinx is accepted, what is said about others, and that compiled forms are found again."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from helpers_fem import grid, make_system, medium

from tmc_vem.fem import compat
from tmc_vem.support.errors import InputError


@pytest.fixture
def fresh() -> Iterator[None]:
    compat.require.cache_clear()
    yield
    compat.require.cache_clear()


@pytest.mark.parametrize(
    ("text", "version"),
    [("0.5.2", (0, 5)), ("0.9.0", (0, 9)), ("0.10.0.post1", (0, 10)), ("0.6.0.dev0", (0, 6)), ("0.11.0", (0, 11))],
)
def test_supported_versions(text: str, version: tuple[int, int]) -> None:
    assert compat.parse_version(text) == version


@pytest.mark.parametrize("text", ["0.4.1", "0.12.0", "1.0.0", "2019.1", "unknown"])
def test_other_versions_are_refused_in_one_line(text: str) -> None:
    with pytest.raises(InputError, match=r"is not supported: use 0\.5 to 0\.11") as caught:
        compat.parse_version(text)
    assert text in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_dolfinx_says_what_to_install(monkeypatch: pytest.MonkeyPatch, fresh: None) -> None:
    monkeypatch.setitem(sys.modules, "dolfinx", None)
    with pytest.raises(InputError, match="apt-get install python3-dolfinx-real") as caught:
        compat.require()
    assert "\n" not in str(caught.value)


def test_parameters_do_not_recompile(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(compat.JIT_OPTIONS, "cache_dir", str(tmp_path))
    mesh = grid(2, 2)

    def libraries_with(**inputs: Any) -> int:
        settings = {"interior_penalty": "penalty", "eta": inputs.pop("eta", 10.0)}
        make_system(mesh, medium(**inputs), **settings).compile()
        return len(list(tmp_path.glob("*.so")))

    n_libraries = libraries_with()
    assert n_libraries >= 3
    assert libraries_with(beta=3.0, eta=20.0) == n_libraries
    assert libraries_with(regulariser="huhu") > n_libraries


@pytest.mark.parametrize("cell", [compat.TRIANGLE, compat.QUADRILATERAL])
def test_reference_edges_follow_the_polygon(cell: str) -> None:
    corners = compat.tensor_order(cell)
    around = {tuple(sorted(pair)) for pair in zip(corners, corners[1:] + corners[:1], strict=True)}
    assert {tuple(pair) for pair in compat.reference_edges(cell).tolist()} == around


@pytest.mark.parametrize("cell", [compat.TRIANGLE, compat.QUADRILATERAL])
@pytest.mark.parametrize("degree", [2, 4, 8])
def test_quadrature_integrates_its_degree(cell: str, degree: int) -> None:
    points, weights = compat.quadrature(cell, degree)
    fine_points, fine_weights = compat.quadrature(cell, 20)

    def integrate(x: Any, w: Any) -> float:
        return float(w @ (x[:, 0] ** (degree - 1) * x[:, 1] - 0.3 * x[:, 1] ** degree))

    assert integrate(points, weights) == pytest.approx(integrate(fine_points, fine_weights), rel=1e-13)
