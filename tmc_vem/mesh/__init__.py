"""Polygon meshes: the immutable data structure and its validation; ``files``, ``make`` and ``spread`` stand on it."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
    from tmc_vem.mesh.polygon import Edges, PolygonMesh

_LAZY = {
    "Edges": "tmc_vem.mesh.polygon",
    "PolygonMesh": "tmc_vem.mesh.polygon",
    "Rectangle": "tmc_vem.mesh.make.structured",
    "structured_quadrilaterals": "tmc_vem.mesh.make.structured",
}

__all__ = ["Edges", "PolygonMesh", "Rectangle", "structured_quadrilaterals"]


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        return getattr(import_module(_LAZY[name]), name)
    raise AttributeError(f"module 'tmc_vem.mesh' has no attribute '{name}'")
