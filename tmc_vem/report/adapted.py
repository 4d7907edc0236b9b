"""What the page of a run has about its adapted mesh."""

from __future__ import annotations

from tmc_vem.report.adapted_curves import adapted_curves
from tmc_vem.report.adapted_meshes import meshes_figure
from tmc_vem.report.adapted_tables import in_words, rounds_table, solution_table
from tmc_vem.report.page import Block, Section, Text, picture
from tmc_vem.results.adapted_rounds import adaptivity_of
from tmc_vem.results.adaptivity import Adaptivity
from tmc_vem.results.run_result import RunResult
from tmc_vem.support.errors import InputError

MESHES = (
    "Meshes of the first, a middle and the last round, undeformed and deformed. Below, the last one that has an "
    "estimate: the share of each cell in the sum of all bounds of what cells contribute, by which cells are chosen."
)


def adapted_sections(name: str, result: RunResult) -> list[Section]:
    """A section with rounds, curves and meshes; none for a run whose mesh was not adapted."""
    try:
        adaptivity = adaptivity_of(result)
    except InputError as error:
        return [Section("Adapted mesh", [Text(str(error))])]
    if adaptivity is None:
        return []
    blocks: list[Block] = [in_words(adaptivity), rounds_table(name, result, adaptivity)]
    blocks += adapted_curves(name, result, adaptivity)
    return [Section("Adapted mesh", [*blocks, _meshes(result, adaptivity), solution_table(adaptivity)])]


def _meshes(result: RunResult, adaptivity: Adaptivity) -> Block:
    """The meshes, or why they cannot be shown."""
    if result.directory is None:
        return Text("The run was kept in memory only: there are no pictures of the meshes.")
    try:
        return picture(meshes_figure(result.directory, adaptivity), "adapted-meshes", MESHES, inline="png")
    except InputError as error:
        return Text(str(error))
