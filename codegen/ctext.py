"""The hand-written C that every kernel contains."""

from __future__ import annotations

from pathlib import Path

HERE = Path(__file__).parent


def abi_header() -> str:
    """Text of kernel_abi.h."""
    return HERE.joinpath("kernel_abi.h").read_text()


def driver_source() -> str:
    """Text of the cell driver, driver.c, and of the other entry points, entries.c."""
    return HERE.joinpath("driver.c").read_text() + "\n" + HERE.joinpath("entries.c").read_text()


def point_arithmetic_source() -> str:
    """Text of the helpers that the point kernels call, pointmath.c."""
    return HERE.joinpath("pointmath.c").read_text()
