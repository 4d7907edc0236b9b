"""Writing the directory of a design: evaluations as they are made, the last states, and the result."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tmc_vem.design.record import Record, read_records, remove_records, write_record
from tmc_vem.results.design_run import (
    ANIMATION,
    BEST,
    COLLECTION,
    CURVES,
    DESIGNS,
    EVALUATIONS,
    FINAL,
    PICTURE,
    STIFFNESS,
    DesignRun,
)
from tmc_vem.results.directory import RunDirectory
from tmc_vem.results.records import DESIGN, HISTORY, RESULT
from tmc_vem.results.unfinished import BEFORE, BEGUN, CHECKPOINT, COMMAND
from tmc_vem.support.files import write_atomically

REPORT = ("report.html", "report.md", "figures")


class DesignDirectory(RunDirectory):
    """Writes a search for a design; files appear whole or not at all, except history.csv, which grows by a row.

    Args:
        path: where to write.
        overwrite: replace an earlier search there.

    Raises:
        InputError: the path is a file, cannot be written, or has something in it that must not be replaced.
    """

    own = (RESULT, DESIGN, HISTORY, EVALUATIONS, DESIGNS, COLLECTION, BEST, STIFFNESS, FINAL, f"{FINAL}.toml", PICTURE,
           CURVES, ANIMATION, *REPORT, COMMAND, BEGUN, CHECKPOINT, BEFORE)  # fmt: skip

    called = "a search for a design"

    def _is_foreign(self) -> bool:
        return not (self.path / DESIGN).exists()

    def begin_search(self, command: Mapping[str, Any] | None, problem: str) -> None:
        """Make the directory, without what an earlier search left.

        Args:
            command: what the command line was asked, for a later ``tmc-vem resume``.
            problem: text of the problem file.

        Raises:
            InputError: there is something by now that must not be replaced.
        """
        written = [*self.path.glob(f"{FINAL}-*.toml"), *self.path.glob("deformed*.png")] if self._is_ours() else []
        self.clear()
        for leftover in written:
            leftover.unlink(missing_ok=True)
        if command is not None:
            write_atomically(self.path / COMMAND, json.dumps(command, indent=2) + "\n")
        (self.path / EVALUATIONS).mkdir()
        (self.path / DESIGNS).mkdir()
        write_atomically(self.path / DESIGN, problem)

    def records(self, n_variables: int, most: int) -> list[Record]:
        """Evaluations on record, of which those beyond are removed."""
        found = read_records(self.path / EVALUATIONS, n_variables, most)
        remove_records(self.path / EVALUATIONS, len(found))
        (self.path / DESIGNS).mkdir(exist_ok=True)
        return found

    def add(self, number: int, record: Record, *, durable: bool) -> None:
        """Write an evaluation; ``durable`` waits until the disk has it."""
        write_record(self.path / EVALUATIONS, number, record, durable=durable)

    def begin_rows(self) -> None:
        """Begin history.csv anew: rows of evaluations on record are told again."""
        (self.path / HISTORY).unlink(missing_ok=True)

    def add_row(self, row: Mapping[str, Any]) -> None:
        """Append a row to history.csv, whose columns it must not have more than."""
        with (self.path / HISTORY).open("a+", newline="") as file:
            file.seek(0)
            columns = next(csv.reader(file), [])
            writer = csv.DictWriter(file, fieldnames=columns or list(row), restval="")
            if not columns:
                writer.writeheader()
            writer.writerow(row)

    def write_run(self, run: DesignRun) -> None:
        """Write result.json."""
        write_atomically(self.path / RESULT, run.to_json())
        (self.path / BEGUN).unlink(missing_ok=True)

    def _is_ours(self) -> bool:
        return (self.path / DESIGN).exists()


def read_rows(path: Path) -> list[dict[str, str]]:
    """Rows of history.csv of a design; the one that was being written when the search ended is left out."""
    text = (path / HISTORY).read_text()
    return list(csv.DictReader(io.StringIO(text[: text.rfind("\n") + 1])))


def columns_of(rows: Sequence[Mapping[str, str]], name: str) -> list[float]:
    """Numbers of a column; not a number where there is none."""
    return [float(row.get(name) or "nan") for row in rows]
