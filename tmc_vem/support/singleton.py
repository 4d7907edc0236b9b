"""Settings of Open MPI 4 for a process that no mpirun has started."""

from __future__ import annotations

import os

# What launchers tell their processes.
LAUNCHED = ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "PMIX_RANK")


def settle() -> None:
    """Let MPI of a process that is alone do without a daemon and without a directory; call it before MPI is loaded.

    Open MPI 4 forks a daemon for such a process, only for the case that it spawns others. That takes 50 ms, and now and
    then the daemon dies and takes the process with it, without a word. Told to do without, all such processes of a user
    have one directory for their session, which each removes when it ends: another that begins at that moment fails. It
    holds nothing that one process needs.
    """
    if any(name in os.environ for name in LAUNCHED):
        return
    os.environ.setdefault("OMPI_MCA_ess_singleton_isolated", "1")
    os.environ.setdefault("OMPI_MCA_orte_create_session_dirs", "0")
