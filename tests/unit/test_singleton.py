"""Processes that no mpirun has started ask nothing of Open MPI that others could take away."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import pytest
from helpers_process import clean_environment, process

from tmc_vem.support.singleton import LAUNCHED, settle

NAMES = ("OMPI_MCA_ess_singleton_isolated", "OMPI_MCA_orte_create_session_dirs")


@pytest.fixture(autouse=True)
def bare(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in (*NAMES, *LAUNCHED):
        monkeypatch.delenv(name, raising=False)


def test_a_process_that_is_alone_has_neither_daemon_nor_directory() -> None:
    settle()
    assert [os.environ[name] for name in NAMES] == ["1", "0"]


@pytest.mark.parametrize("launcher", LAUNCHED)
def test_ranks_of_a_launcher_are_left_alone(launcher: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(launcher, "2")
    settle()
    assert not any(name in os.environ for name in NAMES)


def test_what_a_user_has_set_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(NAMES[0], "0")
    settle()
    assert os.environ[NAMES[0]] == "0"


def test_mpi_of_such_a_process_writes_no_directory() -> None:
    text = "from tmc_vem.support.singleton import settle; settle(); from mpi4py import MPI; import os, sys; "
    with tempfile.TemporaryDirectory() as directory:
        done = process(
            ["-c", text + "print(MPI.COMM_WORLD.size, os.listdir(sys.argv[1]))", directory],
            environment={"TMPDIR": directory},
        )
        assert (done.returncode, done.stdout) == (0, "1 []\n"), done
        assert not list(Path(directory).iterdir())
    assert not any(name in clean_environment() for name in NAMES)
