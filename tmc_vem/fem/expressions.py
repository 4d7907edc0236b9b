"""Energies of ``tmc_vem.energy`` as UFL expressions, for scripts of your own in dolfinx and for our own forms."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codegen.integrand import DEFORMATION_GRADIENT, Integrand, second_gradient_energy
from codegen.layout import Take
from tmc_vem.energy import Energy
from tmc_vem.fem import compat
from tmc_vem.fem.maths import ufl_namespace
from tmc_vem.mesh.geometry import areas
from tmc_vem.support.errors import InputError
from tmc_vem.system.interior_penalty import require_weights

Int = NDArray[np.int64]


def energy_density(u: Any, energy: Energy, parameters: Mapping[str, Any]) -> Any:
    """Energy per reference area, ``psi(I + grad u, grad grad u; p)``.

    Args:
        u: displacement, a function of a vector-valued Lagrange space, of order 2 or more for its second gradient.
        energy: such as ``third_medium(get_regulariser("huhu_lulu"), damped=True)``.
        parameters: value of each of ``energy.parameters``, a number, a dolfinx constant or an expression.

    Raises:
        InputError: dolfinx cannot be used, or parameters are missing, or not those of the energy.
    """
    import ufl

    compat.require()
    return density(u, ufl.grad(ufl.grad(u)), _integrand(energy), _parameters(energy, parameters))


def interior_penalty(
    u: Any, energy: Energy, parameters: Mapping[str, Any], *, eta: Any = 10.0, consistent: bool = True
) -> Any:
    """Energy per length of a facet between two cells of a medium, to be integrated over ``dS``.

    Gradients of Lagrange elements jump between cells, so that second gradients in cells say only a part of how the
    field bends; see docs/fem.md, which derives it. The weight is ``eta gamma alpha_r / (2 h)``.

    Args:
        u, energy, parameters: those of :func:`energy_density`.
        eta: factor of the penalty.
        consistent: with the term that makes the exact solution stationary ("full"), else the penalty alone.

    Raises:
        InputError: the energy has no gamma or alpha_r, or as for :func:`energy_density`.
    """
    import ufl

    compat.require()
    integrand, p = _integrand(energy), _parameters(energy, parameters)
    require_weights(energy.name, integrand)
    mesh = u.function_space.mesh
    corners_cvx, cell = compat.corners(mesh)
    sizes = areas(corners_cvx[:, compat.tensor_order(cell)])
    G = ufl.variable(ufl.grad(ufl.grad(u)))
    factor = eta / (2 * facet_width(mesh, cell, abs(sizes)))
    return facet_energy(u, G, factor, p, density(u, G, integrand, p) if consistent else None)


def measures(mesh: Any, region_c: Int, quadrature_degree: int = 4) -> tuple[Any, Any]:
    """Measures ``dx(n)`` over the cells of region n, and ``dS(n)`` over the facets between two of its cells.

    Args:
        mesh: of dolfinx.
        region_c: (n_cells,) number of the region of every local cell, ghosts included.
        quadrature_degree: of both.
    """
    import ufl

    compat.require()
    metadata = {"quadrature_degree": quadrature_degree}
    numbers = np.asarray(region_c, dtype=np.int64)
    facets, cells = compat.neighbours(mesh)
    within = numbers[cells[:, 0]] == numbers[cells[:, 1]]
    cell_tags = compat.mesh_tags(mesh, 2, np.arange(len(numbers)), numbers)
    facet_tags = compat.mesh_tags(mesh, 1, facets[within], numbers[cells[within, 0]])
    return (
        ufl.Measure("dx", domain=mesh, subdomain_data=cell_tags, metadata=metadata),
        ufl.Measure("dS", domain=mesh, subdomain_data=facet_tags, metadata=metadata),
    )


def density(u: Any, G: Any, integrand: Integrand, p: SimpleNamespace) -> Any:
    """psi as a UFL expression; the integrand sees nested lists of components."""
    import ufl

    taken = {Take.GRADIENT: ufl.grad(u), Take.SECOND_GRADIENT: G}
    return integrand.of_fields(lambda take: taken[take].__getitem__, p, ufl_namespace())


def facet_energy(u: Any, G: Any, factor: Any, p: SimpleNamespace, psi: Any | None) -> Any:
    """Energy per length of facet: ``factor w |[[grad u]] n|^2``, and the consistency term if the density is given.

    Args:
        u: displacement.
        G: its second gradient, a UFL variable that ``psi`` is a function of.
        factor: of the penalty.
        p: parameters; w is the mean of ``gamma alpha_r exp(-beta J)`` of both cells, without beta of ``gamma alpha_r``.
        psi: density of the medium, or None.
    """
    import ufl

    n = ufl.FacetNormal(u.function_space.mesh)
    jump = ufl.jump(ufl.grad(u), n)
    weight = ufl.as_ufl(p.gamma * p.alpha_r)
    if hasattr(p, "beta"):
        F = DEFORMATION_GRADIENT.of_field(ufl.grad(u).__getitem__)
        weight = weight * ufl.exp(-p.beta * (F[0][0] * F[1][1] - F[0][1] * F[1][0]))
    energy = factor * ufl.avg(weight) * ufl.inner(jump, jump)
    if psi is not None:
        T = ufl.diff(psi, G)
        i, j, k = ufl.indices(3)
        moment = ufl.as_vector(T[i, j, k] * n[j] * n[k], i)
        energy = energy - ufl.inner(ufl.avg(moment), jump)
    return energy


def facet_width(mesh: Any, cell: str, areas_c: Any) -> Any:
    """h of a facet: mean area of its two cells over its length, doubled for triangles; both give a square's side."""
    import ufl

    area = compat.cell_function(mesh, areas_c)
    length = ufl.geometry.FacetJacobianDeterminant(mesh)
    factor = 2 if cell == compat.TRIANGLE else 1
    return factor * ufl.avg(area) / length("+")


def _integrand(energy: Energy) -> Integrand:
    return second_gradient_energy(energy.density, energy.name, energy.parameters, energy.description)


def _parameters(energy: Energy, given: Mapping[str, Any]) -> SimpleNamespace:
    """Parameters as attributes.

    Raises:
        InputError: one is missing, or the energy has none of that name.
    """
    for name in energy.parameters:
        if name not in given:
            raise InputError(f"energy '{energy.name}' has a parameter '{name}' without a value")
    for name in given:
        if name not in energy.parameters:
            known = ", ".join(energy.parameters)
            raise InputError(f"energy '{energy.name}' has no parameter '{name}' (it has: {known})")
    return SimpleNamespace(**given)
