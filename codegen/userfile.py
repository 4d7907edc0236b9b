"""Find an energy by name: ``my_energy.py:bending`` or ``package.module:bending``."""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import importlib.util
import inspect
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from codegen.declare import Declaration, declaration
from codegen.errors import CodegenError
from codegen.integrand import LAYOUT, Integrand, second_gradient_energy

ARGUMENTS = (*(entry.name for entry in LAYOUT.inputs), "p", "m")
SIGNATURE = f"({', '.join(ARGUMENTS)})"


@dataclass(frozen=True)
class LoadedDensity:
    """A density found by name.

    Attributes:
        function: ``density(F, G, p, m) -> scalar``.
        name: its name, for messages and generated code.
        parameters: declared parameter names in order, with default values or None.
        declared: everything that was stated about it.
        description: first line of its docstring, or the description of the object it came from.
    """

    function: Callable[[Any, Any, Any, Any], Any]
    name: str
    parameters: dict[str, float | None]
    declared: Declaration
    description: str = ""

    @property
    def integrand(self) -> Integrand:
        """What it is for the generator."""
        return second_gradient_energy(self.function, self.name, self.parameters, self.description)

    def with_values(self, values: Mapping[str, float]) -> LoadedDensity:
        """The same with parameter values; names that were not declared are added in the order given.

        Raises:
            CodegenError: parameters were declared and a name is not among them.
        """
        unknown = [name for name in values if name not in self.parameters]
        if unknown and self.parameters:
            known = ", ".join(self.parameters)
            raise CodegenError(f"energy '{self.name}' has no parameter '{unknown[0]}': its parameters are {known}")
        merged = {**self.parameters, **{name: float(value) for name, value in values.items()}}
        return LoadedDensity(self.function, self.name, merged, self.declared, self.description)


def load_density(target: str) -> LoadedDensity:
    """The density named by ``FILE.py:FUNCTION`` or ``package.module:FUNCTION``.

    The name may also stand for an object with the attributes ``density``, ``name`` and ``parameters``.

    Raises:
        CodegenError: the file or the function does not exist, the file does not run, or the name is not a function of
            ``(F, G, p, m)``.
    """
    place, separator, attribute = target.rpartition(":")
    if not separator or not place or not attribute:
        raise CodegenError(f"'{target}' names no energy: write FILE.py:FUNCTION or package.module:FUNCTION")
    module = _module_from_file(Path(place)) if place.endswith(".py") else _module_by_name(place)
    try:
        found = getattr(module, attribute)
    except AttributeError:
        names = [name for name in dir(module) if not name.startswith("_") and _is_energy(module, name)]
        there = f"it has {', '.join(names)}" if names else "it has no functions"
        raise CodegenError(f"{place} has no '{attribute}'; {there}") from None
    return as_density(found, attribute, f"{place}: ")


def as_density(found: Any, name: str = "", place: str = "") -> LoadedDensity:
    """A density from a function, or from an object with the attributes ``density``, ``name`` and ``parameters``.

    Args:
        found: the function or object.
        name: what to call it; its own name if empty.
        place: where it was found, put before error messages.

    Raises:
        CodegenError: it is not a function of ``(F, G, p, m)``.
    """
    name = name or str(getattr(found, "__name__", getattr(found, "name", "energy")))
    function, description = found, ""
    parameters: dict[str, float | None] = {}
    if hasattr(found, "density") and hasattr(found, "parameters"):
        function = found.density
        name, description = str(getattr(found, "name", name)), str(getattr(found, "description", ""))
        parameters = dict.fromkeys(found.parameters)
    if not callable(function):
        raise CodegenError(f"{place}'{name}' is of type {type(function).__name__}, not a function {name}{SIGNATURE}")
    with contextlib.suppress(ValueError):  # builtins have no signature to look at
        signature = inspect.signature(function)
        try:
            signature.bind(*ARGUMENTS)
        except TypeError:
            raise CodegenError(f"{place}'{name}{signature}' does not take {SIGNATURE}; give it these four") from None
    declared = declaration(function, name)
    parameters.update(declared.parameters)
    description = description or (inspect.getdoc(function) or "").partition("\n")[0]
    return LoadedDensity(function, name, parameters, declared, description)


def _is_energy(module: ModuleType, name: str) -> bool:
    value = getattr(module, name)
    is_own_function = inspect.isfunction(value) and value.__module__ == module.__name__
    return is_own_function or (hasattr(value, "density") and not inspect.isclass(value))


def _module_from_file(path: Path) -> ModuleType:
    if not path.is_file():
        raise CodegenError(
            f"there is no file {path} in {Path.cwd()}" if not path.is_absolute() else f"there is no file {path}"
        )
    name = "energies_" + hashlib.sha256(str(path.resolve()).encode()).hexdigest()[:16]
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise CodegenError(f"{path} is not a Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    with _errors_in(path), _searched_first(path.resolve().parent):
        spec.loader.exec_module(module)
    return module


def _module_by_name(name: str) -> ModuleType:
    with _searched_first(Path.cwd()):
        try:
            if importlib.util.find_spec(name) is None:
                raise ModuleNotFoundError(name)
        except (ImportError, ValueError):
            raise CodegenError(f"there is no module '{name}'; a file is written FILE.py:FUNCTION") from None
        with _errors_in(name):
            return importlib.import_module(name)


@contextlib.contextmanager
def _errors_in(place: Path | str) -> Iterator[None]:
    """Turn whatever the user's file raises into one line."""
    try:
        yield
    except CodegenError:
        raise
    except SyntaxError as error:
        raise CodegenError(f"{error.filename or place}, line {error.lineno}: {error.msg}") from error
    except Exception as error:
        raise CodegenError(f"{place} does not run: {type(error).__name__}: {error}") from error


@contextlib.contextmanager
def _searched_first(directory: Path) -> Iterator[None]:
    """Let a file import its neighbours."""
    sys.path.insert(0, str(directory))
    try:
        yield
    finally:
        with contextlib.suppress(ValueError):
            sys.path.remove(str(directory))
