"""tmc-vem compare, reproduce, list, plot and animate, from the command line to the page in a browser."""

from __future__ import annotations

import csv
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from html.parser import HTMLParser
from pathlib import Path

import pytest
from helpers_process import clean_environment

from tmc_vem.problems import Bodies, Box, Punch
from tmc_vem.problems.cbox import angle_medium
from tmc_vem.problems.probes import Displacement, Gap, Reaction
from tmc_vem.report.comparison import Comparison, Method, comparison_page
from tmc_vem.report.problem_figure import draw_problem
from tmc_vem.report.richardson import Extrapolation
from tmc_vem.report.write import to_markdown
from tmc_vem.results.records import StepRecord
from tmc_vem.results.run_result import RunResult
from tmc_vem.simulation import RunOptions
from tmc_vem.study.batch import Job, Outcome
from tmc_vem.study.compare import METHODS, cbox_study, compare, converged, voronoi_study
from tmc_vem.study.paper import table2 as paper_table2
from tmc_vem.study.paper import table3 as paper_table3
from tmc_vem.study.paper.point_loads import creep, sinking
from tmc_vem.study.paper.reproduce import TARGETS, reproduce
from tmc_vem.study.paper.values import table2, table3
from tmc_vem.support.errors import InputError

SHORT = ("--uy", "-0.05", "--factor", "1", "--factor", "2", "--factor", "3")


def tmc(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", "from tmc_vem.cli.main import main; main()", *arguments]
    return subprocess.run(
        command, cwd=cwd, capture_output=True, text=True, timeout=600, env=clean_environment(), check=False
    )


@pytest.fixture(scope="module")
def compared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("dolfinx")
    cwd = tmp_path_factory.mktemp("compare")
    done = tmc("compare", "box", *SHORT, "--out", "out", cwd=cwd)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "report: out/report.html" in done.stdout
    return cwd / "out"


class Content(HTMLParser):
    """Images, headings and tables of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.images: list[str] = []
        self.tables = 0
        self.headings: list[str] = []
        self._tag = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._tag = tag
        self.tables += tag == "table"
        if tag == "img":
            self.images.append(dict(attrs)["src"] or "")

    def handle_data(self, data: str) -> None:
        if self._tag == "h2" and data.strip():
            self.headings.append(data.strip())


def test_the_report_holds_what_it_promises(compared: Path) -> None:
    content = Content((compared / "report.html").read_text())
    assert content.headings == ["Result", "Problem", "Mesh convergence", "Loading", "Deformed states", "Solution",
                                "How to repeat this"]  # fmt: skip
    assert len(content.images) == 10
    assert all(source.startswith("data:image/") for source in content.images)
    assert content.tables >= 7
    text = (compared / "report.md").read_text()
    for word in ("smallest J, medium", "energy, solid", "petsc", "revision", "Richardson", "--factor 3", "difference"):
        assert word in text, word
    with (compared / "runs.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["run"] for row in rows] == [f"{m} {20 * n} x {5 * n}" for m in ("VEM", "FEM") for n in (1, 2, 3)]
    assert len({row["directory"] for row in rows}) == 6
    # both methods solve the same problem
    assert float(rows[2]["gap"]) == pytest.approx(float(rows[5]["gap"]), rel=1e-3)
    assert {path.stem for path in (compared / "figures").glob("*.svg")} == {
        path.stem for path in (compared / "figures").glob("*.png")
    }


def test_runs_are_reused(compared: Path) -> None:
    before = {path: path.stat().st_mtime_ns for path in compared.glob("runs/*/result.json")}
    done = tmc("compare", "box", *SHORT, "--out", "out", cwd=compared.parent)
    assert done.returncode == 0, done.stderr
    assert "6 runs, 6 of them done before" in done.stderr
    assert before == {path: path.stat().st_mtime_ns for path in compared.glob("runs/*/result.json")}


def test_the_page_in_a_browser(compared: Path, tmp_path: Path) -> None:
    browser = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if browser is None:
        pytest.skip("no chromium: apt-get install chromium")
    # reports what loaded by its title, which --dump-dom shows
    page = (compared / "report.html").read_text()
    probe = (
        "<script>window.addEventListener('load', () => { const all = [...document.images];"
        "document.body.setAttribute('data-bad', all.filter(i => !(i.complete && i.naturalWidth > 0)).length);"
        "document.body.setAttribute('data-images', all.length);"
        "document.body.setAttribute('data-wide', document.documentElement.scrollWidth > window.innerWidth);"
        "});</script>"
    )
    copy = tmp_path / "report.html"
    copy.write_text(page.replace("</head>", probe + "</head>"))
    options = ("--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-sync",
               "--disable-component-update", "--window-size=1200,900", "--enable-logging=stderr", "--v=0",
               f"--user-data-dir={tmp_path / 'profile'}", "--dump-dom")  # fmt: skip
    done = subprocess.run([browser, *options, copy.as_uri()], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert 'data-images="10"' in done.stdout
    assert 'data-bad="0"' in done.stdout
    assert 'data-wide="false"' in done.stdout
    assert "CONSOLE" not in done.stderr
    assert done.stdout.count("<table") >= 7


def test_list_plot_and_animate(compared: Path, tmp_path: Path) -> None:
    listed = tmc("list", str(compared), cwd=tmp_path)
    assert listed.returncode == 0, listed.stderr
    assert "method" in listed.stdout
    assert "gamma" not in listed.stdout  # all runs have the same
    data = json.loads(tmc("list", str(compared), "--json", cwd=tmp_path).stdout)
    assert len(data) == 6
    run = next(compared.glob("runs/box-vem-20x5-*"))
    plotted = tmc("plot", str(run), "--out", "plots", "--quantity", "J", cwd=tmp_path)
    assert plotted.returncode == 0, plotted.stderr
    assert {path.name for path in (tmp_path / "plots" / "figures").glob("*.png")} == {
        "states.png", "loading.png", "smallest-j.png", "energy.png", "newton.png", "field-uy.png", "probes-1.png",
        "contact-tractions.png", "contact-pressure.png",
    }  # fmt: skip
    animated = tmc("animate", str(run), "--out", "box.gif", cwd=tmp_path)
    assert animated.returncode == 0, animated.stderr
    assert (tmp_path / "box.gif").read_bytes().startswith(b"GIF89a")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("compare", "box", "--factor", "1"), "1 meshes"),
        (("compare", "box", "--gamma", "-1"), "gamma = -1"),
        (("reproduce", "table9"), "no 'table9'"),
        (("list", "nowhere"), "not a directory"),
        (("plot", "nowhere"), "not a run directory"),
        (("animate", "nowhere"), "not a run directory"),
        (("animate", "nowhere", "--out", "x.mp4"), ".gif"),
    ],
)
def test_bad_input_is_one_line(arguments: tuple[str, ...], message: str, tmp_path: Path) -> None:
    done = tmc(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_studies_of_other_problems_differ_in_mesh_and_method_only() -> None:
    options = {method: RunOptions(method) for method in METHODS}
    medium = angle_medium(1e-4, 1.0)
    cbox = cbox_study(medium, -0.3, (1, 2, 3), options)
    punch = voronoi_study(lambda size: Punch(size=size, medium=medium), medium, (0.1, 0.2, 0.15), options)
    for study in (cbox, punch):
        jobs = study.jobs()
        assert len({job.name for job in jobs.values()}) == 6
        assert {str(job.inputs["medium"]) for job in jobs.values()} == {str(medium.as_dict())}
    assert [level.size for level in punch.levels] == [0.2, 0.15, 0.1]
    triangles = punch.jobs()["fem", "size 0.2"].problem
    assert triangles.inputs()["triangle_size"] == 0.2
    assert triangles.load() == punch.jobs()["vem", "size 0.2"].problem.load()


def test_meshes_of_a_study_refine_everything_and_keep_the_geometry() -> None:
    study = cbox_study(angle_medium(1e-5, 1.0), -0.5, (1, 2, 4), {method: RunOptions(method) for method in METHODS})
    for method in METHODS:
        meshes = [level.problems[method].make_mesh() for level in study.levels]
        assert len({float(mesh.points_vx[:, 0].max()) for mesh in meshes}) == 1
        for region in ("solid", "medium"):
            counts = [(mesh.region_c == mesh.region_names.index(region)).sum() for mesh in meshes]
            assert counts == sorted(set(counts)), (method, region)


def test_a_mesh_that_cannot_be_made_costs_that_run_only(tmp_path: Path) -> None:
    medium = angle_medium(1e-4, 1.0)
    study = voronoi_study(
        lambda size: Bodies(size=size, medium=medium, uy=0.01), medium, (0.2, 0.15), {"vem": RunOptions("vem")}
    )
    report, comparison = compare(study, tmp_path, command="tmc-vem compare bodies")
    assert list(comparison.methods[0].runs) == ["size 0.15"]
    assert "gave no result: the interface near" in report.read_text()


def method(name: str, gap: float, uncertainty: float, energy: float, penalty: str, **probes: float) -> Method:
    record = StepRecord(
        1, 1.0, -1.0, {"gap": gap, **probes}, -1.0, 3, 0, 0, {"medium": 0.1}, {"medium": energy}, 0, False, 1.0
    )
    inputs = {"method": name.lower(), "interior_penalty": penalty}
    run = RunResult(inputs, {}, True, "", 1.0, 4, 9, 3, 0, {}, {"total": 1.0}, [record], media=["medium"])
    return Method(name, {"coarse": run}, {"gap": Extrapolation(gap, None, uncertainty)})


@pytest.mark.usefixtures("undrawn")
def test_the_report_doubts_what_it_must() -> None:
    def warnings(*methods: Method) -> str:
        return to_markdown(comparison_page(Comparison("t", "c", methods)))

    calm = warnings(method("VEM", 1.0, 0.01, 1.0, "none"), method("FEM", 1.015, 0.01, 1.05, "penalty"))
    assert "differ by" not in calm
    assert "not mesh-converged" not in calm
    apart = warnings(method("VEM", 1.0, 0.01, 1.0, "none"), method("FEM", 1.05, 0.03, 2.0, "penalty"))
    assert "converged values of the gap differ by more than their uncertainties" in apart
    assert "FEM is not mesh-converged: the uncertainty of the gap is 2.9%" in apart
    assert "energies of the medium differ by a factor 2.0" in apart
    assert "relative to each method's own converged value" in apart


@pytest.mark.usefixtures("undrawn")
def test_probes_of_both_methods_stand_beside_each_other() -> None:
    methods = [method(name, 1.0, 0.01, 1.0, "none", bulge=bulge) for name, bulge in (("VEM", 0.0202), ("FEM", 0.02))]
    page = comparison_page(Comparison("t", "c", methods))
    assert "| bulge | 2.0200e-02 | 2.0000e-02 | +1.00 % |" in to_markdown(page)
    assert "probes-1" in [picture.name for picture in page.pictures]


def test_a_problem_is_drawn_with_its_probes() -> None:
    box = Box(cells=(20, 5))
    probes = {**box.probes(), "top": Displacement("uy", "load"), "held": Reaction("uy", "support_left"),
              "corner": Gap((0.1, 0.1), (0.1, 0.4))}  # fmt: skip
    figure = draw_problem(box.make_mesh(), ["medium"], box.prescribed(), box.load(), probes)
    labels = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert labels[-3:] == ["gap", "top", "corner"]
    (corner,) = (line for line in figure.axes[0].lines if list(line.get_xdata()) == [0.1, 0.1])
    assert list(corner.get_ydata()) == [0.1, 0.4]


def test_the_papers_tables() -> None:
    assert table2()[10.0, 1e-4]["fem_fine"].value == 8.2690e-3
    assert table2()[0.1, 1e-6]["fem_fine"].value is None
    assert not table2()[0.1, 1e-6]["fem_fine"].usable
    suspect = [(row, name) for row, cells in table2().items() for name, cell in cells.items() if cell.suspect]
    assert suspect == [((10.0, 1e-5), "vem_mesh1"), ((10.0, 1e-6), "vem_mesh1"), ((10.0, 1e-6), "vem_mesh3"),
                       ((10.0, 1e-6), "fem_fine"), ((1.0, 1e-6), "vem_mesh1"), ((1.0, 1e-6), "vem_mesh2")]  # fmt: skip
    assert all(cell.suspect for cell in table3()["angle"].values())
    # what is called repeated is repeated
    assert table2()[10.0, 1e-6]["vem_mesh3"].value == table2()[10.0, 1e-6]["fem_fine"].value
    assert table3()["angle"]["vem_mesh1"].value == table2()[1.0, 1e-6]["vem_mesh1"].value


def result(gap: float, load: float = 1.0) -> RunResult:
    record = StepRecord(1, load, -load, {"gap": gap}, -1.0, 3, 0, 0, {"solid": 0.9}, {"solid": 1.0}, 0, False, 1.0)
    return RunResult({}, {}, load == 1.0, "", load, 4, 9, 3, 0, {}, {"total": 1.0}, [record])


def test_converged_value_of_a_known_sequence() -> None:
    sizes = [1.0, 0.5, 0.25]
    limit = converged(sizes, [result(2.0 + 0.1 * h**2) for h in sizes])
    assert limit is not None
    assert limit.value == pytest.approx(2.0)
    assert limit.order == pytest.approx(2.0)
    assert converged(sizes, [result(2.0), result(1.9), None]) is None
    assert converged(sizes, [result(2.0), result(1.9), result(1.8, load=0.7)]) is None


def test_single_nodes_sink_in_further_on_finer_meshes(compared: Path) -> None:
    runs = {n: RunResult.read(next(compared.glob(f"runs/box-vem-{20 * n}x{5 * n}-*"))) for n in (1, 2, 3)}
    table = sinking({str(n): run for n, run in runs.items()})
    assert table is not None
    for column in (1, 2):  # twice the elements, the same load: deeper
        depth = [float(str(row[column])) for row in table.rows]
        assert 0.0 < depth[0] < depth[1] < depth[2]
    assert sinking({"1": runs[1], "2": None}) is None
    assert creep(runs[2], runs[3]) > 0.0  # pressed together a little less
    assert creep(runs[2], None) == 0.0


def test_every_target_has_runs_of_its_own() -> None:
    assert set(TARGETS) == {"table2", "table3", "fig4", "fig5", "fig7", "fig8", "fig10", "fig11", "fig13", "fig14"}
    for name, target in TARGETS.items():
        for quick in (False, True):
            jobs = target.jobs(quick)
            assert jobs, name
            assert len({job.name for job in jobs.values()}) == len(jobs), name
    assert {job.inputs["medium"]["beta"] for job in paper_table3.jobs(True).values()} == {0.0, 5.0}


def test_a_table_without_runs_says_so() -> None:
    fem, vem, *_ = paper_table2.sections({}, quick=True)
    assert "0 of 9 pairs" in fem.blocks[0].text  # type: ignore[union-attr]
    assert "failed" in str(vem.blocks)


def test_reproducing_a_figure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pages = reproduce(["fig4"], tmp_path, quick=True, command="tmc-vem reproduce fig4 --quick")
    text = pages[0].read_text()
    assert len(Content(text).images) == 1
    rows = re.findall(r"<td>-1</td>(.*?)</tr>", text, re.S)
    gaps = [float(value) for value in re.findall(r"<td>([\d.e+-]+)</td>", rows[0])][::2]
    assert gaps == sorted(gaps, reverse=True)  # the gap falls with gamma
    with pytest.raises(InputError, match="no 'fig6'"):
        reproduce(["fig6"], tmp_path, command="")


def test_what_failed_is_said_and_what_worked_is_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def some_fail(jobs: Sequence[Job], *_: object, **__: object) -> list[Outcome]:
        return [Outcome(job, result(0.5) if n else None, "" if n else "no memory") for n, job in enumerate(jobs)]

    monkeypatch.setattr("tmc_vem.study.paper.reproduce.run_batch", some_fail)
    jobs = TARGETS["fig4"].jobs(True)
    (page,) = reproduce(["fig4"], tmp_path, quick=True, command="")
    assert f"{next(iter(jobs))} gave no result: no memory" in page.read_text()
    assert len((tmp_path / "fig4.csv").read_text().splitlines()) == len(jobs), "a head and all but one"


@pytest.mark.slow
def test_table2_from_the_command_line(tmp_path: Path) -> None:
    pytest.importorskip("dolfinx")
    done = tmc("reproduce", "table2", "--quick", "--out", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    page = (tmp_path / "out" / "table2.html").read_text()
    assert "9 of 9 pairs reach full load with both methods on all meshes" in page
    assert page.count('class="suspect"') == 2 * 6  # the cells of the paper that cannot be right, and their ratios
    within = re.search(r"fine FEM, without suspect cells, is within ([\d.]+) % of our converged gap", page)
    assert within is not None
    assert float(within[1]) < 5.0  # coarse meshes
    again = tmc("reproduce", "table2", "--quick", "--out", "out", cwd=tmp_path)
    assert "54 runs, 54 of them done before" in again.stderr
