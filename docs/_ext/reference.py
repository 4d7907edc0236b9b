"""Pages of the API reference: one a package, with all its modules, so that none is forgotten."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gallery import write_if_changed

ROOT = Path(__file__).parents[2]
# page: (title, packages with all their modules)
PAGES = {
    "run": ("Problems and runs", ("tmc_vem.simulation", "tmc_vem.problems", "tmc_vem.study")),
    "results": ("Results and fields", ("tmc_vem.results", "tmc_vem.report")),
    "energy": ("Energies", ("tmc_vem.energy",)),
    "codegen": ("Code generator", ("codegen",)),
    "mesh": ("Meshes", ("tmc_vem.mesh",)),
    "system": ("What discretisations share", ("tmc_vem.system", "tmc_vem.support")),
    "vem": ("Virtual elements", ("tmc_vem.vem",)),
    "fem": ("Finite elements", ("tmc_vem.fem",)),
    "solve": ("Nonlinear solver", ("tmc_vem.solve",)),
    "sensitivity": ("Sensitivities", ("tmc_vem.sensitivity",)),
    "design": ("Designs", ("tmc_vem.design",)),
}
WORKERS = ("tmc_vem.study.batch_worker",)  # run by other modules only


def setup(app: Any) -> dict[str, bool]:
    """Write the pages before the sources are read."""
    app.connect("builder-inited", _write_pages)
    return {"parallel_read_safe": True}


def _write_pages(app: Any) -> None:
    folder = Path(app.srcdir) / "api"
    folder.mkdir(exist_ok=True)
    for name, (title, packages) in PAGES.items():
        modules = [module for package in packages for module in modules_of(package)]
        blocks = [f"## {module}\n\n```{{eval-rst}}\n.. automodule:: {module}\n```\n" for module in modules]
        write_if_changed(folder / f"{name}.md", f"# {title}\n\n" + "\n".join(blocks))
    entries = "\n".join(PAGES)
    write_if_changed(
        folder / "index.md",
        "# API reference\n\nMade from the docstrings. Axes are part of array names: `dNdX_qak` has the axes q "
        "(quadrature points), a (basis functions), k (directions).\n\n"
        f"```{{toctree}}\n:maxdepth: 1\n\n{entries}\n```\n",
    )


def modules_of(package: str) -> list[str]:
    """All public modules of a package and of the packages in it."""
    files = sorted((ROOT / package.replace(".", "/")).rglob("*.py"))
    names = [file.relative_to(ROOT).with_suffix("").as_posix().replace("/", ".") for file in files]
    return [name for name in names if not name.rpartition(".")[2].startswith("_") and name not in WORKERS]
