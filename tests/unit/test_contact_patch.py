"""Contact patch test: the pressure between two blocks whose meshes do not match is the same everywhere, and known."""

from __future__ import annotations

import math
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import brentq

from tmc_vem import RunResult, run
from tmc_vem.results.contact import pairs
from tmc_vem.simulation.problem_file import read_problem

EXAMPLE = Path(__file__).parents[2] / "demos" / "problems" / "patch.toml"
K, MU = 100 / (3 * (1 - 0.6)), 100 / (2 * 1.3)


def turned(text: str, degrees: float) -> str:
    """The problem with all of its places turned about the origin, and supports and load along what they were."""
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))

    def place(x: float, y: float) -> str:
        return f"[{cos * x - sin * y!r}, {sin * x + cos * y!r}]"

    def corners(match: re.Match[str]) -> str:
        x0, y0, x1, y1 = (float(number) for number in match[1].split(","))
        return f"polygon = [{place(x0, y0)}, {place(x1, y0)}, {place(x1, y1)}, {place(x0, y1)}]"

    def ends(match: re.Match[str]) -> str:
        x0, y0, x1, y1 = (float(number) for number in match.groups()[1:])
        return f"{match[1]} = [{place(x0, y0)}, {place(x1, y1)}]"

    number = r"([-\d.]+)"
    text = re.sub(r"rectangle = \[(.*?)\]", corners, text)
    text = re.sub(rf"(line|near) = \[\[{number}, {number}\], \[{number}, {number}\]\]", ends, text)
    return re.sub(r"^u[xy] = ", "normal = ", text, flags=re.MULTILINE)


@pytest.fixture(scope="module", params=[0, 20])
def pressed(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> RunResult:
    text = EXAMPLE.read_text()
    path = tmp_path_factory.mktemp("patch") / "patch.toml"
    path.write_text(turned(text, request.param) if request.param else text)
    result = run(*_options(path))
    assert result.complete
    return result


def _options(path: Path):  # type: ignore[no-untyped-def]
    problem, options = read_problem(path, {"regions.medium.medium.gamma": 1e-3})
    return problem, None, options


def layer_pressure(stretch: float, gamma: float) -> float:
    """Of the medium (5) between flat faces, at a stretch."""
    return 2 * gamma * MU / 3 * (stretch ** (-5 / 3) - stretch ** (1 / 3))


def block_pressure(stretch: float) -> float:
    """Of the neo-Hookean solid in uniaxial strain."""
    trace = 2 + stretch**2
    return -K * math.log(stretch) / stretch - MU * stretch ** (-2 / 3) * (stretch - trace / (3 * stretch))


def known_pressure(gamma: float) -> float:
    """With which blocks of 0.5 and a layer of 0.2 become shorter by 0.3 together."""

    def layer(p: float) -> float:
        return brentq(lambda stretch: layer_pressure(stretch, gamma) - p, 1e-6, 1.0, xtol=1e-16)

    def block(p: float) -> float:
        return brentq(lambda stretch: block_pressure(stretch) - p, 0.3, 1.0, xtol=1e-16)

    return brentq(lambda p: 0.2 * layer(p) + 2 * 0.5 * block(p) - 0.9, 1e-3, 100.0, xtol=1e-13)


def test_the_pressure_is_the_same_everywhere(pressed: RunResult) -> None:
    curves = pressed.traction()
    p = known_pressure(1e-3)
    assert {name: int((curves.body_n == n).sum()) for n, name in enumerate(curves.bodies)} == {"low": 23, "up": 35}
    assert np.abs(curves.pressure_n / p - 1).max() < 1e-6
    inside = np.abs(curves.arc_length_n - 0.5) < 0.49  # what holds the sides pulls at the ends of the faces, too
    assert np.abs(curves.shear_n[inside]).max() < 1e-6 * p


def test_pressures_add_up_to_the_force(pressed: RunResult) -> None:
    p = known_pressure(1e-3)
    assert pressed.reaction is not None
    assert abs(pressed.reaction) == pytest.approx(p, rel=1e-9)
    curves = pressed.traction()
    for n in range(2):
        on_body = curves.body_n == n
        assert (curves.pressure_n * curves.deformed_weight_n)[on_body].sum() == pytest.approx(p, rel=1e-8)


def test_a_contact_of_single_stations_has_a_width() -> None:
    """Where one station of each face touches, all positions along the contact are rounding."""
    rng = np.random.default_rng(0)
    for at in rng.uniform(0.1, 1.0, 50):
        x = np.concatenate([at + np.array([-0.1, 0.0, 0.1]), at * (1 + 1e-16) + np.array([0.1, 0.0, -0.1])])
        lower = np.arange(6) < 3
        traction = SimpleNamespace(
            surface=SimpleNamespace(line_n=np.where(lower, 0, 1), closed_l=np.array([False, False])),
            points_nx=np.stack([x, np.where(lower, 0.0, 1e-4)], axis=1),
            tangent_ni=np.where(lower, 1.0, -1.0)[:, None] * [1.0, 0.0],
            weight_n=np.ones(6), pressure_n=np.array([0.0, 0.3, 0.0, 0.0, 0.3 * at, 0.0]),
        )  # fmt: skip
        pair = pairs.Pair((0, 0), lower, ~lower)
        width = pairs._width(traction, pair)  # type: ignore[arg-type]
        assert 0.0 <= width["contact_length"] <= 0.2 + 1e-9
        assert width["centre_x"] == pytest.approx(at)
