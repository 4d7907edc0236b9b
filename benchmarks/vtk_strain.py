"""Strains that VTK's filters make of the fields of a run: a sentence of docs/howto/paraview.md."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "demos"))


def strains() -> list[float]:
    """Mean of du_y/dy by the displacements of the outline, in triangles, and in polygons."""
    from demo_vtk_filters import mean_strains

    with tempfile.TemporaryDirectory() as directory:
        return list(mean_strains(Path(directory)).means)
