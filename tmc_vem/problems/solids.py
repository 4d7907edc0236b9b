"""What solids are made of, as users say it: a model by name, moduli at small strains, constants of the model."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

from tmc_vem.energy import hyperelastic_solid
from tmc_vem.energy.solids import LOG, MODELS, NEO_HOOKE, VOLUMETRIC, SolidModel
from tmc_vem.problems.moduli import NAMES, Moduli, converted, moduli
from tmc_vem.support.errors import InputError
from tmc_vem.support.settings import about, described
from tmc_vem.support.validation import check_fields, key_of, require_finite, require_positive

# Constants that are a force per area, as K, mu, E and lambda are
_STRESSES = ("K", "mu", "E", "lambda_", "c10", "c01", "c1", "c2", "c3", "mu_r")
_PLAIN = {"K", "mu"}  # what a solid without more is given by, which is also what its energy takes


@described
@dataclass(frozen=True)
class Material:
    """Hyperelastic solid, by default (2) with bulk modulus K and shear modulus mu.

    Two of K, mu, E, nu and lambda say the moduli at small strains, which mean the same in all models. Constants of a
    model that fix mu stand for it: ``Material(model="yeoh", c1=0.5, c2=-0.02, c3=0.003, nu=0.49)``.
    """

    K: float | None = field(default=None, metadata=about("Bulk modulus, force per area."))
    mu: float | None = field(default=None, metadata=about("Shear modulus, force per area."))
    model: str = field(default=NEO_HOOKE, metadata=about("Hyperelastic model.", choices=tuple(MODELS)))
    volumetric: str = field(
        default=LOG,
        metadata=about(
            "Volumetric part: log is K/2 (ln J)^2 of (2), quadratic K/2 (J - 1)^2, simo_taylor K/4 (J^2 - 1 - 2 ln J).",
            choices=tuple(VOLUMETRIC),
        ),
    )
    E: float | None = field(default=None, metadata=about("Young's modulus, force per area."))
    nu: float | None = field(default=None, metadata=about("Poisson's ratio, below 0.5."))
    lambda_: float | None = field(
        default=None, metadata=about("Lame's first modulus, force per area; 'lambda' in problem files.")
    )
    c10: float | None = field(default=None, metadata=about("Mooney-Rivlin: mu = 2 (c10 + c01); one, or both for mu."))
    c01: float | None = field(default=None, metadata=about("Mooney-Rivlin: see c10."))
    c1: float | None = field(default=None, metadata=about("Yeoh: mu/2, in place of it."))
    c2: float | None = field(default=None, metadata=about("Yeoh: of (I1b - 3)^2."))
    c3: float | None = field(default=None, metadata=about("Yeoh: of (I1b - 3)^3."))
    J_m: float | None = field(default=None, metadata=about("Gent: I1b - 3 at which it locks."))
    lambda_m: float | None = field(default=None, metadata=about("Arruda-Boyce: stretch at which its chains lock."))
    mu_r: float | None = field(default=None, metadata=about("Arruda-Boyce: rubbery modulus n k T, in place of mu."))

    def __post_init__(self) -> None:
        check_fields(self)
        _ = self.values

    @property
    def of(self) -> SolidModel:
        """The model itself."""
        return MODELS[self.model]

    @cached_property
    def moduli(self) -> Moduli:
        """K and mu at small strains; gamma of a medium multiplies this mu."""
        constants = self._constants
        given = {key_of(name): value for name, value in self._given.items() if key_of(name) in NAMES}
        mu = self.of.shear_modulus(constants)
        if mu is None:
            return moduli(given)
        fixed = " and ".join(f"{name} = {value:g}" for name, value in constants.items())
        if len(given) != 1 or "mu" in given:
            raise InputError(
                f"{fixed} make mu = {mu:g}, so give one of K, nu, E and lambda besides, not "
                f"{' and '.join(given) or 'none'}"
            )
        require_positive("mu", mu, f"the shear modulus at small strains, from {fixed}")
        return moduli({**given, "mu": mu})

    @cached_property
    def values(self) -> dict[str, float]:
        """Values of the parameters of its energy.

        Raises:
            InputError: moduli or constants are missing, too many, not those of the model, or out of range.
        """
        of, constants = self.of, self._constants
        if of.density is not None and self.volumetric != LOG:
            raise InputError(f"volumetric = '{self.volumetric}' is not for {self.model}, which has no such part")
        made = {"K": self.moduli.K, **of.values(self.moduli.mu, constants)}
        return {name: made[name] for name in hyperelastic_solid(self.model, self.volumetric).parameters}

    @cached_property
    def _given(self) -> dict[str, float]:
        """Numbers that were given, by the names of their fields."""
        found = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in ("model", "volumetric")}
        return {name: value for name, value in found.items() if value is not None}

    @cached_property
    def _constants(self) -> dict[str, float]:
        of = self.of
        constants = {name: value for name, value in self._given.items() if key_of(name) not in NAMES}
        for name, value in constants.items():
            if name not in of.constants:
                owner = next(model.name for model in MODELS.values() if name in model.constants)
                has = ", ".join(of.constants) or "no constants of its own"
                raise InputError(f"{name} = {value:g} belongs to model '{owner}'; {self.model} has {has}")
            require_finite(name, value)
        missing = [name for name in of.needed if name not in constants]
        if missing:
            raise InputError(f"{self.model} lacks '{missing[0]}': it takes two moduli and {', '.join(of.constants)}")
        if self.model == "mooney_rivlin" and not constants:
            raise InputError("mooney_rivlin lacks 'c01' or 'c10': mu = 2 (c10 + c01), so give one of them or both")
        _check(constants)
        return constants

    @property
    def numbers(self) -> dict[str, float]:
        """The numbers that were given, by their names in problem files."""
        return {key_of(name): value for name, value in self._given.items()}

    def with_numbers(self, numbers: Mapping[str, float]) -> Material:
        """The same with other numbers in their place."""
        values: dict[str, Any] = {name: numbers[key_of(name)] for name in self._given}
        return replace(self, **values)

    def values_of_cells(self, numbers: Mapping[str, Any]) -> dict[str, Any]:
        """:attr:`values` for numbers that may be arrays (n_cells,); nothing is checked."""
        constants = {name: value for name, value in numbers.items() if name not in NAMES}
        given = {name: value for name, value in numbers.items() if name in NAMES}
        mu = self.of.shear_modulus(constants)
        K, mu = converted(given if mu is None else {**given, "mu": mu})
        made = {"K": K, **self.of.values(mu, constants)}
        return {name: made[name] for name in self.values}

    def stiffer(self, factor: float) -> Material:
        """The same with all moduli times a factor."""
        scaled: dict[str, Any] = {name: factor * value for name, value in self._given.items() if name in _STRESSES}
        return replace(self, **scaled)

    def doubts(self) -> list[str]:
        """Where the model loses its stiffness, if that is known; without a subject, for a region to be put before."""
        values = self.values
        if self.model == "saint_venant_kirchhoff":
            return [
                "is a Saint Venant-Kirchhoff solid, which softens in compression (uniaxially below a stretch of 0.58): "
                "for small strains only"
            ]
        if self.model == "mooney_rivlin" and min(values["c10"], values["c01"]) < 0.0:
            # c10 J^(-2/3) + c01 J^(-4/3), the factor of F:F
            limit = (-values["c01"] / values["c10"]) ** 1.5
            side = "below" if values["c01"] < 0.0 else "above"
            said = f"c10 = {values['c10']:g} and c01 = {values['c01']:g}"
            return [f"has {said}: where J is {side} {limit:.3g} its energy has no lower bound"]
        if self.model == "yeoh":
            end = softening(values["c1"], values["c2"], values["c3"])
            if end is not None:
                return [f"has a Yeoh energy that decreases beyond J^(-2/3) I1 - 3 = {end:.3g}: it gives way there"]
        return []

    def as_dict(self) -> dict[str, Any]:
        """Inputs as plain values for result files; ``made`` is what they became, if that is something else."""
        names = {
            **({} if self.model == NEO_HOOKE else {"model": self.model}),
            **({} if self.volumetric == LOG else {"volumetric": self.volumetric}),
        }
        given = self.numbers
        if not names and set(given) == _PLAIN:
            return dict(given)
        made = {"K": self.moduli.K, "mu": self.moduli.mu, **self.values}
        new = {name: value for name, value in made.items() if name not in given}
        return {**names, **given, **({"made": new} if new else {})}


def softening(c1: float, c2: float, c3: float) -> float | None:
    """The smallest ``x = I1b - 3 > 0`` where ``c1 + 2 c2 x + 3 c3 x^2``, the slope, vanishes; None if there is none."""
    if c3 == 0.0:
        return None if c2 >= 0.0 else -c1 / (2.0 * c2)
    root = c2 * c2 - 3.0 * c1 * c3
    if root < 0.0:
        return None
    ends = [(-c2 + sign * math.sqrt(root)) / (3.0 * c3) for sign in (1.0, -1.0)]
    return min((x for x in ends if x > 0.0), default=None)


def conversions(inputs: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What materials among the inputs of a result were given as and became: a heading and a line for each."""
    regions = {name: table.get("solid") for name, table in inputs.get("regions", {}).items()}
    named = {"material": inputs.get("material")}
    found = named | {f"material, {name}": solid for name, solid in [*_bodies(inputs), *regions.items()]}
    lines = []
    for name, solid in found.items():
        if isinstance(solid, Mapping) and "made" in solid:
            given = {key: value for key, value in solid.items() if key not in ("made", "model", "volumetric")}
            words = [str(solid[key]) for key in ("model", "volumetric") if key in solid]
            lines.append((name, f"{', '.join([*words, _said(given)])}: {_said(solid['made'])}"))
    for name, table in inputs.get("regions", {}).items():
        if "graded" in table:
            formulas = ", ".join(f"{key} = {formula}" for key, formula in table["graded"].items())
            lines.append((f"graded, {name}", f"{formulas} in every cell"))
    return lines


def _bodies(inputs: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """Materials of the problem with several bodies."""
    return [(name, inputs.get(name)) for name in ("beam", "disc")]


def _said(values: Mapping[str, float]) -> str:
    return ", ".join(f"{name} = {value:g}" for name, value in values.items())


def _check(constants: Mapping[str, float]) -> None:
    """Ranges of the models' constants.

    Raises:
        InputError: one is out of its range.
    """
    for name, hint in (
        ("J_m", "I1b - 3 at which the Gent solid locks, 30 to 100 for rubber"),
        ("c1", "half the shear modulus of the Yeoh solid"),
        ("mu_r", "the rubbery modulus of the Arruda-Boyce solid"),
    ):
        if name in constants:
            require_positive(name, constants[name], hint)
    if "lambda_m" in constants and not constants["lambda_m"] > 1.0:
        raise InputError(
            f"lambda_m = {constants['lambda_m']:g} must be above 1: it is the stretch at which chains lock, 2 to 7 for "
            "rubber"
        )
