"""Errors of the code generator, worded for the author of an energy."""

from __future__ import annotations


class CodegenError(Exception):
    """An energy cannot be traced, or its kernel cannot be generated, compiled or loaded."""

    exit_code = 2
