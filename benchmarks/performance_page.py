"""Write the figures of ``make bench`` into docs/performance.md and draw the roofline; of ``make bench-peers``, if there
are any, into docs/peers.md.

    python benchmarks/performance_page.py

Reads runs/bench/*.json. What stands between ``<!-- name -->`` and ``<!-- /name -->`` in the page is replaced.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import peer_tables
import phases as phases_of_a_run
from growth import COLUMNS, table_rows
from harness import RESULTS
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from page_parts import fill, table

ROOT = Path(__file__).resolve().parent.parent
PAGE, PICTURE = ROOT / "docs" / "performance.md", ROOT / "docs" / "pictures" / "roofline.png"


def load(name: str) -> dict[str, Any]:
    """Results of one benchmark."""
    data: dict[str, Any] = json.loads((RESULTS / f"{name}.json").read_text())
    return data


def assembly() -> str:
    """(a) Tangent and residual against dolfinx."""
    rows = []
    for r in load("assembly")["results"]:
        p2 = r["dolfinx P2"]
        for label in ("quadrilaterals", "voronoi", "dolfinx P2", "dolfinx Q2"):
            t, s = r[label]["tangent"]["best"], r[label]["residual"]["best"]
            rows.append((
                f"{r['energy']}, {label}", str(r[label]["n_dofs"]),
                f"{1e6 * t:.2f}", f"{t / p2['tangent']['best']:.2f}", f"{1e6 * s:.3f}",
                f"{s / p2['residual']['best']:.2f}", f"1/{t / s:.1f}",
            ))  # fmt: skip
    heading = (
        "damped energy, cells",
        "dofs",
        "tangent, us/dof",
        "to P2",
        "residual, us/dof",
        "to P2",
        "residual/tangent",
    )
    return table(heading, rows)


def rates() -> str:
    """(b) Flop rates."""
    data = load("kernel_rates")
    peak = data["dgemm_gflops"]
    rows = [
        (name, *(f"{p['gflops']:.1f} ({100 * p['gflops'] / peak:.0f} %)" for p in parts.values()))
        for name, parts in data["parts"].items()
    ]
    heading = (f"Gflop/s (of dgemm's {peak:.1f})", "point kernel", "w D B", "contraction")
    return table(heading, rows)


def gap() -> str:
    """(c) Time to a gap."""
    data = load("time_to_gap")
    rows = []
    for method, runs in data["runs"].items():
        for entry in runs:
            error = 100 * (entry["gap"] / data["converged"] - 1)
            rows.append((
                f"{method}, {entry['cells'][0]} x {entry['cells'][1]}", str(entry["n_dofs"]), f"{entry['gap']:.4e}",
                f"{error:+.2f} %", str(entry["iterations"]), f"{entry['seconds']:.2f}",
            ))  # fmt: skip
    ratios = ", ".join(f"{method} {ratio:.1f}" for method, ratio in data["ratios"].items())
    heading = ("method, cells", "dofs", "gap", "error", "iterations", "seconds")
    return (
        table(heading, rows)
        + f"\n\nFirst mesh within 1 %, time relative to virtual elements on quadrilaterals: {ratios}."
    )


def phases() -> str:
    """(d) Phases."""
    return table(phases_of_a_run.COLUMNS, phases_of_a_run.table_rows(load("phases")))


def growth() -> str:
    """(e) Growth."""
    return table(COLUMNS, table_rows(load("growth")))


def projectors() -> str:
    """Set-up of one polygon."""
    rows = [(label, f"{1e6 * seconds:.1f}") for label, seconds in load("projectors")["results"].items()]
    return table(("distinct polygon", "us"), rows)


def condensation() -> str:
    """Factorisation with and without internal moments."""
    rows = []
    for kind, found in load("condensation")["results"].items():
        for name, f in found.items():
            counts = (str(f["unknowns"]), str(f["entries"]))
            rows.append((f"{kind}, {name}", *counts, f"{1e3 * f['seconds']:.0f} ms"))
    return table(("matrix", "unknowns", "entries", "factorisation and solve"), rows)


def startup() -> str:
    """(f) Start-up."""
    rows = [(k, f"{r['best']:.2f} s", f"{r['median']:.2f} s") for k, r in load("startup")["results"].items()]
    return table(("command, kernels in the cache", "best of 5", "median"), rows)


def projection_cost() -> str:
    """Tangents by projection space."""
    data = load("projection_cost")
    return table(data["columns"], data["rows"])


def machine() -> str:
    """Where this was measured."""
    facts = load("assembly")["machine"]
    return (
        f"{facts['processor']}, widest vectors {facts['vector_unit']}, {facts['cores']} cores of a virtual machine "
        f"that others use too; {facts['system']}, Python {facts['python']}, "
        f"{facts.get('stack', 'libraries not noted')}, OMP_NUM_THREADS={facts['threads']}."
    )


def draw_roofline() -> None:
    """Rates of the whole tangents, insertion included, under the limits of memory and arithmetic."""
    data = load("kernel_rates")
    peak, memory = data["dgemm_gflops"], data["copy_gbytes"]
    figure = Figure(figsize=(7.0, 4.4))
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    low, high = 0.3, 300.0
    knee = peak / memory
    axes.plot([low, knee, high], [low * memory, peak, peak], color="black", linewidth=1.5)
    axes.text(low * 1.1, low * memory * 1.5, f"copy {memory:.1f} GB/s", rotation=33, fontsize=8)
    axes.text(high / 1.1, peak * 1.06, f"dgemm {peak:.1f} Gflop/s", ha="right", fontsize=8)
    for marker, (name, whole) in zip("osD^", data["whole"].items(), strict=True):
        axes.plot(whole["intensity"], whole["gflops"], marker, markersize=8, label=f"{name}: tangent into the matrix")
    contraction = max(parts["contraction"]["gflops"] for parts in data["parts"].values())
    axes.axhline(contraction, color="0.5", linestyle=":", label=f"contraction alone, {contraction:.1f} Gflop/s")
    axes.set(xscale="log", yscale="log", xlim=(low, high), ylim=(1.0, peak * 1.8))
    axes.set_xlabel("flops a byte from memory (tables, positions, matrix values)")
    axes.set_ylabel("Gflop/s, needed operations only")
    axes.legend(fontsize=8, loc="lower right")
    axes.grid(which="major", alpha=0.3)
    figure.tight_layout()
    figure.savefig(PICTURE, dpi=130)


PARTS = {
    "machine": machine, "assembly": assembly, "rates": rates, "gap": gap, "phases": phases, "growth": growth,
    "startup": startup, "projection_cost": projection_cost, "projectors": projectors, "condensation": condensation,
}  # fmt: skip


def main() -> None:
    """Rewrite the page and the picture."""
    fill(PAGE, PARTS)
    draw_roofline()
    print(f"{PAGE.relative_to(ROOT)} and {PICTURE.relative_to(ROOT)} written")
    if peer_tables.RECORDED.is_file():  # 'make bench-peers' is asked for by itself
        peer_tables.main()


if __name__ == "__main__":
    main()
