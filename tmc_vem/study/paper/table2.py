"""Table 2: which runs, and ours beside the paper's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from tmc_vem.problems import Medium
from tmc_vem.report.page import Block, Entry, Section, Table, Text
from tmc_vem.report.richardson import Extrapolation
from tmc_vem.report.tables import effort, full_gap, number, relative
from tmc_vem.results.run_result import RunResult
from tmc_vem.study.batch import Job
from tmc_vem.study.compare import converged
from tmc_vem.study.paper.cells import judged, mesh_name, ours, printed, ratio
from tmc_vem.study.paper.jobs import Cells, box_job
from tmc_vem.study.paper.point_loads import creep, sinking
from tmc_vem.study.paper.target import Results, Target
from tmc_vem.study.paper.values import table2

# The three VEM columns: one mesh of the solid, and the medium's cells divided, as in figure 3 of the paper.
SOLID: dict[bool, Cells] = {False: (60, 15), True: (20, 5)}
DENSITIES = (1, 2, 3)
# Meshes of equal squares; the converged value comes from the last three.
UNIFORM: dict[bool, tuple[Cells, ...]] = {
    False: ((40, 10), (80, 20), (120, 30), (160, 40)),
    True: ((20, 5), (40, 10), (60, 15)),
}
FINE: dict[bool, Cells] = {False: (120, 30), True: (40, 10)}  # of the finite elements
SINKING = (1.0, 1e-4)  # the pair that shows how far the single nodes sink in
SINKING_NOTE = (
    "The box is supported and loaded at single nodes. These sink in by about the same amount whenever the mesh size is "
    "halved, without end, so that the flanges are pressed together a little less: the gap creeps upwards by some "
    f"tenths of a percent and has no limit in the strict sense. Below for alpha_r = {SINKING[0]:g}, gamma = "
    f"{SINKING[1]:g}; the last column is the gap's derivative with respect to u_y times what the nodes sink in further."
)
FEM_WITHIN, VEM_WITHIN = 0.02, 0.05
MEDIA = {pair: Medium(alpha_r=pair[0], gamma=pair[1]) for pair in table2()}


def jobs(quick: bool) -> dict[str, Job]:
    """Nine pairs on all meshes."""
    found = []
    for medium in MEDIA.values():
        found += [box_job("vem", SOLID[quick], medium, refinement) for refinement in DENSITIES]
        found += [box_job("vem", cells, medium) for cells in UNIFORM[quick] if cells != SOLID[quick]]
        found.append(box_job("fem", FINE[quick], medium))
    return {job.label: job for job in found}


def uniform(results: Results, medium: Medium, quick: bool) -> list[RunResult | None]:
    """Runs of virtual elements on equal squares, from coarse to fine."""
    return [results.get(box_job("vem", cells, medium).name) for cells in UNIFORM[quick]]


def limit(results: Results, medium: Medium, quick: bool) -> Extrapolation | None:
    """Mesh-converged gap from virtual elements on the three finest meshes of equal squares.

    It is not known better than by what the single nodes that carry and load the box sink in further from one mesh to
    the next: that change goes on without end, however well the three values may seem to converge.
    """
    runs = uniform(results, medium, quick)
    found = converged([1.0 / cells[0] for cells in UNIFORM[quick]], runs)
    if found is None:
        return None
    return replace(found, uncertainty=max(found.uncertainty, abs(creep(*runs[-2:]) * found.value)))


def sections(results: Results, quick: bool) -> list[Section]:
    """Paper, ours, ratio and converged value."""
    fem_rows: list[list[str | Entry]] = []
    vem_rows: list[list[list[str | Entry]]] = [[] for _ in DENSITIES]
    mesh_rows: list[list[str | Entry]] = []
    differences: dict[str, list[float | None]] = {"paper": [], "fem": [], "vem": []}
    complete = 0
    for pair, cells in table2().items():
        medium = MEDIA[pair]
        reference = limit(results, medium, quick)
        value = reference.value if reference else None
        fem = results.get(box_job("fem", FINE[quick], medium).name)
        vem = [results.get(box_job("vem", SOLID[quick], medium, n).name) for n in DENSITIES]
        squares = uniform(results, medium, quick)
        complete += all(run is not None and run.complete for run in (fem, *vem, *squares))
        paper = cells["fem_fine"]
        to_paper = relative(paper.value, value) if paper.usable else None
        fem_off = relative(full_gap(fem), value)
        vem_off = [relative(full_gap(run), value) for run in vem]
        differences["paper"].append(to_paper)
        differences["fem"].append(fem_off)
        differences["vem"] += vem_off
        label = [f"{pair[0]:g}", f"{pair[1]:.0e}"]
        fem_rows.append(
            [*label, printed(paper), ours(fem), ratio(full_gap(fem), paper), str(reference or "–"),
             judged(to_paper, FEM_WITHIN), judged(fem_off, FEM_WITHIN)]
        )  # fmt: skip
        for n, (run, off) in enumerate(zip(vem, vem_off, strict=True)):
            column = cells[f"vem_mesh{n + 1}"]
            vem_rows[n].append(
                [*label, printed(column), ours(run), ratio(full_gap(run), column), judged(off, VEM_WITHIN)]
            )
        mesh_rows.append([*label, *(number(full_gap(run)) for run in squares), str(reference or "–")])
    three = ", ".join(mesh_name(mesh) for mesh in UNIFORM[quick][-3:])
    fem_table = Table(
        f"Gap at u_y = -1. Ours: Q2 on {mesh_name(FINE[quick])}. Converged: VEM on {three}, Richardson extrapolation.",
        ("alpha_r", "gamma", "paper, fine FEM", "our FEM", "ours / paper", "converged", "paper to converged",
         "our FEM to converged"),
        fem_rows,
    )  # fmt: skip
    mesh_table = Table(
        "Gap at u_y = -1 on meshes of equal squares, virtual elements.",
        ("alpha_r", "gamma", *(mesh_name(mesh) for mesh in UNIFORM[quick]), "converged"),
        mesh_rows,
    )
    blocks: list[Block] = [mesh_table]
    runs = dict(zip(map(mesh_name, UNIFORM[quick]), uniform(results, MEDIA[SINKING], quick), strict=True))
    sunk = sinking(runs)
    if sunk:
        blocks += [Text(SINKING_NOTE), sunk]
    done = {job.label: run for job in jobs(quick).values() if (run := results.get(job.name))}
    return [
        Section("Fine finite elements and converged values", [Text(_summary(complete, differences)), fem_table]),
        Section("Virtual elements", [Text(mesh_note(quick)), *_vem_tables(vem_rows, quick)]),
        Section("Mesh convergence", blocks),
        Section("Effort", [effort(done)]),
    ]


def _summary(complete: int, differences: Mapping[str, Sequence[float | None]]) -> str:
    lines = [f"{complete} of {len(MEDIA)} pairs reach full load with both methods on all meshes."]
    for name, text in (
        ("paper", "The paper's fine FEM, without suspect cells, is within {} of our converged gap."),
        ("fem", "Our fine FEM is within {} of it."),
        ("vem", "Our three VEM meshes are within {} of it."),
    ):
        known = [abs(value) for value in differences[name] if value is not None]
        if known:
            lines.append(text.format(f"{100 * max(known):.1f} %"))
    return " ".join(lines)


def mesh_note(quick: bool) -> str:
    """What the paper says about its meshes, and what ours are."""
    return (
        "The paper shows its three meshes in a figure only: one mesh of the solid, and three densities of the medium. "
        f"Ours have a solid of {mesh_name(SOLID[quick])} squares, whose sides the medium's cells divide by "
        f"{', '.join(map(str, DENSITIES))}; the solid's cells at the interface have the hanging nodes. The paper's "
        "numbers of cells are not known, so the columns are beside each other for scale and not cell by cell."
    )


def _vem_tables(rows: Sequence[list[list[str | Entry]]], quick: bool) -> list[Table]:
    return [
        Table(
            f"Gap at u_y = -1: the paper's mesh {n + 1}, and ours with the medium's cells divided by {density}.",
            ("alpha_r", "gamma", "paper", "ours", "ours / paper", "ours to converged"),
            rows[n],
        )
        for n, density in enumerate(DENSITIES)
    ]


TARGETS: Mapping[str, Target] = {
    "table2": Target(
        "Table 2: gap of the box for nine parameter pairs",
        "Regulariser (9) damped by exp(-5 J). Suspect cells of the paper are shown and not compared with.",
        jobs,
        sections,
    )
}
