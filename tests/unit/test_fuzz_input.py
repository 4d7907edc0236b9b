"""Whatever a user types is accepted rightly or refused in one line: no traceback, no hang."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import tmc_vem.simulation.simulation
from tmc_vem.cli.main import _run
from tmc_vem.mesh.polygon import PolygonMesh

NUMBERS = st.one_of(
    st.sampled_from(
        ["0", "-1", "1", "2", "3", "1e-5", "1e-300", "1e300", "nan", "inf", "-inf", "", "one", "1,5", "0x10"]
    ),
    st.integers(-(10**12), 10**12).map(str),
    st.floats().map(str),
)
WORDS = st.one_of(
    st.sampled_from(["vem", "fem", "huhu", "angle", "x.py:f", ":", "a:b", "none", "full", "polygons", "/", "kappa=1"]),
    st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=8),
)
MEDIUM = ["--gamma", "--alpha-r", "--beta"]
GEOMETRY = ["--uy", "--refine-medium", "--size", "--stiffness", "--gap0", "--case", "--discs"]
WORK = ["--max-iterations", "--max-seconds", "--at"]
METHOD = ["--steps", "--order", "--l", "--quadrature", "--eta", "--snapshots", "--checkpoint-every"]
VERBAL = ["--regulariser", "--param", "--method", "--interior-penalty", "--mesh"]
OPTIONS = st.one_of(
    st.tuples(st.sampled_from(MEDIUM + GEOMETRY + METHOD + WORK), NUMBERS).map(list),
    st.tuples(st.just("--path"), st.lists(NUMBERS, max_size=4).map(" ".join)).map(list),
    st.tuples(st.just("--continuation"), st.sampled_from(["gamma", "alpha_r", "beta", ""]), NUMBERS).map(
        lambda words: [words[0], f"{words[1]}={words[2]}"]
    ),
    st.tuples(st.sampled_from(VERBAL), WORDS).map(list),
    st.tuples(st.just("--cells"), NUMBERS, NUMBERS).map(list),
    st.sampled_from([["--follow"], ["--triangles"], ["--json"], ["--quiet"], ["--overwrite"]]),
    WORDS.map(lambda word: [word]),
)


class Accepted(Exception):
    """The input got as far as a run."""


@settings(max_examples=500, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(problem=st.sampled_from(["box", "cbox", "punch", "bodies"]), options=st.lists(OPTIONS, max_size=4))
def test_any_arguments(
    problem: str, options: list[list[str]], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def accept(*_: Any, **__: Any) -> None:
        raise Accepted

    monkeypatch.setattr(tmc_vem.simulation.simulation, "run", accept)
    capsys.readouterr()
    try:
        code = _run(["run", problem, *(word for option in options for word in option)])
    except Accepted:
        return
    output = capsys.readouterr()
    assert code == (0 if "--help" in output.out or "Usage" in output.out else 2)
    assert len(output.err.strip().splitlines()) <= 1, output.err
    assert "Traceback" not in output.err


@settings(max_examples=200, deadline=None)
@given(
    points=st.lists(st.tuples(st.floats(width=32), st.floats(width=32)), max_size=7),
    cells=st.lists(st.lists(st.integers(-2, 8), max_size=6), max_size=4),
    region=st.lists(st.integers(-1, 2), max_size=4),
)
def test_any_polygon_mesh(points: list[tuple[float, float]], cells: list[list[int]], region: list[int]) -> None:
    from tmc_vem.support.errors import InputError

    message = ""
    try:
        mesh = PolygonMesh.from_cells(points, cells, region, ("solid", "medium"))
    except InputError as error:
        message = str(error)
    if message:
        assert len(message.splitlines()) == 1, message
    else:
        assert mesh.n_cells == len(cells)
