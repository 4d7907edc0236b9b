"""Which files a module depends on: those it imports, directly or not, as the text of the imports says."""

from __future__ import annotations

import ast
import hashlib
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from tmc_vem.support.errors import InputError

START = time.time()  # what is imported later is what is on disk later
ROOT = Path(__file__).resolve().parents[2]
PLACES = (ROOT, ROOT / "benchmarks", ROOT / "tests", ROOT / "tests" / "fem", ROOT / "tests" / "unit", ROOT / "demos")
NO_MODULES = (".c", ".h", ".petsc", ".csv", ".toml")  # read by modules of the same package


def digest(path: Path) -> str:
    """Hash of all files that a module depends on; comments, docstrings and line breaks in Python do not count.

    Raises:
        InputError: one has changed since this process started, which may have imported it before.
    """
    found = hashlib.sha256()
    for file in sorted(dependencies(path)):
        if file.stat().st_mtime > START:
            raise InputError(f"{file.relative_to(ROOT)} has changed since the refresh began: begin again")
        found.update(f"{file.relative_to(ROOT)}\0{_content(file)}\0".encode())
    return found.hexdigest()


def dependencies(path: Path) -> set[Path]:
    """The module's file, those of all modules that it imports, and what lies beside them.

    Imports of names that a package only loads when they are used stand in its ``__init__.py`` for type checkers, and
    are followed there. What a module imports only as a script is not.
    """
    followed: set[Path] = set()
    beside: set[Path] = set()  # run, or read, on the way to a module: the imports in there are those of other names
    todo = [path.resolve()]
    while todo:
        file = todo.pop()
        if file in followed:
            continue
        followed.add(file)
        todo += _imported(file)
        beside.update(p for p in file.parent.rglob("*") if p.suffix in NO_MODULES)
        parents = (parent for parent in file.parents if ROOT in parent.parents)
        beside.update(init for parent in parents if (init := parent / "__init__.py").exists())
    return followed | beside


@cache
def _content(file: Path) -> str:
    if file.suffix != ".py":
        return file.read_text()
    tree = ast.parse(file.read_text())
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
            and ast.get_docstring(node, clean=False) is not None
        ):
            node.body = node.body[1:] or [ast.Pass()]
    return ast.dump(tree)


@cache
def _imported(file: Path) -> tuple[Path, ...]:
    return tuple(path for name in _names(ast.parse(file.read_text())) if (path := _file(name)))


def _names(tree: ast.AST) -> Iterator[str]:
    todo = [tree]
    while todo:
        node = todo.pop()
        if isinstance(node, ast.If) and ast.unparse(node.test) == "__name__ == '__main__'":
            continue
        todo += ast.iter_child_nodes(node)
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


@cache
def _file(name: str) -> Path | None:
    for place in PLACES:
        path = place.joinpath(*name.split("."))
        for candidate in (path.with_suffix(".py"), path / "__init__.py"):
            if candidate.exists():
                return candidate
    return None
