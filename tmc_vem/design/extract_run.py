"""From the directory of a design to its outlines: problem files on a mesh with their edges, and what these give."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from tmc_vem.design.extract import DesignMaterials, Extracted, extracted_problems
from tmc_vem.design.extract_compare import common_load, compare_runs
from tmc_vem.design.extract_directory import EXTRACTED, RUNS, OutlinesDirectory
from tmc_vem.design.extract_files import write_extracted
from tmc_vem.design.extract_options import ExtractOptions
from tmc_vem.design.extract_page import write_outlines
from tmc_vem.design.final import final_problems
from tmc_vem.design.outlined import Outlined
from tmc_vem.mesh.cells import centroids_and_areas
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems.own import OwnProblem
from tmc_vem.problems.stiffness_file import densities_at
from tmc_vem.results.design_run import OUTLINES, STIFFNESS, DesignRun
from tmc_vem.results.records import DESIGN
from tmc_vem.results.run_result import RunResult
from tmc_vem.simulation.monitor import Monitor
from tmc_vem.simulation.options import RunOptions
from tmc_vem.simulation.problem_file import read_problem, with_changes
from tmc_vem.simulation.simulation import run as solve
from tmc_vem.support.distributed import Comm
from tmc_vem.support.errors import InputError
from tmc_vem.support.parallel import from_root, on_root

Float = NDArray[np.float64]


def extract(
    directory: str | Path,
    out: str | Path | None = None,
    options: ExtractOptions | None = None,
    *,
    run: bool = False,
    overwrite: bool = False,
    comm: Comm | None = None,
    monitor: Monitor | None = None,
) -> Outlined:
    """Outlines of the design in a directory of ``tmc-vem optimise``, as problem files on a mesh that is fitted to them.

    Args:
        directory: of the design.
        out: where they go; ``outlines`` in the directory by default.
        options: of outlines and mesh.
        run: solve them, and compare with the runs of the densities, which are solved where there are none.
        overwrite: replace earlier outlines.
        comm: MPI communicator, all ranks by default.
        monitor: hears about progress of the runs; called on rank 0 only.

    Raises:
        InputError: it is no such directory, its search has no result yet, or the design has no outlines that can be
            meshed, see :func:`tmc_vem.design.extract.contour`.
    """
    comm = MPI.COMM_WORLD if comm is None else comm
    source, options = Path(directory), options or ExtractOptions()
    design = from_root(comm, lambda: DesignRun.read(source))
    problem, settings = from_root(comm, lambda: read_problem(source / DESIGN))
    written = from_root(comm, lambda: OutlinesDirectory(out or source / OUTLINES, overwrite=overwrite))
    grey, made = from_root(comm, lambda: _extracted(problem, source, options))
    on_root(comm, written.start_outlines)
    files = from_root(comm, lambda: {c: write_extracted(each, written.path, _named(c)) for c, each in made.items()})
    first = next(iter(made.values()))
    found = Outlined(written.path, design, grey, first, {case: path for case, (path, _) in files.items()})
    if run:
        found = _with_runs(found, {case: of for case, (_, of) in files.items()}, problem, settings, comm, monitor)
    on_root(comm, lambda: _written(found, written, problem, source))
    return found


def _extracted(problem: OwnProblem, source: Path, options: ExtractOptions) -> tuple[float, dict[str, Extracted]]:
    """How grey the design is, and the problems of all load cases."""
    table = problem.table
    assert table.design is not None
    bare = replace(problem, table=replace(table, design=None))
    cases = {case.name: with_changes(bare, case.set) for case in table.design.cases} or {"": bare}
    materials = {}
    for name, region in table.regions.items():
        if region.is_design:
            assert region.solid is not None
            assert region.medium is not None
            materials[name] = DesignMaterials(region.solid, region.medium, region.hold)
    mesh = problem.make_mesh()
    density_c, area_c = design_densities(problem, mesh, source), centroids_and_areas(mesh)[1]
    designed = np.isfinite(density_c)
    between = 4.0 * density_c * (1.0 - density_c)
    grey = float(np.average(between[designed], weights=area_c[designed]))
    return grey, extracted_problems(cases, mesh, density_c, materials, options)


def design_densities(problem: OwnProblem, mesh: PolygonMesh, source: Path) -> Float:
    """(n_cells,) densities of the design in a directory; not a number where nothing is designed.

    Raises:
        InputError: its file is no design on this mesh.
    """
    names = [name for name, region in problem.table.regions.items() if region.is_design]
    cells = np.flatnonzero(np.isin(mesh.region_c, [mesh.region_names.index(name) for name in names]))
    density_c = np.full(mesh.n_cells, np.nan)
    density_c[cells] = densities_at(source / STIFFNESS, centroids_and_areas(mesh)[0][cells])
    return density_c


def _with_runs(
    found: Outlined, problems: Mapping[str, OwnProblem], problem: OwnProblem, settings: RunOptions, comm: Comm,
    monitor: Monitor | None,
) -> Outlined:  # fmt: skip
    """With the runs of all load cases, and those of the densities beside them."""
    source = found.design.directory
    assert source is not None
    settings = replace(settings, overwrite=True, max_iterations=None, max_seconds=None)
    as_densities = final_problems(problem, source)
    runs, designs, compared, at = {}, {}, {}, {}
    for case, each in problems.items():
        where = found.directory / RUNS / case
        command = {"problem": str(found.problems[case].resolve()), "options": {}}
        runs[case] = solve(each, where, settings, comm=comm, monitor=monitor, command=command)
        known = from_root(comm, lambda case=case: _read_run(found.design, case))  # type: ignore[misc]
        designs[case] = known or solve(as_densities[case], None, settings, comm=comm, monitor=monitor)
        if runs[case].history and designs[case].history:
            compared[case] = compare_runs(designs[case], runs[case], found.extracted)
            at[case] = common_load(designs[case], runs[case])
    return replace(found, runs=runs, designs=designs, compared=compared, at=at)


def _read_run(design: DesignRun, case: str) -> RunResult | None:
    """The run of the densities that the search has left; None if there is none."""
    assert design.directory is not None
    if case not in design.runs:
        return None
    try:
        return RunResult.read(design.directory / design.runs[case])
    except InputError:
        return None


def _written(found: Outlined, written: OutlinesDirectory, problem: OwnProblem, source: Path) -> None:
    mesh = problem.make_mesh()
    write_outlines(found, mesh, design_densities(problem, mesh, source))
    written.write_found(found.as_dict())


def _named(case: str) -> str:
    return f"{EXTRACTED}-{case}" if case else EXTRACTED
