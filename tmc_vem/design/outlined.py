"""What became of a design by its outlines: files, runs of both, and how they compare."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from tmc_vem.design.extract import Extracted
from tmc_vem.design.extract_compare import Compared
from tmc_vem.results.design_run import OUTLINES, DesignRun
from tmc_vem.results.run_result import RunResult

GREY = 0.1  # from which on it is said that a design is


@dataclass(frozen=True)
class Outlined:
    """What became of a design.

    Attributes:
        directory: where everything is.
        design: what the search had found.
        grey: 4 x (1 - x) averaged over the design's cells, x their densities: 0 if all are solid or void, 1 if all have
            the density 1/2 (Sigmund 2007, Struct. Multidisc. Optim. 33, 401, eq. (41)).
        extracted: the problem, or that of the first load case: outlines and mesh are those of all.
        problems: files by load case; under no name where there is but one.
        runs: of them, by load case; none if they were not asked for.
        designs: runs of the densities that they are compared with.
        compared: quantities of both, by load case, at the part of the load that ``at`` has.
        at: as far as both runs came, by load case.
    """

    directory: Path
    design: DesignRun
    grey: float
    extracted: Extracted
    problems: Mapping[str, Path]
    runs: Mapping[str, RunResult] = field(default_factory=dict)
    designs: Mapping[str, RunResult] = field(default_factory=dict)
    compared: Mapping[str, list[Compared]] = field(default_factory=dict)
    at: Mapping[str, float] = field(default_factory=dict)

    @property
    def notes(self) -> tuple[str, ...]:
        """A sentence for everything that is not as the densities are."""
        if self.grey < GREY:
            return self.extracted.notes
        note = (
            f"the densities are grey: 4 x (1 - x) is {self.grey:.0%} on average, 0 % would be solid and void alone. "
            "Outlines then do something else than densities; [design] projection makes designs of solid and void"
        )
        return (note, *self.extracted.notes)

    def as_dict(self) -> dict[str, Any]:
        """Everything as plain values."""
        of = self.extracted.outlines
        return {
            "kind": OUTLINES, "problem": self.design.problem, "level": of.level,
            "volumes": {"densities": of.volume_densities, "level": of.volume_level, "cleaned": of.volume_cleaned,
                        "outlines": of.volume, "mesh": self.extracted.volume_mesh},
            "parts": of.parts, "holes": of.holes, "n_cells": self.extracted.mesh.n_cells,
            "grey": self.grey,
            "notes": list(self.notes),
            "files": {case: path.name for case, path in self.problems.items()},
            "complete": {case: run.complete for case, run in self.runs.items()},
            "compared": {
                case: {"load": self.at[case],
                       "quantities": [{**asdict(each), "difference": each.difference} for each in rows]}
                for case, rows in self.compared.items()
            },
        }  # fmt: skip
