"""All speed benchmarks one after the other, each in a process of its own: ``make bench``, about ten minutes.

    python benchmarks/run_all.py [assembly kernel_rates ...]

Results are printed and written to runs/bench; ``make bench-page`` puts them into docs/performance.md.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ALL = (
    "assembly", "kernel_rates", "point_kernel", "time_to_gap", "phases", "growth", "startup", "projectors",
    "condensation", "projection_cost",
)  # fmt: skip


def main() -> None:
    """Run the named benchmarks, or all; exit code 1 if one fails."""
    failed = []
    for name in sys.argv[1:] or ALL:
        if subprocess.run([sys.executable, str(HERE / f"{name}.py")], check=False).returncode:
            failed.append(name)
    if failed:
        raise SystemExit(f"failed: {', '.join(failed)}")


if __name__ == "__main__":
    main()
