"""Checkpoints: everything needed to go on with a run, on any number of ranks.

A checkpoint is a NumPy archive that appears whole or not at all; the one before it is kept. (Not HDF5: where dolfinx is
loaded too, its parallel HDF5 library and the serial one of h5py do not get on in one process.)

Nodal values are stored with labels that do not depend on the distribution (coordinates, and a number that tells moments
of a cell apart), so a run may go on with another number of ranks.
"""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.errors import InputError, TmcError
from tmc_vem.files import whole_file

Float = NDArray[np.float64]

CHECKPOINT, BEFORE = "checkpoint.npz", "checkpoint-before.npz"
SCHEMA = 2
_ARRAYS = ("labels_nz", "states_sni")
# Labels of the same node may differ by rounding; this fraction of the domain is far below any node spacing.
TOLERANCE = 1e-9


@dataclass(frozen=True)
class Checkpoint:
    """The last converged states and where the load stepping stands.

    Attributes:
        facts: inputs of the run, position of the load stepper and records so far, as plain values.
        labels_nz: (n_nodes, 3) labels of the nodes; nodes shared by ranks may stand there more than once.
        states_sni: (n_states, n_nodes, 2) displacements at the last converged steps, the newest at the end.
    """

    facts: Mapping[str, Any]
    labels_nz: Float
    states_sni: Float

    def write(self, directory: Path) -> None:
        """Write into a run directory; the last good checkpoint stays if this fails.

        Raises:
            TmcError: the disk is full or the directory cannot be written.
        """
        try:
            with whole_file(directory / CHECKPOINT, keep=directory / BEFORE) as temporary:
                # made in memory: the archive's writer would complain a second time, later, if the disk is full
                archive = io.BytesIO()
                np.savez(
                    archive, schema=SCHEMA, facts=json.dumps(self.facts), sha256=self._digest(),
                    labels_nz=self.labels_nz, states_sni=self.states_sni,
                )  # fmt: skip
                temporary.write_bytes(archive.getbuffer())
        except OSError as error:
            reason = error.strerror or str(error)
            raise TmcError(
                f"the checkpoint in {directory} could not be written ({reason}); the last one is intact"
            ) from error

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
            except FileNotFoundError:
                problems.append(f"no {name}")
            except (OSError, EOFError, KeyError, ValueError, zipfile.BadZipFile) as error:
                problems.append(f"{name} is damaged ({error})")
        raise InputError(f"{directory} has no checkpoint to go on from: {'; '.join(problems)}")

    def values_at(self, labels_nz: Float) -> Float:
        """The states (n_states, n, 2) at nodes with these labels.

        Raises:
            InputError: a node is not in the checkpoint, which then belongs to another mesh.
        """
        from scipy.spatial import cKDTree

        if not len(labels_nz):
            return np.empty((len(self.states_sni), 0, 2))
        distance, position = cKDTree(self.labels_nz).query(labels_nz)
        extent = np.ptp(self.labels_nz[:, :2], axis=0).max()
        far = np.flatnonzero(distance > TOLERANCE * extent)
        if len(far):
            x, y = labels_nz[far[0], :2]
            raise InputError(f"the checkpoint has no node at ({x:g}, {y:g}): it belongs to another mesh")
        states: Float = self.states_sni[:, position]
        return states

    def _digest(self) -> str:
        digest = hashlib.sha256(json.dumps(self.facts).encode())
        for key in _ARRAYS:
            digest.update(np.ascontiguousarray(getattr(self, key)).tobytes())
        return digest.hexdigest()


def _read(path: Path) -> Checkpoint:
    if not path.exists():
        raise FileNotFoundError(path)
    with np.load(path, allow_pickle=False) as file:
        if int(file["schema"]) != SCHEMA:
            raise ValueError(f"it was written by another version: schema {int(file['schema'])}, here {SCHEMA}")
        checkpoint = Checkpoint(json.loads(str(file["facts"])), *(np.array(file[key]) for key in _ARRAYS))
        if checkpoint._digest() != str(file["sha256"]):
            raise ValueError("its checksum is wrong")
    return checkpoint
