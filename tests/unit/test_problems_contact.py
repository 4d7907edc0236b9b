"""C-box, punch and bodies: meshes, names, refusals, and one small run each."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tmc_vem.mesh.check import find_faults
from tmc_vem.mesh.geometry import areas
from tmc_vem.mesh.make.weld import weld
from tmc_vem.mesh.parts import submesh, with_names
from tmc_vem.problems import Bodies, Box, CBox, Material, Medium, Punch
from tmc_vem.support.errors import InputError

PROBLEMS = {
    "cbox": CBox(),
    "cbox, quadrilaterals": CBox(solid_cells="quadrilaterals"),
    "cbox, fine medium": CBox(medium_refinement=3),
    "punch": Punch(),
    "punch, small gap": Punch(gap0=0.05, size=0.2),
    "bodies 1": Bodies(),
    "bodies 2": Bodies(case=2, discs=2, length=3.0),
    "one body": Bodies(discs=1, length=2.0),
    "box, Voronoi": Box(cells=(20, 5), cell_kind="voronoi"),
}
HALF_DISC = math.pi * 0.2**2 / 2
AREAS = {
    "cbox": {"solid": 0.23, "medium": 0.27 + 0.05 * 0.5},
    "cbox, quadrilaterals": {"solid": 0.23, "medium": 0.27 + 0.05 * 0.5},
    "cbox, fine medium": {"solid": 0.23, "medium": 0.27 + 0.05 * 0.5},
    "punch": {"block": 2.0, "punch": math.pi / 4, "medium": 2 * 1.6 - math.pi / 4},
    "punch, small gap": {"block": 2.0, "punch": math.pi / 4, "medium": 2 * 1.05 - math.pi / 4},
    "bodies 1": {"beam": 1.6, "discs": 7 * HALF_DISC, "medium": 2 * 8 * 0.3 - 7 * HALF_DISC},
    "bodies 2": {"beam": 0.6, "discs": 2 * HALF_DISC, "medium": 2 * 3 * 0.3 - 2 * HALF_DISC},
    "one body": {"beam": 0.4, "discs": HALF_DISC, "medium": 2 * 2 * 0.3 - HALF_DISC},
    "box, Voronoi": {"solid": 0.46, "medium": 0.54},
}


@pytest.mark.parametrize("name", PROBLEMS)
def test_mesh_has_regions_and_all_names_that_the_problem_uses(name):
    problem = PROBLEMS[name]
    mesh = problem.make_mesh()
    assert not find_faults(mesh)
    assert set(mesh.region_names) == set(problem.regions())
    area = dict.fromkeys(mesh.region_names, 0.0)
    for c, loop in enumerate(mesh.cells()):
        area[mesh.region_names[mesh.region_c[c]]] += areas(mesh.points_vx[loop][None])[0]
    assert area == pytest.approx(AREAS[name], rel=0.05)  # chords of circles
    for condition in problem.prescribed():
        assert condition.where in mesh.named_points or len(mesh.named_edges[condition.where])
    assert problem.load() in problem.prescribed()
    gap = problem.probes()["gap"]
    first, second = (mesh.points_vx[mesh.named_vertex(n)] for n in (gap.first, gap.second))
    expected = {"c": 0.3, "p": getattr(problem, "gap0", 0), "b": getattr(problem, "gap0", 0.3), "o": 0.1}[name[0]]
    assert np.hypot(*(first - second)) == pytest.approx(expected)
    assert problem.inputs()["problem"] == problem.name


def test_named_edges_are_where_they_belong():
    mesh = Bodies().make_mesh()
    x = mesh.points_vx
    assert np.ptp(x[mesh.named_edges["left"]][..., 1]) == pytest.approx(0.2)
    assert (np.abs(x[mesh.named_edges["upper"]][..., 1] - 0.5) < 1e-12).all()
    assert (np.abs(x[mesh.named_edges["lower"]][..., 1] + 0.3) < 1e-12).all()
    length = np.hypot(*np.diff(x[mesh.named_edges["upper"]], axis=1)[:, 0].T).sum()
    assert length == pytest.approx(4 * 0.4)
    mesh = Punch().make_mesh()
    assert np.hypot(*np.diff(mesh.points_vx[mesh.named_edges["top"]], axis=1)[:, 0].T).sum() == pytest.approx(1.0)
    assert np.abs(mesh.points_vx[mesh.named_edges["axis"]][..., 0]).max() < 1e-12


def test_boundary_conditions_of_the_two_cases():
    one = {(c.where, c.component) for c in Bodies(case=1).prescribed()}
    two = {(c.where, c.component) for c in Bodies(case=2).prescribed()}
    assert {("upper", 0), ("lower", 0), ("right", 0), ("right", 1)} <= one
    assert not {("upper", 0), ("lower", 0), ("right", 0)} & two
    assert ("right_corner", 1) in two


def test_punch_stiffness_scales_both_moduli():
    regions = Punch(stiffness=100.0, material=Material(2.0, 1.0)).regions()
    assert regions["punch"].values == {"K": 200.0, "mu": 100.0}
    assert regions["block"].values == {"K": 2.0, "mu": 1.0}
    assert regions["medium"].values["mu"] == 1.0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: CBox(cells=(15, 10)), r"15 cells in x do not resolve the wall: 0\.1 is 1\.5 cells"),
        (lambda: CBox(cells=(20,)), r"must be a list of 2|give the number of cells"),
        (lambda: CBox(wall=0.25), r"wall = 0\.25 leaves no cavity"),
        (lambda: CBox(solid_cells="hexagons"), r"unknown solid_cells 'hexagons': choose one of"),
        (lambda: CBox(medium_refinement=0), r"medium_refinement = 0"),
        (lambda: CBox(polygons_across=2), r"polygons_across = 2: use 3 to 64"),
        (lambda: CBox(column_cells=0), r"column_cells = 0: use 1 to 64"),
        (lambda: CBox(uy=math.nan), r"uy = nan"),
        (lambda: CBox(length=-1.0), r"length = -1 must be a positive number"),
        (lambda: Punch(size=0.5), r"size = 0\.5 is too large .* use at most 0\.25"),
        (lambda: Punch(radius=3.0), r"radius = 3 must be smaller than the width"),
        (lambda: Punch(gap0=0.0), r"gap0 = 0 must be a positive number"),
        (lambda: Punch(stiffness=-1.0), r"stiffness = -1 must be"),
        (lambda: Punch(stiffness=100.0, gap0=0.2), r"moves the stiff punch through the bottom"),
        (lambda: Punch(uy=math.inf), r"uy = inf must be a finite number"),
        (lambda: Bodies(case=3), r"case = 3: use 1 .* or 2"),
        (lambda: Bodies(discs=0), r"discs = 0"),
        (lambda: Bodies(discs=40), r"40 half discs of radius 0\.2 do not fit"),
        (lambda: Bodies(size=0.5), r"size = 0\.5 is too large for a beam"),
        (lambda: Bodies(gap0=math.nan), r"gap0 = nan must be"),
        (lambda: Box(cell_kind="hexagons"), r"unknown cell_kind 'hexagons'"),
        (lambda: Box(cell_kind="voronoi", medium_refinement=2), r"refined by 'cells' only"),
    ],
)
def test_refusals(make, message):
    with pytest.raises(InputError, match=message):
        make()


@pytest.mark.parametrize(
    "problem",
    [
        CBox(cells=(10, 5), uy=-0.2),
        Punch(size=0.25, uy=-0.7),
        Bodies(discs=1, length=2.0, uy=0.1),
    ],
    ids=["cbox", "punch", "bodies"],
)
def test_small_runs_reach_their_load_without_interpenetration(problem, tmp_path):
    from tmc_vem.results.contact.contact import check_contact
    from tmc_vem.results.snapshots import read_fields, snapshots
    from tmc_vem.simulation import RunOptions, run

    result = run(problem, tmp_path / "run", RunOptions(snapshots=1))
    assert result.complete, result.reason
    assert result.reaction * problem.load().value > 0.0  # the load does work
    assert not check_contact(read_fields(result, snapshots(result)[-1])).interpenetrates
    assert min(result.min_j.values()) > 0.0


def on_coarse_box(make_mesh=None, projection="auto", **more):
    """Gap and reaction on 20 x 5 squares, where the gap at one point depends on the mesh (docs/projection.md): results
    with hanging nodes are compared with those without, not with the converged ones."""
    from tmc_vem.simulation import RunOptions, run
    from tmc_vem.vem.spaces.element_settings import ElementSettings

    problem = Box(cells=(20, 5), **more)
    if make_mesh is not None:
        object.__setattr__(problem, "make_mesh", make_mesh)
    result = run(problem, None, RunOptions(element=ElementSettings(projection=projection)))
    assert result.complete, result.reason
    return result.gap, result.reaction


@pytest.mark.parametrize("r", [2, pytest.param(4, marks=pytest.mark.slow)])
def test_hanging_nodes_at_the_wall_change_the_box_little(r):
    gap, reaction = on_coarse_box()
    fine_gap, fine_reaction = on_coarse_box(medium_refinement=r)
    assert fine_reaction == pytest.approx(reaction, rel=0.005)
    assert fine_gap == pytest.approx(gap, rel=0.03)


def test_hanging_nodes_within_the_medium_carry_contact():
    """The middle row of the medium is twice as coarse as its neighbours: all cells of the gap have hanging nodes."""
    whole = Box(cells=(20, 5), medium_refinement=2).make_mesh()
    fine, coarse = whole, Box(cells=(20, 5)).make_mesh()

    def rows(mesh, middle):
        y = np.array([mesh.points_vx[mesh.cell(c)][:, 1].mean() for c in range(mesh.n_cells)])
        x = np.array([mesh.points_vx[mesh.cell(c)][:, 0].mean() for c in range(mesh.n_cells)])
        return submesh(mesh, (np.abs(y - 0.25) < 0.05) & (np.abs(x - 1.0) < 0.9) == middle)

    def mesh():
        return with_names(
            weld([rows(fine, False), rows(coarse, True)]),
            {n: tuple(whole.points_vx[v].tolist()) for n, v in whole.named_points.items()},
        )

    assert {6} <= set(mesh().n_sides_c.tolist())
    gap, reaction = on_coarse_box(mesh)
    fine_gap, fine_reaction = on_coarse_box(medium_refinement=2)
    assert reaction == pytest.approx(fine_reaction, rel=0.001)
    assert gap == pytest.approx(fine_gap, rel=0.01)


def test_composite_functions_everywhere_give_the_same_contact():
    """Piecewise P_2 in the crushed medium would give a gap that is 20 % too large."""
    gap, reaction = on_coarse_box(medium=Medium(gamma=1e-6))
    other_gap, other_reaction = on_coarse_box(medium=Medium(gamma=1e-6), projection="composite")
    assert other_reaction == pytest.approx(reaction, rel=0.002)
    assert other_gap == pytest.approx(gap, rel=0.02)


@pytest.mark.slow
def test_gap_of_the_box_of_voronoi_cells():
    from tmc_vem.simulation import run

    assert run(Box(cells=(40, 10), cell_kind="voronoi")).gap == pytest.approx(2.01e-3, rel=0.03)
