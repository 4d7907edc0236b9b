"""A probe as a table of a problem file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from tmc_vem.problems.contact_probe import Contact
from tmc_vem.problems.field_probes import (
    INTEGRAL,
    LARGEST,
    MEAN,
    SMALLEST,
    CutForce,
    EnergyOf,
    Line,
    Over,
    PNorm,
    ValueAt,
)
from tmc_vem.problems.probes import Displacement, Gap, MeanJ, Place, Position, Probe, Reaction
from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import require_choice


@dataclass(frozen=True)
class ProbeTable:
    """Something to measure at every load step: one of the first thirteen, and where.

    Attributes:
        displacement: ``ux`` or ``uy`` of a point.
        position: ``x`` or ``y`` of a point in the deformed state.
        gap: distance of two points, each a name or coordinates.
        reaction: to ``ux`` or ``uy``, where that is prescribed.
        value: field, such as ``von_mises``, at a point.
        smallest, largest, mean, integral: of a field over a region, along edges or a line.
        p_norm: of a field that is nowhere negative, over a region: nearly its largest value, with a derivative.
        energy: ``"stored"``, that of a region.
        cut_force: ``x``, ``y``, ``normal``, ``shear`` or ``moment``: what solids transfer through a line, on its left.
        contact: a quantity of contact: ``force``, ``force_x``, ``force_y`` or ``moment`` of a body or a pair of bodies,
            or ``gap``, ``pressure_max``, ``pressure_fit``, ``half_width``, ``contact_length``, ``centre_x`` or
            ``centre_y`` of a pair.
        at: name or coordinates of a point; for a reaction, name of a point or edges.
        region: name of a region; of values at points and along lines, whose they are where regions meet.
        edges: name of edges.
        line: both ends of a straight line.
        exponent: of a p-norm, 8 by default.
        of: name of a body, which is that of its region, or of a pair of bodies, as ``block-seal``.
    """

    displacement: str | None = None
    position: str | None = None
    gap: tuple[Place, Place] | None = None
    reaction: str | None = None
    value: str | None = None
    smallest: str | None = None
    largest: str | None = None
    mean: str | None = None
    integral: str | None = None
    p_norm: str | None = None
    energy: str | None = None
    cut_force: str | None = None
    contact: str | None = None
    at: Place | None = None
    region: str | None = None
    edges: str | None = None
    line: Line | None = None
    exponent: float | None = None
    of: str | None = None

    def __post_init__(self) -> None:
        self.probe()

    def probe(self) -> Probe:
        """The probe.

        Raises:
            InputError: there is not exactly one, or it lacks the place or has one of another kind.
        """
        given = [name for name in KINDS if getattr(self, name) is not None]
        if len(given) != 1:
            raise InputError(f"give one of {', '.join(KINDS)}, not {' and '.join(given) or 'none'}")
        what, kind = given[0], KINDS[given[0]]
        for place in PLACES:
            there = getattr(self, place) is not None
            if there and place not in (*kind.needs, *kind.takes):
                raise InputError(f"{what} has no use for '{place}'")
            if not there and place in kind.needs:
                raise InputError(f"{what} lacks '{place}'")
        return kind.make(self)


@dataclass(frozen=True)
class Kind:
    """How a probe is made of a table.

    Attributes:
        make: makes it.
        needs: entries that must be there besides the one that names the kind.
        takes: entries that may be there.
    """

    make: Callable[[ProbeTable], Probe]
    needs: tuple[str, ...] = ()
    takes: tuple[str, ...] = ()


def _place(table: ProbeTable) -> Place:
    assert table.at is not None
    return table.at


def _gap(table: ProbeTable) -> Probe:
    assert table.gap is not None
    return Gap(*table.gap)


def _over(what: str) -> Callable[[ProbeTable], Probe]:
    def make(table: ProbeTable) -> Probe:
        field = str(getattr(table, what))
        if (what, field) == (MEAN, "J") and table.edges is None and table.line is None and table.region is not None:
            return MeanJ(table.region)
        return Over(field, what, table.region, table.edges, table.line)

    return make


def _p_norm(table: ProbeTable) -> Probe:
    exponent = {} if table.exponent is None else {"p": table.exponent}
    return PNorm(str(table.p_norm), str(table.region), **exponent)


def _energy(table: ProbeTable) -> Probe:
    require_choice("energy", str(table.energy), ("stored",))
    return EnergyOf(str(table.region))


def _cut(table: ProbeTable) -> Probe:
    assert table.line is not None
    return CutForce(str(table.cut_force), table.line, table.region)


def _reaction(table: ProbeTable) -> Probe:
    if not isinstance(table.at, str):
        raise InputError("at: a reaction needs the name of a point or of edges")
    return Reaction(str(table.reaction), table.at)


# By the entry that names the kind; what else a table may have says where.
KINDS: Mapping[str, Kind] = {
    "displacement": Kind(lambda table: Displacement(str(table.displacement), _place(table)), ("at",)),
    "position": Kind(lambda table: Position(str(table.position), _place(table)), ("at",)),
    "gap": Kind(_gap),
    "reaction": Kind(_reaction, ("at",)),
    "value": Kind(lambda table: ValueAt(str(table.value), _place(table), table.region), ("at",), ("region",)),
    **{what: Kind(_over(what), (), ("region", "edges", "line")) for what in (SMALLEST, LARGEST, MEAN, INTEGRAL)},
    "p_norm": Kind(_p_norm, ("region",), ("exponent",)),
    "energy": Kind(_energy, ("region",)),
    "cut_force": Kind(_cut, ("line",), ("region",)),
    "contact": Kind(lambda table: Contact(str(table.contact), str(table.of)), ("of",)),
}
PLACES = tuple(name for name in ProbeTable.__dataclass_fields__ if name not in KINDS)
