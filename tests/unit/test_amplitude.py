"""A prescribed displacement that is no multiple of the load factor, from the problem to its records."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import pytest

from tmc_vem import Box, Medium, RunOptions, run
from tmc_vem.problems.wrapped import Wrapped
from tmc_vem.system.constraints import Prescribed
from tmc_vem.system.control import Control


@dataclass(frozen=True)
class Squared:
    """The square of the load factor."""

    def at(self, position: Control) -> float:
        return position.load**2

    def per_load(self, position: Control) -> float:
        return 2.0 * position.load


@dataclass(frozen=True)
class SlowAtFirst(Wrapped):
    """A problem whose load grows with the square of the load factor."""

    def load(self) -> Prescribed:
        return replace(self.problem.load(), amplitude=Squared())

    def prescribed(self) -> Sequence[Prescribed]:
        plain = self.problem.load()
        return [self.load() if condition == plain else condition for condition in self.problem.prescribed()]


BOX = Box(cells=(20, 5), medium=Medium(gamma=1e-2), uy=-0.4)


@pytest.mark.parametrize("options", [RunOptions(steps=8), RunOptions(follow=True), RunOptions("fem", steps=8)])
def test_a_load_follows_its_amplitude(options: RunOptions) -> None:
    if options.method == "fem":
        pytest.importorskip("dolfinx")
    slow, plain = run(SlowAtFirst(BOX), options=options), run(BOX, options=replace(options, steps=None, follow=False))
    assert slow.complete
    for record in slow.history:
        assert record.displacement == pytest.approx(-0.4 * record.load**2, rel=1e-14)
        # what the load does per load factor: the force times the speed of the displacement
        assert record.load_force == pytest.approx(record.reaction * -0.8 * record.load, rel=1e-12)
    assert slow.history[-1].reaction == pytest.approx(plain.history[-1].reaction, rel=1e-7)
    assert slow.gap == pytest.approx(plain.gap, rel=1e-7)
    balance = slow.checks["energy_balance"]
    assert abs(balance["integration_error"]) < 0.03 * balance["stored"]
