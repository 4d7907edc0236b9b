"""Input from tables and from Python: converted where nothing is lost, else refused in one line that helps."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tmc_vem.problems import Bodies, Box, CBox, Material, Medium, Punch
from tmc_vem.simulation import RunOptions
from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import (
    build,
    check_fields,
    require_choice,
    require_finite,
    require_known,
    require_within,
)
from tmc_vem.system.fem_settings import FemSettings
from tmc_vem.vem.spaces.element_settings import ElementSettings

TABLES = (Box, CBox, Punch, Bodies, Medium, Material, ElementSettings, FemSettings, RunOptions)


@dataclass(frozen=True)
class Inner:
    k: float = 1.0


@dataclass(frozen=True)
class Outer:
    count: int
    size: float = 0.5
    pair: tuple[int, int] = (1, 2)
    flag: bool = False
    word: str | None = None
    inner: Inner = field(default_factory=Inner)
    values: Mapping[str, float] = field(default_factory=dict)
    loads: Sequence[float] = ()

    def __post_init__(self) -> None:
        check_fields(self)


def test_a_table_becomes_a_dataclass() -> None:
    table = {"count": 3, "size": 2, "pair": [4, 5], "word": "w", "inner": {"k": 7}, "values": {"a": 1}, "loads": [0, 1]}
    made = build(Outer, table, "file")
    assert made == Outer(3, 2.0, (4, 5), False, "w", Inner(7.0), {"a": 1.0}, (0.0, 1.0))
    assert isinstance(made.size, float)
    assert isinstance(made.pair, tuple)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({}, "file lacks 'count'"),
        ({"count": 1, "siez": 2.0}, r"file has no 'siez' \(did you mean 'size'\?\): it has count, size"),
        ({"count": 1.0}, "file: count = 1 must be a whole number"),
        ({"count": True}, "file: count = True must be a whole number"),
        ({"count": "3"}, "file: count = '3' must be a whole number"),
        ({"count": 1, "size": "0.5"}, "file: size = '0.5' must be a number"),
        ({"count": 1, "size": 10**400}, "file: size = 1000.* is too large"),
        ({"count": 1, "pair": [1]}, "file: pair = .* must be a list of 2"),
        ({"count": 1, "pair": [1, 2.5]}, "file: pair, entry 2 = 2.5 must be a whole number"),
        ({"count": 1, "pair": "ab"}, "file: pair = 'ab' must be a list"),
        ({"count": 1, "flag": 1}, "file: flag = 1 must be true or false"),
        ({"count": 1, "word": 1}, "file: word = 1 must be text"),
        ({"count": 1, "inner": 1}, "file: inner = 1 must be a table"),
        ({"count": 1, "inner": {"q": 1}}, "file: inner has no 'q'"),
        ({"count": 1, "values": {"a": "b"}}, "file: values: a = 'b' must be a number"),
        ({"count": 1, "loads": 3}, "file: loads = 3 must be a list"),
        ({"count": 1, "loads": [1, None]}, "file: loads, entry 2 = None must be a number"),
        ([1], r"file = \[1\] must be a table"),
    ],
)
def test_bad_tables_are_refused(table: Any, message: str) -> None:
    with pytest.raises(InputError, match=f"^{message}"):
        build(Outer, table, "file")


def test_values_from_elsewhere_may_not_stand_in_the_table() -> None:
    assert build(Outer, {}, "file", {"count": 2}).count == 2
    with pytest.raises(InputError, match="file has no 'count'"):
        build(Outer, {"count": 1}, "file", {"count": 2})


def test_fields_are_checked_and_converted_in_python_too() -> None:
    assert Box(cells=[20, 5]).cells == (20, 5)  # type: ignore[arg-type]
    box = Box(cells=(np.int64(20), 5), uy=-1)
    assert type(box.uy) is float
    assert type(box.cells[0]) is int
    for make, message in (
        (lambda: Box(cells=(20.5, 5)), "cells, entry 1 = 20.5 must be a whole number"),
        (lambda: Box(medium="soft"), "medium = 'soft' must be a table of names and values or a Medium"),
        (lambda: Medium(gamma="1e-5"), "gamma = '1e-5' must be a number"),
        (lambda: Medium(gamma=math.nan), "gamma = nan must be a positive number"),
        (lambda: Punch(uy=math.inf), "uy = inf must be a finite number"),
        (lambda: RunOptions(method="vme"), r"unknown method 'vme' \(did you mean 'vem'\?\): choose one of vem, fem"),
        (lambda: RunOptions(steps=2.5), "steps = 2.5 must be a whole number"),
        (lambda: ElementSettings(order=None), "order = None must be a whole number"),
        (lambda: FemSettings(triangles="yes"), "triangles = 'yes' must be true or false"),
    ):
        with pytest.raises(InputError, match=f"^{message}"):
            make()


def test_single_values() -> None:
    require_finite("x", -1.0)
    require_within("x", 2, 1, 3)
    require_choice("colour", "red", ("red", "green"))
    require_known(["a"], ["a", "b"], "it")
    for check in (
        lambda: require_finite("x", math.nan),
        lambda: require_within("x", math.nan, 1, 3),
        lambda: require_within("x", 4, 1, 3, "a hint"),
        lambda: require_choice("colour", "rot", ("red", "green")),
        lambda: require_known([3], ["a", "b"], "it"),
    ):
        with pytest.raises(InputError):
            check()


SCALARS = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=6), st.sampled_from(["angle", "vem", "full"])
)
VALUES = st.recursive(
    SCALARS, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3)
)


@settings(max_examples=500, deadline=None)
@given(data=st.data())
def test_any_table_is_accepted_rightly_or_refused_in_one_line(data: st.DataObject) -> None:
    cls = data.draw(st.sampled_from(TABLES))
    names = st.sampled_from(list(cls.__dataclass_fields__)) | st.text(max_size=5)
    table = data.draw(st.dictionaries(names, VALUES, max_size=4) | VALUES)
    made, message = None, ""
    try:
        made = build(cls, table, "file")
    except InputError as error:
        message = str(error)
    if made is None:
        assert len(message.splitlines()) == 1
        assert message.startswith("file")
    else:
        for name, value in table.items():
            kept = getattr(made, name)
            assert value is None or isinstance(value, dict) or kept == value or list(kept) == list(value), (
                name,
                value,
                kept,
            )
