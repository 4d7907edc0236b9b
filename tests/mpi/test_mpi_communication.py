"""Ranks share the work by its cost, keep their own part only, and send each other scalars while the load is applied."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from helpers_process import process

from tmc_vem.results.run_result import RunResult
from tmc_vem.results.snapshots import read_fields, snapshots
from tmc_vem.system.fields import Fields

RANKS = 3


@cache
def report_in(folder: Path) -> dict[str, Any]:
    done = process([str(Path(__file__).with_name("communication.py")), str(folder)], ranks=RANKS)
    assert done.returncode == 0, done.stderr[-3000:]
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("runs")


def test_messages_do_not_grow_with_the_mesh(folder: Path) -> None:
    """Two load steps with fields and checkpoints, on meshes of 20 x 5 and 80 x 20 cells: what is known of the outlines
    of solids grows as they do, four times, and cells sixteen times."""
    coarse, fine = report_in(folder)["messages"]
    assert coarse["calls"] > 20
    assert fine["largest"] <= 4 * coarse["largest"]
    assert fine["largest"] < 15_000


def test_the_root_keeps_its_own_cells_only(folder: Path) -> None:
    for alive, n_cells, _ in report_in(folder)["meshes"]:
        assert alive == [n_cells]
    assert sum(n_cells for _, n_cells, _ in report_in(folder)["meshes"]) == 400


def test_cells_are_spread_by_cost(folder: Path) -> None:
    """The cells of one half of a square count nine times: equal numbers of cells would be unequal work."""
    _, n_cells, cost = zip(*report_in(folder)["meshes"], strict=True)
    assert max(cost) < 1.1 * np.mean(cost)
    assert max(n_cells) > 1.3 * np.mean(n_cells)


def test_imbalance_and_memory_are_in_the_result(folder: Path) -> None:
    result = report_in(folder)["result"]
    assert result["ranks"] == RANKS
    assert result["solver"] == "direct"
    assert result["imbalance"].keys() == {"cells", "expected_cost", "kernel_seconds"}
    assert 1.0 <= result["imbalance"]["expected_cost"] < 1.1
    memory = result["peak_memory_mib"]
    assert RANKS * 20 < memory["all"] <= RANKS * memory["largest"]


def test_pieces_of_fields_make_a_whole(folder: Path) -> None:
    """The collection names one PVTU file a step, which describes its pieces as they are."""
    report_in(folder)
    result = RunResult.read(folder / "80")
    steps = snapshots(result)
    assert [len(step.files) for step in steps] == [RANKS, RANKS]
    fields: Fields = read_fields(result, steps[-1])
    assert fields.polygons.n_cells == result.n_cells == 1600
    assert fields.displacement_ni[:, 1].min() == pytest.approx(-0.1)

    whole = ElementTree.parse(folder / "80" / "fields" / "step_00002.pvtu")
    sources = [piece.attrib["Source"] for piece in whole.iter("Piece")]
    assert sources == [file.name for file in steps[-1].files]
    for source in sources:
        piece = ElementTree.parse(folder / "80" / "fields" / source)
        for kind in ("Points", "PointData", "CellData"):
            promised = [(a.get("Name"), a.get("type")) for a in whole.findall(f".//P{kind}/PDataArray")]
            found = [(a.get("Name"), a.get("type")) for a in piece.findall(f".//{kind}/DataArray")]
            if kind == "Points":
                assert [kind for _, kind in promised] == [kind for _, kind in found]
            else:
                assert promised == found
