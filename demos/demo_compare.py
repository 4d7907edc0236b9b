#!/usr/bin/env python3
"""Virtual against finite elements on the box, as a page to send to a co-author.

Both methods solve the same problem on the same three meshes; the runs are done in processes and found again the next
time. The page has the gap with its mesh-converged value, errors against degrees of freedom and time, curves, deformed
states side by side, and everything that is needed to repeat it. The picture has the curves of the finest mesh: they
lie on one another.

    python demos/demo_compare.py            # up to 60 x 15 cells, u_y = -1
    python demos/demo_compare.py --quick    # a fifth of the load
"""

from __future__ import annotations

import argparse
from pathlib import Path

from tmc_vem import Medium, RunOptions
from tmc_vem.cli.batch_progress import BatchMonitor
from tmc_vem.study.compare import METHODS, box_study, compare

# %%
# Both methods minimise the same potential. The gap $g_h$ on three meshes is extrapolated, $g_h = g + c\, h^p$, and the
# distance of the two limits says how far the methods agree.

# The gap at u_y = -1 must be near the mesh-converged one (20 x 5 to 160 x 40 cells, both methods).
CONVERGED_GAP = 2.00e-3


def main() -> None:
    """Run, write the report and check that the methods agree."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a fifth of the load")
    parser.add_argument("--out", type=Path, default=Path("runs/demo_compare"), help="where report and runs go")
    parser.add_argument("--jobs", type=int, default=2, help="runs at a time")
    options = parser.parse_args()

    uy = -0.2 if options.quick else -1.0
    study = box_study(Medium(gamma=1e-5, alpha_r=1.0), uy, (1, 2, 3), {name: RunOptions(name) for name in METHODS})
    command = f"python demos/demo_compare.py{' --quick' if options.quick else ''}"
    report, comparison = compare(study, options.out, command=command, processes=options.jobs, observer=BatchMonitor())
    gaps = {}
    for method in comparison.methods:
        finest = method.finest
        assert finest is not None
        assert finest.complete, finest.reason
        assert finest.gap is not None
        gaps[method.name] = finest.gap
        print(f"{method.name}: gap {finest.gap:.4e} on the finest mesh, converged {method.converged}")
    difference = gaps["VEM"] / gaps["FEM"] - 1.0
    assert abs(difference) < 0.005, f"VEM and FEM differ by {difference:.2%}"
    if not options.quick:
        assert abs(gaps["VEM"] / CONVERGED_GAP - 1.0) < 0.02, gaps
    print(f"difference of the methods: {difference:+.2%}")
    print(f"report: {report}")


if __name__ == "__main__":
    main()
