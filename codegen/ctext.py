"""The hand-written C that every kernel contains."""

from __future__ import annotations

from pathlib import Path

HERE = Path(__file__).parent


def points_header() -> str:
    """Text of points.h: what every kernel exports."""
    return HERE.joinpath("points.h").read_text()


def parameters_source() -> str:
    """Text of what makes the parameters of some cells of those of all, parameters.c."""
    return HERE.joinpath("parameters.c").read_text()


def points_source() -> str:
    """Text of points.c: the functions of a point at many states."""
    return HERE.joinpath("points.c").read_text()


def point_arithmetic_source() -> str:
    """Text of the helpers that the point kernels call, pointmath.c."""
    return HERE.joinpath("pointmath.c").read_text()


def by_parameters_header() -> str:
    """Text of by_parameters.h: what a kernel of derivatives with respect to parameters exports."""
    return HERE.joinpath("by_parameters.h").read_text()


def by_parameters_source() -> str:
    """Text of by_parameters.c: these derivatives at many states."""
    return HERE.joinpath("by_parameters.c").read_text()
