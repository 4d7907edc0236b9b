"""Bodies that forces act on, a force of each kind, and a problem made of its parts."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from helpers_system import make_system, region
from numpy.typing import NDArray

from tmc_vem.mesh import PolygonMesh
from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
from tmc_vem.mesh.parts import with_names
from tmc_vem.problems import Material
from tmc_vem.problems.base import RegionEnergy, solid_region
from tmc_vem.problems.probes import Probe
from tmc_vem.support.units import Units
from tmc_vem.system.constraints import Prescribed
from tmc_vem.system.control import Control
from tmc_vem.system.discretisation import Discretisation
from tmc_vem.system.forces import BodyForce, CavityPressure, FollowerPressure, Force, PointForce, Spring, Traction
from tmc_vem.vem.spaces.element_settings import ElementSettings

Float = NDArray[np.float64]

SOLID = solid_region(Material(K=3.0, mu=1.5))
METHODS = ("vem", "fem")
ROLLERS = (Prescribed("left", 0), Prescribed("bottom", 1))


def renamed(mesh: PolygonMesh, **edges: Any) -> PolygonMesh:
    """The mesh with more named edges."""
    return PolygonMesh(
        mesh.points_vx, mesh.cell_offsets, mesh.cell_vertices, mesh.region_c, mesh.region_names, mesh.named_points,
        {**mesh.named_edges, **edges},
    )  # fmt: skip


def plate(nx: int = 3, ny: int = 2, width: float = 1.0, height: float = 1.0, bent: float = 0.0) -> PolygonMesh:
    """Rectangle of quadrilaterals with its sides named; ``corner`` is right and top together."""
    x, y = np.linspace(0.0, width, nx + 1), np.linspace(0.0, height, ny + 1)
    flat = structured_quadrilaterals(x, y, [Rectangle("block", 0.0, width, 0.0, height)])
    lines = {
        "left": ((0.0, 0.0), (0.0, height)),
        "right": ((width, 0.0), (width, height)),
        "bottom": ((0.0, 0.0), (width, 0.0)),
        "top": ((0.0, height), (width, height)),
    }
    points = {"tip": (width, height), "base": (0.0, 0.0), "pair#1": (width, 0.0), "pair#2": (width, height)}
    named = with_names(flat, points, lines)
    named = renamed(named, corner=np.concatenate([named.named_edges["right"], named.named_edges["top"]]))
    moved = np.array(named.points_vx)
    inner = ~np.isin(np.arange(len(moved)), np.concatenate([*named.named_edges.values()]))
    moved[inner] += bent * np.sin(9.0 * moved[inner][:, ::-1])
    return PolygonMesh(
        moved, named.cell_offsets, named.cell_vertices, named.region_c, named.region_names, named.named_points,
        named.named_edges,
    )  # fmt: skip


def cavity_plate(bent: float = 0.02) -> PolygonMesh:
    """Plate of 4 x 4 cells without one of them, whose sides are the edges ``hole``."""
    mesh = plate(4, 4, bent=bent)
    gone = 5
    sides = np.array([*mesh.cell(gone)])
    cells = [cell.tolist() for c, cell in enumerate(mesh.cells()) if c != gone]
    return PolygonMesh.from_cells(
        mesh.points_vx, cells, region_names=mesh.region_names, named_points=mesh.named_points,
        named_edges={**mesh.named_edges, "hole": np.column_stack([sides, np.roll(sides, -1)])},
    )  # fmt: skip


KINDS: dict[str, Force] = {
    "point force": PointForce("f", "tip", (0.3, -0.2)),
    "traction": Traction("f", "right", (0.3, 0.4)),
    "body force": BodyForce("f", ("block",), (0.5, -0.3)),
    "cavity": CavityPressure("f", "hole", 0.7),
    "follower": FollowerPressure("f", "corner", 0.6),
    "point spring": Spring("f", "pair", (0.4, 0.9)),
    "springs": Spring("f", "top", (0.8, 0.5)),
}


def ring(n: int, inner: float = 1.0, outer: float = 2.0, layers: int = 2, part: float = 1.0) -> PolygonMesh:
    """Quadrilaterals around the origin, or around a part of the circle that begins on the axis of x."""
    whole = part == 1.0
    m = n if whole else n + 1
    angles, radii = 2.0 * np.pi * part * np.arange(m) / n, np.linspace(inner, outer, layers + 1)
    points = np.array([(r * np.cos(a), r * np.sin(a)) for r in radii for a in angles])
    points[np.abs(points) < 1e-14] = 0.0
    cells = [
        [m * i + j, m * (i + 1) + j, m * (i + 1) + (j + 1) % m, m * i + (j + 1) % m]
        for i in range(layers)
        for j in range(n)
    ]
    around = np.array([(j, (j + 1) % m) for j in range(n)])
    across = m * np.column_stack([np.arange(layers), np.arange(1, layers + 1)])
    edges = {"inner": around, "outer": around + m * layers}
    if not whole:
        edges |= {"start": across, "end": across + n}
    quarter = n // 4
    named = {"east": 0, "north": quarter, "west": 2 * quarter} if whole else {}
    return PolygonMesh.from_cells(points, cells, named_points=named, named_edges=edges)


def discretised(
    method: str, mesh: PolygonMesh, prescribed: Sequence[Prescribed] = ROLLERS, order: int = 2
) -> Discretisation:
    """System of a solid on a mesh."""
    if method == "vem":
        return make_system(mesh, region("solid", **SOLID.values), prescribed, ElementSettings(order=order))
    pytest.importorskip("dolfinx")
    from mpi4py import MPI

    from tmc_vem.fem.system import FemSystem
    from tmc_vem.system.fem_settings import FemSettings

    regions = dict.fromkeys(mesh.region_names, SOLID)
    return FemSystem(MPI.COMM_SELF, lambda: mesh, regions, prescribed, FemSettings(order=order))


def interpolated(system: Any, field: Callable[[Float], Float]) -> Any:
    """Vector of the degrees of freedom of a displacement field (n, 2) -> (n, 2), in either method."""
    if hasattr(system, "interpolate"):
        return system.interpolate(field)
    from helpers_system import interpolate

    return interpolate(system, field)


@dataclass(frozen=True)
class Parts:
    """A problem that is made of its parts; the first condition is the load."""

    mesh: Callable[[], PolygonMesh]
    conditions: Sequence[Prescribed]
    acting: Sequence[Force] = ()
    measured: Mapping[str, Probe] = field(default_factory=dict)
    energy: RegionEnergy = SOLID

    @property
    def name(self) -> str:
        return "parts"

    def make_mesh(self) -> PolygonMesh:
        return self.mesh()

    def regions(self) -> Mapping[str, RegionEnergy]:
        return dict.fromkeys(self.mesh().region_names, self.energy)

    def prescribed(self) -> Sequence[Prescribed]:
        return self.conditions

    def forces(self) -> Sequence[Force]:
        return self.acting

    def probes(self) -> Mapping[str, Probe]:
        return self.measured

    def units(self) -> Units:
        return Units()

    def load(self) -> Prescribed:
        return self.conditions[0]

    def inputs(self) -> dict[str, Any]:
        return {"problem": self.name}


@dataclass(frozen=True)
class Squared:
    """Grows with the square of the load factor."""

    def at(self, position: Control) -> float:
        return position.load**2

    def per_load(self, position: Control) -> float:
        return 2.0 * position.load


def random(system: Any, size: float, seed: int) -> Any:
    vector = system.create_vector()
    array = vector.getArray()
    array[:] = np.random.default_rng(seed).uniform(-size, size, len(array))
    return vector


def smooth(x: Float) -> Float:
    return 0.1 * np.column_stack([x[:, 0] * (1.0 + x[:, 1]) - x[:, 1] ** 2, 0.5 * x[:, 1] - x[:, 0] * x[:, 1]])
