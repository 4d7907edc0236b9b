"""How far limits for gamma to 0 are to be trusted: the measurements behind docs/howto/limit.md.

    python benchmarks/gamma_limit.py

Along the path of some problems gamma is lowered by more decades than a limit takes. Of the values at each load every
five that follow each other give a limit with its uncertainty, from their own gamma; what the values come to with the
smallest gammas tells whether it holds. The page's table is made by ``scripts/refresh-numbers docs/howto/limit.md``.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from tmc_vem.problems import Box, CBox, Medium, Problem
from tmc_vem.problems.cbox import angle_medium
from tmc_vem.results.extrapolation import EXPONENT, NEEDED, PER_DECADE, Estimate, estimate
from tmc_vem.results.limit import reported
from tmc_vem.simulation import RunOptions, run
from tmc_vem.simulation.problem_file import read_problem

GAMMA, DECADES = 1e-3, 4
# A round body is pressed onto a block: half a cylinder of radius 1, with medium around the contact.
HERTZ = """
name = "hertz"
gap = ["tip", "ground"]
[shapes]
block = { rectangle = [-0.8, 0, 0.8, 0.8] }
disc = { disc = [0, 1.86, 1.0] }
above = { rectangle = [-0.6, 0.8, 0.6, 1.4] }
[regions.block]
shape = "block"
solid = { E = 10, nu = 0.3 }
[regions.cylinder]
shape = "disc & above"
solid = { E = 10, nu = 0.3 }
[regions.medium]
shape = "above - disc"
medium = { energy = "balanced", regulariser = "angle_log", alpha_r = 0.05, gamma = 1e-3 }
[mesh]
cells = "voronoi"
size = 0.12
refine = [ { near = [[-0.3, 0.81], [0.3, 0.81]], size = 0.028, within = 0.05 } ]
[points]
tip = [0, 0.86]
ground = [0, 0.8]
[edges]
bottom = { line = [[-0.8, 0], [0.8, 0]] }
top = { line = [[-0.6, 1.4], [0.6, 1.4]] }
[[support]]
at = "bottom"
ux = 0
uy = 0
[[support]]
at = "top"
ux = 0
[load]
at = "top"
uy = -0.16
[probes.side]
displacement = "ux"
at = [0.6, 1.2]
"""
PROBLEMS = ("box", "C-box", "Hertz")
# The limit from smaller gammas has to be known to this part of the whole change with gamma to judge another one.
KNOWN = 0.003
OCCUR = (0.3, 1.3)  # exponents between which values follow a power of gamma


def problem(name: str) -> Problem:
    """One of ``PROBLEMS``."""
    if name == "box":
        return Box(cells=(20, 10), medium=Medium(gamma=GAMMA), uy=-1.0)
    if name == "C-box":
        return CBox(medium=angle_medium(GAMMA, 1.0), uy=-0.6, medium_refinement=2)
    with TemporaryDirectory() as directory:
        path = Path(directory) / "hertz.toml"
        path.write_text(HERTZ)
        return read_problem(path)[0]


def values_by_gamma(name: str) -> list[dict[str, Any]]:
    """Everything that is reported along the path of a problem, at each load by gamma, half a decade apart."""
    result = run(problem(name), None, RunOptions(extrapolate_gamma="path", gamma_decades=DECADES, snapshots=0))
    factors = [10.0 ** (-k / PER_DECADE) for k in range(PER_DECADE * DECADES + 1)]
    found = []
    for start in result.history:
        below = [record for record in result.lowered if record.limit_of == start.step]
        at = [
            start,
            *(r for f in factors[1:] for r in below if np.isclose(r.parameters["gamma"], f * GAMMA, rtol=1e-9)),
        ]
        stable = list(itertools.takewhile(lambda record: not (record.negative_pivots or record.jumped), at))
        said = [reported(record) for record in stable]
        everywhere = [key for key in reported(start) if all(key in record for record in said)]
        values = {key: [record[key] for record in said] for key in everywhere}
        if below:
            found.append({"load": start.load, "values": values})
    return found


@dataclass(frozen=True)
class Case:
    """A limit that is judged.

    Attributes:
        load, name, gamma: of what, and from which gamma on.
        truth: what it comes to with smaller gammas.
        change: how far the first value is from that.
        made: the limit.
        plain: that of the exponent 3/5 from the last two values a decade apart, and its distance from that of the first
            two.
    """

    load: float
    name: str
    gamma: float
    truth: float
    change: float
    made: Estimate
    plain: tuple[float, float]

    @property
    def covered(self) -> bool:
        """Whether the truth is within the uncertainty."""
        made = self.made
        return made.value is not None and abs(made.value - self.truth) <= (made.uncertainty or 0.0)

    @property
    def covered_by_plain(self) -> bool:
        """The same for the distance of the two limits with the exponent 3/5."""
        value, uncertainty = self.plain
        return abs(value - self.truth) <= uncertainty

    @property
    def width(self) -> float:
        """Uncertainty over the change with gamma."""
        return (self.made.uncertainty or 0.0) / self.change


def cases(chains: list[Mapping[str, Any]]) -> Iterator[Case]:
    """All limits of values whose own limit is known well enough."""
    for chain in chains:
        for name, values in chain["values"].items():
            v = _regular(np.array(values))
            found = _truth(v)
            for first in range(len(v) - NEEDED):
                window = v[first : first + NEEDED]
                if found is None or found[1] > KNOWN * abs(window[0] - found[0]):
                    continue
                limits = [
                    b - (a - b) / (10.0**EXPONENT - 1.0) for a, b in ((window[0], window[2]), (window[2], window[4]))
                ]
                plain = (float(limits[1]), abs(float(limits[1] - limits[0])))
                gamma = GAMMA * 10.0 ** (-first / PER_DECADE)
                change = abs(float(window[0]) - found[0])
                yield Case(chain["load"], name, gamma, found[0], change, estimate(window.tolist()), plain)


def _regular(v: Any) -> Any:
    """The values up to one that follows no power of gamma: the medium has buckled there, on the coarse meshes of this
    study at gammas below 1e-6."""
    changes = v[:-1] - v[1:]
    with np.errstate(all="ignore"):
        exponents = PER_DECADE * np.log10(changes[:-1] / changes[1:])
    odd = np.flatnonzero(~((exponents > OCCUR[0]) & (exponents < OCCUR[1])))
    return v[: odd[0] + 2] if len(odd) else v


def _truth(v: Any) -> tuple[float, float] | None:
    """Limit of the smallest gammas by Aitken's rule, and how far three of them lie apart."""
    changes = v[:-1] - v[1:]
    if len(v) < NEEDED + 2 or (changes[:-1] * changes[1:] <= 0.0).any():
        return None
    limits = (v[2:] - changes[1:] / (changes[:-1] / changes[1:] - 1.0))[-3:]
    return float(np.median(limits)), float(np.ptp(limits)) / 2.0


def main() -> None:
    """Print every limit that is not covered, and how many are."""
    for name in PROBLEMS:
        found = list(cases(values_by_gamma(name)))  # type: ignore[arg-type]
        for case in found:
            if not case.covered:
                print(f"{name}, load {case.load:.3g}, {case.name} from {case.gamma:.0e}: {case.made}, {case.truth:.7g}")
        covered, plain = sum(case.covered for case in found), sum(case.covered_by_plain for case in found)
        width = np.median([case.width for case in found])
        print(f"{name}: {covered} of {len(found)} covered, width {width:.2%} of the change; plain {plain}", flush=True)


if __name__ == "__main__":
    main()
