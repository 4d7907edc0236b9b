"""The tables of a problem file, as plain records; what can stand in a file is what stands here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from tmc_vem.problems.base import check_hold
from tmc_vem.problems.design_table import DesignTable
from tmc_vem.problems.graded import PLACE
from tmc_vem.problems.load_tables import LoadTable, SpringTable
from tmc_vem.problems.materials import Material, Medium, chosen_weight
from tmc_vem.problems.mesh_tables import XY, EdgesTable, MeshTable, ShapeTable
from tmc_vem.problems.probe_table import ProbeTable
from tmc_vem.problems.probes import GAP, Place, check_name
from tmc_vem.support.errors import InputError
from tmc_vem.support.formulas import Formula
from tmc_vem.support.settings import about, described, same_as
from tmc_vem.support.units import Units
from tmc_vem.support.validation import (
    require_choice,
    require_finite,
    require_known,
    require_positive,
    shown,
)
from tmc_vem.system.constraints import (
    ACROSS,
    COMPONENTS,
    PROPORTIONAL,
    Amplitude,
    Condition,
    Prescribed,
    PrescribedAcross,
)
from tmc_vem.system.stage import Stage, check_stages


@described
@dataclass(frozen=True)
class MediumTable:
    """Third medium (4): the settings of :class:`tmc_vem.problems.materials.Medium`, and what they are scaled by.

    A regulariser in a file is named relative to the problem file.
    """

    gamma: float = field(default=1e-5, metadata=same_as(Medium, "gamma"))
    alpha_r: float | None = field(default=None, metadata=same_as(Medium, "alpha_r"))
    beta: float = field(default=0.0, metadata=same_as(Medium, "beta"))
    regulariser: str = field(default="angle", metadata=same_as(Medium, "regulariser"))
    parameters: Mapping[str, float] = field(default_factory=dict, metadata=same_as(Medium, "parameters"))
    mu: float | None = field(
        default=None,
        metadata=about(
            "Shear modulus that gamma multiplies.", none="that of all solids at small strains, if it is one"
        ),
    )
    alpha: float | None = field(default=None, metadata=same_as(Medium, "alpha"))
    h: float | None = field(
        default=None,
        metadata=about(
            "Width of the gap in alpha_r = alpha mu h^2.",
            none="the initial distance of the two points of the problem's ``gap``",
        ),
    )
    energy: str = field(default=Medium.energy, metadata=same_as(Medium, "energy"))
    log_j: float = field(default=Medium.log_j, metadata=same_as(Medium, "log_j"))
    friction: float = field(default=Medium.friction, metadata=same_as(Medium, "friction"))
    elastic_slip: float = field(default=Medium.elastic_slip, metadata=same_as(Medium, "elastic_slip"))

    def __post_init__(self) -> None:
        object.__setattr__(self, "alpha_r", chosen_weight(self.alpha_r, self.alpha))
        if self.h is not None:
            require_positive("h", self.h, "the initial width of the gap, a length")
            if self.alpha is None:
                raise InputError(f"h = {self.h:g} belongs to alpha, alpha_r = alpha mu h^2: give alpha, or leave h out")


@dataclass(frozen=True)
class RegionTable:
    """Region: where it is, unless the mesh file says so, and what it is made of.

    Attributes:
        shape: combination of shapes, such as ``"frame - (seal + lid)"``.
        solid: hyperelastic solid, ``{K = 20, mu = 10}`` for (2).
        medium: third medium; with ``solid`` beside it, both make a design region, see ``stiffness``.
        density: energy of your own, ``FILE.py:FUNCTION``, the file relative to the problem file.
        parameters: of that energy.
        hold: ``"medium"`` for a solid without supports of its own that the medium is meant to hold.
        is_medium: whether a region with an energy of its own is third medium; by default if its name starts so.
        graded: formulas of numbers that vary from cell to cell: of the centroid x, y, of cell data of the mesh file by
            name, and of the number itself, ``{E = "E * (1 + x / 2)"}``.
        stiffness: of a design region, the fraction of the solid in all cells: 0 is the medium alone, 1 the solid; by
            default 1. ``tmc-vem optimise`` chooses it cell by cell and writes a file, ``"stiffness.npz"``, whose name
            may stand here too, relative to the problem file.
    """

    shape: str | None = None
    solid: Material | None = None
    medium: MediumTable | None = None
    density: str | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)
    hold: str | None = None
    is_medium: bool | None = None
    graded: Mapping[str, str] = field(default_factory=dict)
    stiffness: float | str | None = None

    @property
    def is_design(self) -> bool:
        """Whether it is a design region: a solid in a medium."""
        return self.solid is not None and self.medium is not None

    def __post_init__(self) -> None:
        check_hold(self.hold, self.medium is not None)
        given = [name for name in ("solid", "medium", "density") if getattr(self, name) is not None]
        if len(given) != 1 and given != ["solid", "medium"]:
            raise InputError(
                f"give one of solid, medium and density, or solid and medium for a design region, not "
                f"{' and '.join(given) or 'none'}"
            )
        if self.stiffness is not None and not self.is_design:
            raise InputError(
                f"stiffness = {shown(self.stiffness)} is for design regions, which have a solid and a medium"
            )
        if isinstance(self.stiffness, str) and not self.stiffness.endswith(".npz"):
            raise InputError(
                f"stiffness = {shown(self.stiffness)}: give a number from 0 to 1, or a file of 'tmc-vem optimise' that "
                "ends in .npz"
            )
        if self.is_design and self.graded:
            raise InputError("graded is for a solid or a medium alone: in a design region the design varies")
        if self.is_medium is not None and self.density is None:
            raise InputError("is_medium is for a density of your own; 'medium = {...}' is third medium as it is")
        for name in self.graded:
            _ = self.cell_data(name)

    def cell_data(self, name: str) -> frozenset[str]:
        """Names in the formula of a number that are not the place and the number itself: cell data of the mesh file.

        Raises:
            InputError: it is no formula.
        """
        try:
            return Formula(self.graded[name]).names - {*PLACE, name}
        except InputError as error:
            raise InputError(f"graded: {name}: {error}") from None


@dataclass(frozen=True)
class ConditionTable:
    """Displacement prescribed at a named point or along named edges, reached at full load.

    Attributes:
        at: name of the point or edges.
        ux, uy: components; one that is left out is free.
        normal, tangential: displacement across a straight edge of any direction, or along it; 0 of the first is a
            roller on an incline.
        stage: names of the stages of the run in which it holds; all by default.
    """

    at: str
    ux: float | None = None
    uy: float | None = None
    normal: float | None = None
    tangential: float | None = None
    stage: str | tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        given = [name for name in (*COMPONENTS, *ACROSS) if getattr(self, name) is not None]
        if not given:
            raise InputError("give ux, uy, normal or tangential; ux = 0 holds, what is left out is free")
        for name in given:
            require_finite(name, getattr(self, name), "a displacement")
        for name in COMPONENTS:
            if name in given and any(other in given for other in ACROSS):
                raise InputError(
                    f"{name} and {given[-1]} do not go together: give what is held along x and y, or across and along "
                    "the edge"
                )

        for name in given if self.stage is not None else ():
            if name in ACROSS or getattr(self, name):
                raise InputError(
                    f"{name} = {getattr(self, name):g} does not go with stage: a support of some stages holds the "
                    "displacement reached when it begins, ux = 0 or uy = 0"
                )
        if self.stage == ():
            raise InputError("stage: there is none; leave it out for a support that holds always")

    @property
    def stages(self) -> tuple[str, ...]:
        """Names of the stages in which it holds; none for all."""
        return (self.stage,) if isinstance(self.stage, str) else self.stage or ()

    def conditions(self, amplitude: Amplitude = PROPORTIONAL) -> list[Condition]:
        """What it prescribes.

        Args:
            amplitude: how displacements other than 0 grow.
        """
        values = {name: getattr(self, name) for name in (*COMPONENTS, *ACROSS)}
        return [
            Prescribed(self.at, COMPONENTS[name], value, amplitude, stages=self.stages)
            if name in COMPONENTS
            else PrescribedAcross(self.at, name, value, amplitude)
            for name, value in values.items()
            if value is not None
        ]


@dataclass(frozen=True, kw_only=True)
class ProblemTable:
    """A problem file as a whole.

    Attributes:
        name: of the problem, for titles and tables.
        regions: by name.
        support: where displacements are prescribed.
        load: what acts: one load, whose displacement and reaction are reported, or several, each by its name.
        mesh: how the mesh is made.
        shapes: by name.
        points: names for nodes on outlines, by their coordinates.
        edges: names for edges.
        gap: two points whose distance is reported; short for a probe of that name.
        probes: what else is measured at every load step, by name.
        units: of length and force; any consistent set by default.
        spring: what holds points or edges elastically.
        stage: parts of the run in which other supports hold.
        solve: method and steps, as in :class:`tmc_vem.simulation.options.RunOptions`.
        design: what ``tmc-vem optimise`` makes of design regions.
    """

    name: str
    regions: Mapping[str, RegionTable]
    support: tuple[ConditionTable, ...] = ()
    load: LoadTable | tuple[LoadTable, ...] | ConditionTable
    mesh: MeshTable
    shapes: Mapping[str, ShapeTable] = field(default_factory=dict)
    points: Mapping[str, XY] = field(default_factory=dict)
    edges: Mapping[str, EdgesTable] = field(default_factory=dict)
    gap: tuple[Place, Place] | None = None
    probes: Mapping[str, ProbeTable] = field(default_factory=dict)
    units: Units = field(default_factory=Units)
    spring: tuple[SpringTable, ...] = ()
    stage: tuple[Stage, ...] = ()
    solve: Mapping[str, Any] = field(default_factory=dict)
    design: DesignTable | None = None

    def __post_init__(self) -> None:
        self._check_loads()
        if self.design is not None and not any(region.is_design for region in self.regions.values()):
            raise InputError("design: no region has both a solid and a medium, so that nothing is designed")
        check_stages(self.stage)
        for n, support in enumerate(self.support, start=1):
            require_stages(support.stages, self.stage, n)
        if self.gap is not None and GAP in self.probes:
            raise InputError(f"probes: {GAP}: there is a gap at the top of the file already; leave out one of them")
        for name in self.probes:
            check_name(name)
        twice = [name for name in self.points if name in self.edges]
        if twice:
            raise InputError(f"points: '{twice[0]}' is the name of edges too: give one of them another name")
        if not self.regions:
            raise InputError("regions: there is none")
        if (self.mesh.file is None) == (not self.shapes):
            raise InputError("mesh: give either a file, or shapes to make it from")
        self.mesh.check_file()
        if self.shapes and self.mesh.size is None:
            raise InputError("mesh: give the size of the cells, a length")
        for name, region in self.regions.items():
            if (region.shape is not None) != bool(self.shapes):
                text = "lacks 'shape'" if self.shapes else "has a shape, but the mesh comes from a file"
                raise InputError(f"regions: {name}: {text}")
            for number in region.graded if self.shapes else ():
                require_known(
                    region.cell_data(number), (*PLACE, number), f"regions: {name}: graded: {number}: a formula"
                )

    @property
    def loads(self) -> tuple[LoadTable, ...]:
        """All loads."""
        if isinstance(self.load, ConditionTable):
            return (LoadTable(self.load.at, self.load.ux, self.load.uy, self.load.normal, self.load.tangential),)
        return (self.load,) if isinstance(self.load, LoadTable) else self.load

    @property
    def names_of_loads(self) -> tuple[str, ...]:
        """Names that loads are reported by; the only one, if it is a displacement component, needs none."""
        if len(self.loads) == 1 and not self.spring and self.loads[0].kind in COMPONENTS:
            return ("",)
        return tuple(table.name or f"load_{n}" for n, table in enumerate(self.loads, start=1))

    @property
    def names_of_springs(self) -> tuple[str, ...]:
        """Names that springs are reported by."""
        return tuple(table.name or f"spring_{n}" for n, table in enumerate(self.spring, start=1))

    def _check_loads(self) -> None:
        if isinstance(self.load, ConditionTable) and (self.load.ux is None) == (self.load.uy is None):
            raise InputError("load: give one of ux and uy; further components belong to [[support]]")
        if not self.loads:
            raise InputError("load: there is none")
        if isinstance(self.load, tuple):
            for n, table in enumerate(self.load, start=1):
                try:
                    table.require_something()
                except InputError as error:
                    raise InputError(f"load, entry {n}: {error}") from None
        names = [("load", name) for name in self.names_of_loads] + [("spring", name) for name in self.names_of_springs]
        known: dict[str, str] = {}
        for n, (kind, name) in enumerate(names):
            number = n + 1 if kind == "load" else n + 1 - len(self.loads)
            if name in known:
                raise InputError(
                    f"{kind}, entry {number}: name = {shown(name)} is that of {known[name]} already: give each a name "
                    "of its own"
                )
            known[name] = f"{kind}, entry {number},"


def require_stages(wanted: Sequence[str], stages: Sequence[Stage], number: int) -> None:
    """Check that the stages of a support are there.

    Args:
        wanted: their names.
        stages: those of the run.
        number: of the support, from 1.

    Raises:
        InputError: one is not.
    """
    for name in wanted:
        try:
            require_choice("stage", name, [stage.name for stage in stages] or ["none"])
        except InputError as error:
            raise InputError(f"support, entry {number}: {error}") from None
