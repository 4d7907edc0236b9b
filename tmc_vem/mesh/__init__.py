"""Polygon meshes: the immutable data structure, its validation, generation and distribution."""

from tmc_vem.mesh.polygon import Edges, PolygonMesh
from tmc_vem.mesh.structured import Rectangle, structured_quadrilaterals

__all__ = ["Edges", "PolygonMesh", "Rectangle", "structured_quadrilaterals"]
