"""Tables of ``make bench-peers``, and the page docs/peers.md.

    python benchmarks/peer_tables.py

Reads runs/bench/peers.json. What stands between ``<!-- name -->`` and ``<!-- /name -->`` in the page is replaced.
"""

from __future__ import annotations

import json
import statistics
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from page_parts import fill, table

ROOT = Path(__file__).resolve().parent.parent
PAGE, RECORDED = ROOT / "docs" / "peers.md", ROOT / "runs" / "bench" / "peers.json"
FIRST = "tmc-vem"
EQUAL, OWN = "20 equal", "automatic"  # load steps
COLUMNS = (
    "program", "load steps", "cells", "unknowns", "iterations", "ms each", "solver", "seconds", "ratio", "wall",
    "residual", "reaction",
)  # fmt: skip


@dataclass(frozen=True)
class Compared:
    """A problem that is compared.

    Attributes:
        stepping: of the run of tmc-vem that others are compared with.
        meshes: cells in x and y.
    """

    stepping: str
    meshes: tuple[tuple[int, int], ...]


PROBLEMS = {
    "cbox": Compared(EQUAL, ((12, 6), (24, 12), (48, 24))),
    "box": Compared(OWN, ((20, 10), (40, 20))),
}
Samples = list[dict[str, Any]]


def seconds(samples: Samples, kind: str, *parts: str) -> float:
    """Median over the runs of the sum of parts; ``kind`` is 'cpu' or 'wall'."""
    return statistics.median(sum(each["seconds"][part][kind] for part in parts) for each in samples)


def work(samples: Samples, kind: str = "cpu") -> float:
    """Median time of set-up and run: from the numbers of a problem to its last state, nothing loaded or compiled."""
    return seconds(samples, kind, "set-up", "run") - compilation(samples, kind)


def compilation(samples: Samples, kind: str) -> float:
    """Median time of compilation that every run repeats, as part of its set-up."""
    return seconds(samples, kind, "compilation") if "compilation" in samples[0]["seconds"] else 0.0


def solver_share(sample: Mapping[str, Any]) -> float:
    """Part of the run's wall time that the linear solver takes."""
    parts = sample["seconds"]
    return float(parts["linear solve"]["wall"] / parts["run"]["wall"])


def rows(data: Mapping[str, Any], problem: str) -> list[tuple[str, ...]]:
    """Rows of a problem's table, those of a mesh together; programs that have failed are not in it."""
    runs = [run for run in data["runs"] if run["problem"] == problem and run["samples"]]
    stepping = PROBLEMS[problem].stepping
    reference = {
        tuple(run["cells"]): work(run["samples"])
        for run in runs
        if run["program"] == FIRST and run["stepping"] == stepping
    }
    return [row_of(run, reference.get(tuple(run["cells"]))) for run in runs]


def row_of(run: Mapping[str, Any], reference: float | None) -> tuple[str, ...]:
    """One row."""
    samples, last = run["samples"], run["samples"][-1]
    spent = work(samples)
    failed = last["attempts"] - last["steps"]
    return (
        run["program"],
        f"{last['steps']}, {run['stepping']}" + (f", {failed} failed" if failed else ""),
        f"{run['cells'][0]} x {run['cells'][1]}",
        str(last["unknowns"]),
        str(last["iterations"]),
        f"{1e3 * seconds(samples, 'cpu', 'run') / last['iterations']:.1f}",
        f"{100 * statistics.median(map(solver_share, samples)):.0f} %",
        f"{spent:.2f}",
        f"{spent / reference:.1f}" if reference else "",
        f"{work(samples, 'wall'):.2f}",
        f"{last['residual']:.0e}",
        f"{last['reaction']:.8e}",
    )  # fmt: skip


def starts(data: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """What comes before: start-up of the programs, with a small run that loads the rest, and compilation."""
    found: dict[str, tuple[str, ...]] = {}
    for run in data["runs"]:
        name = f"{run['problem']}, {run['program']}"
        if run["samples"] and name not in found:
            start = seconds(run["samples"], "wall", "start-up")
            again = compilation(run["samples"], "wall")
            first = data["first_start"].get(name)
            once = f"{first - start:.1f} s, once" if first is not None else ""
            found[name] = (name, f"{start:.2f} s", once or (f"{again:.1f} s, in every run" if again else "none"))
    return list(found.values())


def phases(data: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """Where the time of tmc-vem goes on the finest C-box: wall time, and its part of the whole."""
    finest = PROBLEMS["cbox"].meshes[-1]
    samples = [
        each["phases"]
        for run in data["runs"]
        if (run["problem"], run["program"], run["stepping"], tuple(run["cells"])) == ("cbox", FIRST, EQUAL, finest)
        for each in run["samples"]
    ]
    if not samples:
        return []
    spent = {phase: statistics.median(each[phase] for each in samples) for phase in samples[0]}
    return [(phase, f"{value:.3f} s", f"{100 * value / spent['total']:.0f} %") for phase, value in spent.items()]


def versions(data: Mapping[str, Any]) -> str:
    """Versions of all programs, as their runs have said them."""
    said: dict[str, str] = {}
    for run in data["runs"]:
        if run["samples"] and not run["program"].startswith("tmc-vem"):
            said |= run["samples"][-1]["versions"]
    left = "".join(f" Left out: {name} ({reason})." for name, reason in data["left_out"].items())
    machine, libraries = data["machine"], ", ".join(" ".join(pair) for pair in said.items())
    return f"{machine['processor']}; {machine['stack']}; {libraries}.{left}"


def same(data: Mapping[str, Any]) -> str:
    """How far apart FElupe and finite elements of ours are, if there is FElupe."""
    found = data["same"]
    if not found:
        return "FElupe was left out."
    return table(
        ("largest difference, relative to the largest value", "FElupe and tmc-vem"),
        [
            ("energy density of the solid, 200 F", f"{found['density']:.0e}"),
            ("stress P of the solid, 200 F", f"{found['stress']:.0e}"),
            ("energy of 4 states of the mesh of 12 x 6", f"{found['energy']:.0e}"),
            ("forces at its nodes", f"{found['forces']:.0e}"),
            ("displacement at full load", f"{found['displacement']:.0e}"),
            ("reaction at full load", f"{found['reaction']:.0e}"),
        ],
    )


def parts(data: Mapping[str, Any]) -> dict[str, Callable[[], str]]:
    """What the page has, by the names of its places."""
    return {
        "peers_versions": lambda: versions(data),
        "peers_same": lambda: same(data),
        "peers_cbox": lambda: table(COLUMNS, rows(data, "cbox")),
        "peers_box": lambda: table(COLUMNS, rows(data, "box")),
        "peers_phases": lambda: table(("phase", "wall", "of the whole"), phases(data)),
        "peers_starts": lambda: table(("problem, program", "start-up, wall", "compilation, wall"), starts(data)),
    }


def main() -> None:
    """Rewrite the page."""
    fill(PAGE, parts(json.loads(RECORDED.read_text())))
    print(f"{PAGE.relative_to(ROOT)} written")


if __name__ == "__main__":
    main()
