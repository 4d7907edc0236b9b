"""Optimisers on closed-form problems: optima, histories against nlopt itself, exceptions, failures, restarts."""

from __future__ import annotations

import os
import signal
import warnings

import numpy as np
import pytest

from tmc_vem.design.evaluation import Evaluation
from tmc_vem.design.optimisers import minimise
from tmc_vem.design.replay import Replay
from tmc_vem.design.scaling import Scaling, stationarity
from tmc_vem.support.errors import InputError, Note

BENDING = np.array([61.0, 37.0, 19.0, 7.0, 1.0])
SVANBERG = np.array([6.0160, 5.3092, 4.4943, 3.5015, 2.1527])  # of the exact solution z_i ~ c_i^(1/4)


@pytest.fixture
def nlopt():
    return pytest.importorskip("nlopt")


def cantilever(z):
    """Five elements (Svanberg, IJNME 24 (1987) 359): weight, with the displacement of the tip limited."""
    return Evaluation(
        0.0624 * z.sum(), np.full(5, 0.0624), np.array([(BENDING / z**3).sum() - 1.0]), (-3.0 * BENDING / z**4)[None]
    )


def compliance(a, volume):
    """sum a_i / z_i with sum z_i = volume * n: z_i ~ sqrt(a_i)."""

    def evaluate(z):
        n = len(z)
        return Evaluation(
            float((a / z).sum()), -a / z**2, np.array([z.mean() / volume - 1.0]), np.full((1, n), 1.0 / n / volume)
        )

    return evaluate


@pytest.mark.parametrize("method", ["mma", "ccsaq"])
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("start", [2.0, 5.0, 10.0])
def test_the_cantilever_of_svanberg(nlopt, method, scale, start):
    """Whatever the unit of the objective is, and from designs that are too weak and too heavy."""

    def evaluate(z):
        made = cantilever(z)
        return Evaluation(scale * made.objective, scale * made.gradient, made.constraints, made.jacobian)

    seen = []
    best = minimise(evaluate, np.full(5, start), (1.0, 10.0), 1, method, 100, 1e-5, seen.append)
    assert best.converged
    assert best.feasible
    assert best.evaluation.objective / scale == pytest.approx(1.33996, rel=1e-5)
    assert best.z == pytest.approx(SVANBERG, rel=2e-3)
    assert best.stationarity < 0.01
    assert best.evaluations == len(seen) <= 60
    assert best.iterations == seen[-1].iteration == sum(it.better for it in seen) < best.evaluations
    assert [it.number for it in seen] == list(range(1, len(seen) + 1))
    assert all(it.evaluation.objective == evaluate(it.z).objective for it in seen)


@pytest.mark.parametrize("method", ["mma", "ccsaq"])
def test_history_is_that_of_nlopt(nlopt, method):
    """Called directly with the same scaling: the same designs in the same order, to the last bit."""
    seen = []
    start, evaluations = np.full(5, 5.0), 25
    minimise(cantilever, start, (1.0, 10.0), 1, method, evaluations, 1e-4, seen.append)
    first = cantilever(start)
    gain, limit = (1.0 / np.sqrt(np.mean((4.5 * d) ** 2)) for d in (first.gradient, first.jacobian))
    asked = []

    def objective(z, gradient):
        asked.append(z.copy())
        gradient[:] = gain * 0.0624
        return float(gain * (0.0624 * z.sum()))

    def constraint(result, z, gradient):
        result[:] = limit * ((BENDING / z**3).sum() - 1.0)
        gradient[:] = limit * (-3.0 * BENDING / z**4)

    opt = nlopt.opt(getattr(nlopt, f"LD_{method.upper()}"), 5)
    opt.set_lower_bounds(np.full(5, 1.0))
    opt.set_upper_bounds(np.full(5, 10.0))
    opt.set_xtol_abs(np.full(5, 1e-4 * 9.0))
    opt.set_maxeval(evaluations)
    opt.set_min_objective(objective)
    opt.add_inequality_mconstraint(constraint, [1e-6 * limit])
    best = opt.optimize(start)
    assert len(asked) == len(seen) > 10
    for z, iterate in zip(asked, seen, strict=True):
        assert z.tobytes() == iterate.z.tobytes()
    assert best.tobytes() == next(it.z for it in reversed(seen) if it.better).tobytes()


def two_constraints(z):
    """z1^2 + z2^2 with a_j.z >= 1: a = (2, 1) and (1, 2), whose corner (1/3, 1/3) is the optimum."""
    rows = np.array([[2.0, 1.0], [1.0, 2.0]])
    return Evaluation(float(z @ z), 2.0 * z, 1.0 - rows @ z, -rows)


@pytest.mark.parametrize("method", ["mma", "ccsaq"])
def test_two_constraints(nlopt, method):
    best = minimise(two_constraints, np.array([0.9, 0.2]), (0.0, 1.0), 2, method, 60, 1e-5)
    assert best.feasible
    assert best.z == pytest.approx([1.0 / 3.0, 1.0 / 3.0], abs=1e-4)
    assert best.evaluation.constraints == pytest.approx([0.0, 0.0], abs=1e-4)


def test_no_constraint(nlopt):
    def evaluate(z):
        return Evaluation(float(((z - 0.3) ** 2).sum()), 2.0 * (z - 0.3), np.empty(0), np.empty((0, 3)))

    best = minimise(evaluate, np.array([0.9, 0.5, 0.0]), (0.0, 1.0), 0, "mma", 60, 1e-6)
    assert best.z == pytest.approx(np.full(3, 0.3), abs=1e-4)
    assert best.feasible


@pytest.mark.parametrize("method", ["mma", "ccsaq", "oc"])
def test_many_variables(method):
    """A thousand with weights from 1e-4 to 1e4, and bounds that many of them reach."""
    if method != "oc":
        pytest.importorskip("nlopt")
    n, volume = 1000, 0.4
    a = np.exp(3.0 * np.random.default_rng(0).standard_normal(n))
    evaluate = compliance(a, volume)
    low, high = 1e-3, 1e3
    for _ in range(100):
        middle = np.sqrt(low * high)
        low, high = (low, middle) if np.clip(np.sqrt(a) * middle, 0.01, 1.0).mean() > volume else (middle, high)
    exact = evaluate(np.clip(np.sqrt(a) * middle, 0.01, 1.0)).objective
    best = minimise(evaluate, np.full(n, volume), (0.01, 1.0), 1, method, 60, 1e-3)
    assert best.feasible
    assert 0.9999 < best.evaluation.objective / exact < 1.002
    assert best.stationarity < 0.05


def test_what_cannot_be_satisfied_is_said(nlopt):
    def evaluate(z):
        return Evaluation(float(z.sum()), np.ones(2), np.array([2.5 - z.sum()]), -np.ones((1, 2)))

    best = minimise(evaluate, np.array([0.5, 0.5]), (0.0, 1.0), 1, "mma", 30)
    assert not best.feasible
    assert not best.converged
    assert "no design satisfies the constraints: constraint 0 of the best one is violated by 0.5" in best.reason
    assert best.z == pytest.approx([1.0, 1.0])


@pytest.mark.parametrize("method", ["mma", "ccsaq", "oc"])
@pytest.mark.parametrize("error", [ValueError("a"), KeyboardInterrupt(), StopIteration("b"), SystemExit(3)])
def test_exceptions_come_out(method, error):
    if method != "oc":
        pytest.importorskip("nlopt")
    seen = []

    def evaluate(z):
        if len(seen) == 3:
            raise error
        return compliance(np.array([1.0, 2.0, 3.0]), 0.5)(z)

    with pytest.raises(type(error)) as caught:
        minimise(evaluate, np.full(3, 0.5), (0.01, 1.0), 1, method, 30, 0.0, seen.append)
    assert caught.value is error
    assert len(seen) == 3

    def told(iterate):
        if iterate.number == 4:
            raise error

    with pytest.raises(type(error)) as caught:
        minimise(compliance(np.array([1.0, 2.0, 3.0]), 0.5), np.full(3, 0.5), (0.01, 1.0), 1, method, 30, 0.0, told)
    assert caught.value is error


def test_ctrl_c(nlopt):
    def evaluate(z):
        os.kill(os.getpid(), signal.SIGINT)
        return cantilever(z)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores it
    try:
        with pytest.raises(KeyboardInterrupt):
            minimise(evaluate, np.full(5, 5.0), (1.0, 10.0), 1)
    finally:
        signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("method", ["mma", "ccsaq", "oc"])
def test_designs_that_cannot_be_evaluated(method):
    """Beyond z_0 = 0.64 nothing can be: methods go back, and come close to it, as the optimum lies behind."""
    if method != "oc":
        pytest.importorskip("nlopt")
    inner, failures = compliance(np.array([4.0, 1.0, 1.0]), 0.5), []

    def evaluate(z):
        if z[0] > 0.64:
            failures.append(z)
            return Evaluation.failed(3, 1)
        return inner(z)

    best = minimise(evaluate, np.full(3, 0.5), (0.01, 1.0), 1, method, 40, 1e-4)
    assert failures
    assert best.feasible
    assert 0.62 < best.z[0] <= 0.64
    assert best.evaluation.objective < inner(np.full(3, 0.5)).objective
    with pytest.raises(InputError, match="first design could not be evaluated"):
        minimise(evaluate, np.full(3, 0.8), (0.01, 1.0), 1, method)


@pytest.mark.parametrize(("method", "largest", "bound"), [("mma", 0.55, 4.455), ("ccsaq", 0.5, 3.2)])
def test_designs_that_fail_do_not_count_as_feasible(nlopt, method, largest, bound):
    """From a design that violates the constraint, some steps lead to designs that cannot be evaluated."""
    weight, failures = np.linspace(1.0, 2.0, 6), []

    def evaluate(z):
        if z.max() > largest:
            failures.append(z)
            return Evaluation.failed(6, 1)
        return Evaluation(float(z @ z), 2.0 * z, np.array([1.0 - z @ weight / bound]), -weight[None] / bound)

    best = minimise(evaluate, np.full(6, 0.1), (0.0, 1.0), 1, method, 100, 1e-3)
    assert failures
    assert best.feasible
    assert best.evaluation.objective < 1.02 * bound**2 / (weight @ weight)


def test_optimality_criteria():
    """z ~ sqrt(a) exactly, from one side's bound too, with the volume kept in every iteration."""
    a, seen = np.array([1.0, 4.0, 9.0, 16.0]), []
    best = minimise(
        compliance(a, 0.25), np.array([0.0, 0.5, 0.25, 0.25]) + 1e-9, (1e-9, 1.0), 1, "oc", 60, 1e-10, seen.append
    )
    assert best.converged
    assert best.z == pytest.approx(np.sqrt(a) / np.sqrt(a).sum(), abs=1e-8)
    assert max(abs(it.evaluation.constraints[0]) for it in seen[1:]) < 1e-9
    assert max(it.change for it in seen) <= 0.2 * (1.0 + 1e-8)


def test_optimality_criteria_with_a_curved_constraint():
    """mean(z^2) <= 1/4: with its values every iterate is feasible, with its tangent none is but the last ones."""

    def evaluate(z):
        made = compliance(np.array([1.0, 4.0, 9.0, 16.0]), 0.25)(z)
        return Evaluation(made.objective, made.gradient, np.array([constraint(z)]), 8.0 * z[None] / 4.0)

    def constraint(z):
        return float(4.0 * (z**2).mean() - 1.0)

    seen = []
    exact = np.array([1.0, 4.0, 9.0, 16.0]) ** (1.0 / 3.0)
    exact *= 0.5 / np.sqrt((exact**2).mean())
    best = minimise(evaluate, np.full(4, 0.5), (0.01, 1.0), 1, "oc", 60, 1e-8, seen.append, constraint=constraint)
    assert max(it.evaluation.violation for it in seen) < 1e-10
    assert best.z == pytest.approx(exact, abs=1e-6)
    seen.clear()
    best = minimise(evaluate, np.full(4, 0.5), (0.01, 1.0), 1, "oc", 60, 1e-8, seen.append)
    assert max(it.evaluation.violation for it in seen) > 1e-3
    assert best.evaluation.violation < 1e-6
    assert best.z == pytest.approx(exact, abs=1e-3)


def test_optimality_criteria_do_not_go_to_and_fro():
    """sum a_i / z_i^8 with eta = 1/2: each step would go 4.5 times as far as it should; z_i ~ a_i^(1/9)."""
    a = np.array([1.0, 10.0, 100.0, 1000.0])

    def evaluate(z):
        made = compliance(a, 0.5)(z)
        return Evaluation(float((a / z**8).sum()), -8.0 * a / z**9, made.constraints, made.jacobian)

    best = minimise(evaluate, np.full(4, 0.5), (0.01, 1.0), 1, "oc", 60, 1e-5)
    exact = a ** (1.0 / 9.0)
    assert best.converged
    assert best.z == pytest.approx(exact * 2.0 / exact.sum(), abs=1e-4)


def test_optimality_criteria_bear_wrong_signs():
    """A variable that only harms goes to its lower bound; it is said once."""

    def evaluate(z):
        made = compliance(np.array([1.0, 4.0, 1.0]), 0.5)(z)
        gradient = made.gradient + np.array([0.0, 0.0, 1.0 / z[2] ** 2 + 1.0])
        return Evaluation(made.objective - 1.0 / z[2] + z[2], gradient, made.constraints, made.jacobian)

    with pytest.warns(Note, match=r"grows with some variables") as said:
        best = minimise(evaluate, np.full(3, 0.5), (0.01, 1.0), 1, "oc", 60, 1e-8)
    assert len(said) == 1
    assert best.z == pytest.approx([0.49667, 0.99333, 0.01], abs=1e-4)


def test_optimality_criteria_without_any_gain():
    """Where nothing gains anything, what costs shrinks and what costs nothing stays."""

    seen = []

    def evaluate(z):
        return Evaluation(0.0, np.zeros(2), np.array([z[0] - 1.0]), np.array([[1.0, 0.0]]))

    best = minimise(evaluate, np.full(2, 0.5), (0.0, 1.0), 1, "oc", 10, 1e-8, seen.append)
    assert best.evaluations == 4
    assert seen[-1].z == pytest.approx([0.0, 0.5])
    assert best.reason.startswith("designs hardly change")


def test_optimality_criteria_pass_over_signs_by_rounding():
    """Derivatives far from where a projection has any slope are 0 but for their last bits."""

    def evaluate(z):
        made = compliance(np.array([1.0, 4.0, 1.0]), 0.5)(z)
        tiny = np.array([1.0, 1.0, -1e-17])
        return Evaluation(made.objective, made.gradient * tiny, made.constraints, made.jacobian * tiny)

    with warnings.catch_warnings():
        warnings.simplefilter("error")  # no note
        best = minimise(evaluate, np.full(3, 0.5), (0.01, 1.0), 1, "oc", 60, 1e-8)
    assert best.z[:2] == pytest.approx([1.0 / 3.0, 2.0 / 3.0], abs=1e-6)
    assert best.z[2] == 0.5


def test_what_optimality_criteria_refuse():
    with pytest.raises(InputError, match=r"are for one constraint, the volume; here are 2: use method 'mma'"):
        minimise(two_constraints, np.full(2, 0.5), (0.0, 1.0), 2, "oc")
    with pytest.raises(InputError, match=r"falls with variable 0 \(-0.293\)"):
        minimise(cantilever, np.full(5, 5.0), (1.0, 10.0), 1, "oc")


@pytest.mark.parametrize("method", ["mma", "ccsaq", "oc"])
def test_a_run_that_is_cut_ends_as_the_other(method):
    """Wherever it is cut; with the record, nothing is evaluated twice."""
    if method != "oc":
        pytest.importorskip("nlopt")
    evaluate = compliance(np.array([1.0, 4.0, 9.0, 16.0, 0.1]), 0.3)
    whole = Replay(evaluate)
    bounds = (0.01, 1.0)
    end = minimise(whole, np.full(5, 0.3), bounds, 1, method, 30, 1e-3)
    assert len(whole.records) == end.evaluations > 4
    for cut in range(end.evaluations + 1):
        asked = []

        def counted(z, asked=asked):
            asked.append(z)
            return evaluate(z)

        rest = Replay(counted, whole.records[:cut])
        again = minimise(rest, np.full(5, 0.3), bounds, 1, method, 30, 1e-3)
        assert again.z.tobytes() == end.z.tobytes()
        assert (again.evaluations, again.reason) == (end.evaluations, end.reason)
        assert rest.replayed == cut
        assert len(asked) == end.evaluations - cut
        assert [z.tobytes() for z, _ in rest.records] == [z.tobytes() for z, _ in whole.records]


def test_a_record_of_something_else():
    whole = Replay(cantilever)
    for value in (5.0, 6.0, 7.0):
        whole(np.full(5, value))
    rest = Replay(cantilever, whole.records)
    rest(np.full(5, 5.0))
    with pytest.warns(Note, match=r"evaluation 2 is of another design than on record: .* 2 evaluations on record"):
        rest(np.full(5, np.nextafter(6.0, 7.0)))
    assert rest.replayed == 1
    assert len(rest.records) == 2


def test_scaling():
    width = np.full(5, 9.0)
    first = cantilever(np.full(5, 5.0))
    made = Scaling.of(first, width)
    assert made.objective * 4.5 * 0.0624 == pytest.approx(1.0)
    assert np.sqrt(np.mean((made.constraints[0] * 4.5 * first.jacobian) ** 2)) == pytest.approx(1.0)
    flat = Evaluation(7.0, np.zeros(5), np.zeros(2), np.array([np.zeros(5), np.full(5, 1e3)]))
    assert Scaling.of(flat, width).objective == pytest.approx(50.0 / 7.0)
    assert Scaling.of(flat, width).constraints.tolist() == [50.0, 1.0]
    assert Scaling.of(Evaluation.failed(5, 0), width).objective <= 1.0


def test_stationarity():
    best = np.sqrt(np.array([1.0, 4.0, 9.0]))
    best *= 1.5 / best.sum()
    lower, upper = np.zeros(3), np.ones(3)
    evaluate = compliance(np.array([1.0, 4.0, 9.0]), 0.5)
    assert stationarity(best, evaluate(best), lower, upper) < 1e-12
    assert stationarity(0.9 * best, evaluate(0.9 * best), lower, upper) == pytest.approx(1.0)
    assert 0.1 < stationarity(np.full(3, 0.5), evaluate(np.full(3, 0.5)), lower, upper) < 0.9
    on_bounds = np.array([1.0, 0.0])
    made = Evaluation(0.0, np.array([-1.0, 2.0]), np.empty(0), np.empty((0, 2)))
    assert stationarity(on_bounds, made, np.zeros(2), np.ones(2)) == 0.0
    assert stationarity(on_bounds[::-1], made, np.zeros(2), np.ones(2)) == 1.0


def test_a_method_that_is_stuck_is_started_again(nlopt, monkeypatch):
    """With bad scaling CCSAQ says that it has converged, far from any limit: the objective is linear."""
    bad = Scaling(1e4, np.ones(1))
    options = {"scaling": bad, "feasibility": 1e-8}
    best = minimise(cantilever, np.full(5, 2.0), (1.0, 10.0), 1, "ccsaq", 400, 1e-7, **options)
    assert best.starts > 1
    assert best.evaluation.objective == pytest.approx(1.33996, rel=1e-3)
    monkeypatch.setattr("tmc_vem.design.optimisers._stuck", lambda *_: False)
    stuck = minimise(cantilever, np.full(5, 2.0), (1.0, 10.0), 1, "ccsaq", 400, 1e-7, **options)
    assert stuck.starts == 1
    assert stuck.evaluation.objective > 1.36
    assert "% of the gradient is left, so this need not be an optimum" in stuck.reason


def test_without_nlopt(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "nlopt", None)
    with pytest.raises(InputError, match=r"method 'mma' needs nlopt .*\[design\].*apt-get install python3-nlopt"):
        minimise(cantilever, np.full(5, 5.0), (1.0, 10.0), 1, "mma")
    assert minimise(compliance(np.ones(3), 0.5), np.full(3, 0.5), (0.0, 1.0), 1, "oc").feasible


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"method": "mna"}, "unknown method 'mna'"),
        ({"max_iterations": 0}, "max_iterations = 0"),
        ({"tolerance": -1.0}, "tolerance of designs"),
        ({"feasibility": 2.0}, "feasibility of constraints"),
        ({"move": 0.0}, "move limit"),
        ({"damping": 2.0}, "damping"),
        ({"bounds": (1.0, 1.0)}, "variable 0 has bounds 1 and 1"),
        ({"bounds": (0.0, np.inf)}, "variable 0 has bounds 0 and inf"),
        ({"bounds": (6.0, 7.0)}, "variable 0 of the first design is 5: its bounds are 6 and 7"),
        ({"z0": np.zeros((2, 2))}, r"the first design has shape \(2, 2\)"),
        ({"n_constraints": 2}, r"constraints of a design has shape \(1,\): it needs \(2,\)"),
    ],
)
def test_what_is_refused(change, message):
    arguments = {"z0": np.full(5, 5.0), "bounds": (1.0, 10.0), "n_constraints": 1} | change
    with pytest.raises(InputError, match=message):
        minimise(cantilever, **arguments)


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (Evaluation(1.0, np.ones(4), np.zeros(1), np.ones((1, 5))), r"gradient of a design has shape \(4,\)"),
        (Evaluation(1.0, np.ones(5), np.zeros(1), np.ones(5)), r"jacobian of a design has shape \(5,\)"),
        (Evaluation(1.0, np.array([1, 1, np.nan, 1, 1]), np.zeros(1), np.ones((1, 5))), r"no finite number, at \(2,\)"),
        (Evaluation(np.nan, np.ones(5), np.zeros(1), np.ones((1, 5))), "objective of a design is nan"),
    ],
)
def test_evaluations_that_are_wrong(made, message):
    with pytest.raises(InputError, match=message):
        minimise(lambda z: made, np.full(5, 5.0), (1.0, 10.0), 1)
