"""A problem that is described by tables, such as those of a problem file."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.energy import Energy
from tmc_vem.mesh.files.regions import REST
from tmc_vem.mesh.make.far import origin_for
from tmc_vem.mesh.make.outline import Arc
from tmc_vem.mesh.make.shapes import combine
from tmc_vem.mesh.parts import with_names
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems.base import RegionEnergy, medium_region, solid_region
from tmc_vem.problems.cell_size import is_field, recorded, size_text
from tmc_vem.problems.columns import check_names
from tmc_vem.problems.conditions import check_conditions
from tmc_vem.problems.description import MediumTable, ProblemTable, RegionTable
from tmc_vem.problems.design_region import design_region
from tmc_vem.problems.graded import ByFormulas, OfParameters
from tmc_vem.problems.load_tables import Load
from tmc_vem.problems.materials import Material, Medium
from tmc_vem.problems.mesh_tables import XY, EdgesTable
from tmc_vem.problems.probes import GAP, Gap, Place, Probe, check_probes
from tmc_vem.problems.regularisers import require_traceable
from tmc_vem.problems.shaped_mesh import distance_to_line, mesh_of_shapes
from tmc_vem.problems.stiffness_file import StiffnessOfFile
from tmc_vem.support.errors import InputError
from tmc_vem.support.units import Units
from tmc_vem.system.constraints import PROPORTIONAL, Amplitude, Condition, is_called
from tmc_vem.system.forces import Force
from tmc_vem.system.histories import RAMP
from tmc_vem.system.stage import Stage

Float = NDArray[np.float64]
Int = NDArray[np.int64]

OUTSIDE = "outside"
# Points and edges belong to a line, circle or box up to this fraction of the mesh's extent.
ON = 1e-6
# Shear moduli are one if they differ by this fraction: E and nu say the same as K and mu up to rounding.
SAME_MODULUS = 1e-9
# What a medium's table hands on as it is.
OF_MEDIUM = ("gamma", "alpha_r", "alpha", "beta", "energy", "log_j", "friction", "elastic_slip", "parameters")
# What stands in the inputs of a run only where it is not as before there was a choice.
MEDIUM_UNLESS_USUAL = ("energy", "log_j", "friction", "elastic_slip")


@dataclass(frozen=True)
class OwnProblem:
    """Implements :class:`tmc_vem.problems.base.Problem`.

    Attributes:
        table: the description.
        directory: what file names in it are relative to.
        changes: what was set to other values than those of the file, by name of the entry; for the record.

    Raises:
        InputError: a value is out of range, or a regulariser or energy cannot be loaded.
    """

    table: ProblemTable
    directory: Path = field(default_factory=Path)
    changes: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _ = self._regions
        check_probes(self.probes(), self.prescribed(), tuple(self.table.regions))
        check_conditions(self.prescribed(), self.load(), self.forces())
        check_names(self)
        if self.table.shapes:
            _ = self._outlines

    def __getstate__(self) -> dict[str, Any]:
        """What is sent to other processes: what has been made of the description is made there again."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__}

    @property
    def name(self) -> str:
        """Name given in the description."""
        return self.table.name

    def make_mesh(self) -> PolygonMesh:
        """The mesh from its file or from the shapes, with the names of the description.

        Raises:
            InputError: it cannot be made, or has nothing where something is named.
        """
        table = self.table
        mesh = self._from_shapes() if table.shapes else self._from_file()
        missing = [name for name in mesh.region_names if name not in table.regions]
        unused = [name for name in table.regions if name not in mesh.region_names]
        if missing or unused:
            whose = f"regions: the mesh has {', '.join(mesh.region_names)}"
            hint = "" if table.shapes or not unused or not missing else self._naming(missing[0], unused[0])
            raise InputError(f"{whose}; described are {', '.join(table.regions)}: the names must agree{hint}")
        if not table.shapes:
            mesh = with_names(mesh, table.points)
        named_edges = dict(mesh.named_edges)
        for name, edges in table.edges.items():
            named_edges[name] = find_edges(mesh, name, edges)
        mesh = replace(mesh, named_edges=named_edges, validate=False)
        for where in self._places:
            if where not in mesh.named_edges and not any(is_called(name, where) for name in mesh.named_points):
                known = ", ".join([*mesh.named_points, *mesh.named_edges]) or "none"
                raise InputError(f"'{where}' is neither a point nor edges (there are: {known})")
        missing = [name for load in table.loads for name in load.regions or () if name not in mesh.region_names]
        if missing:
            known = ", ".join(mesh.region_names)
            raise InputError(f"load: there is no region '{missing[0]}' (there are: {known})")
        for name, probe in self.probes().items():
            for place in probe.places:
                if isinstance(place, str) and place not in mesh.named_points:
                    known = ", ".join(sorted(mesh.named_points)) or "none"
                    raise InputError(
                        f"{GAP if name == GAP and table.gap else f'probes: {name}'}: there is no named point '{place}' "
                        f"(there are: {known}); coordinates [x, y] do as well"
                    )
        return mesh

    def curves(self) -> tuple[Arc, ...]:
        """Curved pieces of the outlines that its mesh follows; none for a mesh file, which has straight sides only."""
        if not self.table.shapes:
            return ()
        x, y = self._origin or (0.0, 0.0)
        arcs = [curve for region in self._outlines for curve in region.curves() if isinstance(curve, Arc)]
        return tuple(replace(arc, center=(arc.center[0] + x, arc.center[1] + y)) for arc in arcs)

    def regions(self) -> Mapping[str, RegionEnergy]:
        """Energies of the regions."""
        return self._regions

    def prescribed(self) -> Sequence[Condition]:
        """Supports, and loads that are displacements."""
        amplitude = self._usual_amplitude
        supports = [condition for table in self.table.support for condition in table.conditions(amplitude)]
        return (*supports, *(load for load in self._loads if isinstance(load, Condition)))

    def forces(self) -> Sequence[Force]:
        """Loads that are forces, and springs."""
        table = self.table
        springs = [each.spring(name) for each, name in zip(table.spring, table.names_of_springs, strict=True)]
        return (*(load for load in self._loads if not isinstance(load, Condition)), *springs)

    def probes(self) -> Mapping[str, Probe]:
        """The gap, if the description has one, and the probes."""
        gap = {GAP: Gap(*self.table.gap)} if self.table.gap else {}
        return {**gap, **{name: table.probe() for name, table in self.table.probes.items()}}

    def units(self) -> Units:
        """Those of the description."""
        return self.table.units

    def stages(self) -> Sequence[Stage]:
        """Parts of the run in which other supports hold."""
        return self.table.stage

    def load(self) -> Load:
        """The first load."""
        return self._loads[0]

    def inputs(self) -> dict[str, Any]:
        """The whole description as plain values; files of meshes and designs by their content too."""
        plain = _plain({**asdict(self.table), "name": None, "units": None, "solve": None})
        if callable(self.table.mesh.size):
            plain["mesh"]["size"] = recorded(self.table.mesh.size, self._about)
        if self.table.mesh.file is not None:
            plain["mesh"]["content"] = hashlib.sha256(self._mesh_file.read_bytes()).hexdigest()[:16]
        for name, region in plain["regions"].items():
            solid = self.table.regions[name].solid
            if solid is not None:
                region["solid"] = solid.as_dict()
            design = self._regions[name].graded
            if isinstance(design, StiffnessOfFile):
                region["stiffness_content"] = design.digest
            table = self.table.regions[name].medium
            if table is not None and table.alpha is not None:
                region["medium"] |= {"alpha_r": self._regions[name].values["alpha_r"], "h": self._width(table)}
            for key in MEDIUM_UNLESS_USUAL:
                if table is not None and getattr(table, key) == getattr(MediumTable, key):
                    del region["medium"][key]
        if self.table.mesh.cracks == "join":  # as before there was a choice
            del plain["mesh"]["cracks"]
        for name in ("fit", "across") if not self.table.mesh.fit else ():
            del plain["mesh"][name]
        media = [region["medium"] for region in plain["regions"].values() if "medium" in region]
        said = {name: size_text(value) if callable(value) else value for name, value in self.changes.items()}
        changes = {"set": _plain(said)} if self.changes else {}
        return {"problem": self.name, **plain, **({"medium": media[0]} if media else {}), **changes}

    def with_size(self, size: float, *, voronoi: str = "voronoi") -> OwnProblem:
        """The problem with cells of another size, those of places with smaller ones in proportion.

        Args:
            size: of the cells; where it varies from place to place, what it is multiplied with.
            voronoi: kind of cells instead of Voronoi cells.

        Raises:
            InputError: fewer cells than needed would fit across narrow places.
        """
        mesh = self.table.mesh
        assert mesh.size is not None
        cells = voronoi if mesh.cells == "voronoi" else mesh.cells
        made = mesh.scaled(size / mesh.nominal)
        made = replace(made, cells=cells) if is_field(mesh.size) else replace(made, cells=cells, size=size)
        table = replace(self.table, mesh=made)
        return replace(self, table=table, changes={k: v for k, v in self.changes.items() if k != "mesh.size"})

    def with_table(self, table: ProblemTable) -> OwnProblem:
        """The problem of another description; where its shapes are the same, they are not combined again."""
        if table.shapes != self.table.shapes or not table.shapes:
            return replace(self, table=table)
        made = object.__new__(type(self))
        vars(made).update({**self.__getstate__(), "table": table, "_outlines": self._outlines})
        made.__post_init__()
        return made

    # -- parts -----------------------------------------------------------------------------------------------------

    @cached_property
    def _loads(self) -> tuple[Load, ...]:
        table = self.table
        names = zip(table.loads, table.names_of_loads, strict=True)
        return tuple(each.load(name, self._usual_amplitude) for each, name in names)

    @property
    def _usual_amplitude(self) -> Amplitude:
        """Of what has no history: in proportion to the time; once there are histories, up to 1."""
        return RAMP if any(load.history is not None for load in self.table.loads) else PROPORTIONAL

    @property
    def _places(self) -> list[str]:
        """Names of points and edges at which something is held or acts."""
        table = self.table
        loads = [load.at for load in table.loads if load.at is not None]
        return [*(support.at for support in table.support), *loads, *(spring.at for spring in table.spring)]

    @cached_property
    def _regions(self) -> Mapping[str, RegionEnergy]:
        moduli = [region.solid.moduli.mu for region in self.table.regions.values() if region.solid is not None]
        found = {}
        for name, region in self.table.regions.items():
            try:
                if region.solid is not None and region.medium is not None:
                    found[name] = self._design(region.solid, region.medium, region.stiffness)
                elif region.solid is not None:
                    found[name] = solid_region(region.solid, region.hold, region.graded)
                elif region.medium is not None:
                    found[name] = self._medium(region.medium, moduli, region.graded)
                else:
                    assert region.density is not None
                    is_medium = name.startswith("medium") if region.is_medium is None else region.is_medium
                    found[name] = self._own_energy(region, is_medium)
            except InputError as error:
                raise InputError(f"regions: {name}: {error}") from None
        return found

    @property
    def _cell_data(self) -> tuple[str, ...]:
        """Names in formulas of regions that only the mesh file can know."""
        regions = self.table.regions.values()
        return tuple(
            sorted({name for region in regions for number in region.graded for name in region.cell_data(number)})
        )

    def _design(self, material: Material, table: MediumTable, stiffness: float | str | None) -> RegionEnergy:
        """A solid and a medium, of whose energies the solid's is weighted."""
        of = self.directory / stiffness if isinstance(stiffness, str) else 1.0 if stiffness is None else stiffness
        return design_region(material, self._made(table), of, table.mu, self._width(table))

    def _made(self, table: MediumTable) -> Medium:
        values = {key: getattr(table, key) for key in OF_MEDIUM}
        return Medium(**values, regulariser=self._found(table.regulariser))

    def _medium(self, table: MediumTable, moduli: Sequence[float], graded: Mapping[str, str]) -> RegionEnergy:
        mu = table.mu
        if mu is None:
            if not moduli or max(moduli) - min(moduli) > SAME_MODULUS * max(moduli):
                raise InputError("medium lacks 'mu': the solids have several shear moduli or none, so say which")
            mu = moduli[0]
        return medium_region(self._made(table), mu, self._width(table), graded)

    def _width(self, table: MediumTable) -> float | None:
        """Initial width of the gap, which alpha needs.

        Raises:
            InputError: it cannot be known.
        """
        if table.alpha is None or table.h is not None:
            return table.h
        gap = self.probes().get(GAP)
        if not isinstance(gap, Gap):
            raise InputError(
                f'alpha = {table.alpha:g} needs the width of the gap: name two points, gap = ["...", "..."], or give '
                "the width itself, h = ..."
            )
        first, second = (self._place(place) for place in gap.places)
        return float(np.hypot(*(first - second)))

    def _place(self, place: Place) -> Float:
        """Coordinates of a place in the reference configuration; a mesh file is read if it alone knows the name."""
        if not isinstance(place, str):
            return np.asarray(place, dtype=float)
        if place in self.table.points:
            return np.asarray(self.table.points[place], dtype=float)
        if self.table.shapes:
            raise InputError(f"gap: there is no named point '{place}' (there are: {', '.join(self.table.points)})")
        mesh = self._from_file()
        found: Float = mesh.points_vx[mesh.named_vertex(place)]
        return found

    def _own_energy(self, region: RegionTable, is_medium: bool) -> RegionEnergy:
        from codegen.errors import CodegenError
        from codegen.userfile import load_density

        try:
            loaded = load_density(self._found(region.density or "")).with_values(region.parameters)
        except CodegenError as error:
            raise InputError(str(error)) from None
        missing = [name for name, value in loaded.parameters.items() if value is None]
        if missing:
            raise InputError(
                f"density '{loaded.name}' needs a value for {missing[0]}: parameters = {{{missing[0]} = ...}}"
            )
        require_traceable(loaded.function, loaded.name, tuple(loaded.parameters))
        known = {name: float(value) for name, value in loaded.parameters.items() if value is not None}
        energy = Energy(loaded.name, loaded.function, tuple(known), loaded.description)
        graded = ByFormulas(OfParameters(known), region.graded) if region.graded else None
        return RegionEnergy(energy, known, is_medium, region.hold, graded=graded)

    def _found(self, wanted: str) -> str:
        """``FILE.py:FUNCTION`` relative to the description's directory."""
        file, colon, function = wanted.rpartition(":")
        inside = self.directory / file
        return f"{inside}:{function}" if colon and file.endswith(".py") and inside.is_file() else wanted

    @property
    def _mesh_file(self) -> Path:
        assert self.table.mesh.file is not None
        path = self.directory / self.table.mesh.file
        if not path.is_file():
            raise InputError(f"mesh: there is no file {path}")
        return path

    def _from_file(self) -> PolygonMesh:
        from tmc_vem.mesh.files.io import read_mesh

        path, table = self._mesh_file, self.table.mesh
        mesh = read_mesh(
            path, names=table.names, region_data=table.region_data, cracks=table.cracks, cell_data=self._cell_data
        )
        return self._by_number(mesh)

    @staticmethod
    def _naming(group: str, name: str) -> str:
        """How a group of the mesh file gets another name."""
        if group == REST:
            return f"; '{REST}' are the cells of no group: give the surface of '{name}' a physical group or set"
        key = group.removeprefix("region_")
        key = key if re.fullmatch(r"[\w-]+", key) else f'"{key}"'
        return f'; [mesh] names = {{ {key} = "{name}" }}, for example, gives others'

    def _by_number(self, mesh: PolygonMesh) -> PolygonMesh:
        """The mesh with groups without a name called by their numbers where the description does so."""
        conditions = set(self._places)
        regions = {f"region_{name}": name for name in self.table.regions if name.isdigit()}
        edges = {f"curve_{name}": name for name in conditions if name.isdigit()}
        points = {f"point_{name}": name for name in conditions if name.isdigit()}
        return replace(
            mesh,
            region_names=tuple(regions.get(name, name) for name in mesh.region_names),
            named_points={points.get(name, name): vertex for name, vertex in mesh.named_points.items()},
            named_edges={edges.get(name, name): pairs for name, pairs in mesh.named_edges.items()},
            validate=False,
        )

    @property
    def _about(self) -> list[XY]:
        """Points about which all shapes lie."""
        return [place for table in self.table.shapes.values() for place in table.places()]

    @cached_property
    def _origin(self) -> tuple[float, float] | None:
        """Where the shapes' coordinates are counted from while a mesh is made, if they lie far from the origin."""
        return origin_for(np.array(self._about, dtype=float).reshape(-1, 2))

    @cached_property
    def _outlines(self) -> Any:
        shapes = {}
        for name, table in self.table.shapes.items():
            try:
                shapes[name] = (table if self._origin is None else table.from_origin(self._origin)).shape()
            except InputError as error:
                raise InputError(f"shapes: {name}: {error}") from None
        return combine(shapes, {name: region.shape or "" for name, region in self.table.regions.items()})

    def _from_shapes(self) -> PolygonMesh:
        return mesh_of_shapes(self.table.mesh, self._outlines, self.table.points, self._origin)


def find_edges(mesh: PolygonMesh, name: str, table: EdgesTable) -> Int:
    """End vertices (n, 2) of the edges along outlines and interfaces that fulfil a description.

    Raises:
        InputError: there are none, or a region is unknown.
    """
    edges = mesh.edges
    region_c = np.append(mesh.region_c, -1)  # the last for where there is no cell
    left, right = (region_c[cells] for cells in mesh.cells_of_edges)
    chosen = left != right
    ends = mesh.points_vx[edges.vertices_ev]
    tolerance = ON * float(np.ptp(mesh.points_vx, axis=0).max())
    if table.between is not None:
        number = {OUTSIDE: -1, **{region: n for n, region in enumerate(mesh.region_names)}}
        for region in table.between:
            if region not in number:
                raise InputError(f"edges: {name}: there is no region '{region}' (there are: {', '.join(number)})")
        a, b = (number[region] for region in table.between)
        chosen &= ((left == a) & (right == b)) | ((left == b) & (right == a))
    if table.line is not None:
        distance = distance_to_line(ends.reshape(-1, 2), np.asarray(table.line[0]), np.asarray(table.line[1]))
        chosen &= (distance.reshape(-1, 2) <= tolerance).all(axis=1)
    if table.circle is not None:
        x, y, radius = table.circle
        chosen &= (np.abs(np.hypot(ends[..., 0] - x, ends[..., 1] - y) - radius) <= tolerance).all(axis=1)
    if table.box is not None:
        box = np.sort(np.asarray(table.box).reshape(2, 2), axis=0)
        chosen &= ((ends >= box[0] - tolerance) & (ends <= box[1] + tolerance)).all(axis=(1, 2))
    if not chosen.any():
        raise InputError(f"edges: {name}: no edge of an outline or interface is there")
    found: Int = edges.vertices_ev[chosen]
    return found


def _plain(value: Any) -> Any:
    """Without what is not given; tuples as lists, as they come back from JSON."""
    if isinstance(value, Mapping):
        given = {key: entry for key, entry in value.items() if entry is not None and not _is_empty(entry)}
        return {key: _plain(entry) for key, entry in given.items()}
    if isinstance(value, tuple | list):
        return [_plain(entry) for entry in value]
    return value


def _is_empty(entry: Any) -> bool:
    return isinstance(entry, Mapping | tuple) and not entry
