"""Every block of Python and shell in README, tutorial and how-to pages runs, in order, in an empty directory."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers_process import clean_environment

ROOT = Path(__file__).parents[1]
PAGES = (
    "README.md",
    "docs/guide/tutorial.md",
    "docs/guide/loads.md",
    *(
        f"docs/howto/{name}.md"
        for name in (
            "check-and-sweep",
            "contact-forces",
            "contact-forces",
            "fenicsx",
            "friction",
            "hanging-nodes",
            "limit",
            "own-mesh",
            "paraview",
            "probes",
            "restart",
            "sensitivities",
            "solver-options",
            "stress",
            "topology-optimisation",
        )
    ),
)
BLOCK = re.compile(r"^```(python|sh)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: Path(page).stem)
def test_blocks_run(page: str, tmp_path: Path) -> None:
    blocks = BLOCK.findall((ROOT / page).read_text())
    assert blocks
    environment = {**clean_environment(), "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    for language, text in blocks:
        command = [sys.executable, "-c", text] if language == "python" else ["bash", "-euo", "pipefail", "-c", text]
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300, check=False
        )
        assert done.returncode == 0, f"{text}\n{done.stdout}\n{done.stderr}"


def test_links_between_files_lead_somewhere() -> None:
    """Those of the pages that Sphinx does not read."""
    for page in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md"):
        links = re.findall(r"\]\(([^)#]+)", (ROOT / page).read_text())
        broken = [link for link in links if "://" not in link and not (ROOT / link).exists()]
        assert not broken, f"{page}: {broken}"


def test_every_option_of_the_table_is_one_of_problem_files() -> None:
    """The right column of the how-to page on solver options; each changes what is run."""
    import tomllib

    from tmc_vem.simulation import RunOptions
    from tmc_vem.support.validation import build

    page = (ROOT / "docs/howto/solver-options.md").read_text()
    entries = re.findall(r"^\|.*\| `([^`]*)` \|$", page, re.MULTILINE)
    assert len(entries) > 10
    for entry in entries:
        assert build(RunOptions, tomllib.loads(entry), entry) != RunOptions(), entry


def test_examples_of_problem_files_are_read(tmp_path: Path) -> None:
    """The [solve] and [probes] tables of the schema page."""
    import tomllib

    from tmc_vem.problems.description import ProbeTable
    from tmc_vem.simulation import RunOptions
    from tmc_vem.support.validation import build

    page = (ROOT / "docs/guide/problem-files.md").read_text()
    blocks = re.findall(r"^```toml\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    (solve,) = (tomllib.loads(text)["solve"] for text in blocks if "[solve]" in text)
    (probes,) = (tomllib.loads(text)["probes"] for text in blocks if "[probes]" in text)
    assert build(RunOptions, solve, "solve").snapshots == 20
    kinds = [type(build(ProbeTable, probe, name).probe()).__name__ for name, probe in probes.items()]
    assert kinds == [
        "Displacement", "Position", "Gap", "Reaction", "MeanJ", "ValueAt", "Over", "PNorm", "Over", "Over",
        "EnergyOf", "CutForce", "Contact", "Contact",
    ]  # fmt: skip


def test_the_tables_of_designs_are_read_and_complete() -> None:
    """The load cases of the page on designs, and every key of [design] on the page of the schema."""
    import dataclasses
    import tomllib

    from tmc_vem.problems.description import ProblemTable
    from tmc_vem.problems.design_table import DesignTable
    from tmc_vem.support.validation import build

    page = (ROOT / "docs/howto/topology-optimisation.md").read_text()
    (example,) = re.findall(r"<<'END'\n(.*?)^END$", page, re.MULTILINE | re.DOTALL)
    (cases,) = re.findall(r"^```toml\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    design = build(ProblemTable, tomllib.loads(example + cases), "page").design
    assert design is not None
    assert [(case.name, case.weight) for case in design.cases] == [("down", 1.0), ("up", 0.5)]
    schema = (ROOT / "docs/guide/problem-files.md").read_text().split("### `[design]`")[1].split("### ")[0]
    for field in dataclasses.fields(DesignTable):
        assert re.search(rf"^\|[^|]*\b{field.name}\b", schema, re.MULTILINE), field.name


def test_solids_on_the_page_of_materials_are_solids() -> None:
    """Those of problem files and of Python, and what the summary says of one."""
    import tomllib

    from tmc_vem.problems import Material
    from tmc_vem.problems.base import solid_region
    from tmc_vem.problems.description import RegionTable
    from tmc_vem.problems.solids import conversions
    from tmc_vem.support.validation import build

    page = (ROOT / "docs/materials.md").read_text()
    text, graded = re.findall(r"^```toml\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    solids = {name: build(Material, region["solid"], name) for name, region in tomllib.loads(text)["regions"].items()}
    varying = {name: build(RegionTable, region, name) for name, region in tomllib.loads(graded)["regions"].items()}
    finger = varying["finger"]
    assert finger.solid is not None
    region = solid_region(finger.solid, graded=finger.graded)
    assert region.graded is not None
    assert region.graded.factors(np.array([[2.0, 0.0]]), {}) == pytest.approx(np.array([[4.0, 4.0]]))
    ((heading, words),) = conversions({"regions": {"seal": {"solid": solids["seal"].as_dict()}}})
    assert f"`{heading}   {words}`" in page
    in_python = re.findall(r"Material\((.*?)\)", page)
    assert [Material(**eval(f"dict({arguments})")).model for arguments in in_python] == [
        "neo_hooke",
        "gent",
        "neo_hooke",
    ]
