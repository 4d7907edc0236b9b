"""Polygon meshes: the immutable data structure and its validation; ``files``, ``make`` and ``spread`` stand on it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tmc_vem.support.lazy import lazily

if TYPE_CHECKING:
    from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
    from tmc_vem.mesh.polygon import Edges, PolygonMesh

_MODULES = {
    "Edges": "polygon",
    "PolygonMesh": "polygon",
    "Rectangle": "make.structured",
    "structured_quadrilaterals": "make.structured",
}

__all__ = ["Edges", "PolygonMesh", "Rectangle", "structured_quadrilaterals"]

__getattr__ = lazily(__name__, _MODULES)
