"""The maths namespace ``m`` of a density for each kind of scalar; the code generator brings its own."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any


def ufl_namespace() -> Any:
    """Functions for UFL expressions; imports ufl."""
    import ufl

    return SimpleNamespace(
        exp=ufl.exp,
        log=ufl.ln,
        sqrt=ufl.sqrt,
        sin=ufl.sin,
        cos=ufl.cos,
        atan=ufl.atan,
        atan2=ufl.atan2 if hasattr(ufl, "atan2") else ufl.atan_2,  # renamed in UFL 2022.3
    )


def numpy_namespace() -> Any:
    """Functions for numpy arrays; imports numpy."""
    import numpy as np

    return SimpleNamespace(
        exp=np.exp, log=np.log, sqrt=np.sqrt, sin=np.sin, cos=np.cos, atan=np.arctan, atan2=np.arctan2
    )
