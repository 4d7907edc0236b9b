"""A run in two parts: what is prepared can be looked at before it goes, and nothing is written until then."""

from __future__ import annotations

import importlib
import pickle
import subprocess
import sys
from dataclasses import asdict, replace
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import tmc_vem
import tmc_vem.simulation
from tmc_vem import Box, Medium, RunOptions, RunResult, prepare, run
from tmc_vem.results.directory import RunDirectory
from tmc_vem.support.errors import InputError
from tmc_vem.support.timing import Timer

BOX = Box(cells=(20, 5), uy=-0.05, medium=Medium(gamma=1e-4))
OPTIONS = RunOptions(steps=2, snapshots=1)


def without_times(result: RunResult) -> dict[str, Any]:
    plain = asdict(replace(result, seconds={}, directory=None, parallel={}, curves=None, end=None))
    for record in plain["history"]:
        record["seconds"] = 0.0
    return plain


def test_what_is_prepared_can_be_looked_at_and_goes_as_run_does(tmp_path: Path) -> None:
    simulation = prepare(BOX, tmp_path / "box", OPTIONS)
    assert not (tmp_path / "box").exists()
    assert simulation.n_cells == 100
    assert simulation.hints == ()
    u, residual = simulation.system.create_vector(), simulation.system.create_vector()
    held = simulation.system.constrained()
    assert simulation.system.residual(u, residual).min_j == 1.0
    assert residual.norm() < 1e-12
    u.getArray()[held] = -0.01
    assert simulation.system.residual(u, residual).energy > 0.0
    result = simulation.go()
    assert result.complete
    assert (simulation.n_cells, simulation.n_dofs) == (result.n_cells, result.n_dofs)
    assert (tmp_path / "box" / "result.json").exists()
    assert asdict(result)["end"] is result.end
    assert pickle.loads(pickle.dumps(result)).end is None, "a state has ranks, which stay where they are"
    assert without_times(result) == without_times(run(BOX, tmp_path / "other", OPTIONS))


def test_a_run_goes_once() -> None:
    simulation = prepare(BOX, None, OPTIONS)
    simulation.go()
    with pytest.raises(InputError, match="has gone through its load steps already: prepare it again"):
        simulation.go()


def test_a_run_that_has_come_meanwhile_is_kept(tmp_path: Path) -> None:
    first, second = (prepare(BOX, tmp_path / "box", OPTIONS) for _ in range(2))
    first.go()
    result = (tmp_path / "box" / "result.json").read_text()
    with pytest.raises(InputError, match="has a run in it: choose another"):
        second.go()
    assert (tmp_path / "box" / "result.json").read_text() == result
    RunDirectory(tmp_path / "box", overwrite=True).lock().release()


def test_time_between_preparation_and_steps_does_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 0.0
    monkeypatch.setattr("time.perf_counter", lambda: now)
    timer = Timer()
    with timer("set-up"):
        now = 2.0
    timer.pause()
    now = 100.0
    timer.go_on()
    with timer("newton"):
        now = 103.0
    assert timer.report() == {"set-up": 2.0, "newton": 3.0, "other": 0.0, "total": 5.0}


@pytest.mark.parametrize("package", [tmc_vem, tmc_vem.simulation], ids=lambda package: package.__name__)
def test_no_module_takes_the_place_of_a_public_name(package: ModuleType) -> None:
    modules = {path.stem for path in Path(str(package.__file__)).parent.iterdir()}
    assert not modules & set(package.__all__)
    code = f"import importlib; m = importlib.import_module('{package.__name__}'); [getattr(m, n) for n in m.__all__]"
    subprocess.run([sys.executable, "-c", code], check=True)
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        importlib.import_module(package.__name__).nothing  # noqa: B018


def test_options_load_no_petsc() -> None:
    code = "import sys; from tmc_vem.simulation import RunOptions, run, prepare; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert not {"petsc4py.PETSc", "mpi4py.MPI"} & set(loaded)
