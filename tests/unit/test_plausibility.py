"""Results that look converged and should not be quoted as they are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from tmc_vem import Box, Medium, run
from tmc_vem.results.plausibility import ERROR, WARNING, Evidence, Finding, by_weight, findings_of
from tmc_vem.results.records import StepRecord

SIZE = 2.0


def record(load: float = 1.0, **changes: Any) -> StepRecord:
    values: dict[str, Any] = {
        "step": 1, "load": load, "displacement": -load, "probes": {}, "reaction": -1.0, "iterations": 3, "cut_backs": 0,
        "wasted_iterations": 0, "min_j": {"solid": 0.8, "medium": 0.01}, "energy": {"solid": 1.0, "medium": 0.01},
        "negative_pivots": 0, "jumped": False, "seconds": 0.0,
    }  # fmt: skip
    return StepRecord(**{**values, **changes})


def open_gap(load: float, reaction: float, share: float, **changes: Any) -> StepRecord:
    """A step before contact, in which the medium takes a share of the work."""
    energy = {"solid": (1.0 - share) * load * abs(reaction) / 2, "medium": share * load * abs(reaction) / 2}
    return record(load, reaction=reaction, min_j={"solid": 0.9, "medium": 0.9}, energy=energy, **changes)


def findings(
    *history: StepRecord, inputs: Mapping[str, Any] | None = None, checks: Mapping[str, Any] | None = None
) -> list[Finding]:
    return findings_of(Evidence(inputs or {"medium": {"gamma": 1e-5}}, history, checks or {}, ["medium"], SIZE))


def test_a_good_result_has_no_warnings() -> None:
    assert findings(open_gap(0.1, -0.1, 0.01), record()) == []
    assert findings() == []


@pytest.mark.parametrize(
    ("history", "message"),
    [
        ([record(negative_pivots=2)], "unstable"),
        ([record(0.5, jumped=True), record()], "jumped to another one at load 0.5"),
        ([record(min_j={"solid": 0.1, "medium": 0.01})], "smallest J in region 'solid' is 0.1, below 0.2"),
        ([record(min_j={"solid": 0.8, "medium": 1e-7})], "smallest J in region 'medium' is 1e-07, below 1e-06"),
        ([record(energy={"solid": 1.0, "medium": 0.1})], "9.1% of the final reaction squeezes the medium"),
        ([record(0.5), record(energy={"solid": 1.8, "medium": 0.21})], "20% of the final reaction squeezes the medium"),
        ([open_gap(0.1, -0.2, 0.5), record()], "the medium alone gives 10% of the final reaction (0.1 of 1;"),
        ([open_gap(0.1, -0.2, 0.5)], "before contact (load 0.1) the medium alone gives 50% of the final reaction"),
        (
            [record(0.5, parameters={"gamma": 1e-3}), record(parameters={"gamma": 1e-5})],
            "steps at loads 0.5 to 0.5 have a stiffer medium",
        ),
    ],
)  # fmt: skip
def test_doubtful_results_are_said(history: list[StepRecord], message: str) -> None:
    (finding,) = findings(*history)
    assert message in finding.text
    assert finding.severity == WARNING


def test_cells_that_are_inverted_between_the_points_are_said() -> None:
    (finding,) = findings(record(), checks={"inverted_cells": {"medium": 3, "solid": 1}, "inverted_from": 0.25})
    assert "J < 0 between the quadrature points in 3 cells of 'medium' and 1 cell of 'solid'" in finding.text
    assert "(seen first at load 0.25)" in finding.text
    assert finding.severity == WARNING
    assert findings(record(), checks={"inverted_cells": {}}) == []


def test_what_jumps_lost_is_said() -> None:
    """Half of the energy of a spring."""
    history = [
        record(0.5, energy={"solid": 0.25, "medium": 0.0}, load_force=1.0),
        record(0.5, energy={"solid": 0.125, "medium": 0.0}, load_force=0.5, jumped=True),
    ]
    (finding,) = findings(*history)
    assert "jumped to another one at load 0.5; 0.12 of energy was lost, where 0.25 is stored at most" in finding.text


def test_a_body_that_moves_freely_before_contact_is_no_reason_to_warn() -> None:
    """All of the work goes into the medium then, and next to nothing of the reaction that is quoted."""
    assert findings(open_gap(0.5, -1e-3, 1.0), record()) == []


def test_unloading_does_not_take_the_reaction_that_is_compared_with() -> None:
    start, top = open_gap(0.1, -0.01, 1.0), record(1.0)
    back = open_gap(0.0, -1e-9, 1.0)
    assert findings(start, top, back) == []


def test_steps_that_say_nothing_about_the_final_reaction() -> None:
    """A jump, or a change of gamma, changes energies without work at the load."""
    many = {"solid": 1.0, "medium": 0.9}
    assert all("squeezes" not in f.text for f in findings(record(0.9), record(energy=many, jumped=True)))
    soft, stiff = {"gamma": 1e-5}, {"gamma": 1e-3}
    inputs = {"medium": {"gamma": 1e-5}, "continuation": stiff}
    assert findings(record(parameters=stiff), record(energy=many, parameters=soft), inputs=inputs) == []


@pytest.mark.parametrize(
    "inputs", [{"medium": {"gamma": 1e-5}}, {"regions": {"medium a": {"medium": {"gamma": 1e-5}}, "block": {}}}]
)
def test_a_gamma_that_was_not_brought_back_is_an_error(inputs: dict[str, Any]) -> None:
    (finding,) = findings(record(parameters={"gamma": 3e-4}), inputs=inputs)
    assert finding == Finding(ERROR, "the last state has gamma = 0.0003, not 1e-05: it was not yet brought back")
    assert findings(record(parameters={"gamma": 1e-5}), inputs=inputs) == []


def test_overlaps_are_errors_whatever_the_size() -> None:
    checks = {"penetration_depth": 1e-3, "overlap_area": 0.0, "summary": "solids overlap"}
    assert findings(record(), checks=checks)[0].severity == ERROR
    assert findings(record(), checks={**checks, "penetration_depth": 1e-9}) == []
    assert findings(record(), checks={**checks, "penetration_depth": 0.0, "overlap_area": 0.9e-6 * SIZE**2}) == []
    assert findings(record(), checks={**checks, "penetration_depth": 0.0, "overlap_area": 1.1e-6 * SIZE**2})


def test_errors_come_first_and_the_weightiest_of_them_at_the_top() -> None:
    checks = {"penetration_depth": 1e-3, "overlap_area": 0.0, "summary": "solids overlap"}
    last = record(negative_pivots=1, parameters={"gamma": 0.05}, min_j={"solid": 0.1, "medium": 0.01})
    inputs = {"medium": {"gamma": 0.02}}
    texts = [finding.text for finding in findings(record(0.5, jumped=True), last, inputs=inputs, checks=checks)]
    starts = ("solids overlap", "the last state has gamma", "the last state is unstable", "the equilibrium branch",
              "smallest J in region 'solid'", "gamma = 0.02")  # fmt: skip
    assert [text.startswith(start) for text, start in zip(texts, starts, strict=True)] == [True] * len(starts)
    assert [f.severity for f in by_weight([Finding(WARNING, ""), Finding(ERROR, "")])] == [ERROR, WARNING]


def test_large_gamma_of_any_medium_is_said_once() -> None:
    regions = {"medium": {"medium": {"gamma": 0.05}}, "medium 2": {"medium": {"gamma": 1e-3}}}
    (finding,) = findings(record(), inputs={"medium": {"gamma": 0.05}, "regions": regions})
    assert "gamma = 0.05 is above 0.01" in finding.text


def test_a_run_says_them() -> None:
    stiff = run(Box(cells=(20, 5), uy=-0.2, medium=Medium(gamma=0.05)))
    assert any("gamma = 0.05" in text for text in stiff.warnings)
    assert any("before contact" in text for text in stiff.warnings)
    assert not stiff.errors
    soft = run(Box(cells=(20, 5), uy=-0.2, medium=Medium(gamma=1e-6)))
    assert list(soft.warnings) == []
    assert list(soft.errors) == []


# -- problems with several media --------------------------------------------------------------------------------------

MEDIA = ["medium", "medium b"]
BOTH = {"regions": {"block": {"solid": {"K": 1.0}}, "medium": {"medium": {"gamma": 1e-5}},
                    "medium b": {"medium": {"gamma": 1e-4}}}}  # fmt: skip


def of_two(first: tuple[float, float], second: tuple[float, float], load: float = 1.0, **changes: Any) -> StepRecord:
    """A step with smallest J and energy of each medium; the solid has the rest of 1."""
    min_j = {"solid": 0.8, "medium": first[0], "medium b": second[0]}
    energy = {"solid": 1.0 - first[1] - second[1], "medium": first[1], "medium b": second[1]}
    return record(load, min_j=min_j, energy=energy, **changes)


@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize(
    ("history", "message"),
    [
        ([((0.4, 0.0), (1e-7, 0.0), {})], "below 1e-06"),
        ([((0.4, 0.0), (0.01, 0.06), {})], "6.0% of the final reaction squeezes the medium"),
        ([((0.4, 0.03), (0.01, 0.03), {})], "6.0% of the final reaction squeezes the medium"),
        (
            [((0.9, 0.0), (0.9, 0.9), {"load": 0.1, "reaction": -0.2}), ((0.4, 0.0), (0.4, 0.01), {})],
            "before contact (load 0.1) the medium alone gives 18%",
        ),
    ],
)
def test_every_medium_is_judged(history: list[Any], message: str, swap: bool) -> None:
    steps = [of_two(*((b, a) if swap else (a, b)), **more) for a, b, more in history]
    (finding,) = findings_of(Evidence(BOTH, steps, {}, MEDIA, SIZE))
    assert message in finding.text


@pytest.mark.parametrize("swap", [False, True])
def test_one_medium_that_is_squeezed_is_enough(swap: bool) -> None:
    """Then what the other one takes is no parasitic reaction before contact."""
    first, second = (0.9, 0.5), (0.4, 0.0)
    steps = [of_two(*((second, first) if swap else (first, second)), load=0.1, reaction=-0.5), of_two((0.4, 0), (1, 0))]
    assert findings_of(Evidence(BOTH, steps, {}, MEDIA, SIZE)) == []


@pytest.mark.parametrize("which", MEDIA)
def test_large_gamma_and_other_parameters_of_any_medium(which: str) -> None:
    regions = {**BOTH["regions"], which: {"medium": {"gamma": 0.02}}}
    (finding,) = findings_of(Evidence({"regions": regions}, [], {}, MEDIA, SIZE))
    assert finding.text.startswith("gamma = 0.02 is above")
    wanted = BOTH["regions"][which]["medium"]["gamma"]
    steps = [of_two((0.4, 0.0), (0.4, 0.0), parameters={"gamma": wanted})]
    assert findings_of(Evidence(BOTH, steps, {}, MEDIA, SIZE)) == []


def test_a_run_has_all_of_its_media_judged(monkeypatch: pytest.MonkeyPatch) -> None:
    """A box whose medium is two regions."""
    import dataclasses

    from tmc_vem.problems.base import media_of
    from tmc_vem.problems.wrapped import Wrapped
    from tmc_vem.simulation import recorder

    class Halves(Wrapped):
        def regions(self) -> Any:
            regions = self.problem.regions()
            return {**regions, "medium b": regions["medium"]}

        def make_mesh(self) -> Any:
            mesh = self.problem.make_mesh()
            right = [mesh.points_vx[loop].mean(axis=0)[0] > 1.0 for loop in mesh.cells()]
            number = mesh.region_names.index("medium")
            region_c = [2 if r == number and at else r for r, at in zip(mesh.region_c, right, strict=True)]
            return dataclasses.replace(mesh, region_c=np.array(region_c), region_names=(*mesh.region_names, "medium b"))

    seen: list[Evidence] = []
    monkeypatch.setattr(recorder, "findings_of", lambda evidence: seen.append(evidence) or [])
    problem = Halves(Box(cells=(20, 5), uy=-0.01))
    run(problem)
    assert list(seen[0].media) == ["medium", "medium b"] == media_of(problem)
    assert set(seen[0].history[-1].energy) == {"solid", "medium", "medium b"}


# -- limits, and all that is said ------------------------------------------------------------------------------------


def texts(*history: StepRecord, complete: bool = True, media: Any = ("medium",), **more: Any) -> list[str]:
    inputs, checks = more.get("inputs", {"medium": {"gamma": 1e-5}}), more.get("checks", {})
    return [finding.text for finding in findings_of(Evidence(inputs, history, checks, media, SIZE, complete))]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"negative_pivots": 2}, ["the last state is unstable (2 negative pivots): there may be others"]),
        ({"negative_pivots": None}, []),
        ({"min_j": {"solid": 0.2, "medium": 1e-6}}, []),
        ({"min_j": {"solid": 0.199, "medium": 1e-6}},
         ["smallest J in region 'solid' is 0.2, below 0.2: use smaller cells there"]),
        ({"min_j": {"medium": 0.9e-6, "solid": 0.1}},
         ["smallest J in region 'solid' is 0.1, below 0.2: use smaller cells there",
          "smallest J in region 'medium' is 9e-07, below 1e-06: use smaller cells there"]),
        ({"energy": {"solid": 1.0, "medium": 0.0526}}, []),
        ({"energy": {"solid": 1.0, "medium": 0.0527}},
         ["5.0% of the final reaction squeezes the medium and not the bodies (more than 5% counts; it is off by about "
          "as much): use a smaller gamma or alpha_r, or cite the limit that extrapolate_gamma gives"]),
        ({"energy": {"solid": -1.0, "medium": 1.5}},
         ["100% of the final reaction squeezes the medium and not the bodies (more than 5% counts; it is off by about "
          "as much): use a smaller gamma or alpha_r, or cite the limit that extrapolate_gamma gives"]),
        ({"energy": {"solid": 0.0, "medium": 0.0}}, []),
        ({"energy": {"solid": 0.1, "medium": 0.9}, "min_j": {"medium": 0.5}, "parameters": {"gamma": 1e-5}}, []),
    ],
)  # fmt: skip
def test_what_is_said_of_a_last_state(changes: dict[str, Any], said: list[str]) -> None:
    assert texts(record(**changes)) == said


@pytest.mark.parametrize(
    ("share", "said"),
    [
        (0.049, None),
        (0.051, "before contact (load 0.5) the medium alone gives 5.1% of the final reaction (0.051 of 1; more than 5% "
         "counts): use a smaller gamma"),
        (0.25, "before contact (load 0.5) the medium alone gives 25% of the final reaction (0.25 of 1; more than 5% "
         "counts): use a smaller gamma"),
    ],
)  # fmt: skip
def test_the_medium_before_contact(share: float, said: str | None) -> None:
    """Not of a run that stopped, nor without a medium, a reaction or energy."""
    before = open_gap(0.5, -2.0, share / 2.0)
    assert texts(before, record()) == ([said] if said else [])
    assert texts(before, record(), complete=False) == []
    assert texts(before, record(min_j={"solid": 0.8, "medium": 0.3}), media=()) == []
    assert texts(before, record(reaction=0.0)) == []
    soft = {"parameters": {"gamma": 1e-5}}
    assert texts(open_gap(0.5, -2.0, share / 2.0, **soft), record(**soft)) == []
    assert texts(record(0.5, min_j={"solid": 1.0, "medium": 1.0}, energy={"solid": 0.0, "medium": 0.0}), record()) == []


@pytest.mark.parametrize("load", [0.3, 0.1])
def test_the_last_state_before_contact_counts(load: float) -> None:
    history = [open_gap(0.1, -0.5, 0.9), open_gap(0.3, -0.5, 0.02), record(0.5), open_gap(0.8, -1.0, 0.9), record()]
    assert texts(*history) == []
    history[1] = record(0.3)
    assert texts(*history)[0].startswith("before contact (load 0.1)")


def test_the_reaction_that_is_quoted_is_that_of_the_largest_load_and_the_last_such_one() -> None:
    evidence = Evidence({}, [record(load) for load in (0.5, -1.0, 1.0 - 1e-12, 1.0 - 1e-6, 0.0)], {}, [], SIZE)
    assert evidence.quoted == 2


def test_the_medium_in_contact_is_judged_by_the_last_step_to_the_quoted_load() -> None:
    """A fifth of what the step adds is of the medium; nothing is said where the step did no work at the load."""
    before = record(0.5, energy={"solid": 1.0, "medium": 0.1})
    now = record(energy={"solid": 1.8, "medium": 0.3})
    (said,) = texts(before, now)
    assert said.startswith("20% of the final reaction squeezes")
    for changes in ({"parameters": {"gamma": 1e-5}}, {"displacement": -0.5}, {"jumped": True},
                    {"min_j": {"solid": 0.8, "medium": 0.5}}, {"forces": {"push": {"force_y": 1.0}}}):  # fmt: skip
        assert not any("squeezes" in text for text in texts(before, record(**{**vars(now), **changes})))
    spring = record(**{**vars(now), "forces": {"pad": {"force_y": 1.0, "energy": 2.0}}})
    assert texts(before, spring) == [said]
    open_medium = record(**{**vars(now), "min_j": {"solid": 0.8, "medium": 0.3}})
    assert texts(before, now, complete=False) == texts(before, open_medium, media=()) == []
    assert texts(now, before) == [
        "14% of the final reaction squeezes the medium and not the bodies (more than 5% counts; it is off by about as "
        "much): use a smaller gamma or alpha_r, or cite the limit that extrapolate_gamma gives"
    ]  # fmt: skip


@pytest.mark.parametrize(("n", "at"), [(1, "0.1"), (4, "0.1, 0.2, 0.3, 0.4"), (5, "0.1, 0.2, 0.3, 0.4 and 1 more")])
def test_loads_of_jumps(n: int, at: str) -> None:
    history = [record(0.1 * (i + 1), jumped=True, load_force=None) for i in range(n)]
    assert texts(*history, record()) == [f"the equilibrium branch ended and the run jumped to another one at load {at}"]


def test_overlap_is_said_with_its_summary() -> None:
    checks = {"penetration_depth": None, "overlap_area": 1.0, "summary": "solids overlap: much"}
    assert texts(record(), checks=checks) == [
        "solids overlap: much: use smaller cells there or more medium around sharp corners"
    ]


def test_stiffer_steps_and_other_parameters() -> None:
    soft, stiff = {"gamma": 1e-5}, {"gamma": 1e-3}
    history = [record(0.25, parameters=stiff), record(0.75, parameters=stiff), record(parameters=soft)]
    said = "steps at loads 0.25 to 0.75 have a stiffer medium, as the branch ended (parameter_* in history.csv)"
    assert texts(*history) == [said]
    assert texts(*history, inputs={"medium": {"gamma": 1e-5}, "continuation": stiff}) == []
    assert texts(record(0.25), record(parameters=soft)) == []
    off = texts(record(parameters={"gamma": 1e-5 * (1 + 2e-9)}))
    assert off == ["the last state has gamma = 1e-05, not 1e-05: it was not yet brought back"]
    assert texts(record(parameters={"gamma": 1e-5 * (1 + 5e-10)})) == []
    assert texts(record(parameters={"beta": 1.0})) == []


@pytest.mark.parametrize(("gamma", "said"), [(1e-2, []), (1.1e-2, ["gamma = 0.011 is above 0.01: the medium acts as a "
                                                                  "body of its own; use 1e-3 or less"])])  # fmt: skip
def test_large_gamma(gamma: float, said: list[str]) -> None:
    assert texts(record(), inputs={"medium": {"gamma": gamma}}) == said
    assert texts(record(), inputs={"regions": {"a": {"medium": {"gamma": gamma}}, "b": 3}}) == said


def test_inverted_cells() -> None:
    assert texts(record(), checks={"inverted_cells": {"medium": 1, "solid": 2}}) == [
        "J < 0 between the quadrature points in 1 cell of 'medium' and 2 cells of 'solid': a corner may go through the "
        "medium there; use smaller cells, or round it"
    ]
