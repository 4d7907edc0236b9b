"""The generated C that is kept under version control; run this file to write it anew after a wanted change."""

from __future__ import annotations

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


if __name__ == "__main__":
    main()
