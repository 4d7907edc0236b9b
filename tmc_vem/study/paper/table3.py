"""Table 3: which runs, and ours beside the paper's."""

from __future__ import annotations

from collections.abc import Mapping

from tmc_vem.problems import Medium
from tmc_vem.report.page import Block, Entry, Section, Table, Text
from tmc_vem.report.tables import full_gap
from tmc_vem.study.batch import Job
from tmc_vem.study.paper.cells import mesh_name, ours, printed, ratio
from tmc_vem.study.paper.jobs import Cells, box_job
from tmc_vem.study.paper.target import Results, Target
from tmc_vem.study.paper.values import table3

MESHES: dict[bool, tuple[Cells, ...]] = {False: ((20, 5), (40, 10), (80, 20)), True: ((20, 5), (40, 10))}
REGULARISERS = {"huhu_lulu": "(9) huhu_lulu", "angle": "(15) angle", "tangent": "(16) tangent"}
NOTE = (
    "The paper's three meshes are those of its Table 2, shown in a figure only. Ours are equal squares, so the columns "
    "are beside each other for scale and not cell by cell."
)


def jobs(quick: bool) -> dict[str, Job]:
    """Three regularisers with and without damping."""
    media = [_medium(name, beta) for name in table3() for beta in (0.0, 5.0)]
    found = [box_job("vem", cells, medium) for medium in media for cells in MESHES[quick]]
    return {job.label: job for job in found}


def _medium(regulariser: str, beta: float) -> Medium:
    return Medium(alpha_r=10.0, gamma=1e-6, beta=beta, regulariser=regulariser)


def sections(results: Results, quick: bool) -> list[Section]:
    """Paper, ours without and with damping."""
    blocks: list[Block] = [Text(NOTE)]
    meshes = MESHES[quick]
    for beta, what in ((0.0, "without damping"), (5.0, "damped by exp(-5 J)")):
        rows = []
        for name, cells in table3().items():
            row: list[str | Entry] = [REGULARISERS[name]]
            for n, mesh in enumerate(meshes):
                run = results.get(box_job("vem", mesh, _medium(name, beta)).name)
                column = cells[f"vem_mesh{n + 1}"]
                row += [printed(column), ours(run), ratio(full_gap(run), column)]
            rows.append(row)
        head = ["regulariser"]
        for n, mesh in enumerate(meshes):
            head += [f"paper, mesh {n + 1}", f"ours, {mesh_name(mesh)}", "ours / paper"]
        blocks.append(Table(f"Gap at u_y = -1, gamma = 1e-6, alpha_r = 10, {what}.", head, rows))
    spread = _spread(results, quick)
    if spread is not None:
        text = (
            f"On one mesh, all regularisers with and without damping agree within {100 * spread:.1f} %: the choice has "
            "little effect, as the paper says."
        )
        blocks.insert(0, Text(text))
    return [Section("Regularisers", blocks)]


def _spread(results: Results, quick: bool) -> float | None:
    """Largest relative spread of the gap on a mesh."""
    by_mesh: dict[str, list[float]] = {}
    for job in jobs(quick).values():
        gap = full_gap(results.get(job.name))
        if gap is not None:
            by_mesh.setdefault(str(job.inputs["cells"]), []).append(gap)
    return max((max(gaps) / min(gaps) - 1.0 for gaps in by_mesh.values()), default=None)


TARGETS: Mapping[str, Target] = {
    "table3": Target(
        "Table 3: gap of the box for three regularisers",
        "gamma = 1e-6, alpha_r = 10, with and without the damping factor exp(-5 J).",
        jobs,
        sections,
    )
}
