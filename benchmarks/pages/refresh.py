"""The command ``scripts/refresh-numbers``."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from pages.block import COSTS, AnyBlock, Block
from pages.runs import ROOT, Batch, Kept, KeptRuns, Measure
from tmc_vem.report.refresh import block_names, replaced, texts
from tmc_vem.report.rounding import Difference, differences
from tmc_vem.simulation.interrupt import Interrupted
from tmc_vem.support.errors import InputError, TmcError

HELP = """Write the numbers of README.md and docs anew from runs.

    scripts/refresh-numbers                          # all: about an hour and a half of one core, if nothing is there
    scripts/refresh-numbers --quick                  # blocks that take seconds
    scripts/refresh-numbers docs/fem.md zoo          # some pages or blocks
    scripts/refresh-numbers --check [...]            # writes nothing

What was measured is kept in runs/numbers, and runs of the paper's tables and figures in runs/reproduce/runs, where
'tmc-vem reproduce' finds them as well. They are used again as long as sources and libraries are the same, so that an
interrupted refresh goes on. The exit code of --check is 1 if a number is out of date by more than rounding.
"""


def pages(root: Path = ROOT) -> dict[str, str]:
    """Texts of README and documentation by their paths."""
    skipped = ("api", "gallery")
    docs = (p for p in sorted((root / "docs").rglob("*.md")) if p.relative_to(root / "docs").parts[0] not in skipped)
    return {str(path.relative_to(root)): path.read_text() for path in (root / "README.md", *docs) if path.exists()}


def places(documents: Mapping[str, str], blocks: Sequence[AnyBlock]) -> dict[str, list[AnyBlock]]:
    """The blocks of every page, in the order of the page.

    Raises:
        InputError: a page has a block that nothing makes, or a block stands in no page or in two.
    """
    by_name = {block.name: block for block in blocks}
    found: dict[str, list[AnyBlock]] = {}
    where: dict[str, str] = {}
    for page, text in documents.items():
        for name in block_names(text):
            if name not in by_name:
                raise InputError(f"{page}: no numbers are known by '{name}': choose one of {', '.join(by_name)}")
            if name in where:
                raise InputError(f"block '{name}' stands in {where[name]} and in {page}: leave out one")
            where[name] = page
            found.setdefault(page, []).append(by_name[name])
    missing = [name for name in by_name if name not in where]
    if missing:
        raise InputError(f"no page has a block '{missing[0]}': add '<!-- numbers: {missing[0]} -->' to one")
    return found


def chosen(found: Mapping[str, Sequence[AnyBlock]], names: Sequence[str], quick: bool) -> list[tuple[str, AnyBlock]]:
    """Pages with blocks that were asked for, the cheap ones first.

    Raises:
        InputError: neither a page nor a block has that name.
    """
    every = [(page, block) for page, blocks in found.items() for block in blocks]
    known = {*found, *(block.name for _, block in every)}
    unknown = [name for name in names if name not in known]
    if unknown:
        raise InputError(f"no page or block is called '{unknown[0]}': see scripts/refresh-numbers --list")
    wanted = [(p, b) for p, b in every if not names or p in names or b.name in names]
    affordable = [(p, b) for p, b in wanted if not quick or b.cost == COSTS[0]]
    if not affordable:
        raise InputError(f"nothing in {', '.join(names)} takes seconds: leave out --quick")
    return sorted(affordable, key=lambda pair: COSTS.index(pair[1].cost))


def text_of(block: AnyBlock, measure: Measure, batch: Batch) -> str:
    """What a block says now."""
    return (block.write(measure) if isinstance(block, Block) else block.write(batch)).strip()


def refresh(
    root: Path, wanted: Sequence[tuple[str, AnyBlock]], measure: Measure, batch: Batch, *, check: bool
) -> tuple[list[str], list[str]]:
    """Write blocks, or compare them.

    Returns:
        What was out of date, line by line, and blocks that could not be made.
    """
    stale, failed = [], []
    for page, block in wanted:
        start = time.monotonic()
        _say(f"{page}, {block.name} ({block.cost})")
        try:
            new = text_of(block, measure, batch)
        except Interrupted:
            raise
        except (TmcError, ImportError, AssertionError) as error:
            failed.append(f"{page}, {block.name}: {error or 'a run did not get where it should'}")
            continue
        document = (root / page).read_text()
        old = texts(document)[block.name]
        found = differences(old, new)
        if found or (new != old and not check):
            stale += [f"{page}, {block.name}: {line}" for line in _lines(found)]
        if new != old and not check:
            (root / page).write_text(replaced(document, block.name, new))
        _say(f"    {time.monotonic() - start:.0f} s")
    return stale, failed


def _lines(found: Sequence[Difference], most: int = 8) -> list[str]:
    """The first differences in words."""
    left = len(found) - most
    return [*map(str, found[:most]), *([f"and {left} more"] if left > 0 else [])] or ["rounding"]


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def main(blocks: Sequence[AnyBlock]) -> int:
    """The command line; its exit code."""
    parser = argparse.ArgumentParser(description=HELP, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="*", metavar="PAGE or BLOCK", help="default: all")
    parser.add_argument("--quick", action="store_true", help="only blocks that take seconds")
    parser.add_argument("--check", action="store_true", help="write nothing; name what is out of date")
    parser.add_argument("--again", action="store_true", help="measure again what is there")
    parser.add_argument("--list", action="store_true", help="pages, blocks, and what they cost")
    parser.add_argument("--runs", type=Path, default=ROOT / "runs", help="what was measured; default: runs")
    parser.add_argument("--jobs", type=int, default=1, help="runs of the paper's tables at a time; default: 1")
    options = parser.parse_args()
    try:
        found = places(pages(), blocks)
        wanted = chosen(found, options.what, options.quick)
        if options.list:
            print("\n".join(f"{page:28s} {block.name:20s} {block.cost}" for page, block in wanted))
            return 0
        measure = Kept(options.runs / "numbers", again=options.again, say=lambda line: _say(f"  {line}"))
        batch = KeptRuns(options.runs / "reproduce" / "runs", processes=options.jobs, again=options.again,
                         say=lambda line: _say(f"  {line}"))  # fmt: skip
        stale, failed = refresh(ROOT, wanted, measure, batch, check=options.check)
    except TmcError as error:
        print(f"refresh-numbers: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print("refresh-numbers: interrupted; what was measured is kept", file=sys.stderr)
        return 130
    for line in (*stale, *(f"failed: {line}" for line in failed)):
        print(line)
    state = "out of date" if options.check else "refreshed"
    pages_of = dict.fromkeys(line.split(",")[0] for line in stale)
    print(f"{state}: {', '.join(pages_of) or 'nothing'}")
    return 1 if failed or (stale and options.check) else 0
