"""One, two and three ranks: the same mesh, the same numbers, the same errors. Each script runs once per rank count."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import pytest
from helpers_process import process

HERE = Path(__file__).resolve().parent
RANKS = (1, 2, 3)


@cache
def run(script: str, n_ranks: int):
    """JSON that the script's rank 0 prints; a run that hangs is stopped and fails."""
    done = process([str(HERE / script)], ranks=n_ranks)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.parametrize("n_ranks", RANKS)
def test_distribution_keeps_every_cell_vertex_and_name(n_ranks):
    report = run("closure_of_distribution.py", n_ranks)
    assert len(report) == 5
    if n_ranks > 1:  # the mesh is really spread, evenly
        assert report["box"]["most"] < 100 / n_ranks * 1.3
        assert report["box"]["shared"] > 0
        assert report["voronoi"]["shared"] > 0


@pytest.mark.parametrize("n_ranks", RANKS[1:])
def test_numbers_do_not_depend_on_the_ranks(n_ranks):
    expected, found = run("results_by_rank.py", 1), run("results_by_rank.py", n_ranks)
    assert expected.keys() == found.keys()
    for name in expected:
        if not name.startswith("solved"):
            assert found[name] == pytest.approx(expected[name], rel=1e-11, abs=1e-12), name


@pytest.mark.parametrize("n_ranks", RANKS)
def test_assembly_allocates_nothing(n_ranks):
    report = run("results_by_rank.py", n_ranks)
    assert [values["mallocs"] for name, values in report.items() if not name.startswith("solved")] == [0.0] * 11


@pytest.mark.parametrize("n_ranks", RANKS)
def test_an_edge_set_is_constrained_wherever_its_nodes_are(n_ranks):
    """Spoke: 2 vertices and a midpoint in x and y; rim: as many in y. Each is counted on exactly one rank."""
    assert run("results_by_rank.py", n_ranks)["fan"]["constrained"] == 9


@pytest.mark.parametrize("n_ranks", RANKS[1:])
def test_solutions_do_not_depend_on_the_ranks(n_ranks):
    expected, found = run("results_by_rank.py", 1), run("results_by_rank.py", n_ranks)
    for name in ("solved fan", "solved ring", "solved box"):
        assert found[name]["complete"] == 1.0
        assert found[name] == pytest.approx(expected[name], rel=1e-8, abs=1e-12), name


def test_edge_sets_carry_the_body_force():
    """Reactions balance the load in x, of area times 1 on a regular polygon with 12 sides and radius 1."""
    assert run("results_by_rank.py", 3)["solved fan"]["spoke x"] == pytest.approx(-3.0, rel=1e-9)


def test_box_has_its_gap():
    """20 x 10 squares, gamma = 1e-4, alpha_r = 1: 8.092e-3 in an independent prototype."""
    assert run("results_by_rank.py", 1)["solved box"]["gap"] == pytest.approx(8.092e-3, rel=2e-3)


@pytest.mark.parametrize("n_ranks", RANKS)
def test_errors_of_one_rank_are_raised_on_all(n_ranks):
    report = run("errors_on_all_ranks.py", n_ranks)
    expected = {
        "bad mesh": "InputError: cell 0 is clockwise",
        "unexpected error while meshing": "RuntimeError: mesh file lost",
        "forced degree": "has 4 vertices: l = 2 leaves 2 spurious modes",
        "no degree for one cell": "InputError: cell 0 has 7 vertices and spurious modes",
        "unknown name": "neither a point nor edges named 'nowhere'",
        "unknown probe": "no named point 'nowhere'",
        "reaction of an unknown name": "neither a point nor edges named 'no'",
    }
    assert report.keys() == expected.keys()
    for name, outcomes in report.items():
        assert len(outcomes) == n_ranks
        assert all(expected[name] in outcome for outcome in outcomes), outcomes
        assert len(set(outcomes)) == 1


@pytest.mark.parametrize("n_ranks", RANKS)
def test_overlap_is_seen_on_any_ranks(n_ranks):
    report = run("overlap_by_rank.py", n_ranks)
    for method in ("vem", "fem"):
        said = report[method]
        assert not said["apart"]
        assert said["inside"].startswith("solids would overlap: depth 5.00e-02 at (")
        assert said["behind"] is True
        assert not said["beyond"]
        assert said["jump"].startswith("solids would have passed through each other: depth")
        assert said["inverted"] == 23  # all cells of the medium, none of the blocks
    # the place, and the cells there, are the same wherever they are
    assert report["vem"] == run("overlap_by_rank.py", 1)["vem"]
    assert report["fem"]["inside"].split("where")[0] == run("overlap_by_rank.py", 1)["fem"]["inside"].split("where")[0]


@pytest.mark.parametrize("n_ranks", RANKS)
def test_rigid_motions_are_not_counted_by_the_sign_of_their_rounding(n_ranks):
    assert run("free_body.py", n_ranks) == {
        f"{preset} {cells}": [False, 0] for preset in ("direct", "reproducible") for cells in (4, 16)
    }
