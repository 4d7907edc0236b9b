"""The hand-written C that loops over cells, as the code generator takes it."""

from __future__ import annotations

from pathlib import Path

from codegen.driver import Driver

HERE = Path(__file__).parent

CELL_DRIVER = Driver(
    header=HERE / "kernel_abi.h",
    files=tuple(HERE / name for name in ("lanes.c", "shapes.c", "residual.c", "tangent.c", "entries.c")),
)
