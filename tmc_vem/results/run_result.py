"""The result of a run, read from and written to a run directory; what there is of it while the run goes on."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tmc_vem.results.adaptivity import Adaptivity
from tmc_vem.results.limit import GammaLimit
from tmc_vem.results.records import (
    CONTACT,
    DESIGN,
    FRICTION,
    HISTORY,
    OLDEST,
    RESULT,
    SCHEMA,
    StepRecord,
    finite,
    heading,
)
from tmc_vem.results.unfinished import unfinished
from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import shown

if TYPE_CHECKING:
    from tmc_vem.results.contact.curves import ContactCurves


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
        checks: interpenetration, gap along contact, imbalance of the reactions, the regulariser's part of the medium's
            energy in cells (``regulariser_energy``) and, with an interior penalty, between them (``penalty_energy``),
            and J between quadrature points at the last converged step, see
            :class:`tmc_vem.results.contact.contact.ContactReport`.
        units: of the columns of the history that have one; in terms of length and force if the problem declares none.
        errors, warnings: what is wrong or doubtful about the result, in sentences, the weightiest first; see
            :mod:`tmc_vem.results.plausibility`. Run directories from before they were told apart have warnings only.
        parallel: ranks, linear solver, imbalance and peak memory, see :func:`tmc_vem.simulation.balance.balance`.
        seconds: wall time by phase.
        media: names of the regions that are third medium.
        history: the load steps.
        directory: where the run was written, or None.
        curves: tractions of the last step, if any solid is in medium; :meth:`traction` reads them from directories too.
        cut_short: a limit on work has ended the run, so that it can be resumed.
        limit: limits for gamma to 0 of everything that is reported, if they were asked for.
        lowered: states beside the load steps, with lower gamma at the load of step ``limit_of``.
        unfinished: 'running', 'interrupted' or 'unknown' for a run that has no result yet, or never will. Its sizes are
            0 where they are not known.
        adaptivity: how its mesh was adapted, with the estimated errors, if it was.
        end: the last state, :class:`tmc_vem.simulation.end_of_run.EndOfRun`, of a run of this process; None of a result
            that was read from a directory.
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
    errors: Sequence[str] = ()
    warnings: Sequence[str] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    cut_short: bool = False
    unfinished: str = ""
    media: Sequence[str] = ()
    curves: ContactCurves | None = field(default=None, repr=False, compare=False)
    limit: GammaLimit | None = None
    lowered: Sequence[StepRecord] = field(default=(), repr=False)
    adaptivity: Adaptivity | None = field(default=None, repr=False)
    end: Any = field(default=None, repr=False, compare=False)

    @property
    def state(self) -> str:
        """'complete', 'stopped' before the end of the path, 'running', 'interrupted', or 'unknown'."""
        return self.unfinished or ("complete" if self.complete else "stopped")

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
    def loads(self) -> Mapping[str, Mapping[str, float]]:
        """What is reported of loads and springs by their names at the last converged step."""
        return self.last.forces if self.last else {}

    @property
    def contact(self) -> Mapping[str, Mapping[str, float]]:
        """Forces of the medium on bodies, and contact of pairs of outlines, by their names at the last converged step;
        see :mod:`tmc_vem.results.contact.pairs`."""
        return self.last.contact if self.last else {}

    @property
    def friction(self) -> Mapping[str, Mapping[str, float]]:
        """What friction has stored and dissipated in the media that have it, and how much of it sticks, by region at
        the last converged step; see ``OF_REGION`` of :mod:`tmc_vem.results.records`."""
        return self.last.friction if self.last else {}

    @property
    def reported(self) -> Mapping[str, float]:
        """Probes, and what is shown of loads, at the last converged step."""
        return self.last.reported if self.last else {}

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

    def traction(self, load: float | None = None) -> ContactCurves:
        """What the medium does to the solids along their outlines, as arrays: of the last step, or of the written step
        nearest to a load factor; see :class:`tmc_vem.results.contact.curves.ContactCurves`.

        Raises:
            InputError: there is none: no solid is in medium, or the step was not written.
        """
        from tmc_vem.results.contact_files import curves_at

        return self.curves if load is None and self.curves is not None else curves_at(self, load)

    def gradient(self, of: Any, by: str, *, per_cell: bool = False) -> Any:
        """Derivative of a result at the last state with respect to a number of the problem, by an adjoint field.

        ``result.gradient("gap", "regions.block.solid.E")``; for several,
        :func:`tmc_vem.sensitivity.at_end.sensitivities` does the work once. See docs/howto/sensitivities.md.

        Args:
            of: a probe by name, ``reaction``, ``displacement``, ``energy``, ``compliance``, ... or a functional.
            by: a number by name as in ``--set``, or ``REGION.PARAMETER`` of an energy.
            per_cell: an array (n_cells,) with the derivative by the number in each cell alone.

        Raises:
            InputError: there is no such result or number, or no derivative.
        """
        return import_module("tmc_vem.sensitivity").sensitivities(self).gradient(of, by, per_cell=per_cell)

    def to_pandas(self) -> Any:
        """Load steps as a pandas data frame, see :func:`tmc_vem.results.export.to_pandas`."""
        from tmc_vem.results.export import to_pandas

        return to_pandas(self)

    def to_pyvista(self, load: float = 1.0, *, triangulated: bool = False) -> Any:
        """Fields at a load factor as a PyVista mesh, see :func:`tmc_vem.results.export.to_pyvista`."""
        from tmc_vem.results.export import to_pyvista

        return to_pyvista(self, load, triangulated=triangulated)

    def cells_to_pandas(self, load: float = 1.0) -> Any:
        """Fields of the cells at a load factor as a data frame, see :func:`tmc_vem.results.export.cells_to_pandas`."""
        from tmc_vem.results.export import cells_to_pandas

        return cells_to_pandas(self, load)

    def to_meshio(self, load: float = 1.0) -> Any:
        """Fields at a load factor as a meshio mesh, see :func:`tmc_vem.results.export.to_meshio`."""
        from tmc_vem.results.export import to_meshio

        return to_meshio(self, load)

    def as_dict(self) -> dict[str, Any]:
        """Content of result.json."""
        last = self.last
        return {
            "schema": SCHEMA,
            "complete": self.complete,
            "state": self.state,
            "reason": self.reason,
            "cut_short": self.cut_short,
            "load": self.load,
            "displacement": last.displacement if last else 0.0,
            "gap": self.gap,
            "reaction": self.reaction,
            "probes": dict(self.probes),
            **({"loads": {name: dict(values) for name, values in self.loads.items()}} if self.loads else {}),
            **({"contact": {name: dict(values) for name, values in self.contact.items()}} if self.contact else {}),
            **({"friction": {name: dict(values) for name, values in self.friction.items()}} if self.friction else {}),
            "min_j": dict(self.min_j),
            "energy": dict(last.energy) if last else {},
            "units": dict(self.units),
            "media": list(self.media),
            "n_cells": self.n_cells,
            "n_dofs": self.n_dofs,
            "steps": self.steps,
            "newton_iterations": self.newton_iterations,
            "cut_backs": self.cut_backs,
            "limit": None if self.limit is None else self.limit.as_dict(),
            **({} if self.adaptivity is None else {"adaptivity": self.adaptivity.as_dict()}),
            "negative_pivots": last.negative_pivots if last else None,
            "projection_degrees": dict(self.projection_degrees),
            "checks": dict(self.checks),
            "parallel": dict(self.parallel),
            "errors": list(self.errors),
            "warnings": list(self.warnings),
            "seconds": dict(self.seconds),
            "inputs": dict(self.inputs),
            "versions": dict(self.versions),
        }

    def to_json(self) -> str:
        """Text of result.json; a value that is not a number becomes null."""
        return json.dumps(finite(self.as_dict()), indent=2, allow_nan=False) + "\n"

    @staticmethod
    def read(directory: str | Path) -> RunResult:
        """Result of a run directory, or what there is of a run that goes on or was interrupted.

        Raises:
            InputError: it is not one, or its schema is not one that this version reads.
        """
        path = Path(directory)
        try:
            data, has_result = _result_of(path)
            columns = {heading(name, unit): name for name, unit in data.get("units", {}).items()}
            rows = _history(path, columns, whole=has_result)
            history = [row for row in rows if row.limit_of is None]
            lowered = tuple(row for row in rows if row.limit_of is not None)
            steps = data.get("steps", len(history))
            if has_result and len(history) != steps:
                raise ValueError(f"{HISTORY} has {len(history)} of {steps} steps")
            if not has_result:
                data |= _totals(history, lowered)
            names = ("inputs", "versions", "complete", "reason", "load", "n_cells", "n_dofs", "newton_iterations",
                     "cut_backs", "projection_degrees", "seconds")  # fmt: skip
            if data.get("media") is None:
                data["media"] = _media_by_name(history)
            # not in the first runs
            optional = ("checks", "parallel", "errors", "warnings", "units", "cut_short", "unfinished", "media")
            later = {name: data[name] for name in optional if name in data}
            _check_types({name: data[name] for name in (*names, *later)})
            limit = None if data.get("limit") is None else GammaLimit.from_dict(data["limit"])
            adapted = None if data.get("adaptivity") is None else Adaptivity.from_dict(data["adaptivity"])
            plain = {name: data[name] for name in names}
            more = {**later, "limit": limit, "lowered": lowered, "adaptivity": adapted}
            return RunResult(**plain, history=history, directory=path, **more)
        except OSError as error:
            raise InputError(f"{path} is not a run directory: {error.strerror} ({error.filename})") from None
        except KeyError as error:
            raise InputError(f"{path} is not a readable run directory: {error} is missing; run it again") from None
        except (ValueError, TypeError, AttributeError, RecursionError, csv.Error) as error:
            raise InputError(f"{path} is not a readable run directory: {error}") from None


def refuse_search(path: Path) -> None:
    """Check that a directory is not that of a search for a design, whose runs are below it.

    Raises:
        InputError: it is.
    """
    if (path / DESIGN).is_file():
        raise InputError(
            f"{path} is a search for a design, of 'tmc-vem optimise', and no run: its best design is run in "
            f"{path / 'final'}, with a directory for each load case"
        )


def _result_of(path: Path) -> tuple[dict[str, Any], bool]:
    """What result.json says, or else what is known of the run; and whether there is a result."""
    try:
        text = (path / RESULT).read_text()
    except FileNotFoundError as missing:
        try:
            return unfinished(path), False
        except FileNotFoundError:
            raise missing from None
    refuse_search(path)
    data = json.loads(text)
    _check_schema(path, data)
    return data, True


def _media_by_name(history: Sequence[StepRecord]) -> list[str]:
    """The media of a run directory from before they were written down: then names of regions told, nothing else."""
    return [name for name in history[-1].min_j if name.startswith("medium")] if history else []


def _history(path: Path, columns: Mapping[str, str], *, whole: bool) -> list[StepRecord]:
    """The steps of history.csv; of a run without a result, without the row that was being written when it ended.

    Args:
        path: run directory.
        columns: names by headings with units.
        whole: every row must be.
    """
    try:
        text = (path / HISTORY).read_text()
    except FileNotFoundError:
        return []  # no step has converged
    if not whole:
        text = text[: text.rfind("\n") + 1]
    rows = csv.DictReader(io.StringIO(text))
    return [StepRecord.from_row({_name(key, columns): value for key, value in row.items()}) for row in rows]


def _name(heading: str, columns: Mapping[str, str]) -> str:
    """Name of a column; a run that goes on does not know yet of which pairs of outlines it will have columns."""
    if heading not in columns and heading.startswith((CONTACT, FRICTION)):
        return heading.rpartition(" [")[0] or heading
    return columns.get(heading, heading)


def _totals(history: Sequence[StepRecord], lowered: Sequence[StepRecord]) -> dict[str, Any]:
    """What the steps so far say about the run."""
    last = history[-1] if history else None
    return {
        "load": last.load if last else 0.0,
        "newton_iterations": sum(record.iterations + record.wasted_iterations for record in (*history, *lowered)),
        "cut_backs": sum(record.cut_backs for record in history),
        "seconds": {"total": last.seconds if last else 0.0},
    }


def _check_types(data: Mapping[str, Any]) -> None:
    """Check the values of a result that was edited or damaged.

    Raises:
        TypeError: one has the wrong type.
    """
    kinds: dict[str, type | tuple[type, ...]] = {
        **dict.fromkeys(("inputs", "versions", "projection_degrees", "seconds", "checks", "parallel", "units"), dict),
        **dict.fromkeys(("errors", "warnings", "media"), list),
        **dict.fromkeys(("complete", "cut_short"), bool),
        **dict.fromkeys(("reason", "unfinished"), str),
        **dict.fromkeys(("n_cells", "n_dofs", "newton_iterations", "cut_backs"), int),
        "load": (int, float),
    }
    for name, value in data.items():
        if not isinstance(value, kinds[name]):
            raise TypeError(f"{name} = {shown(value)} has the wrong type")
    for name, what in (("errors", "sentences"), ("warnings", "sentences"), ("media", "names")):
        if not all(isinstance(text, str) for text in data.get(name) or ()):
            raise TypeError(f"{name} = {shown(data[name])} are no {what}")
    times = data["seconds"]
    if not all(isinstance(value, (int, float)) for value in (times.get("total"), *times.values())):
        raise TypeError(f"seconds = {shown(times)} are no times, with a total")


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
