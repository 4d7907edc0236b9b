"""Which runs comparisons and the paper's figures ask for: names, problems, options and costs, one by one."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tmc_vem.cli.batch_progress import BatchMonitor, _left
from tmc_vem.problems import Bodies, Box, CBox, Medium, Punch
from tmc_vem.problems.cbox import angle_medium
from tmc_vem.report.page import Entry
from tmc_vem.simulation import RunOptions
from tmc_vem.simulation.triangulated import Triangulated
from tmc_vem.study import compare
from tmc_vem.study.batch import Job, Outcome, _found, _Pool, _Worker, run_batch
from tmc_vem.study.compare import box_study, cbox_study, voronoi_study
from tmc_vem.study.paper import table2 as second
from tmc_vem.study.paper import table3 as third
from tmc_vem.study.paper.body_figures import FIGURES
from tmc_vem.study.paper.box_figures import GAMMAS, SHOWN, figure4_jobs, figure5_jobs
from tmc_vem.study.paper.cells import judged, mesh_name, ours, printed, ratio
from tmc_vem.study.paper.jobs import box_job
from tmc_vem.study.paper.point_loads import _shortened, _slope
from tmc_vem.study.paper.reproduce import TARGETS, reproduce, write_atomically_in
from tmc_vem.study.paper.values import Printed, table2, table3
from tmc_vem.support.errors import InputError

OPTIONS = {"vem": RunOptions("vem"), "fem": RunOptions("fem")}


# -- comparisons -----------------------------------------------------------------------------------------------------


def test_jobs_of_a_comparison_of_the_box() -> None:
    medium = Medium(alpha_r=1.0, gamma=1e-4)
    study = box_study(medium, -1.0, (1, 2, 4), OPTIONS)
    assert [(level.name, level.size) for level in study.levels] == [
        ("20 x 5", 1.0), ("40 x 10", 0.5), ("80 x 20", 0.25),
    ]  # fmt: skip
    jobs = study.jobs()
    assert [(key, job.label, job.cost, job.options.method) for key, job in jobs.items()] == [
        (("vem", "20 x 5"), "box-vem-20x5", 1 / 16, "vem"), (("vem", "40 x 10"), "box-vem-40x10", 1 / 4, "vem"),
        (("vem", "80 x 20"), "box-vem-80x20", 1.0, "vem"), (("fem", "20 x 5"), "box-fem-20x5", 1 / 8, "fem"),
        (("fem", "40 x 10"), "box-fem-40x10", 1 / 2, "fem"), (("fem", "80 x 20"), "box-fem-80x20", 2.0, "fem"),
    ]  # fmt: skip
    assert [job.problem.cells for job in jobs.values()] == [(20, 5), (40, 10), (80, 20)] * 2
    assert study.title == "Box: VEM and FEM, gamma = 0.0001, alpha_r = 1, regulariser huhu_lulu"
    assert list(study.paper) == ["FEM, fine mesh", "VEM, mesh 1", "VEM, mesh 2", "VEM, mesh 3"]
    cells = table2()[1.0, 1e-4]
    assert study.paper["FEM, fine mesh"] == (cells["fem_fine"].value, cells["fem_fine"].suspect)
    assert study.paper["VEM, mesh 3"] == (cells["vem_mesh3"].value, cells["vem_mesh3"].suspect)


@pytest.mark.parametrize(
    ("medium", "uy"),
    [(Medium(alpha_r=1.0, gamma=1e-4), -0.9), (Medium(alpha_r=1.0, gamma=1e-4, beta=0.0), -1.0),
     (Medium(alpha_r=1.0, gamma=1e-4, regulariser="angle"), -1.0), (Medium(alpha_r=3.0), -1.0),
     (Medium(alpha=1.0), -1.0)],
)  # fmt: skip
def test_the_paper_says_nothing_about_other_parameters(medium: Medium, uy: float) -> None:
    assert box_study(medium, uy, (1,), OPTIONS).paper == {}


def test_studies_name_what_they_compare_and_refuse_no_cells() -> None:
    own = Medium(gamma=1e-3, alpha=2.5, regulariser="angle")
    assert cbox_study(own, -0.5, (1,), OPTIONS).title == (
        "C-box: VEM and FEM, gamma = 0.001, alpha = 2.5, regulariser angle"
    )
    with pytest.raises(InputError, match="mesh factor 0: use 1 for 20 x 5 cells, 2 for 40 x 10, and so on"):
        box_study(own, -1.0, (1, 0), OPTIONS)
    assert box_study(own, -1.0, (1,), OPTIONS, 3).levels[0].problems["vem"] == Box(
        cells=(20, 5), medium=own, uy=-1.0, medium_refinement=3
    )


def test_levels_of_the_c_box() -> None:
    medium = angle_medium(1e-5, 1.0)
    levels = cbox_study(medium, -0.4, (1, 3), OPTIONS).levels
    assert [(level.name, level.size) for level in levels] == [("10 x 5", 1.0), ("30 x 15", pytest.approx(1 / 3))]
    for n, level in zip((1, 3), levels, strict=True):
        vem = CBox(cells=(10 * n, 5 * n), medium=medium, uy=-0.4, polygons_across=2 * n + 1, column_cells=n)
        assert level.problems["vem"] == vem
        assert level.problems["fem"] == CBox(
            cells=(10 * n, 5 * n), medium=medium, uy=-0.4, polygons_across=2 * n + 1, column_cells=n,
            solid_cells="quadrilaterals",
        )  # fmt: skip


def test_levels_of_voronoi_cells_go_from_coarse_to_fine() -> None:
    medium = angle_medium(1e-4, 1.0)
    study = voronoi_study(lambda size: Punch(size=size, medium=medium), medium, (0.1, 0.2, 0.14), OPTIONS)
    assert [(level.name, level.size) for level in study.levels] == [
        ("size 0.2", 0.2), ("size 0.14", 0.14), ("size 0.1", 0.1),
    ]  # fmt: skip
    assert study.title.startswith("Punch: VEM and FEM, gamma = 0.0001, alpha_r = 1, regulariser angle")
    last = study.levels[-1].problems
    assert last == {"vem": Punch(size=0.1, medium=medium), "fem": Triangulated(last["vem"], 0.1)}
    assert [job.cost for job in study.jobs().values()] == pytest.approx(
        [0.25, (0.1 / 0.14) ** 2, 1.0, 0.5, 2 * (0.1 / 0.14) ** 2, 2.0]
    )


def test_limits_of_meshes_need_three_complete_runs() -> None:
    runs: list[Any] = [SimpleNamespace(gap=value, complete=True) for value in (9.0, 1.25, 1.0625, 1.015625)]
    sizes = [8.0, 4.0, 2.0, 1.0]
    found = compare.converged(sizes, runs)
    assert found is not None
    assert found.value == pytest.approx(1.0)
    runs[2].complete = False
    assert compare.converged(sizes, runs) is None
    assert compare.converged(sizes[2:], runs[2:]) is None


# -- the paper's figures ---------------------------------------------------------------------------------------------


def test_the_figures_of_deformed_states() -> None:
    quarters, open_gap = (0.25, 0.5, 0.75, 1.0), "The paper gives the initial gap in a figure only; ours is the default"
    end = " of the problem."
    assert [(f.number, f.title, f.caption, f.note.removesuffix(end), tuple(f.shares)) for f in FIGURES] == [
        (7, "C-box at u_y = -0.5", "Deformed C-box with two densities of the medium (figure 7 of the paper).",
         "gamma = 1e-5, alpha_r = 1.", (1.0,)),
        (8, "C-box up to u_y = -1", "Deformed C-box at increasing displacement (figure 8 of the paper).",
         "gamma = 1e-5, alpha_r = 20.", quarters),
        (10, "punch as soft as the block", "Punch at increasing displacement (figure 10 of the paper).",
         f"gamma = 1e-4, alpha_r = 1. {open_gap}", quarters),
        (11, "punch a hundred times stiffer", "Punch at increasing displacement (figure 11 of the paper).",
         f"gamma = 1e-4, alpha_r = 1. {open_gap}", quarters),
        (13, "several bodies, half discs guided", "Case 1 at increasing displacement (figure 13 of the paper).",
         f"gamma = 1e-4, alpha_r = 10. {open_gap}", (0.5, 1.0)),
        (14, "several bodies, half discs free", "Case 2 at increasing displacement (figure 14 of the paper).",
         f"gamma = 1e-4, alpha_r = 10. {open_gap}", (0.5, 1.0)),
    ]  # fmt: skip
    assert all(figure.options == RunOptions(snapshots=20) for figure in FIGURES)


PROBLEMS = {
    7: lambda quick: {f"medium divided by {n}": CBox(cells=(10, 5) if quick else (20, 10), medium_refinement=n, uy=-0.5)
                      for n in (1, 2)},
    8: lambda quick: {"C-box": CBox(cells=(10, 5) if quick else (20, 10), medium=angle_medium(1e-5, 20.0), uy=-1.0)},
    10: lambda quick: {"punch": Punch(size=0.2 if quick else 0.1, stiffness=1.0)},
    11: lambda quick: {"punch": Punch(size=0.2 if quick else 0.1, stiffness=100.0)},
    13: lambda quick: {"case 1": Bodies(case=1, size=0.15 if quick else 0.1)},
    14: lambda quick: {"case 2": Bodies(case=2, size=0.15 if quick else 0.1)},
}  # fmt: skip


@pytest.mark.parametrize("quick", [False, True])
@pytest.mark.parametrize("figure", FIGURES, ids=lambda figure: str(figure.number))
def test_the_runs_of_a_figure(figure: Any, quick: bool) -> None:
    wanted, jobs = PROBLEMS[figure.number](quick), figure.jobs(quick)
    assert list(jobs) == list(wanted)
    for label, problem in wanted.items():
        assert jobs[label] == Job(f"fig{figure.number}-{problem.name}", problem, RunOptions(snapshots=20), 10.0)
    target = TARGETS[f"fig{figure.number}"]
    assert target.title == f"Figure {figure.number}: {figure.title}"
    assert target.jobs(quick) == jobs


def test_runs_of_the_box_and_what_they_cost() -> None:
    plain = box_job("vem", (20, 5), Medium(gamma=1e-5, alpha_r=0.1), steps=7)
    assert plain == Job(
        "box-vem-20x5-huhu_lulu-a0.1-g1e-05", Box(cells=(20, 5), medium=Medium(gamma=1e-5, alpha_r=0.1)),
        RunOptions("vem", steps=7), (100 / 400 + 0.5) ** 1.2,
    )  # fmt: skip
    fine = box_job("fem", (40, 10), Medium(gamma=1e-6, alpha_r=10.0, beta=0.0, regulariser="angle"), 3)
    assert fine.label == "box-fem-40x10-r3-angle-undamped-a10-g1e-06"
    assert fine.cost == pytest.approx(1.2 * (400 * (0.46 + 0.54 * 9) / 400 + 0.5) ** 1.2 * 2.0)
    assert fine.problem.medium_refinement == 3
    assert fine.options == RunOptions("fem")


def test_runs_of_figures_4_and_5() -> None:
    assert (GAMMAS, SHOWN) == ((1e-4, 1e-5, 1e-6), (0.3, 0.6, 1.0))
    for quick, cells in ((True, (20, 5)), (False, (60, 15))):
        four = figure4_jobs(quick)
        assert list(four) == ["gamma = 1e-04", "gamma = 1e-05", "gamma = 1e-06"]
        for gamma, job in zip(GAMMAS, four.values(), strict=True):
            assert job == box_job("vem", cells, Medium(gamma=gamma, alpha_r=0.1), 3, steps=20)
        five = figure5_jobs(quick)
        assert five == {
            f"mesh {n}": box_job("vem", cells, Medium(gamma=1e-6, alpha_r=0.1), n, steps=20) for n in (1, 3)
        }


def test_runs_of_table_2() -> None:
    pairs = [(alpha, gamma) for alpha in (0.1, 1.0, 10.0) for gamma in (1e-4, 1e-5, 1e-6)]
    assert set(table2()) == set(pairs) == set(second.MEDIA)
    assert all(
        (m.alpha_r, m.gamma, m.beta, m.regulariser) == (*pair, 5.0, "huhu_lulu") for pair, m in second.MEDIA.items()
    )
    for quick, solid, fine, uniform in (
        (True, (20, 5), (40, 10), ((20, 5), (40, 10), (60, 15))),
        (False, (60, 15), (120, 30), ((40, 10), (80, 20), (120, 30), (160, 40))),
    ):
        wanted = {
            job.label
            for medium in second.MEDIA.values()
            for job in (
                *(box_job("vem", solid, medium, n) for n in (1, 2, 3)), box_job("fem", fine, medium),
                *(box_job("vem", cells, medium) for cells in uniform),
            )
        }  # fmt: skip
        assert set(second.jobs(quick)) == wanted
    medium = second.MEDIA[1.0, 1e-4]
    results: Any = {box_job("vem", cells, medium).name: cells for cells in second.UNIFORM[True]}
    assert second.uniform(results, medium, True) == list(second.UNIFORM[True])
    assert (second.FEM_WITHIN, second.VEM_WITHIN, second.SINKING) == (0.02, 0.05, (1.0, 1e-4))


def test_summary_of_table_2() -> None:
    assert second._summary(7, {"paper": [0.01, None, -0.0234], "fem": [], "vem": [-0.005]}) == (
        "7 of 9 pairs reach full load with both methods on all meshes. The paper's fine FEM, without suspect cells, is "
        "within 2.3 % of our converged gap. Our three VEM meshes are within 0.5 % of it."
    )


def test_runs_of_table_3() -> None:
    for quick, meshes in ((True, ((20, 5), (40, 10))), (False, ((20, 5), (40, 10), (80, 20)))):
        wanted = {
            box_job("vem", cells, Medium(alpha_r=10.0, gamma=1e-6, beta=beta, regulariser=name)).label
            for name in ("huhu_lulu", "angle", "tangent") for beta in (0.0, 5.0) for cells in meshes
        }  # fmt: skip
        assert set(third.jobs(quick)) == wanted
    jobs = list(third.jobs(True).values())
    results: Any = {
        job.name: SimpleNamespace(complete=True, gap=1.0 + 0.25 * (n == 3) + 9.0 * (job.inputs["cells"] == [40, 10]))
        for n, job in enumerate(jobs)
    }
    assert third._spread(results, True) == pytest.approx(0.025)
    assert jobs[3].inputs["cells"] == [40, 10]
    assert third._spread({}, True) is None


def test_printed_values_and_those_that_are_suspect() -> None:
    found = {(key, column): cell.suspect for key, row in table2().items() for column, cell in row.items()}
    assert {place: reason for place, reason in found.items() if reason} == SUSPECT
    angle = "the same digits stand in Table 2, for another regulariser and"
    assert [[cell.suspect for cell in row.values()] for row in table3().values()] == [
        ["", "", ""], [f"{angle} alpha_r = 1", f"{angle} alpha_r = 1", f"{angle} twice"], ["", "", ""],
    ]  # fmt: skip
    assert table2()[10.0, 1e-5]["vem_mesh2"] == Printed(1.9476e-03)
    assert [cell.value for cell in table3()["tangent"].values()] == [5.1127e-04, 5.4095e-04, 4.0902e-04]
    assert [list(row) for row in table3().values()] == [["vem_mesh1", "vem_mesh2", "vem_mesh3"]] * 3
    assert [list(row) for row in table2().values()] == [["vem_mesh1", "vem_mesh2", "vem_mesh3", "fem_fine"]] * 9
    assert (Printed(1.0).usable, Printed(1.0, "odd").usable, Printed(None).usable) == (True, False, False)


OTHER = "the same digits stand in Table 3, for another regulariser and alpha_r = 10"
SUSPECT = {
    ((10.0, 1e-5), "vem_mesh1"): "off every trend: 38 % above the other meshes and the finite elements",
    ((10.0, 1e-6), "vem_mesh1"): "off every trend: 40 % or more above the other meshes",
    ((10.0, 1e-6), "vem_mesh3"): "the same digits stand in the next column and in Table 3",
    ((10.0, 1e-6), "fem_fine"): "the same digits stand in the column before and in Table 3",
    ((1.0, 1e-6), "vem_mesh1"): OTHER,
    ((1.0, 1e-6), "vem_mesh2"): OTHER,
}


def test_entries_of_tables() -> None:
    assert printed(Printed(0.0012345)) == Entry("1.2345e-03")
    assert printed(Printed(None)) == Entry("does not converge")
    odd = printed(Printed(0.5, "too large"))
    assert (odd.note, odd.style) == ("suspect: too large", "suspect")
    assert ours(None) == Entry("failed", style="bad")
    assert ours(SimpleNamespace(complete=True, gap=0.5)) == "5.0000e-01"  # type: ignore[arg-type]
    assert ratio(0.5, Printed(0.25)) == "2.000"
    assert ratio(0.5, Printed(0.25, "odd")) == Entry("2.000", style="suspect")
    assert ratio(None, Printed(0.25)) == ratio(0.5, Printed(None)) == "–"
    assert judged(None, 0.1) == Entry("–")
    assert [judged(value, 0.02).style for value in (0.02, -0.02, 0.021, -0.021)] == ["good", "good", "bad", "bad"]
    assert mesh_name((20, 5)) == "20 x 5"


def test_how_far_points_come_closer_and_how_the_gap_follows() -> None:
    fields: Any = SimpleNamespace(
        polygons=SimpleNamespace(points_nx=np.array([(0.0, 0.0), (1.0, 0.5), (1.0, 0.4)])),
        displacement_ni=np.array([(0.0, 0.0), (0.0, -0.03), (0.0, -0.01)]),
    )
    assert _shortened(fields, (1.0, 0.5), (1.0, 0.4)) == pytest.approx(0.02)
    steps = [SimpleNamespace(gap=gap, displacement=d) for gap, d in ((9.0, 0.0), (0.5, -0.75), (0.25, -1.0))]
    assert _slope(SimpleNamespace(history=steps)) == pytest.approx(-1.0)


def test_what_is_unknown_and_where_files_go(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        reproduce(["table2", "fig6"], tmp_path, command="")
    assert str(caught.value) == (
        "the paper has no 'fig6' here: choose table2, table3, fig4, fig5, fig7, fig8, fig10, fig11, fig13, fig14, all"
    )
    for _ in range(2):
        write_atomically_in(tmp_path / "a" / "b", "c.csv", "text")
    assert (tmp_path / "a" / "b" / "c.csv").read_text() == "text"


# -- batches ---------------------------------------------------------------------------------------------------------


def test_names_of_jobs_tell_inputs_apart_and_nothing_else() -> None:
    box = Box(cells=(20, 5))
    job = Job("a", box, RunOptions(largest_step=1.0))
    assert job.inputs["cells"] == [20, 5]
    assert job.name == Job("a", box, RunOptions(largest_step=1), 7.0).name  # 1 and 1.0 are equal
    assert job.name.startswith("a-")
    assert len(job.name) == 2 + 8
    assert job.name != Job("a", box, RunOptions(largest_step=0.5)).name
    assert _found(job, Path("nowhere")) is None


def test_a_batch_of_no_processes_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"^0 processes: use 1 or more$"):
        run_batch([], tmp_path, processes=0)


def test_the_time_left_follows_from_the_work_done(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    jobs = [Job(name, Box(cells=(20, 5)), RunOptions(), cost) for name, cost in (("a", 1.0), ("b", 3.0))]
    seen: list[Any] = []
    observer: Any = SimpleNamespace(finished=lambda outcome, n, left: seen.append((outcome.job.label, n, left)))
    pool = _Pool(jobs, tmp_path, 1, observer, {}, started=100.0)
    pool.total_cost = 4.0
    monkeypatch.setattr("tmc_vem.study.batch.time.monotonic", lambda: 110.0)
    assert (pool._fraction(), pool._seconds_left()) == (0.0, None)
    worker: Any = _Worker(jobs[1], None, None, load=0.02)  # type: ignore[arg-type]
    pool.running = [worker]
    assert (pool._fraction(), pool._seconds_left()) == (pytest.approx(0.015), None)
    worker.load = 0.5
    assert (pool._fraction(), pool._seconds_left()) == (0.375, pytest.approx(10.0 * (1 / 0.375 - 1.0)))
    pool.running = []
    pool._finish(Outcome(jobs[0], None, "bad"))
    assert seen == [("a", 1, pytest.approx(30.0))]
    assert pool.done[jobs[0].name].error == "bad"


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(None, ""), (0.0, ""), (89.4, ", about 89 s left"), (90.0, ", about 2 min left"), (600.0, ", about 10 min left")],
)
def test_the_time_left_in_words(seconds: float | None, text: str) -> None:
    assert _left(seconds) == text


def test_lines_of_a_batch(capsys: pytest.CaptureFixture[str]) -> None:
    monitor = BatchMonitor()
    monitor.started(3, 1)
    job = Job("a", Box(cells=(20, 5)), RunOptions())
    monitor.finished(Outcome(job, None, "no way"), 2, 30.0)
    assert (monitor.n_jobs, monitor.n_done) == (3, 2)
    monitor.interrupted()
    monitor.started(2, 0)
    monitor.advanced(0.5, 3.0, ["a"])
    assert capsys.readouterr().err.splitlines() == [
        "3 runs, 1 of them done before", "[2/3] a: failed: no way, about 30 s left",
        "2 of 3 runs are done and kept; the same command does the others", "2 runs",
    ]  # fmt: skip
