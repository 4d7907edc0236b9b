"""The last states of all load cases as a checkpoint, from which a search goes on with the same bits."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.design.load_case import LoadCase
from tmc_vem.simulation.checkpoint import Checkpoint, require_same_inputs
from tmc_vem.support.distributed import Comm, Vec
from tmc_vem.support.errors import InputError
from tmc_vem.support.parallel import on_every_rank, on_root
from tmc_vem.system.layout import DISPLACEMENT

Float = NDArray[np.float64]


def write_states(
    directory: Path, comm: Comm, cases: Mapping[str, LoadCase], inputs: Mapping[str, Any], evaluation: int, *,
    durable: bool, keep: bool,
) -> None:  # fmt: skip
    """Write the last states; called on all ranks.

    Args:
        directory: of the design.
        comm: the ranks.
        cases: load cases by name, which have the same nodes.
        inputs: what the search is made with.
        evaluation: number of the last one.
        durable: wait until the disk has it.
        keep: the checkpoint that is replaced becomes the one before.

    Raises:
        TmcError: the disk is full or the directory cannot be written.
    """
    labels_nz = next(iter(cases.values())).system.node_labels()
    facts = {
        "inputs": inputs,
        "evaluation": evaluation,
        "cases": [
            {"name": name, "shift": case.shift, "watched": case.watched, "stiffness": _as_text(case.stiffness_c)}
            for name, case in cases.items()
        ],
    }
    mine = Checkpoint(facts if comm.rank == 0 else {}, labels_nz, np.array([_nodal(case) for case in cases.values()]))
    part = None if comm.rank == 0 else f"checkpoint-part-{evaluation:06d}-{comm.rank}.npz"
    checksum = on_every_rank(comm, lambda: part and mine.write_part(directory, part, durable=durable))
    parts = {name: value for name, value in comm.gather((part, checksum)) or () if name and value}
    on_root(comm, lambda: mine.write(directory, parts, durable=durable, keep=keep))


def read_states(directory: Path, inputs: Mapping[str, Any]) -> Checkpoint:
    """The last good checkpoint of a search.

    Raises:
        InputError: there is none, or it was made with other inputs.
    """
    checkpoint = Checkpoint.read(directory)
    facts = checkpoint.facts
    if "evaluation" not in facts:
        raise InputError(f"{directory} has the checkpoint of a run, none of 'tmc-vem optimise': use 'tmc-vem resume'")
    require_same_inputs(facts["inputs"], inputs)
    return checkpoint


def restore(checkpoint: Checkpoint, cases: Mapping[str, LoadCase]) -> None:
    """Bring load cases to the states of a checkpoint.

    Raises:
        InputError: it belongs to another mesh.
    """
    for n, (entry, case) in enumerate(zip(checkpoint.facts["cases"], cases.values(), strict=True)):
        states_sni = checkpoint.values_at(case.system.node_labels())
        u: Vec | None = None
        if entry["stiffness"] is not None:
            u = case.system.create_vector()
            u.getArray()[:] = states_sni[n].ravel()
        is_active, crossed = entry.get("watched", (False, False))
        case.remember(u, _as_numbers(entry["stiffness"]), entry["shift"], (is_active, crossed))


def _as_text(values: Float | None) -> str | None:
    """Numbers to the last bit, as text."""
    return None if values is None else base64.b64encode(np.ascontiguousarray(values, "<f8").tobytes()).decode()


def _as_numbers(text: str | None) -> Float | None:
    return None if text is None else np.frombuffer(base64.b64decode(text), "<f8").astype(np.float64)


def _nodal(case: LoadCase) -> Float:
    """(n_nodes, 2) the last state of a load case; 0 before there is one."""
    u = case.system.create_vector() if case.u is None else case.u
    nodal_ni: Float = DISPLACEMENT.nodal(u.getArray(readonly=True)).copy()
    return nodal_ni
