"""The command of mutation runs."""

from __future__ import annotations

import argparse
import fnmatch
import signal
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from mutation import explained, show
from mutation.judge import Outcome
from mutation.measure import Record, record_path, stale, test_files
from mutation.nearness import Nearness
from mutation.pool import Pool, pool
from mutation.sample import draw, find, sources
from mutation.site import Mutant
from mutation.trees import ROOT, STORE

MOST = 0.06  # share of faults that may survive


def main(arguments: Sequence[str] | None = None) -> int:
    """Put faults into the sources and run the tests near them; fails if more than 6 % survive unexplained."""
    options = _parser().parse_args(arguments)
    console = Console(width=None if sys.stdout.isatty() else 160)
    try:
        known = explained.read(ROOT / explained.EXPLAINED)
        faults = _faults(options, console)
    except (OSError, ValueError) as error:
        print(f"mutants: {error}", file=sys.stderr)
        return 2
    old = explained.obsolete(ROOT, known)
    for entry in old:
        text = f"{explained.EXPLAINED}: no source has this any more: {entry.file}: {entry.before}"
        console.print(escape(text), style="yellow", soft_wrap=True, highlight=False)
    if options.list:
        for mutant in faults:
            console.print(escape(f"{mutant.file}:{mutant.line} ({mutant.operator})"), soft_wrap=True, highlight=False)
            console.print(show.difference(mutant), markup=False, soft_wrap=True, highlight=False)
        return 0
    try:
        return _run(options, console, faults, known)
    except KeyboardInterrupt:
        print("mutants: interrupted", file=sys.stderr)
        return 130


def _run(
    options: argparse.Namespace, console: Console, faults: Sequence[Mutant], known: Sequence[explained.Explained]
) -> int:
    """Judge faults; 0 if few survive."""
    start = time.monotonic()
    results: list[show.Judged] = []
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C: tests that run are ended
    with pool(ROOT, options.workers) as workers:
        _measure(workers, console, everything=options.measure)
        nearness = Nearness(workers.root, test_files(workers.root))

        def judged(mutant: Mutant, outcome: Outcome) -> None:
            results.append(show.Judged(mutant, outcome, explained.reason(mutant, known)))
            show.progress(console, results[-1], len(results), len(faults))
            show.write(options.out or _result(options), results)

        workers.judge(faults, nearness, judged)
    good = show.summary(console, results, (time.monotonic() - start) / 60, MOST)
    console.print(f"result: {options.out or _result(options)}", soft_wrap=True, highlight=False)
    return 0 if good else 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="mutants", description=main.__doc__)
    parser.add_argument("--seed", type=int, default=1, help="of the sample [1]")
    parser.add_argument("--number", type=_positive, default=100, help="faults in the sample [100]")
    parser.add_argument(
        "--only", action="append", metavar="FILE", help="draw from this source only; may be a pattern, and repeated"
    )
    parser.add_argument(
        "--again", type=Path, metavar="RESULT", help="instead of a sample what survived in an earlier run"
    )
    parser.add_argument("--list", action="store_true", help="show the sample, run nothing")
    parser.add_argument("--measure", action="store_true", help="measure anew which test executes which line")
    parser.add_argument("--workers", type=_positive, default=2, help="processes that run tests at the same time [2]")
    parser.add_argument("--out", type=Path, help="file for the result [build/mutants/seed-N.json, again.json]")
    return parser


def _positive(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{value} is not positive")
    return value


def _result(options: argparse.Namespace) -> Path:
    return STORE / ("again.json" if options.again else f"seed-{options.seed}.json")


def _faults(options: argparse.Namespace, console: Console) -> list[Mutant]:
    """The faults to put in.

    Raises:
        ValueError: there is no such source or result.
    """
    if options.again:
        survivors = show.survivors(options.again)
        known = find(ROOT, [key for key, _ in survivors])
        found = [min(known[key], key=lambda m: abs(m.line - line)) for key, line in survivors if key in known]
        if len(found) < len(survivors):
            console.print(f"{len(survivors) - len(found)} of the faults have no place in the sources any more")
        return sorted(found, key=lambda mutant: (mutant.file, mutant.start))
    files = sources(ROOT)
    if options.only:
        files = [file for file in files if any(fnmatch.fnmatch(file, pattern) for pattern in options.only)]
        if not files:
            raise ValueError(f"no source is called {' or '.join(options.only)}; name it as in tmc_vem/mesh/parts.py")
    return draw(ROOT, files, options.seed, options.number)


def _measure(workers: Pool, console: Console, *, everything: bool) -> None:
    """Measure the test files whose records are missing or older than their text."""
    files = test_files(workers.root)
    missing = files if everything else stale(workers.root, files)
    if not missing:
        return
    first = not any(record_path(file).is_file() for file in files)
    time_needed = "; the first time takes half an hour on two cores" if first else ""
    console.print(f"measuring which tests execute which lines: {len(missing)} of {len(files)} test files{time_needed}")
    start = time.monotonic()
    done: list[str] = []

    def measured(group: Sequence[str], records: Sequence[Record]) -> None:
        for file, record in zip(group, records, strict=True):
            done.append(file)
            told = f"{len(done):4d}/{len(missing)} measured {len(record.seconds):4d} tests of {file}"
            console.print(escape(told), soft_wrap=True, highlight=False)

    workers.measure(missing, measured)
    console.print(f"measured in {(time.monotonic() - start) / 60:.0f} minutes")
