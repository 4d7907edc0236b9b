#!/usr/bin/env python3
"""Your own regulariser: write it, check it, run it, compare it.

The second-gradient energy keeps the third medium's mesh from collapsing. The paper compares four; this demo adds one
that is in none of its tables: it penalises the gradient of J, which keeps neighbouring cells equally compressed, and
the gradient of the deformation's skew part, which keeps them equally rotated,

    Psi_r = 1/2 |grad J|^2 + kappa/2 |grad (F12 - F21)|^2 ,

and leaves all other second gradients alone. It is cheaper than `angle` (no quotient), but for large rotations the skew
part is no measure of the rotation: the energy is not objective, and the check below says so in words.

The picture has its box beside that of the paper's regulariser (9), coloured by J: the same shape, and gaps that differ
by one percent.

    python demos/demo_new_regulariser.py            # 40 x 10 cells, all four of Table 1 for comparison
    python demos/demo_new_regulariser.py --quick    # 20 x 10 cells, two of them
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from tmc_vem import Box, Medium, RunOptions, RunResult, run
from tmc_vem.report.animation import draw_states, states_of

# %%
# A regulariser is any function $\psi_r(F, G)$ of the deformation gradient and its gradient. The code generator derives
# $P = \partial \psi / \partial F$, $T = \partial \psi / \partial G$ and the three second derivatives, and verifies
# their rates.

REGULARISER = '''\
"""A regulariser on grad J and on the gradient of the skew part of F."""


def spin(F, G, p, m):
    """1/2 |grad J|^2 + kappa/2 |grad (F12 - F21)|^2."""
    axes = (0, 1)
    grad_j = [F[1][1] * G[0][0][k] - F[1][0] * G[0][1][k] - F[0][1] * G[1][0][k] + F[0][0] * G[1][1][k] for k in axes]
    grad_w = [G[0][1][k] - G[1][0][k] for k in axes]
    return sum(g**2 for g in grad_j) / 2 + p.kappa / 2 * sum(w**2 for w in grad_w)
'''

GAMMA, ALPHA_R, CONVERGED_GAP = 1e-5, 1.0, 2.01e-3


def check(file: Path) -> None:
    """Compile the kernel and print the verification table; the demo goes on whatever it says about objectivity."""
    command = [sys.executable, "-m", "codegen", f"{file}:spin", "--param", "kappa=0.1", "--check", "--show"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    print(done.stdout)
    if "objectiv" not in done.stdout:
        raise SystemExit(f"the check did not run:\n{done.stderr}")


def solve(out: Path, cells: tuple[int, int], regulariser: str, **parameters: float) -> RunResult:
    """Box without damping, so that the regularisers are compared as they are."""
    medium = Medium(gamma=GAMMA, alpha_r=ALPHA_R, beta=0.0, regulariser=regulariser, parameters=parameters)
    return run(Box(cells=cells, medium=medium), out, RunOptions(snapshots=1, overwrite=True))


def main() -> None:
    """Write, check, run, compare."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a coarser mesh, fewer regularisers")
    parser.add_argument("--out", type=Path, default=Path("runs/demo_new_regulariser"), help="where all files go")
    options = parser.parse_args()
    cells = (20, 10) if options.quick else (40, 10)

    options.out.mkdir(parents=True, exist_ok=True)
    file = options.out / "spin.py"
    file.write_text(REGULARISER)
    check(file)

    names = ("huhu_lulu", "angle") if options.quick else ("huhu", "huhu_lulu", "angle", "tangent")
    runs = {
        f"spin, kappa = {kappa:g}": solve(options.out / f"spin-{kappa:g}", cells, f"{file}:spin", kappa=kappa)
        for kappa in (0.1, 1.0)
    }
    runs |= {name: solve(options.out / name, cells, name) for name in names}

    table = Table(
        title=f"Box, gamma = {GAMMA:g}, alpha_r = {ALPHA_R:g}, no damping, {cells[0]} x {cells[1]}", box=SIMPLE
    )
    for heading in ("regulariser", "gap", "load", "steps", "Newton iterations", "min J"):
        table.add_column(heading, justify="left" if heading == "regulariser" else "right")
    for name, result in runs.items():
        gap = "" if result.gap is None else f"{result.gap:.3e}"
        smallest = min(result.min_j.values())
        table.add_row(
            name, gap, f"{result.load:.0%}", str(result.steps), str(result.newton_iterations), f"{smallest:.1e}"
        )
    Console().print(table)

    picture = options.out / "states.png"
    shown = {name: runs[name] for name in ("spin, kappa = 0.1", "huhu_lulu")}
    states = [
        (f"{name}: gap {result.gap:.3e}, {result.newton_iterations} iterations", states_of(result)[-1][1])
        for name, result in shown.items()
    ]
    draw_states(states, picture, quantity="J")
    print(f"picture: {picture}")

    own = runs["spin, kappa = 0.1"]
    assert own.complete, own.reason
    assert own.gap is not None
    assert abs(own.gap / CONVERGED_GAP - 1.0) < 0.1, f"gap {own.gap:.3e} is far from {CONVERGED_GAP:.3e}"


if __name__ == "__main__":
    main()
