"""Every package and module stands on one ordered list of layers, and imports go downwards only."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

# From the ground up. A module belongs to the longest name that it begins with, and may import from layers below and
# from its own. Public names of a package are made when they are asked for, which is no import.
LAYERS = (
    "codegen",
    "tmc_vem.support",
    "tmc_vem.energy",
    "tmc_vem.mesh",
    "tmc_vem.mesh.files",
    "tmc_vem.mesh.make",
    "tmc_vem.mesh.spread",
    "tmc_vem.system",
    "tmc_vem.vem.spaces",
    "tmc_vem.vem.kernel",
    "tmc_vem.vem",
    "tmc_vem.fem",
    "tmc_vem.solve",
    "tmc_vem.problems",
    "tmc_vem.results.contact",
    "tmc_vem.results",
    "tmc_vem.report",
    "tmc_vem.simulation",
    "tmc_vem.sensitivity",
    "tmc_vem.adapt",
    "tmc_vem.design",
    "tmc_vem.study",
    "tmc_vem.cli",
    "tmc_vem.moved",
    "tmc_vem.__init__",
)
PETSC = ("petsc4py", "tmc_vem.support.petsc", "tmc_vem.support.petsc_start")
# What each layer does not need, besides what is above it; also of what is below, where a seam is between.
FORBIDDEN = {
    "codegen": ("tmc_vem", "petsc4py", "mpi4py", "dolfinx", "ufl"),
    "tmc_vem.support": ("codegen", "dolfinx", "ufl", "sympy"),
    "tmc_vem.energy": ("codegen", "numpy", *PETSC, "mpi4py", "dolfinx", "ufl", "sympy"),
    "tmc_vem.mesh": ("codegen", "dolfinx", "ufl", "tmc_vem.energy"),
    "tmc_vem.vem": ("dolfinx", "ufl"),
    "tmc_vem.fem": ("tmc_vem.vem",),
    "tmc_vem.solve": ("dolfinx", "ufl", "codegen", "tmc_vem.vem", "tmc_vem.fem", "tmc_vem.mesh"),
    "tmc_vem.problems": (*PETSC, "mpi4py", "dolfinx", "ufl", "tmc_vem.vem", "tmc_vem.fem", "tmc_vem.solve"),
    "tmc_vem.report": (*PETSC, "mpi4py", "dolfinx", "ufl", "tmc_vem.vem", "tmc_vem.fem", "tmc_vem.solve"),
}
FEM_LIBRARIES = ("dolfinx", "ufl", "basix", "ffcx", "tmc_vem.fem.compat")


def modules() -> dict[str, Path]:
    """All modules by name; packages are called ``package.__init__``."""
    files = [file for package in ("codegen", "tmc_vem") for file in sorted((ROOT / package).rglob("*.py"))]
    return {file.relative_to(ROOT).with_suffix("").as_posix().replace("/", "."): file for file in files}


def for_types_only(tree: ast.Module) -> set[int]:
    """Nodes below ``if TYPE_CHECKING``."""
    tests = [node for node in ast.walk(tree) if isinstance(node, ast.If)]
    return {
        id(inner) for node in tests if "TYPE_CHECKING" in ast.unparse(node.test) for inner in ast.walk(node)
    }  # fmt: skip


def imported(text: str) -> Iterator[str]:
    """Names of all modules that a file imports, wherever in the file; those for type checkers only do not count."""
    tree = ast.parse(text)
    skipped = for_types_only(tree)
    for node in ast.walk(tree):
        if id(node) in skipped:
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            assert not node.level, "imports name the whole path"
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def graph(sources: Mapping[str, str]) -> dict[str, set[str]]:
    """Modules of ours that each module imports; a package counts only where it is named itself."""

    def ours(name: str) -> str | None:
        return next((known for known in (name, f"{name}.__init__") if known in sources), None)

    found: dict[str, set[str]] = {}
    for module, text in sources.items():
        names = list(imported(text))
        # ``from package import module`` names the package as well, whose __init__ says nothing then
        packages = {name.rpartition(".")[0] for name in names if ours(name) == name}
        targets = {ours(name) for name in names if name not in packages or ours(name) == name}
        found[module] = {target for target in targets if target and target != module}
    return found


def layer(module: str) -> int:
    """Number of the layer of a module.

    Raises:
        LookupError: it has none.
    """
    name = module.removesuffix(".__init__") if module != "tmc_vem.__init__" else module
    places = [place for place in LAYERS if name == place or name.startswith(f"{place}.")]
    if not places:
        raise LookupError(f"{module} has no place: give it one in LAYERS, or move it to a package that has one")
    return LAYERS.index(max(places, key=len))


def upwards(edges: Mapping[str, set[str]]) -> list[str]:
    """Imports that go up."""
    return [f"{a} imports {b}" for a, targets in edges.items() for b in sorted(targets) if layer(b) > layer(a)]


def circles(edges: Mapping[str, set[str]]) -> list[str]:
    """Modules that import each other, by whatever way round."""
    left = {module: set(targets) for module, targets in edges.items()}
    while left:
        free = {module for module, targets in left.items() if not targets & left.keys()}
        if not free:
            break
        left = {module: targets for module, targets in left.items() if module not in free}
    return sorted(left)


SOURCES = {name: path.read_text() for name, path in modules().items()}
EDGES = graph(SOURCES)


def test_every_module_has_a_place() -> None:
    for module in SOURCES:
        layer(module)
    for place in LAYERS:
        assert any(module == place or module.startswith(f"{place}.") for module in SOURCES), place


def test_imports_go_downwards() -> None:
    assert upwards(EDGES) == []


def test_nothing_imports_itself_round_about() -> None:
    """What is left after all that leads to no circle is taken away is in one, or above one."""
    assert circles(EDGES) == []


@pytest.mark.parametrize("place", FORBIDDEN)
def test_seams(place: str) -> None:
    wrong = [
        f"{module} imports {name}"
        for module, text in SOURCES.items()
        if f"{module}.".startswith(f"{place}.")
        for name in imported(text)
        if any(name == banned or name.startswith(f"{banned}.") for banned in FORBIDDEN[place])
    ]
    assert not wrong, "\n".join(wrong)


def test_fem_has_only_what_needs_dolfinx() -> None:
    """``jit_lock`` and ``plain_library`` see to FFCx's cache and compiler, for ``compat`` alone."""
    others = {f"tmc_vem.fem.{name}" for name in ("__init__", "jit_lock", "plain_library")}
    for module, text in SOURCES.items():
        if module.startswith("tmc_vem.fem.") and module not in others:
            assert any(name.startswith(FEM_LIBRARIES) for name in imported(text)), module


def test_the_test_sees_faults() -> None:
    sources = {
        "tmc_vem.support.a": "from tmc_vem.mesh import b\nif TYPE_CHECKING:\n    import tmc_vem.cli.c\n",
        "tmc_vem.mesh.b": "def f():\n    from tmc_vem.mesh.d import x\n",
        "tmc_vem.mesh.d": "import tmc_vem.mesh.b\n",
        "tmc_vem.cli.c": "from tmc_vem.support import a\n",
    }
    edges = graph(sources)
    assert edges["tmc_vem.cli.c"] == {"tmc_vem.support.a"}
    assert upwards(edges) == ["tmc_vem.support.a imports tmc_vem.mesh.b"]
    assert {"tmc_vem.mesh.b", "tmc_vem.mesh.d"} <= set(circles(edges))
    with pytest.raises(LookupError, match="has no place"):
        layer("tmc_vem.new")
