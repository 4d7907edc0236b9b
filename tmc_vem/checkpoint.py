"""Checkpoints: everything needed to go on with a run, on any number of ranks.

A checkpoint is a NumPy archive that appears whole or not at all; the one before it is kept. (Not HDF5: where dolfinx is
loaded too, its parallel HDF5 library and the serial one of h5py do not get on in one process.)

Nodal values are stored with labels that do not depend on the distribution (coordinates, and a number that tells moments
of a cell apart), so a run may go on with another number of ranks.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import tempfile
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.errors import InputError, TmcError

Float = NDArray[np.float64]

CHECKPOINT, BEFORE = "checkpoint.npz", "checkpoint-before.npz"
SCHEMA = 1
_ARRAYS = ("labels_nz", "state_ni", "previous_ni")
# Labels of the same node may differ by rounding; this fraction of the domain is far below any node spacing.
TOLERANCE = 1e-9


@dataclass(frozen=True)
class Checkpoint:
    """A converged state and where the load stepping stands.

    Attributes:
        facts: inputs of the run, position of the load stepper and records so far, as plain values.
        labels_nz: (n_nodes, 3) labels of the nodes; nodes shared by ranks may stand there more than once.
        state_ni, previous_ni: (n_nodes, 2) displacements at the last converged step and the one before.
    """

    facts: Mapping[str, Any]
    labels_nz: Float
    state_ni: Float
    previous_ni: Float

    def write(self, directory: Path) -> None:
        """Write into a run directory; the last good checkpoint stays if this fails.

        Raises:
            TmcError: the disk is full or the directory cannot be written.
        """
        handle, name = tempfile.mkstemp(dir=directory, prefix=".checkpoint-", suffix=".npz")
        os.close(handle)
        try:
            np.savez(
                name, schema=SCHEMA, facts=json.dumps(self.facts), sha256=self._digest(),
                labels_nz=self.labels_nz, state_ni=self.state_ni, previous_ni=self.previous_ni,
            )  # fmt: skip
            with open(name, "rb") as written:
                os.fsync(written.fileno())
            current = directory / CHECKPOINT
            if current.exists():
                os.replace(current, directory / BEFORE)
            os.replace(name, current)
        except OSError as error:
            with contextlib.suppress(OSError):
                os.unlink(name)
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

    def values_at(self, labels_nz: Float) -> tuple[Float, Float]:
        """State and previous state (n, 2) at nodes with these labels.

        Raises:
            InputError: a node is not in the checkpoint, which then belongs to another mesh.
        """
        from scipy.spatial import cKDTree

        if not len(labels_nz):
            return np.empty((0, 2)), np.empty((0, 2))
        distance, position = cKDTree(self.labels_nz).query(labels_nz)
        extent = np.ptp(self.labels_nz[:, :2], axis=0).max()
        far = np.flatnonzero(distance > TOLERANCE * extent)
        if len(far):
            x, y = labels_nz[far[0], :2]
            raise InputError(f"the checkpoint has no node at ({x:g}, {y:g}): it belongs to another mesh")
        return self.state_ni[position], self.previous_ni[position]

    def _digest(self) -> str:
        digest = hashlib.sha256(json.dumps(self.facts).encode())
        for key in _ARRAYS:
            digest.update(np.ascontiguousarray(getattr(self, key)).tobytes())
        return digest.hexdigest()


def _read(path: Path) -> Checkpoint:
    if not path.exists():
        raise FileNotFoundError(path)
    with np.load(path, allow_pickle=False) as file:
        if int(file["schema"]) > SCHEMA:
            raise ValueError(f"schema {int(file['schema'])} is newer than {SCHEMA}")
        checkpoint = Checkpoint(json.loads(str(file["facts"])), *(np.array(file[key]) for key in _ARRAYS))
        if checkpoint._digest() != str(file["sha256"]):
            raise ValueError("its checksum is wrong")
    return checkpoint
