"""Maths namespaces that turn a density into a UFL expression or into numbers."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from tmc_vem.fem import compat


def ufl_namespace() -> Any:
    """The ``m`` of a density for UFL expressions."""
    import ufl

    return SimpleNamespace(
        exp=ufl.exp, log=ufl.ln, sqrt=ufl.sqrt, sin=ufl.sin, cos=ufl.cos, atan=ufl.atan, atan2=compat.atan2
    )  # fmt: skip


def numpy_namespace() -> Any:
    """The ``m`` of a density for numpy arrays."""
    return SimpleNamespace(
        exp=np.exp, log=np.log, sqrt=np.sqrt, sin=np.sin, cos=np.cos, atan=np.arctan, atan2=np.arctan2
    )  # fmt: skip
