"""Gap and reaction of the paper's problems on 1, 2, 3 and 4 ranks: they must agree to 1e-8.

python benchmarks/rank_independence.py            # small meshes, about 5 minutes on two cores
python benchmarks/rank_independence.py --full     # the meshes that the command line uses by default
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from typing import Any

from harness import MPI_SETTINGS, YIELD

SMALL = {
    "box": ["box", "--cells", "40", "10", "--gamma", "1e-4"],
    "cbox": ["cbox", "--cells", "20", "10"],
    "punch": ["punch", "--size", "0.2"],
    "bodies 1": ["bodies", "--case", "1", "--discs", "3"],
    "bodies 2": ["bodies", "--case", "2", "--discs", "3"],
}
FULL = {
    "box": ["box"],
    "box, hanging nodes": ["box", "--cells", "20", "5", "--refine-medium", "2"],
    "cbox": ["cbox"],
    "punch": ["punch"],
    "bodies 1": ["bodies", "--case", "1"],
    "bodies 2": ["bodies", "--case", "2"],
}


def solve(arguments: list[str], ranks: int) -> dict[str, Any]:
    """result.json of a run."""
    command = ["-c", "from tmc_vem.cli.main import main; main()", "run", *arguments, "--json"]
    done = subprocess.run(
        ["mpirun", "-n", str(ranks), sys.executable, *command],
        capture_output=True, text=True, env=os.environ | MPI_SETTINGS | YIELD, check=False,
    )  # fmt: skip
    if not done.stdout:
        sys.exit(f"{arguments} on {ranks} ranks failed: {done.stderr[-500:]}")
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--full", action="store_true")
    parser.add_argument("--only", help="one problem")
    parser.add_argument("--solver", default="direct", help="of tmc-vem run; 'reproducible' repeats to the bit")
    parser.add_argument("--ranks", type=int, nargs="*", default=[1, 2, 3, 4])
    arguments = parser.parse_args()
    cases = FULL if arguments.full else SMALL
    worst = 0.0
    columns = (
        "problem",
        "dofs",
        "ranks",
        "gap",
        "reaction",
        "difference",
        "same bits",
        "steps",
        "iterations",
        "seconds",
    )
    print("|", " | ".join(columns), "|")
    print("|---" * len(columns), "|", sep="")
    for name, case in cases.items():
        if arguments.only and arguments.only != name:
            continue
        asked = [*case, "--solver", arguments.solver]
        first: dict[str, Any] | None = None
        for ranks in arguments.ranks:
            result = solve(asked, ranks)
            first = first or result
            keys = ("gap", "reaction")
            difference = max(abs(result[key] / first[key] - 1.0) for key in keys)
            worst = max(worst, difference)
            row = [name, result["n_dofs"], ranks, f"{result['gap']:.12e}", f"{result['reaction']:.12e}"]
            row.append(f"{difference:.1e}")
            again = solve(asked, ranks) if ranks == 2 else None
            row.append("" if again is None else str(all(result[key] == again[key] for key in keys)))
            row += [result["steps"], result["newton_iterations"], f"{result['seconds']['total']:.1f}"]
            print("|", " | ".join(map(str, row)), "|", flush=True)
    print(f"\nlargest relative difference: {worst:.1e}")


if __name__ == "__main__":
    main()
