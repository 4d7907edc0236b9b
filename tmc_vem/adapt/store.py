"""What adapted runs keep in their directory: where the rounds stand, their results, meshes for ParaView.

``adapt/rounds.json`` has the rounds, ``adapt/01-state.npz`` the state that the next one begins with, bit for bit,
``adapt/mesh.npz`` the mesh that came out, ``adapt/round-00.vtu`` and so on what each mesh was and how it deforms, and
``adapt.pvd`` opens them all. ``mesh.vtu`` is the last mesh as a mesh file.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, fields, replace
from pathlib import Path, PurePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.adapt.estimate import Estimate
from tmc_vem.adapt.rounds import Finished, Standing, Watcher
from tmc_vem.adapt.solved import Solved, prepared
from tmc_vem.mesh.files.io import write_mesh
from tmc_vem.mesh.make.change import CellTree
from tmc_vem.mesh.stored import DAMAGED, mesh_arrays, mesh_of
from tmc_vem.problems.base import Problem, media_of
from tmc_vem.problems.on_mesh import OnMesh
from tmc_vem.results import unfinished
from tmc_vem.results.adapted_rounds import ERROR_OF, round_file
from tmc_vem.results.adaptivity import Round
from tmc_vem.results.output import fields_of, polygons_of
from tmc_vem.results.records import ADAPT, ADAPTED, ADAPTED_MESH, ADAPTED_PICTURE, PROBLEM
from tmc_vem.results.unfinished import BEGUN, COMMAND, checkpoint_inputs, how_to_go_on
from tmc_vem.results.vtu import VtuWriter
from tmc_vem.simulation import adapted
from tmc_vem.simulation.adapt_settings import AdaptSettings
from tmc_vem.simulation.checkpoint import require_same_inputs
from tmc_vem.simulation.monitor import Monitor
from tmc_vem.simulation.options import RunOptions
from tmc_vem.support.errors import InputError, TmcError
from tmc_vem.support.files import whole_file, write_atomically
from tmc_vem.system.control import Control
from tmc_vem.system.fields import write_pvd

ROUNDS, STATE, MESH = PurePath(unfinished.ROUNDS).name, "state.npz", PurePath(adapted.MESH).name
# What a run directory keeps when the run on the last mesh begins there; without the last two, which are written anew,
# a run that is killed just then could not go on.
KEPT = (ADAPT, ADAPTED, ADAPTED_MESH, ADAPTED_PICTURE, PROBLEM, BEGUN, COMMAND)


class RoundStore(Watcher):
    """Keeps rounds in a run directory, if there is one, and tells the monitor of them; on rank 0.

    Args:
        path: run directory, or None.
        problem, options: of the run.
        inputs: of the run, by which a later one recognises the rounds.
        monitor: hears of every round.
    """

    def __init__(
        self, path: Path | None, problem: Problem, options: RunOptions, inputs: Mapping[str, Any], monitor: Monitor
    ) -> None:
        self._directory = None if path is None else path / ADAPT
        self._problem, self._options, self._inputs, self._monitor = problem, options, dict(inputs), monitor

    def restored(self) -> Standing | Finished | None:
        """Where the rounds of the directory stand; None before the first state.

        Raises:
            InputError: they were made with other inputs, or a file is damaged.
        """
        directory = self._directory
        if directory is None or not (directory / ROUNDS).is_file():
            return None
        try:
            facts = json.loads((directory / ROUNDS).read_text())
            rounds = tuple(Round(**each) for each in facts["rounds"])
            require_same_inputs(facts["inputs"], self._inputs)
            if facts["finished"] is not None:
                with np.load(directory / MESH, allow_pickle=False) as file:
                    return Finished(mesh_of(file), rounds, **facts["finished"])
            return self._standing(facts["standing"], rounds)
        except DAMAGED as error:
            raise InputError(f"{directory} is damaged ({error}): run it again with --overwrite") from None

    def stands(self, standing: Standing) -> None:
        """Write where the rounds stand.

        Raises:
            TmcError: the directory cannot be written.
        """
        if self._directory is None:
            return
        with self._writing():
            self._keep(standing)

    def _keep(self, standing: Standing) -> None:
        assert self._directory is not None
        solved = standing.solved
        facts = {
            "before": dict(standing.before),
            "target": standing.target,
            "at_target": standing.at_target,
            "missed": list(standing.missed),
            "load": solved.position.load,
            "parameters": dict(solved.position.parameters),
            "found": solved.found,
            "iterations": solved.iterations,
            "shift": solved.simulation.solver.last_shift,
        }
        tree = {f"tree {field.name}": getattr(standing.tree, field.name) for field in fields(CellTree)}
        self._directory.mkdir(parents=True, exist_ok=True)
        # the state first: one of a round that rounds.json does not know of is made again
        name = f"{len(standing.rounds):02d}-{STATE}"
        arrays = {**mesh_arrays(solved.mesh), **tree, "u": solved.u.getArray(readonly=True)}
        self._save(name, arrays)
        self._write(standing.rounds, standing={**facts, "state": name})
        for old in self._directory.glob(f"*-{STATE}"):
            if old.name != name:
                old.unlink()

    def done(self, round_: Round, solved: Solved, estimate: Estimate) -> None:
        """Draw a round for ParaView, and tell of it.

        Raises:
            TmcError: the directory cannot be written.
        """
        self._monitor.adapted(round_, self._options.adapt.names)
        if self._directory is None:
            return
        with self._writing():
            self._draw(round_, solved, estimate)

    def _draw(self, round_: Round, solved: Solved, estimate: Estimate) -> None:
        assert self._directory is not None
        self._directory.mkdir(parents=True, exist_ok=True)
        data = {ERROR_OF + name: values for name, values in estimate.indicators.items()}
        system = solved.simulation.system
        numbers = system.cell_numbers()
        made = fields_of(system, solved.u, polygons_of(system, media_of(self._problem)))
        made = replace(made, cell_fields={name: values[numbers] for name, values in data.items()})
        no_unit = dict.fromkeys(data, "")  # that of the result, or of the energy where it has no derivative
        writer = VtuWriter(made.polygons, self._problem.units(), no_unit)
        writer.write(self._directory / round_file(round_.number), made)
        files = [(float(n), [f"{ADAPT}/{round_file(n)}"]) for n in range(round_.number + 1)]
        write_pvd(self._directory.parent / ADAPTED, files)

    def finished(self, end: Finished) -> None:
        """Write the mesh that came out.

        Raises:
            TmcError: the directory cannot be written.
        """
        if self._directory is None:
            return
        with self._writing():
            self._save(MESH, mesh_arrays(end.mesh))
            write_mesh(end.mesh, self._directory.parent / ADAPTED_MESH)
            self._write(end.rounds, finished={"reached": end.reached, "reason": end.reason})
            for old in self._directory.glob(f"*-{STATE}"):
                old.unlink()

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Say in one line that the directory cannot be written.

        Raises:
            TmcError: it cannot; what was written before is intact.
        """
        assert self._directory is not None
        path = self._directory.parent
        try:
            yield
        except OSError as error:
            how = how_to_go_on(path)
            after = f"; what is there is intact: with more room, {how}" if how else ""
            raise TmcError(f"{path} could not be written ({error.strerror or error}){after}") from error

    def _standing(self, facts: Mapping[str, Any], rounds: tuple[Round, ...]) -> Standing:
        assert self._directory is not None
        with np.load(self._directory / facts["state"], allow_pickle=False) as file:
            mesh = mesh_of(file)
            tree = CellTree(**{field.name: file[f"tree {field.name}"] for field in fields(CellTree)})
            values = file["u"]
        problem = OnMesh(self._problem, mesh)
        simulation = prepared(problem, replace(self._options, adapt=AdaptSettings()))
        simulation.solver.last_shift = facts["shift"]
        u = simulation.system.create_vector()
        u.getArray()[:] = values
        position = Control(facts["load"], facts["parameters"])
        if position.parameters:
            simulation.system.set_parameters(position.parameters)
        solved = Solved(problem, mesh, simulation, u, position, facts["found"], facts["iterations"])
        return Standing(
            solved, tree, facts["before"], facts["target"], facts["at_target"], rounds, tuple(facts["missed"])
        )  # fmt: skip

    def _save(self, name: str, arrays: Mapping[str, NDArray[Any]]) -> None:
        assert self._directory is not None
        with whole_file(self._directory / name) as temporary, temporary.open("wb") as file:
            np.savez(file, **arrays)

    def _write(
        self, rounds: tuple[Round, ...], *, standing: Mapping[str, Any] | None = None,
        finished: Mapping[str, Any] | None = None,
    ) -> None:  # fmt: skip
        assert self._directory is not None
        adapt = self._options.adapt
        plain = {
            "inputs": self._inputs, "of": adapt.names, "tolerance": adapt.relative,
            "rounds": [asdict(each) for each in rounds], "standing": standing, "finished": finished,
        }  # fmt: skip
        text = json.dumps(plain, indent=2)
        write_atomically(self._directory / ROUNDS, text + "\n")


def has_run(path: Path, *, adapted: bool) -> bool:
    """Whether a directory has a checkpoint of the run on the last mesh, or of one on the mesh as it was."""
    inputs = checkpoint_inputs(path)
    return inputs is not None and ("adapt" in inputs) == adapted
