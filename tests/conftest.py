"""The order of the test files, and what tests of several files use."""

from __future__ import annotations

import pytest

from tmc_vem.support.singleton import settle

settle()  # tests load MPI in their own process as well

# Files that take long, the longest first, so that none is left at the end; pytest-xdist goes by numbers of tests.
LONG = (
    "tests/test_docs.py",
    "tests/mpi/test_mpi_runs.py",
    "tests/mpi/test_mpi_sensitivity.py",
    "tests/test_demos.py",
    "tests/unit/test_interior_penalty.py",
    "tests/unit/test_compare.py",
    "tests/unit/test_codegen_cli.py",
    "tests/unit/test_cli.py",
    "tests/unit/test_overlap.py",
    "tests/mpi/test_mpi_problem_files.py",
    "tests/mpi/test_mpi_vem.py",
    "tests/unit/test_problem_file.py",
    "tests/unit/test_codegen_compilers.py",
    "tests/unit/test_codegen_device.py",
    "tests/unit/test_unfinished.py",
    "tests/unit/test_batch.py",
    "tests/unit/test_adapt_resume.py",
    "tests/fem/test_fem_taylor.py",
    "tests/fem/test_fem_mpi.py",
    "tests/fem/test_fem_plain_library.py",
    "tests/test_extending.py",
)


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Sort the files of a worker of pytest-xdist; without it, and within a file, the order stays."""
    if hasattr(config, "workerinput"):
        place = {name: n for n, name in enumerate(LONG)}
        items.sort(key=lambda item: place.get(item.nodeid.partition("::")[0], len(LONG)))


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures of reports are made but not drawn, for tests of the words: drawing takes nearly all the time."""
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda *_, **__: None)


@pytest.fixture(scope="module", params=("vem", "fem"))
def method(request: pytest.FixtureRequest) -> str:
    """Both methods, finite elements where dolfinx is."""
    if request.param == "fem":
        pytest.importorskip("dolfinx")
    return str(request.param)
