"""Which nodes of a syntax tree decide what a program does: not words for people, types, nor the look of pictures."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace

# Calls whose arguments are words for people, or the look of a picture or table.
_WORDS = re.compile(
    r"(.*(Error|Exception|Warning|Exit)|BadParameter|print|echo|secho|warn|warning|info|debug|error|exception|critical|log"
    r"|TypeVar|NewType|isinstance|issubclass|getattr|hasattr|add_column|add_row|set_(title|xlabel|ylabel|linewidth|antialiased)"
    r"|Text|Panel|Progress|Console|get_cmap|isEnabledFor|getLogger|destroy|close|overload|Literal)"
)
COSMETIC = {
    "help", "metavar", "short_help", "epilog", "prog_name", "show_default", "hidden", "context_settings", "style",
    "color", "colour", "colours", "colors", "cmap", "linewidth", "linestyle", "lw", "ls", "marker", "markersize",
    "fontsize", "font", "figsize", "dpi", "ha", "va", "loc", "pad", "zorder", "title", "caption", "label",
    "xlabel", "ylabel", "justify", "no_wrap", "box", "show_header", "show_edge", "padding", "console", "transient",
    "bbox_inches", "frameon", "optimize",
    # of no effect on what is computed here, or a guard of Python's own
    "encoding", "strict", "copy", "check", "text", "capture_output", "errors", "frozen", "slots", "kw_only",
    "repr", "eq", "order", "daemon", "stacklevel", "exist_ok",
}  # fmt: skip
_TYPES_ONLY = {"Protocol", "TypedDict", "NamedTuple"}
_ALIAS = re.compile(r"_?[A-Z][a-z]\w*")


@dataclass(frozen=True)
class Scope:
    """What is known where a node stands.

    Attributes:
        siblings: another parameter of the same type, by name.
        fields: another field of the same type, by name, for ``self``.
        bound: names that have a value before the present statement.
        parent: the node above.
    """

    siblings: Mapping[str, str] = field(default_factory=dict)
    fields: Mapping[str, str] = field(default_factory=dict)
    bound: frozenset[str] = frozenset()
    parent: ast.AST | None = None


def visited(tree: ast.Module) -> Iterator[tuple[ast.AST, Scope]]:
    """All nodes that decide something, each with its scope."""
    yield from _visit(tree, Scope())


def called(node: ast.AST) -> str:
    """Last name of what is called; empty if this is no call."""
    function = node.func if isinstance(node, ast.Call) else None
    if isinstance(function, ast.Attribute):
        return function.attr
    return function.id if isinstance(function, ast.Name) else ""


def _visit(node: ast.AST, scope: Scope) -> Iterator[tuple[ast.AST, Scope]]:
    if says_nothing(node):
        return
    yield node, scope
    inside = replace(_inner(node, scope), parent=node)
    for child in _children(node):
        yield from _visit(child, inside)
        if isinstance(node, ast.FunctionDef) and isinstance(child, ast.stmt):
            inside = replace(inside, bound=inside.bound | _stored(child))


def says_nothing(node: ast.AST) -> bool:
    """Whether nothing that is computed depends on it."""
    match node:
        case ast.Raise() | ast.JoinedStr() | ast.Assert() | ast.Import() | ast.ImportFrom() | ast.Global():
            return True
        case ast.Expr(value=ast.Constant()):
            return True
        case ast.Call():
            return _WORDS.fullmatch(called(node)) is not None
        case ast.If(test=test):
            return any(name in ast.unparse(test) for name in ("TYPE_CHECKING", "__name__"))
        case ast.keyword(arg=name):
            return name in COSMETIC
        case ast.Assign(targets=[ast.Name(id=name)]):
            return name in ("__all__", "logger") or _ALIAS.fullmatch(name) is not None
        case ast.ClassDef(bases=bases):
            return any(ast.unparse(base).split(".")[-1].split("[")[0] in _TYPES_ONLY for base in bases)
        case ast.FunctionDef(decorator_list=decorators):
            return any(ast.unparse(decorator).endswith("overload") for decorator in decorators)
    return False


def _children(node: ast.AST) -> Iterator[ast.AST]:
    """Nodes below that may matter, in the order of the text where that is easy."""
    types = {"annotation", "returns", "type_comment", "bases", "op", "ops", "ctx", "type"}
    for name, value in ast.iter_fields(node):
        if name in types:
            continue
        if name == "decorator_list":
            value = [each for each in value if called(each) != "dataclass"]
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield child


def _inner(node: ast.AST, scope: Scope) -> Scope:
    """The scope inside a node."""
    if isinstance(node, ast.FunctionDef):
        arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
        typed = [(each.arg, ast.unparse(each.annotation)) for each in arguments if each.annotation]
        return replace(scope, siblings=_next_of_type(typed), bound=frozenset(each.arg for each in arguments))
    if isinstance(node, ast.ClassDef):
        declared = [
            (each.target.id, ast.unparse(each.annotation))
            for each in node.body
            if isinstance(each, ast.AnnAssign) and isinstance(each.target, ast.Name)
        ]
        return Scope(fields=_next_of_type(declared))
    return scope


def _next_of_type(typed: Iterable[tuple[str, str]]) -> dict[str, str]:
    """For every name the next one of the same type, round about."""
    groups: dict[str, list[str]] = defaultdict(list)
    for name, annotation in typed:
        groups[annotation].append(name)
    return {
        name: group[(n + 1) % len(group)] for group in groups.values() if len(group) > 1 for n, name in enumerate(group)
    }


def _stored(statement: ast.stmt) -> set[str]:
    """Names that get a value in a statement."""
    return {each.id for each in ast.walk(statement) if isinstance(each, ast.Name) and isinstance(each.ctx, ast.Store)}
