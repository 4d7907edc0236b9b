"""Virtual elements at their quadrature points: projected gradients of a state and the parameters that belong to it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.geometry import centroids
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.system.point_states import PointStates
from tmc_vem.vem.blocks import Block

Float = NDArray[np.float64]


def point_states(blocks: Sequence[Block], mesh: PolygonMesh, u_ni: Float) -> Iterator[PointStates]:
    """All cells of blocks at displacements (n_nodes, 2) of their nodes, not too many at a time."""
    for block in blocks:
        for chosen in block.chunks():
            scale_c = 1.0 / block.batch.inverse_h_s[block.batch.shape_c[chosen]]
            points_cqx, weights_cq = block.rule(chosen)
            centroid_cx = centroids(block.polygons(mesh, chosen))
            yield PointStates(
                region=block.region,
                cells=block.cells[chosen],
                w_cq=weights_cq,
                X_cqx=centroid_cx[:, None] + scale_c[:, None, None] * points_cqx,
                F_cqij=np.eye(2) + np.swapaxes(block.displacement_gradients(u_ni, chosen), 2, 3),
                G_cqijk=_second_gradients(block, u_ni, chosen) if block.kernel.uses_second_gradient else None,
                parameters=_parameters(block, chosen),
            )


def _second_gradients(block: Block, u_ni: Float, chosen: slice) -> Float:
    """(n_cells, n_points, 2, 2, 2) second gradients; rows 2 to 5 of the basis are d1 d1, d2 d1, d1 d2 and d2 d2."""
    u_cai = u_ni[block.batch.nodes_ca[chosen]]
    rows_cqra = block.second_rows(chosen)
    n_cells, n_points = rows_cqra.shape[:2]
    rows_cqri = (rows_cqra.reshape(n_cells, n_points * 4, -1) @ u_cai).reshape(n_cells, n_points, 2, 2, 2)
    G: Float = rows_cqri.transpose(0, 1, 4, 3, 2)  # k, j, i -> i, j, k
    return G


def _parameters(block: Block, chosen: slice) -> dict[str, float | Float]:
    names = block.kernel.parameters
    values: dict[str, float | Float] = dict(zip(names, block.parameters.tolist(), strict=True))
    factor_ck = block.batch.factor_ck
    for k, name in enumerate(names[len(names) - block.kernel.n_varying :] if factor_ck is not None else ()):
        assert factor_ck is not None
        values[name] = values[name] * factor_ck[chosen, k : k + 1]
    return values
