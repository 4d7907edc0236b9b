"""What regions are made of, as users say it: a hyperelastic solid, and the third medium."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from tmc_vem.energy import MEDIA, PAPER_MEDIUM, REGULARISERS, Regulariser
from tmc_vem.problems.regularisers import RegulariserLike, resolve_regulariser
from tmc_vem.problems.solids import Material
from tmc_vem.support.errors import InputError
from tmc_vem.support.settings import about, described
from tmc_vem.support.validation import check_fields, require_positive
from tmc_vem.system.friction_settings import ELASTIC_SLIP, Friction

__all__ = ["Material", "Medium", "chosen_weight"]


@described
@dataclass(frozen=True)
class Medium:
    """Third medium (4), gamma (psi_m + alpha_r psi_r)."""

    gamma: float = field(default=1e-5, metadata=about("Stiffness relative to the solid.", detail="Far below 1."))
    alpha_r: float | None = field(
        default=None,
        metadata=about(
            "Weight of the regulariser, a modulus times a length squared: another number in other units.",
            none="1, unless alpha is given",
            detail="It scales with the unit of moduli as well as with the geometry.",
        ),
    )
    beta: float = field(default=5.0, metadata=about("Damping exp(-beta J); 0 for none."))
    regulariser: RegulariserLike = field(
        default="huhu_lulu",
        metadata=about(
            f"{', '.join(REGULARISERS[name].title for name in REGULARISERS)}, or your own: FILE.py:FUNCTION.",
            detail="From Python also a function ``density(F, G, p, m)``.",
        ),
    )
    parameters: Mapping[str, float] = field(default_factory=dict, metadata=about("Parameter of your own regulariser."))
    alpha: float | None = field(
        default=None,
        metadata=about(
            "Weight of the regulariser without dimension, alpha_r = alpha mu h^2 with the initial width h of the gap, "
            "instead of alpha_r: 2.5 suits any geometry and units.",
            detail="mu is the shear modulus that gamma multiplies.",
        ),
    )
    energy: str = field(
        default=PAPER_MEDIUM,
        metadata=about(
            "The medium besides its regulariser: isochoric is the paper's (5); balanced pulls nothing in where it is "
            "squeezed.",
            choices=tuple(MEDIA),
        ),
    )
    log_j: float = field(
        default=0.0,
        metadata=about(
            "Bulk modulus of the medium relative to mu: log_j mu/2 (ln J)^2 is added to it, 0 for none.",
            detail="As in the solid (2), and scaled by gamma like the rest of the medium.",
        ),
    )
    friction: float = field(
        default=0.0,
        metadata=about("Coefficient of Coulomb's friction between the surfaces that the medium parts, 0 for none."),
    )
    elastic_slip: float = field(
        default=ELASTIC_SLIP,
        metadata=about(
            "Slip at which friction is reached in full, in widths of the squeezed gap.",
            detail="With less, bodies stick better and steps converge worse. Without friction it is not used.",
        ),
    )

    def __post_init__(self) -> None:
        check_fields(self)
        require_positive("gamma", self.gamma, "the medium's stiffness relative to the solid, try 1e-5")
        object.__setattr__(self, "alpha_r", chosen_weight(self.alpha_r, self.alpha))
        if not (math.isfinite(self.beta) and self.beta >= 0.0):
            raise InputError(
                f"beta = {self.beta:g} must not be negative: 5 damps as in the paper, 0 switches damping off"
            )
        if not (math.isfinite(self.log_j) and self.log_j >= 0.0):
            raise InputError(f"log_j = {self.log_j:g} must not be negative: 0 is the paper's medium, 1 has K = mu")
        self._check_friction()
        self.resolve()

    def _check_friction(self) -> None:
        if not (math.isfinite(self.friction) and self.friction >= 0.0):
            raise InputError(
                f"friction = {self.friction:g} must be 0 or a positive number: a coefficient such as 0.3, 0 for none"
            )
        _ = Friction(self.friction or 1.0, self.elastic_slip)

    @property
    def coulomb(self) -> Friction | None:
        """Friction in it, if there is some."""
        return Friction(self.friction, self.elastic_slip) if self.friction > 0.0 else None

    def resolve(self) -> tuple[Regulariser, dict[str, float]]:
        """The regulariser itself and the values of its own parameters.

        A file is executed once, when the medium is made: what becomes of it during a run changes nothing.
        """
        return self._resolved

    @cached_property
    def _resolved(self) -> tuple[Regulariser, dict[str, float]]:
        return resolve_regulariser(self.regulariser, self.parameters)

    def __getstate__(self) -> dict[str, Any]:
        """What is sent to other processes: functions of a file are not, they are found there again."""
        return {name: value for name, value in vars(self).items() if name != "_resolved"}

    def weight(self, mu: float, h: float | None) -> float:
        """alpha_r, given or from alpha.

        Args:
            mu: shear modulus that gamma multiplies.
            h: initial width of the gap, if it is known.

        Raises:
            InputError: alpha is given, and the width is not known.
        """
        if self.alpha is None:
            assert self.alpha_r is not None
            return self.alpha_r
        if h is None:
            raise InputError(f"alpha = {self.alpha:g} needs the width h of the gap: give it, or alpha_r instead")
        require_positive("h", h, "the initial width of the gap, a length")
        return self.alpha * mu * h**2

    def values(self, mu: float, h: float | None = None) -> dict[str, float]:
        """Values of the parameters of its energy.

        Args:
            mu: shear modulus that gamma multiplies.
            h: initial width of the gap, if it is known.

        Raises:
            InputError: alpha is given, and the width is not known.
        """
        values = {"mu": mu, "gamma": self.gamma, "alpha_r": self.weight(mu, h), "beta": self.beta, **self.resolve()[1]}
        if self.log_j > 0.0:
            values["log_j"] = self.log_j
        return values

    def as_dict(self, mu: float | None = None, h: float | None = None) -> dict[str, Any]:
        """Inputs as plain values for result files; with ``mu`` and ``h`` also the alpha_r that alpha makes."""
        regulariser, parameters = self.resolve()
        made = self.alpha_r if mu is None else self.weight(mu, h)
        return {
            "gamma": self.gamma,
            **({} if made is None else {"alpha_r": made}),
            **({} if self.alpha is None else {"alpha": self.alpha}),
            **({} if self.alpha is None or h is None else {"h": h}),
            "beta": self.beta,
            **({} if self.energy == PAPER_MEDIUM else {"energy": self.energy}),
            **({} if self.log_j == 0.0 else {"log_j": self.log_j}),
            **({} if self.coulomb is None else {"friction": self.friction, "elastic_slip": self.elastic_slip}),
            "regulariser": self.regulariser if isinstance(self.regulariser, str) else regulariser.name,
            **({"parameters": parameters} if parameters else {}),
        }


def chosen_weight(alpha_r: float | None, alpha: float | None) -> float | None:
    """alpha_r, 1 if neither it nor alpha is given; None if alpha is.

    Raises:
        InputError: both are given, or one is not positive.
    """
    if alpha_r is not None and alpha is not None:
        raise InputError(
            f"alpha = {alpha:g} and alpha_r = {alpha_r:g} say one thing in two ways, alpha_r = alpha mu h^2: give one"
        )
    if alpha is not None:
        require_positive("alpha", alpha, "alpha_r / (mu h^2) with the gap's width h, try 2.5")
        return None
    chosen = 1.0 if alpha_r is None else alpha_r
    require_positive("alpha_r", chosen, "the weight of the regulariser, try 1")
    return chosen
