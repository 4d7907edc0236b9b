"""Where the lines of a source are: in which statement and function, and under which names."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from functools import cache
from pathlib import Path


@dataclass(frozen=True)
class Places:
    """Statements and functions of a source by line."""

    tree: ast.Module
    inside: frozenset[int]

    @classmethod
    @cache
    def of(cls, path: Path) -> Places:
        return cls(ast.parse(path.read_text()), in_functions(path))

    def statement(self, number: int) -> range:
        """Lines of the smallest statement, without what is below it."""
        found = range(number, number + 1)
        for node in ast.walk(self.tree):
            if isinstance(node, ast.stmt) and node.end_lineno and node.lineno <= number <= node.end_lineno:
                body = getattr(node, "body", None)
                end = body[0].lineno if body and body[0].lineno > node.lineno else node.end_lineno + 1
                found = range(node.lineno, max(end, number + 1))
        return found

    def names(self, number: int) -> set[str]:
        """What the statement of a line outside functions gives a value, class and field names included."""
        found: set[str] = set()
        for node in ast.walk(self.tree):
            if not isinstance(node, ast.stmt) or not node.end_lineno or not node.lineno <= number <= node.end_lineno:
                continue
            targets = [node.target] if isinstance(node, ast.AnnAssign) else getattr(node, "targets", [])
            named = {each.id for target in targets for each in ast.walk(target) if isinstance(each, ast.Name)}
            if named:
                found = named
        return found

    def function(self, number: int) -> range:
        """Lines of the body of the function whose head, default values or decorators have a line."""
        for node in ast.walk(self.tree):
            if isinstance(node, ast.FunctionDef) and node.end_lineno:
                first = min([node.lineno, *(each.lineno for each in node.decorator_list)])
                if first <= number < node.body[0].lineno:
                    return range(node.body[0].lineno, node.end_lineno + 1)
        return range(0)


@cache
def in_functions(path: Path) -> frozenset[int]:
    """Lines of the bodies of functions: they are executed when these are called, others when the module is imported."""
    return frozenset(
        number
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.FunctionDef) and node.end_lineno
        for number in range(node.body[0].lineno, node.end_lineno + 1)
    )


@cache
def lines_of(path: Path) -> list[str]:
    return path.read_text().splitlines()


@cache
def words_of_tests(path: Path) -> dict[str, frozenset[str]]:
    """Names and attributes that each test function of a file mentions."""
    return {
        function.name: frozenset(
            each.id if isinstance(each, ast.Name) else each.attr
            for each in ast.walk(function)
            if isinstance(each, ast.Name | ast.Attribute)
        )
        for function in ast.walk(ast.parse(path.read_text()))
        if isinstance(function, ast.FunctionDef)
    }
