"""The hand-written C that loops over cells, as the code generator takes it."""

from __future__ import annotations

from pathlib import Path

from codegen.driver import Driver

HERE = Path(__file__).parent

LANE_PRODUCTS = HERE / "lanes.c"  # vectors of lanes and products of small matrices of them

CELL_DRIVER = Driver(
    header=HERE / "kernel_abi.h",
    files=(LANE_PRODUCTS, *(HERE / name for name in ("shapes.c", "residual.c", "tangent.c", "entries.c"))),
)
