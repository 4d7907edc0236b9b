"""Pages of the API reference: one a package, with all its modules, so that none is forgotten."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gallery import write_if_changed

ROOT = Path(__file__).parents[2]
# page: (title, packages and modules in it, of tmc_vem or beside it); modules that are not named stand on the first page
PAGES = {
    "run": ("Problems and runs", ("simulation", "problem_file", "problems")),
    "results": (
        "Results and fields",
        ("results", "export", "sample", "fields", "vtu", "output", "checkpoint", "report"),
    ),
    "energy": ("Energies", ("energy",)),
    "codegen": ("Code generator", ("codegen",)),
    "mesh": ("Meshes", ("mesh",)),
    "vem": ("Virtual elements", ("vem",)),
    "fem": ("Finite elements", ("fem",)),
    "solve": ("Nonlinear solver", ("solve",)),
}
WORKERS = ("batch_worker",)  # run by other modules only


def setup(app: Any) -> dict[str, bool]:
    """Write the pages before the sources are read."""
    app.connect("builder-inited", _write_pages)
    return {"parallel_read_safe": True}


def _write_pages(app: Any) -> None:
    folder = Path(app.srcdir) / "api"
    folder.mkdir(exist_ok=True)
    named = {root for _, roots in PAGES.values() for root in roots}
    others = sorted({file.stem for file in (ROOT / "tmc_vem").glob("[!_]*.py")} - named - {*WORKERS})
    for name, (title, roots) in PAGES.items():
        modules = [module for root in (*roots, *(others if name == "run" else ())) for module in modules_of(root)]
        blocks = [f"## {module}\n\n```{{eval-rst}}\n.. automodule:: {module}\n```\n" for module in modules]
        write_if_changed(folder / f"{name}.md", f"# {title}\n\n" + "\n".join(blocks))
    entries = "\n".join(PAGES)
    write_if_changed(
        folder / "index.md",
        "# API reference\n\nMade from the docstrings. Axes are part of array names: `dNdX_qak` has the axes q "
        "(quadrature points), a (basis functions), k (directions).\n\n"
        f"```{{toctree}}\n:maxdepth: 1\n\n{entries}\n```\n",
    )


def modules_of(root: str) -> list[str]:
    """A module, or all public modules of a package."""
    root = root if root == "codegen" else f"tmc_vem.{root}"
    path = ROOT / root.replace(".", "/")
    if not path.is_dir():
        return [root] if path.with_suffix(".py").exists() else []
    files = sorted(file for file in path.glob("*.py") if not file.stem.startswith("_"))
    return [f"{root}.{file.stem}" for file in files]
