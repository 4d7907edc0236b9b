"""From the variables of an optimiser to the densities of all cells of a design, and back by the chain rule.

z (variables, 0 to 1) -> x (a variable for every orbit of the symmetry; passive cells have theirs) -> filter ->
projection -> physical density, which passive cells have again as it is given -> factor s of the stiffness.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from tmc_vem.design.filters import Filter, NoFilter
from tmc_vem.design.interpolation import Interpolation, Simp
from tmc_vem.design.projection import Projection
from tmc_vem.design.symmetry import Mirror, orbits
from tmc_vem.mesh.cells import centroids_and_areas
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]

ROUNDING = 1e-9  # by how much a variable may be out of bounds before it is wrong


@dataclass(frozen=True)
class Parametrisation:
    """Densities of a design's cells as functions of the variables; the whole mesh, the same on every rank.

    Attributes:
        cells: (n_cells,) numbers of the design's cells in the mesh; all arrays over cells have this order.
        area_c: (n_cells,) their areas.
        variable_c: (n_cells,) the variable of each, -1 where it is passive.
        passive_c: (n_cells,) densities of passive cells, not a number elsewhere.
        filter: over these cells, passive ones among them.
        projection: of filtered densities, if there is one.
        interpolation: from physical density to factor.
    """

    cells: Int
    area_c: Float
    variable_c: Int
    passive_c: Float
    filter: Filter = field(default_factory=NoFilter)
    projection: Projection | None = None
    interpolation: Interpolation = field(default_factory=Simp)

    @property
    def n_variables(self) -> int:
        """How many variables there are."""
        return int(self.variable_c.max(initial=-1)) + 1

    def with_projection(self, projection: Projection | None) -> Parametrisation:
        """The same with another projection."""
        return replace(self, projection=projection)

    def densities(self, z: Float) -> Float:
        """x (n_cells,) of variables (n_variables,), before filter and projection.

        Raises:
            InputError: there are not as many variables, or one is not in [0, 1].
        """
        z = self._checked(z)
        return np.where(self._active, z[self.variable_c], self.passive_c)

    def physical(self, z: Float) -> Float:
        """Densities (n_cells,) in [0, 1] after filter and projection; passive cells have what they were given.

        Raises:
            InputError: as for :meth:`densities`.
        """
        return self._physical(self._filtered(z))

    def factors(self, z: Float) -> Float:
        """s (n_cells,) in [0, 1] that the energy of the solid is multiplied with.

        Raises:
            InputError: as for :meth:`densities`.
        """
        return self.interpolation.factor(self.physical(z))

    def backward(self, z: Float, *, by_physical_c: Float | None = None, by_factor_c: Float | None = None) -> Float:
        """dv/dz (n_variables,) of a functional v.

        Args:
            z: (n_variables,) where.
            by_physical_c: (n_cells,) dv/d(physical density), without what comes by the factor.
            by_factor_c: (n_cells,) dv/ds. With both given, they are added.

        Raises:
            InputError: as for :meth:`densities`.
        """
        filtered = self._filtered(z)
        slope = np.zeros(len(self.cells)) if by_physical_c is None else np.asarray(by_physical_c, dtype=np.float64)
        if by_factor_c is not None:
            slope = slope + by_factor_c * self.interpolation.slope(self._physical(filtered))
        slope = np.where(self._active, slope, 0.0)
        if self.projection is not None:
            slope = slope * self.projection.slope(filtered)
        by_density = self.filter.backward(slope)
        return self._gathered(by_density)

    def volume(self, z: Float) -> float:
        """Mean physical density over the area of the design, passive cells included (no unit).

        Raises:
            InputError: as for :meth:`densities`.
        """
        return float(self.area_c @ self.physical(z) / self.area_c.sum())

    def volume_gradient(self, z: Float) -> Float:
        """d(volume)/dz (n_variables,).

        Raises:
            InputError: as for :meth:`densities`.
        """
        return self.backward(z, by_physical_c=self.area_c / self.area_c.sum())

    def uniform(self, volume: float) -> Float:
        """Variables (n_variables,), all equal, of a volume.

        Raises:
            InputError: the volume is not between those of variables that are all 0 and all 1.
        """
        low, high = (self.volume(np.full(self.n_variables, value)) for value in (0.0, 1.0))
        if not low <= volume <= high:
            raise InputError(
                f"volume {volume:g}: with its passive cells, the design has {low:.4g} to {high:.4g} of its area: use a "
                "volume in between"
            )
        value = brentq(lambda z: self.volume(np.full(self.n_variables, z)) - volume, 0.0, 1.0, xtol=1e-14)
        return np.full(self.n_variables, value)

    @property
    def _active(self) -> Bool:
        return self.variable_c >= 0

    def _gathered(self, values_c: Float) -> Float:
        active = self._active
        summed = np.bincount(self.variable_c[active], values_c[active], self.n_variables)
        return np.asarray(summed, dtype=np.float64)

    def _filtered(self, z: Float) -> Float:
        return np.clip(self.filter.forward(self.densities(z)), 0.0, 1.0)  # out of [0, 1] by rounding only

    def _physical(self, filtered_c: Float) -> Float:
        value = filtered_c if self.projection is None else np.clip(self.projection.value(filtered_c), 0.0, 1.0)
        return np.where(self._active, value, self.passive_c)

    def _checked(self, z: Float) -> Float:
        z = np.asarray(z, dtype=np.float64)
        if z.shape != (self.n_variables,):
            raise InputError(
                f"variables of shape {z.shape}: this design has {self.n_variables} of them, one after the other"
            )
        bad = np.flatnonzero(~((z >= -ROUNDING) & (z <= 1.0 + ROUNDING)))
        if len(bad):
            raise InputError(f"variable {bad[0]} is {z[bad[0]]:g}: a density is from 0 to 1")
        return np.clip(z, 0.0, 1.0)


def parametrise(
    mesh: PolygonMesh,
    design_c: Bool,
    *,
    solid_c: Bool | None = None,
    void_c: Bool | None = None,
    mirrors: Sequence[Mirror] = (),
    filter_of: Filter | None = None,
    projection: Projection | None = None,
    interpolation: Interpolation | None = None,
) -> Parametrisation:
    """Variables of a design: one for every cell that is not passive, or for every set of mirror images.

    Args:
        mesh: the whole mesh.
        design_c: (n_cells of the mesh,) mask of the design's cells.
        solid_c, void_c: (n_cells of the mesh,) masks of cells whose density stays 1 or 0; those outside the design are
            passed over.
        mirrors: lines of symmetry.
        filter_of: a filter over ``np.flatnonzero(design_c)``, or None.
        projection: of filtered densities, or None.
        interpolation: from density to stiffness; SIMP with p = 3 by default.

    Raises:
        InputError: a mask has another length, no cell is left to vary, a cell is to be solid and void, the mesh is not
            symmetric, or of mirror images one is passive and one is not.
    """
    cells = np.flatnonzero(_mask("the design", design_c, mesh.n_cells))
    solid, void = (
        np.zeros(len(cells), dtype=bool) if given is None else _mask(name, given, mesh.n_cells)[cells]
        for name, given in (("solid cells", solid_c), ("void cells", void_c))
    )
    center, area = (values[cells] for values in centroids_and_areas(mesh))
    both = np.flatnonzero(solid & void)
    if len(both):
        raise InputError(
            f"{_at(center, both[0])} is to be solid and void ({len(both)} such cells): take it out of one of the masks"
        )
    passive = np.where(solid, 1.0, np.where(void, 0.0, np.nan))
    if np.isfinite(passive).all():
        raise InputError(f"none of the {len(cells)} cells of the design may change: all are solid, void or outside it")
    orbit = orbits(center, area, mirrors) if mirrors else np.arange(len(cells))
    _check_images(orbit, passive, center)
    active = np.isnan(passive)
    _, number = np.unique(orbit[active], return_inverse=True)
    variable = np.full(len(cells), -1, dtype=np.int64)
    variable[active] = number
    return Parametrisation(cells, area, variable, passive, filter_of or NoFilter(), projection, interpolation or Simp())


def _mask(name: str, mask: Bool, n_cells: int) -> Bool:
    mask = np.asarray(mask)
    if mask.dtype != np.bool_ or mask.shape != (n_cells,):
        raise InputError(
            f"the mask of {name} is an array of {mask.dtype} of shape {mask.shape}: give one bool for each of the "
            f"{n_cells} cells of the mesh"
        )
    return mask


def _check_images(orbit_c: Int, passive_c: Float, center_cx: Float) -> None:
    """Mirror images are all passive, with one density, or none is."""
    kind = np.where(np.isnan(passive_c), -1.0, passive_c)
    first = np.zeros(orbit_c.max() + 1)
    first[orbit_c[::-1]] = kind[::-1]
    bad = np.flatnonzero(kind != first[orbit_c])
    if len(bad):
        words = {-1.0: "free", 0.0: "void", 1.0: "solid"}
        raise InputError(
            f"{_at(center_cx, bad[0])} is {words[kind[bad[0]]]}, but its mirror image is "
            f"{words[first[orbit_c[bad[0]]]]}: make the passive cells symmetric too"
        )


def _at(center_cx: Float, cell: np.int64) -> str:
    x, y = center_cx[cell]
    return f"the cell at ({x:.6g}, {y:.6g})"
