"""Bodies and their faces from the polygon meshes of tmc_vem, node by node."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conventional.body import Body, with_middles
from tmc_vem.mesh import PolygonMesh

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Where = Callable[[Float], bool]


@dataclass(frozen=True)
class Solids:
    """The solid part of a mesh.

    Attributes:
        body: its elements.
        vertex: number of the node of each vertex of the mesh that is a solid's.
        boundary_sk: (n, 3) nodes of the sides of the boundary, the body on the left.
    """

    body: Body
    vertex: Mapping[int, int]
    boundary_sk: Int

    def face(self, where: Where) -> Int:
        """(n, 3) sides of the boundary whose middle ``where`` accepts, one after the other along a chain.

        Raises:
            ValueError: they are none, or no single open chain.
        """
        chosen = [tuple(side) for side in self.boundary_sk.tolist() if where(self.body.X_ni[side[1]])]
        after = {side[0]: side for side in chosen}
        starts = [side for side in chosen if side[0] not in {other[2] for other in chosen}]
        if len(starts) != 1 or len(after) != len(chosen):
            raise ValueError(f"{len(chosen)} sides with {len(starts)} ends: a face is one open chain")
        chain = [starts[0]]
        while chain[-1][2] in after:
            chain.append(after[chain[-1][2]])
        if len(chain) != len(chosen):
            raise ValueError(f"{len(chosen)} sides are several chains: a face is one open chain")
        return np.array(chain, dtype=np.int64)


def solids(mesh: PolygonMesh, moduli: Mapping[str, tuple[float, float]]) -> Solids:
    """Quadratic elements on the cells of some regions, whose K and mu are given; all else is left out."""
    wanted = {mesh.region_names.index(name): pair for name, pair in moduli.items()}
    chosen = [c for c in range(mesh.n_cells) if int(mesh.region_c[c]) in wanted]
    polygons = [mesh.cell(c).tolist() for c in chosen]
    used = sorted({v for polygon in polygons for v in polygon})
    number = {v: i for i, v in enumerate(used)}
    polygons = [[number[v] for v in polygon] for polygon in polygons]
    X_ni, cells, middles = with_middles(mesh.points_vx[used], polygons)
    K_c, mu_c = np.array([wanted[int(mesh.region_c[c])] for c in chosen]).T
    body = Body(X_ni, cells, K_c, mu_c)
    return Solids(body, number, _boundary(polygons, middles))


def _boundary(polygons: Sequence[Sequence[int]], middles: Mapping[tuple[int, int], int]) -> Int:
    directed = {(a, b) for polygon in polygons for a, b in zip(polygon, [*polygon[1:], polygon[0]], strict=True)}
    outer = [(a, b) for a, b in sorted(directed) if (b, a) not in directed]
    return np.array([(a, middles[min(a, b), max(a, b)], b) for a, b in outer], dtype=np.int64)
