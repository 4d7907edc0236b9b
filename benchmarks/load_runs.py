"""What problem files with several loads do on their way, for pages."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from tmc_vem import run
from tmc_vem.simulation.problem_file import read_problem


def history(text: str) -> list[dict[str, Any]]:
    """Every step of a problem file by its text: load factor, probes, what loads say, and whether it jumped."""
    with TemporaryDirectory() as directory:
        path = Path(directory) / "problem.toml"
        path.write_text(text)
        own, options = read_problem(path)
        result = run(own, None, options)
    assert result.complete
    return [
        {"load": step.load, "jumped": step.jumped, **step.probes}
        | {f"{name}.{key}": value for name, of in step.forces.items() for key, value in of.items()}
        for step in result.history
    ]
