"""Finite elements in dolfinx; the names below are for scripts of your own, see docs/howto/fenicsx.md."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tmc_vem.support.lazy import lazily

if TYPE_CHECKING:
    from tmc_vem.fem.compat import form, vector_space
    from tmc_vem.fem.exchange import polygon_mesh
    from tmc_vem.fem.expressions import energy_density, interior_penalty, measures

_MODULES = {
    "energy_density": "expressions",
    "form": "compat",
    "interior_penalty": "expressions",
    "measures": "expressions",
    "polygon_mesh": "exchange",
    "vector_space": "compat",
}

__all__ = ["energy_density", "form", "interior_penalty", "measures", "polygon_mesh", "vector_space"]

__getattr__ = lazily(__name__, _MODULES)
