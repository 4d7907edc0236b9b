"""The hand-written C that every kernel contains."""

from __future__ import annotations

from pathlib import Path

HERE = Path(__file__).parent


def abi_header() -> str:
    """Text of kernel_abi.h."""
    return HERE.joinpath("kernel_abi.h").read_text()


def driver_source() -> str:
    """Text of the cell driver: its files in the order in which they build on each other."""
    files = ("lanes.c", "shapes.c", "residual.c", "tangent.c", "entries.c")
    return "\n".join(HERE.joinpath(file).read_text() for file in files)


def point_arithmetic_source() -> str:
    """Text of the helpers that the point kernels call, pointmath.c."""
    return HERE.joinpath("pointmath.c").read_text()
