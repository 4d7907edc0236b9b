"""Rounds of a run directory: what is known of them, also before there is a result, and the meshes that they left."""

from __future__ import annotations

import json
from pathlib import Path

from tmc_vem.results.adaptivity import Adaptivity
from tmc_vem.results.records import ADAPT
from tmc_vem.results.run_result import RunResult
from tmc_vem.results.snapshots import fields_of_file
from tmc_vem.results.unfinished import ROUNDS
from tmc_vem.support.errors import InputError
from tmc_vem.system.fields import Fields

ERROR_OF = "error of "  # what names of cell fields begin with that have contributions of cells to errors
GO_ON = "the run has no result yet"


def round_file(number: int) -> str:
    """Name of a round's file in the folder of the meshes."""
    return f"round-{number:02d}.vtu"


def read_round(directory: Path, number: int) -> Fields:
    """Mesh, displacements and contributions of cells to errors in a round of a run directory.

    Raises:
        InputError: the file is missing or not readable.
    """
    return fields_of_file(directory / ADAPT / round_file(number))


def adaptivity_of(result: RunResult) -> Adaptivity | None:
    """How the mesh of a run was adapted; of a run without a result, the rounds that are over; None without any.

    Raises:
        InputError: the file of the rounds is damaged.
    """
    if result.adaptivity is not None or result.directory is None or not result.unfinished:
        return result.adaptivity
    path = result.directory / ROUNDS
    try:
        facts = json.loads(path.read_text())
        finished = facts["finished"] or {"reached": False, "reason": GO_ON}
        rounds = facts["rounds"]
        plain = {"of": facts["of"], "tolerance": facts["tolerance"], "rounds": rounds, **finished}
        return Adaptivity.from_dict(plain) if rounds else None
    except FileNotFoundError:
        return None
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path} is not readable: {error}") from None
