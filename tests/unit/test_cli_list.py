"""The table of ``tmc-vem list`` fits the terminal and leaves out what matters least."""

from __future__ import annotations

from tmc_vem.cli.list import Column, fitting


def columns() -> list[Column]:
    headings = ("problem", "length", "medium.gamma", "method", "load", "gap", "reaction", "time (s)")
    return [Column(heading, ["0" * 10]) for heading in headings]


def test_wide_enough_for_all() -> None:
    assert fitting(columns(), 1000) == columns()


def test_what_matters_least_goes_first_and_the_order_stays() -> None:
    width = sum(column.width for column in columns())
    assert [c.heading for c in fitting(columns(), width - 1)] == [
        "problem", "medium.gamma", "method", "load", "gap", "reaction", "time (s)",
    ]  # fmt: skip
    assert [c.heading for c in fitting(columns(), 13 * 5)] == ["problem", "method", "load", "gap", "reaction"]


def test_results_are_shown_in_any_case() -> None:
    assert [c.heading for c in fitting(columns(), 10)] == ["load", "gap", "reaction"]
