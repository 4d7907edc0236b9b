"""Energies by name: which densities exist, their parameters, and how a third medium is composed from them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from tmc_vem.energy import densities
from tmc_vem.energy import kinematics as kin
from tmc_vem.energy.declare import declare, declared
from tmc_vem.energy.solids import LOG, MODELS, NEO_HOOKE, VOLUMETRIC, Density, solid_density, solid_name
from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import require_choice

_PASSED_ON = ("objective", "stress_free", "max_rotation", "domain")  # true of a regulariser and its medium


@dataclass(frozen=True)
class Energy:
    """A density with the names of its parameters, in the order in which kernels receive their values."""

    name: str
    density: Density
    parameters: tuple[str, ...]
    description: str = ""


@dataclass(frozen=True)
class Regulariser:
    """A second-gradient energy psi_r(F, G) and the names of its own parameters (none for those of Table 1)."""

    name: str
    density: Density
    equation: str = ""
    parameters: tuple[str, ...] = ()

    @property
    def title(self) -> str:
        """Its name, and the equation if it has a number."""
        return f"{self.name} {self.equation}".rstrip()


REGULARISERS: dict[str, Regulariser] = {
    regulariser.name: regulariser
    for regulariser in (
        Regulariser("huhu", densities.huhu, "(6)"),
        Regulariser("huhu_lulu", densities.huhu_lulu, "(9)"),
        Regulariser("angle", densities.angle, "(15)"),
        Regulariser("tangent", densities.tangent, "(16)"),
        Regulariser("angle_log", densities.angle_log),
        Regulariser("huhu_log", densities.huhu_log),
    )
}


TABLE_1 = ("huhu", "huhu_lulu", "angle", "tangent")  # the paper's

# What the medium is besides its regulariser: (5) of the paper, and one without stress across a squeeze.
MEDIA: dict[str, Density] = {"isochoric": densities.medium, "balanced": densities.balanced}
PAPER_MEDIUM = "isochoric"


def get_regulariser(name: str) -> Regulariser:
    """Regulariser by name.

    Raises:
        InputError: there is none of that name; the message lists the names.
    """
    require_choice("regulariser", name, REGULARISERS, "FILE.py:FUNCTION is one of your own")
    return REGULARISERS[name]


def hyperelastic_solid(model: str = NEO_HOOKE, volumetric: str = LOG) -> Energy:
    """Solid by name, the paper's (2) with parameters ``K`` and ``mu`` by default.

    Args:
        model: one of ``MODELS`` of :mod:`tmc_vem.energy.solids`.
        volumetric: one of its ``VOLUMETRIC``; no matter for a model that is not split.

    Raises:
        InputError: there is none of that name.
    """
    require_choice("model", model, MODELS)
    require_choice("volumetric", volumetric, VOLUMETRIC)
    of = MODELS[model]
    name = solid_name(of, volumetric)
    if name == "solid":
        return Energy(name, densities.solid, ("K", "mu"), "hyperelastic solid (2)")
    with_part = "" if name == model else f" with volumetric part '{volumetric}'"
    return Energy(name, solid_density(of, volumetric), ("K", *of.parameters), f"{of.title} solid{with_part}")


def energy_name(regulariser: Regulariser, damped: bool, medium: str = PAPER_MEDIUM, *, volumetric: bool = False) -> str:
    """Name of the third medium's energy, used for kernels and golden files."""
    kind = "" if medium == PAPER_MEDIUM else f"{medium}_"
    return f"medium_{kind}{regulariser.name}{'_damped' if damped else ''}{'_log_j' if volumetric else ''}"


def third_medium(
    regulariser: Regulariser, *, damped: bool, medium: str = PAPER_MEDIUM, volumetric: bool = False
) -> Energy:
    """Third medium (4), ``gamma (psi_m + alpha_r psi_r)``; damped: ``psi_r`` times ``exp(-beta J)`` as in (8).

    ``medium`` is one of :data:`MEDIA`, psi_m. With ``volumetric``, psi_m has in addition the volumetric part of the
    solid (2), ``log_j mu/2 (ln J)^2``: log_j is the bulk modulus relative to mu.

    The factor stands inside the energy, as in the paper's Appendix B, so the tangent is symmetric. ``alpha_r`` is
    a modulus times a length squared, that is a force: psi_m is an energy per volume, and the psi_r of Table 1 have the
    unit of one over length squared. The kernel takes the values in the order mu, gamma,
    alpha_r, beta (if damped), log_j (if volumetric), then the regulariser's own.

    Raises:
        InputError: a parameter of the regulariser has the name of one of these.
    """
    own = ("mu", "gamma", "alpha_r", *(("beta",) if damped else ()), *(("log_j",) if volumetric else ()))
    taken = [name for name in regulariser.parameters if name in own]
    if taken:
        raise InputError(f"regulariser '{regulariser.name}': the medium has a parameter '{taken[0]}' too; rename it")
    facts = {key: value for key, value in declared(regulariser.density).items() if key in _PASSED_ON}

    psi_m = MEDIA[medium]

    @declare(**facts)
    def density(F: Any, G: Any, p: Any, m: Any) -> Any:
        psi_r = regulariser.density(F, G, p, m)
        if damped:
            psi_r = m.exp(-p.beta * kin.det(F)) * psi_r
        psi = psi_m(F, G, p, m)
        if volumetric:
            log_j = m.log(kin.det(F))
            psi = psi + p.log_j * p.mu / 2 * log_j * log_j
        return p.gamma * (psi + p.alpha_r * psi_r)

    kind = "third medium" if medium == PAPER_MEDIUM else f"{medium} third medium"
    damping = (" with exp(-beta J)" if damped else "") + (" and (ln J)^2" if volumetric else "")
    return Energy(
        energy_name(regulariser, damped, medium, volumetric=volumetric),
        density,
        (*own, *regulariser.parameters),
        f"{kind} (4) with regulariser {regulariser.title}{damping}",
    )


# Solids by the names of their energies; with "neo_hooke", by which the model of the paper's solid is called.
SOLIDS: dict[str, Energy] = {
    NEO_HOOKE: hyperelastic_solid(),
    **{
        energy.name: energy
        for energy in (hyperelastic_solid(model, volumetric) for model in MODELS for volumetric in VOLUMETRIC)
    },
}

# Energies by name: the paper's, and those with our own medium or regularisers; other solids are in SOLIDS.
DENSITIES: dict[str, Energy] = {
    energy.name: energy
    for energy in (
        hyperelastic_solid(),
        *(
            third_medium(regulariser, damped=damped, medium=medium)
            for medium in MEDIA
            for regulariser in REGULARISERS.values()
            for damped in (False, True)
        ),
    )
}
PAPER_DENSITIES = {
    name: DENSITIES[name]
    for name in ("solid", *(energy_name(REGULARISERS[r], damped) for r in TABLE_1 for damped in (False, True)))
}
