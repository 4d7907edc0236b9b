"""Stiffnesses of a design in a file: one for every cell, which is known by its centroid.

``np.load`` reads the file; its arrays are ``centroid_cx`` (n_cells, 2) and ``stiffness_c`` (n_cells,), of the cells of
all design regions, in any order. So a design can be solved on any number of ranks, and with either method.
"""

from __future__ import annotations

import hashlib
import io
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.energy.mixed import STIFFNESS
from tmc_vem.support.errors import InputError
from tmc_vem.support.files import whole_file
from tmc_vem.system.enclosed import shown_place

Float = NDArray[np.float64]
Int = NDArray[np.int64]

SUFFIX = ".npz"
NEAR = 1e-6  # of the design's extent, by which centroids of the same cell may differ: rounding, and formats of meshes


@dataclass(frozen=True)
class StiffnessOfFile:
    """Implements :class:`tmc_vem.system.graded.Graded`.

    Attributes:
        path: the file.

    Raises:
        InputError: it is not there, has not the arrays of a design, or values that are none.
    """

    path: Path
    names: tuple[str, ...] = (STIFFNESS,)

    def __post_init__(self) -> None:
        _ = self._content

    @property
    def digest(self) -> str:
        """Hash of the design, by which runs of two designs differ."""
        digest = hashlib.sha256()
        for values in self._content:
            digest.update(np.ascontiguousarray(values).tobytes())
        return digest.hexdigest()[:16]

    def factors(self, centroid_cx: Float, data: Mapping[str, Float]) -> Float:
        """(n_cells, 1) stiffnesses.

        Raises:
            InputError: the design has no cell at one of the places.
        """
        if not len(centroid_cx):
            return np.empty((0, 1))
        found: Float = self._content[1][self.nearest(centroid_cx)][:, None]
        return found

    @property
    def n_cells(self) -> int:
        """Number of cells of the design."""
        return len(self._content[1])

    def nearest(self, centroid_cx: Float) -> Int:
        """(n_cells,) numbers of the design's cells at some places (n_cells, 2).

        Raises:
            InputError: the design has no cell at one of the places.
        """
        away, nearest = self._tree.query(centroid_cx)
        far = np.flatnonzero(away > NEAR * np.ptp(self._content[0], axis=0).max())
        if len(far):
            raise InputError(
                f"stiffness: {self.path.name} has no cell around {shown_place(centroid_cx[far[0]])}: it is a design on "
                "another mesh; use the mesh that it was made on"
            )
        found: Int = nearest
        return found

    def __getstate__(self) -> dict[str, Any]:
        return {"path": self.path, "names": self.names, "_content": self._content}

    @cached_property
    def _tree(self) -> Any:
        from scipy.spatial import cKDTree

        return cKDTree(self._content[0])

    @cached_property
    def _content(self) -> tuple[Float, Float]:
        try:
            with np.load(self.path, allow_pickle=False) as file:
                found = np.array(file["centroid_cx"], dtype=np.float64), np.array(file["stiffness_c"], dtype=np.float64)
        except OSError as error:
            raise InputError(
                f"stiffness: {self.path} cannot be read: {error.strerror or 'it is no .npz file'}"
            ) from None
        except (KeyError, ValueError, EOFError, TypeError, zipfile.BadZipFile) as error:
            raise InputError(
                f"stiffness: {self.path} is no design ({error}): it needs the arrays centroid_cx and stiffness_c"
            ) from None
        centroid_cx, stiffness_c = found
        if centroid_cx.shape != (len(stiffness_c), 2) or stiffness_c.ndim != 1 or not len(stiffness_c):
            raise InputError(
                f"stiffness: {self.path} has centroid_cx of shape {centroid_cx.shape} and stiffness_c of shape "
                f"{stiffness_c.shape}: they need to be (n_cells, 2) and (n_cells,)"
            )
        bad = np.flatnonzero(~((stiffness_c >= 0.0) & (stiffness_c <= 1.0)))
        if len(bad):
            raise InputError(
                f"stiffness: {self.path} has {stiffness_c[bad[0]]:g} in the cell around "
                f"{shown_place(centroid_cx[bad[0]])}: it must be from 0, the medium alone, to 1, the solid"
            )
        if not np.isfinite(centroid_cx).all():
            raise InputError(f"stiffness: {self.path} has a centroid that is no number")
        return found


def densities_at(path: Path, centroid_cx: Float) -> Float:
    """Densities of a design in a file, by the centroids of cells.

    Args:
        path: the file, as :func:`write_stiffness` writes it.
        centroid_cx: (n_cells, 2) centroids of the design's cells, in any order.

    Returns:
        (n_cells,) densities from 0 to 1.

    Raises:
        InputError: the file is no design, has no densities, or no cell at one of the places.
    """
    design = StiffnessOfFile(path)
    numbered = design.nearest(centroid_cx)
    with np.load(path, allow_pickle=False) as file:
        density_c = np.array(file["density_c"], dtype=np.float64) if "density_c" in file else np.empty(0)
    known = density_c.shape == (design.n_cells,)
    if not known or not ((density_c >= 0.0) & (density_c <= 1.0)).all():
        raise InputError(f"{path} has no array density_c of densities from 0 to 1, one for each of its cells")
    found: Float = density_c[numbered]
    return found


def write_stiffness(path: Path, centroid_cx: Float, stiffness_c: Float, density_c: Float) -> None:
    """Write a design as a file that ``stiffness`` of a design region reads.

    Args:
        path: file; its suffix must be .npz.
        centroid_cx: (n_cells, 2) centroids of the design's cells.
        stiffness_c: (n_cells,) stiffnesses from 0 to 1.
        density_c: (n_cells,) the densities that they come from, for readers of the file.

    Raises:
        OSError: it could not be written.
    """
    archive = io.BytesIO()
    np.savez_compressed(archive, centroid_cx=centroid_cx, stiffness_c=stiffness_c, density_c=density_c)
    with whole_file(path) as temporary:
        temporary.write_bytes(archive.getbuffer())
