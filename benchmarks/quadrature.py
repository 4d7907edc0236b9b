"""How much the quadrature rule changes the gap of the box: the evidence for the default, in docs/performance.md.

    python benchmarks/quadrature.py

Two minutes on one core. ``scripts/refresh-numbers quadrature`` measures the same, keeps it, and writes it there.
"""

from __future__ import annotations

from pages.runs import directly
from pages.solver import quadrature

if __name__ == "__main__":
    print(quadrature(directly))
