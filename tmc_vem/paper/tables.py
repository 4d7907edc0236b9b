"""Tables 2 and 3: which runs, and ours beside the paper's."""

from __future__ import annotations

from collections.abc import Mapping

from tmc_vem.batch import Job
from tmc_vem.compare import converged
from tmc_vem.paper.jobs import Cells, box_job
from tmc_vem.paper.target import Results, Target
from tmc_vem.paper.values import Cell as Printed
from tmc_vem.paper.values import table2, table3
from tmc_vem.problems import Medium
from tmc_vem.report.comparison import Converged
from tmc_vem.report.page import Block, Cell, Section, Table, Text
from tmc_vem.report.tables import effort, full_gap, number, percent, reached, relative
from tmc_vem.results import RunResult

# Meshes of the three VEM columns, those that the converged value comes from, and the fine one of FEM.
MESHES: dict[bool, tuple[Cells, ...]] = {False: ((60, 15), (80, 20), (160, 40)), True: ((20, 5), (40, 10), (60, 15))}
LIMIT: dict[bool, tuple[Cells, ...]] = {False: ((40, 10), (80, 20), (160, 40)), True: ((20, 5), (40, 10), (60, 15))}
MESHES3: dict[bool, tuple[Cells, ...]] = {False: ((20, 5), (40, 10), (80, 20)), True: ((20, 5), (40, 10))}
FINE: dict[bool, Cells] = {False: (80, 20), True: (40, 10)}
FEM_WITHIN, VEM_WITHIN = 0.02, 0.05
MEDIA = {pair: Medium(alpha_r=pair[0], gamma=pair[1]) for pair in table2()}
REGULARISERS = {"huhu_lulu": "(9) huhu_lulu", "angle": "(15) angle", "tangent": "(16) tangent"}


def table2_jobs(quick: bool) -> dict[str, Job]:
    """Nine pairs on all meshes."""
    jobs = []
    for medium in MEDIA.values():
        jobs += [box_job("vem", cells, medium) for cells in dict.fromkeys((*MESHES[quick], *LIMIT[quick]))]
        jobs.append(box_job("fem", FINE[quick], medium))
    return {job.label: job for job in jobs}


def table3_jobs(quick: bool) -> dict[str, Job]:
    """Three regularisers with and without damping."""
    meshes = MESHES3[quick]
    jobs = [box_job("vem", cells, _medium3(name, beta)) for name in table3() for beta in (0.0, 5.0) for cells in meshes]
    return {job.label: job for job in jobs}


def _medium3(regulariser: str, beta: float) -> Medium:
    return Medium(alpha_r=10.0, gamma=1e-6, beta=beta, regulariser=regulariser)


def limit(results: Results, medium: Medium, quick: bool) -> Converged | None:
    """Mesh-converged gap from virtual elements on three meshes."""
    meshes = LIMIT[quick]
    runs = [results.get(box_job("vem", cells, medium).name) for cells in meshes]
    return converged([1.0 / cells[0] for cells in meshes], runs)


def printed(cell: Printed) -> Cell:
    """A cell of the paper."""
    text = "does not converge" if cell.value is None else number(cell.value)
    return Cell(text, f"suspect: {cell.suspect}", "suspect") if cell.suspect else Cell(text)


def ours(run: RunResult | None) -> str | Cell:
    """Gap of a run."""
    if run is None:
        return Cell("failed", style="bad")
    return number(run.gap) if run.complete else Cell(reached(run), style="bad")


def judged(value: float | None, within: float) -> Cell:
    """Relative difference, marked by whether it is within a limit."""
    return Cell("–") if value is None else Cell(percent(value), style="good" if abs(value) <= within else "bad")


def table2_sections(results: Results, quick: bool) -> list[Section]:
    """Paper, ours, ratio and converged value."""
    fem_rows: list[list[str | Cell]] = []
    vem_rows: list[list[list[str | Cell]]] = [[] for _ in MESHES[quick]]
    worst: dict[str, list[float]] = {"paper": [], "fem": [], "vem": []}
    complete = 0
    for pair, cells in table2().items():
        medium = MEDIA[pair]
        reference = limit(results, medium, quick)
        value = reference.value if reference else None
        fem = results.get(box_job("fem", FINE[quick], medium).name)
        vem = [results.get(box_job("vem", mesh, medium).name) for mesh in MESHES[quick]]
        complete += all(run is not None and run.complete for run in (fem, *vem))
        paper = cells["fem_fine"]
        to_paper = relative(paper.value, value) if paper.usable else None
        fem_off = relative(full_gap(fem), value)
        vem_off = [relative(full_gap(run), value) for run in vem]
        for name, found in (("paper", [to_paper]), ("fem", [fem_off]), ("vem", vem_off)):
            worst[name] += [abs(x) for x in found if x is not None]
        label = [f"{pair[0]:g}", f"{pair[1]:.0e}"]
        fem_rows.append(
            [*label, printed(paper), ours(fem), _ratio(full_gap(fem), paper), str(reference or "–"),
             judged(to_paper, FEM_WITHIN), judged(fem_off, FEM_WITHIN)]
        )  # fmt: skip
        for n, (run, off) in enumerate(zip(vem, vem_off, strict=True)):
            column = cells[f"vem_mesh{n + 1}"]
            ratio = _ratio(full_gap(run), column)
            vem_rows[n].append([*label, printed(column), ours(run), ratio, judged(off, VEM_WITHIN)])
    summary = [f"{complete} of {len(MEDIA)} pairs reach full load with both methods on all meshes."]
    for name, text in (
        ("paper", "The paper's fine FEM, without suspect cells, is within {} of our converged gap."),
        ("fem", "Our fine FEM is within {} of it."),
        ("vem", "Our VEM meshes are within {} of it."),
    ):
        if worst[name]:
            summary.append(text.format(f"{100 * max(worst[name]):.1f} %"))
    finest = ", ".join(_name(mesh) for mesh in LIMIT[quick])
    vem_tables = [
        Table(
            f"Gap at u_y = -1: the paper's mesh {n + 1} and ours of {_name(mesh)} squares.",
            ("alpha_r", "gamma", "paper", "ours", "ours / paper", "ours to converged"),
            vem_rows[n],
        )
        for n, mesh in enumerate(MESHES[quick])
    ]
    return [
        Section(
            "Fine finite elements and converged values",
            [
                Text(" ".join(summary)),
                Table(
                    f"Gap at u_y = -1. Ours: Q2 on {_name(FINE[quick])}. Converged: VEM on {finest}, Richardson "
                    "extrapolation.",
                    FEM_HEAD,
                    fem_rows,
                ),
            ],
        ),
        Section("Virtual elements", [Text(MESH_NOTE), *vem_tables]),
        Section("Effort", [effort({job.label: run for job in table2_jobs(quick).values()
                                   if (run := results.get(job.name))})]),
    ]  # fmt: skip


FEM_HEAD = ("alpha_r", "gamma", "paper, fine FEM", "our FEM", "ours / paper", "converged", "paper to converged",
            "our FEM to converged")  # fmt: skip
MESH_NOTE = (
    "The paper shows its three meshes in a figure only; their solids have equal cells and their media different ones. "
    "Ours are squares throughout, so the columns are beside each other for scale and not cell by cell."
)


def table3_sections(results: Results, quick: bool) -> list[Section]:
    """Paper, ours without and with damping."""
    blocks: list[Block] = [Text(MESH_NOTE)]
    meshes = MESHES3[quick]
    for beta, what in ((0.0, "without damping"), (5.0, "damped by exp(-5 J)")):
        rows = []
        for name, cells in table3().items():
            row: list[str | Cell] = [REGULARISERS[name]]
            for n, mesh in enumerate(meshes):
                run = results.get(box_job("vem", mesh, _medium3(name, beta)).name)
                column = cells[f"vem_mesh{n + 1}"]
                row += [printed(column), ours(run), _ratio(full_gap(run), column)]
            rows.append(row)
        head = ["regulariser"]
        for n, mesh in enumerate(meshes):
            head += [f"paper, mesh {n + 1}", f"ours, {_name(mesh)}", "ours / paper"]
        blocks.append(Table(f"Gap at u_y = -1, gamma = 1e-6, alpha_r = 10, {what}.", head, rows))
    spread = _spread(results, quick)
    if spread is not None:
        blocks.insert(
            0,
            Text(
                "On one mesh, all regularisers with and without damping agree within "
                f"{100 * spread:.1f} %: the choice has little effect, as the paper says."
            ),
        )
    return [Section("Regularisers", blocks)]


def _spread(results: Results, quick: bool) -> float | None:
    """Largest relative spread of the gap on a mesh."""
    by_mesh: dict[str, list[float]] = {}
    for job in table3_jobs(quick).values():
        gap = full_gap(results.get(job.name))
        if gap is not None:
            by_mesh.setdefault(str(job.inputs["cells"]), []).append(gap)
    return max((max(gaps) / min(gaps) - 1.0 for gaps in by_mesh.values()), default=None)


def _ratio(value: float | None, cell: Printed) -> str | Cell:
    if value is None or cell.value is None:
        return "–"
    text = f"{value / cell.value:.3f}"
    return Cell(text, style="suspect") if cell.suspect else text


def _name(cells: Cells) -> str:
    return f"{cells[0]} x {cells[1]}"


TARGETS: Mapping[str, Target] = {
    "table2": Target(
        "Table 2: gap of the box for nine parameter pairs",
        "Regulariser (9) damped by exp(-5 J). Suspect cells of the paper are shown and not compared with.",
        table2_jobs,
        table2_sections,
    ),
    "table3": Target(
        "Table 3: gap of the box for three regularisers",
        "gamma = 1e-6, alpha_r = 10, with and without the damping factor exp(-5 J).",
        table3_jobs,
        table3_sections,
    ),
}
