"""Languages that functions of a point are printed in, by name."""

from __future__ import annotations

import importlib

from codegen.backends.backend import Backend
from codegen.errors import CodegenError

TARGETS = ("c", "cuda")


def backend(target: str) -> Backend:
    """The language of that name; it is imported when it is asked for, as it needs sympy.

    Raises:
        CodegenError: there is none.
    """
    if target not in TARGETS:
        raise CodegenError(f"there is no target '{target}'; choose one of {', '.join(TARGETS)}")
    found: Backend = importlib.import_module(f"codegen.backends.{target}").BACKEND
    return found
