"""What all speed benchmarks share: interleaved repetitions, facts about the machine, a table on screen and json."""

from __future__ import annotations

import json
import os
import platform
import statistics
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

# for mpirun as root, and with more ranks than cores: of Open MPI 4, and of 5
MPI_SETTINGS = {
    "OMP_NUM_THREADS": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
}
# more ranks than cores: who waits must not keep a core busy
YIELD = {"OMPI_MCA_mpi_yield_when_idle": "1", "MPIR_CVAR_ENABLE_HEAVY_YIELD": "1"}
RESULTS = Path(__file__).resolve().parent.parent / "runs" / "bench"


@dataclass
class Samples:
    """Processor seconds of repetitions of one piece of work."""

    seconds: list[float] = field(default_factory=list)

    @property
    def best(self) -> float:
        """The smallest: what the work takes where nothing disturbs it."""
        return min(self.seconds)

    @property
    def median(self) -> float:
        """The median."""
        return statistics.median(self.seconds)


def interleaved(work: Mapping[str, Callable[[], object]], repetitions: int = 7) -> dict[str, Samples]:
    """Time several pieces of work in turn, so that a busy moment of the machine falls on all of them.

    What counts is processor time: the moments in which other processes have the core are not ours. With one thread and
    nothing to wait for it is the time on a quiet machine.
    """
    samples = {name: Samples() for name in work}
    for run in work.values():  # warm caches, first-touch memory
        run()
    for _ in range(repetitions):
        for name, run in work.items():
            started = time.process_time()
            run()
            samples[name].seconds.append(time.process_time() - started)
    return samples


def machine() -> dict[str, Any]:
    """What a reader has to know about the machine to make sense of seconds."""
    model = platform.processor() or platform.machine()
    flags = ""
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            key, _, value = line.partition(":")
            if key.strip() == "model name":
                model = value.strip()
            if key.strip() == "flags":
                flags = value
                break
    except OSError:
        pass
    vector = next((name for name in ("avx512f", "avx2", "avx") if name in flags.split()), "none")
    return {
        "processor": model,
        "vector_unit": vector,
        "cores": os.cpu_count(),
        "system": platform.platform(),
        "python": platform.python_version(),
        "stack": stack(),
        "threads": os.environ.get("OMP_NUM_THREADS", "not set"),
    }


def stack() -> str:
    """Libraries that the time goes to, and the compiler."""
    import numpy
    from mpi4py import MPI

    from codegen.build import compiler
    from tmc_vem.fem import compat
    from tmc_vem.support.petsc import PETSc

    said = subprocess.run([*compiler(), "--version"], capture_output=True, text=True, check=False).stdout
    parts = [
        f"PETSc {'.'.join(map(str, PETSc.Sys.getVersion()))}",
        "dolfinx " + ".".join(map(str, compat.require())),
        MPI.Get_library_version().split(",")[0].splitlines()[0].strip(),
        f"numpy {numpy.__version__}",
        next(iter(said.splitlines()), "an unknown compiler"),
    ]
    return ", ".join(parts)


def report(
    name: str,
    title: str,
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    data: Mapping[str, Any],
    width: int = 132,
) -> None:
    """Print a table of at most so many characters and write ``runs/bench/<name>.json``."""
    table = Table(title=title, title_justify="left")
    for n, heading in enumerate(columns):
        table.add_column(heading, justify="left" if n == 0 else "right")
    for row in rows:
        table.add_row(*row)
    Console(highlight=False, width=width).print(table)
    RESULTS.mkdir(parents=True, exist_ok=True)
    (RESULTS / f"{name}.json").write_text(json.dumps({"machine": machine(), **data}, indent=1) + "\n")
