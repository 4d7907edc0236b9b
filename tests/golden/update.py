"""Generated C and records of pictures that are kept under version control; run this file to write them anew after a wanted
change."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from codegen.compiler import generate
from codegen.integrand import second_gradient_energy
from codegen.trace import trace
from tmc_vem.energy import PAPER_DENSITIES

DIRECTORY = Path(__file__).parent
COMMAND = "python tests/golden/update.py"
START, END = "static void point_energy(", "/* ---- Single states"


def golden_text(name: str) -> str:
    """What belongs to one energy: provenance and point kernels, without the parts that all kernels share."""
    energy = PAPER_DENSITIES[name]
    source = generate(trace(second_gradient_energy(energy.density, energy.name, energy.parameters)), energy.description).c_source
    provenance = source[: source.index("*/") + 3]
    return provenance + "\n" + source[source.index(START) : source.index(END)].rstrip() + "\n"


def main() -> None:
    """Write every golden file and name those that changed."""
    for name in PAPER_DENSITIES:
        path, text = DIRECTORY / f"{name}.c", golden_text(name)
        if not path.exists() or path.read_text() != text:
            path.write_text(text)
            print(f"wrote {path}")
    for path in DIRECTORY.glob("*.c"):
        if path.stem not in PAPER_DENSITIES:
            path.unlink()
            print(f"removed {path}")


def write_pictures() -> None:
    """Write the record of every picture."""
    sys.path.insert(0, str(DIRECTORY.parent))
    from drawn import pictures

    lines = (f"{json.dumps(name)}: [\n{_lines(record)}\n]" for name, record in pictures().items())
    text, path = "{\n" + ",\n".join(lines) + "\n}\n", DIRECTORY / "pictures.json"
    if not path.exists() or path.read_text() != text:
        path.write_text(text)
        print(f"wrote {path}: look at the pictures that have changed")


def _lines(record: list[list[object]]) -> str:
    rounded = ([_rounded(value) for value in entry] for entry in record)
    return ",\n".join(json.dumps(entry, ensure_ascii=False) for entry in rounded)


def _rounded(value: object) -> object:
    return float(f"{value:.9g}") if isinstance(value, float) else value


if __name__ == "__main__":
    main()
    write_pictures()
