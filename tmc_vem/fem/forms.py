"""The potential as UFL forms: the regions' densities over cells, and the interior penalty over facets in the medium.

Residual and tangent are derivatives of the potential, so they agree with it and the tangent is symmetric.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, Protocol

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from codegen.integrand import Integrand
from tmc_vem.fem import compat
from tmc_vem.fem.expressions import density, facet_energy, facet_width
from tmc_vem.fem.friction import PointFriction
from tmc_vem.fem.mesh import FemMesh
from tmc_vem.support.distributed import Comm
from tmc_vem.system.control import parameter_of
from tmc_vem.system.fem_settings import FemSettings
from tmc_vem.system.friction_settings import Friction
from tmc_vem.system.graded import Graded
from tmc_vem.system.interior_penalty import require_weights

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]


class RegionDensity(Protocol):
    """Energy of a region, the values of its parameters, whether it is the third medium, what varies in it, friction."""

    @property
    def integrand(self) -> Integrand: ...

    @property
    def values(self) -> Mapping[str, float]: ...

    @property
    def is_medium(self) -> bool: ...

    @property
    def graded(self) -> Graded | None: ...

    @property
    def friction(self) -> Friction | None: ...


@dataclass(frozen=True)
class Forms:
    """UFL forms of a potential.

    Attributes:
        cells: the regions' energies.
        facets: by region name, the interior penalty's energy, for the media that have one.
        residual: first derivative of all of it, and of the potential of friction, which has no form of its own: it is
            divided by a stiffness that vanishes where there is no friction.
        tangent: derivative of the residual; points that slip may have some stiffness in it.
        residual_of: the residual of some of this rank's cells (n,) alone, without facets. It differs from ``residual``
            in the cells that are marked only, so that the same compiled code computes it.
        set_parameters: changes parameters, by name, in every energy that has them, or in that of one region.
        set_factors: changes what multiplies the parameters of a region that vary, (n, n_varying) in the cells of the
            region that this rank owns; for all ranks together.
    """

    cells: Any
    facets: Mapping[str, Any]
    residual: Any
    tangent: Any
    residual_of: Callable[[Int], Any]
    set_parameters: Callable[[Mapping[str, float]], None]
    set_factors: Callable[[str, Float], None]


class CompiledForms:
    """Forms that are compiled when they are first needed, or found in dolfinx' cache; all ranks ask for them together.

    Args:
        comm: communicator.
        forms: what is compiled.
    """

    def __init__(self, comm: Comm, forms: Forms) -> None:
        self._comm, self._forms = comm, forms
        self._partial: dict[bytes, Any] = {}

    @functools.cached_property
    def residual(self) -> Any:
        return compat.form(self._forms.residual)

    @functools.cached_property
    def tangent(self) -> Any:
        return compat.form(self._forms.tangent)

    @functools.cached_property
    def facets(self) -> dict[str, Any]:
        return {name: compat.form(form) for name, form in self._forms.facets.items()}

    def residual_of(self, chosen_c: Bool) -> Any:
        """The residual of some of this rank's cells alone; kept, as the same ones are asked for again."""
        key = chosen_c.tobytes()
        if self._comm.allreduce(key not in self._partial, op=MPI.LOR):  # making a form is for all ranks together
            self._partial[key] = compat.form(self._forms.residual_of(np.flatnonzero(chosen_c)))
        return self._partial[key]


def make_forms(
    mesh: FemMesh,
    u: Any,
    regions: Mapping[str, RegionDensity],
    settings: FemSettings,
    friction: PointFriction,
) -> Forms:
    """Forms of the potential at ``u``, a function in the displacement space, with the friction of some regions.

    Raises:
        InputError: a medium with interior penalty lacks one of the parameters gamma and alpha_r.
    """
    import ufl

    domain = mesh.mesh
    names = mesh.names.regions
    metadata = {"quadrature_degree": settings.quadrature}
    parameters, eta, set_parameters, set_factors = _parameters(
        mesh, {name: regions[name] for name in names}, settings.eta
    )
    G = ufl.variable(ufl.grad(ufl.grad(u)))
    densities = {name: density(u, G, regions[name].integrand, parameters[name]) for name in names}
    media = [name for name in names if regions[name].is_medium and settings.interior_penalty != "none"]
    width: Any = facet_width(domain, mesh.cell, mesh.areas_c) if media else None
    test = ufl.TestFunction(u.function_space)

    def over(cell_tags: Any) -> Any:
        return ufl.Measure("dx", domain=domain, subdomain_data=cell_tags, metadata=metadata)

    def energies(cell_tags: Any, facet_tags: Any) -> tuple[Any, dict[str, Any]]:
        dx = over(cell_tags)
        cells = sum(densities[name] * dx(number) for number, name in enumerate(names))
        facets: dict[str, Any] = {}
        dS = ufl.Measure("dS", domain=domain, subdomain_data=facet_tags, metadata=metadata)
        for tag, name in enumerate(media, start=1):
            require_weights(name, regions[name].integrand)
            psi = densities[name] if settings.interior_penalty == "full" else None
            facets[name] = facet_energy(u, G, eta / (2 * width), parameters[name], psi) * dS(tag)
        return cells, facets

    def with_friction(form: Any, density: Any, cell_tags: Any) -> Any:
        dx = over(cell_tags)
        return form + sum(density * dx(names.index(name)) for name in friction.laws)

    def residual(cell_tags: Any, cells: Any, facets: Mapping[str, Any]) -> tuple[Any, Any]:
        stored = ufl.derivative(cells + sum(facets.values()) if facets else cells, u, test)
        work = friction.shear_work(u, test) if friction.laws else None
        return stored, stored if work is None else with_friction(stored, work, cell_tags)

    def residual_of(chosen: Int) -> Any:
        none = np.empty(0, dtype=np.int64)
        facet_tags = compat.mesh_tags(domain, 1, none, none) if media else None
        cell_tags = compat.mesh_tags(domain, 2, chosen, mesh.region_c[chosen])
        return residual(cell_tags, *energies(cell_tags, facet_tags))[1]

    everywhere = compat.mesh_tags(domain, 2, np.arange(len(mesh.region_c)), mesh.region_c)
    whole = energies(everywhere, _facet_tags(mesh, media) if media else None)
    stored, gradient = residual(everywhere, *whole)
    trial = ufl.TrialFunction(u.function_space)
    tangent = ufl.derivative(stored, u, trial)
    if friction.laws:
        tangent = with_friction(tangent, friction.shear_stiffness(u, trial, test), everywhere)
    return Forms(*whole, gradient, tangent, residual_of, set_parameters, set_factors)


def _parameters(
    mesh: FemMesh, regions: Mapping[str, RegionDensity], eta: float
) -> tuple[dict[str, SimpleNamespace], Any, Callable[[Mapping[str, float]], None], Callable[[str, Float], None]]:
    """Parameters of each region and the penalty factor as constants, and how to change them; what varies from cell to
    cell is multiplied with a function, and how to change these."""
    keys = [(name, key) for name, region in regions.items() for key in region.integrand.parameter_names]
    constants, numbers = compat.constants(mesh.mesh, [*(regions[name].values[key] for name, key in keys), eta])
    *values, factor = constants
    parameters = {name: SimpleNamespace() for name in regions}
    for (name, key), value in zip(keys, values, strict=True):
        setattr(parameters[name], key, value)
    functions: dict[str, list[Any]] = {name: [] for name in regions}
    for number, name in enumerate(mesh.names.regions):
        graded = regions[name].graded
        if graded is not None:
            cells = np.flatnonzero(mesh.region_c == number)
            for key, factor_c in zip(graded.names, mesh.factors(graded, cells).T, strict=True):
                everywhere = np.ones(len(mesh.region_c))
                everywhere[cells] = factor_c
                varying = compat.cell_function(mesh.mesh, everywhere)
                setattr(parameters[name], key, getattr(parameters[name], key) * varying)
                functions[name].append(varying)

    def change(wanted: Mapping[str, float]) -> None:
        for position, (name, key) in enumerate(keys):
            for known in (key, parameter_of(name, key)):
                if known in wanted:
                    numbers[position] = wanted[known]

    def change_factors(name: str, factor_ck: Float) -> None:
        cells = np.flatnonzero(mesh.region_c[: mesh.n_owned] == mesh.names.regions.index(name))
        for function, factor_c in zip(functions[name], factor_ck.T, strict=True):
            compat.set_cell_values(function, len(mesh.region_c), cells, factor_c)

    return parameters, factor, change, change_factors


def _facet_tags(mesh: FemMesh, media: Sequence[str]) -> Any:
    """Number 1, 2, ... of the medium on facets between two of its cells."""
    facets, cells = compat.neighbours(mesh.mesh)
    numbers = np.array([mesh.names.regions.index(name) for name in media])
    region: NDArray[Any] = mesh.region_c[cells]
    tags = np.zeros(len(facets), dtype=np.int32)
    for tag, number in enumerate(numbers, start=1):
        tags[(region == number).all(axis=1)] = tag
    return compat.mesh_tags(mesh.mesh, 1, facets[tags > 0], tags[tags > 0])
