"""Every picture is drawn as it was when somebody last looked at it."""

from __future__ import annotations

import json
from pathlib import Path

import drawn
import pytest

GOLDEN = json.loads((Path(__file__).parents[1] / "golden" / "pictures.json").read_text())
PIXELS = 3.0  # what widths of texts differ by between versions of the font library


@pytest.fixture(scope="module")
def pictures() -> dict[str, drawn.Record]:
    return drawn.pictures()


@pytest.mark.parametrize("name", GOLDEN)
def test_a_picture_is_drawn_as_before(name: str, pictures: dict[str, drawn.Record]) -> None:
    """Words are equal, and numbers up to rounding; on a canvas up to the width of texts."""
    found, golden = json.loads(json.dumps(pictures[name])), GOLDEN[name]
    by_pixels = name.startswith("state") or name == "animation"
    assert [entry[0] for entry in found] == [entry[0] for entry in golden]
    in_legend = False
    for new, old in zip(found, golden, strict=True):
        words, values = _apart(new)
        old_words, old_values = _apart(old)
        assert words == old_words
        in_legend = in_legend or "third medium" in words  # where its patches are depends on widths of texts
        loose = PIXELS if by_pixels and (in_legend or new[0] in ("text", "frame")) else 1e-6
        assert values == pytest.approx(old_values, rel=1e-6, abs=loose), new


def _apart(entry: list[object]) -> tuple[list[str], list[float]]:
    return [str(e) for e in entry if not _is_number(e)], [e for e in entry if _is_number(e)]  # type: ignore[misc]


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def test_all_pictures_are_there(pictures: dict[str, drawn.Record]) -> None:
    assert set(pictures) == set(GOLDEN)
