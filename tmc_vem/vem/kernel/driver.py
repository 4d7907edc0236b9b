"""The hand-written C that loops over cells, as the code generator takes it."""

from __future__ import annotations

from pathlib import Path

from codegen.driver import Driver

HERE = Path(__file__).parent

# Vectors of lanes with products of small matrices of them, the largest step with J > 0 at points, and where entries of
# the Hessian at a point lie.
LANE_PRODUCTS, STEP_LIMIT, PACKED_HESSIAN = HERE / "lanes.c", HERE / "limit.c", HERE / "hessian.c"

CELLS = ("shapes", "friction", "polynomials", "residual", "smooth", "tangent", "entries")
CELL_DRIVER = Driver(
    header=HERE / "kernel_abi.h",
    files=(
        LANE_PRODUCTS,
        STEP_LIMIT,
        PACKED_HESSIAN,
        *(HERE / f"{name}.c" for name in CELLS),
    ),
)

# Derivatives with respect to parameters, which have a library of their own.
PARAMETER_DRIVER = Driver(
    header=HERE / "by_parameters_abi.h",
    files=(LANE_PRODUCTS, *(HERE / name for name in ("shapes.c", "polynomials.c", "by_parameters.c"))),
    shared_headers=(CELL_DRIVER.header,),
)

# Cells in words of a device, for programs of others.
DEVICE_CELLS = Driver(header=HERE / "cells_abi.cuh", files=(HERE / "cells.cuh",))
