"""Processes of their own for tests: the command line, and MPI programs."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

_MPI_SETTINGS = {
    "OMP_NUM_THREADS": "1",
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",  # the same for Open MPI 5
    "OMPI_MCA_btl_vader_single_copy_mechanism": "none",
    "MPIR_CVAR_ENABLE_HEAVY_YIELD": "1",  # and MPICH
    "OMPI_MCA_mpi_yield_when_idle": "1",  # more ranks than cores: who waits must not keep a core busy
}

# that of a wheel lies beside Python and is no other's
_BESIDE = Path(sys.executable).with_name("mpirun")
MPIRUN = str(_BESIDE) if _BESIDE.exists() else "mpirun"


def clean_environment() -> dict[str, str]:
    """The environment without what Open MPI leaves in it when this process has started MPI itself; with that left in,
    mpirun takes itself for a part of the running job and ends without a word."""
    leftovers = ("OMPI_", "PMIX_", "PMI_", "ORTE_", "HWLOC_", "MPI_LOCAL")
    return {k: v for k, v in os.environ.items() if not k.startswith(leftovers)} | _MPI_SETTINGS


def process(
    arguments: Sequence[str],
    *,
    ranks: int = 0,
    cwd: Path | str | None = None,
    timeout: float = 150,
    environment: Mapping[str, str] | None = None,
) -> subprocess.CompletedProcess[str]:
    """Run this Python with arguments, under mpirun if ``ranks`` is given; output as text, the exit code not checked."""
    launcher = [MPIRUN, "-n", str(ranks)] if ranks else []
    return subprocess.run(
        [*launcher, sys.executable, *arguments],
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=timeout,
        env=clean_environment() | dict(environment or {}),
        check=False,
    )


def tmc(
    *arguments: str, ranks: int = 0, cwd: Path | str | None = None, timeout: float = 150
) -> subprocess.CompletedProcess[str]:
    """Run the command tmc-vem."""
    return process(
        ["-c", "from tmc_vem.cli.main import main; main()", *arguments], ranks=ranks, cwd=cwd, timeout=timeout
    )


def plain_words(error: BaseException) -> str:
    """What an error says, without the names that numpy 2 gives to the types of its strings."""
    return re.sub(r"np\.\w+_\((b?'[^']*')\)", r"\1", str(error))
