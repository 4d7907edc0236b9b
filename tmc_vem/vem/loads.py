"""What forces act on in a virtual element mesh: the sides along named edges, and the area of regions."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.spread.distribute import DistributedMesh
from tmc_vem.system.sides import Sides
from tmc_vem.vem.blocks import Block
from tmc_vem.vem.dofmap import DofMap
from tmc_vem.vem.spaces.quadrature import gauss_lobatto
from tmc_vem.vem.spaces.tabulated import points_and_values

Float = NDArray[np.float64]


def body_load(
    distributed: DistributedMesh, dofmap: DofMap, blocks: Sequence[Block], regions: Collection[str],
    force: Callable[[Float], Float],
) -> Float:  # fmt: skip
    """Nodal forces (n_nodes, 2) of this rank's cells, whose work is ``int f . Pi0_k u``: it keeps the order k + 1.

    Args:
        distributed, dofmap, blocks: the cells and their nodes.
        regions: names of those on which the force acts.
        force: maps points (n, 2) to the force per reference area (n, 2).
    """
    load = np.zeros((dofmap.n_nodes, 2))
    for block in blocks:
        for chosen in block.chunks() if block.region in regions else ():
            points_cqx, values_cqa = points_and_values(
                block.polygons(distributed.mesh, chosen), dofmap.order, block.scaled_points(chosen)
            )
            f_cqi = force(points_cqx.reshape(-1, 2)).reshape(points_cqx.shape)
            work_cai = np.swapaxes(values_cqa, 1, 2) @ (block.weights(chosen)[..., None] * f_cqi)
            np.add.at(load, block.batch.nodes_ca[chosen], work_cai)
    return load


def sides_along(distributed: DistributedMesh, dofmap: DofMap, where: str) -> Sides:
    """Sides of this rank's cells along named edges; none if they have no such edges."""
    mesh, edges = distributed.mesh, distributed.edges
    pairs = np.sort(np.asarray(mesh.named_edges.get(where, np.empty((0, 2), dtype=np.int64))).reshape(-1, 2), axis=1)
    known = np.sort(edges.vertices_ev, axis=1) @ np.array([mesh.n_vertices, 1])
    named_e = np.isin(known, pairs @ np.array([mesh.n_vertices, 1]))
    sides = np.flatnonzero(named_e[edges.cell_edges])
    edge, forward = edges.cell_edges[sides], edges.forward[sides][:, None]
    ends = np.where(forward, edges.vertices_ev[edge], edges.vertices_ev[edge][:, ::-1])
    inner = np.where(forward, dofmap.edge_nodes[edge], dofmap.edge_nodes[edge][:, ::-1])
    nodes = np.column_stack([dofmap.vertex_nodes[ends[:, 0]], inner, dofmap.vertex_nodes[ends[:, 1]]])
    start, end = (mesh.points_vx[ends[:, n]][:, None] for n in (0, 1))
    t_a = gauss_lobatto(dofmap.order + 1)[0][:, None]
    cells = np.searchsorted(mesh.cell_offsets, sides, side="right") - 1
    return Sides(
        nodes_sa=dofmap.global_node_n[nodes],
        points_sax=(1.0 - t_a) * start + t_a * end,
        ends_se=distributed.vertex_ids[ends],
        cell_s=distributed.cell_ids[cells],
        region_s=np.array(mesh.region_names)[mesh.region_c[cells]],
    )
