"""Process that does one run of a batch: ``python -m tmc_vem.study.batch_worker``; :mod:`tmc_vem.study.batch` starts it.

It reads what to run from stdin, reports on stdout, and ends when stdin is closed: a batch that is killed, however hard,
leaves no runs behind that go on writing.
"""

from __future__ import annotations

import json
import os
import pickle
import sys
import threading
from pathlib import Path
from typing import Any

MARK = "tmc-vem-batch "
KILLED = 137


def main() -> int:
    """Do the run; 0 if its result is written, complete or not."""
    problem, options, directory = pickle.load(sys.stdin.buffer)
    threading.Thread(target=_end_with_parent, daemon=True).start()

    from tmc_vem.support.petsc_start import start
    from tmc_vem.support.singleton import settle

    settle()
    start(["tmc-vem"])
    from dataclasses import replace

    from codegen.errors import CodegenError
    from tmc_vem.adapt.run import run
    from tmc_vem.results.records import StepRecord
    from tmc_vem.simulation.monitor import Monitor
    from tmc_vem.support.errors import TmcError

    class Reporter(Monitor):
        """Passes the load factor on."""

        def stepped(self, record: StepRecord) -> None:
            """A load step has converged."""
            _tell(load=record.load)

    _tell(began=True)
    # runs of a batch are short, and begin anew when they are cut off
    options = replace(options, checkpoint_every=0)
    try:
        run(problem, Path(directory), options, monitor=Reporter())
    except (TmcError, CodegenError) as error:
        _tell(error=str(error))
        return 2
    return 0


def _tell(**message: Any) -> None:
    print(MARK + json.dumps(message), flush=True)


def _end_with_parent() -> None:
    while os.read(sys.stdin.fileno(), 4096):
        pass
    os._exit(KILLED)


if __name__ == "__main__":
    sys.exit(main())
