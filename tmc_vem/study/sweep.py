"""Runs of a problem with several values of some entries: which combinations there are, and what becomes of them."""

from __future__ import annotations

import dataclasses
import itertools
import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from tmc_vem.problems import Bodies, Box, CBox, Medium, Punch
from tmc_vem.problems.base import Problem
from tmc_vem.report.sweep import Row, Sweep, said, sweep_page
from tmc_vem.report.write import write_page
from tmc_vem.simulation.options import RunOptions
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.study.batch import Job, Observer, run_batch
from tmc_vem.support.assignments import changed, keys
from tmc_vem.support.errors import InputError
from tmc_vem.support.files import write_atomically
from tmc_vem.support.toml_text import as_table
from tmc_vem.support.validation import build, require_choice

BENCHMARKS: Mapping[str, Any] = {"box": Box, "cbox": CBox, "punch": Punch, "bodies": Bodies}
SUFFIX = ".toml"
MOST = 1000  # combinations
LONGEST = 60  # characters of a label in the name of a directory

Make = Callable[[Mapping[str, Any]], tuple[Problem, RunOptions]]


def maker(source: str) -> Make:
    """What makes a problem and its run options with some entries set to other values.

    Args:
        source: a problem file, or the name of a benchmark, whose entries are its arguments, those of its ``medium``,
            also by themselves, and ``solve``.

    Raises:
        InputError: it is neither.
    """
    if source.endswith(SUFFIX):
        return lambda changes: read_problem(source, changes)
    require_choice("problem", source, BENCHMARKS, "or give a problem file, NAME.toml")
    return lambda changes: _benchmark(source, changes)


def combinations(choices: Mapping[str, Sequence[Any]], *, zipped: bool = False) -> list[dict[str, Any]]:
    """All combinations of values, the last entry varying fastest; or first with first, second with second and so on.

    Args:
        choices: values by name of the entry; an entry with one value has it in every combination.
        zipped: take the values side by side.

    Raises:
        InputError: an entry has a value twice, there are too many, or lists of different lengths side by side.
    """
    for name, values in choices.items():
        texts = [json.dumps(value, sort_keys=True) for value in values]
        twice = [said(value) for value, text in zip(values, texts, strict=True) if texts.count(text) > 1]
        if twice:
            raise InputError(f"--set {name} has the value {twice[0]} twice: give it once")
    if zipped:
        lengths = {name: len(values) for name, values in choices.items() if len(values) > 1}
        if len(set(lengths.values())) > 1:
            counts = ", ".join(f"{name} has {n}" for name, n in lengths.items())
            raise InputError(f"--zip takes equally many values of each entry, or one: {counts}")
        n = max(lengths.values(), default=1)
        columns = [list(values) if len(values) > 1 else [values[0]] * n for values in choices.values()]
        return [dict(zip(choices, row, strict=True)) for row in zip(*columns, strict=True)]
    n = math.prod(len(values) for values in choices.values())
    if n > MOST:
        raise InputError(f"{n} combinations are more than {MOST}: give fewer values, or take them side by side, --zip")
    return [dict(zip(choices, row, strict=True)) for row in itertools.product(*choices.values())]


def sweep(
    source: str,
    choices: Mapping[str, Sequence[Any]],
    out: Path,
    *,
    zipped: bool = False,
    command: str = "",
    processes: int = 2,
    observer: Observer | None = None,
) -> Sweep:
    """Do the runs that are not done yet, and write report, table and curves.

    Args:
        source: problem file or name of a benchmark.
        choices: values by name of the entry, as in :func:`combinations`.
        out: gets report.html, report.md, sweep.csv, sweep.json, figures and the run directories in ``runs``.
        zipped: take the values side by side.
        command: the command line, for the report.
        processes: runs at a time.
        observer: hears about progress.

    Returns:
        A row for each combination; one whose run failed, or whose values are no problem, says why.

    Raises:
        InputError: the directory cannot be used, or no combination gave a result.
    """
    make, axes = maker(source), [name for name, values in choices.items() if len(values) > 1]
    if not axes:
        raise InputError("a sweep needs an entry with several values, for example --set regions.block.solid.mu=10,20")
    chosen = combinations(choices, zipped=zipped)
    made = [_made(make, values) for values in chosen]
    errors = [entry for entry in made if isinstance(entry, str)]
    if len(errors) == len(made):
        raise InputError(errors[0])
    empty = Sweep("", "", axes, ())
    jobs = {
        n: Job(_label(entry[0].name, empty.label(Row(values, None))), *entry)
        for n, (values, entry) in enumerate(zip(chosen, made, strict=True))
        if not isinstance(entry, str)
    }
    outcomes = dict(
        zip(jobs, run_batch(list(jobs.values()), out / "runs", processes=processes, observer=observer), strict=True)
    )
    rows = [Row(values, None, str(entry)) for values, entry in zip(chosen, made, strict=True)]
    for n, outcome in outcomes.items():
        rows[n] = Row(chosen[n], outcome.result, outcome.error, jobs[n].name)
    found = Sweep(f"Sweep of '{next(iter(jobs.values())).problem.name}'", command, axes, rows)
    if not found.runs:
        raise InputError(found.failures[0])
    write_atomically(out / "sweep.csv", found.to_csv())
    write_atomically(out / "sweep.json", found.to_json())
    write_page(sweep_page(found), out)
    return found


def _made(make: Make, values: Mapping[str, Any]) -> tuple[Problem, RunOptions] | str:
    """Problem and options of a combination, or what is wrong with it."""
    try:
        return make(values)
    except InputError as error:
        return str(error)


def _benchmark(name: str, changes: Mapping[str, Any]) -> tuple[Problem, RunOptions]:
    """A benchmark with some arguments changed, and run options from ``solve``."""
    default = BENCHMARKS[name]()
    fields = {field.name: getattr(default, field.name) for field in dataclasses.fields(default)}
    of_medium = {field.name for field in dataclasses.fields(Medium)}
    ways = {
        f"medium.{entry}" if keys(entry)[0] in of_medium - fields.keys() else entry: value
        for entry, value in changes.items()
    }
    nested = {key: as_table(value) for key, value in fields.items() if dataclasses.is_dataclass(value)}
    table = changed(nested, ways)
    solve = table.pop("solve", {})
    return build(BENCHMARKS[name], table, name), build(RunOptions, solve, f"{name}: solve")


def _label(problem: str, values: str) -> str:
    """Beginning of the name of a run directory."""
    return re.sub(r"[^\w.=+-]+", "_", f"{problem}-{values.replace(' ', '')}")[:LONGEST]
