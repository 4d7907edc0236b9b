"""Faults in Python: what may stand in the place of a node of the syntax tree. The rest of the file stays as it is."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from itertools import accumulate, pairwise

from mutation.c_sites import stretches
from mutation.constants import changed_number, changed_string, is_key
from mutation.python_walk import COSMETIC, Scope, called, says_nothing, visited
from mutation.site import Site
from mutation.swaps import ARITHMETIC, BUILTINS, COMMUTATIVE, COMPARISONS, NAMES

UNDROPPED = {*COSMETIC, "dtype"}  # a type, which is numpy's own choice mostly
Stretch = tuple[int, int, tuple[str, ...], str]  # start, end, options, operator


def python_sites(file: str, text: str) -> Iterator[Site]:
    """All sites of a Python source."""
    source = Source(text)
    words = "/report/" in file or "/cli/" in file
    for node, scope in visited(ast.parse(text)):
        for start, end, options, operator in _faults(source, node, scope, words):
            kept = tuple(option for option in options if option != text[start:end])
            if kept:
                yield Site(file, start, end, kept, operator)


class Source:
    """A text with the places of its nodes; the syntax tree counts bytes."""

    def __init__(self, text: str) -> None:
        self.text = text
        self._lines = text.splitlines(keepends=True)
        self._starts = [0, *accumulate(map(len, self._lines))]

    def _place(self, line: int, column: int) -> int:
        return self._starts[line - 1] + len(self._lines[line - 1].encode()[:column].decode())

    def span(self, node: ast.expr | ast.stmt | ast.keyword) -> tuple[int, int]:
        """Start and end of a node."""
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        return self._place(node.lineno, node.col_offset), self._place(node.end_lineno, node.end_col_offset)

    def of(self, node: ast.expr | ast.stmt | ast.keyword) -> str:
        """Text of a node."""
        start, end = self.span(node)
        return self.text[start:end]

    def between(self, before: ast.expr, after: ast.expr, word: str) -> tuple[int, int] | None:
        """Where an operator stands between two operands."""
        start, end = self.span(before)[1], self.span(after)[0]
        found = re.search(re.escape(word) if not word[0].isalpha() else rf"\b{word}\b", self.text[start:end])
        if not found or "#" in self.text[start:end]:
            return None
        return start + found.start(), start + found.end()


def _faults(source: Source, node: ast.AST, scope: Scope, words: bool) -> Iterator[Stretch]:
    """Faults at one node; ``words``: strings are mostly for people here."""
    match node:
        case ast.BinOp() | ast.Compare() | ast.BoolOp() | ast.UnaryOp() | ast.AugAssign():
            yield from _operators(source, node)
        case ast.Constant():
            yield from _constants(source, node, scope, words)
        case ast.Name(ctx=ast.Load()) | ast.Attribute(ctx=ast.Load()):
            yield from _names(source, node, scope)
        case ast.Call():
            yield from _calls(source, node)
        case ast.Subscript(slice=index, ctx=ast.Load()):
            yield from _slices(source, index)
    match node:
        case ast.Assign() | ast.AugAssign() | ast.Expr() | ast.Return() | ast.If() | ast.IfExp() | ast.Continue():
            yield from _statements(source, node, scope)
        case ast.comprehension(ifs=[*conditions]):
            for condition in conditions:
                yield (*source.span(condition), ("True",), "filter dropped")


def _operators(
    source: Source, node: ast.BinOp | ast.Compare | ast.BoolOp | ast.UnaryOp | ast.AugAssign
) -> Iterator[Stretch]:
    match node:
        case ast.BinOp(left=left, op=op, right=right):
            sequences = (ast.JoinedStr, ast.List, ast.Tuple, ast.Dict, ast.ListComp)
            joins = any(isinstance(each, sequences) or _is_string(each) for each in (left, right))
            if type(op) in ARITHMETIC and not joins:
                word, options = ARITHMETIC[type(op)]
                if place := source.between(left, right, word):
                    yield (*place, options, "arithmetic")
        case ast.Compare(left=left, ops=ops, comparators=comparators):
            for (before, after), sign in zip(pairwise([left, *comparators]), ops, strict=True):
                word, options = COMPARISONS[type(sign)]
                if place := source.between(before, after, word):
                    yield (*place, options, "comparison")
        case ast.BoolOp(op=op, values=values):
            word, other = ("and", "or") if isinstance(op, ast.And) else ("or", "and")
            for before, after in pairwise(values):
                if place := source.between(before, after, word):
                    yield (*place, (other,), "and/or")
        case ast.UnaryOp(op=ast.Not() | ast.USub() as op):
            start, end = source.span(node)
            text = source.text[start:end].removeprefix("not" if isinstance(op, ast.Not) else "-").lstrip()
            yield start, end, (text,), "not dropped" if isinstance(op, ast.Not) else "sign"
        case ast.AugAssign(target=target, op=op, value=value) if type(op) in ARITHMETIC:
            word, options = ARITHMETIC[type(op)]
            if place := source.between(target, value, f"{word}="):
                yield (*place, tuple(f"{option}=" for option in options), "arithmetic")


def _is_string(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


def _constants(source: Source, node: ast.Constant, scope: Scope, words: bool) -> Iterator[Stretch]:
    start, end = source.span(node)
    text, parent = source.text[start:end], scope.parent
    if isinstance(node.value, bool):
        yield start, end, (str(not node.value),), "True/False"
    elif isinstance(node.value, int) and isinstance(parent, ast.keyword) and parent.arg == "axis":
        yield start, end, ("1" if node.value == 0 else "0",), "axis"
    elif isinstance(node.value, int | float):
        yield start, end, changed_number(text), "number"
    elif isinstance(node.value, str) and ("\n" in text and (";" in text or "{" in text)):
        yield from ((start + a, start + b, options, f"C, {operator}") for a, b, options, operator in stretches(text))
    elif isinstance(node.value, str) and is_key(node, parent, words):
        yield start, end, changed_string(text), "string"


def _names(source: Source, node: ast.Name | ast.Attribute, scope: Scope) -> Iterator[Stretch]:
    start, end = source.span(node)
    name = node.id if isinstance(node, ast.Name) else node.attr
    begin = end - len(name)
    if name in NAMES and (isinstance(node, ast.Attribute) or name in BUILTINS):
        yield begin, end, (NAMES[name],), "name"
    if isinstance(node, ast.Name) and name in scope.siblings:
        yield start, end, (scope.siblings[name],), "sibling"
    if isinstance(node, ast.Attribute):
        if isinstance(node.value, ast.Name) and node.value.id == "self" and name in scope.fields:
            yield begin, end, (scope.fields[name],), "sibling"
        if name == "T":
            yield start, end, (source.of(node.value),), "transposition dropped"


def _calls(source: Source, node: ast.Call) -> Iterator[Stretch]:
    plain = [each for each in node.args if not isinstance(each, ast.Starred)]
    if called(node) not in COMMUTATIVE and len(plain) == len(node.args):
        for first, second in pairwise(plain):
            if type(first) is type(second):  # others are of different types, which any test sees
                (a, b), (c, d) = source.span(first), source.span(second)
                yield a, d, (source.text[c:d] + source.text[b:c] + source.text[a:b],), "swapped arguments"
    given: list[ast.expr | ast.keyword] = sorted([*node.args, *node.keywords], key=lambda each: source.span(each)[0])
    for n, each in enumerate(given):
        if not isinstance(each, ast.keyword) or each.arg is None or each.arg in UNDROPPED or called(node) == "field":
            continue
        start, end = source.span(each)
        if n:
            start = source.span(given[n - 1])[1]
            opening = source.text[start : source.span(each)[0]]
            if ")" in opening:  # of a parenthesis around the argument before
                continue
        elif len(given) > 1:
            end = source.span(given[1])[0]
        yield start, end, ("",), "keyword dropped"


def _slices(source: Source, index: ast.expr) -> Iterator[Stretch]:
    for each in index.elts if isinstance(index, ast.Tuple) else [index]:
        if not isinstance(each, ast.Slice):
            continue
        if source.of(each) == "::-1":
            yield (*source.span(each), (":",), "slice")
        for bound in (each.lower, each.upper):
            if bound is not None and not isinstance(bound, ast.Constant | ast.UnaryOp):
                yield (*source.span(bound), (f"{source.of(bound)} + 1", f"{source.of(bound)} - 1"), "slice")


def _statements(source: Source, node: ast.AST, scope: Scope) -> Iterator[Stretch]:
    match node:
        case ast.Assign(targets=[ast.Tuple(elts=[ast.Name() as first, ast.Name() as second])]):
            yield from _swapped(source, first, second)
        case ast.Return(value=ast.Tuple(elts=[first, second, *_])):
            yield from _swapped(source, first, second)
        case ast.Assign(targets=[ast.Attribute() | ast.Subscript()]) | ast.AugAssign():
            yield (*source.span(node), ("pass",), "statement deleted")
        case ast.Assign(targets=[ast.Name(id=name)]) if name in scope.bound:
            yield (*source.span(node), ("pass",), "statement deleted")
        case ast.Expr(value=ast.Call() as call) if not says_nothing(call):
            yield (*source.span(node), ("pass",), "statement deleted")
        case ast.If(test=test, body=body):
            leaves = isinstance(body[-1], ast.Raise | ast.Return | ast.Continue | ast.Break)
            other = ("False",) if leaves else (f"not ({source.of(test)})",)
            yield (*source.span(test), other, "guard" if leaves else "condition")
        case ast.IfExp(test=test):
            yield (*source.span(test), (f"not ({source.of(test)})",), "condition")
        case ast.Continue():
            yield (*source.span(node), ("break",), "continue")


def _swapped(source: Source, first: ast.expr, second: ast.expr) -> Iterator[Stretch]:
    (a, b), (c, d) = source.span(first), source.span(second)
    if not isinstance(first, ast.Starred) and not isinstance(second, ast.Starred):
        yield a, d, (source.text[c:d] + source.text[b:c] + source.text[a:b],), "swapped"
