"""What a run leaves behind while it goes on: history, fields, checkpoints, and the result at the end."""

from __future__ import annotations

import functools
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.problems.base import Problem, media_of, with_friction
from tmc_vem.problems.design_region import design_regions
from tmc_vem.results.adaptivity import Adaptivity
from tmc_vem.results.contact.contact import check_contact
from tmc_vem.results.contact.curves import ContactCurves
from tmc_vem.results.contact_files import collect, write_last, write_snapshot
from tmc_vem.results.directory import RunDirectory
from tmc_vem.results.energy_balance import energy_balance
from tmc_vem.results.limit import Lowering, limit_at_end
from tmc_vem.results.output import SnapshotWriter, gather_fields
from tmc_vem.results.plausibility import ERROR, WARNING, Evidence, Finding, by_weight, findings_of, limit_findings
from tmc_vem.results.records import PICTURE, StepRecord
from tmc_vem.results.run_result import RunResult
from tmc_vem.simulation.balance import balance
from tmc_vem.simulation.checkpoint import DURABLE, Checkpoint, require_same_inputs
from tmc_vem.simulation.contact_gauge import ContactGauge
from tmc_vem.simulation.end_checks import imbalance, second_gradient_energy
from tmc_vem.simulation.gauge import Gauge
from tmc_vem.simulation.lowered import Descending, Lowered, stepper_state
from tmc_vem.simulation.measured import LoadGauge, Reading
from tmc_vem.simulation.monitor import Monitor
from tmc_vem.simulation.overlap import OverlapWatch
from tmc_vem.simulation.provenance import versions
from tmc_vem.simulation.saved import Saved, facts_of
from tmc_vem.simulation.words import reported, title_of, units_of_columns
from tmc_vem.solve.states import States
from tmc_vem.solve.stepping import Step, StepperState, SteppingResult
from tmc_vem.support.distributed import Vec
from tmc_vem.support.parallel import on_every_rank, on_root
from tmc_vem.support.timing import Timer
from tmc_vem.system.control import Control
from tmc_vem.system.discretisation import Discretisation
from tmc_vem.system.fields import Fields
from tmc_vem.system.stress import Stresses

Float = NDArray[np.float64]


class Recorder:
    """Records converged load steps.

    Args:
        problem: what is solved.
        system: its discretisation.
        gauge: the problem's probes on it.
        inputs: parameters of problem and method, for result.json and to recognise a checkpoint.
        directory: where to write, or None.
        times: coordinates along the load path at which fields are written; the last state always is, if there are any.
        checkpoint_every: converged steps between checkpoints; 0 for none.
        monitor: hears about steps.
        timer: phases of the run.
        watch: knows whether solids overlap in the state that converged last.
        triangulated: write the fields once more, cut into triangles.
        stress_fields: names of stress and strain that are written.
    """

    def __init__(
        self, problem: Problem, system: Discretisation, gauge: Gauge, inputs: Mapping[str, Any],
        directory: RunDirectory | None, times: Sequence[float], checkpoint_every: int, monitor: Monitor, timer: Timer,
        watch: OverlapWatch, *, triangulated: bool = False, stress_fields: Sequence[str] = (),
    ) -> None:  # fmt: skip
        self.problem, self.system, self.inputs, self.directory = problem, system, dict(inputs), directory
        self.gauge, self.monitor, self.timer, self.watch = gauge, monitor, timer, watch
        self.loads = LoadGauge(problem, system)
        media = {name: problem.regions()[name].integrand for name in media_of(problem)}
        self.contact = ContactGauge(system, media, int(inputs["order"]), with_friction(problem))
        self.friction = self.contact.friction
        self._read: Reading | None = None
        self.main: tuple[States, StepperState] | None = None  # from which the load path goes on
        self.lowered = Lowered()
        self.descending: Descending | None = None
        self._inverted: dict[str, Any] = {}
        self.history: list[StepRecord] = []
        self._plain_history: list[dict[str, Any]] = []
        self._columns: set[str] = set()  # of history.csv
        self.findings: list[Finding] = []  # about the run as such: its files, for example
        self.adaptivity: Adaptivity | None = None  # how the mesh came about
        self._facts: dict[str, Any] = {}
        self._order = int(inputs["order"])
        self._every = checkpoint_every if directory is not None else 0
        self._on_root = system.comm.rank == 0
        self._seconds_before = 0.0
        # when to wait for the disk again, and whether it has the checkpoint that is there
        self._durable_until, self._is_durable = time.monotonic() + DURABLE, True
        self._snapshots: SnapshotWriter | None = None
        self._stresses = Stresses(system, {name: region.integrand for name, region in problem.regions().items()})
        if directory is not None and times:
            self._snapshots = SnapshotWriter(
                system, directory.path, tuple(times), media_of(problem), problem.units(), triangulated=triangulated,
                order=self._order, stresses=self._stresses, names=stress_fields,
            )  # fmt: skip

    def record(self, step: Step, states: States, position: StepperState) -> None:
        """Record a converged step; called on all ranks."""
        u = states.vectors[-1]
        self.main = states, position
        with self.timer("tables"):
            record, self._read = self._measure(step, u, along_path=True)
            self._add_to_history(record)
        if self._snapshots is not None:
            with self.timer("snapshots"), reported(self._snapshots.directory):
                if self._snapshots.offer(step.number, step.time, u):
                    assert step.newton.residual is not None  # it has converged
                    self._write_contact(step.number, self.contact.curves(u, step.newton.residual))
        if self._every and step.number % self._every == 0:
            self._write_checkpoint()
        self.monitor.stepped(record)

    def record_lowered(self, step: Step, states: States, position: StepperState, *, passed: bool = False) -> None:
        """Record a state with lower gamma beside the last load step; called on all ranks.

        Args:
            step, states, position: as of :meth:`record`.
            passed: it is on the way to one that is recorded.
        """
        start, before = self.history[-1], self.descending
        records, iterations = (before.records, before.passed) if before is not None else ([], 0)
        if passed:
            iterations += len(step.newton.iterations) + step.wasted_iterations
        else:
            with self.timer("tables"):
                record, _ = self._measure(step, states.vectors[-1], along_path=False)
                records = [*records, replace(record, time=start.time, limit_of=start.step)]
        self.descending = Descending(start.step, records, states, position, iterations)
        self.lowered.friction_error = max(self.lowered.friction_error, position.friction.error)
        if self._every and step.number % self._every == 0:
            self._write_checkpoint()
        if not passed:
            self.monitor.lowered(records[-1])

    def end_descent(self, why: str, iterations: int = 0) -> None:
        """The descent from the last load step has ended; called on all ranks.

        Args:
            why: it did not go further; empty if it went to its end.
            iterations: of Newton's method in vain since its last state.
        """
        records, passed = (self.descending.records, self.descending.passed) if self.descending is not None else ([], 0)
        self.lowered.end(self.history[-1].step, records, why, iterations + passed)
        self.descending = None
        if self.directory is not None and records:
            self._rewrite_history(self.directory)
        if self._every:
            self._write_checkpoint()

    def _measure(self, step: Step, u: Vec, *, along_path: bool) -> tuple[StepRecord, Reading]:
        """What is recorded of a converged state, which follows the last load step.

        Args:
            step, u: the state.
            along_path: whether it is a load step itself.
        """
        residual = step.newton.residual
        assert residual is not None  # it has converged
        regions = step.newton.evaluation.regions
        with self.timer("contact"):
            contact = self.contact.read(u, residual, along_path=along_path)
        friction = self.friction.of_regions(u)
        before: Mapping[str, Mapping[str, float]] | None = None
        if along_path:
            before = self.history[-1].friction if self.history else {}
        potential = {name: values.potential for name, values in friction.items()}
        reading = self.loads.read(u, residual, step.control, self._read)
        return (
            StepRecord(
                step=step.number,
                load=step.load,
                displacement=reading.displacement,
                probes=self.gauge.read(u, residual, functools.partial(self.watch.behind, u), contact),
                reaction=reading.reaction,
                iterations=len(step.newton.iterations),
                cut_backs=step.cut_backs,
                wasted_iterations=step.wasted_iterations,
                min_j={name: values.min_j for name, values in regions.items()},
                energy={name: values.energy - potential.get(name, 0.0) for name, values in regions.items()},
                negative_pivots=step.newton.negative_pivots,
                jumped=step.jumped,
                seconds=self._seconds_before + self.timer.report()["total"],
                time=step.time,
                parameters=step.control.parameters,
                load_force=self._load_force(residual, step.control),
                load_work=reading.work,
                forces=reading.loads,
                contact=contact,
                friction={
                    name: values.reported(None if before is None else before.get(name, {}))
                    for name, values in friction.items()
                },
            ),
            reading,
        )

    def _add_to_history(self, record: StepRecord) -> None:
        self.history.append(record)
        self._plain_history.append(asdict(record))
        if self.directory is None:
            return
        directory = self.directory
        columns = record.as_row().keys()
        if len(self.history) == 1:
            self._columns = {*columns}
        if not columns <= self._columns:  # pairs of outlines and parameters come and go
            self._rewrite_history(directory)
            return
        with reported(directory.path):
            on_root(self.system.comm, lambda: directory.add_step(record, self._headings(record)))

    def _rewrite_history(self, directory: RunDirectory) -> None:
        """Write history.csv anew: load steps, each followed by what was recorded with lower gamma beside it."""
        rows: list[StepRecord] = []
        for record in self.history:
            rows += [record, *self.lowered.of(record.step)]
        self._columns = {name for record in rows for name in record.as_row()}
        units = self._units_of(rows) if self.problem.units().declared else {}
        with reported(directory.path):
            on_root(self.system.comm, lambda: directory.rewrite_history(rows, units))

    def restore(self, u: Vec) -> tuple[States, StepperState]:
        """Go on from the last checkpoint of the run directory: fill ``u``; the last states and the position.

        Raises:
            InputError: there is no good checkpoint, or it belongs to other inputs or another mesh.
        """
        assert self.directory is not None
        checkpoint = Checkpoint.read(self.directory.path)
        facts = checkpoint.facts
        require_same_inputs(facts["inputs"], self.inputs)
        saved = Saved.read(checkpoint, self._node_labels, self.system.shear(u)[0], u)
        saved.give(self.system, facts.get("stage", 0))
        if saved.below is not None:
            self.descending = Descending.from_facts(facts["descending"], saved.below)
        if "lowered" in facts:
            self.lowered = Lowered.from_facts(facts["lowered"])
        self.history = [StepRecord.from_plain(entry) for entry in facts["history"]]
        self._plain_history = [asdict(record) for record in self.history]
        self.watch.go_on(self.history)
        self._seconds_before = self.history[-1].seconds if self.history else 0.0
        self._rewrite_history(self.directory)
        if self._snapshots is not None:
            snapshots = self._snapshots
            snapshots.restore(facts["snapshots"])
            if self.contact.is_used:
                on_root(self.system.comm, lambda: collect(snapshots.directory, snapshots.entries))
        if self.history:
            self._read = self._read_again(u)
            self.contact.go_on(u, facts.get("slip", ()))
        self.main = saved.main, stepper_state(facts["position"])
        return self.main

    def _read_again(self, u: Vec) -> Reading:
        """The loads at the last state, from which work is summed on."""
        last = self.history[-1]
        control = Control(last.load, last.parameters)
        self.system.set_position(control)
        if control.parameters:
            self.system.set_parameters(control.parameters)
        residual = self.system.create_vector()
        self.system.residual(u, residual)
        return self.loads.again(u, residual, last.forces, last.load_work)

    def begin(self, *, locked: bool) -> None:
        """Say in the run directory what the run is; called on all ranks.

        Args:
            locked: whether this process holds the directory's lock.
        """
        with self.timer("tables"):
            self._facts = {
                "inputs": self.inputs,
                "versions": versions(self.system.comm.size),
                "n_cells": self.system.n_cells_global,
                "n_dofs": self.system.n_dofs,
                "projection_degrees": self.system.projection_degrees(),
                "media": tuple(media_of(self.problem)),
            }
        if self.directory is not None:
            directory, units = self.directory, self._units()
            with reported(directory.path):
                on_root(self.system.comm, lambda: directory.begin({**self._facts, "units": units}, locked=locked))

    def finish(
        self, outcome: SteppingResult, u: Vec, solver: str, *, cut_short: bool = False,
        lowering: Lowering | None = None, along_path: bool = False,
    ) -> RunResult:  # fmt: skip
        """Check the last state, draw it and write result.json.

        The check for interpenetration and the picture need the whole state on rank 0.

        Args:
            outcome: how the load stepping ended.
            u: the last converged state.
            solver: name of the linear solver.
            cut_short: a limit on work has ended the stepping.
            lowering: how gamma was lowered, if it was.
            along_path: whether limits along the path are wanted.
        """
        residual = self.system.create_vector()
        with self.timer("check"):
            evaluation = self.system.residual(u, residual)
        with self.timer("contact"):
            curves = self.system.comm.bcast(self.contact.curves(u, residual))
        if self._snapshots is not None and self.history:
            last = self.history[-1]
            with self.timer("snapshots"), reported(self._snapshots.directory):
                if self._snapshots.write(last.step, last.coordinate, u):
                    self._write_contact(last.step, curves)
        with self.timer("check"):
            checks: dict[str, Any] = {"imbalance": imbalance(self.system, residual, self.history)}
            checks |= second_gradient_energy(self.system, u, evaluation, self.inputs)
            checks |= {**self._between_the_points(u), **self._inverted}
            if curves is not None:
                checks["regulariser_share"] = curves.regulariser_share()
            balance_of_energy = energy_balance(self.history)
            if balance_of_energy:
                checks["energy_balance"] = balance_of_energy.as_dict()
            fields = gather_fields(self.system, u, media_of(self.problem))
            if fields is not None:
                contact = check_contact(fields, self._order)
                checks |= {**contact.as_dict(), "summary": contact.summary()}
            checks = self.system.comm.bcast(checks) | outcome.friction.checks() | self.lowered.friction_checks()
        if fields is not None and self.directory is not None:
            with self.timer("picture"):
                self._draw(fields, self.directory.path / PICTURE)
        history = self.history
        linear = {"solver": solver, "ordering": outcome.ordering, "linear_iterations": outcome.linear_iterations}
        designs = design_regions(self.problem.regions())
        media = [name for name in media_of(self.problem) if name not in designs]
        evidence = Evidence(self.inputs, history, checks, media, self.system.size, outcome.complete, designs)
        doubts = findings_of(evidence)
        limit, effort = None, self.lowered.iterations(self.descending)
        if lowering is not None:
            wrong = next((finding.text for finding in doubts if finding.severity == ERROR), "")
            lowered, done = self.lowered.records, self.lowered.done
            limit = limit_at_end(
                lowering, history, lowered, done, along_path=along_path, doubt=wrong, newton_iterations=effort
            )
            doubts += limit_findings(limit)
        findings = by_weight([*doubts, *self.findings])
        result = RunResult(
            **self._facts,
            complete=outcome.complete,
            reason=outcome.reason,
            load=outcome.load,
            newton_iterations=sum(r.iterations + r.wasted_iterations for r in history)
            + outcome.failed_iterations
            + effort,
            cut_backs=sum(r.cut_backs for r in history) + outcome.failed_attempts,
            checks=checks,
            parallel=balance(self.system.comm, self.system.work()) | linear,
            errors=[finding.text for finding in findings if finding.severity == ERROR],
            warnings=[finding.text for finding in findings if finding.severity == WARNING],
            seconds=self.timer.report(),
            history=history,
            directory=None if self.directory is None else self.directory.path,
            units=self._units_of([*history, *self.lowered.records]) if history else {},
            cut_short=cut_short and not outcome.complete,
            curves=curves,
            limit=limit,
            lowered=tuple(self.lowered.records),
            adaptivity=self.adaptivity,
        )
        if self.directory is not None:
            directory = self.directory
            with reported(directory.path):
                if curves is not None:
                    on_root(self.system.comm, lambda: write_last(directory.path, curves, self.problem.units()))
                on_root(self.system.comm, lambda: directory.write_result(result))
        return result

    def _write_contact(self, step: int, curves: ContactCurves | None) -> None:
        """Write the tractions (on rank 0) of a snapshot that has just been written; called on all ranks."""
        if (snapshots := self._snapshots) is None or not self.contact.is_used:
            return

        def write() -> None:
            assert curves is not None
            write_snapshot(snapshots.directory, step, curves, self.problem.units(), snapshots.entries)

        on_root(self.system.comm, write)

    def _draw(self, fields: Fields, path: Path) -> None:
        from tmc_vem.report.figures import draw_deformed

        try:
            draw_deformed(fields, path, title=title_of(self.problem, self.history))
        except OSError as error:
            text = f"{path.name} could not be written: {error.strerror or error}"
            self.findings.append(Finding(WARNING, text))

    def step_failed(self, u: Vec) -> None:
        """A step from a converged state has failed: count the cells that are inverted between their quadrature points.

        Where a corner goes through the medium, they are the first sign of it. Called on all ranks.
        """
        if self._inverted:
            return
        with self.timer("check"):
            count = self._between_the_points(u)["inverted_cells"]
        if count:
            self._inverted = {"inverted_from": self.history[-1].load if self.history else 0.0}

    def _between_the_points(self, u: Vec) -> dict[str, dict[str, Any]]:
        """What J is on a grid much finer than the quadrature's, by region.

        Returns:
            ``inverted_cells``: cells in which it is not positive, for the regions that have any; ``dense_min_j``: the
            smallest of a region, not a number if it is none anywhere.
        """
        polygons = self.system.output_polygons()
        J_c = self.system.dense_jacobians(u)
        by_region = [J_c[polygons.region_c == region] for region in range(len(polygons.region_names))]
        mine = [(int((~(J > 0.0)).sum()), float(J.min(initial=np.inf))) for J in by_region]
        counts, smallest = np.moveaxis(np.array(self.system.comm.allgather(mine)), -1, 0)
        inverted = zip(polygons.region_names, counts.sum(axis=0).astype(int).tolist(), strict=True)
        return {
            "inverted_cells": {name: n for name, n in inverted if n},
            "dense_min_j": dict(zip(polygons.region_names, smallest.min(axis=0).tolist(), strict=True)),
        }

    def _load_force(self, residual: Vec, position: Control) -> float:
        """Work of the prescribed displacements per load factor, at a position on the path."""
        values = residual.getArray(readonly=True)[self.system.constrained()]
        return float(self.system.comm.allreduce(float(values @ self.system.prescribed_per_load(position))))

    @cached_property
    def _node_labels(self) -> Float:
        return self.system.node_labels()

    def _write_checkpoint(self) -> None:
        """Each rank writes its own nodes; only names and checksums travel to rank 0."""
        with self.timer("checkpoints"):
            self._write_states()

    def _write_states(self) -> None:
        assert self.directory is not None
        assert self.main is not None
        (states, position), below = self.main, self.descending
        comm, path = self.system.comm, self.directory.path
        facts: dict[str, Any] = {}
        stage, kept = self.system.memory()
        saved = Saved(states, kept, below.states if below else None)
        if self._on_root:
            facts = {
                "stage": stage,
                "inputs": self.inputs,
                "position": asdict(position),
                **facts_of(states),
                "history": self._plain_history,
                "snapshots": self._snapshots.entries if self._snapshots else [],
            }
            if self.friction.is_used:
                facts["slip"] = self.friction.plain_slip()
            if self.lowered.done or below:
                facts |= {"lowered": self.lowered.facts(), "descending": below.facts() if below else None}
        mine = saved.checkpoint(facts, self._node_labels)
        durable = comm.bcast(time.monotonic() >= self._durable_until)
        label = f"{position.number:06d}" + (f"-{below.position.number:06d}" if below else "")
        part = None if self._on_root else f"checkpoint-part-{label}-{comm.rank}.npz"
        checksum = on_every_rank(comm, lambda: part and mine.write_part(path, part, durable=durable))
        parts = {key: value for key, value in comm.gather((part, checksum)) or () if key and value}
        on_root(comm, lambda: mine.write(path, parts, durable=durable, keep=self._is_durable))
        self._is_durable = durable
        if durable:
            self._durable_until = time.monotonic() + DURABLE

    def _units(self, record: StepRecord | None = None) -> dict[str, str]:
        """Units of the columns of the history; without a record, of those that every step will have."""
        kinds = {name: probe.kind for name, probe in self.gauge.probes.items()}
        kinds |= self.contact.kinds(record.contact if record else {}) | self.friction.kinds()
        return units_of_columns(self.problem, kinds, record)

    def _units_of(self, records: Sequence[StepRecord]) -> dict[str, str]:
        """Units of all columns that some steps have: pairs of outlines, and parameters, come and go."""
        distinct = {(*record.contact, *record.parameters): record for record in records}
        return {name: unit for record in distinct.values() for name, unit in self._units(record).items()}

    def _headings(self, record: StepRecord) -> dict[str, str]:
        """Units that stand in the headings of history.csv: those that the problem declares."""
        return self._units(record) if self.problem.units().declared else {}
