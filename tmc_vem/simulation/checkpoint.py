"""Checkpoints: everything needed to go on with a run, on any number of ranks.

A checkpoint is a NumPy archive that appears whole or not at all, so that a killed run loses nothing. Waiting for the
disk after each would take longer than small steps do: that is done every ten seconds, and the last checkpoint for which
it was is kept beside the newest, for the case of a power cut.

With several ranks, each writes its own nodes as a part; the archive of rank 0, which names the parts and their
checksums, appears last. (Not HDF5: where dolfinx is loaded too, its parallel HDF5 library and the serial one of h5py do
not get on in one process.)

Nodal values are stored with labels that do not depend on the distribution (coordinates, and a number that tells moments
of a cell apart), so a run may go on with another number of ranks. So is the shear of points with friction, with their
coordinates.
"""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.results.unfinished import BEFORE, CHECKPOINT, how_to_go_on
from tmc_vem.support.errors import InputError, TmcError
from tmc_vem.support.files import whole_file

Float = NDArray[np.float64]

PARTS = "checkpoint-part-*.npz"
SCHEMA = 4
DURABLE = 10.0  # seconds of a run that a power cut may cost
_ARRAYS = ("labels_nz", "states_sni")
_OF_FRICTION = ("points_px", "shear_kp")  # which other checkpoints do not have
# Labels of the same node may differ by rounding; this fraction of the domain is far below any node spacing.
TOLERANCE = 1e-9


@dataclass(frozen=True)
class Checkpoint:
    """The last converged states and where the load stepping stands.

    Attributes:
        facts: inputs of the run, position of the load stepper and records so far, as plain values.
        labels_nz: (n_nodes, 3) labels of the nodes; nodes shared by ranks may stand there more than once.
        states_sni: (n_states, n_nodes, 2) displacements at the last converged steps, the newest at the end, and what
            else is kept of nodes, see :mod:`tmc_vem.simulation.saved`.
        points_px: (n_points, 2) quadrature points with friction.
        shear_kp: (n_beginnings, n_points) Kirchhoff shear reached there where steps began.
    """

    facts: Mapping[str, Any]
    labels_nz: Float
    states_sni: Float
    points_px: Float = field(default_factory=lambda: np.empty((0, 2)))
    shear_kp: Float = field(default_factory=lambda: np.empty((0, 0)))

    def write(
        self, directory: Path, parts: Mapping[str, str] | None = None, *, durable: bool = True, keep: bool = True
    ) -> None:
        """Write into a run directory; the last good checkpoint stays if this fails.

        Args:
            directory: run directory.
            parts: checksums of the other ranks' parts by file name, from :meth:`write_part`.
            durable: wait until the disk has it.
            keep: the checkpoint that is replaced becomes the one before.

        Raises:
            TmcError: the disk is full or the directory cannot be written.
        """
        parts, before = dict(parts or {}), directory / BEFORE
        self._write(directory / CHECKPOINT, parts, durable, before if keep else None)
        found = list(directory.glob(PARTS))
        needed = {*parts, *_parts_of(before)} if found else parts
        for old in found:
            if old.name not in needed:
                old.unlink(missing_ok=True)

    def write_part(self, directory: Path, name: str, *, durable: bool = True) -> str:
        """Write the nodes of one rank under a name of their own; their checksum.

        Raises:
            TmcError: the disk is full or the directory cannot be written.
        """
        return self._write(directory / name, {}, durable)

    def _write(self, path: Path, parts: Mapping[str, str], durable: bool, keep: Path | None = None) -> str:
        facts = json.dumps(self.facts)
        digest = self._digest(facts)
        try:
            with whole_file(path, keep, durable=durable) as temporary:
                # made in memory: the archive's writer would complain a second time, later, if the disk is full
                archive = io.BytesIO()
                np.savez(
                    archive, schema=SCHEMA, facts=facts, sha256=digest,
                    parts=json.dumps(parts), **{key: getattr(self, key) for key in self._keys},
                )  # fmt: skip
                temporary.write_bytes(archive.getbuffer())
        except OSError as error:
            reason, how = error.strerror or str(error), how_to_go_on(path.parent)
            after = f"; the last one is intact: with more room, {how}" if how else ""
            raise TmcError(f"the checkpoint in {path.parent} could not be written ({reason}){after}") from error
        return digest

    @staticmethod
    def read(directory: Path) -> Checkpoint:
        """The last good checkpoint of a run directory: a torn one is passed over for the one before.

        Raises:
            InputError: there is none.
        """
        problems = []
        for name in (CHECKPOINT, BEFORE):
            try:
                return _read(directory / name)
            except FileNotFoundError as missing:
                problems.append(f"no {Path(missing.args[0]).name}")
            except (OSError, EOFError, KeyError, ValueError, zipfile.BadZipFile) as error:
                problems.append(f"{name} is damaged ({error})")
        raise InputError(f"{directory} has no checkpoint to go on from: {'; '.join(problems)}")

    def values_at(self, labels_nz: Float) -> Float:
        """The states (n_states, n, 2) at nodes with these labels.

        Raises:
            InputError: a node is not in the checkpoint, which then belongs to another mesh; or two are at one place.
        """
        from scipy.spatial import cKDTree

        if not len(labels_nz):
            return np.empty((len(self.states_sni), 0, 2))
        tree = cKDTree(self.labels_nz)
        distance, position = tree.query(labels_nz)
        extent = np.ptp(self.labels_nz[:, :2], axis=0).max()
        if tree.query_pairs(TOLERANCE * extent, output_type="ndarray").size:
            raise InputError("the mesh has cracks, whose nodes are at the same place: its runs cannot be resumed")
        far = np.flatnonzero(distance > TOLERANCE * extent)
        if len(far):
            x, y = labels_nz[far[0], :2]
            raise InputError(f"the checkpoint has no node at ({x:g}, {y:g}): it belongs to another mesh")
        states: Float = self.states_sni[:, position]
        return states

    @property
    def _keys(self) -> tuple[str, ...]:
        return _ARRAYS + _OF_FRICTION if len(self.shear_kp) else _ARRAYS

    def _digest(self, facts: str) -> str:
        digest = hashlib.sha256(facts.encode())
        for key in self._keys:
            digest.update(np.ascontiguousarray(getattr(self, key)).data)
        return digest.hexdigest()


def require_same_inputs(before: Mapping[str, Any], now: Mapping[str, Any]) -> None:
    """Check that a checkpoint was made with the same inputs.

    Raises:
        InputError: one differs; the message names it.
    """
    first, second = _entries(before), _entries(json.loads(json.dumps(now)))
    for name in sorted({*first, *second}):
        if first.get(name) != second.get(name):
            raise InputError(
                f"the checkpoint was made with {name} = {first.get(name)}, not {second.get(name)}: start anew"
            )


def _entries(inputs: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """Entries of tables within tables, by names with dots."""
    found: dict[str, Any] = {}
    for name, value in inputs.items():
        found |= _entries(value, f"{before}{name}.") if isinstance(value, dict) else {before + name: value}
    return found


def _parts_of(path: Path) -> list[str]:
    """Names of the parts of a checkpoint, as far as it can be read."""
    try:
        with np.load(path, allow_pickle=False) as file:
            return list(json.loads(str(file["parts"])))
    except (OSError, EOFError, KeyError, ValueError, zipfile.BadZipFile):
        return []


def _read(path: Path) -> Checkpoint:
    if not path.exists():
        raise FileNotFoundError(path)
    with np.load(path, allow_pickle=False) as file:
        if int(file["schema"]) != SCHEMA:
            raise ValueError(f"it was written by another version: schema {int(file['schema'])}, here {SCHEMA}")
        facts = str(file["facts"])
        keys = [key for key in _ARRAYS + _OF_FRICTION if key in _ARRAYS or key in file]
        checkpoint = Checkpoint(json.loads(facts), *(np.array(file[key]) for key in keys))
        if checkpoint._digest(facts) != str(file["sha256"]):
            raise ValueError("its checksum is wrong")
        parts: dict[str, str] = json.loads(str(file["parts"]))
    pieces = [checkpoint]
    for name, digest in parts.items():
        pieces.append(_read(path.with_name(name)))
        if pieces[-1]._digest(json.dumps(pieces[-1].facts)) != digest:
            raise ValueError(f"its part {name} is another one")
    return Checkpoint(
        checkpoint.facts,
        np.concatenate([piece.labels_nz for piece in pieces]),
        np.concatenate([piece.states_sni for piece in pieces], axis=1),
        np.concatenate([piece.points_px for piece in pieces]),
        np.concatenate([piece.shear_kp for piece in pieces], axis=1),
    )
