"""Equal squares in shapes whose sides are lines of a grid."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from helpers_design import cantilever

from tmc_vem.mesh.geometry import areas, centroids
from tmc_vem.mesh.make.grid import grid_mesh
from tmc_vem.mesh.make.outline import Region
from tmc_vem.mesh.make.shapes import combine, disc, polygon, rectangle
from tmc_vem.support.errors import InputError

SHAPES = {"frame": rectangle(-1.0, 0.5, 2.0, 2.5), "hole": rectangle(0.0, 1.0, 1.0, 2.0),
          "slot": rectangle(1.0, 1.25, 2.0, 1.5)}  # fmt: skip


def frame(**regions: str) -> list[Region]:
    return combine(SHAPES, regions)


def test_cells_are_equal_squares_of_the_regions_that_have_them() -> None:
    mesh = grid_mesh(frame(solid="frame - hole - slot", gap="hole"), 0.25, {"tip": (2.0, 1.25)})
    assert mesh.region_names == ("solid", "gap")
    corners_cvx = mesh.points_vx[np.array(list(mesh.cells()))]
    assert areas(corners_cvx) == pytest.approx(0.0625)
    assert corners_cvx - corners_cvx[:, :1] == pytest.approx(
        np.broadcast_to([[0.0, 0.0], [0.25, 0.0], [0.25, 0.25], [0.0, 0.25]], corners_cvx.shape), abs=1e-14
    )
    assert np.bincount(mesh.region_c).tolist() == [12 * 8 - 16 - 4, 16]
    x, y = centroids(corners_cvx[mesh.region_c == 1]).T
    assert (x.min(), x.max(), y.min(), y.max()) == pytest.approx((0.125, 0.875, 1.125, 1.875))
    assert not ((centroids(corners_cvx)[:, 0] > 1.0) & (abs(centroids(corners_cvx)[:, 1] - 1.375) < 0.1)).any()
    assert mesh.points_vx[mesh.named_vertex("tip")].tolist() == [2.0, 1.25]
    assert len(np.unique(mesh.points_vx, axis=0)) == mesh.n_vertices  # and no vertex is left over
    assert len(np.unique(np.concatenate(list(mesh.cells())))) == mesh.n_vertices


def test_the_grid_is_symmetric_where_the_domain_is() -> None:
    mesh = grid_mesh(combine({"a": rectangle(0.0, 0.0, 0.9, 0.3)}, {"all": "a"}), 0.1)
    mirrored = np.column_stack([0.9 - mesh.points_vx[:, 0], mesh.points_vx[:, 1]])
    order = np.lexsort(np.round(mirrored, 6).T)
    assert np.abs(mirrored[order] - mesh.points_vx[np.lexsort(np.round(mesh.points_vx, 6).T)]).max() < 2e-16


def test_a_grid_far_from_the_origin_is_the_same() -> None:
    there = grid_mesh(combine({"a": rectangle(4e6, 0.0, 4e6 + 0.9, 0.3)}, {"all": "a"}), 0.1)
    assert there.n_cells == 27


@pytest.mark.parametrize(
    ("regions", "size", "points", "message"),
    [
        (frame(solid="frame - hole - slot"), 0.5, {},
         r"'solid' has a side at y = 1.25, which is 0.25 off the line y = 1.5 of the grid of size 0.5 that begins at "
         r"y = 0.5: move the side there, or choose a size that divides 0.75"),
        (frame(solid="frame"), 0.3, {}, r"side at y = 2.5, which is 0.1 off the line y = 2.6 of the grid of size 0.3"),
        (frame(solid="frame"), 0.25, {"tip": (2.0, 0.6)}, r"point 'tip': no node at \(2, 0.6\).*begins at \(-1, 0.5\)"),
        (combine({"a": disc(0.0, 0.0, 1.0)}, {"all": "a"}), 0.1, {}, r"'all' has a round side at .* is for rectangles"),
        (combine({"a": polygon([(0, 0), (1, 0), (0, 1)])}, {"all": "a"}), 0.1, {}, r"neither along x nor along y"),
        (frame(solid="frame"), 1e-4, {}, r"the mesh would have about 6e\+08 cells"),
    ],
    ids=["inner side", "outer side", "point", "disc", "slanted", "too many"],
)  # fmt: skip
def test_what_does_not_fit(
    regions: list[Region], size: float, points: dict[str, tuple[float, float]], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        grid_mesh(regions, size, points)


def test_problem_files_have_grids(tmp_path: Path) -> None:
    mesh = cantilever(tmp_path)[0].make_mesh()
    assert (mesh.n_cells, len(mesh.named_edges["wall"])) == (32, 4)
    with pytest.raises(InputError, match=r"refine and cells = 'grid' do not go together"):
        cantilever(tmp_path, {"mesh.refine": [{"near": [1, 1], "size": 0.1}]})
