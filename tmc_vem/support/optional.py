"""Packages that only some commands need: what for, whether they work here, and which command brings them."""

from __future__ import annotations

import importlib
import importlib.util
import re
import sysconfig
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tmc_vem.support.errors import InputError


@dataclass(frozen=True)
class Package:
    """A package that may be missing.

    Attributes:
        purpose: what needs it.
        install: the command that brings it.
        libraries: the command that brings the system's libraries which its wheel is linked with, if there are any.
    """

    purpose: str
    install: str
    libraries: str = ""


PACKAGES = {
    "dolfinx": Package(
        "--method fem", "pip install 'tmc-vem[wheels]' (Python 3.12 or newer) or apt-get install python3-dolfinx-real"
    ),
    "gmsh": Package(
        "triangles and quadrilaterals of any outline, .geo files",
        "pip install gmsh or apt-get install python3-gmsh",
        "apt-get install libglu1-mesa libgl1 libxcursor1 libxft2 libxinerama1 libgomp1",
    ),
    "nlopt": Package(
        "methods mma and ccsaq of designs",
        "pip install 'tmc-vem[design]' (Python 3.12 or newer) or apt-get install python3-nlopt",
    ),
    "pandas": Package("RunResult.to_pandas", "pip install 'tmc-vem[analysis]'"),
    "pyvista": Package("RunResult.to_pyvista", "pip install 'tmc-vem[analysis]'"),
    "h5py": Package("meshes in MED and MATLAB 7.3", "pip install 'tmc-vem[meshes]'"),
    "netCDF4": Package("meshes in netCDF 4 and 5", "pip install 'tmc-vem[meshes]'"),
    "lz4": Package("meshes in VTK files with LZ4", "pip install 'tmc-vem[meshes]'"),
    "sphinx": Package("make docs", "pip install 'tmc-vem[docs]'"),
}


def load(name: str, need: str) -> Any:
    """A package of :data:`PACKAGES`.

    Args:
        name: the module.
        need: what it is needed for, as the beginning of a sentence: "a .geo file needs".

    Raises:
        InputError: it is missing, or a library that it is linked with is; the error names the command that helps.
    """
    try:
        return importlib.import_module(name)
    except (ImportError, OSError) as error:  # an OSError where ctypes finds no library
        reason = " ".join(str(error).split())
        raise InputError(f"{need} {name} ({reason}): {remedy(name, error)}") from None


def remedy(name: str, error: BaseException) -> str:
    """The command that helps after a package could not be imported."""
    package = PACKAGES[name]
    lacks_library = isinstance(error, OSError) or re.search(r"\.so[.\d]*: cannot open", str(error)) is not None
    return package.libraries if lacks_library and package.libraries else package.install


def state(name: str) -> str:
    """One line on a package: whether it is there and can be loaded, what for, and what to do if not."""
    package = PACKAGES[name]
    if importlib.util.find_spec(name) is None:
        return f"not installed: {package.purpose}; {package.install}"
    if package.libraries:  # only these are imported here: all of them would take seconds
        try:
            importlib.import_module(name)
        except (ImportError, OSError) as error:
            reason = " ".join(str(error).split())
            return f"does not load ({reason}): {package.purpose}; {remedy(name, error)}"
    return f"available: {package.purpose}"


def has_python_headers() -> bool:
    """Whether C extensions of this Python can be compiled."""
    return (Path(sysconfig.get_paths()["include"]) / "Python.h").exists()


def python_headers() -> str:
    """One line on Python.h: whether it is there, and what is done without it."""
    if has_python_headers():
        return "available: forms of finite elements are compiled as dolfinx does it"
    return (
        "not installed: finite elements do without it here, dolfinx in your own scripts does not; "
        "apt-get install python3-dev"
    )
