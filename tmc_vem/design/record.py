"""Evaluations of designs as files, one each: written once and never again, so that a kill costs one at most."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tmc_vem.design.evaluation import Evaluation
from tmc_vem.design.evaluator import Worth
from tmc_vem.support import notes
from tmc_vem.support.files import whole_file

Float = NDArray[np.float64]

SCHEMA = 1
_ARRAYS = ("z", "objective", "gradient", "constraints", "jacobian")


@dataclass(frozen=True)
class Record:
    """A design that was evaluated.

    Attributes:
        z: (n_variables,) its variables.
        evaluation: objective and constraints.
        worth: results.
    """

    z: Float
    evaluation: Evaluation
    worth: Worth


def name_of(number: int) -> str:
    """Name of the file of an evaluation, counted from 1."""
    return f"{number:05d}.npz"


def write_record(folder: Path, number: int, record: Record, *, durable: bool = True) -> None:
    """Write an evaluation.

    Args:
        folder: where all of them are.
        number: of it, from 1.
        record: the evaluation.
        durable: wait until the disk has it.

    Raises:
        OSError: it could not be written.
    """
    of, worth = record.evaluation, record.worth
    arrays = (record.z, np.array(of.objective), of.gradient, of.constraints, of.jacobian)
    facts = {
        "values": dict(worth.values),
        "volume": worth.volume,
        "iterations": worth.iterations,
        "seconds": worth.seconds,
        "notes": list(worth.notes),
    }
    archive = io.BytesIO()
    np.savez(archive, schema=SCHEMA, facts=json.dumps(facts), **dict(zip(_ARRAYS, arrays, strict=True)))
    with whole_file(folder / name_of(number), durable=durable) as temporary:
        temporary.write_bytes(archive.getbuffer())


def read_records(folder: Path, n_variables: int, most: int) -> list[Record]:
    """The evaluations of a folder, in order, up to the first that is missing or damaged.

    Args:
        folder: where they are.
        n_variables: of the design.
        most: how many there are at most; files beyond are passed over.
    """
    found: list[Record] = []
    while len(found) < most:
        path = folder / name_of(len(found) + 1)
        try:
            record = _read(path)
            if record.z.shape != (n_variables,):
                raise ValueError(f"it has {record.z.size} variables, the design {n_variables}")
        except FileNotFoundError:
            break
        except (OSError, EOFError, KeyError, ValueError, TypeError, zipfile.BadZipFile) as error:
            notes.say(f"{path} is damaged ({error}): designs from there on are evaluated again")
            break
        found.append(record)
    return found


def remove_records(folder: Path, after: int) -> None:
    """Remove the evaluations with numbers above one."""
    for path in folder.glob("*.npz"):
        if path.stem.isdigit() and int(path.stem) > after:
            path.unlink()


def _read(path: Path) -> Record:
    with np.load(path, allow_pickle=False) as file:
        if int(file["schema"]) != SCHEMA:
            raise ValueError(f"schema {int(file['schema'])}, here {SCHEMA}")
        z, objective, gradient, constraints, jacobian = (np.array(file[name]) for name in _ARRAYS)
        facts = json.loads(str(file["facts"]))
    worth = Worth(
        facts["values"], facts["volume"], facts["iterations"], facts["seconds"], tuple(facts["notes"])
    )  # fmt: skip
    return Record(z, Evaluation(float(objective), gradient, constraints, jacobian), worth)
