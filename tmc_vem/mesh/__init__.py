"""Polygon meshes: the immutable data structure, its validation, generation and distribution."""

from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
from tmc_vem.mesh.polygon import Edges, PolygonMesh

__all__ = ["Edges", "PolygonMesh", "Rectangle", "structured_quadrilaterals"]
