"""Runs as data: records of load steps and the result of a run, read from and written to a run directory.

A run directory holds ``result.json`` (inputs, versions, results, times), ``history.csv`` (a row a load step),
``fields.pvd`` with ``fields/*.vtu`` and ``deformed.png``.
"""

from __future__ import annotations

import csv
import io
import json
import math
import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from tmc_vem.errors import InputError
from tmc_vem.files import remove_unfinished, write_atomically
from tmc_vem.lock import LOCK
from tmc_vem.probes import GAP, RESERVED, RESERVED_STARTS

# Schema of run directories that is written, and the oldest that is read. A new entry with a default in ``read`` or
# ``from_row`` leaves both alone; a changed meaning raises both.
SCHEMA, OLDEST = 1, 1
RESULT, HISTORY, FIELDS, COLLECTION, PICTURE = "result.json", "history.csv", "fields", "fields.pvd", "deformed.png"
COMMAND = "command.json"
TRIANGULATED = "triangulated"  # fields cut into triangles: the collection, and what their files begin with
# groups of values in a record, and what their columns begin with
_GROUPS = {"min_j": "min_j_", "energy": "energy_", "parameters": "parameter_"}
_OWN = (
    RESULT,
    HISTORY,
    FIELDS,
    COLLECTION,
    f"{TRIANGULATED}.pvd",
    PICTURE,
    COMMAND,
    "checkpoint.npz",
    "checkpoint-before.npz",
)


@dataclass(frozen=True)
class StepRecord:
    """A converged load step.

    Attributes:
        step: 1 for the first.
        load: load factor, 1 at full load.
        displacement: prescribed displacement of the loaded point or edge.
        probes: values of the problem's probes by name.
        reaction: force at the loaded point or edge, in the direction of the displacement component.
        iterations: Newton iterations; ``cut_backs`` failed attempts before it, with ``wasted_iterations``.
        min_j, energy: smallest J and energy by region.
        negative_pivots: negative eigenvalues of the tangent (unstable if above 0), or None if unknown.
        jumped: the equilibrium branch ended before this step, and this state lies on another one.
        seconds: wall time since the start of the run.
        time: coordinate along the load path; None in old runs, where it is the load factor.
        parameters: values of the medium's parameters while they are continued, by name; empty otherwise.
    """

    step: int
    load: float
    displacement: float
    probes: Mapping[str, float]
    reaction: float
    iterations: int
    cut_backs: int
    wasted_iterations: int
    min_j: Mapping[str, float]
    energy: Mapping[str, float]
    negative_pivots: int | None
    jumped: bool
    seconds: float
    time: float | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)

    @property
    def coordinate(self) -> float:
        """Where the step is on the load path: what increases from step to step, also when the load does not."""
        return self.load if self.time is None else self.time

    @property
    def gap(self) -> float | None:
        """The probe that reports go by, or None."""
        return self.probes.get(GAP)

    def as_row(self) -> dict[str, Any]:
        """Flat form for history.csv, groups as ``min_j_<region>``, ``energy_<region>`` and ``parameter_<name>``.

        The regions keep their order, by which the fields of a run directory are given their names.
        """
        flat: dict[str, Any] = {}
        for name, value in asdict(self).items():
            if name not in _GROUPS:
                flat |= value if name == "probes" else {name: value}
        for name, prefix in _GROUPS.items():
            flat |= {prefix + key: value for key, value in getattr(self, name).items()}
        return {key: "" if value is None else value for key, value in flat.items()}

    @staticmethod
    def from_row(row: Mapping[str, str]) -> StepRecord:
        """Record of a row of history.csv; what is no other column is a probe."""

        def values(named: Mapping[str, str]) -> dict[str, float]:
            return {name: float(value) for name, value in named.items() if value}

        def group(name: str) -> dict[str, float]:
            prefix = _GROUPS[name]
            return values({key[len(prefix) :]: value for key, value in row.items() if key.startswith(prefix)})

        probes = {key: row[key] for key in row if key not in RESERVED and not key.startswith(RESERVED_STARTS)}

        return StepRecord(
            step=int(row["step"]),
            load=float(row["load"]),
            displacement=float(row["displacement"]),
            probes=values(probes),
            reaction=float(row["reaction"]),
            iterations=int(row["iterations"]),
            cut_backs=int(row["cut_backs"]),
            wasted_iterations=int(row["wasted_iterations"]),
            min_j=group("min_j"),
            energy=group("energy"),
            negative_pivots=int(row["negative_pivots"]) if row["negative_pivots"] else None,
            jumped=row["jumped"] == "True",
            seconds=float(row["seconds"]),
            time=float(row["time"]) if row.get("time") else None,
            parameters=group("parameters"),
        )

    @staticmethod
    def from_plain(entry: Mapping[str, Any]) -> StepRecord:
        """Record of the plain values of a checkpoint; the first versions knew one probe, the gap."""
        gap = {} if entry.get(GAP) is None else {GAP: entry[GAP]}
        return StepRecord(**{"probes": gap, **{key: value for key, value in entry.items() if key != GAP}})


@dataclass(frozen=True)
class RunResult:
    """Everything about a run that is not a field.

    Attributes:
        inputs: the problem's parameters and the method's settings.
        versions: of the program, its libraries and the machine.
        complete: whether the full load was reached; ``reason`` says why not.
        load: load factor of the last converged step.
        n_cells, n_dofs: size of the discretisation.
        cut_backs, newton_iterations: totals; the iterations include those of failed attempts.
        projection_degrees: number of cells by degree l (VEM only).
        checks: interpenetration, gap along contact, imbalance of the reactions and the regulariser's part of the
            medium's energy at the last converged step, see :class:`tmc_vem.report.contact.ContactReport`.
        units: of the columns of the history that have one; in terms of length and force if the problem declares none.
        warnings: what is doubtful about the result, in sentences; see :mod:`tmc_vem.plausibility`.
        parallel: ranks, linear solver, imbalance and peak memory, see :func:`tmc_vem.balance.balance`.
        seconds: wall time by phase.
        media: names of the regions that are third medium; None in old runs, where they begin with ``medium``.
        history: the load steps.
        directory: where the run was written, or None.
    """

    inputs: Mapping[str, Any]
    versions: Mapping[str, Any]
    complete: bool
    reason: str
    load: float
    n_cells: int
    n_dofs: int
    newton_iterations: int
    cut_backs: int
    projection_degrees: Mapping[str, int]
    seconds: Mapping[str, float]
    history: Sequence[StepRecord] = field(repr=False)
    directory: Path | None = None
    checks: Mapping[str, Any] = field(default_factory=dict)
    parallel: Mapping[str, Any] = field(default_factory=dict)
    warnings: Sequence[str] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    media: Sequence[str] | None = None

    @property
    def last(self) -> StepRecord | None:
        """Last converged step."""
        return self.history[-1] if self.history else None

    @property
    def gap(self) -> float | None:
        """Gap at the last converged step."""
        return self.last.gap if self.last else None

    @property
    def probes(self) -> Mapping[str, float]:
        """Probes at the last converged step, the gap included."""
        return self.last.probes if self.last else {}

    @property
    def reaction(self) -> float | None:
        """Reaction at the last converged step."""
        return self.last.reaction if self.last else None

    @property
    def min_j(self) -> Mapping[str, float]:
        """Smallest J by region at the last converged step."""
        return self.last.min_j if self.last else {}

    def unit(self, column: str) -> str:
        """Unit of a column of the history that the problem has declared; empty for a plain number, and without one."""
        unit = self.units.get(column, "1") if "units" in self.inputs else "1"
        return "" if unit == "1" else unit

    @property
    def steps(self) -> int:
        """Converged load steps."""
        return len(self.history)

    def to_pandas(self) -> Any:
        """Load steps as a pandas data frame, see :func:`tmc_vem.export.to_pandas`."""
        from tmc_vem.export import to_pandas

        return to_pandas(self)

    def to_pyvista(self, load: float = 1.0, *, triangulated: bool = False) -> Any:
        """Fields at a load factor as a PyVista mesh, see :func:`tmc_vem.export.to_pyvista`."""
        from tmc_vem.export import to_pyvista

        return to_pyvista(self, load, triangulated=triangulated)

    def to_meshio(self, load: float = 1.0) -> Any:
        """Fields at a load factor as a meshio mesh, see :func:`tmc_vem.export.to_meshio`."""
        from tmc_vem.export import to_meshio

        return to_meshio(self, load)

    def as_dict(self) -> dict[str, Any]:
        """Content of result.json."""
        last = self.last
        return {
            "schema": SCHEMA,
            "complete": self.complete,
            "reason": self.reason,
            "load": self.load,
            "displacement": last.displacement if last else 0.0,
            "gap": self.gap,
            "reaction": self.reaction,
            "probes": dict(self.probes),
            "min_j": dict(self.min_j),
            "energy": dict(last.energy) if last else {},
            "units": dict(self.units),
            "media": None if self.media is None else list(self.media),
            "n_cells": self.n_cells,
            "n_dofs": self.n_dofs,
            "steps": self.steps,
            "newton_iterations": self.newton_iterations,
            "cut_backs": self.cut_backs,
            "negative_pivots": last.negative_pivots if last else None,
            "projection_degrees": dict(self.projection_degrees),
            "checks": dict(self.checks),
            "parallel": dict(self.parallel),
            "warnings": list(self.warnings),
            "seconds": dict(self.seconds),
            "inputs": dict(self.inputs),
            "versions": dict(self.versions),
        }

    def to_json(self) -> str:
        """Text of result.json; a value that is not a number becomes null."""
        return json.dumps(_finite(self.as_dict()), indent=2, allow_nan=False) + "\n"

    @staticmethod
    def read(directory: str | Path) -> RunResult:
        """Result of a run directory.

        Raises:
            InputError: it is not one, or its schema is not one that this version reads.
        """
        path = Path(directory)
        try:
            data = json.loads((path / RESULT).read_text())
            _check_schema(path, data)
            plain = {heading(name, unit): name for name, unit in data.get("units", {}).items()}
            with (path / HISTORY).open(newline="") as file:
                rows = [{plain.get(key, key): value for key, value in row.items()} for row in csv.DictReader(file)]
            history = [StepRecord.from_row(row) for row in rows]
            names = ("inputs", "versions", "complete", "reason", "load", "n_cells", "n_dofs", "newton_iterations",
                     "cut_backs", "projection_degrees", "seconds")  # fmt: skip
            optional = ("checks", "parallel", "warnings", "units", "media")  # not in the first runs
            later = {name: data[name] for name in optional if name in data}
            return RunResult(**{name: data[name] for name in names}, history=history, directory=path, **later)
        except OSError as error:
            raise InputError(f"{path} is not a run directory: {error.strerror} ({error.filename})") from None
        except KeyError as error:
            raise InputError(f"{path} is not a readable run directory: {error} is missing; run it again") from None
        except (ValueError, TypeError) as error:
            raise InputError(f"{path} is not a readable run directory: {error}") from None


def heading(name: str, unit: str) -> str:
    """Of a column of history.csv whose unit the problem declares: ``reaction [N/mm]``."""
    return name if unit in ("", "1") else f"{name} [{unit}]"


def _check_schema(path: Path, data: Any) -> None:
    """Check that this version can read a result.

    Raises:
        InputError: it has no schema number, or one that is too old or too new.
    """
    schema = data.get("schema") if isinstance(data, dict) else None
    if not isinstance(schema, int):
        raise InputError(f"{path} was written before run directories had a schema number: run it again")
    if schema > SCHEMA:
        raise InputError(
            f"{path} was written by a newer version (schema {schema}, known up to {SCHEMA}): update tmc-vem"
        )
    if schema < OLDEST:
        raise InputError(f"{path} was written by an old version (schema {schema}, read from {OLDEST} on): run it again")


class RunDirectory:
    """Writes a run; files appear whole or not at all, except history.csv, which grows by a row a step.

    Args:
        path: where to write.
        overwrite: replace an earlier run there.

    Raises:
        InputError: the path is a file, cannot be written, or has something in it that must not be replaced.
    """

    def __init__(self, path: str | Path, *, overwrite: bool = False) -> None:
        self.path = Path(path)
        self._check(overwrite)

    def _check(self, overwrite: bool) -> None:
        path = self.path
        if path.exists() and not path.is_dir():
            raise InputError(f"output directory {path} is a file: choose another name")
        if path.is_dir() and any(entry.name != LOCK for entry in path.iterdir()):
            if not any((path / name).exists() for name in (RESULT, HISTORY, COMMAND)):
                raise InputError(f"output directory {path} has other things in it: choose an empty or new one")
            if not overwrite:
                raise InputError(f"output directory {path} has a run in it: choose another, or say --overwrite")
        parent = next(p for p in (path, *path.absolute().parents) if p.exists())
        if not parent.is_dir():
            raise InputError(f"output directory {path} cannot be made: {parent} is a file")
        if not os.access(parent, os.W_OK):
            raise InputError(f"output directory {path} cannot be written: no permission in {parent}")

    def start(self, command: Mapping[str, Any] | None = None) -> None:
        """Make the directory, without what an earlier run left.

        Args:
            command: what the command line was asked, for a later ``tmc-vem resume``.
        """
        self.path.mkdir(parents=True, exist_ok=True)
        remove_unfinished(self.path)
        for name in _OWN:
            target = self.path / name
            if target.is_dir():
                shutil.rmtree(target)
            else:
                target.unlink(missing_ok=True)
        for part in self.path.glob("checkpoint-part-*.npz"):
            part.unlink()
        (self.path / FIELDS).mkdir()
        if command is not None:
            write_atomically(self.path / COMMAND, json.dumps(command, indent=2) + "\n")

    def add_step(self, record: StepRecord, units: Mapping[str, str] | None = None) -> None:
        """Append a row to history.csv.

        Args:
            record: the step.
            units: of columns, for their headings.
        """
        row = _headed(record, units)
        path = self.path / HISTORY
        new = not path.exists()
        with path.open("a", newline="") as file:
            writer = csv.DictWriter(file, fieldnames=list(row))
            if new:
                writer.writeheader()
            writer.writerow(row)

    def rewrite_history(self, records: Sequence[StepRecord], units: Mapping[str, str] | None = None) -> None:
        """Write history.csv anew, without the steps after a checkpoint, and remove what was left half written."""
        remove_unfinished(self.path)
        rows = [_headed(record, units) for record in records]
        text = io.StringIO()
        columns = dict.fromkeys(name for row in rows for name in row)  # parameters may have come in later
        writer = csv.DictWriter(text, fieldnames=list(columns) or ["step"], restval="")
        writer.writeheader()
        writer.writerows(rows)
        write_atomically(self.path / HISTORY, text.getvalue())

    def write_result(self, result: RunResult) -> None:
        """Write result.json."""
        write_atomically(self.path / RESULT, result.to_json())


def _headed(record: StepRecord, units: Mapping[str, str] | None) -> dict[str, Any]:
    return {heading(name, (units or {}).get(name, "")): value for name, value in record.as_row().items()}


def _finite(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Mapping):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(entry) for entry in value]
    return value
