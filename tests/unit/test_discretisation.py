"""One protocol for both discretisations: what they offer is what it says, and what is above them uses nothing else."""

from __future__ import annotations

import ast
import inspect
from pathlib import Path
from typing import Any

import pytest
from mpi4py import MPI

from tmc_vem.fem.system import FemSystem
from tmc_vem.support import distributed
from tmc_vem.support.petsc import PETSc
from tmc_vem.system.discretisation import Discretisation
from tmc_vem.vem.system import VemSystem

PACKAGE = Path(__file__).parents[2] / "tmc_vem"
CLASSES = (VemSystem, FemSystem)
# where systems are made, and below
NOT_ABOVE = ("vem", "fem", "mesh", "energy", "support", "problems")
CALLED = ("system", "_system")  # what a discretisation is called there


def members(protocol: type) -> dict[str, Any]:
    """Methods and properties of a protocol, those of its bases included."""
    found: dict[str, Any] = {}
    for base in reversed(protocol.__mro__):
        if getattr(base, "_is_protocol", False):
            found |= {name: value for name, value in vars(base).items() if not name.startswith("_")}
    return found


def attributes(protocol: type) -> dict[str, str]:
    """Annotations of a protocol's attributes."""
    return {name: kind for base in protocol.__mro__ for name, kind in vars(base).get("__annotations__", {}).items()}


def signature(member: Any) -> list[tuple[str, str, Any]]:
    """Names, annotations and defaults of the parameters of a method or property, and what it returns."""
    function = member.fget if isinstance(member, property) else member
    shape = inspect.signature(function)
    parameters = [(p.name, p.annotation, p.default) for p in shape.parameters.values()]
    return [*parameters[1:], ("return", shape.return_annotation, None)]


@pytest.mark.parametrize("system", CLASSES)
def test_both_discretisations_have_the_members_of_the_protocol(system: type) -> None:
    missing = [name for name in members(Discretisation) if not hasattr(system, name)]
    assert not missing
    for name, member in members(Discretisation).items():
        own = getattr(system, name)
        assert isinstance(own, property) == isinstance(member, property), name
        assert signature(own) == signature(member), name
        assert inspect.getdoc(own), name


@pytest.mark.parametrize("system", CLASSES)
def test_both_discretisations_set_the_attributes_of_the_protocol(system: Any) -> None:
    tree = ast.parse(inspect.getsource(inspect.getmodule(system)))
    made = {
        target.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Assign)
        for target in node.targets
        if isinstance(target, ast.Attribute)
    }
    assert attributes(Discretisation).keys() == {"comm", "size"}
    assert attributes(Discretisation).keys() <= made


def used(path: Path) -> set[str]:
    """Attributes of discretisations that a file uses."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Attribute):
            owner = node.value
            name = owner.id if isinstance(owner, ast.Name) else owner.attr if isinstance(owner, ast.Attribute) else ""
            if name in CALLED:
                found.add(node.attr)
    return found


def test_what_is_above_uses_the_protocol_only() -> None:
    offered = members(Discretisation).keys() | attributes(Discretisation).keys()
    files = [path for path in PACKAGE.rglob("*.py") if path.relative_to(PACKAGE).parts[0] not in NOT_ABOVE]
    by_file = {path: used(path) for path in files}
    assert len([path for path in files if by_file[path]]) >= 8  # the search has found something
    wrong = [f"{path.relative_to(PACKAGE)}: {', '.join(names - offered)}" for path, names in by_file.items()
             if names - offered]  # fmt: skip
    assert not wrong
    # and there is nothing in it that nobody asks for
    assert offered - set().union(*by_file.values()) == set()


@pytest.mark.parametrize(
    ("protocol", "stands_for"),
    [
        (distributed.Vec, PETSc.Vec),
        (distributed.Mat, PETSc.Mat),
        (distributed.Ksp, PETSc.KSP),
        (distributed.Pc, PETSc.PC),
        (distributed.Comm, MPI.Intracomm),
        (distributed.Request, MPI.Request),
    ],
)
def test_the_types_of_distributed_objects_are_those_of_the_libraries(protocol: type, stands_for: type) -> None:
    assert members(protocol)
    for name, member in members(protocol).items():
        assert hasattr(stands_for, name), name
        said = getattr(stands_for, name).__doc__ or ""
        if isinstance(member, property) or f"{name}(" not in said:
            continue
        taken = said[said.index("(") + 1 : said.index(")")].split(",")
        wanted = [p for p in inspect.signature(member).parameters.values() if p.default is p.empty]
        assert len(wanted) <= len(taken), name
