"""Designs for ParaView: densities, stiffnesses and the displacements of all load cases, every so many evaluations."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tmc_vem.design.evaluator import Evaluator
from tmc_vem.design.load_case import LoadCase
from tmc_vem.design.optimise import DesignStep
from tmc_vem.problems.base import media_of
from tmc_vem.problems.own import OwnProblem
from tmc_vem.results.design_run import BEST, COLLECTION, DESIGNS
from tmc_vem.results.output import fields_of, polygons_of
from tmc_vem.results.vtu import VtuWriter
from tmc_vem.support.parallel import on_root
from tmc_vem.system.fields import Fields, write_pvd
from tmc_vem.system.tensors import MOVED

Float = NDArray[np.float64]


class DesignSnapshots:
    """Writes VTU files of designs, and the PVD collection that ParaView opens, its time the number of the evaluation.

    Args:
        directory: of the design.
        evaluator: of the search.
        problem: what is solved.
        every: evaluations from one file to the next; 0 for none but the best design's.
    """

    def __init__(self, directory: Path, evaluator: Evaluator, problem: OwnProblem, every: int) -> None:
        self._directory, self._evaluator, self._problem, self._every = directory, evaluator, problem, every
        self._comm = next(iter(evaluator.cases.values())).system.comm
        self._entries: list[tuple[float, list[str]]] = []

    def restore(self, number: int) -> None:
        """Go on after an evaluation: designs after it are not in the collection."""
        if self._every and self._comm.rank == 0:
            known = range(self._every, number + 1, self._every)
            named = [(float(n), [self._name(n)]) for n in (1, *known) if n <= number]
            self._entries = [entry for entry in named if (self._directory / entry[1][0]).is_file()]

    def offer(self, step: DesignStep) -> None:
        """Write a design if it is its turn and all load cases have a state; called on all ranks."""
        n = step.number
        if not self._every or (n % self._every and n != 1) or not np.isfinite(step.iterate.evaluation.objective):
            return
        evaluator = self._evaluator
        fields = self.fields(evaluator.densities(step.iterate.z), evaluator.stiffness(step.iterate.z))
        self._write(self._name(n), fields)
        self._entries.append((float(n), [self._name(n)]))
        on_root(self._comm, lambda: write_pvd(self._directory / COLLECTION, self._entries))

    def write_best(self, fields: dict[str, Fields]) -> None:
        """Write a design as the best; called on all ranks."""
        self._write(BEST, fields)

    def fields(self, density_c: Float, stiffness_c: Float) -> dict[str, Fields]:
        """States of all load cases with the design; on rank 0, elsewhere none. Load cases without a state are left out.

        Args:
            density_c, stiffness_c: (n_cells of the mesh,).
        """
        found = {name: self._of(case, density_c, stiffness_c) for name, case in self._evaluator.cases.items()}
        return {name: fields for name, fields in found.items() if fields is not None}

    def _of(self, case: LoadCase, density_c: Float, stiffness_c: Float) -> Fields | None:
        if case.u is None:
            return None
        system = case.system
        numbers = system.cell_numbers()
        mine = replace(
            fields_of(system, case.u, polygons_of(system, media_of(self._problem))),
            cell_fields={"density": density_c[numbers], "stiffness": stiffness_c[numbers]},
        )
        parts = [mine] if system.comm.size == 1 else system.comm.gather(mine)
        return Fields.merge(parts) if parts else None

    def _write(self, name: str, fields: dict[str, Fields]) -> None:
        on_root(self._comm, lambda: self._write_on_root(name, fields))

    def _write_on_root(self, name: str, fields: dict[str, Fields]) -> None:
        if not fields:
            return
        first = next(iter(fields.values()))
        if len(fields) > 1:
            moved = {f"{MOVED}{case}": _in_space(of.displacement_ni) for case, of in fields.items()}
            first = replace(first, point_fields=moved)
        VtuWriter(first.polygons, self._problem.units()).write(self._directory / name, first)

    def _name(self, number: int) -> str:
        return f"{DESIGNS}/design_{number:05d}.vtu"


def _in_space(plane: Float) -> Float:
    return np.column_stack([plane, np.zeros(len(plane))])
