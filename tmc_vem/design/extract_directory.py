"""The directory of the outlines of a design: problem files, mesh, pictures, report, and their runs."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from tmc_vem.results.design_run import OUTLINES
from tmc_vem.results.directory import RunDirectory
from tmc_vem.results.records import DESIGN, finite
from tmc_vem.support.files import write_atomically

# What 'tmc-vem extract' found, as plain values: it tells these directories from others.
FOUND = "outlines.json"
PICTURE, CURVES, RUNS, EXTRACTED = "outlines.png", "curves", "run", "extracted"
BEGINNINGS = (EXTRACTED, CURVES)  # of the files of load cases


class OutlinesDirectory(RunDirectory):
    """Writes what ``tmc-vem extract`` finds.

    Args:
        path: where to write.
        overwrite: replace earlier outlines there.

    Raises:
        InputError: the path is a file, cannot be written, or has something in it that must not be replaced.
    """

    own = (FOUND, PICTURE, "report.html", "report.md", "figures", RUNS)
    marks = (FOUND,)
    called = "outlines"

    def _is_foreign(self) -> bool:
        return (self.path / DESIGN).exists()

    def start_outlines(self) -> None:
        """Make the directory, without what was there before.

        Raises:
            InputError: there is something by now that must not be replaced.
        """
        known = (self.path / FOUND).is_file()
        self.clear()
        for beginning in BEGINNINGS if known else ():
            for leftover in self.path.glob(f"{beginning}*.*"):
                leftover.unlink()
        self.write_found({"kind": OUTLINES, "complete": None})  # a kill leaves a directory that can be told from others

    def write_found(self, found: Mapping[str, Any]) -> str:
        """Write, and return, what was found as JSON."""
        text = json.dumps(finite(dict(found)), indent=2, allow_nan=False) + "\n"
        write_atomically(self.path / FOUND, text)
        return text
