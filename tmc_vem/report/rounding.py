"""Whether two texts with numbers say the same, up to what rounding and another machine do to the numbers.

Words must be equal. A number with a decimal point may differ by one unit of its last printed digit, and so may an
uncertainty, which stands behind '±'; a number without one, such as 40 or 1e-05, not at all. The exception are Newton
iterations and load steps, which follow from decisions that rounding can tip: in columns whose heading names them, in
front of these words, and as '69 in 18' they may differ by two, and by a twentieth where that is more. (With other
kernels of the BLAS the counts of nineteen runs in contact were the same, and their gaps agreed to 1e-12.)
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import zip_longest

EFFORT = re.compile(r"iterations|steps", re.IGNORECASE)
SHARE, AT_LEAST = 0.05, 2  # of counted work
_NUMBER = re.compile(r"(?<![\w.])[+-]?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?(?!\w)")
_COUNTED_AFTER = re.compile(r"\s*(?:(?:Newton |load )?(?:iterations|steps)\b|in \d+\b)")
_COUNTED_BEFORE = re.compile(r"\d in $")


@dataclass(frozen=True)
class Difference:
    """Where two texts differ by more than rounding: a number of each, or what stands there in words."""

    old: str
    new: str
    where: str

    def __str__(self) -> str:
        return f"{self.old or 'nothing'} -> {self.new or 'nothing'} ({self.where})"


def differences(old: str, new: str) -> list[Difference]:
    """What a text of numbers says that another does not, beyond rounding, line by line."""
    found: list[Difference] = []
    counted: list[bool] = []
    lines = [[line.strip() for line in text.splitlines() if line.strip()] for text in (old, new)]
    for before, after in zip_longest(*lines, fillvalue=""):
        cells = _cells(after)
        if not cells:
            counted = []
        elif not counted:  # the first row of a table is its heading
            counted = [EFFORT.search(cell) is not None for cell in cells]
        found += _in_line(before, after, counted)
    return found


def _cells(line: str) -> list[str]:
    return line.strip("|").split("|") if line.startswith("|") else []


def _in_line(before: str, after: str, counted: list[bool]) -> list[Difference]:
    if before == after:
        return []
    words = [_NUMBER.sub("#", line) for line in (before, after)]
    if words[0] != words[1]:
        return [Difference(_short(before), _short(after), "words")]
    found = []
    for a, b in zip(_NUMBER.finditer(before), _NUMBER.finditer(after), strict=True):
        column = after[: b.start()].count("|") - 1 if counted else -1
        effort = (column >= 0 and counted[column]) or _is_counted(after, b)
        if not _close(a[0], b[0], effort, uncertainty=after[: b.start()].endswith("± ")):
            found.append(Difference(a[0], b[0], _short(after)))
    return found


def _is_counted(line: str, number: re.Match[str]) -> bool:
    after, before = _COUNTED_AFTER.match(line, number.end()), _COUNTED_BEFORE.search(line[: number.start()])
    return after is not None or before is not None


def _close(a: str, b: str, effort: bool, uncertainty: bool) -> bool:
    x, y = float(a), float(b)
    if effort:
        return abs(x - y) <= max(AT_LEAST, SHARE * abs(y))
    if "." in a + b or uncertainty:
        return abs(x - y) <= 1.01 * max(_unit(a), _unit(b))
    return x == y


def _unit(text: str) -> float:
    """One in the last printed digit."""
    mantissa, _, exponent = text.lower().partition("e")
    decimals = len(mantissa.partition(".")[2])
    return float(10.0 ** (int(exponent or 0) - decimals))


def _short(line: str, most: int = 90) -> str:
    return line if len(line) <= most else line[: most - 3] + "..."
