"""Writing a run directory: what a run leaves on disk while it goes on, and its result."""

from __future__ import annotations

import csv
import io
import json
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from tmc_vem.results.lock import LOCK, DirectoryLock
from tmc_vem.results.records import (
    ADAPT,
    ADAPTED,
    ADAPTED_MESH,
    ADAPTED_PICTURE,
    COLLECTION,
    CONTACT_FOLDER,
    CONTACT_LINES,
    CONTACT_TABLE,
    DESIGN,
    FIELDS,
    HISTORY,
    MARKS,
    PICTURE,
    PROBLEM,
    RESULT,
    TRIANGULATED,
    StepRecord,
    finite,
    heading,
)  # fmt: skip
from tmc_vem.results.run_result import RunResult
from tmc_vem.results.unfinished import BEFORE, BEGUN, CHECKPOINT, COMMAND, process_facts
from tmc_vem.support.errors import InputError
from tmc_vem.support.files import remove_unfinished, write_atomically

_OWN = (RESULT, HISTORY, FIELDS, COLLECTION, f"{TRIANGULATED}.pvd", CONTACT_TABLE, CONTACT_FOLDER, CONTACT_LINES,
        PICTURE, COMMAND, PROBLEM, BEGUN, CHECKPOINT, BEFORE, ADAPT, ADAPTED, ADAPTED_MESH,
        ADAPTED_PICTURE)  # fmt: skip


class RunDirectory:
    """Writes a run; files appear whole or not at all, except history.csv, which grows by a row a step.

    Args:
        path: where to write.
        overwrite: replace an earlier run there.
        keep: what of it is not removed, as it belongs to the new one.

    Raises:
        InputError: the path is a file, cannot be written, or has something in it that must not be replaced.
    """

    # What a run leaves, which the next one there removes.
    own: tuple[str, ...] = _OWN
    # What tells it from other directories, and what is said to be in it.
    marks: tuple[str, ...] = (*MARKS, HISTORY)
    called = "a run"

    def __init__(self, path: str | Path, *, overwrite: bool = False, keep: Sequence[str] = ()) -> None:
        self.path = Path(path)
        self._facts: dict[str, Any] = {}
        self._overwrite, self._keep = overwrite, tuple(keep)
        with _writable(self.path):
            self._check()

    def _check(self) -> None:
        path = self.path
        if path.exists() and not path.is_dir():
            raise InputError(f"output directory {path} is a file: choose another name")
        if path.is_dir() and any(entry.name != LOCK for entry in path.iterdir()):
            if not any((path / name).exists() for name in self.marks) or self._is_foreign():
                raise InputError(f"output directory {path} has other things in it: choose an empty or new one")
            if not self._overwrite:
                raise InputError(f"output directory {path} has {self.called} in it: choose another, or say --overwrite")
        made = [p for p in (path, *path.absolute().parents) if not p.exists()]
        parent = made[-1].parent if made else path
        if not parent.is_dir():
            raise InputError(f"output directory {path} cannot be made: {parent} is a file")
        try:
            path.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=path):
                pass
        finally:  # it was a try: nothing is left behind if something else is wrong
            for directory in made:
                with suppress(OSError):
                    directory.rmdir()

    def _is_foreign(self) -> bool:
        """Whether there is something else than a run, though it looks like one."""
        return (self.path / DESIGN).exists()

    def lock(self) -> DirectoryLock:
        """Make the directory and keep others out of it.

        Raises:
            InputError: another process writes there, or it cannot be made.
        """
        with _writable(self.path):
            self.path.mkdir(parents=True, exist_ok=True)
            return DirectoryLock(self.path)

    def clear(self) -> None:
        """Make the directory, without what an earlier run left.

        Raises:
            InputError: there is a run by now that must not be replaced.
        """
        with _writable(self.path):
            self._check()
        self.path.mkdir(parents=True, exist_ok=True)
        remove_unfinished(self.path)
        for name in set(self.own) - set(self._keep):
            target = self.path / name
            if target.is_dir():
                shutil.rmtree(target)
            else:
                target.unlink(missing_ok=True)
        for part in self.path.glob("checkpoint-part-*.npz"):
            part.unlink()

    def start(self, command: Mapping[str, Any] | None = None, problem: str | None = None) -> None:
        """Make the directory, without what an earlier run left.

        Args:
            command: what the command line was asked, for a later ``tmc-vem resume``.
            problem: text of a problem file that does the run again.

        Raises:
            InputError: there is a run by now that must not be replaced.
        """
        self.clear()
        (self.path / FIELDS).mkdir()
        if command is not None:
            write_atomically(self.path / COMMAND, json.dumps(command, indent=2) + "\n")
        if problem is not None:
            write_atomically(self.path / PROBLEM, problem)

    def begin(self, facts: Mapping[str, Any], *, locked: bool) -> None:
        """Say what the run is, before its first step or before it goes on; an earlier result is no longer one.

        Args:
            facts: inputs, versions, units and sizes, by their names in result.json.
            locked: whether this process holds the directory's lock.
        """
        self._facts = {**facts, "process": process_facts(locked=locked)}
        write_atomically(self.path / BEGUN, json.dumps(finite(self._facts), indent=2) + "\n")
        (self.path / RESULT).unlink(missing_ok=True)

    def interrupted(self, reason: str) -> None:
        """Say why the run that has begun ends without a result, if the disk takes it."""
        if self._facts:
            with suppress(OSError):
                text = json.dumps(finite({**self._facts, "reason": reason}), indent=2) + "\n"
                write_atomically(self.path / BEGUN, text, durable=False)

    def add_step(self, record: StepRecord, units: Mapping[str, str] | None = None) -> None:
        """Append a row to history.csv, whose columns it must not have more than.

        Args:
            record: the step.
            units: of columns, for their headings.
        """
        row = _headed(record, units)
        with (self.path / HISTORY).open("a+", newline="") as file:
            file.seek(0)
            columns = next(csv.reader(file), [])
            writer = csv.DictWriter(file, fieldnames=columns or list(row), restval="")
            if not columns:
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
        (self.path / BEGUN).unlink(missing_ok=True)


@contextmanager
def _writable(path: Path) -> Iterator[None]:
    """Say in one line that a directory cannot be made or written.

    Raises:
        InputError: it cannot.
    """
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        at = "" if error.filename is None or Path(error.filename).parent == path else f" ({error.filename})"
        raise InputError(f"output directory {path} cannot be written: {reason}{at}; choose another") from None


def _headed(record: StepRecord, units: Mapping[str, str] | None) -> dict[str, Any]:
    return {heading(name, (units or {}).get(name, "")): value for name, value in record.as_row().items()}
