"""What a mutation run says: a line for every fault, and what survived."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from mutation.judge import SURVIVED, Outcome
from mutation.site import Mutant

EXPLAINED = "explained"


@dataclass(frozen=True)
class Judged:
    """A fault, what became of it, and why it is none if somebody has said so."""

    mutant: Mutant
    outcome: Outcome
    reason: str | None = None

    @property
    def status(self) -> str:
        """In one word."""
        return EXPLAINED if self.reason and not self.outcome.seen else self.outcome.status


def difference(mutant: Mutant) -> str:
    """The lines before and after."""
    lines = [f"- {line}" for line in mutant.before.splitlines()] + [f"+ {line}" for line in mutant.after.splitlines()]
    return "\n".join(f"    {line}" for line in lines)


def progress(console: Console, judged: Judged, number: int, total: int) -> None:
    """One line for a fault that has been judged."""
    place = f"{judged.mutant.file}:{judged.mutant.line}"
    style = {"survived": "red", "no tests": "red", "explained": "yellow"}.get(judged.status, "green")
    file, _, test = judged.outcome.by.partition("::")
    by = f", {Path(file).name}::{test}" if test else ""
    told = f"{number:4d}/{total} [{style}]{judged.status:9s}[/] {judged.outcome.seconds:6.1f} s  "
    console.print(told + escape(f"{place} ({judged.mutant.operator}){by}"), soft_wrap=True, highlight=False)
    for name in judged.outcome.broken:
        console.print(f"  fails without the fault, and does not count: {escape(name)}", soft_wrap=True, highlight=False)


def summary(console: Console, results: Sequence[Judged], minutes: float, most: float) -> bool:
    """Show what survived; return whether it is no more than a share ``most`` of all."""
    for status in (EXPLAINED, "no tests", SURVIVED):
        for judged in (each for each in results if each.status == status):
            console.rule(style="dim")
            head = f"{status}: {judged.mutant.file}:{judged.mutant.line} ({judged.mutant.operator})"
            console.print(escape(head), soft_wrap=True, highlight=False, style="bold")
            console.print(difference(judged.mutant), markup=False, highlight=False, soft_wrap=True)
            if judged.reason:
                console.print(f"    {judged.reason}", markup=False, highlight=False)
            else:
                console.print(f"    {_by_file(judged.outcome.ran)}", markup=False, highlight=False)
    counts = Counter(judged.status for judged in results)
    survived = counts[SURVIVED] + counts["no tests"]
    console.rule(style="dim")
    said = ", ".join(f"{count} {status}" for status, count in counts.most_common())
    good = survived <= most * len(results)
    limit = "" if good else f": more than {100 * most:g} % of {len(results)} survived"
    console.print(f"{said}; {minutes:.0f} minutes{limit}", highlight=False)
    return good


def _by_file(tests: Iterable[str]) -> str:
    counts = Counter(test.partition("::")[0] for test in tests)
    return "tests run: " + (", ".join(f"{count} of {file}" for file, count in counts.most_common()) or "none")


def write(path: Path, results: Iterable[Judged]) -> None:
    """Store all as JSON."""
    path.parent.mkdir(parents=True, exist_ok=True)
    found = [
        {"mutant": asdict(each.mutant), "outcome": asdict(each.outcome), "status": each.status, "reason": each.reason}
        for each in results
    ]
    path.write_text(json.dumps(found, indent=1) + "\n")


def survivors(path: Path) -> list[tuple[tuple[str, str, str], int]]:
    """What survived in an earlier run: file, lines before and lines after of each, and its line number then.

    Raises:
        ValueError: the file is not the result of a run.
    """
    try:
        stored = json.loads(path.read_text())
        unseen = [each["mutant"] for each in stored if each["status"] in (SURVIVED, "no tests")]
        return [((each["file"], each["before"], each["after"]), each["line"]) for each in unseen]
    except (KeyError, TypeError, json.JSONDecodeError) as error:
        raise ValueError(f"{path} is not the result of a mutation run ({error})") from error
