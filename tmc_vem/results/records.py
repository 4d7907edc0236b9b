"""Records of load steps, and the names of what a run directory holds.

A run directory holds ``result.json`` (inputs, versions, results, times), ``history.csv`` (a row a load step),
``fields.pvd`` with ``fields/*.vtu`` and ``deformed.png``; until there is a result, ``run.json`` instead. A run that
adapts its mesh has ``adapt.pvd`` with ``adapt/*.vtu``, ``mesh.vtu`` and ``adapted.png`` as well.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, Protocol

from tmc_vem.problems.contact_quantities import quantities_of, shown
from tmc_vem.problems.probes import GAP, RESERVED, RESERVED_STARTS
from tmc_vem.results.unfinished import BEGUN, CHECKPOINT, COMMAND
from tmc_vem.support.units import ENERGY, NONE

# Schema of run directories that is written, and the oldest that is read. A new entry with a default in ``read`` or
# ``from_row`` leaves both alone; a changed meaning raises both.
SCHEMA, OLDEST = 2, 1
RESULT, HISTORY, FIELDS, COLLECTION, PICTURE = "result.json", "history.csv", "fields", "fields.pvd", "deformed.png"
# meshes that a run was adapted on: the folder, the collection, the last one as a mesh file, and a picture of them
ADAPT, ADAPTED, ADAPTED_MESH, ADAPTED_PICTURE = "adapt", "adapt.pvd", "mesh.vtu", "adapted.png"
PROBLEM = "problem.toml"  # of a run whose problem came from tables
DESIGN = "design.toml"  # the same of a search for a design, whose directory is none of a run
# tractions: the table of the last step, and of all snapshots the folder and the collection of their lines
CONTACT_TABLE, CONTACT_FOLDER, CONTACT_LINES = "contact.csv", "contact", "contact.pvd"
TRIANGULATED = "triangulated"  # fields cut into triangles: the collection, and what their files begin with
# groups of values in a record, and what their columns begin with
_GROUPS = {"min_j": "min_j_", "energy": "energy_", "parameters": "parameter_"}
_NESTED = ("forces", "contact", "friction")
_OPTIONAL = ("load_work", "limit_of")  # columns that not every run has
OF = "."  # between a load and a quantity of it
CONTACT = "contact" + OF  # what the columns of contact begin with; then comes a body or a pair, and a quantity
FRICTION = "friction" + OF  # what the columns of friction in a region begin with; then comes the region, and a quantity
# What is recorded of a region with friction: the energy that its elastic slip stores, what friction has dissipated and
# what work has gone into it since the start, the part of the largest shear that sticks, and the mean J in contact.
OF_REGION = {"slip_energy": ENERGY, "dissipated": ENERGY, "work": ENERGY, "sticking": NONE, "contact_j": NONE}
# What is said of a load that is shown, and not in the files alone; of springs, what has no pair.
SHOWN = ("displacement", "reaction", "angle", "moment", "force", "area", "swept", "pressure", "work")
SHOWN_OF_SPRINGS = ("force_x", "force_y", "energy")
# what tells a run directory from others
MARKS = (RESULT, BEGUN, COMMAND, CHECKPOINT)


def is_spring(measures: Mapping[str, float]) -> bool:
    """Whether measures by name, those of an entry of ``StepRecord.forces``, are a spring's: it alone has an energy."""
    return "energy" in measures


@dataclass(frozen=True)
class StepRecord:
    """A converged load step.

    Attributes:
        step: 1 for the first.
        load: load factor, 1 at full load.
        displacement: prescribed displacement of the loaded point or edge.
        probes: values of the problem's probes by name.
        reaction: force at the loaded point or edge, in the direction of the displacement component.
        iterations: Newton iterations; ``cut_backs`` failed attempts before it, with ``wasted_iterations``.
        min_j, energy: smallest J and energy by region; what friction stores is not in it.
        negative_pivots: negative eigenvalues of the tangent (unstable if above 0), or None if unknown.
        jumped: the equilibrium branch ended before this step, and this state lies on another one.
        seconds: wall time since the start of the run.
        time: coordinate along the load path; None in old runs, where it is the load factor.
        parameters: values of the medium's parameters while they are continued, by name; empty otherwise.
        load_force: work of the prescribed displacements per load factor: the sum of each reaction times its
            displacement at full load; None in old runs.
        load_work: work of all prescribed displacements since the start; None, and no column, where there are neither
            histories nor loads with names.
        forces: what is reported of loads and springs by their names, see :mod:`tmc_vem.problems.columns`.
        contact: forces of the medium on bodies, and contact of pairs of outlines, by their names, see
            :mod:`tmc_vem.results.contact.pairs`; what is not known in a state is left out.
        limit_of: number of the load step from which gamma was lowered to this state, at the same load; None, and no
            column, for the load steps themselves.
        friction: by region of medium with friction, see ``OF_REGION``; what is not known without contact is left out.
    """

    step: int
    load: float
    displacement: float
    probes: Mapping[str, float]
    reaction: float
    iterations: int
    cut_backs: int
    wasted_iterations: int
    min_j: Mapping[str, float]
    energy: Mapping[str, float]
    negative_pivots: int | None
    jumped: bool
    seconds: float
    time: float | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)
    load_force: float | None = None
    load_work: float | None = None
    forces: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    contact: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    limit_of: int | None = None
    friction: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    @property
    def coordinate(self) -> float:
        """Where the step is on the load path: what increases from step to step, also when the load does not."""
        return self.load if self.time is None else self.time

    @property
    def gap(self) -> float | None:
        """The probe that reports go by, or None."""
        return self.probes.get(GAP)

    @property
    def reported(self) -> dict[str, float]:
        """Probes, what is shown of loads and springs, ``<load>.<quantity>``, and of contact,
        ``contact.<body or pair>.<quantity>``."""
        found = dict(self.probes)
        for name, values in self.forces.items():
            hidden = {"moment"} if "amplitude" in values else set()  # of forces, about the origin: in the files alone
            named = {*(SHOWN_OF_SPRINGS if is_spring(values) else SHOWN)} - hidden
            found |= {name + OF + quantity: value for quantity, value in values.items() if quantity in named}
        of_contact = shown(self.contact).items()
        return found | {CONTACT + name + OF + quantity: value for (name, quantity), value in of_contact}

    def as_row(self) -> dict[str, Any]:
        """Flat form for history.csv, groups as ``min_j_<region>``, ``energy_<region>``, ``parameter_<name>``,
        ``<force>.<measure>``, ``contact.<body or pair>.<quantity>`` and ``friction.<region>.<quantity>``.

        The regions keep their order, by which the fields of a run directory are given their names.
        """
        flat: dict[str, Any] = {}
        for name, value in asdict(self).items():
            if name not in (*_GROUPS, *_NESTED) and not (name in _OPTIONAL and value is None):
                flat |= value if name == "probes" else {name: value}
        for name, prefix in _GROUPS.items():
            flat |= {prefix + key: value for key, value in getattr(self, name).items()}
        for name, measures in self.forces.items():
            flat |= {name + OF + measure: value for measure, value in measures.items()}
        for name, quantities in self.contact.items():
            columns = quantities_of(quantities)
            flat |= {CONTACT + name + OF + quantity: quantities.get(quantity) for quantity in columns}
        for name, quantities in self.friction.items():
            flat |= {FRICTION + name + OF + quantity: quantities.get(quantity) for quantity in OF_REGION}
        return {key: "" if value is None else value for key, value in flat.items()}

    @staticmethod
    def from_row(row: Mapping[str, str]) -> StepRecord:
        """Record of a row of history.csv; what is no other column is a probe."""

        def values(named: Mapping[str, str]) -> dict[str, float]:
            return {name: float(value) for name, value in named.items() if value}

        def group(name: str) -> dict[str, float]:
            prefix = _GROUPS[name]
            return values({key[len(prefix) :]: value for key, value in row.items() if key.startswith(prefix)})

        others = [key for key in row if key not in RESERVED and not key.startswith(RESERVED_STARTS)]
        forces: dict[str, dict[str, float]] = {}
        contact: dict[str, dict[str, float]] = {}
        friction: dict[str, dict[str, float]] = {}
        for key, value in values({key: row[key] for key in others if OF in key}).items():
            name, _, measure = key.rpartition(OF)  # of a load called "contact" the name is that, without a dot
            start = next((start for start in (CONTACT, FRICTION) if name.startswith(start)), "")
            group_of = {CONTACT: contact, FRICTION: friction}.get(start, forces)
            group_of.setdefault(name.removeprefix(start), {})[measure] = value

        return StepRecord(
            step=int(row["step"]),
            load=float(row["load"]),
            displacement=float(row["displacement"]),
            probes=values({key: row[key] for key in others if OF not in key}),
            reaction=float(row["reaction"]),
            iterations=int(row["iterations"]),
            cut_backs=int(row["cut_backs"]),
            wasted_iterations=int(row["wasted_iterations"]),
            min_j=group("min_j"),
            energy=group("energy"),
            negative_pivots=int(row["negative_pivots"]) if row["negative_pivots"] else None,
            jumped=row["jumped"] == "True",
            seconds=float(row["seconds"]),
            time=float(row["time"]) if row.get("time") else None,
            parameters=group("parameters"),
            load_force=float(row["load_force"]) if row.get("load_force") else None,
            load_work=float(row["load_work"]) if row.get("load_work") else None,
            forces=forces,
            contact=contact,
            limit_of=int(row["limit_of"]) if row.get("limit_of") else None,
            friction=friction,
        )

    @staticmethod
    def from_plain(entry: Mapping[str, Any]) -> StepRecord:
        """Record of the plain values of a checkpoint; the first versions knew one probe, the gap."""
        gap = {} if entry.get(GAP) is None else {GAP: entry[GAP]}
        return StepRecord(**{"probes": gap, **{key: value for key, value in entry.items() if key != GAP}})


# columns of history.csv that every run has
COLUMNS = tuple(
    entry.name for entry in fields(StepRecord) if entry.name not in ("probes", *_NESTED, *_OPTIONAL, *_GROUPS)
)


class Written(Protocol):
    """What is read back from a run's files by way of its result."""

    @property
    def directory(self) -> Path | None:
        """Where the run was written, or None."""

    @property
    def history(self) -> Sequence[StepRecord]:
        """The load steps."""

    @property
    def inputs(self) -> Mapping[str, Any]:
        """The problem's parameters and the method's settings."""

    @property
    def units(self) -> Mapping[str, str]:
        """Of the columns of the history."""

    @property
    def media(self) -> Sequence[str]:
        """Names of the regions that are third medium."""

    @property
    def min_j(self) -> Mapping[str, float]:
        """Smallest J by region at the last step."""


def heading(name: str, unit: str) -> str:
    """Of a column of history.csv whose unit the problem declares: ``reaction [N/mm]``."""
    return name if unit in ("", "1") else f"{name} [{unit}]"


def finite(value: Any) -> Any:
    """A value for JSON files, which know no infinity and no number that is none: those become null."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Mapping):
        return {key: finite(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(entry) for entry in value]
    return value
